//! What the kernel says about reading: page faults, bytes fetched from storage, memory held; and how to make it forget a file.
//!
//! Linux tells all of it in files under /proc, and drops a file from memory through `posix_fadvise`. Elsewhere, and where /proc is not mounted, every answer is
//! `None`: not known. How much of a file is in memory is asked where files are mapped
//! ([`resident_bytes`](terrasoar_layout::file::source::resident_bytes)). Cost: one small
//! file read an answer, some tens of microseconds, so ask outside what is timed.

use std::path::Path;
use std::time::Duration;

/// Page faults so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Faults {
    /// Served from memory.
    pub minor: u64,
    /// Waited for storage.
    pub major: u64,
}

/// Faults of the calling thread.
pub fn thread_faults() -> Option<Faults> {
    parse_faults(&proc_file("thread-self/stat")?)
}

/// Processor time of the calling thread, in steps of a clock tick, a hundredth of a second.
#[cfg(target_os = "linux")]
pub fn thread_time() -> Option<Duration> {
    let ticks = parse_ticks(&proc_file("thread-self/stat")?)?;
    Some(Duration::from_secs_f64(ticks as f64 / rustix::param::clock_ticks_per_second() as f64))
}

/// As on Linux: here it is not known.
#[cfg(not(target_os = "linux"))]
pub fn thread_time() -> Option<Duration> {
    None
}

/// Bytes that storage delivered for this process, all threads counted.
pub fn read_bytes() -> Option<u64> {
    parse_field(&proc_file("self/io")?, "read_bytes:")
}

/// Most memory this process has held since it began or since [`reset_peak_memory`], in bytes, touched pages of mapped files included.
pub(crate) fn peak_memory_bytes() -> Option<u64> {
    Some(1024 * parse_field(&proc_file("self/status")?, "VmHWM:")?)
}

/// Starts the peak anew from what is held now; whether that worked.
pub(crate) fn reset_peak_memory() -> bool {
    cfg!(target_os = "linux") && std::fs::write("/proc/self/clear_refs", "5").is_ok()
}

/// Asks the system to drop the file's clean pages from memory, so that the next reader waits for storage; whether it can be asked. Pages that some process has mapped
/// and touched stay.
///
/// # Errors
/// The file cannot be opened, or the system refuses.
#[cfg(target_os = "linux")]
pub(crate) fn forget_file(path: &Path) -> std::io::Result<bool> {
    let file = std::fs::File::open(path)?;
    // What has not reached the disk cannot be dropped.
    file.sync_data()?;
    rustix::fs::fadvise(&file, 0, None, rustix::fs::Advice::DontNeed)?;
    Ok(true)
}

/// As on Linux: here it cannot be asked.
///
/// # Errors
/// None.
#[cfg(not(target_os = "linux"))]
pub(crate) fn forget_file(_: &Path) -> std::io::Result<bool> {
    Ok(false)
}

/// Tells the system that what is read next of the file will be anywhere: no read-ahead.
///
/// # Errors
/// The system refuses.
#[cfg(target_os = "linux")]
pub(crate) fn expect_random_reads(file: &std::fs::File) -> std::io::Result<()> {
    Ok(rustix::fs::fadvise(file, 0, None, rustix::fs::Advice::Random)?)
}

/// As on Linux: here it cannot be told.
///
/// # Errors
/// None.
#[cfg(not(target_os = "linux"))]
pub(crate) fn expect_random_reads(_: &std::fs::File) -> std::io::Result<()> {
    Ok(())
}

/// Bytes that an ordinary user may still write to the file system of `folder`; `None` where that is not known.
///
/// # Errors
/// The folder cannot be looked at.
#[cfg(target_os = "linux")]
pub(crate) fn free_bytes(folder: &Path) -> std::io::Result<Option<u64>> {
    let stat = rustix::fs::statvfs(folder)?;
    Ok(Some(stat.f_bavail * stat.f_frsize))
}

/// As on Linux: here it is not known.
///
/// # Errors
/// None.
#[cfg(not(target_os = "linux"))]
pub(crate) fn free_bytes(_: &Path) -> std::io::Result<Option<u64>> {
    Ok(None)
}

fn proc_file(name: &str) -> Option<String> {
    if cfg!(target_os = "linux") { std::fs::read_to_string(Path::new("/proc").join(name)).ok() } else { None }
}

/// Fields 14 and 15 of a `stat` line, together.
#[cfg_attr(not(target_os = "linux"), allow(dead_code, reason = "only Linux has such lines"))]
fn parse_ticks(stat: &str) -> Option<u64> {
    let mut words = stat.get(stat.rfind(')')? + 1..)?.split_ascii_whitespace().skip(11);
    let user: u64 = words.next()?.parse().ok()?;
    let system: u64 = words.next()?.parse().ok()?;
    user.checked_add(system)
}

/// Fields 10 and 12 of a `stat` line. The second is the program's name in brackets, which may hold anything.
fn parse_faults(stat: &str) -> Option<Faults> {
    let mut words = stat.get(stat.rfind(')')? + 1..)?.split_ascii_whitespace().skip(7);
    let minor = words.next()?.parse().ok()?;
    let major = words.nth(1)?.parse().ok()?;
    Some(Faults { minor, major })
}

fn parse_field(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_ascii_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_as_the_kernel_writes_them() {
        let stat = "15190 (a) b (c)) R 15183 15183 10048 0 -1 4194304 100 7 42 9 0 0 0 0 20 0 1 0 1364871";
        assert_eq!(parse_faults(stat), Some(Faults { minor: 100, major: 42 }));
        assert_eq!(parse_faults("15190 (cat) R 1"), None);
        assert_eq!(parse_faults(""), None);
        assert_eq!(parse_field("rchar: 1\nread_bytes: 4096\n", "read_bytes:"), Some(4096));
        assert_eq!(parse_field("VmHWM:\t  5120 kB\n", "VmHWM:"), Some(5120));
        assert_eq!(parse_field("VmHWM: x\n", "VmHWM:"), None);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn touching_new_memory_faults_and_raises_the_peak() {
        let (before, peak) = (thread_faults().unwrap(), peak_memory_bytes().unwrap());
        let bytes = 1 << 25;
        let block = vec![1u8; bytes];
        std::hint::black_box(&block);
        let after = thread_faults().unwrap();
        assert!(after.minor > before.minor && after.major >= before.major);
        assert!(peak_memory_bytes().unwrap() >= peak);
        assert!(peak_memory_bytes().unwrap() >= bytes as u64);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn files_are_forgotten_and_room_is_known() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f");
        std::fs::write(&path, [7; 10_000]).unwrap();
        assert!(forget_file(&path).unwrap());
        assert_eq!(std::fs::read(&path).unwrap(), [7; 10_000]);
        assert!(forget_file(&folder.path().join("none")).is_err());
        assert!(free_bytes(folder.path()).unwrap() > Some(0));
    }
}

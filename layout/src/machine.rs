//! What the machine has left: room on a disk, and memory. None where the system does not say.
//!
//! Something large is refused before it is begun, not when it fails half-way. Cost: a call, or a small file of the system's.

use std::path::Path;

/// Bytes that may still be written on the disk that holds `path`, a file or folder that is there.
pub fn free_disk_bytes(path: &Path) -> Option<u64> {
    #[cfg(unix)]
    {
        let found = rustix::fs::statvfs(path).ok()?;
        Some(found.f_bavail.saturating_mul(found.f_frsize))
    }
    #[cfg(not(unix))]
    {
        let _ = path;
        None
    }
}

/// Bytes of memory that this process may still take, what is kept on the disk in place of memory included.
pub fn free_memory_bytes() -> Option<u64> {
    let told = std::fs::read_to_string("/proc/meminfo").ok()?;
    let free = free_of(&told)?;
    // A container may have less than the machine.
    let limits = ["/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"];
    let limits = limits.iter().filter_map(|path| std::fs::read_to_string(path).ok()?.trim().parse().ok());
    Some(limits.fold(free, u64::min))
}

/// What a `meminfo` of Linux says is free.
fn free_of(meminfo: &str) -> Option<u64> {
    let kib = |name: &str| -> Option<u64> {
        let line = meminfo.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(':'))?;
        line.trim().strip_suffix(" kB")?.trim().parse().ok()
    };
    Some((kib("MemAvailable")? + kib("SwapFree").unwrap_or(0)) << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_free_is_read_where_it_is_told() {
        let told =
            "MemTotal:       24689764 kB\nMemFree:  1 kB\nMemAvailable:   23000000 kB\nSwapFree:  24 kB\n";
        assert_eq!(free_of(told), Some(23_000_024 << 10));
        assert_eq!(free_of("MemAvailable: many\n"), None);
        assert_eq!(free_of(""), None);
        if cfg!(target_os = "linux") {
            assert!(free_memory_bytes().is_some_and(|free| free > 1 << 20));
        }
        if cfg!(unix) {
            assert!(free_disk_bytes(Path::new(".")).is_some());
        }
        assert_eq!(free_disk_bytes(Path::new("no such folder")), None);
    }
}

//! A cap on the memory of what is measured, page cache included, by a Linux control group.
//!
//! The program makes a group, caps it, and runs itself again. The copy is in the group while it measures and out of it while it counts. So the cap holds for the memory that flying and
//! reading take; memory is charged to the group in which it was first touched. The first program outlives the copy, reports if the kernel ended it, and removes the group. If the
//! first program is killed, the copy ends too and removes the group. A group that is left all the same is removed by the next cap. Version 1 has `memory.limit_in_bytes`, version 2 `memory.max`. Where neither can be had, the program
//! goes on without a cap and says why.

use super::WrongUsage;
use anyhow::{Context, Result, bail};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;
use terrasoar_lab::iobench::Cap;

/// Names of our groups, before a process id.
const PREFIX: &str = "terrasoar-iobench-";

/// The hidden flag that tells the copy its group.
pub(super) const GROUP_FLAG: &str = "--cap-group";

/// How the program stands with its cap.
#[derive(Debug, Default)]
pub(super) struct Standing {
    pub(super) cap: Option<Cap>,
    /// Why it has none though one was asked for.
    pub(super) note: Option<String>,
    groups: Option<Groups>,
}

/// Where the copy is while it measures and while it does not.
#[derive(Debug)]
struct Groups {
    capped: PathBuf,
    home: PathBuf,
}

/// What came of asking for a cap.
pub(super) enum Asked {
    /// Go on, capped or not.
    GoOn(Standing),
    /// A copy ran under the cap and ended well: there is nothing left to do.
    Ran,
}

impl Standing {
    fn uncapped(why: String) -> Self {
        Self { note: Some(why), ..Self::default() }
    }

    /// Does `work` under the cap, if there is one.
    pub(super) fn within<T>(&self, work: impl FnOnce() -> Result<T>) -> Result<T> {
        let Some(Groups { capped, home }) = &self.groups else { return work() };
        enter(capped).with_context(|| format!("{}: cannot enter the control group", capped.display()))?;
        let done = work();
        enter(home).with_context(|| format!("{}: cannot leave for this control group", home.display()))?;
        done
    }
}

/// Moves this process, all threads, into a group.
fn enter(group: &Path) -> std::io::Result<()> {
    std::fs::write(group.join("cgroup.procs"), "0")
}

/// Brings the program under a cap of `mib`. `group` is what [`GROUP_FLAG`] says in the copy.
pub(super) fn ask(mib: u64, group: Option<&Path>) -> Result<Asked> {
    if let Some(path) = group {
        return Ok(Asked::GoOn(join(path, mib)?));
    }
    match Group::create(mib) {
        Ok(group) => run_in(&group, mib).map(|()| Asked::Ran),
        Err(why) => Ok(Asked::GoOn(Standing::uncapped(why.to_string()))),
    }
}

/// Finds out whether the group that the first program made can be entered and left.
fn join(capped: &Path, mib: u64) -> Result<Standing> {
    let ours = capped.file_name().and_then(|n| n.to_str()).is_some_and(|name| name.starts_with(PREFIX));
    if !ours || !capped.is_dir() {
        return Err(WrongUsage(format!(
            "{GROUP_FLAG} is for the program's own use; ask for a cap with --cap"
        ))
        .into());
    }
    let control_group_version = if capped.join("memory.limit_in_bytes").exists() { 1 } else { 2 };
    let own = std::fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    let home = parents(&own).into_iter().find(|(_, version)| *version == control_group_version);
    let Some((home, _)) = home else {
        return Ok(Standing::uncapped("this process does not find its own control group".into()));
    };
    let standing = Standing {
        cap: Some(Cap { mib, control_group_version }),
        note: None,
        groups: Some(Groups { capped: capped.into(), home }),
    };
    #[cfg(unix)]
    if let Some(Groups { capped, home }) = &standing.groups {
        end_with_parent(capped.clone(), home.clone());
    }
    Ok(standing.within(|| Ok(())).map(|()| standing).unwrap_or_else(|e| Standing::uncapped(format!("{e:#}"))))
}

/// Ends this copy soon after the program that made the group, if that is killed: nothing waits for the copy then, and nothing else would remove the group.
#[cfg(unix)]
fn end_with_parent(capped: PathBuf, home: PathBuf) {
    let parent = std::os::unix::process::parent_id();
    // Without a thread to watch, the next cap removes the group.
    let _ = std::thread::Builder::new().name("parent".into()).spawn(move || {
        while std::os::unix::process::parent_id() == parent {
            std::thread::sleep(std::time::Duration::from_millis(100));
        }
        // A group with a process in it cannot be removed.
        if enter(&home).is_ok() {
            // Removed when dropped.
            drop(Group { path: capped });
        }
        std::process::exit(1);
    });
}

/// Runs the program again with the same words and the group's name.
fn run_in(group: &Group, mib: u64) -> Result<()> {
    let program = std::env::current_exe().context("cannot find this program to run it under a cap")?;
    let words: Vec<OsString> = std::env::args_os().skip(1).collect();
    let mut copy = Command::new(&program);
    copy.args(words).arg(GROUP_FLAG).arg(&group.path);
    // Reports tell what was typed.
    #[cfg(unix)]
    if let Some(typed) = std::env::args_os().next() {
        std::os::unix::process::CommandExt::arg0(&mut copy, typed);
    }
    #[cfg(unix)]
    let ran = super::signals::run_copy(&mut copy, || group.remove());
    #[cfg(not(unix))]
    let ran = copy.status();
    let status = ran.with_context(|| format!("{}: cannot run under a cap", program.display()))?;
    match status.code() {
        Some(0) => Ok(()),
        Some(code) => {
            group.remove();
            // It has said why itself.
            std::process::exit(code)
        }
        None => bail!(
            "{status} under the cap of {mib} MiB, which is less than the engines themselves need if the kernel ended it; allow more with --cap"
        ),
    }
}

/// A capped control group; removed when dropped.
struct Group {
    path: PathBuf,
}

impl Group {
    /// Makes a group capped at `mib`.
    ///
    /// # Errors
    /// Why none can be had.
    fn create(mib: u64) -> Result<Self> {
        if !cfg!(target_os = "linux") {
            bail!("memory is capped by control groups, which only Linux has");
        }
        let own =
            std::fs::read_to_string("/proc/self/cgroup").context("control groups cannot be asked for")?;
        let mut why = None;
        for (parent, version) in parents(&own) {
            match Self::create_in(&parent, version, mib) {
                Ok(group) => return Ok(group),
                Err(error) => why = Some(error),
            }
        }
        match why {
            Some(why) => Err(why),
            None => bail!("this system has no control groups for memory"),
        }
    }

    fn create_in(parent: &Path, version: u32, mib: u64) -> Result<Self> {
        sweep(parent);
        let tell = |path: &Path, what: &str, e: std::io::Error| {
            anyhow::anyhow!("control group version {version}: {}: {what}: {e}", path.display())
        };
        let control = parent.join("cgroup.subtree_control");
        if version == 2 {
            let given = std::fs::read_to_string(&control).map_err(|e| tell(&control, "cannot read", e))?;
            if !given.split_ascii_whitespace().any(|word| word == "memory") {
                std::fs::write(&control, "+memory")
                    .map_err(|e| tell(&control, "cannot have memory counted", e))?;
            }
        }
        let path = parent.join(format!("{PREFIX}{}", std::process::id()));
        std::fs::create_dir(&path).map_err(|e| tell(&path, "cannot make a group", e))?;
        let group = Self { path };
        let limit = group.path.join(if version == 1 { "memory.limit_in_bytes" } else { "memory.max" });
        std::fs::write(&limit, (mib << 20).to_string()).map_err(|e| tell(&limit, "cannot set the cap", e))?;
        Ok(group)
    }

    fn remove(&self) {
        // A group stays busy for a moment after its last process. What cannot be removed now the next cap removes.
        for _ in 0..50 {
            if std::fs::remove_dir(&self.path).is_ok() || !self.path.exists() {
                return;
            }
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        self.remove();
    }
}

/// Removes groups of programs that are no more. A group with processes cannot be removed.
fn sweep(parent: &Path) {
    let Ok(entries) = std::fs::read_dir(parent) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let id = name.to_str().and_then(|name| name.strip_prefix(PREFIX));
        if id.is_some_and(|id| id.parse::<u32>().is_ok() && !Path::new("/proc").join(id).exists()) {
            // It is the next one's then.
            let _ = std::fs::remove_dir(entry.path());
        }
    }
}

/// Where a group may be made, best first, and the version there, from the lines of /proc/self/cgroup.
fn parents(own: &str) -> Vec<(PathBuf, u32)> {
    let mut found = Vec::new();
    for line in own.lines() {
        let mut parts = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(path)) = (parts.next(), parts.next()) else { continue };
        let (mount, version, file) = match controllers {
            "" => ("/sys/fs/cgroup", 2, "cgroup.subtree_control"),
            list if list.split(',').any(|word| word == "memory") => {
                ("/sys/fs/cgroup/memory", 1, "memory.limit_in_bytes")
            }
            _ => continue,
        };
        // Inside a container the path may be one of outside; the mount's root is the container's then.
        let mount = Path::new(mount);
        let mut here = mount.join(path.trim_start_matches('/'));
        loop {
            if here.join(file).exists() {
                found.push((here.clone(), version));
            }
            if here == mount || !here.pop() {
                break;
            }
        }
    }
    found.sort_by_key(|(_, version)| *version);
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_are_looked_for_where_the_process_is() {
        assert!(parents("").is_empty() && parents("x\n:\n").is_empty());
        // Paths that exist nowhere leave at most the mounts themselves.
        for (path, _) in parents("4:memory:/no/such\n0::/no/such\n") {
            assert!(path == Path::new("/sys/fs/cgroup/memory") || path == Path::new("/sys/fs/cgroup"));
        }
    }

    #[test]
    fn only_our_groups_are_joined() {
        let folder = tempfile::tempdir().unwrap();
        assert!(join(folder.path(), 64).unwrap_err().is::<WrongUsage>());
        assert!(join(&folder.path().join("terrasoar-iobench-1"), 64).unwrap_err().is::<WrongUsage>());
    }

    #[test]
    fn work_is_done_inside_and_the_rest_outside() {
        let folder = tempfile::tempdir().unwrap();
        let [capped, home] = ["capped", "home"].map(|name| folder.path().join(name));
        std::fs::create_dir(&capped).unwrap();
        std::fs::create_dir(&home).unwrap();
        let inside = |group: &Path| std::fs::read_to_string(group.join("cgroup.procs")).ok();
        let standing = Standing {
            groups: Some(Groups { capped: capped.clone(), home: home.clone() }),
            ..Default::default()
        };
        let failed = standing.within(|| {
            assert_eq!((inside(&capped).as_deref(), inside(&home)), (Some("0"), None));
            bail!("no luck") as Result<()>
        });
        assert_eq!(failed.unwrap_err().to_string(), "no luck");
        assert_eq!(inside(&home).as_deref(), Some("0"), "it has left, whatever came of the work");
        std::fs::remove_dir_all(&capped).unwrap();
        assert!(standing.within(|| -> Result<()> { panic!("uncapped") }).is_err());
        assert_eq!(Standing::default().within(|| Ok(7)).unwrap(), 7);
    }
}

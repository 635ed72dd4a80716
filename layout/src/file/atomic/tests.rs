//! Files appear whole or not at all, in the right place, with the right mode.

use super::*;

#[test]
fn nothing_appears_before_publishing_and_nothing_else_after() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("a");
    let names = || std::fs::read_dir(folder.path()).unwrap().count();
    let file = AtomicFile::create(&target).unwrap();
    SystemDisk.write_at(file.file(), b"half", 0).unwrap();
    assert!(!target.exists());
    drop(file);
    assert_eq!(names(), 0);
    for text in ["one", "two"] {
        let file = AtomicFile::create(&target).unwrap();
        SystemDisk.write_at(file.file(), text.as_bytes(), 0).unwrap();
        file.publish().unwrap();
        assert_eq!(std::fs::read_to_string(&target).unwrap(), text);
        assert_eq!(names(), 1);
    }
    #[cfg(target_os = "linux")]
    {
        // What a process leaves that was killed in the wrong moment, and what is none of that.
        for name in [".a.x1y2.terrasoar-new", ".b.x1y2.terrasoar-new", ".a.x1y2"] {
            std::fs::write(folder.path().join(name), "left").unwrap();
        }
        remove_left(&target, STALE);
        assert_eq!(names(), 4);
        remove_left(&target, Duration::ZERO);
        assert_eq!(names(), 3);
        assert!(!folder.path().join(".a.x1y2.terrasoar-new").exists());
    }
    assert!(AtomicFile::create(folder.path()).is_err());
    assert!(AtomicFile::create(&folder.path().join("missing/x")).is_err());
}

#[test]
fn names_of_any_length_are_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("n".repeat(255));
    for text in ["one", "two"] {
        let file = AtomicFile::create(&target).unwrap();
        SystemDisk.write_at(file.file(), text.as_bytes(), 0).unwrap();
        file.publish().unwrap();
        assert_eq!(std::fs::read_to_string(&target).unwrap(), text);
    }
}

/// Many publish to one name at once: none fails, and one complete file is there in the end.
#[test]
fn several_may_publish_to_one_name() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("a");
    std::thread::scope(|scope| {
        for i in 0..4u8 {
            let target = &target;
            scope.spawn(move || {
                for _ in 0..50 {
                    let file = AtomicFile::create(target).unwrap();
                    SystemDisk.write_at(file.file(), &[i; 9000], 0).unwrap();
                    file.publish().unwrap();
                    let there = std::fs::read(target).unwrap();
                    assert!(there.len() == 9000 && there.iter().all(|b| *b == there[0]));
                }
            });
        }
    });
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

fn publish(target: &Path, text: &str) -> Result<(), LayoutError> {
    let file = AtomicFile::create(target)?;
    SystemDisk.write_at(file.file(), text.as_bytes(), 0).unwrap();
    file.publish()
}

#[cfg(unix)]
#[test]
fn links_lead_on_to_the_file_that_is_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::create_dir(at("real")).unwrap();
    std::os::unix::fs::symlink("second", at("first")).unwrap();
    std::os::unix::fs::symlink("real/file", at("second")).unwrap();
    // The first leads to nothing yet.
    for text in ["one", "two"] {
        publish(&at("first"), text).unwrap();
        assert!(std::fs::symlink_metadata(at("first")).unwrap().is_symlink());
        assert!(std::fs::symlink_metadata(at("second")).unwrap().is_symlink());
        assert_eq!(std::fs::read_to_string(at("real/file")).unwrap(), text);
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 3);
    std::os::unix::fs::symlink("b", at("a")).unwrap();
    std::os::unix::fs::symlink("a", at("b")).unwrap();
    assert!(publish(&at("a"), "x").unwrap_err().to_string().contains("circle"));
}

#[cfg(unix)]
#[test]
fn mode_and_owner_stay() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt, chown};
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("a");
    publish(&target, "new").unwrap();
    // As the system makes new files here, whatever the process's mask.
    std::fs::write(folder.path().join("b"), "").unwrap();
    let mode = |name: &str| std::fs::metadata(folder.path().join(name)).unwrap().mode();
    assert_eq!(mode("a"), mode("b"));
    for bits in [0o600, 0o640, 0o664, 0o444] {
        std::fs::set_permissions(&target, PermissionsExt::from_mode(bits)).unwrap();
        publish(&target, "again").unwrap();
        assert_eq!(mode("a") & 0o777, bits);
    }
    // Only root may give files away.
    if chown(&target, Some(12_345), Some(54_321)).is_ok() {
        publish(&target, "again").unwrap();
        let meta = std::fs::metadata(&target).unwrap();
        assert_eq!((meta.uid(), meta.gid(), meta.mode() & 0o777), (12_345, 54_321, 0o444));
    }
}

#[cfg(unix)]
#[test]
fn what_is_no_regular_file_is_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let fifo = folder.path().join("fifo");
    let (kind, mode) = (rustix::fs::FileType::Fifo, rustix::fs::Mode::from_raw_mode(0o600));
    rustix::fs::mknodat(rustix::fs::CWD, &fifo, kind, mode, 0).unwrap();
    std::os::unix::fs::symlink("/dev/null", folder.path().join("null")).unwrap();
    for name in [fifo, folder.path().join("null"), "/dev/null".into()] {
        let error = publish(&name, "x").unwrap_err().to_string();
        assert!(error.contains("no regular file"), "{error}");
    }
    assert!(!std::fs::symlink_metadata("/dev/null").unwrap().is_file());
}

#[test]
fn what_somebody_writes_to_is_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("a");
    publish(&target, "old").unwrap();
    let lock = WriteLock::take(&target).unwrap();
    if cfg!(any(target_os = "linux", windows)) {
        let error = publish(&target, "new").unwrap_err().to_string();
        assert!(error.contains("another program is writing"), "{error}");
    }
    // Whoever has the lock may, once: then it is the lock of a file that has no name any more.
    for wanted in [true, false] {
        let file = AtomicFile::create(&target).unwrap();
        SystemDisk.write_at(file.file(), b"ours", 0).unwrap();
        let done = file.publish_over(&SystemDisk, &lock);
        assert_eq!(done.is_ok(), wanted, "{done:?}");
    }
    assert_eq!(std::fs::read_to_string(&target).unwrap(), "ours");
    let file = AtomicFile::create(&target).unwrap();
    assert!(!file.publish_new_on(&SystemDisk).unwrap(), "something has the name");
    let file = AtomicFile::create(&folder.path().join("b")).unwrap();
    assert!(file.publish_new_on(&SystemDisk).unwrap());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
}

/// Edits that were told as durable while the new file was made are not lost, and neither is a terrain that came into being meanwhile.
#[test]
fn a_terrain_that_was_edited_meanwhile_is_not_replaced() {
    use crate::build::{BuildOptions, build};
    use crate::edit::{Edit, EditSession, SampleRect};
    use crate::progress::Silent;
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("a.iqt");
    let dem = crate::dem::MemoryDem::from_fn([9, 9], crate::dem::SampleType::I16, |x, y| f64::from(x + y));
    let make = || build(&dem, &target, &BuildOptions::default(), &Silent).unwrap();
    make();
    let file = AtomicFile::create(&target).unwrap();
    SystemDisk.write_at(file.file(), b"new", 0).unwrap();
    let mut session = EditSession::open(&target).unwrap();
    let rect = SampleRect { west: 1, south: 1, east: 3, north: 3 };
    session.apply(&[Edit::set(rect, 7.0)]).unwrap();
    session.commit("a dam").unwrap();
    drop(session);
    let edited = std::fs::read(&target).unwrap();
    let error = file.publish().unwrap_err().to_string();
    assert!(error.contains("changed or replaced by another meanwhile"), "{error}");
    assert!(std::fs::read(&target).unwrap() == edited);

    std::fs::remove_file(&target).unwrap();
    let file = AtomicFile::create(&target).unwrap();
    make();
    let made = std::fs::read(&target).unwrap();
    file.publish().unwrap_err();
    assert!(std::fs::read(&target).unwrap() == made);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    // One that is as it was is replaced.
    make();
}

/// A bare chroot, which has no `/proc`: a file without a name could not be given one there.
#[cfg(target_os = "linux")]
#[test]
fn a_nameless_file_is_only_taken_where_a_way_leads_to_it() {
    let folder = tempfile::tempdir().unwrap();
    assert!(super::nameless(folder.path(), |_| PathBuf::from("/no/such/way")).is_none());
    let way = |file: &File| crate::file::disk::way_to(file);
    // Some file systems have no such files.
    if let Some(file) = super::nameless(folder.path(), way) {
        assert!(way(&file).exists());
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

//! What may be replaced: the rule for everything that a verb writes under a name that the user gave.
//!
//! **No verb replaces a file that it could not have made, nor a terrain that holds edits or a picture, unless `--force` is given**; the message says what would be lost. The kind of a file
//! is judged by its content, never by its name; where the name is a link, by the file it leads to. Devices, pipes, sockets and folders are never replaced, and neither is an input. An empty
//! file may be replaced. All this is checked before any work is done. Cost: the start of a file is read; a terrain file is opened.

mod kind;
mod there;

#[cfg(feature = "pictures")]
pub(super) use kind::FILM_NOTE;
pub(super) use kind::Kind;

use anyhow::{Result, bail};
use std::io;
use std::path::Path;
use terrasoar::sink::is_stream;
use terrasoar_lab::report::command_of;

/// The flag of verbs that write.
#[derive(Debug, Clone, Copy, clap::Args)]
pub(super) struct Force {
    /// Replace whatever file is there; without this flag, none that this verb could not have made, and no terrain that holds edits or a picture
    #[arg(long)]
    force: bool,
}

impl Force {
    /// Refuses an output that must be a file and cannot or should not be.
    pub(super) fn file(self, out: &Path, kind: Kind, inputs: &[&Path]) -> Result<()> {
        if is_stream(out) {
            bail!(
                "{}: the output is a device or pipe, which would be replaced by a file; name a file",
                out.display()
            );
        }
        self.stream(out, kind, inputs)
    }

    /// Refuses an output that cannot or should not be; devices and pipes may be written to.
    pub(super) fn stream(self, out: &Path, kind: Kind, inputs: &[&Path]) -> Result<()> {
        if out.is_dir() {
            bail!("{}: the output is a folder; name a file in it", out.display());
        }
        if is_stream(out) {
            return refuse_socket(out);
        }
        if let Some(folder) = out.parent().filter(|folder| !folder.as_os_str().is_empty())
            && matches!(std::fs::metadata(folder), Err(error) if error.kind() == io::ErrorKind::NotFound)
        {
            bail!("{}: the folder {} does not exist; make it first", out.display(), folder.display());
        }
        refuse_inputs(out, inputs)?;
        if self.force {
            return Ok(());
        }
        match kind.refusal(out) {
            Ok(None) => Ok(()),
            Ok(Some(what)) => refuse(out, &what),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            Err(error) => refuse(out, &format!("a file that cannot be looked into ({error})")),
        }
    }

    /// As [`Force::stream`], of a table of figures, which says by which command it was made. Another run's table is kept.
    pub(super) fn table(self, out: &Path, kind: Kind, inputs: &[&Path]) -> Result<()> {
        self.stream(out, kind, inputs)?;
        if self.force || is_stream(out) || !out.exists() {
            return Ok(());
        }
        let start = there::start_of(out)?;
        let bare = |command: &str| command.replace(" --force", "");
        match command_of(&start) {
            _ if start.is_empty() => Ok(()),
            Some(command) if bare(&command) == bare(&super::made::made().command) => Ok(()),
            Some(command) => refuse(out, &format!("the figures of another run ({command})")),
            None => refuse(out, "figures that do not say which run they are of"),
        }
    }

    /// Refuses a folder for files of these names if it is none, or if one of them cannot or should not be.
    pub(super) fn folder(self, folder: &Path, files: &[(String, Kind)], inputs: &[&Path]) -> Result<()> {
        if folder.exists() && !folder.is_dir() {
            bail!("{}: the report needs a folder and this is a file; name another", folder.display());
        }
        // A folder that is not there is made, and holds nothing that could be lost.
        for (name, kind) in files.iter().filter(|_| folder.is_dir()) {
            self.file(&folder.join(name), *kind, inputs)?;
        }
        Ok(())
    }

    /// Whether everything may be replaced.
    pub(super) fn is_given(self) -> bool {
        self.force
    }
}

fn refuse(out: &Path, what: &str) -> Result<()> {
    bail!("{}: this would replace {what}; name another output, or replace it with --force", out.display())
}

/// Refuses an output that is an input, by whatever name.
fn refuse_inputs(out: &Path, inputs: &[&Path]) -> Result<()> {
    for input in inputs {
        // What is not there is no input; whoever reads it says so.
        if same_file::is_same_file(out, input).unwrap_or(false) {
            bail!("{}: the output is the input, which would be lost; name another file", out.display());
        }
    }
    Ok(())
}

fn refuse_socket(out: &Path) -> Result<()> {
    #[cfg(unix)]
    if std::fs::metadata(out).is_ok_and(|meta| std::os::unix::fs::FileTypeExt::is_socket(&meta.file_type())) {
        // Only a socket with a name cannot be opened; one that is open already is written to as a pipe is.
        if std::fs::symlink_metadata(out).is_ok_and(|meta| !meta.is_symlink()) {
            bail!(
                "{}: the output is a socket, which cannot be opened by its name; name a file",
                out.display()
            );
        }
    }
    let _ = out;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    const NO: Force = Force { force: false };
    const YES: Force = Force { force: true };

    fn said(result: Result<()>) -> String {
        result.unwrap_err().to_string()
    }

    #[test]
    fn nothing_and_an_empty_file_may_be_replaced_and_text_may_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        for kind in Kind::ALL {
            let _ = std::fs::remove_file(&path);
            NO.file(&path, kind, &[]).unwrap();
            std::fs::write(&path, "").unwrap();
            NO.file(&path, kind, &[]).unwrap();
            std::fs::write(&path, "my notes\n").unwrap();
            let message = said(NO.file(&path, kind, &[]));
            assert!(message.contains("a text file") && message.contains("--force"), "{kind:?}: {message}");
            YES.file(&path, kind, &[]).unwrap();
        }
        assert_eq!(std::fs::read(&path).unwrap(), b"my notes\n");
    }

    #[test]
    fn a_folder_is_never_replaced() {
        let folder = tempfile::tempdir().unwrap();
        for force in [NO, YES] {
            assert!(said(force.file(folder.path(), Kind::Terrain, &[])).contains("folder"));
            let inside = [("sub".to_owned(), Kind::Mesh)];
            std::fs::create_dir_all(folder.path().join("sub")).unwrap();
            assert!(said(force.folder(folder.path(), &inside, &[])).contains("sub: the output is a folder"));
        }
    }

    /// An input is one under every name that leads to it.
    #[test]
    #[cfg(unix)]
    fn an_input_is_never_replaced_whatever_it_is_called() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("in"), "").unwrap();
        std::fs::hard_link(at("in"), at("hard")).unwrap();
        std::os::unix::fs::symlink("in", at("soft")).unwrap();
        std::os::unix::fs::symlink("soft", at("softer")).unwrap();
        std::fs::create_dir(at("d")).unwrap();
        let around: PathBuf = at("d").join("..").join("in");
        for out in [at("in"), at("hard"), at("soft"), at("softer"), around] {
            for force in [NO, YES] {
                let message = said(force.file(&out, Kind::Terrain, &[&at("none"), &at("in")]));
                assert!(message.contains("the output is the input"), "{message}");
                assert!(said(force.stream(&out, Kind::Flight, &[&at("hard")])).contains("the input"));
            }
        }
        NO.file(&at("other"), Kind::Terrain, &[&at("in")]).unwrap();
    }

    #[test]
    #[cfg(unix)]
    fn devices_and_pipes_are_never_replaced_and_may_be_streamed_to() {
        let folder = tempfile::tempdir().unwrap();
        let fifo = folder.path().join("fifo");
        rustix::fs::mknodat(rustix::fs::CWD, &fifo, rustix::fs::FileType::Fifo, 0o600.into(), 0).unwrap();
        let link = folder.path().join("link");
        std::os::unix::fs::symlink("/dev/null", &link).unwrap();
        for out in [Path::new("/dev/null"), Path::new("/dev/stdout"), &fifo, &link] {
            for force in [NO, YES] {
                assert!(said(force.file(out, Kind::Terrain, &[])).contains("device or pipe"), "{out:?}");
                force.stream(out, Kind::Flight, &[]).unwrap();
            }
        }
        let socket = folder.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        assert!(said(YES.stream(&socket, Kind::Flight, &[])).contains("socket"));
    }
}

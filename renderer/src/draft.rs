//! Files that appear under their final names only when they are whole.
//!
//! A file is written beside its final place as `.NAME.part-HOST-PID`, synced, and renamed. Who writes it holds a lock on it
//! for as long as it lives, so a later run can tell what a killed one has left from what another still writes.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;

/// A file in the making, which is deleted if it is not published.
#[derive(Debug)]
pub struct Draft {
    target: PathBuf,
    hidden: PathBuf,
    /// Holds the lock, which everything else that opens the file by its name leaves alone.
    _locked: File,
}

impl Draft {
    /// An empty file that is to become `target`.
    ///
    /// # Errors
    /// The folder is absent or not writable, or `target` names no file.
    pub fn create(target: &Path) -> io::Result<Self> {
        let mut name = prefix(target)?;
        name.push(std::process::id().to_string());
        let hidden = target.with_file_name(name);
        loop {
            let file = OpenOptions::new().create(true).truncate(false).write(true).open(&hidden)?;
            if lock(&file)? == Lock::Held {
                // Of a process with the same number on a host of the same name.
                return Err(io::Error::new(io::ErrorKind::AlreadyExists, "another process is writing the same file"));
            }
            // Who looks for leftovers may have taken it for one before it was locked.
            if same_file(&file, &hidden) {
                file.set_len(0)?;
                return Ok(Self { target: target.to_owned(), hidden, _locked: file });
            }
        }
    }

    /// Where to write. Whoever opens it must not replace it by another file.
    pub fn path(&self) -> &Path {
        &self.hidden
    }

    /// Gives the file its final name once its bytes are on the disk. The final name then survives a loss of power.
    ///
    /// # Errors
    /// The system's: the final name has what it had before.
    pub fn publish(self) -> io::Result<()> {
        File::open(&self.hidden)?.sync_all()?;
        fs::rename(&self.hidden, &self.target)?;
        // Some network file systems cannot do this to a folder.
        File::open(folder(&self.target)).and_then(|folder| folder.sync_all()).unwrap_or_default();
        Ok(())
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        // Nothing has the name if it was published.
        fs::remove_file(&self.hidden).unwrap_or_default();
    }
}

/// Makes sure that there can be a file `target`, and removes what processes of this host that were killed have left of it.
///
/// What another host may be writing is left alone, whatever its lock says: not every shared disk tells of other hosts' locks.
///
/// # Errors
/// As [`Draft::create`].
pub fn prepare(target: &Path) -> io::Result<()> {
    let prefix = prefix(target)?;
    for entry in fs::read_dir(folder(target))?.flatten() {
        if is_draft(&entry.file_name(), &prefix) {
            remove_if_free(&entry.path());
        }
    }
    Draft::create(target).map(drop)
}

/// Deletes a file that nobody has locked. What cannot be locked or deleted stays.
fn remove_if_free(path: &Path) {
    let Ok(file) = OpenOptions::new().write(true).open(path) else { return };
    if lock(&file).is_ok_and(|lock| lock == Lock::Taken) && same_file(&file, path) {
        fs::remove_file(path).unwrap_or_default();
    }
}

/// Whether a name is `prefix` and a number.
fn is_draft(name: &OsStr, prefix: &OsStr) -> bool {
    let number = name.as_encoded_bytes().strip_prefix(prefix.as_encoded_bytes());
    number.is_some_and(|number| !number.is_empty() && number.iter().all(u8::is_ascii_digit))
}

/// With what the names of this host's drafts of a file begin.
fn prefix(target: &Path) -> io::Result<OsString> {
    let name = target.file_name();
    let name = name.ok_or_else(|| io::Error::new(io::ErrorKind::InvalidInput, "the path names no file"))?;
    let host = rustix::system::uname().nodename().to_string_lossy().replace('/', "_");
    let mut prefix = OsString::from(".");
    prefix.push(name);
    prefix.push(format!(".part-{host}-"));
    Ok(prefix)
}

fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lock {
    Taken,
    /// By somebody else.
    Held,
    /// The file system knows none.
    Unknown,
}

fn lock(file: &File) -> io::Result<Lock> {
    loop {
        return match flock(file, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => Ok(Lock::Taken),
            Err(Errno::INTR) => continue,
            Err(Errno::WOULDBLOCK) => Ok(Lock::Held),
            Err(Errno::NOTSUP | Errno::NOSYS | Errno::NOLCK | Errno::INVAL) => Ok(Lock::Unknown),
            Err(error) => Err(error.into()),
        };
    }
}

/// Whether `path` is the name of an open file.
fn same_file(file: &File, path: &Path) -> bool {
    let identity = |metadata: fs::Metadata| (metadata.dev(), metadata.ino());
    let (open, named) = (file.metadata().map(identity), fs::metadata(path).map(identity));
    open.ok().zip(named.ok()).is_some_and(|(open, named)| open == named)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_appears_only_when_it_is_published() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        fs::write(&path, "old").unwrap();
        let draft = Draft::create(&path).unwrap();
        fs::write(draft.path(), "new").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        draft.publish().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        let draft = Draft::create(&path).unwrap();
        fs::write(draft.path(), "half").unwrap();
        drop(draft);
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(names(folder.path()), ["a.json"]);
    }

    #[test]
    fn what_the_dead_left_is_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        let mine = prefix(&path).unwrap().into_string().unwrap();
        let dead = format!("{mine}4194305");
        let kept = [
            ".a.exr.part-another.host-17".to_owned(),
            ".b.exr.part-17".to_owned(),
            format!("{mine}17.exr"),
            mine.replace("a.exr", "ba.exr") + "17",
        ];
        for name in kept.iter().chain([&dead]) {
            fs::write(folder.path().join(name), "half").unwrap();
        }
        // As another process would hold it.
        let other = folder.path().join(format!("{mine}4194306"));
        let held = File::create(&other).unwrap();
        assert_eq!(lock(&held).unwrap(), Lock::Taken);
        prepare(&path).unwrap();
        let left = names(folder.path());
        assert!(!left.contains(&dead) && kept.iter().all(|name| left.contains(name)) && other.exists(), "{left:?}");
        drop(held);
        let draft = Draft::create(&path).unwrap();
        prepare(&path).unwrap_err();
        assert!(draft.path().exists() && !other.exists());
    }

    #[test]
    fn an_absent_folder_is_an_error() {
        for path in ["/nonexistent/folder/a.exr", "..", ""] {
            Draft::create(Path::new(path)).unwrap_err();
            prepare(Path::new(path)).unwrap_err();
        }
    }
}

//! Files that appear under their final name only when they are complete.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::exit::Failure;

/// A file to be written. Until [`Self::commit`] it is a hidden file beside its final place, which is deleted when this is
/// dropped.
#[derive(Debug)]
pub struct OutputFile {
    target: PathBuf,
    part: PathBuf,
}

impl OutputFile {
    /// Makes sure, before any work is done, that the file can be written.
    ///
    /// # Errors
    /// The folder is missing or not writable, or something that is not a file has the name.
    pub fn prepare(path: &Path) -> Result<Self, Failure> {
        let failure =
            |why: &dyn std::fmt::Display| Failure::Output(format!("cannot write \"{}\": {why}", path.display()));
        // A link to a file elsewhere stays a link: it is its target that is replaced.
        let target = match fs::metadata(path) {
            Ok(existing) if existing.is_dir() => return Err(failure(&"it is a folder; name a file in it")),
            Ok(existing) if !existing.is_file() => return Err(failure(&"it exists and is not an ordinary file")),
            Ok(_) => fs::canonicalize(path).map_err(|why| failure(&why))?,
            Err(_) => path.to_owned(),
        };
        let Some(name) = target.file_name() else { return Err(failure(&"it has no file name")) };
        let mut part = std::ffi::OsString::from(".");
        part.push(name);
        part.push(format!(".part-{}", std::process::id()));
        let output = Self { part: target.with_file_name(part), target };
        match File::create(&output.part) {
            Ok(_) => {
                fs::remove_file(&output.part).map_err(|why| failure(&why))?;
                Ok(output)
            }
            Err(why) if why.kind() == io::ErrorKind::NotFound => {
                Err(failure(&format!("the folder \"{}\" does not exist", output.folder().display())))
            }
            Err(why) => Err(failure(&why)),
        }
    }

    /// The final place.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Where to write.
    pub fn part(&self) -> &Path {
        &self.part
    }

    /// Gives the written file its final name, once its bytes are on the disk.
    ///
    /// # Errors
    /// The system refuses, for example because the disk is full. The final name then holds what it held before.
    pub fn commit(self) -> Result<(), Failure> {
        let commit = || {
            File::open(&self.part)?.sync_all()?;
            fs::rename(&self.part, &self.target)?;
            // The name, too, has to survive a loss of power. Some network file systems cannot do this to a folder.
            File::open(self.folder()).and_then(|folder| folder.sync_all()).unwrap_or_default();
            Ok(())
        };
        commit().map_err(|why: io::Error| self.failure(&why))
    }

    /// Writes all of a file at once and commits it.
    ///
    /// # Errors
    /// As [`Self::commit`].
    pub fn write(self, bytes: &[u8]) -> Result<(), Failure> {
        File::create(&self.part).and_then(|mut file| file.write_all(bytes)).map_err(|why| self.failure(&why))?;
        self.commit()
    }

    fn folder(&self) -> &Path {
        match self.target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        }
    }

    fn failure(&self, why: &dyn std::fmt::Display) -> Failure {
        Failure::Output(format!("cannot write \"{}\": {why}", self.target.display()))
    }
}

impl Drop for OutputFile {
    fn drop(&mut self) {
        // Committed, or never written: then there is nothing to delete.
        fs::remove_file(&self.part).unwrap_or_default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn a_file_appears_only_when_it_is_committed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        fs::write(&path, "old").unwrap();
        let output = OutputFile::prepare(&path).unwrap();
        fs::write(output.part(), "new").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        output.commit().unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(names(folder.path()), ["a.json"]);
    }

    #[test]
    fn an_abandoned_file_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let output = OutputFile::prepare(&folder.path().join("a.exr")).unwrap();
        fs::write(output.part(), "half").unwrap();
        drop(output);
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn a_link_keeps_pointing_to_its_target() {
        let folder = tempfile::tempdir().unwrap();
        let (real, link) = (folder.path().join("real"), folder.path().join("link"));
        fs::write(&real, "old").unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        OutputFile::prepare(&link).unwrap().write(b"new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read_to_string(&real).unwrap(), "new");
    }

    #[test]
    fn what_cannot_be_a_file_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        for bad in [folder.path().to_owned(), folder.path().join("none/a.exr"), "/dev/null".into(), "..".into()] {
            let failure = OutputFile::prepare(&bad).unwrap_err();
            assert_eq!(failure.code(), 4, "{failure}");
            assert!(failure.to_string().contains(&*bad.to_string_lossy()), "{failure}");
        }
    }
}

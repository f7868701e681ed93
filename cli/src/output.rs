//! Files that the command line names, to be written when the work is done.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use renderer::draft::{self, Draft};

use crate::exit::Failure;

/// A file to be written.
#[derive(Debug)]
pub struct OutputFile {
    target: PathBuf,
}

impl OutputFile {
    /// Makes sure, before any work is done, that the file can be written, and removes what killed processes have left of
    /// it.
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
        if target.to_str().is_none() {
            return Err(failure(&"its name is not UTF-8, and the library that writes images takes no other"));
        }
        match draft::prepare(&target) {
            Ok(()) => Ok(Self { target }),
            Err(why) if why.kind() == io::ErrorKind::NotFound => {
                let folder = target.parent().unwrap_or(Path::new("")).display();
                Err(failure(&format_args!("the folder \"{folder}\" does not exist; make it first, with mkdir -p")))
            }
            Err(why) => Err(failure(&why)),
        }
    }

    /// The final place.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Makes sure that no input is written over.
    ///
    /// # Errors
    /// One of them is this file.
    pub fn spare<'a>(&self, inputs: impl IntoIterator<Item = &'a Path>) -> Result<(), Failure> {
        inputs.into_iter().try_for_each(|input| spare(&self.target, input))
    }

    /// Whether another path leads to the same place.
    pub fn is(&self, other: &Self) -> bool {
        let place = |target: &Path| {
            let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
            (fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned()), target.file_name().map(ToOwned::to_owned))
        };
        place(&self.target) == place(&other.target)
    }

    /// The file in the making.
    ///
    /// # Errors
    /// It cannot be made any more.
    pub fn draft(&self) -> Result<Draft, Failure> {
        Draft::create(&self.target).map_err(|why| self.failure(&why))
    }

    /// Gives the written file its final name.
    ///
    /// # Errors
    /// The system refuses, for example because the disk is full. The final name then holds what it held before.
    pub fn publish(&self, draft: Draft) -> Result<(), Failure> {
        draft.publish().map_err(|why| self.failure(&why))
    }

    /// Writes all of a file at once.
    ///
    /// # Errors
    /// As [`Self::publish`].
    pub fn write(&self, bytes: &[u8]) -> Result<(), Failure> {
        let draft = self.draft()?;
        fs::write(draft.path(), bytes).map_err(|why| self.failure(&why))?;
        self.publish(draft)
    }

    fn failure(&self, why: &dyn std::fmt::Display) -> Failure {
        Failure::Output(format!("cannot write \"{}\": {why}", self.target.display()))
    }
}

/// Makes sure that an input is not written over.
///
/// # Errors
/// It is the file that is to be written.
pub fn spare(output: &Path, input: &Path) -> Result<(), Failure> {
    let real = |path| fs::canonicalize(path).ok();
    if real(output).is_some_and(|output| Some(output) == real(input)) {
        let text = format!("\"{}\" is read and cannot be written over: name another file to write", input.display());
        return Err(Failure::Usage(text));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

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
            assert_eq!(failure.to_string().contains("mkdir -p"), bad.ends_with("none/a.exr"), "{failure}");
        }
        assert!(fs::read_dir(folder.path()).unwrap().next().is_none());
    }
}

//! Messages about a scene file, each with the place it is about.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A place in one of the files of a scene: byte range `start..end` of file `file` in the [`SourceMap`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Span {
    /// Index into the [`SourceMap`].
    pub file: u32,
    /// First byte.
    pub start: u32,
    /// One past the last byte.
    pub end: u32,
}

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The picture can be made, though not as the file asks.
    Warning,
    /// The picture cannot be made.
    Error,
}

/// One message, ready to be shown: everything it says is already text, so it outlives the files.
#[derive(Clone, Debug, PartialEq)]
pub struct Diagnostic {
    /// How bad it is.
    pub severity: Severity,
    /// What is wrong and what to do about it.
    pub message: String,
    /// Where; `None` for a message about no one place.
    pub place: Option<Place>,
}

/// A resolved [`Span`].
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// The file.
    pub path: PathBuf,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// The text of that line, without its end.
    pub text: String,
    /// How many characters of the line are meant, at least 1.
    pub width: usize,
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = match self.severity {
            Severity::Warning => "warning",
            Severity::Error => "error",
        };
        let Some(place) = &self.place else { return write!(f, "{word}: {}", self.message) };
        // A line of a mesh can be megabytes long: show a window of it around the place.
        const WINDOW: usize = 100;
        let column = place.column - 1;
        let from = column.saturating_sub(WINDOW / 2);
        let shown: String =
            place.text.chars().skip(from).take(WINDOW).map(|c| if c.is_control() { ' ' } else { c }).collect();
        let room = shown.chars().count().saturating_sub(column - from).max(1);
        writeln!(f, "{}:{}:{}: {word}: {}", place.path.display(), place.line, place.column, self.message)?;
        writeln!(f, "  {shown}")?;
        write!(f, "  {}{}", " ".repeat(column - from), "^".repeat(place.width.clamp(1, room)))
    }
}

/// The texts of all files that a scene was read from, so that a [`Span`] can be shown.
#[derive(Clone, Debug, Default)]
pub struct SourceMap {
    files: Vec<(PathBuf, Arc<[u8]>)>,
}

impl SourceMap {
    /// Adds a file and returns its index.
    pub fn add(&mut self, path: &Path, text: Arc<[u8]>) -> u32 {
        self.files.push((path.to_owned(), text));
        u32::try_from(self.files.len() - 1).expect("a scene of 2^32 files cannot be named by a span")
    }

    /// The file's path.
    pub fn path(&self, file: u32) -> &Path {
        &self.files[file as usize].0
    }

    /// All paths, in the order in which the files were first read.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        self.files.iter().map(|(path, _)| path.as_path())
    }

    /// Resolves a span to line and column.
    pub fn place(&self, span: Span) -> Place {
        let (path, text) = &self.files[span.file as usize];
        let start = (span.start as usize).min(text.len());
        let line_start = text[..start].iter().rposition(|&b| b == b'\n').map_or(0, |at| at + 1);
        let line_end = text[start..].iter().position(|&b| b == b'\n').map_or(text.len(), |at| start + at);
        let end = (span.end as usize).clamp(start, line_end);
        Place {
            path: path.clone(),
            line: 1 + text[..start].iter().filter(|&&b| b == b'\n').count(),
            column: 1 + String::from_utf8_lossy(&text[line_start..start]).chars().count(),
            text: String::from_utf8_lossy(&text[line_start..line_end]).trim_end_matches('\r').to_owned(),
            width: String::from_utf8_lossy(&text[start..end]).chars().count().max(1),
        }
    }

    /// A warning at `span`.
    pub fn warning(&self, span: Span, message: impl Into<String>) -> Diagnostic {
        Diagnostic { severity: Severity::Warning, message: message.into(), place: Some(self.place(span)) }
    }

    /// An error at `span`.
    pub fn error(&self, span: Span, message: impl Into<String>) -> Diagnostic {
        Diagnostic { severity: Severity::Error, message: message.into(), place: Some(self.place(span)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_counts_lines_and_characters_and_shows_the_line() {
        let mut sources = SourceMap::default();
        let file = sources.add(Path::new("a.pbrt"), Arc::from("Camera \"x\"\n  \u{e9} Shape \"cone\"\n".as_bytes()));
        let start = 11 + 2 + 3 + 6;
        let error = sources.error(Span { file, start, end: start + 6 }, "no such shape");
        assert_eq!(
            error.to_string(),
            "a.pbrt:2:11: error: no such shape\n    \u{e9} Shape \"cone\"\n            ^^^^^^"
        );
    }
}

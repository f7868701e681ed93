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
    /// The text of that line around the place, without the line's end: a line of a mesh can be megabytes long.
    pub text: String,
    /// How many characters of `text` stand before the place.
    pub before: usize,
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
        let shown: String = place.text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        let room = shown.chars().count().saturating_sub(place.before).max(1);
        writeln!(f, "{}:{}:{}: {word}: {}", place.path.display(), place.line, place.column, self.message)?;
        writeln!(f, "  {shown}")?;
        write!(f, "  {}{}", " ".repeat(place.before), "^".repeat(place.width.clamp(1, room)))
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

    /// A hash of all texts: scenes with different texts differ in it. FNV-1a, the same on every machine.
    pub fn hash(&self) -> u64 {
        const OFFSET: u64 = 0xcbf2_9ce4_8422_2325;
        const PRIME: u64 = 0x0100_0000_01b3;
        let step = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(PRIME);
        // The length separates texts, so that moving a line from one file to the next is a difference.
        let file = |hash, text: &[u8]| (text.len() as u64).to_le_bytes().iter().chain(text).fold(hash, step);
        self.files.iter().fold(OFFSET, |hash, (_, text)| file(hash, text))
    }

    /// Resolves a span to line and column. For many spans use [`Self::places`].
    pub fn place(&self, span: Span) -> Place {
        self.places().place(span)
    }

    /// A resolver for many spans: it looks for the lines of a file once.
    pub fn places(&self) -> Places<'_> {
        Places { sources: self, lines: vec![None; self.files.len()] }
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

/// Resolves spans of a [`SourceMap`]. See [`SourceMap::places`].
#[derive(Debug)]
pub struct Places<'s> {
    sources: &'s SourceMap,
    /// Offset of the first byte of each line, of the files that were asked for.
    lines: Vec<Option<Vec<usize>>>,
}

impl Places<'_> {
    /// Line and column of a span. A span of no known file resolves to line 1 of no file.
    pub fn place(&mut self, span: Span) -> Place {
        let Some((path, text)) = self.sources.files.get(span.file as usize) else {
            return Place { path: PathBuf::new(), line: 1, column: 1, text: String::new(), before: 0, width: 1 };
        };
        let lines = self.lines[span.file as usize].get_or_insert_with(|| {
            let ends = text.iter().enumerate().filter(|&(_, &b)| b == b'\n');
            std::iter::once(0).chain(ends.map(|(at, _)| at + 1)).collect()
        });
        let start = (span.start as usize).min(text.len());
        let line = lines.partition_point(|&first| first <= start);
        let line_start = lines[line - 1];
        let line_end = lines.get(line).map_or(text.len(), |&next| next - 1);
        let end = (span.end as usize).clamp(start, line_end.max(start));

        // A window of the line, cut between characters.
        const REACH: usize = 60;
        let is_boundary = |&at: &usize| at >= text.len() || (text[at] & 0xc0) != 0x80;
        let from = (line_start.max(start.saturating_sub(REACH))..=start).find(is_boundary).unwrap_or(start);
        let to = (start..=line_end.min(start + REACH).max(start)).rev().find(is_boundary).unwrap_or(start);
        let before = String::from_utf8_lossy(&text[from..start]);
        let before = if from > line_start { format!("… {before}") } else { before.into_owned() };
        let after = String::from_utf8_lossy(&text[start..to]);
        let after = after.trim_end_matches('\r');
        Place {
            path: path.clone(),
            line,
            column: 1 + String::from_utf8_lossy(&text[line_start..start]).chars().count(),
            before: before.chars().count(),
            width: String::from_utf8_lossy(&text[start..end]).chars().count().max(1),
            text: if to < line_end { format!("{before}{after} …") } else { before + after },
        }
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

    #[test]
    fn a_long_line_is_shown_around_the_place() {
        let mut sources = SourceMap::default();
        let line = format!("{}\u{e9}here{}\nnext", "\u{e9}".repeat(5000), "x".repeat(5000));
        let file = sources.add(Path::new("a.pbrt"), Arc::from(line.as_bytes()));
        let place = sources.place(Span { file, start: 10002, end: 10006 });
        assert_eq!((place.line, place.column, place.width), (1, 5002, 4));
        assert!(place.text.chars().count() < 200);
        assert_eq!(place.text.chars().skip(place.before).take(4).collect::<String>(), "here");
        assert!(place.text.starts_with("… \u{e9}") && place.text.ends_with("x …"), "{}", place.text);
    }

    #[test]
    fn spans_beyond_the_text_or_of_no_file_resolve() {
        let mut sources = SourceMap::default();
        let file = sources.add(Path::new("a.pbrt"), Arc::from("ab\n".as_bytes()));
        let place = sources.place(Span { file, start: 3, end: 9 });
        assert_eq!((place.line, place.column, place.text.as_str()), (2, 1, ""));
        assert_eq!(sources.place(Span { file, start: 2, end: 2 }).column, 3);
        assert_eq!(sources.place(Span { file: 7, start: 0, end: 0 }).line, 1);
    }
}

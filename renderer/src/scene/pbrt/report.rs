//! Collects everything there is to say about a scene, in the order of its files.

use std::collections::HashMap;

use crate::scene::{Diagnostic, Severity, SourceMap, Span};

/// Beyond this many errors only their number is told: a file of garbage would otherwise answer with a message per word.
const MAX_ERRORS: usize = 1000;

struct Message {
    severity: Severity,
    span: Option<Span>,
    text: String,
    /// How many more times a warning of this cause came up.
    more: usize,
}

/// The messages so far.
#[derive(Default)]
pub(super) struct Report {
    messages: Vec<Message>,
    errors: usize,
    once: HashMap<String, usize>,
}

impl Report {
    /// Something that makes the picture impossible.
    pub(super) fn error(&mut self, span: Span, text: impl Into<String>) {
        self.errors += 1;
        if self.errors <= MAX_ERRORS {
            self.messages.push(Message { severity: Severity::Error, span: Some(span), text: text.into(), more: 0 });
        }
    }

    /// An error that is about no one place.
    pub(super) fn error_nowhere(&mut self, text: impl Into<String>) {
        self.errors += 1;
        self.messages.push(Message { severity: Severity::Error, span: None, text: text.into(), more: 0 });
    }

    /// Something that makes the picture other than the file asks. Told once per `cause`, at its first place.
    pub(super) fn warning(&mut self, cause: impl Into<String>, span: Span, text: impl Into<String>) {
        let next = self.messages.len();
        let index = *self.once.entry(cause.into()).or_insert(next);
        if index == next {
            self.messages.push(Message { severity: Severity::Warning, span: Some(span), text: text.into(), more: 0 });
        } else {
            self.messages[index].more += 1;
        }
    }

    /// Whether there were errors.
    pub(super) fn failed(&self) -> bool {
        self.errors > 0
    }

    /// All messages with their places, in the order of the files and of the lines in them.
    pub(super) fn finish(mut self, sources: &SourceMap) -> Vec<Diagnostic> {
        self.messages.sort_by_key(|m| m.span.map_or((u32::MAX, u32::MAX), |span| (span.file, span.start)));
        self.messages.dedup_by(|a, b| a.span == b.span && a.text == b.text);
        let hidden = self.errors.saturating_sub(MAX_ERRORS);
        if hidden > 0 {
            self.errors = 0;
            self.error_nowhere(format!("{hidden} more errors are not shown"));
        }
        let mut places = sources.places();
        let resolve = |m: Message| Diagnostic {
            severity: m.severity,
            message: match m.more {
                0 => m.text,
                1 => format!("{} (and once more)", m.text),
                n => format!("{} (and {n} times more)", m.text),
            },
            place: m.span.map(|span| places.place(span)),
        };
        self.messages.into_iter().map(resolve).collect()
    }
}

/// As much of a piece of a file as a message should hold, on one line.
pub(super) fn shown(text: &str) -> String {
    const LONGEST: usize = 60;
    let mut short: String = text.chars().take(LONGEST).map(|c| if c.is_control() { ' ' } else { c }).collect();
    if text.chars().nth(LONGEST).is_some() {
        short.push_str("...");
    }
    short
}

/// `; did you mean “x”?` for the candidate that is closest to `name`, or nothing if none is close.
pub fn did_you_mean<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> String {
    nearest(name, candidates).map_or_else(String::new, |best| format!("; did you mean \"{best}\"?"))
}

/// The candidate closest to `name` by edit distance, the first of equals, if it is close enough to be a slip.
fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // Nobody slips so often in one word; comparing longer ones only costs time.
    const LONGEST: usize = 64;
    if name.is_empty() || name.len() > LONGEST {
        return None;
    }
    let lower = name.to_lowercase();
    let length = |text: &str| text.chars().count();
    let slips = |candidate: &str| (candidate.len().max(name.len()) / 3).max(1);
    // Enough for every table of ours and for the names of most scenes; a guess is not worth more.
    const MOST: usize = 5000;
    candidates
        .into_iter()
        .take(MOST)
        // As many characters as one is longer than the other have been slipped at least.
        .filter(|candidate| candidate.len() <= LONGEST && length(candidate).abs_diff(length(name)) <= slips(candidate))
        .map(|candidate| (edit_distance(&lower, &candidate.to_lowercase()), candidate))
        .min_by_key(|&(distance, _)| distance)
        .filter(|&(distance, candidate)| distance <= slips(candidate))
        .map(|(_, candidate)| candidate)
}

/// Number of insertions, deletions, replacements and swaps of neighbours that turn `a` into `b`
/// (optimal string alignment).
fn edit_distance(a: &str, b: &str) -> usize {
    let a: Vec<char> = a.chars().collect();
    let b: Vec<char> = b.chars().collect();
    let mut before: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i];
        for j in 1..=b.len() {
            let replaced = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut cost = replaced.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                cost = cost.min(before[j - 2] + 1);
            }
            row.push(cost);
        }
        before = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn edit_distance_counts_slips() {
        for (a, b, distance) in
            [("", "", 0), ("radius", "radius", 0), ("raduis", "radius", 1), ("fov", "fow", 1), ("ab", "abcd", 2)]
        {
            assert_eq!(edit_distance(a, b), distance, "{a} {b}");
            assert_eq!(edit_distance(b, a), distance, "{b} {a}");
        }
    }

    #[test]
    fn only_slips_are_corrected() {
        assert_eq!(nearest("refectance", ["roughness", "reflectance"]), Some("reflectance"));
        assert_eq!(nearest("Radius", ["zmin", "radius"]), Some("radius"));
        assert_eq!(nearest("thickness", ["eta", "k"]), None);
        assert_eq!(did_you_mean("K", ["k"]), "; did you mean \"k\"?");
    }

    #[test]
    fn a_warning_is_told_once_and_counted() {
        let mut sources = SourceMap::default();
        let file = sources.add(Path::new("a"), std::sync::Arc::from(&b"0123456789"[..]));
        let mut report = Report::default();
        for start in [5, 6, 7] {
            report.warning("cause", Span { file, start, end: start + 1 }, "odd");
        }
        report.error(Span { file, start: 2, end: 3 }, "bad");
        assert!(report.failed());
        let told: Vec<_> =
            report.finish(&sources).into_iter().map(|d| (d.message, d.place.map(|p| p.column))).collect();
        assert_eq!(told, [("bad".to_owned(), Some(3)), ("odd (and 2 times more)".to_owned(), Some(6))]);
    }

    #[test]
    fn errors_beyond_the_limit_are_only_counted() {
        let mut sources = SourceMap::default();
        let file = sources.add(Path::new("a"), std::sync::Arc::from(vec![b'x'; 2000].as_slice()));
        let mut report = Report::default();
        for start in 0..1500 {
            report.error(Span { file, start, end: start + 1 }, "bad");
        }
        let all = report.finish(&sources);
        assert_eq!(all.len(), MAX_ERRORS + 1);
        assert_eq!(all.last().unwrap().message, "500 more errors are not shown");
    }
}

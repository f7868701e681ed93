//! Makes text from scene files and file names harmless in logs.
//!
//! Farm software reads progress, outputs and failures from what a renderer prints, mostly with regular expressions that
//! match anywhere in a line. A scene must not be able to print such lines through its names.

use std::borrow::Cow;

/// What farm software looks for, in any case, and what is shown instead.
const CONTROL_WORDS: [(&str, &str); 8] = [
    ("alf_progress", "ALF-PROGRESS"),
    ("openjd_", "openjd-"),
    ("progress:", "progress;"),
    ("image:", "image;"),
    ("@image@", "(image)"),
    ("peak memory usage", "peak-memory-usage"),
    ("finished rendering", "finished-rendering"),
    ("[error]", "(error)"),
];

/// The text on one line: control characters, line separators and marks that reorder text are written as escapes.
pub fn one_line(text: &str) -> Cow<'_, str> {
    if !text.chars().any(is_unsafe) {
        return text.into();
    }
    let mut safe = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_unsafe(c) {
            safe.extend(c.escape_default());
        } else {
            safe.push(c);
        }
    }
    safe.into()
}

/// The text line by line, each as by [`one_line`] and without words that a farm would take for ours.
pub fn lines(text: &str) -> impl Iterator<Item = String> + '_ {
    text.split('\n').map(|line| {
        // In this case only: scene diagnostics say "error:" themselves.
        let line = one_line(line).replace("Error:", "Error;");
        CONTROL_WORDS.iter().fold(line, |line, (word, shown)| replace_in_any_case(line, word, shown))
    })
}

/// `word` is in lower case.
fn replace_in_any_case(line: String, word: &str, shown: &str) -> String {
    // Lowering ASCII letters moves no byte.
    let lower = line.to_ascii_lowercase();
    let mut replaced = String::new();
    let mut rest = 0;
    for (at, _) in lower.match_indices(word) {
        replaced.push_str(&line[rest..at]);
        replaced.push_str(shown);
        rest = at + word.len();
    }
    if rest == 0 { line } else { replaced + &line[rest..] }
}

fn is_unsafe(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{2028}' | '\u{2029}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ordinary_text_passes_unchanged() {
        let text = "scène \"küche\": 3 warnings, 50 % done → ok";
        assert!(matches!(one_line(text), Cow::Borrowed(same) if same == text));
        assert_eq!(lines(text).collect::<Vec<_>>(), [text]);
    }

    #[test]
    fn control_lines_cannot_be_forged() {
        let forged = "a\rALF_PROGRESS 99%\nopenjd_fail: x\u{2028}Finished Rendering\u{1b}[2K";
        let shown: Vec<_> = lines(forged).collect();
        assert_eq!(shown, ["a\\rALF-PROGRESS 99%", "openjd-fail: x\\u{2028}finished-rendering\\u{1b}[2K"]);
        assert_eq!(lines("Error: [ERROR] error: Image:").next().unwrap(), "Error; (error) error: image;");
    }

    #[test]
    fn no_replacement_makes_a_new_control_word() {
        for (_, shown) in CONTROL_WORDS {
            assert!(CONTROL_WORDS.iter().all(|(word, _)| !shown.to_ascii_lowercase().contains(word)), "{shown}");
        }
        let nested = lines("@@IMAGE@IMAGE@ ALF_ALF_PROGRESSPROGRESS:: [Err[Error]or] openjd_openjd__").next().unwrap();
        let lower = nested.to_ascii_lowercase();
        assert!(CONTROL_WORDS.iter().all(|(word, _)| !lower.contains(word)), "{nested}");
    }
}

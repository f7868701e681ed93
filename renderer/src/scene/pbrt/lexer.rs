//! Bytes to tokens: words, quoted strings and brackets.
//!
//! The scanner works on bytes, allocates nothing and cannot fail: what is not a token of the grammar is still a word,
//! and whoever expected something else says so.

use std::borrow::Cow;

/// What a token is, before anyone looks at its text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A directive, a number, `true`, `false`: anything up to a space, quote, bracket or comment.
    Word,
    /// A string between quotes.
    Quoted,
    /// A string without its closing quote: ends with the line.
    Unterminated,
    /// `[`
    Open,
    /// `]`
    Close,
}

/// A token, by its bytes `start..end` in the text. A quoted one includes its quotes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Token {
    pub(super) kind: Kind,
    pub(super) start: usize,
    pub(super) end: usize,
}

/// Why a word is not the number that was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NotANumber {
    /// It does not spell one.
    Malformed,
    /// It spells one that does not fit.
    TooLarge,
    /// It spells one with a fraction, where a whole one is needed.
    Fraction,
}

/// A scanner over the text of one file.
#[derive(Clone, Debug)]
pub(super) struct Lexer<'t> {
    text: &'t [u8],
    at: usize,
}

impl<'t> Lexer<'t> {
    pub(super) fn new(text: &'t [u8]) -> Self {
        // Editors on Windows put a byte-order mark in front of UTF-8.
        let at = if text.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Self { text, at }
    }

    /// Byte offset of the next unread byte.
    pub(super) fn position(&self) -> usize {
        self.at
    }

    /// The bytes of a token.
    pub(super) fn bytes(&self, token: Token) -> &'t [u8] {
        &self.text[token.start..token.end]
    }

    /// The next token, or `None` at the end of the file.
    #[inline]
    pub(super) fn next(&mut self) -> Option<Token> {
        self.skip_space();
        let start = self.at;
        let kind = match *self.text.get(start)? {
            b'"' => self.quoted(),
            b'[' => {
                self.at += 1;
                Kind::Open
            }
            b']' => {
                self.at += 1;
                Kind::Close
            }
            _ => {
                let rest = &self.text[start..];
                self.at += rest.iter().position(|&b| ends_word(b)).unwrap_or(rest.len());
                Kind::Word
            }
        };
        Some(Token { kind, start, end: self.at })
    }

    /// The scanner as it was before it read `token`.
    pub(super) fn rewound(&self, token: Token) -> Self {
        Self { text: self.text, at: token.start }
    }

    #[inline]
    fn skip_space(&mut self) {
        while let Some(&b) = self.text.get(self.at) {
            match b {
                b' ' | b'\n' | b'\t' | b'\r' => self.at += 1,
                b'#' => {
                    let rest = &self.text[self.at..];
                    self.at += rest.iter().position(|&b| b == b'\n' || b == b'\r').unwrap_or(rest.len());
                }
                _ => return,
            }
        }
    }

    fn quoted(&mut self) -> Kind {
        self.at += 1;
        while let Some(&b) = self.text.get(self.at) {
            match b {
                b'"' => {
                    self.at += 1;
                    return Kind::Quoted;
                }
                b'\n' => return Kind::Unterminated,
                // An escaped character may be a quote, but a string never runs into the next line.
                b'\\' if self.text.get(self.at + 1).is_some_and(|&next| next != b'\n') => self.at += 2,
                _ => self.at += 1,
            }
        }
        Kind::Unterminated
    }

    /// What stands between the quotes, escapes decoded. Bytes that are not UTF-8 become U+FFFD.
    pub(super) fn content(&self, token: Token) -> Cow<'t, str> {
        let bytes = self.bytes(token);
        let inner = match token.kind {
            Kind::Quoted => &bytes[1..bytes.len() - 1],
            Kind::Unterminated => &bytes[1..],
            _ => bytes,
        };
        if token.kind == Kind::Quoted && inner.contains(&b'\\') {
            return Cow::Owned(String::from_utf8_lossy(&unescape(inner)).into_owned());
        }
        String::from_utf8_lossy(inner)
    }
}

#[inline]
fn ends_word(b: u8) -> bool {
    matches!(b, b' ' | b'\n' | b'\t' | b'\r' | b'"' | b'[' | b']' | b'#')
}

fn unescape(text: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(text.len());
    let mut bytes = text.iter().copied();
    while let Some(b) = bytes.next() {
        if b != b'\\' {
            out.push(b);
            continue;
        }
        match bytes.next() {
            Some(b'b') => out.push(8),
            Some(b'f') => out.push(12),
            Some(b'n') => out.push(b'\n'),
            Some(b'r') => out.push(b'\r'),
            Some(b't') => out.push(b'\t'),
            Some(b @ (b'\\' | b'\'' | b'"')) => out.push(b),
            // Not an escape of the grammar: most likely a Windows path.
            Some(b) => out.extend([b'\\', b]),
            None => out.push(b'\\'),
        }
    }
    out
}

/// Only what spells a decimal number reaches the standard parsers, which would also take `nan` and `infinity`.
fn spells_number(word: &[u8]) -> Option<&str> {
    let decimal = word.iter().all(|b| matches!(b, b'0'..=b'9' | b'+' | b'-' | b'.' | b'e' | b'E'));
    if decimal { std::str::from_utf8(word).ok() } else { None }
}

/// The word as a finite `f32`.
pub(super) fn parse_f32(word: &[u8]) -> Result<f32, NotANumber> {
    let value: f32 = spells_number(word).and_then(|text| text.parse().ok()).ok_or(NotANumber::Malformed)?;
    if value.is_finite() { Ok(value) } else { Err(NotANumber::TooLarge) }
}

/// The word as a finite `f64`.
pub(super) fn parse_f64(word: &[u8]) -> Result<f64, NotANumber> {
    let value: f64 = spells_number(word).and_then(|text| text.parse().ok()).ok_or(NotANumber::Malformed)?;
    if value.is_finite() { Ok(value) } else { Err(NotANumber::TooLarge) }
}

/// The word as an `i32`.
pub(super) fn parse_i32(word: &[u8]) -> Result<i32, NotANumber> {
    // Most integers of a scene are indices: up to nine digits, which cannot overflow.
    if (1..=9).contains(&word.len()) && word.iter().all(u8::is_ascii_digit) {
        return Ok(word.iter().fold(0, |value, &digit| 10 * value + i32::from(digit - b'0')));
    }
    let text = spells_number(word).ok_or(NotANumber::Malformed)?;
    if let Ok(value) = text.parse() {
        return Ok(value);
    }
    match text.parse::<f64>() {
        Ok(value) if value.fract() == 0.0 && value.abs() > f64::from(i32::MAX) => Err(NotANumber::TooLarge),
        Ok(_) => Err(NotANumber::Fraction),
        Err(_) => Err(NotANumber::Malformed),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tokens(text: &str) -> Vec<(Kind, String)> {
        let mut lexer = Lexer::new(text.as_bytes());
        std::iter::from_fn(|| lexer.next().map(|t| (t.kind, lexer.content(t).into_owned()))).collect()
    }

    #[test]
    fn words_strings_brackets_and_comments_are_told_apart() {
        use Kind::*;
        let expected = [(Word, "Shape"), (Quoted, "a b"), (Open, "["), (Word, "1"), (Word, "-2.5e3"), (Close, "]")];
        let expected = expected.map(|(kind, text)| (kind, text.to_owned()));
        assert_eq!(tokens("# c \"\nShape\"a b\"[1 -2.5e3]# end"), expected);
        assert_eq!(tokens("\u{feff}Shape \"a b\"\r\n[ 1\t-2.5e3 ]"), expected);
    }

    #[test]
    fn escapes_are_decoded_and_windows_paths_survive() {
        assert_eq!(tokens(r#""a\"b\\c\n" "C:\Ab""#)[0].1, "a\"b\\c\n");
        assert_eq!(tokens(r#""C:\Ab""#)[0].1, r"C:\Ab");
    }

    #[test]
    fn a_string_ends_with_its_line() {
        assert_eq!(tokens("\"ab\nShape"), [(Kind::Unterminated, "ab".to_owned()), (Kind::Word, "Shape".to_owned())]);
        assert_eq!(tokens("\"ab\\"), [(Kind::Unterminated, "ab\\".to_owned())]);
        assert_eq!(tokens("\"a\\\nb"), [(Kind::Unterminated, "a\\".to_owned()), (Kind::Word, "b".to_owned())]);
    }

    #[test]
    fn numbers_are_finite_decimals() {
        assert_eq!(parse_f32(b"-.5"), Ok(-0.5));
        assert_eq!(parse_f32(b"1.e+2"), Ok(100.0));
        assert_eq!(parse_f32(b"1e-60"), Ok(0.0));
        for word in [&b"nan"[..], b"inf", b"-", b"", b"1e", b"0x10", b"1,5", b"1.2.3", b"\xff"] {
            assert_eq!(parse_f32(word), Err(NotANumber::Malformed), "{word:?}");
            assert_eq!(parse_f64(word), Err(NotANumber::Malformed), "{word:?}");
        }
        assert_eq!(parse_f32(b"1e39"), Err(NotANumber::TooLarge));
        assert_eq!(parse_f64(b"1e309"), Err(NotANumber::TooLarge));
        assert_eq!(parse_i32(b"+7"), Ok(7));
        assert_eq!(parse_i32(b"7.5"), Err(NotANumber::Fraction));
        assert_eq!(parse_i32(b"7.0"), Err(NotANumber::Fraction));
        assert_eq!(parse_i32(b"-2147483649"), Err(NotANumber::TooLarge));
    }
}

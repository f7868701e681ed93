//! The files of a scene and the place in one of them where reading goes on.

use std::borrow::Cow;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::lexer::{Kind, Lexer, NotANumber, Token, parse_f64};
use super::report::{Report, shown};
use super::syntax::DIRECTIVES;
use crate::scene::{PathMap, SourceMap, Span};

/// Something was wrong and has been reported: go on with the next directive.
#[derive(Debug)]
pub(super) struct Fault;

/// Reads a whole file, unpacking it if it starts as gzip does.
///
/// # Errors
/// A sentence without the file's name. Devices and pipes, which might never end, are refused.
pub(in crate::scene) fn read_file(path: &Path) -> Result<Vec<u8>, String> {
    let data = fs::metadata(path).map_err(|why| why.to_string())?;
    if !data.is_file() {
        return Err("not a file".to_owned());
    }
    let bytes = fs::read(path).map_err(|why| why.to_string())?;
    if !bytes.starts_with(&[0x1f, 0x8b]) {
        return Ok(bytes);
    }
    let mut unpacked = Vec::new();
    match flate2::bufread::MultiGzDecoder::new(bytes.as_slice()).read_to_end(&mut unpacked) {
        Ok(_) => Ok(unpacked),
        Err(why) => Err(format!("the gzip data is damaged: {why}")),
    }
}

/// The files that were read, and where others are looked for.
#[derive(Debug, Default)]
pub(super) struct Files {
    pub(super) sources: SourceMap,
    /// Folder of the scene file: paths in a scene are relative to it.
    pub(super) folder: PathBuf,
    /// Where files are that the scene has elsewhere.
    pub(super) map: PathMap,
}

impl Files {
    /// Makes a text known.
    ///
    /// # Errors
    /// When it is longer than a span can say.
    pub(super) fn add(&mut self, path: &Path, text: Vec<u8>) -> Result<(u32, Arc<[u8]>), String> {
        if u32::try_from(text.len()).is_err() {
            return Err("larger than 4 GiB: split it and use Include".to_owned());
        }
        let text: Arc<[u8]> = text.into();
        Ok((self.sources.add(path, Arc::clone(&text)), text))
    }

    /// The path that `name` in file `file` means: relative to the folder of the scene, as pbrt has it, or else relative
    /// to the file that says it.
    pub(super) fn resolve(&self, name: &str, file: u32) -> PathBuf {
        let name = self.map.apply(name);
        let by_scene = self.folder.join(&name);
        if name.is_relative() && !by_scene.exists() {
            if let Some(by_file) = self.sources.path(file).parent().map(|folder| folder.join(&name)) {
                if by_file.exists() {
                    return by_file;
                }
            }
        }
        by_scene
    }
}

/// Where reading is, in one file.
pub(super) struct Cursor<'t, 'r> {
    lexer: Lexer<'t>,
    peeked: Option<Token>,
    file: u32,
    pub(super) report: &'r mut Report,
}

impl<'t, 'r> Cursor<'t, 'r> {
    pub(super) fn new(lexer: Lexer<'t>, file: u32, report: &'r mut Report) -> Self {
        Self { lexer, peeked: None, file, report }
    }

    /// The scanner, to go on with later.
    pub(super) fn into_lexer(self) -> Lexer<'t> {
        match self.peeked {
            Some(token) => self.lexer.rewound(token),
            None => self.lexer,
        }
    }

    /// The next token without reading it.
    #[inline]
    pub(super) fn peek(&mut self) -> Option<Token> {
        if self.peeked.is_none() {
            self.peeked = self.lexer.next();
        }
        self.peeked
    }

    /// Reads the peeked token.
    #[inline]
    pub(super) fn advance(&mut self) {
        self.peeked = None;
    }

    /// Its bytes.
    #[inline]
    pub(super) fn bytes(&self, token: Token) -> &'t [u8] {
        self.lexer.bytes(token)
    }

    /// Its text, without quotes.
    pub(super) fn content(&self, token: Token) -> Cow<'t, str> {
        self.lexer.content(token)
    }

    /// Its place.
    pub(super) fn span(&self, token: Token) -> Span {
        // `Files::add` lets no longer text in.
        Span { file: self.file, start: token.start as u32, end: token.end as u32 }
    }

    /// The place after everything.
    pub(super) fn end(&self) -> Span {
        let end = self.lexer.position() as u32;
        Span { file: self.file, start: end, end }
    }

    /// Whether the token begins a directive: where to go on after an error.
    #[inline]
    pub(super) fn is_directive(&self, token: Token) -> bool {
        token.kind == Kind::Word
            && self.bytes(token).first().is_some_and(u8::is_ascii_uppercase)
            && DIRECTIVES.iter().any(|name| name.as_bytes() == self.bytes(token))
    }

    /// Reports an error.
    pub(super) fn fault(&mut self, span: Span, text: impl Into<String>) -> Fault {
        self.report.error(span, text);
        Fault
    }

    /// Steps forward to the next directive, or to the end.
    pub(super) fn recover(&mut self) {
        while self.peek().is_some_and(|token| !self.is_directive(token)) {
            self.advance();
        }
    }

    /// Reads a string in quotes; `what` names it in the error.
    pub(super) fn string(&mut self, what: &str) -> Result<(String, Span), Fault> {
        match self.peek() {
            Some(token) if token.kind == Kind::Quoted => {
                self.advance();
                Ok((self.content(token).into_owned(), self.span(token)))
            }
            found => Err(self.unexpected(found, &format!("{what} in quotes"))),
        }
    }

    /// Reads `N` numbers, with or without brackets around them.
    pub(super) fn numbers<const N: usize>(&mut self) -> Result<[f64; N], Fault> {
        let open = self.peek().is_some_and(|token| token.kind == Kind::Open);
        if open {
            self.advance();
        }
        let expected = |read: usize| match read {
            0 => format!("{N} numbers"),
            _ => format!("{N} numbers, of which {read} came"),
        };
        let mut numbers = [0.0; N];
        for (index, number) in numbers.iter_mut().enumerate() {
            match self.peek() {
                Some(token) if token.kind == Kind::Word => match parse_f64(self.bytes(token)) {
                    Ok(value) => {
                        *number = value;
                        self.advance();
                    }
                    Err(NotANumber::TooLarge) => {
                        let word = shown(&self.content(token));
                        return Err(self.fault(self.span(token), format!("the number {word} is too large")));
                    }
                    Err(_) => return Err(self.unexpected(Some(token), &expected(index))),
                },
                found => return Err(self.unexpected(found, &expected(index))),
            }
        }
        match self.peek() {
            Some(token) if open && token.kind == Kind::Close => self.advance(),
            found if open => return Err(self.unexpected(found, "a closing bracket")),
            _ => {}
        }
        Ok(numbers)
    }

    /// Reports that something else was expected than what was found.
    pub(super) fn unexpected(&mut self, found: Option<Token>, expected: &str) -> Fault {
        let Some(token) = found else {
            return self.fault(self.end(), format!("expected {expected}, found the end of the file"));
        };
        let text = match token.kind {
            Kind::Unterminated => "the string has no closing quote on this line".to_owned(),
            _ => format!("expected {expected}, found {}", shown(&String::from_utf8_lossy(self.bytes(token)))),
        };
        self.fault(self.span(token), text)
    }
}

//! One parameter of a directive: `"type name" values`, as the file gives it.

use super::lexer::{Kind, NotANumber, Token, parse_f32, parse_i32};
use super::report::{did_you_mean, shown};
use super::source::{Cursor, Fault};
use crate::scene::Span;
use crate::spectrum::RgbSpace;

/// The declared type of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ParamType {
    Bool,
    Float,
    Integer,
    Point2,
    Vector2,
    Point3,
    Vector3,
    Normal,
    String,
    Texture,
    Rgb,
    Spectrum,
    Blackbody,
}

impl ParamType {
    /// Names in files. The last four are those of older versions of the format.
    const NAMES: [(&'static str, ParamType); 17] = [
        ("bool", Self::Bool),
        ("float", Self::Float),
        ("integer", Self::Integer),
        ("point2", Self::Point2),
        ("vector2", Self::Vector2),
        ("point3", Self::Point3),
        ("vector3", Self::Vector3),
        ("normal", Self::Normal),
        ("string", Self::String),
        ("texture", Self::Texture),
        ("rgb", Self::Rgb),
        ("spectrum", Self::Spectrum),
        ("blackbody", Self::Blackbody),
        ("normal3", Self::Normal),
        ("point", Self::Point3),
        ("vector", Self::Vector3),
        ("color", Self::Rgb),
    ];

    fn from_name(name: &str) -> Option<Self> {
        Self::NAMES.iter().find(|(known, _)| *known == name).map(|&(_, kind)| kind)
    }

    /// Its name in a file.
    pub(super) fn name(self) -> &'static str {
        Self::NAMES.iter().find(|&&(_, kind)| kind == self).map_or("", |(name, _)| name)
    }

    /// How many numbers make one value, where values are numbers.
    pub(super) fn size(self) -> usize {
        match self {
            Self::Point2 | Self::Vector2 => 2,
            Self::Point3 | Self::Vector3 | Self::Normal | Self::Rgb => 3,
            _ => 1,
        }
    }
}

/// The values of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    Floats(Vec<f32>),
    Integers(Vec<i32>),
    Bools(Vec<bool>),
    Strings(Vec<String>),
    /// They were wrong, which has been told.
    Faulty,
}

/// A parameter.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Param {
    pub(super) kind: ParamType,
    pub(super) name: Box<str>,
    pub(super) values: Values,
    /// Of the declaration, the part in quotes.
    pub(super) span: Span,
    /// In which the file's RGB values of this parameter are.
    pub(super) color_space: RgbSpace,
    /// Given by `Attribute` for whoever knows it, so nobody needs to.
    pub(super) inherited: bool,
    /// Somebody asked for it.
    pub(super) used: bool,
}

/// Reads the parameters that follow a directive. What is wrong with one is reported and leaves that one out.
pub(super) fn read_params(cursor: &mut Cursor<'_, '_>, color_space: RgbSpace) -> Vec<Param> {
    let mut params: Vec<Param> = Vec::new();
    while let Some(token) = cursor.peek().filter(|t| matches!(t.kind, Kind::Quoted | Kind::Unterminated)) {
        cursor.advance();
        let span = cursor.span(token);
        let Ok((kind, name)) = declaration(cursor, token) else {
            skip_values(cursor);
            continue;
        };
        let values = read_values(cursor, kind, &name, span).unwrap_or(Values::Faulty);
        if params.iter().any(|p| p.name == name) {
            let text = format!("\"{name}\" is given twice: the last one counts");
            cursor.report.warning(format!("twice {name}"), span, text);
            params.retain(|p| p.name != name);
        }
        params.push(Param { kind, name, values, span, color_space, inherited: false, used: false });
    }
    params
}

fn declaration(cursor: &mut Cursor<'_, '_>, token: Token) -> Result<(ParamType, Box<str>), Fault> {
    let text = cursor.content(token);
    let span = cursor.span(token);
    let quote = || shown(&text);
    if token.kind == Kind::Unterminated {
        return Err(cursor.fault(span, "the string has no closing quote on this line"));
    }
    let mut words = text.split_ascii_whitespace();
    let (Some(type_name), Some(name), rest) = (words.next(), words.next(), words.next()) else {
        return Err(cursor.fault(span, format!("expected a parameter as \"type name\", found \"{}\"", quote())));
    };
    if rest.is_some() {
        return Err(
            cursor.fault(span, format!("expected a parameter as \"type name\", found more words in \"{}\"", quote()))
        );
    }
    let Some(kind) = ParamType::from_name(type_name) else {
        let hint = did_you_mean(type_name, ParamType::NAMES.iter().map(|(name, _)| *name));
        return Err(cursor.fault(span, format!("\"{}\" is not a type of parameter{hint}", shown(type_name))));
    };
    if matches!(type_name, "point" | "vector" | "color") {
        let text = format!("\"{type_name}\" is the older name of the type \"{}\"", kind.name());
        cursor.report.warning(format!("older type {type_name}"), span, text);
    }
    Ok((kind, name.into()))
}

/// Steps over the values of a parameter that could not be understood.
fn skip_values(cursor: &mut Cursor<'_, '_>) {
    match cursor.peek() {
        Some(token) if token.kind == Kind::Open => {
            while let Some(token) = cursor.peek().filter(|&token| !cursor.is_directive(token)) {
                cursor.advance();
                if token.kind == Kind::Close {
                    return;
                }
            }
        }
        Some(token) if token.kind == Kind::Word && !cursor.is_directive(token) => cursor.advance(),
        // A string may be this parameter's value or the next one's declaration.
        Some(token) if token.kind == Kind::Quoted && !cursor.content(token).contains(' ') => cursor.advance(),
        _ => {}
    }
}

fn read_values(cursor: &mut Cursor<'_, '_>, kind: ParamType, name: &str, span: Span) -> Result<Values, Fault> {
    let mut sink = Sink::new(kind);
    let mut fault = None;
    match cursor.peek() {
        Some(token) if token.kind == Kind::Open => {
            cursor.advance();
            loop {
                match cursor.peek() {
                    Some(token) if token.kind == Kind::Close => {
                        cursor.advance();
                        break;
                    }
                    Some(token) if !cursor.is_directive(token) => {
                        cursor.advance();
                        if let Err(why) = sink.push(cursor, token) {
                            // One message for a list, however much of it is wrong.
                            fault = fault.or_else(|| Some(cursor.fault(cursor.span(token), why)));
                        }
                    }
                    _ => return Err(cursor.fault(span, format!("the values of \"{name}\" have no closing bracket"))),
                }
            }
        }
        Some(token) if !cursor.is_directive(token) && token.kind != Kind::Close => {
            cursor.advance();
            if let Err(why) = sink.push(cursor, token) {
                fault = Some(cursor.fault(cursor.span(token), why));
            }
        }
        _ => return Err(cursor.fault(span, format!("\"{name}\" has no value"))),
    }
    if let Some(fault) = fault {
        return Err(fault);
    }
    let (count, size) = (sink.len(), kind.size());
    if count == 0 {
        return Err(cursor.fault(span, format!("\"{name}\" has no value")));
    }
    if count % size != 0 {
        let text = format!("\"{name}\" has {count} numbers, but {} takes {size} each", kind.name());
        return Err(cursor.fault(span, text));
    }
    Ok(sink.values)
}

/// Values as they come in.
struct Sink {
    kind: ParamType,
    values: Values,
}

impl Sink {
    fn new(kind: ParamType) -> Self {
        let values = match kind {
            ParamType::Bool => Values::Bools(Vec::new()),
            ParamType::Integer => Values::Integers(Vec::new()),
            ParamType::String | ParamType::Texture => Values::Strings(Vec::new()),
            _ => Values::Floats(Vec::new()),
        };
        Self { kind, values }
    }

    fn len(&self) -> usize {
        match &self.values {
            Values::Floats(values) => values.len(),
            Values::Integers(values) => values.len(),
            Values::Bools(values) => values.len(),
            Values::Strings(values) => values.len(),
            Values::Faulty => 0,
        }
    }

    #[inline]
    fn push(&mut self, cursor: &Cursor<'_, '_>, token: Token) -> Result<(), String> {
        match token.kind {
            Kind::Word => self.push_word(cursor.bytes(token)),
            Kind::Quoted => self.push_string(&cursor.content(token)),
            Kind::Unterminated => Err("the string has no closing quote on this line".to_owned()),
            Kind::Open | Kind::Close => Err("a bracket within brackets".to_owned()),
        }
    }

    #[inline]
    fn push_word(&mut self, word: &[u8]) -> Result<(), String> {
        let number = match &mut self.values {
            Values::Floats(values) => parse_f32(word).map(|value| values.push(value)),
            Values::Integers(values) => parse_i32(word).map(|value| values.push(value)),
            Values::Bools(values) => return push_bool(values, &String::from_utf8_lossy(word)),
            Values::Strings(_) | Values::Faulty => {
                let word = shown(&String::from_utf8_lossy(word));
                return Err(format!("expected a string in quotes, found {word}"));
            }
        };
        number.map_err(|why| self.not_a_number(why, word))
    }

    fn push_string(&mut self, text: &str) -> Result<(), String> {
        // A spectrum is a list of numbers or a name: the first value tells.
        if self.kind == ParamType::Spectrum && self.len() == 0 {
            self.values = Values::Strings(Vec::new());
        }
        match &mut self.values {
            Values::Strings(values) => values.push(text.to_owned()),
            Values::Bools(values) => return push_bool(values, text),
            _ => return Err(format!("expected a number, found the string \"{}\"", shown(text))),
        }
        Ok(())
    }

    fn not_a_number(&self, why: NotANumber, word: &[u8]) -> String {
        let word = shown(&String::from_utf8_lossy(word));
        match why {
            NotANumber::Malformed => format!("expected a number, found {word}"),
            NotANumber::TooLarge => format!("the number {word} is too large"),
            NotANumber::Fraction => format!("expected a whole number without a decimal point, found {word}"),
        }
    }
}

fn push_bool(values: &mut Vec<bool>, text: &str) -> Result<(), String> {
    values.push(match text {
        "true" => true,
        "false" => false,
        _ => return Err(format!("expected true or false, found {}", shown(text))),
    });
    Ok(())
}

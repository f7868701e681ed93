//! The header of a PLY file.

use super::PlyError;

/// How the data after the header is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// A type of number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Bytes of one in a binary file.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// What each row of an element holds.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Property {
    /// One number.
    Scalar { name: String, kind: Scalar },
    /// A length and as many numbers.
    List { name: String, length: Scalar, kind: Scalar },
}

/// A table of the file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) count: usize,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// The index of a scalar property.
    pub(super) fn scalar(&self, wanted: &str) -> Option<usize> {
        self.properties.iter().position(|p| matches!(p, Property::Scalar { name, .. } if name == wanted))
    }

    /// The index of a list property by any of its names.
    pub(super) fn list(&self, wanted: &[&str]) -> Option<usize> {
        self.properties.iter().position(|p| matches!(p, Property::List { name, .. } if wanted.contains(&name.as_str())))
    }

    /// Bytes of a row in a binary file, and the offset of each property; `None` if there are lists.
    pub(super) fn layout(&self) -> Option<(usize, Vec<(usize, Scalar)>)> {
        let mut size = 0;
        let mut offsets = Vec::with_capacity(self.properties.len());
        for property in &self.properties {
            let Property::Scalar { kind, .. } = property else { return None };
            offsets.push((size, *kind));
            size += kind.size();
        }
        Some((size, offsets))
    }

    /// The fewest bytes that a row takes in any encoding. Not 0 where there are properties.
    pub(super) fn least_row_size(&self) -> usize {
        self.properties.len()
    }
}

/// The header.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// Offset of the first byte of the data.
    pub(super) end: usize,
}

impl Header {
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, PlyError> {
        let mut lines = Lines { bytes, at: 0, line: 0 };
        if lines.next()?.trim_end() != "ply" {
            return Err(lines.error("a PLY file starts with the line \"ply\""));
        }
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        loop {
            let line = lines.next()?;
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            match words.as_slice() {
                ["end_header"] => break,
                [] | ["comment" | "obj_info", ..] => {}
                ["format", name, "1.0"] => {
                    encoding = Some(match *name {
                        "ascii" => Encoding::Ascii,
                        "binary_little_endian" => Encoding::LittleEndian,
                        "binary_big_endian" => Encoding::BigEndian,
                        _ => return Err(lines.error("the format is ascii, binary_little_endian or binary_big_endian")),
                    });
                }
                ["format", ..] => return Err(lines.error("expected \"format ENCODING 1.0\"")),
                ["element", name, count] => {
                    let count = count.parse().map_err(|_| lines.error("an element has a whole number of rows"))?;
                    elements.push(Element { name: (*name).to_owned(), count, properties: Vec::new() });
                }
                ["property", rest @ ..] => {
                    let property = property(rest).map_err(|message| lines.error(message))?;
                    let element = elements.last_mut().ok_or_else(|| lines.error("a property before any element"))?;
                    element.properties.push(property);
                }
                _ => return Err(lines.error("expected format, element, property, comment or end_header")),
            }
        }
        let encoding = encoding.ok_or_else(|| lines.error("the header has no line \"format\""))?;
        Ok(Self { encoding, elements, end: lines.at })
    }
}

fn property(words: &[&str]) -> Result<Property, &'static str> {
    const TYPES: &str = "a property's type is one of char uchar short ushort int uint float double";
    let kind = |name: &str| Scalar::from_name(name).ok_or(TYPES);
    match *words {
        ["list", length, of, name] => {
            let length = kind(length)?;
            if matches!(length, Scalar::F32 | Scalar::F64) {
                return Err("the length of a list is a whole number");
            }
            Ok(Property::List { name: name.to_owned(), length, kind: kind(of)? })
        }
        [of, name] => Ok(Property::Scalar { name: name.to_owned(), kind: kind(of)? }),
        _ => Err("expected \"property TYPE NAME\" or \"property list TYPE TYPE NAME\""),
    }
}

struct Lines<'b> {
    bytes: &'b [u8],
    at: usize,
    line: usize,
}

impl<'b> Lines<'b> {
    fn next(&mut self) -> Result<&'b str, PlyError> {
        // No line of a header is longer; without its end, what follows may be any amount of garbage.
        const LONGEST: usize = 4096;
        self.line += 1;
        let rest = &self.bytes[self.at..];
        let reach = &rest[..rest.len().min(LONGEST)];
        let Some(end) = reach.iter().position(|&b| b == b'\n' || b == b'\r') else {
            return Err(self.error("the header has no end_header"));
        };
        self.at += end + 1;
        if rest[end] == b'\r' && rest.get(end + 1) == Some(&b'\n') {
            self.at += 1;
        }
        let comment = rest.starts_with(b"comment") || rest.starts_with(b"obj_info");
        match std::str::from_utf8(&rest[..end]) {
            Ok(line) => Ok(line),
            Err(_) if comment => Ok("comment"),
            Err(_) => Err(self.error("the line is not text")),
        }
    }

    fn error(&self, message: &str) -> PlyError {
        PlyError::Header { line: self.line, message: message.to_owned() }
    }
}

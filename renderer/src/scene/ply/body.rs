//! The data of a PLY file, row by row.

use glam::{Vec2, Vec3};

use super::header::{Element, Property, Scalar};
use super::{PlyError, Table};

/// A way of storing rows.
pub(super) trait Rows {
    /// Reads all scalar values of an element.
    fn table(&mut self, element: &Element) -> Result<impl Table, PlyError>;

    /// Reads an element and hands the values of its list property number `list` to `push`, row by row. Indices that do
    /// not fit in 32 bits become indices that no vertex has.
    fn lists(&mut self, element: &Element, list: usize, push: impl FnMut(&[u32])) -> Result<(), PlyError>;

    /// Steps over an element.
    fn skip(&mut self, element: &Element) -> Result<(), PlyError>;
}

/// Values one after the other.
trait Values {
    /// Offset of the next value, for messages.
    fn offset(&self) -> usize;

    /// The next value; `None` at the end of the data.
    fn value(&mut self, kind: Scalar) -> Result<Option<f64>, PlyError>;
}

/// Reads an element value by value: the general case.
fn read_rows(
    source: &mut impl Values,
    element: &Element,
    mut scalar: impl FnMut(usize, f64),
    mut list: impl FnMut(usize, &[f64]),
) -> Result<(), PlyError> {
    let mut items = Vec::new();
    for row in 0..element.count {
        for (column, property) in element.properties.iter().enumerate() {
            let start = source.offset();
            let truncated = |source: &mut _| truncated(Values::offset(source), element, row);
            match *property {
                Property::Scalar { kind, .. } => {
                    let value = source.value(kind)?;
                    scalar(column, value.ok_or_else(|| truncated(source))?);
                }
                Property::List { length, kind, .. } => {
                    let length = source.value(length)?;
                    let length = length.ok_or_else(|| truncated(source))?;
                    if length < 0.0 || length.fract() != 0.0 || length > f64::from(u32::MAX) {
                        let (element, offset) = (element.name.clone(), start);
                        return Err(PlyError::ListLength { offset, length, element, row });
                    }
                    items.clear();
                    for _ in 0..length as u32 {
                        let value = source.value(kind)?;
                        items.push(value.ok_or_else(|| truncated(source))?);
                    }
                    list(column, &items);
                }
            }
        }
    }
    Ok(())
}

fn truncated(offset: usize, element: &Element, row: usize) -> PlyError {
    PlyError::Truncated { offset, element: element.name.clone(), row, count: element.count }
}

/// An index as stored, or one that no vertex has.
fn index(value: f64) -> u32 {
    if (0.0..=f64::from(u32::MAX)).contains(&value) && value.fract() == 0.0 {
        value as u32
    } else {
        (value as i32).min(-1) as u32
    }
}

/// Scalar values in columns.
struct Columns(Vec<Vec<f32>>);

impl Columns {
    /// Reads an element value by value. `most` bounds the rows that the data can hold.
    fn read(source: &mut impl Values, element: &Element, most: usize) -> Result<Self, PlyError> {
        let capacity = element.count.min(most);
        let mut columns: Vec<Vec<f32>> = element.properties.iter().map(|_| Vec::with_capacity(capacity)).collect();
        read_rows(source, element, |column, value| columns[column].push(value as f32), |_, _| {})?;
        Ok(Self(columns))
    }
}

impl Table for Columns {
    fn vec3s(&self, columns: &[usize]) -> Vec<Vec3> {
        let [x, y, z] = [0, 1, 2].map(|axis| &self.0[columns[axis]]);
        x.iter().zip(y).zip(z).map(|((&x, &y), &z)| Vec3::new(x, y, z)).collect()
    }

    fn vec2s(&self, columns: &[usize]) -> Vec<Vec2> {
        let [u, v] = [0, 1].map(|axis| &self.0[columns[axis]]);
        u.iter().zip(v).map(|(&u, &v)| Vec2::new(u, v)).collect()
    }
}

/// Words.
pub(super) struct Ascii<'b> {
    bytes: &'b [u8],
    at: usize,
}

impl<'b> Ascii<'b> {
    pub(super) fn new(bytes: &'b [u8], at: usize) -> Self {
        Self { bytes, at }
    }

    /// Most rows that the rest can hold: a value is a digit and a space.
    fn most_rows(&self, element: &Element) -> usize {
        (self.bytes.len() - self.at) / (2 * element.least_row_size()).max(1) + 1
    }
}

impl Values for Ascii<'_> {
    fn offset(&self) -> usize {
        self.at
    }

    fn value(&mut self, _: Scalar) -> Result<Option<f64>, PlyError> {
        let rest = &self.bytes[self.at..];
        let Some(start) = rest.iter().position(|b| !b.is_ascii_whitespace()) else { return Ok(None) };
        let rest = &rest[start..];
        let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        let word = &rest[..end];
        let parsed = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
        if parsed.is_none() {
            let line = 1 + self.bytes[..self.at + start].iter().filter(|&&b| b == b'\n').count();
            let word = word.iter().take(40).copied().collect::<Vec<u8>>();
            return Err(PlyError::NotANumber { line, word: String::from_utf8_lossy(&word).escape_debug().to_string() });
        }
        self.at += start + end;
        Ok(parsed)
    }
}

impl Rows for Ascii<'_> {
    fn table(&mut self, element: &Element) -> Result<impl Table, PlyError> {
        let most = self.most_rows(element);
        Columns::read(self, element, most)
    }

    fn lists(&mut self, element: &Element, list: usize, mut push: impl FnMut(&[u32])) -> Result<(), PlyError> {
        rows_with_list(self, element, list, &mut push)
    }

    fn skip(&mut self, element: &Element) -> Result<(), PlyError> {
        read_rows(self, element, |_, _| {}, |_, _| {})
    }
}

fn rows_with_list(
    source: &mut impl Values,
    element: &Element,
    list: usize,
    push: &mut impl FnMut(&[u32]),
) -> Result<(), PlyError> {
    let mut indices = Vec::new();
    let each = |column: usize, items: &[f64]| {
        if column == list {
            indices.clear();
            indices.extend(items.iter().map(|&value| index(value)));
            push(&indices);
        }
    };
    read_rows(source, element, |_, _| {}, each)
}

/// Bytes.
pub(super) struct Binary<'b> {
    bytes: &'b [u8],
    at: usize,
    big_endian: bool,
}

impl<'b> Binary<'b> {
    pub(super) fn new(bytes: &'b [u8], at: usize, big_endian: bool) -> Self {
        Self { bytes, at, big_endian }
    }

    /// Takes all rows of an element of fixed size.
    fn take_rows(&mut self, element: &Element, size: usize) -> Result<&'b [u8], PlyError> {
        let rest = &self.bytes[self.at..];
        let end = element.count.checked_mul(size).filter(|&end| end <= rest.len());
        let end = end.ok_or_else(|| truncated(self.bytes.len(), element, rest.len() / size))?;
        self.at += end;
        Ok(&rest[..end])
    }

    /// The usual faces: a byte and as many 32-bit integers.
    fn usual_lists(&mut self, element: &Element, push: &mut impl FnMut(&[u32])) -> Result<(), PlyError> {
        let big_endian = self.big_endian;
        let word = |bytes: &[u8]| {
            let bytes = [bytes[0], bytes[1], bytes[2], bytes[3]];
            if big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) }
        };
        let mut corners = [0; 255];
        for row in 0..element.count {
            let rest = &self.bytes[self.at..];
            let taken = rest.split_first().and_then(|(&length, rest)| rest.get(..4 * usize::from(length)));
            let Some(taken) = taken else { return Err(truncated(self.bytes.len(), element, row)) };
            let corners = &mut corners[..taken.len() / 4];
            for (corner, bytes) in corners.iter_mut().zip(taken.chunks_exact(4)) {
                *corner = word(bytes);
            }
            push(corners);
            self.at += 1 + taken.len();
        }
        Ok(())
    }
}

impl Values for Binary<'_> {
    fn offset(&self) -> usize {
        self.at
    }

    #[inline]
    fn value(&mut self, kind: Scalar) -> Result<Option<f64>, PlyError> {
        let Some(bytes) = self.bytes.get(self.at..self.at + kind.size()) else {
            self.at = self.bytes.len();
            return Ok(None);
        };
        self.at += kind.size();
        Ok(Some(decode(kind, bytes, self.big_endian)))
    }
}

/// The number in `bytes`, which are as many as its kind has.
#[inline]
fn decode(kind: Scalar, bytes: &[u8], big_endian: bool) -> f64 {
    let mut word = [0; 8];
    let size = kind.size();
    word[..size].copy_from_slice(&bytes[..size]);
    if big_endian {
        word[..size].reverse();
    }
    let [a, b, c, d, ..] = word;
    match kind {
        Scalar::I8 => f64::from(a as i8),
        Scalar::U8 => f64::from(a),
        Scalar::I16 => f64::from(i16::from_le_bytes([a, b])),
        Scalar::U16 => f64::from(u16::from_le_bytes([a, b])),
        Scalar::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
        Scalar::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
        Scalar::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
        Scalar::F64 => f64::from_le_bytes(word),
    }
}

/// Rows of fixed size.
struct Fixed<'b> {
    rows: &'b [u8],
    size: usize,
    /// Offset and kind of each property in a row.
    layout: Vec<(usize, Scalar)>,
    big_endian: bool,
}

impl Fixed<'_> {
    /// Reads `N` columns of all rows.
    fn read<const N: usize, T>(&self, columns: &[usize], make: impl Fn([f32; N]) -> T) -> Vec<T> {
        let columns: [(usize, Scalar); N] = std::array::from_fn(|i| self.layout[columns[i]]);
        let rows = self.rows.chunks_exact(self.size);
        if !self.big_endian && columns.iter().all(|&(_, kind)| kind == Scalar::F32) {
            let offsets = columns.map(|(offset, _)| offset);
            let float = |row: &[u8], at: usize| f32::from_le_bytes([row[at], row[at + 1], row[at + 2], row[at + 3]]);
            return rows.map(|row| make(offsets.map(|at| float(row, at)))).collect();
        }
        rows.map(|row| make(columns.map(|(at, kind)| decode(kind, &row[at..], self.big_endian) as f32))).collect()
    }
}

impl Table for Fixed<'_> {
    fn vec3s(&self, columns: &[usize]) -> Vec<Vec3> {
        self.read(columns, Vec3::from_array)
    }

    fn vec2s(&self, columns: &[usize]) -> Vec<Vec2> {
        self.read(columns, Vec2::from_array)
    }
}

/// A table either way.
enum Either<A, B> {
    Fixed(A),
    Columns(B),
}

impl<A: Table, B: Table> Table for Either<A, B> {
    fn vec3s(&self, columns: &[usize]) -> Vec<Vec3> {
        match self {
            Self::Fixed(table) => table.vec3s(columns),
            Self::Columns(table) => table.vec3s(columns),
        }
    }

    fn vec2s(&self, columns: &[usize]) -> Vec<Vec2> {
        match self {
            Self::Fixed(table) => table.vec2s(columns),
            Self::Columns(table) => table.vec2s(columns),
        }
    }
}

impl Rows for Binary<'_> {
    fn table(&mut self, element: &Element) -> Result<impl Table, PlyError> {
        if let Some((size, layout)) = element.layout() {
            let rows = self.take_rows(element, size)?;
            return Ok(Either::Fixed(Fixed { rows, size, layout, big_endian: self.big_endian }));
        }
        let most = (self.bytes.len() - self.at) / element.least_row_size();
        Ok(Either::Columns(Columns::read(self, element, most)?))
    }

    fn lists(&mut self, element: &Element, list: usize, mut push: impl FnMut(&[u32])) -> Result<(), PlyError> {
        match element.properties[..] {
            [Property::List { length: Scalar::U8, kind: Scalar::I32 | Scalar::U32, .. }] => {
                self.usual_lists(element, &mut push)
            }
            _ => rows_with_list(self, element, list, &mut push),
        }
    }

    fn skip(&mut self, element: &Element) -> Result<(), PlyError> {
        match element.layout() {
            Some((size, _)) => self.take_rows(element, size).map(|_| ()),
            None => read_rows(self, element, |_, _| {}, |_, _| {}),
        }
    }
}

//! What reading and writing have in common: windows, channel formats, attributes.

/// A rectangle of pixels, `y` down.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Window {
    /// Left column.
    pub x: i32,
    /// Top row.
    pub y: i32,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl Window {
    /// A rectangle whose upper left pixel is (0, 0).
    pub fn at_origin(width: usize, height: usize) -> Self {
        Self { x: 0, y: 0, width, height }
    }
}

/// How one channel is stored in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Format {
    /// 8-bit integers that stand for 0 to 1.
    U8 = 0,
    /// 16-bit integers that stand for 0 to 1.
    U16 = 1,
    /// 16-bit floats.
    Half = 2,
    /// 32-bit floats.
    Float = 3,
}

impl Format {
    pub(crate) fn from_code(code: i32) -> Self {
        match code {
            0 => Self::U8,
            1 => Self::U16,
            2 => Self::Half,
            _ => Self::Float,
        }
    }
}

/// The value of a metadata attribute.
#[derive(Clone, Debug, PartialEq)]
pub enum Attribute {
    /// Text.
    Text(String),
    /// An integer.
    Int(i32),
    /// A number.
    Float(f32),
    /// Some numbers, such as `chromaticities`.
    Floats(Vec<f32>),
    /// A 4×4 matrix, by rows as OpenEXR's `M44f`: row vectors are multiplied from the left.
    Matrix([f32; 16]),
    /// A quotient of integers, such as `framesPerSecond`.
    Rational(i32, i32),
}

/// An image in memory: every channel of the data window as `f32`.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Names, in the order in which `pixels` holds them.
    pub channels: Vec<String>,
    /// Values as stored; integers as 0 to 1, not linearised. Order: row from the top, column, channel.
    pub pixels: Vec<f32>,
    /// What `pixels` covers.
    pub data_window: Window,
    /// The frame.
    pub display_window: Window,
    /// The widest format of a channel in the file.
    pub format: Format,
    /// Metadata that can be expressed, in the order of the file.
    pub attributes: Vec<(String, Attribute)>,
}

impl Image {
    /// Whether the file held 8-bit integers, which by convention are sRGB-encoded.
    pub fn eight_bit(&self) -> bool {
        self.format == Format::U8
    }

    /// Index of the channel of that name.
    pub fn channel(&self, name: &str) -> Option<usize> {
        self.channels.iter().position(|channel| channel == name)
    }

    /// The value of the attribute of that name. Case does not matter: OpenImageIO writes `worldtocamera` and OpenEXR
    /// calls it `worldToCamera`.
    pub fn attribute(&self, name: &str) -> Option<&Attribute> {
        self.attributes.iter().find(|(key, _)| key.eq_ignore_ascii_case(name)).map(|(_, value)| value)
    }
}

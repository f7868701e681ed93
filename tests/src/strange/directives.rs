//! What scenes are made of: names and kinds of parameters.

use super::{COLOURS, Choices, LEVELS};

/// A type of some directive.
pub(super) struct Entity {
    pub(super) name: &'static str,
    pub(super) parameters: &'static [(&'static str, Kind)],
}

/// What a parameter takes.
#[derive(Clone, Copy)]
pub(super) enum Kind {
    Number,
    /// Nearly always below 1.
    Share,
    /// A colour of light.
    Level,
    /// A reflectance.
    Colour,
    Flag,
    /// A place.
    Point,
    /// What an interface takes: a number or a glass.
    Glass,
    /// What a metal takes: a number for each wavelength, or a metal's.
    Metal,
    /// Of the texture's own type.
    Value,
    Count,
    Points(usize),
    Word(&'static [&'static str]),
}

impl Kind {
    /// The parameter, with its type.
    pub(super) fn value(self, name: &str, choices: &mut Choices) -> String {
        match self {
            Self::Number => format!("\"float {name}\" {}", choices.number()),
            Self::Share => format!("\"float {name}\" {}", choices.of(&["0.2", "0", "1e-30", "0.999999", "0.1"])),
            Self::Level => format!("\"rgb {name}\" [ {0} {0} {1} ]", choices.of(&LEVELS), choices.of(&LEVELS)),
            Self::Colour => format!("\"rgb {name}\" [ {} ]", choices.of(&COLOURS)),
            Self::Flag => format!("\"bool {name}\" {}", choices.of(&["true", "false"])),
            Self::Point => format!("\"point3 {name}\" [ {} ]", choices.place(3)),
            Self::Glass if choices.rarely(4) => format!("\"spectrum {name}\" \"glass-BK7\""),
            Self::Glass => format!("\"float {name}\" {}", choices.number()),
            Self::Metal if choices.rarely(2) => format!("\"spectrum {name}\" \"metal-Au-eta\""),
            Self::Metal => format!("\"rgb {name}\" [ {} {} {} ]", choices.number(), choices.number(), choices.number()),
            Self::Value => {
                let number = choices.number();
                // The type is known only when the class is.
                format!("\"VALUE {name}\" [ {number} ]")
            }
            Self::Count => format!("\"integer {name}\" {}", choices.of(&["1", "2", "3", "8"])),
            Self::Points(count) => format!("\"point3 {name}\" [ {} ]", choices.place(3 * count)),
            Self::Word(words) => format!("\"string {name}\" \"{}\"", choices.of(words)),
        }
    }
}

use Kind::{Colour, Count, Flag, Glass, Level, Metal, Number, Point, Points, Share, Value, Word};

const fn entity(name: &'static str, parameters: &'static [(&'static str, Kind)]) -> Entity {
    Entity { name, parameters }
}

pub(super) const CAMERAS: [Entity; 4] = [
    entity("perspective", &[("fov", Number), ("lensradius", Number), ("focaldistance", Number)]),
    entity("perspective", &[("frameaspectratio", Number), ("shutterclose", Number)]),
    entity("orthographic", &[("lensradius", Number), ("focaldistance", Number)]),
    entity("spherical", &[("mapping", Word(&["equalarea", "equirectangular"]))]),
];

pub(super) const FILTERS: [Entity; 5] = [
    entity("box", &[("xradius", Number), ("yradius", Number)]),
    entity("triangle", &[("xradius", Number), ("yradius", Number)]),
    entity("gaussian", &[("xradius", Number), ("sigma", Number)]),
    entity("mitchell", &[("xradius", Number), ("B", Number), ("C", Number)]),
    entity("sinc", &[("xradius", Number), ("tau", Number)]),
];

pub(super) const SHAPES: [Entity; 6] = [
    entity("sphere", &[("radius", Number)]),
    entity("sphere", &[("radius", Number), ("zmin", Number), ("zmax", Number), ("phimax", Number), ("alpha", Number)]),
    entity("disk", &[("radius", Number), ("height", Number), ("innerradius", Share), ("phimax", Number)]),
    entity("cylinder", &[("radius", Number), ("zmin", Number), ("zmax", Number), ("phimax", Number)]),
    entity("curve", &[("P", Points(4)), ("width0", Number), ("width1", Number), ("type", Word(&["flat", "cylinder"]))]),
    entity("curve", &[("P", Points(7)), ("basis", Word(&["bezier", "bspline"])), ("width", Number)]),
];

pub(super) const LIGHTS: [Entity; 5] = [
    entity("point", &[("I", Level), ("from", Point), ("scale", Number)]),
    entity("spot", &[("I", Level), ("from", Point), ("to", Point), ("coneangle", Number), ("conedeltaangle", Number)]),
    entity("distant", &[("L", Level), ("from", Point), ("to", Point)]),
    entity("infinite", &[("L", Level)]),
    entity("goniometric", &[("I", Level), ("power", Number)]),
];

pub(super) const MATERIALS: [Entity; 10] = [
    entity("diffuse", &[("reflectance", Colour)]),
    entity("conductor", &[("reflectance", Colour), ("roughness", Number), ("remaproughness", Flag)]),
    entity("conductor", &[("eta", Metal), ("k", Metal), ("uroughness", Number), ("vroughness", Number)]),
    entity("dielectric", &[("eta", Glass)]),
    entity("dielectric", &[("eta", Glass), ("uroughness", Number), ("vroughness", Number), ("remaproughness", Flag)]),
    entity("thindielectric", &[("eta", Glass)]),
    entity(
        "coateddiffuse",
        &[
            ("reflectance", Colour),
            ("roughness", Number),
            ("thickness", Number),
            ("eta", Glass),
            ("g", Share),
            ("albedo", Colour),
        ],
    ),
    entity(
        "coatedconductor",
        &[
            ("reflectance", Colour),
            ("conductor.roughness", Number),
            ("interface.roughness", Number),
            ("interface.eta", Glass),
            ("thickness", Number),
            ("g", Share),
            ("albedo", Colour),
            ("remaproughness", Flag),
        ],
    ),
    entity("diffusetransmission", &[("reflectance", Colour), ("transmittance", Colour), ("scale", Number)]),
    entity("interface", &[]),
];

pub(super) const TEXTURES: [Entity; 11] = [
    entity("constant", &[("value", Value)]),
    entity("scale", &[("tex", Value), ("scale", Number)]),
    entity("mix", &[("tex1", Value), ("tex2", Value), ("amount", Number)]),
    entity("directionmix", &[("tex1", Value), ("tex2", Value)]),
    entity(
        "imagemap",
        &[("scale", Number), ("invert", Flag), ("filter", FILTERING), ("wrap", WRAP), ("uscale", Number)],
    ),
    entity(
        "imagemap",
        &[("encoding", Word(&["linear", "sRGB", "gamma 2.2"])), ("mapping", MAPPING), ("vscale", Number)],
    ),
    entity("checkerboard", &[("tex1", Value), ("mapping", MAPPING), ("uscale", Number), ("vdelta", Number)]),
    entity("dots", &[("inside", Value), ("outside", Value), ("mapping", MAPPING), ("uscale", Number)]),
    entity("fbm", &[("octaves", Count), ("roughness", Number)]),
    entity("wrinkled", &[("octaves", Count), ("roughness", Number)]),
    entity("marble", &[("octaves", Count), ("scale", Number), ("variation", Number), ("roughness", Number)]),
];

const FILTERING: Kind = Word(&["bilinear", "point", "trilinear", "ewa"]);
const WRAP: Kind = Word(&["repeat", "black", "clamp", "octahedralsphere"]);
const MAPPING: Kind = Word(&["uv", "spherical", "cylindrical", "planar"]);

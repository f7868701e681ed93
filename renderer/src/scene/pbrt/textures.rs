//! Textures: `Texture "name" "float|spectrum" "class"`.

use std::collections::BTreeMap;

use glam::{Vec2, Vec3};

use super::context::{Context, TextureNames};
use super::params::Params;
use super::report::{did_you_mean, shown};
use super::spectra::Usage;
use crate::math::{Rgb, Transform};
use crate::scene::Span;
use crate::scene::description::{
    Encoding, ImageTexture, Mapping, Mapping2D, Texture, TextureFilter, TextureId, TextureKind, Value, Wrap,
};

/// What a texture yields. Each has its own names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum TextureValues {
    Float,
    Spectrum,
}

impl TextureValues {
    fn name(self) -> &'static str {
        match self {
            Self::Float => "float",
            Self::Spectrum => "spectrum",
        }
    }
}

/// A texture as read; its parameters name others, perhaps later ones.
#[derive(Debug)]
pub(super) struct TextureEntity {
    pub(super) name: String,
    pub(super) values: TextureValues,
    pub(super) params: Params,
    pub(super) world_from_texture: Transform,
}

#[derive(Debug)]
enum Slot {
    Waiting(Box<TextureEntity>),
    Building,
    Built(Option<TextureId>),
}

/// The textures of a scene on their way from entities to descriptions.
#[derive(Debug, Default)]
pub(super) struct TextureTable {
    names: [BTreeMap<String, usize>; 2],
    slots: Vec<Slot>,
    built: Vec<Texture>,
    depth: usize,
}

impl TextureTable {
    /// Adds a texture. Whether the name was free.
    pub(super) fn add(&mut self, entity: TextureEntity) -> bool {
        let names = &mut self.names[entity.values as usize];
        if names.contains_key(&entity.name) {
            return false;
        }
        names.insert(entity.name.clone(), self.slots.len());
        self.slots.push(Slot::Waiting(Box::new(entity)));
        true
    }
}

/// Builds all textures, each after those that it uses.
pub(super) fn build_all(cx: &mut Context, table: TextureTable) -> TextureNames {
    let count = table.slots.len();
    let said = std::mem::replace(&mut cx.textures, TextureNames::Defined(table));
    for index in 0..count {
        build_slot(cx, index, Span::default());
    }
    said
}

/// The textures that were built.
pub(super) fn take_built(cx: &mut Context) -> Vec<Texture> {
    std::mem::take(&mut table(cx).built)
}

/// Adds a texture that no file names.
pub(super) fn add_built(cx: &mut Context, name: &str, kind: TextureKind, span: Span) -> TextureId {
    let built = &mut table(cx).built;
    built.push(Texture { name: name.to_owned(), kind, span });
    TextureId(built.len() as u32 - 1)
}

fn table(cx: &mut Context) -> &mut TextureTable {
    match &mut cx.textures {
        TextureNames::Defined(table) => table,
        TextureNames::Said(_) => unreachable!("textures are built only after `build_all` has set the table"),
    }
}

/// The texture of this name, built if it is not yet. `None` after an error.
pub(super) fn resolve(cx: &mut Context, values: TextureValues, name: &str, span: Span) -> Option<TextureId> {
    let names = &table(cx).names;
    if let Some(&index) = names[values as usize].get(name) {
        return build_slot(cx, index, span);
    }
    let other = if values == TextureValues::Float { TextureValues::Spectrum } else { TextureValues::Float };
    let hint = if names[other as usize].contains_key(name) {
        format!("; there is a {} texture of that name, but its values do not fit here", other.name())
    } else {
        did_you_mean(name, names[values as usize].keys().map(String::as_str))
    };
    cx.report.error(span, format!("there is no {} texture \"{}\"{hint}", values.name(), shown(name)));
    None
}

fn build_slot(cx: &mut Context, index: usize, span: Span) -> Option<TextureId> {
    // Only names used before their definition nest, so real scenes stay far below this.
    const DEEPEST: usize = 100;
    let table_now = table(cx);
    let mut entity = match std::mem::replace(&mut table_now.slots[index], Slot::Building) {
        Slot::Built(id) => {
            table_now.slots[index] = Slot::Built(id);
            return id;
        }
        Slot::Building => {
            cx.report.error(span, "this texture is defined by itself");
            return None;
        }
        Slot::Waiting(entity) => *entity,
    };
    if table_now.depth == DEEPEST {
        table_now.slots[index] = Slot::Waiting(Box::new(entity));
        cx.report.error(span, format!("more than {DEEPEST} textures each used before the next is defined"));
        return None;
    }
    table_now.depth += 1;
    let kind = build(cx, &mut entity);
    let span = entity.params.span;
    entity.params.finish(cx);
    let table = table(cx);
    table.depth -= 1;
    let id = kind.map(|kind| {
        table.built.push(Texture { name: entity.name, kind, span });
        TextureId(table.built.len() as u32 - 1)
    });
    table.slots[index] = Slot::Built(id);
    id
}

const CLASSES: [&str; 13] = [
    "constant",
    "scale",
    "mix",
    "directionmix",
    "bilerp",
    "imagemap",
    "checkerboard",
    "dots",
    "fbm",
    "wrinkled",
    "windy",
    "marble",
    "ptex",
];

fn build(cx: &mut Context, entity: &mut TextureEntity) -> Option<TextureKind> {
    let (values, params, world_from_texture) = (entity.values, &mut entity.params, entity.world_from_texture);
    let texture_from_world = world_from_texture.inverse();
    let class = params.name.clone();
    let only = match class.as_str() {
        "fbm" | "wrinkled" | "windy" => Some(TextureValues::Float),
        "marble" => Some(TextureValues::Spectrum),
        _ => None,
    };
    if let Some(only) = only.filter(|&only| only != values) {
        cx.report.error(params.span, format!("the texture \"{class}\" yields {} values only", only.name()));
    }
    let octaves = |cx: &mut Context, params: &mut Params| params.int(cx, "octaves", 8, 1..=64);
    let omega = |cx: &mut Context, params: &mut Params| params.float(cx, "roughness", 0.5);
    Some(match class.as_str() {
        "constant" => TextureKind::Constant(constant(cx, params, "value", values, 1.0)),
        "scale" => TextureKind::Scale {
            tex: value(cx, params, "tex", values, 1.0),
            scale: params.float_texture(cx, "scale", 1.0),
        },
        "mix" => TextureKind::Mix {
            tex1: value(cx, params, "tex1", values, 0.0),
            tex2: value(cx, params, "tex2", values, 1.0),
            amount: params.float_texture(cx, "amount", 0.5),
        },
        "directionmix" => {
            // In the file tex1 is what is seen along `dir`; the description mixes towards its second.
            let along = value(cx, params, "tex1", values, 0.0);
            let across = value(cx, params, "tex2", values, 1.0);
            let dir = params.direction(cx, "dir", Vec3::Y);
            let dir = world_from_texture.vector(dir).try_normalize().unwrap_or(Vec3::Y);
            TextureKind::DirectionMix { tex1: across, tex2: along, dir }
        }
        "bilerp" => TextureKind::Bilerp {
            // The file's digits are u then v, the description's index is v then u.
            corners: [("v00", 0.0), ("v10", 0.0), ("v01", 1.0), ("v11", 1.0)]
                .map(|(name, default)| constant(cx, params, name, values, default)),
            mapping: mapping_2d(cx, params, texture_from_world),
        },
        "imagemap" => TextureKind::Image(image(cx, params, values, texture_from_world)?),
        "checkerboard" => {
            let mapping = match params.int(cx, "dimension", 2, 2..=3) {
                2 => Mapping::Two(mapping_2d(cx, params, texture_from_world)),
                _ => Mapping::Three(texture_from_world),
            };
            let tex = [value(cx, params, "tex1", values, 1.0), value(cx, params, "tex2", values, 0.0)];
            TextureKind::Checkerboard { mapping, tex }
        }
        "dots" => TextureKind::Dots {
            mapping: mapping_2d(cx, params, texture_from_world),
            inside: value(cx, params, "inside", values, 1.0),
            outside: value(cx, params, "outside", values, 0.0),
        },
        "fbm" => TextureKind::Fbm { texture_from_world, octaves: octaves(cx, params), omega: omega(cx, params) },
        "wrinkled" => {
            TextureKind::Wrinkled { texture_from_world, octaves: octaves(cx, params), omega: omega(cx, params) }
        }
        "windy" => TextureKind::Windy { texture_from_world },
        "marble" => TextureKind::Marble {
            texture_from_world,
            octaves: octaves(cx, params),
            omega: omega(cx, params),
            scale: params.float(cx, "scale", 1.0),
            variation: params.float(cx, "variation", 0.2),
        },
        "ptex" => {
            params.ignore(&["filename", "encoding", "scale"]);
            cx.report.warning("ptex", params.span, "ptex files are not read: 0.5 is drawn in their place");
            TextureKind::Constant(Rgb::splat(0.5))
        }
        _ => {
            cx.unknown_type("texture", &class, params.span, &CLASSES);
            params.ignore_all();
            return None;
        }
    })
}

fn constant(cx: &mut Context, params: &mut Params, name: &'static str, values: TextureValues, default: f32) -> Rgb {
    match values {
        TextureValues::Float => Rgb::splat(params.float(cx, name, default)),
        TextureValues::Spectrum => params.opt_rgb(cx, name, Usage::Unbounded).unwrap_or(Rgb::splat(default)),
    }
}

fn value(cx: &mut Context, params: &mut Params, name: &'static str, values: TextureValues, default: f32) -> Value<Rgb> {
    match values {
        TextureValues::Float => match params.float_texture(cx, name, default) {
            Value::Constant(value) => Value::Constant(Rgb::splat(value)),
            Value::Texture(id) => Value::Texture(id),
        },
        TextureValues::Spectrum => params.rgb_texture(cx, name, Usage::Unbounded, default),
    }
}

#[derive(Clone, Copy)]
enum MappingName {
    Uv,
    Spherical,
    Cylindrical,
    Planar,
}

fn mapping_2d(cx: &mut Context, params: &mut Params, texture_from_world: Transform) -> Mapping2D {
    let names = [
        ("uv", MappingName::Uv),
        ("spherical", MappingName::Spherical),
        ("cylindrical", MappingName::Cylindrical),
        ("planar", MappingName::Planar),
    ];
    let name = params.choice(cx, "mapping", &names);
    let delta = Vec2::new(params.float(cx, "udelta", 0.0), params.float(cx, "vdelta", 0.0));
    let scale = Vec2::new(params.float(cx, "uscale", 1.0), params.float(cx, "vscale", 1.0));
    let (vs, vt) = (params.direction(cx, "v1", Vec3::X), params.direction(cx, "v2", Vec3::Y));
    match name {
        MappingName::Uv => Mapping2D::Uv { scale, delta },
        MappingName::Spherical => Mapping2D::Spherical(texture_from_world),
        MappingName::Cylindrical => Mapping2D::Cylindrical(texture_from_world),
        MappingName::Planar => Mapping2D::Planar { texture_from_world, vs, vt, delta },
    }
}

fn image(
    cx: &mut Context,
    params: &mut Params,
    values: TextureValues,
    texture_from_world: Transform,
) -> Option<ImageTexture> {
    let mapping = mapping_2d(cx, params, texture_from_world);
    // Bounds the eccentricity of `ewa` in pbrt; our look-ups bound their own.
    params.ignore(&["maxanisotropy"]);
    let filter = params.choice(
        cx,
        "filter",
        &[
            ("bilinear", TextureFilter::Bilinear),
            ("point", TextureFilter::Point),
            ("trilinear", TextureFilter::Trilinear),
            ("ewa", TextureFilter::Ewa),
        ],
    );
    let wrap = params.choice(
        cx,
        "wrap",
        &[
            ("repeat", Wrap::Repeat),
            ("black", Wrap::Black),
            ("clamp", Wrap::Clamp),
            ("octahedralsphere", Wrap::OctahedralSphere),
        ],
    );
    let scale = params.float(cx, "scale", 1.0);
    let invert = params.bool(cx, "invert", false);
    let encoding = encoding(cx, params);
    let path = params.needed_path(cx)?;
    let monochrome = values == TextureValues::Float;
    Some(ImageTexture { path, mapping, wrap, filter, encoding, scale, invert, monochrome })
}

fn encoding(cx: &mut Context, params: &mut Params) -> Option<Encoding> {
    let text = params.string(cx, "encoding")?;
    let words: Vec<&str> = text.split_ascii_whitespace().collect();
    let encoding = match words[..] {
        [word] if word.eq_ignore_ascii_case("srgb") => Some(Encoding::Srgb),
        ["linear"] => Some(Encoding::Linear),
        ["gamma", value] => value.parse().ok().filter(|&g: &f32| g.is_finite() && g > 0.0).map(Encoding::Gamma),
        _ => None,
    };
    if encoding.is_none() {
        let text = format!("an encoding is \"sRGB\", \"linear\" or \"gamma 2.2\", not \"{}\"", shown(&text));
        cx.report.error(params.span_of("encoding"), text);
    }
    encoding
}

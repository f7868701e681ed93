//! From descriptions of textures to nodes: images loaded, constants folded, reach checked.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use rayon::prelude::*;

use super::image::{Channels, Flaws, UNKNOWN_SPACE, load_texels};
use super::mapping::{Map, Map2, affine};
use super::{ImageNode, Node, Pyramid, Textures};
use crate::math::Rgb;
use crate::scene::Span;
use crate::scene::description::{Encoding, ImageTexture, Texture, TextureId, TextureKind, Value, Wrap};
use crate::spectrum::RgbSpace;

/// Look-ups that one look-up of a texture may lead to. Textures that name others twice over and over would otherwise
/// multiply without end.
const MAX_LOOKUPS: u64 = 1 << 12;

/// How deep textures may be nested: the look-up recurses.
const MAX_DEPTH: u32 = 256;

/// What is wrong with a texture; also used for warnings.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct TextureError {
    /// Where the texture was described.
    pub span: Span,
    /// What is wrong, naming the texture and the file.
    pub message: String,
}

impl Textures {
    /// Builds all textures of a scene and loads their images, in parallel. Beside the textures come warnings.
    ///
    /// # Errors
    /// All that is wrong: images that cannot be read, textures that refer to later ones or without bounds.
    pub fn build(textures: &[Texture]) -> Result<(Self, Vec<TextureError>), Vec<TextureError>> {
        let images = load_images(textures);
        let mut builder =
            Builder { images: &images, textures: Textures::default(), reach: vec![], warnings: vec![], errors: vec![] };
        for texture in textures {
            builder.add(texture);
        }
        let Builder { textures, warnings, errors, .. } = builder;
        if errors.is_empty() { Ok((textures, warnings)) } else { Err(errors) }
    }
}

/// What distinguishes the texels of image textures: file and encoding. Encodings have no order of their own, so they are
/// told apart by code and gamma.
type Key = (PathBuf, u8, u32);

/// The images that one file was loaded as.
struct File {
    rgb: Arc<Pyramid>,
    /// The same as `rgb`, unless the file has an alpha channel that says something or is of another RGB space.
    number: Arc<Pyramid>,
    /// How many values were not finite.
    flaws: Flaws,
}

fn key(image: &ImageTexture) -> Key {
    let (code, gamma) = match image.encoding {
        None => (0, 0.0),
        Some(Encoding::Srgb) => (1, 0.0),
        Some(Encoding::Linear) => (2, 0.0),
        Some(Encoding::Gamma(gamma)) => (3, gamma),
    };
    (image.path.clone(), code, gamma.to_bits())
}

/// Loads every image once, in parallel.
fn load_images(textures: &[Texture]) -> BTreeMap<Key, Result<File, String>> {
    let mut wanted = BTreeMap::new();
    for texture in textures {
        if let TextureKind::Image(image) = &texture.kind {
            let (_, rgb, number) = wanted.entry(key(image)).or_insert((image, false, false));
            *(if image.monochrome { number } else { rgb }) = true;
        }
    }
    let wanted: Vec<_> = wanted.into_iter().collect();
    wanted.into_par_iter().map(|(key, (image, rgb, number))| (key, load(image, rgb, number))).collect()
}

fn load(image: &ImageTexture, rgb: bool, number: bool) -> Result<File, String> {
    let read = |channels| load_texels(&image.path, channels, image.encoding);
    let first = read(if number { Channels::Number } else { Channels::Reflectance })?;
    // A number is the mean of channels as they are.
    let other = first.alpha || first.space != RgbSpace::Srgb;
    let second = if number && rgb && other { Some(read(Channels::Reflectance)?) } else { None };
    let replaced = first.flaws.replaced + second.as_ref().map_or(0, |texels| texels.flaws.replaced);
    let unknown_space = first.flaws.unknown_space;
    let first = Arc::new(Pyramid::new(first));
    let second = second.map_or_else(|| Arc::clone(&first), |texels| Arc::new(Pyramid::new(texels)));
    Ok(File { rgb: second, number: first, flaws: Flaws { replaced, unknown_space } })
}

/// How much work a look-up may be: itself and those it leads to.
#[derive(Clone, Copy, Default)]
struct Reach {
    lookups: u64,
    depth: u32,
}

impl Reach {
    fn and(self, other: Self) -> Self {
        Self { lookups: self.lookups.saturating_add(other.lookups), depth: self.depth.max(other.depth) }
    }
}

struct Builder<'a> {
    images: &'a BTreeMap<Key, Result<File, String>>,
    textures: Textures,
    reach: Vec<Reach>,
    warnings: Vec<TextureError>,
    errors: Vec<TextureError>,
}

impl Builder<'_> {
    fn add(&mut self, texture: &Texture) {
        let error = |message| TextureError { span: texture.span, message };
        let reach = operands(&texture.kind)
            .into_iter()
            .flatten()
            .try_fold(Reach::default(), |sum, operand| Some(sum.and(*self.reach.get(operand.index())?)));
        let mut own = Reach { lookups: 1, depth: 0 };
        let mut node = Node::Constant(Rgb::ZERO);
        match reach {
            None => self.errors.push(error(format!(
                "texture \"{}\" is made of a texture that is described after it",
                texture.name
            ))),
            Some(reach) if reach.lookups >= MAX_LOOKUPS || reach.depth >= MAX_DEPTH => self.errors.push(error(format!(
                "texture \"{}\" is made of too many others: one look-up would need {} further ones, {} deep, and the \
                 limits are {MAX_LOOKUPS} and {MAX_DEPTH}",
                texture.name, reach.lookups, reach.depth
            ))),
            Some(reach) => match self.node(texture) {
                Ok(found) => {
                    node = found;
                    own = Reach { lookups: reach.lookups + 1, depth: reach.depth + 1 };
                }
                Err(message) => self.errors.push(error(format!("texture \"{}\": {message}", texture.name))),
            },
        }
        if matches!(node, Node::Constant(_)) {
            own = Reach { lookups: 1, depth: 0 };
        }
        self.textures.nodes.push(node);
        self.reach.push(own);
    }

    /// The node, its operands checked before.
    fn node(&mut self, texture: &Texture) -> Result<Node, String> {
        let rgb = |value: &Value<Rgb>| self.textures.folded_rgb(value);
        let float = |value: &Value<f32>| self.textures.folded_float(value);
        Ok(match &texture.kind {
            TextureKind::Constant(constant) => Node::Constant(*constant),
            TextureKind::Scale { tex, scale } => match (rgb(tex), float(scale)) {
                (Value::Constant(tex), Value::Constant(scale)) => Node::Constant(scale * tex),
                (tex, Value::Constant(1.0)) => self.alias(&tex),
                (tex, scale) => Node::Scale { tex, scale },
            },
            TextureKind::Mix { tex1, tex2, amount } => {
                let tex = [rgb(tex1), rgb(tex2)];
                match float(amount) {
                    Value::Constant(0.0) => self.alias(&tex[0]),
                    Value::Constant(1.0) => self.alias(&tex[1]),
                    amount => blend(tex, Some(&amount), |tex| Node::Mix { tex, amount: amount.clone() }),
                }
            }
            TextureKind::DirectionMix { tex1, tex2, dir } => {
                blend([rgb(tex1), rgb(tex2)], None, |tex| Node::DirectionMix { tex, direction: *dir })
            }
            TextureKind::Bilerp { corners, mapping } => {
                if corners.iter().all(|corner| corner == &corners[0]) {
                    return Ok(Node::Constant(corners[0]));
                }
                Node::Bilerp { corners: *corners, map: mapping.into() }
            }
            TextureKind::Image(image) => self.image(texture, image)?,
            TextureKind::Checkerboard { mapping, tex } => {
                blend([rgb(&tex[0]), rgb(&tex[1])], None, |tex| Node::Checkerboard { tex, map: Map::from(mapping) })
            }
            TextureKind::Dots { mapping, inside, outside } => {
                blend([rgb(inside), rgb(outside)], None, |[inside, outside]| Node::Dots {
                    inside,
                    outside,
                    map: Map2::from(mapping),
                })
            }
            TextureKind::Fbm { texture_from_world, octaves, omega } => {
                Node::Fbm { texture_from_world: affine(texture_from_world), octaves: *octaves, omega: *omega }
            }
            TextureKind::Wrinkled { texture_from_world, octaves, omega } => {
                Node::Wrinkled { texture_from_world: affine(texture_from_world), octaves: *octaves, omega: *omega }
            }
            TextureKind::Windy { texture_from_world } => Node::Windy { texture_from_world: affine(texture_from_world) },
            TextureKind::Marble { texture_from_world, octaves, omega, scale, variation } => Node::Marble {
                texture_from_world: affine(texture_from_world),
                octaves: *octaves,
                omega: *omega,
                scale: *scale,
                variation: *variation,
            },
        })
    }

    /// The node of an operand that passes through unchanged.
    fn alias(&self, value: &Value<Rgb>) -> Node {
        match *value {
            Value::Constant(constant) => Node::Constant(constant),
            Value::Texture(id) => self.textures.nodes[id.index()].clone(),
        }
    }

    fn image(&mut self, texture: &Texture, image: &ImageTexture) -> Result<Node, String> {
        let file = self.images[&key(image)].as_ref().map_err(Clone::clone)?;
        let (name, path) = (&texture.name, image.path.display());
        if file.flaws.unknown_space && !image.monochrome {
            let message = format!("texture \"{name}\": \"{path}\" {UNKNOWN_SPACE}");
            self.warnings.push(TextureError { span: texture.span, message });
        }
        if file.flaws.replaced > 0 {
            let count = file.flaws.replaced;
            let message =
                format!("texture \"{name}\": {count} values of \"{path}\" are not finite and were taken as 0");
            self.warnings.push(TextureError { span: texture.span, message });
        }
        let pyramid = Arc::clone(if image.monochrome { &file.number } else { &file.rgb });
        let constant = pyramid.constant().filter(|_| image.wrap != Wrap::Black);
        let node = ImageNode {
            pyramid,
            map: Map2::from(&image.mapping),
            filter: image.filter,
            wrap: image.wrap,
            scale: image.scale,
            invert: image.invert,
            mean: image.monochrome,
        };
        if let Some(constant) = constant {
            return Ok(Node::Constant(node.finish(constant)));
        }
        if !self.textures.pyramids.iter().any(|known| Arc::ptr_eq(known, &node.pyramid)) {
            self.textures.pyramids.push(Arc::clone(&node.pyramid));
        }
        Ok(Node::Image(node))
    }
}

/// A mixture of two textures: their constant if they are equal, or if all is known. Weights sum to 1.
fn blend(tex: [Value<Rgb>; 2], amount: Option<&Value<f32>>, node: impl FnOnce([Value<Rgb>; 2]) -> Node) -> Node {
    match (&tex, amount) {
        ([Value::Constant(a), Value::Constant(b)], _) if a == b => Node::Constant(*a),
        ([Value::Constant(a), Value::Constant(b)], Some(Value::Constant(t))) => {
            Node::Constant((1.0 - t) * *a + *t * *b)
        }
        _ => node(tex),
    }
}

/// The textures that a texture is made of.
fn operands(kind: &TextureKind) -> [Option<TextureId>; 3] {
    fn id<T>(value: &Value<T>) -> Option<TextureId> {
        match value {
            Value::Constant(_) => None,
            Value::Texture(id) => Some(*id),
        }
    }
    match kind {
        TextureKind::Scale { tex, scale } => [id(tex), id(scale), None],
        TextureKind::Mix { tex1, tex2, amount } => [id(tex1), id(tex2), id(amount)],
        TextureKind::DirectionMix { tex1, tex2, .. } => [id(tex1), id(tex2), None],
        TextureKind::Checkerboard { tex: [a, b], .. } => [id(a), id(b), None],
        TextureKind::Dots { inside, outside, .. } => [id(inside), id(outside), None],
        TextureKind::Constant(_)
        | TextureKind::Bilerp { .. }
        | TextureKind::Image(_)
        | TextureKind::Fbm { .. }
        | TextureKind::Wrinkled { .. }
        | TextureKind::Windy { .. }
        | TextureKind::Marble { .. } => [None; 3],
    }
}

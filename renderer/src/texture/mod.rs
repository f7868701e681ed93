//! Textures: values that vary over surfaces.
//!
//! [`Textures::build`] turns descriptions into nodes, loading each image once and folding what is constant; then
//! [`Textures::rgb`] and [`Textures::float`] look values up, at [`TexturePoint`]s. Image files are read by OpenImageIO;
//! look-ups are our own, see [`pyramid`].
//!
//! # Invariants
//! A look-up neither fails nor allocates nor locks, and depends on nothing but the texture and the point.

mod build;
pub mod encoding;
pub mod image;
mod levels;
mod mapping;
mod noise;
mod procedural;
pub mod pyramid;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use glam::{Affine3A, Vec2, Vec3};

pub use build::TextureError;
pub use image::RgbImage;
pub use pyramid::Pyramid;

use crate::math::Rgb;
use crate::scene::description::{TextureFilter, TextureId, Value, Wrap};
use mapping::{Map, Map2, map3};

/// Where a texture is looked up, and how far one pixel reaches there. World space.
///
/// The derivatives are per pixel; zeros mean no footprint, so nothing is filtered.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TexturePoint {
    /// Position.
    pub p: Vec3,
    /// Unit geometric normal.
    pub n: Vec3,
    /// Surface parameters.
    pub uv: Vec2,
    /// Change of `p` from this pixel to the next in x.
    pub dpdx: Vec3,
    /// Change of `p` from this pixel to the next in y.
    pub dpdy: Vec3,
    /// Change of `uv` from this pixel to the next in x.
    pub duvdx: Vec2,
    /// Change of `uv` from this pixel to the next in y.
    pub duvdy: Vec2,
}

/// All textures of a scene, ready for look-ups.
#[derive(Clone, Debug, Default)]
pub struct Textures {
    nodes: Vec<Node>,
    pyramids: Vec<Arc<Pyramid>>,
}

/// One texture. Constants among the operands are already values.
#[derive(Clone, Debug)]
enum Node {
    Constant(Rgb),
    Scale { tex: Value<Rgb>, scale: Value<f32> },
    Mix { tex: [Value<Rgb>; 2], amount: Value<f32> },
    DirectionMix { tex: [Value<Rgb>; 2], direction: Vec3 },
    Bilerp { corners: [Rgb; 4], map: Map2 },
    Image(ImageNode),
    Checkerboard { tex: [Value<Rgb>; 2], map: Map },
    Dots { inside: Value<Rgb>, outside: Value<Rgb>, map: Map2 },
    Fbm { texture_from_world: Affine3A, octaves: u32, omega: f32 },
    Wrinkled { texture_from_world: Affine3A, octaves: u32, omega: f32 },
    Windy { texture_from_world: Affine3A },
    Marble { texture_from_world: Affine3A, octaves: u32, omega: f32, scale: f32, variation: f32 },
}

#[derive(Clone, Debug)]
struct ImageNode {
    pyramid: Arc<Pyramid>,
    map: Map2,
    filter: TextureFilter,
    wrap: Wrap,
    scale: f32,
    invert: bool,
    /// A number: the mean of the channels.
    mean: bool,
}

impl Textures {
    /// The value at a point, in linear RGB.
    ///
    /// # Panics
    /// The value names a texture that is not of this scene.
    #[inline]
    pub fn rgb(&self, value: &Value<Rgb>, at: &TexturePoint) -> Rgb {
        match *value {
            Value::Constant(constant) => constant,
            Value::Texture(id) => self.evaluate(id, at),
        }
    }

    /// The value at a point, as a number.
    ///
    /// # Panics
    /// As [`Self::rgb`].
    #[inline]
    pub fn float(&self, value: &Value<f32>, at: &TexturePoint) -> f32 {
        match *value {
            Value::Constant(constant) => constant,
            // Textures of numbers have them in all channels.
            Value::Texture(id) => self.evaluate(id, at).x,
        }
    }

    /// The value itself, or its constant if the texture turned out to be the same everywhere.
    pub fn folded_rgb(&self, value: &Value<Rgb>) -> Value<Rgb> {
        match *value {
            Value::Texture(id) => match self.nodes[id.index()] {
                Node::Constant(constant) => Value::Constant(constant),
                _ => Value::Texture(id),
            },
            Value::Constant(constant) => Value::Constant(constant),
        }
    }

    /// As [`Self::folded_rgb`], for numbers.
    pub fn folded_float(&self, value: &Value<f32>) -> Value<f32> {
        match *value {
            Value::Texture(id) => match self.nodes[id.index()] {
                Node::Constant(constant) => Value::Constant(constant.x),
                _ => Value::Texture(id),
            },
            Value::Constant(constant) => Value::Constant(constant),
        }
    }

    /// Whether texture coordinates and their change are all that a value looks at.
    pub fn follows_uv<T>(&self, value: &Value<T>) -> bool {
        let uv = |map: &Map2| matches!(map, Map2::Uv { .. });
        let all = |values: &[Value<Rgb>; 2]| values.iter().all(|value| self.follows_uv(value));
        let Value::Texture(id) = value else { return true };
        match &self.nodes[id.index()] {
            Node::Constant(_) => true,
            Node::Scale { tex, scale } => self.follows_uv(tex) && self.follows_uv(scale),
            Node::Mix { tex, amount } => all(tex) && self.follows_uv(amount),
            Node::Bilerp { map, .. } => uv(map),
            Node::Image(image) => uv(&image.map),
            Node::Checkerboard { tex, map: Map::Two(map) } => uv(map) && all(tex),
            Node::Dots { inside, outside, map } => uv(map) && self.follows_uv(inside) && self.follows_uv(outside),
            Node::Checkerboard { map: Map::Three(_), .. }
            | Node::DirectionMix { .. }
            | Node::Fbm { .. }
            | Node::Wrinkled { .. }
            | Node::Windy { .. }
            | Node::Marble { .. } => false,
        }
    }

    /// Bytes that the images take.
    pub fn bytes(&self) -> usize {
        self.pyramids.iter().map(|pyramid| pyramid.bytes()).sum()
    }

    fn evaluate(&self, id: TextureId, at: &TexturePoint) -> Rgb {
        match &self.nodes[id.index()] {
            Node::Constant(constant) => *constant,
            Node::Image(image) => image.evaluate(at),
            Node::Scale { tex, scale } => {
                let scale = self.float(scale, at);
                if scale == 0.0 { Rgb::ZERO } else { scale * self.rgb(tex, at) }
            }
            Node::Mix { tex, amount } => self.mix(tex, self.float(amount, at), at),
            Node::DirectionMix { tex, direction } => self.mix(tex, at.n.dot(*direction).abs(), at),
            Node::Bilerp { corners: [bottom_left, bottom_right, top_left, top_right], map } => {
                let st = map.at(at).st;
                let bottom = *bottom_left * (1.0 - st.x) + *bottom_right * st.x;
                let top = *top_left * (1.0 - st.x) + *top_right * st.x;
                bottom * (1.0 - st.y) + top * st.y
            }
            Node::Checkerboard { tex, map } => {
                let second = match map {
                    Map::Two(map) => procedural::checks2(&map.at(at)),
                    Map::Three(texture_from_world) => procedural::checks3(&map3(texture_from_world, at)),
                };
                self.mix(tex, second, at)
            }
            Node::Dots { inside, outside, map } => {
                self.rgb(if procedural::inside_dot(map.at(at).st) { inside } else { outside }, at)
            }
            Node::Fbm { texture_from_world, octaves, omega } => {
                Rgb::splat(noise::fbm(&map3(texture_from_world, at), *omega, *octaves))
            }
            Node::Wrinkled { texture_from_world, octaves, omega } => {
                Rgb::splat(noise::turbulence(&map3(texture_from_world, at), *omega, *octaves))
            }
            Node::Windy { texture_from_world } => Rgb::splat(procedural::windy(&map3(texture_from_world, at))),
            Node::Marble { texture_from_world, octaves, omega, scale, variation } => {
                procedural::marble(&map3(texture_from_world, at), *octaves, *omega, *scale, *variation)
            }
        }
    }

    /// tex₀ (1 − amount) + tex₁ amount, without looking up what has no weight.
    fn mix(&self, tex: &[Value<Rgb>; 2], amount: f32, at: &TexturePoint) -> Rgb {
        if amount == 0.0 {
            return self.rgb(&tex[0], at);
        }
        if amount == 1.0 {
            return self.rgb(&tex[1], at);
        }
        (1.0 - amount) * self.rgb(&tex[0], at) + amount * self.rgb(&tex[1], at)
    }
}

impl ImageNode {
    fn evaluate(&self, at: &TexturePoint) -> Rgb {
        let mut point = self.map.at(at);
        // Texture coordinates grow upwards, rows of an image downwards.
        point.st.y = 1.0 - point.st.y;
        point.footprint.dx.y = -point.footprint.dx.y;
        point.footprint.dy.y = -point.footprint.dy.y;
        self.finish(self.pyramid.filter(point.st, &point.footprint, self.filter, self.wrap))
    }

    /// What pbrt does to a filtered value.
    fn finish(&self, texel: Rgb) -> Rgb {
        let texel = if self.mean { Rgb::splat((texel.x + texel.y + texel.z) / 3.0) } else { texel };
        let scaled = self.scale * texel;
        if self.invert { (Rgb::ONE - scaled).max(Rgb::ZERO) } else { scaled }
    }
}

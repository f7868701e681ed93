//! Shapes → Embree scenes, the table of their surfaces, and the shapes that emit.
//!
//! Shapes are read, checked and moved to their place in parallel ([`load`]), then put together one after the other in the
//! order of the description ([`assemble`]), so numbers never depend on scheduling. Objects that are instanced get scenes of
//! their own; objects that are not are not even read.

mod assemble;
mod load;
mod quads;
#[cfg(test)]
mod tests;
mod user;

use embree::{Device, SceneOptions};
use rayon::prelude::*;

pub use crate::interaction::{AlphaTest, Geometry};

use crate::interaction::{Alpha, TriangleTest};
use crate::light::Emitter;
use crate::scene::Span;
use crate::scene::description::{MaterialKind, Scene, Shape, Value};
use crate::texture::Textures;
use assemble::Assembly;
use load::{Loaded, Part};

/// A message and the place in the scene file that it is about.
pub type Message = (Span, String);

/// How geometry is built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// For all Embree scenes. The default is not watertight: that test is slower, and as edges of the fast one leak only
    /// within its rounding error, about 10⁻⁷ of a triangle's size seen from its own distance, no image shows it.
    pub scene: SceneOptions,
}

impl Default for Options {
    fn default() -> Self {
        Self { scene: SceneOptions { robust: false, ..SceneOptions::default() } }
    }
}

/// Builds the geometry of a scene, with the shapes that emit, in the order of their numbers; also warnings.
///
/// `textures`, where they could be built, tell which alpha textures are constant.
///
/// # Errors
/// Outer: Embree fails. Inner: all shapes and instances that cannot be built, with their places.
#[allow(clippy::type_complexity, reason = "a stage's two kinds of failure, as `compile` reports them")]
pub fn build(
    scene: &Scene,
    device: &Device,
    textures: Option<&Textures>,
    options: &Options,
) -> Result<Result<((Geometry, Vec<Emitter>), Vec<Message>), Vec<Message>>, embree::Error> {
    let mut messages = Messages::default();
    let placed = load_all(scene, &scene.shapes, textures, &mut messages);
    let objects: Vec<_> = instanced_objects(scene)
        .map(|(index, instanced)| {
            let shapes = if instanced { &scene.objects[index].shapes[..] } else { &[] };
            load_all(scene, shapes, textures, &mut messages)
        })
        .collect();
    messages.summarise_degenerate();

    let mut assembly = Assembly::new(device, options.scene);
    let top = assembly.surfaces(placed, &mut messages);
    let placed = top.len() as u32;
    let objects = assembly.objects(objects, &mut messages)?;
    let instances = assembly.instances(&scene.instances, &objects, &mut messages);
    if !messages.errors.is_empty() {
        return Ok(Err(messages.errors));
    }
    let (surfaces, emitters, scene) = assembly.commit(top, &instances)?;
    let test = if options.scene.robust { TriangleTest::Watertight } else { TriangleTest::Fast };
    let instances = instances.into_iter().map(|(instance, _)| instance).collect();
    let geometry = Geometry::new(scene, surfaces, instances, placed, test);
    Ok(Ok(((geometry, emitters), messages.warnings)))
}

/// Everything that is said about the shapes of a scene.
#[derive(Default)]
struct Messages {
    warnings: Vec<Message>,
    errors: Vec<Message>,
    /// Primitives without area: how many, in how many shapes, and the first of these.
    degenerate: usize,
    degenerate_shapes: usize,
    first_degenerate: Span,
}

impl Messages {
    fn warn(&mut self, span: Span, message: impl Into<String>) {
        self.warnings.push((span, message.into()));
    }

    fn error(&mut self, span: Span, message: impl Into<String>) {
        self.errors.push((span, message.into()));
    }

    fn count_degenerate(&mut self, span: Span, count: usize) {
        if count == 0 {
            return;
        }
        if self.degenerate == 0 {
            self.first_degenerate = span;
        }
        self.degenerate += count;
        self.degenerate_shapes += 1;
    }

    /// One warning about all: such triangles are common, and nobody sees them.
    fn summarise_degenerate(&mut self) {
        let (count, shapes) = (self.degenerate, self.degenerate_shapes);
        if count > 0 {
            let faces = if count == 1 { "1 face has".to_owned() } else { format!("{count} faces have") };
            let shapes = if shapes == 1 { "this shape".to_owned() } else { format!("{shapes} shapes, this one first") };
            self.warn(self.first_degenerate, format!("{faces} no area and will not be drawn ({shapes})"));
        }
    }
}

/// The objects of a scene by number, and whether any instance places them.
fn instanced_objects(scene: &Scene) -> impl Iterator<Item = (usize, bool)> {
    let mut instanced = vec![false; scene.objects.len()];
    for instance in &scene.instances {
        instanced[instance.object.index()] = true;
    }
    instanced.into_iter().enumerate()
}

/// Reads shapes in parallel, and collects what there is to say about them in their order.
fn load_all<'s>(
    scene: &Scene,
    shapes: &'s [Shape],
    textures: Option<&Textures>,
    messages: &mut Messages,
) -> Vec<Loading<'s>> {
    let visible: Vec<Loading<'s>> =
        shapes.iter().filter_map(|shape| Loading::new(scene, shape, textures, messages)).collect();
    let loaded: Vec<Result<Loaded, String>> =
        visible.par_iter().map(|loading| load::load(loading.shape, loading.emits)).collect();
    let mut result: Vec<Loading<'s>> = Vec::with_capacity(visible.len());
    for (mut loading, loaded) in visible.into_iter().zip(loaded) {
        let span = loading.shape.span;
        match loaded {
            Err(error) => messages.error(span, error),
            Ok(loaded) => {
                loaded.notes.into_iter().for_each(|note| messages.warn(span, note));
                messages.count_degenerate(span, loaded.degenerate);
                loading.parts = loaded.parts;
                if !result.last_mut().is_some_and(|last| last.absorb(&mut loading)) {
                    result.push(loading);
                }
            }
        }
    }
    result
}

/// A shape on its way into a scene.
struct Loading<'s> {
    shape: &'s Shape,
    /// The alpha that hits are tested with, if they are.
    alpha: Option<Alpha>,
    emits: bool,
    parts: Vec<Part>,
}

impl<'s> Loading<'s> {
    /// `None`: nothing of the shape will be seen.
    fn new(scene: &Scene, shape: &'s Shape, textures: Option<&Textures>, messages: &mut Messages) -> Option<Self> {
        let alpha = match &shape.alpha {
            Some(value) => textures.map_or_else(|| value.clone(), |textures| textures.folded_float(value)),
            None => Value::Constant(1.0),
        };
        let emits = shape.area_light.is_some();
        let alpha = match alpha {
            Value::Constant(alpha) if alpha >= 1.0 => None,
            Value::Constant(alpha) if alpha <= 0.0 || alpha.is_nan() => {
                if emits {
                    let text = "an emitting shape with an alpha of 0 is left out together with its light; \
                                to light a scene without being seen, use a point, spot or distant light";
                    messages.warn(shape.span, text);
                }
                return None;
            }
            value => Some(Alpha { by_uv: textures.is_none_or(|textures| textures.follows_uv(&value)), value }),
        };
        // Between media that are not rendered, an interface is nothing.
        let interface = matches!(scene.materials[shape.material.index()].kind, MaterialKind::Interface);
        (emits || !interface).then_some(Self { shape, alpha, emits, parts: Vec::new() })
    }

    /// Takes the curves of `next` into those of this one, if they look alike: hair is thousands of shapes of one curve.
    fn absorb(&mut self, next: &mut Loading<'_>) -> bool {
        let looks = |loading: &Loading<'_>| (loading.shape.material, loading.alpha.clone(), loading.shape.name.clone());
        let alike = looks(self) == looks(next);
        match (&mut self.parts[..], &mut next.parts[..]) {
            ([Part::Curves(kind, segments)], [Part::Curves(next_kind, more)]) if alike && kind == next_kind => {
                segments.append(more);
                true
            }
            _ => false,
        }
    }
}

//! Names of what can be seen, for mattes.

use std::collections::HashMap;
use std::sync::Arc;

use crate::interaction::{Geometry, Surface};
use crate::scene::Span;
use crate::scene::description::{Material, Scene, Shape, ShapeKind};

/// Names of surfaces: of those that are not instanced, and then of each instance's.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Names {
    /// Of the objects that surfaces are of.
    pub objects: Vec<Arc<str>>,
    /// Of their materials.
    pub materials: Vec<Arc<str>>,
    /// Where the surfaces of each instance begin.
    pub instances: Vec<u32>,
}

impl Names {
    /// The names of a scene's surfaces.
    ///
    /// A shape has the name of its parameter `name`, or that of the object that it is defined in, or that of its file. A
    /// material has that of its `MakeNamedMaterial`, and the one of shapes that are given none is `default`. What has no name is called after its place in the scene file. Instances
    /// of an object are counted from 1, in their order in the scene, and the shapes of each have its number behind their
    /// names: `tree.1`.
    pub fn new(scene: &Scene, geometry: &Geometry) -> Self {
        let mut places = scene.sources.places();
        let mut place = |span: Span| -> Arc<str> {
            let place = places.place(span);
            let file = place.path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            format!("{file}:{}", place.line).into()
        };
        let objects = scene.objects.iter().flat_map(|o| o.shapes.iter().map(move |shape| (shape, Some(&o.name))));
        let shapes = scene.shapes.iter().map(|shape| (shape, None)).chain(objects);
        let objects: HashMap<Span, Arc<str>> = shapes
            .map(|(shape, object)| (shape.span, of_shape(shape, object).unwrap_or_else(|| place(shape.span))))
            .collect();
        let of_material = |material: &Material| {
            let default = material.span == Span::default();
            material.name.as_deref().or(default.then_some("default")).map(Arc::from)
        };
        let materials: Vec<Arc<str>> =
            scene.materials.iter().map(|m| of_material(m).unwrap_or_else(|| place(m.span))).collect();

        let mut names = Self::default();
        let mut add = |surface: &Surface, object: Arc<str>| {
            names.objects.push(object);
            names.materials.push(Arc::clone(&materials[surface.material.index()]));
        };
        for surface in &geometry.surfaces()[geometry.placed()] {
            add(surface, Arc::clone(&objects[&surface.span]));
        }
        let mut instances = Vec::with_capacity(geometry.instances().len());
        let mut next = geometry.placed().end as u32;
        let mut copies: HashMap<usize, u32> = HashMap::new();
        for object in geometry.instanced() {
            instances.push(next);
            next += object.len() as u32;
            let copy = copies.entry(object.start).or_default();
            *copy += 1;
            for surface in &geometry.surfaces()[object] {
                add(surface, format!("{}.{copy}", objects[&surface.span]).into());
            }
        }
        Self { instances, ..names }
    }
}

fn of_shape(shape: &Shape, object: Option<&Arc<str>>) -> Option<Arc<str>> {
    let file = match &shape.kind {
        ShapeKind::Ply { path, .. } => path.file_stem().map(|stem| stem.to_string_lossy().into()),
        _ => None,
    };
    shape.name.clone().or_else(|| object.cloned()).or(file)
}

//! Names of what can be seen, for mattes.

use std::collections::HashMap;
use std::sync::Arc;

use crate::interaction::Geometry;
use crate::scene::Span;
use crate::scene::description::{Material, Scene, Shape, ShapeKind};

/// Names by surface.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Names {
    /// Of the objects that surfaces are of.
    pub objects: Vec<Arc<str>>,
    /// Of their materials.
    pub materials: Vec<Arc<str>>,
}

impl Names {
    /// The names of a scene's surfaces.
    ///
    /// A shape has the name of its parameter `name`, or that of the object that it is defined in, which all instances of the
    /// object share, or that of its file. A material has that of its `MakeNamedMaterial`. What has no name is called after its
    /// place in the scene file.
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
        let of_material = |material: &Material| material.name.as_deref().map(Arc::from);
        let materials: Vec<Arc<str>> =
            scene.materials.iter().map(|m| of_material(m).unwrap_or_else(|| place(m.span))).collect();
        let surfaces = geometry.surfaces().iter();
        Self {
            objects: surfaces.clone().map(|surface| Arc::clone(&objects[&surface.span])).collect(),
            materials: surfaces.map(|surface| Arc::clone(&materials[surface.material.index()])).collect(),
        }
    }
}

fn of_shape(shape: &Shape, object: Option<&Arc<str>>) -> Option<Arc<str>> {
    let file = match &shape.kind {
        ShapeKind::Ply { path, .. } => path.file_stem().map(|stem| stem.to_string_lossy().into()),
        _ => None,
    };
    shape.name.clone().or_else(|| object.cloned()).or(file)
}

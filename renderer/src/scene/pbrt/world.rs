//! What the directives have added to a scene, before names are resolved.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::context::Names;
use super::materials::MaterialTable;
use super::params::Params;
use super::textures::TextureTable;
use crate::math::Transform;
use crate::scene::Span;
use crate::scene::description::{Medium, Shape};

/// The material of a shape, before all materials are known.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum MaterialRef {
    /// By its place in the table.
    Slot(usize),
    /// By its name.
    Named(String, Span),
}

/// An object as read.
#[derive(Debug)]
pub(super) struct ObjectEntity {
    pub(super) name: Arc<str>,
    pub(super) shapes: Vec<Shape>,
    pub(super) instances: Vec<InstanceEntity>,
    pub(super) span: Span,
}

/// A placed object as read.
#[derive(Clone, Copy, Debug)]
pub(super) struct InstanceEntity {
    /// Number of the object's name in [`World::object_names`].
    pub(super) name: u32,
    pub(super) transform: Transform,
    pub(super) span: Span,
}

/// What the directives have added so far. Shapes refer to materials, textures and media by the numbers of their names.
pub(super) struct World {
    pub(super) textures: TextureTable,
    pub(super) materials: MaterialTable,
    pub(super) material_refs: Vec<MaterialRef>,
    pub(super) lights: Vec<(Params, Transform)>,
    pub(super) area_lights: Vec<Params>,
    pub(super) media: BTreeMap<String, Option<Medium>>,
    pub(super) medium_names: Names<String>,
    pub(super) shapes: Vec<Shape>,
    pub(super) objects: Vec<ObjectEntity>,
    pub(super) object_names: Names<String>,
    pub(super) instances: Vec<InstanceEntity>,
}

impl Default for World {
    fn default() -> Self {
        Self {
            textures: TextureTable::default(),
            materials: MaterialTable::new(),
            material_refs: vec![MaterialRef::Slot(0)],
            lights: Vec::new(),
            area_lights: Vec::new(),
            media: BTreeMap::new(),
            medium_names: Names::default(),
            shapes: Vec::new(),
            objects: Vec::new(),
            object_names: Names::default(),
            instances: Vec::new(),
        }
    }
}

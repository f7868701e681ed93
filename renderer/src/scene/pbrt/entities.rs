//! Directives that add something to the scene: shapes, lights, materials, textures, media, and the options.

use std::sync::Arc;

use super::materials::MaterialEntity;
use super::media;
use super::param::Param;
use super::params::Params;
use super::reader::Reader;
use super::report::shown;
use super::shapes;
use super::state::Attributes;
use super::syntax::Entity;
use super::textures::{TextureEntity, TextureValues};
use super::world::MaterialRef;
use crate::scene::Span;
use crate::scene::description::{AreaLightId, MaterialId, MediumId, Shape};

impl Reader {
    pub(super) fn named_material(&mut self, name: String, span: Span) {
        self.only_in_world("NamedMaterial", span);
        let refs = &mut self.world.material_refs;
        self.state.material = *self.named_materials.entry(name.clone()).or_insert_with(|| {
            refs.push(MaterialRef::Named(name, span));
            refs.len() as u32 - 1
        });
    }

    pub(super) fn medium_interface(&mut self, inside: String, outside: String, span: Span) {
        let mut medium =
            |name: String| (!name.is_empty()).then(|| MediumId(self.world.medium_names.intern(name, span)));
        self.state.media = [medium(inside), medium(outside)];
    }

    pub(super) fn texture(&mut self, name: String, values: &str, params: Params) {
        let span = params.span;
        let values = match values {
            "float" => TextureValues::Float,
            "spectrum" => TextureValues::Spectrum,
            // Its name before version 4.
            "color" => {
                self.cx.report.warning("color texture", span, "a texture of \"color\" is now one of \"spectrum\"");
                TextureValues::Spectrum
            }
            other => {
                let other = shown(other);
                let text = format!("a texture is \"float\" or \"spectrum\", not \"{other}\"");
                self.cx.report.error(span, text);
                return;
            }
        };
        let world_from_texture = self.placed("texture", span);
        let shown_name = shown(&name);
        if !self.world.textures.add(TextureEntity { name, values, params, world_from_texture }) {
            self.cx.report.error(span, format!("there is already a texture \"{shown_name}\" of these values"));
        }
    }

    pub(super) fn entity(&mut self, entity: Entity, name: String, params: Vec<Param>, span: Span) {
        let attributes = Arc::clone(&self.state.attributes);
        match entity {
            Entity::Shape => {
                self.only_in_world("Shape", span);
                self.shape(Params::new("shape", name, span, params, &attributes.shape));
            }
            Entity::Light => {
                self.only_in_world("LightSource", span);
                let world_from_light = self.placed("light", span);
                let params = Params::new("light", name, span, params, &attributes.light);
                self.world.lights.push((params, world_from_light));
            }
            Entity::AreaLight => {
                self.only_in_world("AreaLightSource", span);
                self.state.area_light = Some(self.world.area_lights.len() as u32);
                self.world.area_lights.push(Params::new("area light", name, span, params, &attributes.light));
            }
            Entity::Material => {
                self.only_in_world("Material", span);
                let params = Params::new("material", name, span, params, &attributes.material);
                if let Some(slot) = self.world.materials.add(MaterialEntity { name: None, params }) {
                    self.state.material = self.world.material_refs.len() as u32;
                    self.world.material_refs.push(MaterialRef::Slot(slot));
                }
            }
            Entity::NamedMaterial => {
                self.only_in_world("MakeNamedMaterial", span);
                let params = Params::new("material", name.clone(), span, params, &attributes.material);
                if self.world.materials.add(MaterialEntity { name: Some(name.clone()), params }).is_none() {
                    self.cx.report.error(span, format!("there is already a material named \"{}\"", shown(&name)));
                }
            }
            Entity::NamedMedium => {
                let mut params = Params::new("medium", name.clone(), span, params, &attributes.medium);
                if self.world.media.contains_key(&name) {
                    self.cx.report.error(span, format!("there is already a medium named \"{}\"", shown(&name)));
                    return;
                }
                let medium = media::build(&mut self.cx, &mut params);
                self.world.media.insert(name, medium);
            }
            Entity::Attribute => self.attribute(&name, params, span),
            Entity::Camera => {
                self.only_before_world("Camera", span);
                let camera_from_world = self.placed("camera", span);
                let systems = self.state.transforms.map(|transform| transform.inverse());
                self.systems.insert("camera".to_owned(), systems);
                let params = Params::new("camera", name, span, params, &[]);
                self.options.set_camera(&mut self.cx, params, camera_from_world.inverse());
            }
            Entity::Film => {
                self.only_before_world("Film", span);
                let params = Params::new("film", name, span, params, &[]);
                self.options.set_film(&mut self.cx, params, self.state.color_space);
            }
            Entity::PixelFilter => {
                self.option(entity, "PixelFilter", Params::new("pixel filter", name, span, params, &[]))
            }
            Entity::Sampler => self.option(entity, "Sampler", Params::new("sampler", name, span, params, &[])),
            Entity::Integrator => self.option(entity, "Integrator", Params::new("integrator", name, span, params, &[])),
            // How rays find shapes is Embree's.
            Entity::Accelerator => self.only_before_world("Accelerator", span),
        }
    }

    fn option(&mut self, entity: Entity, name: &str, params: Params) {
        self.only_before_world(name, params.span);
        self.options.set_other(&mut self.cx, entity, params);
    }

    fn attribute(&mut self, target: &str, params: Vec<Param>, span: Span) {
        let attributes = Arc::make_mut(&mut self.state.attributes);
        let Some(list) = attributes.target(target) else {
            self.cx.unknown_type("target of Attribute", target, span, &Attributes::TARGETS);
            return;
        };
        for mut param in params {
            param.inherited = true;
            list.retain(|p| p.name != param.name);
            list.push(param);
        }
    }

    fn shape(&mut self, mut params: Params) {
        let span = params.span;
        let world_from_shape = self.placed("shape", span);
        let kind = shapes::build(&mut self.cx, &mut params);
        let alpha = shapes::alpha(&mut self.cx, &mut params);
        // Not pbrt's: what mattes know the shape by.
        let name = params.string(&mut self.cx, "name").filter(|name| !name.is_empty()).map(Arc::from);
        params.finish(&mut self.cx);
        let mut area_light = self.state.area_light.map(AreaLightId);
        if self.open_object.is_some() && area_light.take().is_some() {
            let text = "shapes of objects do not shine: this one is drawn without its area light, as in pbrt";
            self.cx.report.warning("area light in object", span, text);
        }
        let Some(kind) = kind else { return };
        let shape = Shape {
            world_from_shape,
            reverse_orientation: self.state.reverse_orientation,
            kind,
            material: MaterialId(self.state.material),
            area_light,
            alpha,
            name,
            media: self.state.media,
            span,
        };
        match self.open_object {
            Some(object) => self.world.objects[object].shapes.push(shape),
            None => self.world.shapes.push(shape),
        }
    }
}

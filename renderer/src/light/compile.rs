//! From the description of lights to lights.

mod candidates;
mod sources;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec3, Vec3};

use super::area::{AreaEmitter, Emission};
use super::image::LightImage;
use super::tree::{LightTree, build::Candidate};
use super::{Group, Lights, NO_GROUP};
use crate::math::{Rgb, luminance};
use crate::scene::Span;
use crate::scene::description::{self, AreaLightId, Value};
use crate::shape::Shape;
use crate::texture::RgbImage;
use crate::texture::image::{Flaws, UNKNOWN_SPACE, load_rgb};

/// A message and the place in the scene file that it is about.
pub type Message = (Span, String);

/// A shape that emits as one of the scene's area lights says.
#[derive(Clone, Debug)]
pub struct Emitter {
    /// The shape, in the world.
    pub shape: Shape,
    /// Area (m²) of the face that it is, or is half of: a power is that of the whole face.
    pub face_area: f32,
    /// Probability of a point being there; `None`: 1.
    pub alpha: Option<Value<f32>>,
    /// Its emission.
    pub light: AreaLightId,
}

impl Lights {
    /// The lights of a scene. Emitters keep the numbers of their order. `scene_bounds` are two corners of a box, world.
    ///
    /// Returns also warnings.
    ///
    /// # Errors
    /// Images that cannot be read or do not fit, and transforms without an inverse: all of them.
    pub fn build(
        lights: &[description::Light],
        area: &[description::AreaLight],
        emitters: Vec<Emitter>,
        scene_bounds: (Vec3, Vec3),
    ) -> Result<(Self, Vec<Message>), Vec<Message>> {
        Self::build_with(lights, area, emitters, scene_bounds, load_rgb)
    }

    /// As [`Self::build`], with images from `load`: see [`load_rgb`].
    pub(super) fn build_with(
        lights: &[description::Light],
        area: &[description::AreaLight],
        emitters: Vec<Emitter>,
        scene_bounds: (Vec3, Vec3),
        load: impl Fn(&Path) -> Loaded,
    ) -> Result<(Self, Vec<Message>), Vec<Message>> {
        let mut compiler = Compiler {
            load,
            images: BTreeMap::new(),
            warnings: Vec::new(),
            errors: Vec::new(),
            group: Group::default(),
            built: Lights { groups: groups(lights, area), ..Lights::default() },
        };
        let emissions = compiler.emissions(area);
        let mut choices = compiler.emitters(area, &emissions, emitters);
        choices.extend(lights.iter().filter_map(|light| compiler.light(light)));
        if !compiler.errors.is_empty() {
            return Err(compiler.errors);
        }
        let mut built = compiler.built;
        let size = (scene_bounds.1.as_dvec3() - scene_bounds.0.as_dvec3()).length();
        built.tree = LightTree::build(&choices, built.emitters.len() + built.points.len(), size);
        built.arrange();
        Ok((built, compiler.warnings))
    }
}

/// An image and what was mended of it, or why there is none.
pub(super) type Loaded = Result<(RgbImage, Flaws), String>;

/// The names of all groups, sorted.
fn groups(lights: &[description::Light], area: &[description::AreaLight]) -> Vec<Arc<str>> {
    let names = lights.iter().map(|light| &light.group).chain(area.iter().map(|light| &light.group));
    let names: BTreeSet<&str> = names.map(|name| name.as_deref().unwrap_or(NO_GROUP)).collect();
    names.into_iter().map(Arc::from).collect()
}

struct Compiler<Load> {
    load: Load,
    /// What each file held, `None`: it was no use, which has been said.
    images: BTreeMap<PathBuf, Option<Arc<LightImage>>>,
    warnings: Vec<Message>,
    errors: Vec<Message>,
    /// Of the light at hand.
    group: Group,
    built: Lights,
}

impl<Load: Fn(&Path) -> Loaded> Compiler<Load> {
    /// The group of that name.
    fn group_of(&self, name: &Option<Arc<str>>) -> Group {
        let name = name.as_deref().unwrap_or(NO_GROUP);
        Group(
            self.built.groups.iter().position(|known| **known == *name).unwrap_or_default().min(u16::MAX.into()) as u16
        )
    }

    /// The image at `path`. `None`: there is an error about it.
    fn image(&mut self, path: &Path, span: Span) -> Option<Arc<LightImage>> {
        if let Some(known) = self.images.get(path) {
            return known.clone();
        }
        let loaded = (self.load)(path).and_then(|(image, flaws)| {
            let (image, unusable) =
                LightImage::new(image).ok_or_else(|| format!("\"{}\" has no pixels", path.display()))?;
            Ok((image, flaws.replaced + unusable, flaws.unknown_space))
        });
        let image = match loaded {
            Ok((image, unusable, unknown_space)) => {
                if unknown_space {
                    self.warnings.push((span, format!("\"{}\" {UNKNOWN_SPACE}", path.display())));
                }
                if unusable > 0 {
                    let what = "values are negative, infinite or not a number, and count as 0";
                    self.warnings.push((span, format!("\"{}\": {unusable} {what}", path.display())));
                }
                Some(Arc::new(image))
            }
            Err(message) => {
                self.errors.push((span, message));
                None
            }
        };
        self.images.insert(path.to_owned(), image.clone());
        image
    }

    /// As [`Self::image`], for an image in octahedral layout.
    fn octahedral_image(&mut self, path: &Path, span: Span) -> Option<Arc<LightImage>> {
        let image = self.image(path, span)?;
        let (width, height) = (image.width(), image.height());
        if width == height {
            return Some(image);
        }
        let advice = "an equal-area octahedral image is square; pbrt's \"imgtool makeequiarea\" makes one from a \
                      latitude-longitude map";
        self.errors.push((span, format!("\"{}\" has {width}x{height} pixels; {advice}", path.display())));
        None
    }

    /// `rgb`, with values that no light can have set to 0.
    fn sane(&mut self, rgb: Rgb, span: Span) -> Rgb {
        let clean = Rgb::from_array(rgb.to_array().map(|v| if v >= 0.0 && v.is_finite() { v } else { 0.0 }));
        if clean != rgb {
            self.warnings.push((span, "negative or infinite emission counts as 0".to_owned()));
        }
        clean
    }

    /// Emission by area light; `None` after an error.
    fn emissions(&mut self, area: &[description::AreaLight]) -> Vec<Option<Emission>> {
        let mut emissions = Vec::with_capacity(area.len());
        for light in area {
            let radiance = self.sane(light.radiance, light.span);
            let image = match &light.image {
                None => None,
                Some(path) => match self.image(path, light.span) {
                    None => {
                        emissions.push(None);
                        continue;
                    }
                    Some(image) => Some(self.image_index(image)),
                },
            };
            emissions.push(Some(Emission { radiance, image, two_sided: light.two_sided }));
        }
        emissions
    }

    fn image_index(&mut self, image: Arc<LightImage>) -> u32 {
        let images = &mut self.built.images;
        let index = images.iter().position(|known| Arc::ptr_eq(known, &image)).unwrap_or(images.len());
        if index == images.len() {
            images.push(image);
        }
        index as u32
    }

    /// Takes over the emitters and returns those that a light sample may choose.
    fn emitters(
        &mut self,
        area: &[description::AreaLight],
        emissions: &[Option<Emission>],
        emitters: Vec<Emitter>,
    ) -> Vec<Candidate> {
        let means: Vec<DVec3> = self.built.images.iter().map(|image| image.mean()).collect();
        let groups: Vec<Group> = area.iter().map(|light| self.group_of(&light.group)).collect();
        let mut degenerate = vec![0usize; area.len()];
        let mut choices = Vec::with_capacity(emitters.len());
        for Emitter { shape, face_area, alpha, light } in emitters {
            let Some(mut emission) = emissions[light.index()].clone() else { continue };
            let shape_area = f64::from(shape.area());
            let mean = emission.image.map_or(DVec3::ONE, |image| means[image as usize]);
            if let Some(power) = area[light.index()].power.filter(|&p| p > 0.0) {
                // As in pbrt, the power is that of each shape, and so of each face of a mesh.
                let sides = if emission.two_sided { 2.0 } else { 1.0 };
                let relative = luminance_f64(if emission.image.is_some() { mean } else { DVec3::ONE });
                let per_level = sides * f64::from(face_area) * std::f64::consts::PI * relative;
                emission.radiance = scaled(emission.radiance, f64::from(power), per_level);
            }
            let number = self.built.emitters.len() as u32;
            let radiance = (emission.radiance.as_dvec3() * mean).element_sum() / 3.0;
            if shape_area > 0.0 && shape_area.is_finite() {
                choices.extend(candidates::of_shape(number, &shape, shape_area, radiance, emission.two_sided));
            } else {
                degenerate[light.index()] += 1;
            }
            let group = groups[light.index()];
            self.built.emitters.push(AreaEmitter { shape, emission, alpha, group });
        }
        for (light, &count) in area.iter().zip(&degenerate) {
            if count > 0 {
                self.warnings.push((light.span, format!("{count} emitting shapes have no area and light nothing")));
            }
        }
        choices
    }
}

/// `level` scaled so that an emission of 1 over `per_level` becomes `total`, where that is given and positive.
fn with_total(level: Rgb, total: Option<f32>, per_level: f64) -> Rgb {
    total.filter(|&t| t > 0.0).map_or(level, |total| scaled(level, f64::from(total), per_level))
}

fn scaled(level: Rgb, total: f64, per_level: f64) -> Rgb {
    if per_level > 0.0 { (level.as_dvec3() * (total / per_level)).as_vec3() } else { Rgb::ZERO }
}

fn luminance_f64(rgb: DVec3) -> f64 {
    // In one place only: relative to the largest value, so that f32 can hold it.
    let largest = rgb.max_element();
    if largest > 0.0 { f64::from(luminance((rgb / largest).as_vec3())) * largest } else { 0.0 }
}

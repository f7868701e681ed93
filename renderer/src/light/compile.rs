//! From the description of lights to lights.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DMat3, DVec3, Mat3, Vec3};

use super::Lights;
use super::area::{AreaEmitter, Emission as AreaEmission};
use super::bounds::{ALL_DIRECTIONS, LightBounds, cone_from_cosine};
use super::environment::{Environment, pbrt_illuminance};
use super::image::LightImage;
use super::infinite::Infinite;
use super::point::{Emission, Goniometric, PointLight, Projection, Spot};
use super::tree::{LightTree, build::Candidate};
use crate::math::{Rgb, luminance};
use crate::scene::Span;
use crate::scene::description::{self, AreaLightId, LightKind};
use crate::shape::Shape;
use crate::texture::{RgbImage, load_rgb};

/// A message and the place in the scene file that it is about.
pub type Message = (Span, String);

/// A shape that emits as one of the scene's area lights says.
#[derive(Clone, Debug)]
pub struct Emitter {
    /// The shape, in the world.
    pub shape: Shape,
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
        Self::build_with(lights, area, emitters, scene_bounds, |path| load_rgb(path))
    }

    /// As [`Self::build`], with images from `load`.
    pub(super) fn build_with(
        lights: &[description::Light],
        area: &[description::AreaLight],
        emitters: Vec<Emitter>,
        scene_bounds: (Vec3, Vec3),
        load: impl Fn(&Path) -> Result<RgbImage, String>,
    ) -> Result<(Self, Vec<Message>), Vec<Message>> {
        let mut compiler = Compiler {
            load,
            images: BTreeMap::new(),
            warnings: Vec::new(),
            errors: Vec::new(),
            built: Lights::default(),
        };
        let emissions = compiler.emissions(area);
        let mut candidates = compiler.emitters(area, &emissions, emitters);
        for light in lights {
            candidates.extend(compiler.light(light));
        }
        if !compiler.errors.is_empty() {
            return Err(compiler.errors);
        }
        let mut built = compiler.built;
        let size = (scene_bounds.1.as_dvec3() - scene_bounds.0.as_dvec3()).length();
        built.tree = LightTree::build(&candidates, built.emitters.len() + built.points.len(), size);
        built.arrange();
        Ok((built, compiler.warnings))
    }
}

struct Compiler<Load> {
    load: Load,
    /// What each file held, `None`: it was no use, which has been said.
    images: BTreeMap<PathBuf, Option<Arc<LightImage>>>,
    warnings: Vec<Message>,
    errors: Vec<Message>,
    built: Lights,
}

impl<Load: Fn(&Path) -> Result<RgbImage, String>> Compiler<Load> {
    /// The image at `path`. `None`: there is an error about it.
    fn image(&mut self, path: &Path, span: Span) -> Option<Arc<LightImage>> {
        if let Some(known) = self.images.get(path) {
            return known.clone();
        }
        let loaded = (self.load)(path)
            .and_then(|image| LightImage::new(image).ok_or_else(|| format!("\"{}\" has no pixels", path.display())));
        let image = match loaded {
            Ok((image, unusable)) => {
                if unusable > 0 {
                    let what = "pixels are negative, infinite or not a number; such values count as 0";
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
    fn emissions(&mut self, area: &[description::AreaLight]) -> Vec<Option<AreaEmission>> {
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
            emissions.push(Some(AreaEmission { radiance, image, two_sided: light.two_sided }));
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
        emissions: &[Option<AreaEmission>],
        emitters: Vec<Emitter>,
    ) -> Vec<Candidate> {
        let means: Vec<DVec3> = self.built.images.iter().map(|image| image.mean()).collect();
        let mut degenerate = vec![0usize; area.len()];
        let mut candidates = Vec::with_capacity(emitters.len());
        for Emitter { shape, light } in emitters {
            let Some(mut emission) = emissions[light.index()].clone() else { continue };
            let shape_area = f64::from(shape.area());
            let mean = emission.image.map_or(DVec3::ONE, |image| means[image as usize]);
            if let Some(power) = area[light.index()].power.filter(|&p| p > 0.0) {
                // As in pbrt, the power is that of each shape, and so of each triangle of a mesh.
                let sides = if emission.two_sided { 2.0 } else { 1.0 };
                let relative = luminance_f64(if emission.image.is_some() { mean } else { DVec3::ONE });
                emission.radiance =
                    scaled(emission.radiance, f64::from(power), sides * shape_area * std::f64::consts::PI * relative);
            }
            let number = self.built.emitters.len() as u32;
            let radiance = (emission.radiance.as_dvec3() * mean).element_sum() / 3.0;
            if shape_area > 0.0 && shape_area.is_finite() {
                candidates.extend(emitter_candidate(number, &shape, shape_area, radiance, emission.two_sided));
            } else {
                degenerate[light.index()] += 1;
            }
            self.built.emitters.push(AreaEmitter { shape, emission });
        }
        for (light, &count) in area.iter().zip(&degenerate) {
            if count > 0 {
                self.warnings.push((light.span, format!("{count} emitting shapes have no area and light nothing")));
            }
        }
        candidates
    }

    /// Takes over a light and returns how it may be chosen, if it has a place.
    fn light(&mut self, light: &description::Light) -> Option<Candidate> {
        let span = light.span;
        let light_from_world = DMat3::from_mat4(light.world_from_light.inverse().matrix());
        if !light.world_from_light.is_invertible() || light_from_world.determinant() == 0.0 {
            self.errors.push((span, "the light's transform has no inverse: check its scales".to_owned()));
            return None;
        }
        let place = |p: Vec3| light.world_from_light.point(p);
        match &light.kind {
            LightKind::Point { intensity, from, power } => {
                let intensity = self.sane(*intensity, span);
                let intensity = with_power(intensity, *power, 4.0 * std::f64::consts::PI);
                let light = PointLight::new(place(*from), Mat3::IDENTITY, Emission::Isotropic(intensity));
                self.point(light, intensity.as_dvec3(), ALL_DIRECTIONS, std::f64::consts::FRAC_PI_2)
            }
            LightKind::Spot { intensity, from, to, cone_angle, cone_delta_angle, power } => {
                let intensity = self.sane(*intensity, span);
                let intensity = with_power(intensity, *power, Spot::solid_angle(*cone_angle, *cone_delta_angle));
                let Some(axis) = (to.as_dvec3() - from.as_dvec3()).try_normalize() else {
                    self.errors.push((span, "the spot's \"from\" and \"to\" are the same point".to_owned()));
                    return None;
                };
                let (s, t) = axis.any_orthonormal_pair();
                let axes_from_world = DMat3::from_cols(s, t, axis).transpose() * light_from_world;
                let spot = Spot::new(intensity, *cone_angle, *cone_delta_angle);
                let [start, end] = spot.angles();
                let light = PointLight::new(place(*from), axes_from_world.as_mat3(), Emission::Spot(spot));
                self.cone(light, intensity.as_dvec3(), axes_from_world, start, end)
            }
            LightKind::Goniometric { intensity, image, power } => {
                let intensity = self.sane(*intensity, span);
                let image = match image {
                    Some(path) => self.octahedral_image(path, span)?,
                    None => Arc::new(LightImage::white()),
                };
                let intensity = with_power(intensity, *power, Goniometric::solid_angle(&image));
                let goniometric = Goniometric::new(intensity, &image);
                let mean = goniometric.mean();
                let light =
                    PointLight::new(place(Vec3::ZERO), light_from_world.as_mat3(), Emission::Goniometric(goniometric));
                self.point(light, mean, ALL_DIRECTIONS, std::f64::consts::FRAC_PI_2)
            }
            LightKind::Projection { scale, image, fov, power } => {
                let scale = self.sane(*scale, span);
                let image = self.image(image, span)?;
                let scale = with_power(scale, *power, luminance_f64(Projection::solid_angle(&image, *fov)));
                let projection = Projection::new(scale, LightImage::clone(&image), *fov);
                let (mean, half_angle) = (projection.mean(), projection.half_angle());
                let light =
                    PointLight::new(place(Vec3::ZERO), light_from_world.as_mat3(), Emission::Projection(projection));
                self.cone(light, mean, light_from_world, 0.0, half_angle)
            }
            LightKind::Distant { radiance, from, to, illuminance } => {
                let radiance = self.sane(*radiance, span);
                let irradiance = with_power(radiance, *illuminance, 1.0);
                let Some(wi) = light.world_from_light.vector(*from - *to).try_normalize() else {
                    self.errors.push((span, "the light's \"from\" and \"to\" are the same point".to_owned()));
                    return None;
                };
                self.infinite(Infinite::Distant { irradiance, wi }, irradiance == Rgb::ZERO)
            }
            LightKind::Infinite { radiance, image, illuminance, portal } => {
                if !portal.is_empty() {
                    let what = "portals are not rendered: the environment lights the scene from all directions";
                    self.warnings.push((span, what.to_owned()));
                }
                let radiance = self.sane(*radiance, span);
                match image {
                    Some(path) => self.environment(path, radiance, *illuminance, light_from_world, span),
                    None => {
                        let radiance = with_power(radiance, *illuminance, std::f64::consts::PI);
                        self.infinite(Infinite::Uniform { radiance, sampled: true }, radiance == Rgb::ZERO)
                    }
                }
            }
        }
    }

    fn environment(
        &mut self,
        path: &Path,
        scale: Rgb,
        illuminance: Option<f32>,
        light_from_world: DMat3,
        span: Span,
    ) -> Option<Candidate> {
        let image = self.octahedral_image(path, span)?;
        let mut scale = scale;
        if let Some(illuminance) = illuminance.filter(|&e| e > 0.0) {
            let own = pbrt_illuminance(&image);
            if own > 0.0 {
                scale = scaled(scale, f64::from(illuminance), own);
            } else {
                let what = "the upper half of the image is black and cannot have the \"illuminance\" asked for";
                self.warnings.push((span, what.to_owned()));
            }
        }
        let light = Environment::new(&image, scale, light_from_world);
        let black = light.is_black();
        self.infinite(Infinite::Image(Box::new(light)), black)
    }

    fn infinite(&mut self, light: Infinite, black: bool) -> Option<Candidate> {
        if !black {
            self.built.infinite.push(light);
        }
        None
    }

    /// A light at a point that shines along the axis z of its space, up to `end` radians from it and fully up to `start`.
    fn cone(
        &mut self,
        light: PointLight,
        intensity: DVec3,
        light_from_world: DMat3,
        start: f64,
        end: f64,
    ) -> Option<Candidate> {
        // The tree computes angles from cosines in f32: of three of them each errs by √(8ε) at most, where it is near 0.
        const ANGLE_ERROR: f64 = 2.1e-3;
        // A spot that is skewed by its transform is bounded only by its hemisphere.
        let gram = light_from_world * light_from_world.transpose();
        let mean = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
        let skew =
            (gram - DMat3::from_diagonal(DVec3::splat(mean))).to_cols_array().iter().fold(0.0, |m, v| v.abs().max(m));
        let reach = std::f64::consts::FRAC_PI_2;
        // 1e-4 of skew moves an angle by no more than half that, which the margin covers.
        let cone = if skew > 1e-4 * mean || end + ANGLE_ERROR >= reach {
            (ALL_DIRECTIONS, reach)
        } else {
            let axis = (light_from_world.inverse() * DVec3::Z).normalize();
            ((axis, start), (end - start + ANGLE_ERROR).min(reach))
        };
        self.point(light, intensity, cone.0, cone.1)
    }

    fn point(
        &mut self,
        light: PointLight,
        intensity: DVec3,
        (axis, theta_o): (DVec3, f64),
        theta_e: f64,
    ) -> Option<Candidate> {
        let p = light.position().as_dvec3();
        let number = (self.built.emitters.len() + self.built.points.len()) as u32;
        self.built.points.push(light);
        let intensity = intensity.element_sum() / 3.0;
        let bounds = LightBounds { low: p, high: p, axis, theta_o, theta_e, two_sided: false, intensity };
        (intensity > 0.0 && p.is_finite()).then_some(Candidate { light: number, bounds, depth: 0.0 })
    }
}

/// How an emitting shape is chosen; `None`: it emits nothing.
fn emitter_candidate(number: u32, shape: &Shape, area: f64, radiance: f64, two_sided: bool) -> Option<Candidate> {
    let (low, high) = shape.bounds();
    let (axis, theta_o) = {
        let (axis, cos) = shape.normal_cone();
        cone_from_cosine(axis, cos)
    };
    // What is seen of a surface that faces all ways, such as a sphere, is on average a quarter of its area (Cauchy).
    let seen = if theta_o < std::f64::consts::FRAC_PI_2 { area } else { area / 4.0 };
    let bounds = LightBounds {
        low: low.as_dvec3(),
        high: high.as_dvec3(),
        axis,
        theta_o,
        theta_e: std::f64::consts::FRAC_PI_2,
        two_sided,
        intensity: radiance * seen,
    };
    let usable =
        bounds.intensity > 0.0 && bounds.intensity.is_finite() && bounds.low.is_finite() && bounds.high.is_finite();
    usable.then_some(Candidate { light: number, depth: depth(shape, &bounds), bounds })
}

/// How far the shape reaches below the centre of its box along its axis. Of a flat shape any of its points tells.
fn depth(shape: &Shape, bounds: &LightBounds) -> f64 {
    let center = bounds.center();
    let above = center + bounds.axis * bounds.radius();
    let point = if bounds.theta_o == 0.0 { shape.sample(above.as_vec3(), glam::Vec2::splat(0.5)) } else { None };
    let exact = point.map(|s| {
        let error = s.point.error.as_dvec3().dot(bounds.axis.abs());
        bounds.axis.dot(center - s.point.p.as_dvec3()) + error
    });
    exact.unwrap_or(bounds.depth()).min(bounds.depth())
}

/// `level` scaled so that an emission of 1 over `per_level` becomes `total`, where that is given and positive.
fn with_power(level: Rgb, total: Option<f32>, per_level: f64) -> Rgb {
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

//! Lights that are not shapes.

use std::f64::consts::PI;
use std::path::Path;
use std::sync::Arc;

use glam::{DMat3, DVec3, Mat3, Vec3};

use super::super::Member;
use super::super::environment::{Environment, pbrt_illuminance};
use super::super::image::LightImage;
use super::super::infinite::Infinite;
use super::super::point::{Emission, Goniometric, PointLight, Projection, Spot};
use super::super::tree::build::Candidate;
use super::{Compiler, Loaded, candidates, luminance_f64, scaled, with_total};
use crate::math::{Rgb, Transform, unit};
use crate::scene::Span;
use crate::scene::description::{Light, LightKind};

/// Where a light is described and stands.
struct Place<'a> {
    span: Span,
    world_from_light: &'a Transform,
    light_from_world: DMat3,
}

impl<Load: Fn(&Path) -> Loaded> Compiler<Load> {
    /// Takes over a light and returns how it may be chosen, if it has a place in the scene.
    pub(super) fn light(&mut self, light: &Light) -> Option<Candidate> {
        let span = light.span;
        self.group = self.group_of(&light.group);
        let light_from_world = DMat3::from_mat4(light.world_from_light.inverse().matrix());
        if !light.world_from_light.is_invertible() || light_from_world.determinant() == 0.0 {
            self.errors.push((span, "the light's transform has no inverse: check its scales".to_owned()));
            return None;
        }
        let at = Place { span, world_from_light: &light.world_from_light, light_from_world };
        match &light.kind {
            LightKind::Point { intensity, from, power } => {
                let intensity = with_total(self.sane(*intensity, span), *power, 4.0 * PI);
                self.point(at.light(*from, Mat3::IDENTITY, Emission::Isotropic(intensity)), intensity.as_dvec3())
            }
            LightKind::Spot { intensity, from, to, cone_angle, cone_delta_angle, power } => {
                let intensity = self.sane(*intensity, span);
                let total = Spot::solid_angle(*cone_angle, *cone_delta_angle);
                let spot = Spot::new(with_total(intensity, *power, total), *cone_angle, *cone_delta_angle);
                self.spot(&at, *from, *to, spot)
            }
            LightKind::Goniometric { intensity, image, power } => {
                let intensity = self.sane(*intensity, span);
                let image = match image {
                    Some(path) => self.octahedral_image(path, span)?,
                    None => Arc::new(LightImage::white()),
                };
                let intensity = with_total(intensity, *power, Goniometric::solid_angle(&image));
                let goniometric = Goniometric::new(intensity, &image);
                let mean = goniometric.mean();
                let axes = at.light_from_world.as_mat3();
                self.point(at.light(Vec3::ZERO, axes, Emission::Goniometric(goniometric)), mean)
            }
            LightKind::Projection { scale, image, fov, power } => {
                let scale = self.sane(*scale, span);
                let image = self.image(image, span)?;
                let scale = with_total(scale, *power, luminance_f64(Projection::solid_angle(&image, *fov)));
                self.projection(&at, Projection::new(scale, LightImage::clone(&image), *fov))
            }
            LightKind::Distant { radiance, from, to, illuminance } => {
                let irradiance = with_total(self.sane(*radiance, span), *illuminance, 1.0);
                let Some(wi) = unit(light.world_from_light.vector(*from - *to)) else {
                    return self.without_direction(span);
                };
                self.infinite(Infinite::Distant { irradiance, wi }, irradiance == Rgb::ZERO)
            }
            LightKind::Infinite { radiance, image, illuminance, portal: _ } => {
                let radiance = self.sane(*radiance, span);
                match image {
                    Some(path) => self.environment(&at, path, radiance, *illuminance),
                    None => {
                        let radiance = with_total(radiance, *illuminance, PI);
                        self.infinite(Infinite::Uniform { radiance, sampled: true }, radiance == Rgb::ZERO)
                    }
                }
            }
        }
    }

    fn spot(&mut self, at: &Place<'_>, from: Vec3, to: Vec3, spot: Spot) -> Option<Candidate> {
        let Some(axis) = (to.as_dvec3() - from.as_dvec3()).try_normalize() else {
            return self.without_direction(at.span);
        };
        let (s, t) = axis.any_orthonormal_pair();
        let axes_from_world = DMat3::from_cols(s, t, axis).transpose() * at.light_from_world;
        let (angles, intensity) = (spot.angles(), mean(spot.peak().as_dvec3()));
        let light = at.light(from, axes_from_world.as_mat3(), Emission::Spot(spot));
        let p = light.position().as_dvec3();
        candidates::of_cone(self.number(light), p, axes_from_world, angles, intensity)
    }

    fn projection(&mut self, at: &Place<'_>, projection: Projection) -> Option<Candidate> {
        let (intensity, half_angle) = (mean(projection.mean()), projection.half_angle());
        let light = at.light(Vec3::ZERO, at.light_from_world.as_mat3(), Emission::Projection(projection));
        let p = light.position().as_dvec3();
        candidates::of_cone(self.number(light), p, at.light_from_world, [0.0, half_angle], intensity)
    }

    fn point(&mut self, light: PointLight, intensity: DVec3) -> Option<Candidate> {
        let p = light.position().as_dvec3();
        candidates::of_point(self.number(light), p, mean(intensity))
    }

    /// Takes over a light at a point; its number is one beyond those of the emitters and of the lights before it.
    fn number(&mut self, light: PointLight) -> u32 {
        self.built.points.push(Member { light, group: self.group });
        (self.built.emitters.len() + self.built.points.len() - 1) as u32
    }

    fn environment(&mut self, at: &Place<'_>, path: &Path, scale: Rgb, illuminance: Option<f32>) -> Option<Candidate> {
        let image = self.octahedral_image(path, at.span)?;
        let mut scale = scale;
        if let Some(illuminance) = illuminance.filter(|&e| e > 0.0) {
            let own = pbrt_illuminance(&image);
            if own > 0.0 {
                scale = scaled(scale, f64::from(illuminance), own);
            } else {
                let what = "the upper half of the image is black and cannot have the \"illuminance\" asked for";
                self.warnings.push((at.span, what.to_owned()));
            }
        }
        let light = Environment::new(&image, scale, at.light_from_world);
        let black = light.is_black();
        self.infinite(Infinite::Image(Box::new(light)), black)
    }

    /// Takes over a light that the tree does not choose.
    fn infinite(&mut self, light: Infinite, black: bool) -> Option<Candidate> {
        if !black {
            self.built.infinite.push(Member { light, group: self.group });
        }
        None
    }

    fn without_direction(&mut self, span: Span) -> Option<Candidate> {
        self.errors.push((span, "the light's \"from\" and \"to\" are the same point".to_owned()));
        None
    }
}

impl Place<'_> {
    /// A light at `p` of light space that emits by directions of the space that `axes_from_world` leads to.
    fn light(&self, p: Vec3, axes_from_world: Mat3, emission: Emission) -> PointLight {
        PointLight::new(self.world_from_light.point(p), axes_from_world, emission)
    }
}

fn mean(rgb: DVec3) -> f64 {
    rgb.element_sum() / 3.0
}

//! Lights: `LightSource "type"` and `AreaLightSource "type"`.
//!
//! pbrt divides the level of every emission spectrum by its photometric luminance, so that the level of a blackbody or
//! named spectrum is `scale` and that of an RGB its own. [`Usage::Illuminant`] does that.
//!
//! `"string group"` is not pbrt's: it names the group of lights whose share of the image is wanted by itself.

use std::sync::Arc;

use glam::Vec3;

use super::context::Context;
use super::params::Params;
use super::report::shown;
use super::spectra::Usage;
use crate::math::{Rgb, Transform};
use crate::scene::description::{AreaLight, Light, LightKind};

const TYPES: [&str; 6] = ["point", "spot", "distant", "infinite", "goniometric", "projection"];

/// Builds a light. `None` after an error.
pub(super) fn build(cx: &mut Context, params: &mut Params, world_from_light: Transform) -> Option<Light> {
    let kind = match params.name.as_str() {
        "point" => Some(point(cx, params)),
        "spot" => spot(cx, params),
        "distant" => distant(cx, params),
        "infinite" => Some(infinite(cx, params)),
        "goniometric" => Some(goniometric(cx, params)),
        "projection" => projection(cx, params),
        name => {
            let name = name.to_owned();
            cx.unknown_type("light", &name, params.span, &TYPES);
            params.ignore_all();
            None
        }
    };
    let group = group(cx, params);
    params.finish(cx);
    Some(Light { world_from_light, kind: kind?, group, span: params.span })
}

/// Builds the emission of a shape. `None` after an error.
pub(super) fn build_area(cx: &mut Context, params: &mut Params) -> Option<AreaLight> {
    if params.name != "diffuse" {
        let name = params.name.clone();
        cx.unknown_type("area light", &name, params.span, &["diffuse"]);
        return None;
    }
    let image = params.path(cx, "filename");
    if image.is_some() && params.has("L") {
        cx.report.error(params.span_of("L"), "\"L\" and \"filename\" exclude each other: give either");
    }
    let light = AreaLight {
        radiance: level(cx, params, "L"),
        image,
        two_sided: params.bool(cx, "twosided", false),
        power: power(cx, params, "power"),
        group: group(cx, params),
        span: params.span,
    };
    params.finish(cx);
    Some(light)
}

/// The group that a light is in. Its name becomes part of those of channels, in which a dot separates layers.
fn group(cx: &mut Context, params: &mut Params) -> Option<Arc<str>> {
    let name = params.string(cx, "group").filter(|name| !name.is_empty())?;
    if name.bytes().any(|byte| !byte.is_ascii_alphanumeric() && byte != b'_' && byte != b'-') {
        let text = format!("\"group\" takes letters, digits, \"_\" and \"-\", not \"{}\"", shown(&name));
        cx.report.error(params.span_of("group"), text);
        return None;
    }
    Some(name.into())
}

/// The emission `name` times `scale`; white of luminance 1 where it is not given.
fn level(cx: &mut Context, params: &mut Params, name: &'static str) -> Rgb {
    let rgb = params.opt_rgb(cx, name, Usage::Illuminant).unwrap_or(Rgb::ONE);
    rgb * params.float_where(cx, "scale", 1.0, "at least 0", |scale| scale >= 0.0)
}

/// A power or illuminance. Those that are not positive mean none, as in pbrt.
fn power(cx: &mut Context, params: &mut Params, name: &'static str) -> Option<f32> {
    params.opt_float(cx, name).filter(|&power| power > 0.0)
}

fn point(cx: &mut Context, params: &mut Params) -> LightKind {
    LightKind::Point {
        intensity: level(cx, params, "I"),
        from: params.point3(cx, "from", Vec3::ZERO),
        power: power(cx, params, "power"),
    }
}

/// The ends of a light's axis. `None` if they coincide.
fn axis(cx: &mut Context, params: &mut Params) -> Option<(Vec3, Vec3)> {
    let from = params.point3(cx, "from", Vec3::ZERO);
    let to = params.point3(cx, "to", Vec3::Z);
    if (to.as_dvec3() - from.as_dvec3()).try_normalize().is_none() {
        cx.report.error(params.span, "\"from\" and \"to\" are the same point, so the light has no direction");
        return None;
    }
    Some((from, to))
}

fn spot(cx: &mut Context, params: &mut Params) -> Option<LightKind> {
    let cone_angle = params.float_where(cx, "coneangle", 30.0, "from 0 to 180", |a| (0.0..=180.0).contains(&a));
    let cone_delta_angle = params.float_where(cx, "conedeltaangle", 5.0, "at least 0", |a| a >= 0.0).min(cone_angle);
    let (intensity, power) = (level(cx, params, "I"), power(cx, params, "power"));
    let (from, to) = axis(cx, params)?;
    Some(LightKind::Spot { intensity, from, to, cone_angle, cone_delta_angle, power })
}

fn distant(cx: &mut Context, params: &mut Params) -> Option<LightKind> {
    let (radiance, illuminance) = (level(cx, params, "L"), power(cx, params, "illuminance"));
    let (from, to) = axis(cx, params)?;
    Some(LightKind::Distant { radiance, from, to, illuminance })
}

fn infinite(cx: &mut Context, params: &mut Params) -> LightKind {
    let image = params.path(cx, "filename");
    if image.is_some() && params.has("L") {
        cx.report.error(params.span_of("L"), "\"L\" and \"filename\" exclude each other: give either");
    }
    let portal = params.point3s(cx, "portal");
    if !portal.is_empty() {
        let text = "portals are not rendered: the light shines from everywhere, as it would without one";
        cx.report.warning("portal", params.span_of("portal"), text);
        if portal.len() != 4 {
            let text = format!("a portal has 4 corners, not {}", portal.len());
            cx.report.error(params.span_of("portal"), text);
        }
    }
    let (radiance, illuminance) = (level(cx, params, "L"), power(cx, params, "illuminance"));
    LightKind::Infinite { radiance, image, illuminance, portal }
}

fn goniometric(cx: &mut Context, params: &mut Params) -> LightKind {
    let (intensity, power) = (level(cx, params, "I"), power(cx, params, "power"));
    let image = params.path(cx, "filename");
    if image.is_none() {
        let text = "a goniometric light without \"filename\" shines the same in all directions";
        cx.report.warning("goniometric without image", params.span, text);
    }
    LightKind::Goniometric { intensity, image, power }
}

fn projection(cx: &mut Context, params: &mut Params) -> Option<LightKind> {
    let scale = params.float_where(cx, "scale", 1.0, "at least 0", |scale| scale >= 0.0);
    let fov = params.float_where(cx, "fov", 90.0, "between 0 and 180", |fov| fov > 0.0 && fov < 180.0);
    let power = power(cx, params, "power");
    let image = params.needed_path(cx)?;
    Some(LightKind::Projection { scale: Rgb::splat(scale), image, fov, power })
}

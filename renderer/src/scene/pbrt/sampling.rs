//! How pixels are filtered and sampled and how light is traced: `PixelFilter`, `Sampler`, `Integrator`, `Accelerator`.

use glam::Vec2;

use super::context::Context;
use super::params::Params;
use crate::scene::description::{Integrator, PixelFilter, PixelFilterKind};

/// Builds the pixel filter.
pub(super) fn filter(cx: &mut Context, params: &mut Params) -> PixelFilter {
    let third = 1.0 / 3.0;
    let (radius, kind) = match params.name.as_str() {
        "box" => (0.5, PixelFilterKind::Box),
        "triangle" => (2.0, PixelFilterKind::Triangle),
        "gaussian" => (1.5, PixelFilterKind::Gaussian { sigma: params.positive(cx, "sigma", 0.5) }),
        "mitchell" => {
            (2.0, PixelFilterKind::Mitchell { b: params.float(cx, "B", third), c: params.float(cx, "C", third) })
        }
        "sinc" => (4.0, PixelFilterKind::LanczosSinc { tau: params.positive(cx, "tau", 3.0) }),
        name => {
            let name = name.to_owned();
            cx.unknown_type("pixel filter", &name, params.span, &["box", "gaussian", "mitchell", "sinc", "triangle"]);
            params.ignore_all();
            (0.5, PixelFilterKind::Box)
        }
    };
    // A filter is sampled over its support: beyond this it would be a blur of the whole picture.
    let mut side =
        |name| params.float_where(cx, name, radius, "more than 0 and at most 100", |r| r > 0.0 && r <= 100.0);
    let radius = Vec2::new(side("xradius"), side("yradius"));
    params.finish(cx);
    PixelFilter { radius, kind }
}

/// Finds samples per pixel and seed. All samplers are drawn with our own sequence, so only their numbers count.
pub(super) fn sampler(cx: &mut Context, params: &mut Params) -> (u64, Option<u64>) {
    const MOST: u32 = i32::MAX as u32;
    let spp = match params.name.as_str() {
        "stratified" => {
            params.ignore(&["jitter"]);
            u64::from(params.int(cx, "xsamples", 4, 1..=MOST)) * u64::from(params.int(cx, "ysamples", 4, 1..=MOST))
        }
        "independent" => u64::from(params.int(cx, "pixelsamples", 4, 1..=MOST)),
        "halton" | "paddedsobol" | "pmj02bn" | "sobol" | "zsobol" => {
            params.ignore(&["randomization"]);
            u64::from(params.int(cx, "pixelsamples", 16, 1..=MOST))
        }
        name => {
            let known = ["halton", "independent", "paddedsobol", "pmj02bn", "sobol", "stratified", "zsobol"];
            let name = name.to_owned();
            cx.unknown_type("sampler", &name, params.span, &known);
            params.ignore_all();
            16
        }
    };
    let seed = params.opt_int(cx, "seed").map(|seed| u64::from(seed as u32));
    params.finish(cx);
    (spp, seed)
}

/// Integrators that pbrt has and we draw by path tracing; and what their pictures would show otherwise.
const OTHERS: [(&str, &[&str]); 9] = [
    ("ambientocclusion", &["cossample", "maxdistance"]),
    ("bdpt", &["visualizestrategies", "visualizeweights"]),
    ("function", &["function", "filename", "skipbad"]),
    ("lightpath", &[]),
    ("mlt", &["bootstrapsamples", "chains", "mutationsperpixel", "sigma", "largestepprobability"]),
    ("randomwalk", &[]),
    ("simplepath", &["samplelights", "samplebsdf"]),
    ("simplevolpath", &[]),
    ("sppm", &["photonsperiteration", "radius", "seed"]),
];

/// Builds the integrator.
pub(super) fn integrator(cx: &mut Context, params: &mut Params) -> Integrator {
    // Which of several ways to choose among lights: ours is its own.
    params.ignore(&["lightsampler", "lightsamplestrategy"]);
    if let Some((name, ignored)) = OTHERS.iter().find(|(name, _)| *name == params.name) {
        params.ignore(ignored);
        let text = format!("integrator \"{name}\" is not ours: the picture is drawn by path tracing");
        cx.report.warning("integrator", params.span, text);
    } else if params.name != "path" && params.name != "volpath" {
        let known: Vec<&str> = ["path", "volpath"].into_iter().chain(OTHERS.iter().map(|(name, _)| *name)).collect();
        let name = params.name.clone();
        cx.unknown_type("integrator", &name, params.span, &known);
        params.ignore_all();
    }
    let integrator = Integrator {
        max_depth: params.int(cx, "maxdepth", 5, 0..=i32::MAX as u32),
        regularize: params.bool(cx, "regularize", false),
    };
    params.finish(cx);
    integrator
}

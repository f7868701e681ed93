//! `Option "name" value`, and the directives before `WorldBegin` that describe how the picture is taken.

use super::camera;
use super::context::Context;
use super::film;
use super::params::Params;
use super::report::{did_you_mean, shown};
use super::sampling;
use super::syntax::Entity;
use crate::math::Transform;
use crate::scene::Span;
use crate::scene::description::{Camera, Film, Integrator, PixelFilter};
use crate::spectrum::RgbSpace;

/// How the picture is taken, as read so far. What is missing has pbrt's defaults.
#[derive(Default)]
pub(super) struct Options {
    camera: Option<(Params, Transform)>,
    film: Option<(Params, RgbSpace)>,
    filter: Option<Params>,
    sampler: Option<Params>,
    integrator: Option<Params>,
    seed: Option<u64>,
}

/// How the picture is taken.
pub(super) struct Picture {
    pub(super) camera: Camera,
    pub(super) film: Film,
    pub(super) filter: PixelFilter,
    pub(super) spp: u64,
    pub(super) seed: u64,
    pub(super) integrator: Integrator,
}

/// Options that change nothing that we draw: wavelengths are not sampled, and there is one way to render.
const WITHOUT_EFFECT: [&str; 5] =
    ["disablewavelengthjitter", "displacementedgescale", "pixelstats", "rendercoordsys", "wavefront"];

/// Options that we know and do not follow, with what happens instead.
const NOT_FOLLOWED: [(&str, &str); 5] = [
    ("disablepixeljitter", "pixels are filtered as always"),
    ("disabletexturefiltering", "textures are filtered as always"),
    ("forcediffuse", "materials are drawn as they are"),
    ("msereferenceimage", "compare pictures with the compare command"),
    ("msereferenceout", "compare pictures with the compare command"),
];

impl Options {
    /// `Option`.
    pub(super) fn set(&mut self, cx: &mut Context, name: &str, value: &str, span: Span) {
        // Spelled with a type in early versions, and with any capitals, dashes and underscores.
        let last = name.split_ascii_whitespace().next_back().unwrap_or_default();
        let name: String = last.chars().filter(|c| !matches!(c, '-' | '_')).collect::<String>().to_lowercase();
        if name == "seed" {
            match value.parse::<i32>() {
                Ok(seed) => self.seed = Some(u64::from(seed as u32)),
                Err(_) => {
                    let text = format!("the seed is a whole number of 32 bits, not {}", shown(value));
                    cx.report.error(span, text);
                }
            }
        } else if let Some((_, instead)) = NOT_FOLLOWED.iter().find(|(known, _)| *known == name) {
            if value != "false" {
                cx.report.warning(
                    format!("option {name}"),
                    span,
                    format!("option \"{name}\" is not followed: {instead}"),
                );
            }
        } else if !WITHOUT_EFFECT.contains(&name.as_str()) {
            let known = WITHOUT_EFFECT.into_iter().chain(NOT_FOLLOWED.iter().map(|(known, _)| *known)).chain(["seed"]);
            let hint = did_you_mean(&name, known);
            cx.report.error(span, format!("there is no option \"{}\"{hint}", shown(&name)));
        }
    }

    /// `Camera`.
    pub(super) fn set_camera(&mut self, cx: &mut Context, params: Params, world_from_camera: Transform) {
        told_twice(cx, self.camera.is_some(), "Camera", params.span);
        self.camera = Some((params, world_from_camera));
    }

    /// `Film`, in the colour space in force.
    pub(super) fn set_film(&mut self, cx: &mut Context, params: Params, space: RgbSpace) {
        told_twice(cx, self.film.is_some(), "Film", params.span);
        self.film = Some((params, space));
    }

    /// `PixelFilter`, `Sampler` and `Integrator`.
    pub(super) fn set_other(&mut self, cx: &mut Context, entity: Entity, params: Params) {
        let (slot, name) = match entity {
            Entity::PixelFilter => (&mut self.filter, "PixelFilter"),
            Entity::Sampler => (&mut self.sampler, "Sampler"),
            _ => (&mut self.integrator, "Integrator"),
        };
        told_twice(cx, slot.is_some(), name, params.span);
        *slot = Some(params);
    }

    /// Builds everything, or pbrt's defaults of what was not given.
    pub(super) fn build(self, cx: &mut Context) -> Picture {
        let none = |what, name| Params::none(what, name, Span::default());
        let (mut params, world_from_camera) =
            self.camera.unwrap_or_else(|| (none("camera", "perspective"), Transform::default()));
        let (camera, exposure_time) = camera::build(cx, &mut params, world_from_camera);
        let (mut params, space) = self.film.unwrap_or_else(|| (none("film", "rgb"), RgbSpace::Srgb));
        let film = film::build(cx, &mut params, space, exposure_time);
        let filter = sampling::filter(cx, &mut self.filter.unwrap_or_else(|| none("pixel filter", "gaussian")));
        let (spp, seed) = sampling::sampler(cx, &mut self.sampler.unwrap_or_else(|| none("sampler", "zsobol")));
        let integrator =
            sampling::integrator(cx, &mut self.integrator.unwrap_or_else(|| none("integrator", "volpath")));
        Picture { camera, film, filter, spp, seed: seed.or(self.seed).unwrap_or(0), integrator }
    }
}

fn told_twice(cx: &mut Context, twice: bool, name: &str, span: Span) {
    if twice {
        cx.report.warning(format!("twice {name}"), span, format!("{name} is given twice: the last one counts"));
    }
}

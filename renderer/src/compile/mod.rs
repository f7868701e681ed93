//! Description → world: the last place that may fail on input.

pub mod geometry;
pub mod names;
pub mod origin;

use crate::camera::{Camera, CameraError, Filter, rendered_pixels};
use crate::light::Lights;
use crate::material::Materials;
use crate::scene::{Diagnostic, Scene, Severity, SourceMap, Span};
use crate::texture::{TextureError, Textures};
use crate::world::{Bounds, Sensor, Techniques, World};

/// What keeps a description from becoming a world.
#[derive(Debug)]
pub enum CompileError {
    /// Everything that is wrong with the scene, and the warnings so far.
    Scene(Vec<Diagnostic>),
    /// Embree failed.
    Embree(embree::Error),
}

/// What a stage builds, with its warnings, or all that is wrong.
type StageResult<T> = Result<(T, Vec<(Span, String)>), Vec<(Span, String)>>;

/// Messages with their places, collected over all stages so that a user sees every error at once.
struct Report<'a> {
    sources: &'a SourceMap,
    diagnostics: Vec<Diagnostic>,
}

impl Report<'_> {
    fn failed(&self) -> bool {
        self.diagnostics.iter().any(|diagnostic| diagnostic.severity == Severity::Error)
    }

    fn errors(&mut self, messages: impl IntoIterator<Item = (Span, String)>) {
        self.diagnostics.extend(messages.into_iter().map(|(span, message)| self.sources.error(span, message)));
    }

    fn warnings(&mut self, messages: impl IntoIterator<Item = (Span, String)>) {
        self.diagnostics.extend(messages.into_iter().map(|(span, message)| self.sources.warning(span, message)));
    }

    /// The camera or filter, or `None` with its error noted; `otherwise` is the place of an error that names none.
    fn camera<T>(&mut self, result: Result<T, CameraError>, otherwise: Span) -> Option<T> {
        result.map_err(|error| self.errors([(error.span.unwrap_or(otherwise), error.message)])).ok()
    }

    /// The stage's result, or `None` with its errors noted.
    fn keep<T>(&mut self, result: StageResult<T>) -> Option<T> {
        match result {
            Ok((value, warnings)) => {
                self.warnings(warnings);
                Some(value)
            }
            Err(errors) => {
                self.errors(errors);
                None
            }
        }
    }
}

/// Builds the world of a description, and says what in it will not look as described.
///
/// # Errors
/// All that is wrong with the description, not the first of it.
pub fn world(
    scene: &Scene,
    device: &embree::Device,
    techniques: Techniques,
) -> Result<(World, Vec<Diagnostic>), CompileError> {
    let mut report = Report { sources: &scene.sources, diagnostics: Vec::new() };
    let sensor = sensor(scene, &mut report);
    let camera = report.camera(Camera::build(&scene.camera, scene.film.resolution), scene.camera.span);
    let filter = report.camera(Filter::build(&scene.filter), scene.film.span);
    let textures = report.keep(textures(scene));
    let geometry = report.keep(
        geometry::build(scene, device, textures.as_ref(), &geometry::Options::default())
            .map_err(CompileError::Embree)?,
    );
    let materials = textures.as_ref().and_then(|textures| report.keep(Materials::build(&scene.materials, textures)));
    let (geometry, emitters) = geometry.unzip();
    report.errors(geometry.as_ref().and_then(|geometry| too_small(scene, geometry)));
    let lights = geometry.as_ref().zip(emitters).and_then(|(geometry, emitters)| {
        report.keep(Lights::build(&scene.lights, &scene.area_lights, emitters, geometry.bounds()))
    });
    if lights.as_ref().is_some_and(Lights::is_empty) {
        let message = "there is no light in the scene: the picture is black".to_owned();
        report.diagnostics.push(Diagnostic { severity: Severity::Warning, message, place: None });
    }
    match (sensor, camera, filter, textures, geometry, materials, lights) {
        (Some(sensor), Some(camera), Some(filter), Some(textures), Some(geometry), Some(materials), Some(lights))
            if !report.failed() =>
        {
            let integrator = scene.integrator;
            let lights = if techniques == Techniques::Both { lights.beside_bsdf_samples() } else { lights };
            let origin = scene.origin;
            let world =
                World { origin, camera, filter, sensor, geometry, textures, materials, lights, integrator, techniques };
            Ok((world, report.diagnostics))
        }
        _ => {
            debug_assert!(report.failed());
            Err(CompileError::Scene(report.diagnostics))
        }
    }
}

/// A ray query multiplies three lengths of a scene. Their product has all its 24 digits down to 2⁻¹²⁶⁺²⁴, so lengths must not
/// be below the third root of that: triangles would vanish.
const SMALLEST: f32 = 1.0 / (1u64 << 34) as f32;

/// What to say of a scene of which every length is too small.
fn too_small(scene: &Scene, geometry: &geometry::Geometry) -> Option<(Span, String)> {
    let (low, high) = geometry.bounds();
    let size = (high - low).max_element();
    let text =
        || format!("the whole scene is {size:e} across, below the {SMALLEST:e} that rays can resolve: scale it up");
    (size > 0.0 && size < SMALLEST)
        .then(|| (scene.shapes.first().map_or(scene.camera.span, |shape| shape.span), text()))
}

fn textures(scene: &Scene) -> StageResult<Textures> {
    let messages = |errors: Vec<TextureError>| errors.into_iter().map(|e| (e.span, e.message)).collect();
    Textures::build(&scene.textures).map(|(textures, warnings)| (textures, messages(warnings))).map_err(messages)
}

fn sensor(scene: &Scene, report: &mut Report<'_>) -> Option<Sensor> {
    let film = &scene.film;
    let Some([min, max]) = rendered_pixels(film.resolution, film.overscan, film.crop_window, film.pixel_bounds) else {
        report.errors([(film.span, "the crop window or pixel bounds leave no pixel of the frame to render".into())]);
        return None;
    };
    Some(Sensor {
        resolution: film.resolution,
        overscan: film.overscan,
        bounds: Bounds { min, max },
        response: film.sensor,
        max_component: film.max_component_value,
    })
}

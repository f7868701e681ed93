//! The camera: `Camera "type"`.

use super::context::Context;
use super::params::Params;
use crate::math::Transform;
use crate::scene::description::{Camera, CameraKind};

const TYPES: [&str; 4] = ["perspective", "orthographic", "spherical", "realistic"];

/// The field of view drawn for a camera with lenses: that of 50 mm on the short side, 24 mm, of full-frame film.
const REALISTIC_FOV: f32 = 26.99;

/// Builds the camera and finds for how long its shutter is open.
pub(super) fn build(cx: &mut Context, params: &mut Params, world_from_camera: Transform) -> (Camera, f32) {
    let open = params.float(cx, "shutteropen", 0.0);
    let close = params.float(cx, "shutterclose", 1.0);
    let mut exposure_time = close - open;
    if exposure_time <= 0.0 {
        cx.report
            .error(params.span, format!("the shutter opens at {open} and closes at {close}: nothing would be seen"));
        exposure_time = 1.0;
    }
    let mut camera = Camera {
        world_from_camera,
        kind: CameraKind::Orthographic,
        lens_radius: params.float_where(cx, "lensradius", 0.0, "at least 0", |radius| radius >= 0.0),
        focal_distance: params.positive(cx, "focaldistance", 1e6),
        screen_window: params.float4(cx, "screenwindow"),
        frame_aspect_ratio: params.has("frameaspectratio").then(|| params.positive(cx, "frameaspectratio", 1.0)),
        span: params.span,
    };
    if camera.screen_window.is_some_and(|[x0, x1, y0, y1]| x0 == x1 || y0 == y1) {
        cx.report.error(params.span_of("screenwindow"), "\"screenwindow\" is empty: give x0 x1 y0 y1");
    }
    camera.kind = match params.name.as_str() {
        "perspective" => {
            let valid = |fov| fov > 0.0 && fov < 180.0;
            CameraKind::Perspective { fov: params.float_where(cx, "fov", 90.0, "between 0 and 180", valid) }
        }
        "orthographic" => CameraKind::Orthographic,
        "spherical" => {
            let choices = [("equalarea", true), ("equirectangular", false)];
            CameraKind::Spherical { equal_area: params.choice(cx, "mapping", &choices) }
        }
        "realistic" => {
            params.ignore(&["lensfile", "aperturediameter", "focusdistance", "aperture"]);
            let text = "a camera with lenses is not rendered: a pinhole with the view of a 50 mm lens is drawn instead";
            cx.report.warning("realistic camera", params.span, text);
            CameraKind::Perspective { fov: REALISTIC_FOV }
        }
        name => {
            let name = name.to_owned();
            cx.unknown_type("camera", &name, params.span, &TYPES);
            params.ignore_all();
            CameraKind::Perspective { fov: 90.0 }
        }
    };
    params.finish(cx);
    (camera, exposure_time)
}

//! The film and its sensor: `Film "type"`.

use std::path::PathBuf;

use glam::Mat3;

use super::context::Context;
use super::params::Params;
use crate::scene::description::Film;
use crate::spectrum::RgbSpace;

const TYPES: [&str; 3] = ["rgb", "gbuffer", "spectral"];

/// Sides beyond this are a slip.
const LARGEST_SIDE: u32 = 1 << 20;

/// Builds the film. `exposure_time` is how long the camera's shutter is open, in seconds.
pub(super) fn build(cx: &mut Context, params: &mut Params, space: RgbSpace, exposure_time: f32) -> Film {
    let gbuffer = params.name == "gbuffer";
    match params.name.as_str() {
        "rgb" => {}
        // Whether positions and normals are in camera or world space: ours are in world space.
        "gbuffer" => {
            let in_world = params.choice(cx, "coordinatesystem", &[("camera", false), ("world", true)]);
            if !in_world {
                let text = "the auxiliary channels of the picture are in world space, not in the camera's";
                cx.report.warning("gbuffer space", params.span, text);
            }
        }
        "spectral" => {
            params.ignore(&["lambdamin", "lambdamax", "nbuckets"]);
            cx.report.warning("spectral film", params.span, "spectra are not recorded: the picture is written as RGB");
        }
        name => {
            let name = name.to_owned();
            cx.unknown_type("film", &name, params.span, &TYPES);
            params.ignore_all();
        }
    }
    if space != RgbSpace::Srgb {
        let text = "the picture is written in linear Rec.709 RGB, not in the file's colour space";
        cx.report.warning("film colour space", params.span, text);
    }
    // Size of the film behind lenses; how EXR pixels are stored, which is the renderer's option.
    params.ignore(&["diagonal", "savefp16"]);
    let film = Film {
        resolution: [
            params.int(cx, "xresolution", 1280, 1..=LARGEST_SIDE),
            params.int(cx, "yresolution", 720, 1..=LARGEST_SIDE),
        ],
        overscan: 0,
        crop_window: crop_window(cx, params),
        pixel_bounds: pixel_bounds(cx, params),
        filename: params.string(cx, "filename").filter(|name| !name.is_empty()).map(PathBuf::from),
        gbuffer,
        sensor: sensor(cx, params, exposure_time),
        max_component_value: params.positive(cx, "maxcomponentvalue", f32::INFINITY),
        span: params.span,
    };
    params.finish(cx);
    film
}

fn crop_window(cx: &mut Context, params: &mut Params) -> Option<[f32; 4]> {
    let [x0, x1, y0, y1] = params.float4(cx, "cropwindow")?.map(|edge| edge.clamp(0.0, 1.0));
    let window = [x0.min(x1), x0.max(x1), y0.min(y1), y0.max(y1)];
    if window[0] == window[1] || window[2] == window[3] {
        cx.report.error(params.span_of("cropwindow"), "\"cropwindow\" is empty: give x0 x1 y0 y1 from 0 to 1");
        return None;
    }
    Some(window)
}

fn pixel_bounds(cx: &mut Context, params: &mut Params) -> Option<[i32; 4]> {
    let values = params.ints(cx, "pixelbounds")?;
    let span = params.span_of("pixelbounds");
    let Ok([x0, x1, y0, y1]) = <[i32; 4]>::try_from(values) else {
        cx.report.error(span, "\"pixelbounds\" takes 4 values: x0 x1 y0 y1");
        return None;
    };
    if x0 >= x1 || y0 >= y1 {
        cx.report.error(span, "\"pixelbounds\" is empty: give x0 x1 y0 y1, upper ends exclusive");
        return None;
    }
    if params.has("cropwindow") {
        let text = "\"cropwindow\" and \"pixelbounds\" are both given: the crop window counts";
        cx.report.warning("crop and bounds", span, text);
        return None;
    }
    Some([x0, x1, y0, y1])
}

/// Exposure and white balance.
///
/// **Source**: \[Pharr23\] section 5.4.2; the imaging ratio is exposure time × ISO / 100.
fn sensor(cx: &mut Context, params: &mut Params, exposure_time: f32) -> Mat3 {
    let iso = params.positive(cx, "iso", 100.0);
    // A parameter of early versions, which have no shutter times in its place.
    let exposure_time =
        if params.has("exposuretime") { params.positive(cx, "exposuretime", 1.0) } else { exposure_time };
    let white = params.float_where(cx, "whitebalance", 0.0, "0 or from 1000 to 40000 K", |kelvin| {
        kelvin == 0.0 || (1000.0..=40000.0).contains(&kelvin)
    });
    let name = params.string(cx, "sensor").unwrap_or_else(|| "cie1931".to_owned());
    let mut balance = if white > 0.0 { RgbSpace::Srgb.film_from_rec709(Some(white)) } else { Mat3::IDENTITY };
    if name != "cie1931" {
        let text = format!("the response of the sensor \"{name}\" is not simulated: the CIE 1931 observer is used");
        cx.report.warning("sensor", params.span_of("sensor"), text);
        if white == 0.0 {
            // What pbrt assumes for real sensors.
            balance = RgbSpace::Srgb.film_from_rec709(Some(6500.0));
        }
    }
    let imaging_ratio = (f64::from(exposure_time) * f64::from(iso) / 100.0) as f32;
    if !imaging_ratio.is_finite() {
        let text = format!("an exposure of {exposure_time:e} s at ISO {iso:e} is beyond all numbers: lower either");
        cx.report.error(params.span, text);
    }
    balance * imaging_ratio
}

//! Participating media: `MakeNamedMedium "name" "string type" "type"`. Understood, not yet rendered.

use super::context::Context;
use super::params::Params;
use super::spectra::Usage;
use crate::scene::description::Medium;

const TYPES: [&str; 5] = ["homogeneous", "uniformgrid", "rgbgrid", "cloud", "nanovdb"];

/// Reads a medium. `None` after an error.
pub(super) fn build(cx: &mut Context, params: &mut Params) -> Option<Medium> {
    let text = "participating media are not rendered: the space is drawn empty";
    cx.report.warning("media", params.span, text);
    let (name, span) = (params.name.clone(), params.span);
    let Some(kind) = params.string(cx, "type") else {
        if !params.has("type") {
            cx.report.error(span, "a medium needs \"string type\"");
        }
        params.ignore_all();
        return None;
    };
    if !TYPES.contains(&kind.as_str()) {
        cx.unknown_type("medium of type", &kind, span, &TYPES);
        params.ignore_all();
        return None;
    }
    parameters(cx, params, &kind);
    params.name.clone_from(&kind);
    params.finish(cx);
    Some(Medium { name, kind, span })
}

/// Asks for all that a medium may have, so that what is wrong with them is known now.
fn parameters(cx: &mut Context, params: &mut Params, kind: &str) {
    params.float_where(cx, "g", 0.0, "between -1 and 1", |g| g > -1.0 && g < 1.0);
    params.opt_float(cx, "scale");
    if kind == "homogeneous" {
        params.string(cx, "preset");
    }
    if kind != "rgbgrid" {
        params.opt_rgb(cx, "sigma_a", Usage::Unbounded);
        params.opt_rgb(cx, "sigma_s", Usage::Unbounded);
    }
    if kind == "homogeneous" || kind == "uniformgrid" {
        params.opt_rgb(cx, "Le", Usage::Illuminant);
    }
    match kind {
        "homogeneous" => params.ignore(&["Lescale"]),
        "uniformgrid" => {
            params.ignore(&["nx", "ny", "nz", "density", "temperature", "Lescale", "p0", "p1"]);
            params.ignore(&["temperatureoffset", "temperaturecutoff", "temperaturescale"]);
        }
        "rgbgrid" => params.ignore(&["nx", "ny", "nz", "sigma_a", "sigma_s", "Le", "Lescale", "p0", "p1"]),
        "cloud" => params.ignore(&["density", "wispiness", "frequency", "p0", "p1"]),
        _ => {
            params.path(cx, "filename");
            params.ignore(&["Lescale", "temperatureoffset", "temperaturecutoff", "temperaturescale"]);
        }
    }
}

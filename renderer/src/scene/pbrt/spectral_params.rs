//! Parameters that are spectra or textures.

use super::context::Context;
use super::param::{ParamType, Values};
use super::params::Params;
use super::spectra::{self, Usage};
use crate::math::Rgb;
use crate::scene::description::{TextureId, Value};
use crate::spectrum::{RgbSpace, Spectrum};

/// What a spectrum can be given as; the first is a texture.
const SPECTRAL: [ParamType; 4] = [ParamType::Texture, ParamType::Rgb, ParamType::Spectrum, ParamType::Blackbody];

/// A spectrum as given: its numbers are still in the file's colour space.
enum Given {
    Spectrum(Spectrum),
    Texture(String),
}

impl Params {
    /// A number or a texture of numbers.
    pub(super) fn opt_float_texture(&mut self, cx: &mut Context, name: &'static str) -> Option<Value<f32>> {
        let param = self.find(cx, name, &[ParamType::Float, ParamType::Texture])?;
        match &param.values {
            Values::Strings(names) => {
                let (first, count, span) = (names.first().cloned()?, names.len(), param.span);
                self.only_one(cx, name, count);
                cx.float_texture(&first, span).map(Value::Texture)
            }
            Values::Floats(values) => {
                let (first, count) = (*values.first()?, values.len());
                self.only_one(cx, name, count);
                Some(Value::Constant(first))
            }
            _ => None,
        }
    }

    /// A number or a texture of numbers, or the default.
    pub(super) fn float_texture(&mut self, cx: &mut Context, name: &'static str, default: f32) -> Value<f32> {
        self.opt_float_texture(cx, name).unwrap_or(Value::Constant(default))
    }

    /// A texture of numbers and nothing else.
    pub(super) fn only_float_texture(&mut self, cx: &mut Context, name: &'static str) -> Option<TextureId> {
        let param = self.find(cx, name, &[ParamType::Texture])?;
        let Values::Strings(names) = &param.values else { return None };
        let (first, span) = (names.first().cloned()?, param.span);
        cx.float_texture(&first, span)
    }

    /// A spectrum as linear Rec.709 RGB.
    pub(super) fn opt_rgb(&mut self, cx: &mut Context, name: &'static str, usage: Usage) -> Option<Rgb> {
        match self.given(cx, name, usage, &SPECTRAL[1..])? {
            Given::Spectrum(spectrum) => Some(self.checked(cx, name, usage, &spectrum)),
            Given::Texture(_) => None,
        }
    }

    /// A spectrum as linear Rec.709 RGB, or a texture.
    pub(super) fn opt_rgb_texture(&mut self, cx: &mut Context, name: &'static str, usage: Usage) -> Option<Value<Rgb>> {
        match self.given(cx, name, usage, &SPECTRAL)? {
            Given::Spectrum(spectrum) => Some(Value::Constant(self.checked(cx, name, usage, &spectrum))),
            Given::Texture(texture) => cx.spectrum_texture(&texture, self.span_of(name)).map(Value::Texture),
        }
    }

    /// A spectrum as linear Rec.709 RGB, or a texture, or the same value in all channels.
    pub(super) fn rgb_texture(
        &mut self,
        cx: &mut Context,
        name: &'static str,
        usage: Usage,
        default: f32,
    ) -> Value<Rgb> {
        self.opt_rgb_texture(cx, name, usage).unwrap_or(Value::Constant(Rgb::splat(default)))
    }

    /// A spectrum as it stands, or a texture.
    pub(super) fn opt_spectrum_texture(&mut self, cx: &mut Context, name: &'static str) -> Option<Value<Spectrum>> {
        match self.given(cx, name, Usage::Unbounded, &SPECTRAL)? {
            Given::Spectrum(spectrum) => Some(Value::Constant(spectrum)),
            Given::Texture(texture) => cx.spectrum_texture(&texture, self.span_of(name)).map(Value::Texture),
        }
    }

    /// A refractive index: a number, or a spectrum, of which the value at the d line counts.
    pub(super) fn eta(&mut self, cx: &mut Context, name: &'static str, default: f32) -> f32 {
        let is_float = self.list.iter().any(|p| &*p.name == name && p.kind == ParamType::Float);
        let eta = if is_float {
            self.float(cx, name, default)
        } else {
            let kinds = [ParamType::Float, ParamType::Rgb, ParamType::Spectrum, ParamType::Blackbody];
            match self.given(cx, name, Usage::Unbounded, &kinds) {
                Some(Given::Spectrum(spectrum)) => {
                    if spectra::varies(&spectrum) {
                        let text =
                            "dispersion is not rendered: the refractive index at 587.6 nm is used for all colours";
                        cx.report.warning("dispersion", self.span_of(name), text);
                    }
                    spectrum.refractive_index()
                }
                _ => default,
            }
        };
        // Squares, and products of squares, are formed of it.
        const RANGE: std::ops::RangeInclusive<f32> = 1e-6..=1e6;
        if RANGE.contains(&eta) {
            return eta;
        }
        if eta > 0.0 {
            let text = format!("\"{name}\" is {eta:e}: no medium is like that; give from 1e-6 to 1e6");
            cx.report.error(self.span_of(name), text);
            return default;
        }
        cx.report.error(self.span_of(name), format!("\"{name}\" must be more than 0, not {eta}"));
        default
    }

    /// The spectrum or texture that `name` gives, read and converted to Rec.709 but not judged.
    fn given(&mut self, cx: &mut Context, name: &'static str, usage: Usage, kinds: &[ParamType]) -> Option<Given> {
        let param = self.find(cx, name, kinds)?;
        let (span, color_space, kind) = (param.span, param.color_space, param.kind);
        match &param.values {
            Values::Strings(names) => {
                let (first, count) = (names.first().cloned()?, names.len());
                self.only_one(cx, name, count);
                if kind == ParamType::Texture {
                    return Some(Given::Texture(first));
                }
                cx.named_spectrum(&first, span).map(Given::Spectrum)
            }
            Values::Floats(values) => {
                let values = values.clone();
                self.only_one(cx, name, if kind == ParamType::Spectrum { 1 } else { values.len() / kind.size() });
                match kind {
                    ParamType::Rgb => Some(Given::Spectrum(Spectrum::Rgb(spectra::to_rec709(
                        color_space,
                        Rgb::from_slice(&values),
                        usage,
                    )))),
                    ParamType::Blackbody if values[0] > 0.0 => Some(Given::Spectrum(Spectrum::Blackbody(values[0]))),
                    ParamType::Blackbody => {
                        cx.report.error(span, format!("a temperature must be more than 0 K, not {}", values[0]));
                        None
                    }
                    _ => match spectra::sampled(&values) {
                        Ok(spectrum) => Some(Given::Spectrum(spectrum)),
                        Err(why) => {
                            cx.report.error(span, format!("\"{name}\": {why}"));
                            None
                        }
                    },
                }
            }
            _ => None,
        }
    }

    /// The spectrum as RGB, and whether it can be what it is used for.
    fn checked(&self, cx: &mut Context, name: &str, usage: Usage, spectrum: &Spectrum) -> Rgb {
        let rgb = spectra::rgb(spectrum, usage);
        let given_rgb = matches!(spectrum, Spectrum::Rgb(_));
        let mut kept = rgb;
        if !rgb.is_finite() || (given_rgb && rgb.min_element() < 0.0) {
            // A colour of a wider space may lie outside Rec.709: that is the conversion's, not the file's.
            let own = self.list.iter().find(|p| &*p.name == name).is_none_or(|p| p.color_space == RgbSpace::Srgb);
            if own || !rgb.is_finite() {
                cx.report.error(self.span_of(name), format!("\"{name}\" must not be negative"));
            } else {
                let text = "some colours lie outside Rec.709 and are brought to its border";
                cx.report.warning("outside Rec.709", self.span_of(name), text);
            }
            kept = rgb.max(Rgb::ZERO);
        }
        if usage == Usage::Albedo && kept.max_element() > 1.0 {
            if given_rgb {
                let text = format!("\"{name}\" is a reflectance of more than 1: brought down to 1");
                cx.report.warning("albedo above 1", self.span_of(name), text);
            }
            kept = kept.min(Rgb::ONE);
        }
        if kept.is_finite() { kept } else { Rgb::ZERO }
    }
}

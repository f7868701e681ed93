//! The parameters of a directive, asked for by name and type.
//!
//! Whoever builds something asks for every parameter it knows and then calls [`Params::finish`], which tells what
//! nobody asked for. So the list of known names is the code that reads them, and cannot go stale.

use std::path::PathBuf;

use glam::{Vec2, Vec3};

use super::context::Context;
use super::param::{Param, ParamType, Values};
use super::report::{did_you_mean, shown};
use super::spectra::{self, Usage};
use crate::math::Rgb;
use crate::scene::Span;
use crate::scene::description::{TextureId, Value};
use crate::spectrum::{RgbSpace, Spectrum};

/// Parameters of one directive.
#[derive(Clone, Debug)]
pub(super) struct Params {
    /// `shape`, `material`, ... for messages.
    what: &'static str,
    /// `sphere`, `diffuse`, ...
    pub(super) name: String,
    /// Of the directive and its name.
    pub(super) span: Span,
    list: Vec<Param>,
    asked: Vec<&'static str>,
}

/// A spectrum as given: its numbers are still in the file's colour space.
enum Given {
    Spectrum(Spectrum),
    Texture(String),
}

impl Params {
    /// `inherited` come from `Attribute` and count only where `own` does not have the name.
    pub(super) fn new(what: &'static str, name: String, span: Span, own: Vec<Param>, inherited: &[Param]) -> Self {
        let mut list = own;
        for param in inherited {
            if !list.iter().any(|p| p.name == param.name) {
                list.push(param.clone());
            }
        }
        Self { what, name, span, list, asked: Vec::new() }
    }

    /// None at all.
    pub(super) fn none(what: &'static str, name: &str, span: Span) -> Self {
        Self::new(what, name.to_owned(), span, Vec::new(), &[])
    }

    /// The parameter `name`, if it has one of the types `kinds`; another type is an error.
    fn find(&mut self, cx: &mut Context, name: &'static str, kinds: &[ParamType]) -> Option<&mut Param> {
        self.asked.push(name);
        let param = self.list.iter_mut().find(|p| &*p.name == name)?;
        let first = !std::mem::replace(&mut param.used, true);
        if kinds.contains(&param.kind) {
            return Some(param);
        }
        if first && !param.inherited {
            let expected: Vec<_> = kinds.iter().map(|kind| kind.name()).collect();
            let text = format!("\"{name}\" is of type {}, not {}", expected.join(" or "), param.kind.name());
            cx.report.error(param.span, text);
        }
        None
    }

    /// Where `name` was given, or the directive.
    pub(super) fn span_of(&self, name: &str) -> Span {
        self.list.iter().find(|p| &*p.name == name).map_or(self.span, |p| p.span)
    }

    /// Whether `name` was given, in whatever type.
    pub(super) fn has(&self, name: &str) -> bool {
        self.list.iter().any(|p| &*p.name == name)
    }

    /// Names that are known and have no effect on our picture.
    pub(super) fn ignore(&mut self, names: &[&'static str]) {
        for &name in names {
            self.asked.push(name);
            if let Some(param) = self.list.iter_mut().find(|p| &*p.name == name) {
                param.used = true;
            }
        }
    }

    /// Says nothing about any parameter: whose they are could not be found out.
    pub(super) fn ignore_all(&mut self) {
        self.list.iter_mut().for_each(|param| param.used = true);
    }

    fn floats_of(&mut self, cx: &mut Context, name: &'static str, kind: ParamType) -> Option<Vec<f32>> {
        match &mut self.find(cx, name, &[kind])?.values {
            Values::Floats(values) => Some(std::mem::take(values)),
            _ => None,
        }
    }

    /// Reports a list where one value belongs.
    fn only_one(&self, cx: &mut Context, name: &str, values: usize) {
        if values > 1 {
            cx.report.error(self.span_of(name), format!("\"{name}\" takes one value, not {values}"));
        }
    }

    /// A number.
    pub(super) fn opt_float(&mut self, cx: &mut Context, name: &'static str) -> Option<f32> {
        let values = self.floats_of(cx, name, ParamType::Float)?;
        self.only_one(cx, name, values.len());
        values.first().copied()
    }

    /// A number, or the default.
    pub(super) fn float(&mut self, cx: &mut Context, name: &'static str, default: f32) -> f32 {
        self.opt_float(cx, name).unwrap_or(default)
    }

    /// A number for which `valid` holds; else an error that says what it `must` be, and the default.
    pub(super) fn float_where(
        &mut self,
        cx: &mut Context,
        name: &'static str,
        default: f32,
        must: &str,
        valid: impl Fn(f32) -> bool,
    ) -> f32 {
        match self.opt_float(cx, name) {
            Some(value) if !valid(value) => {
                cx.report.error(self.span_of(name), format!("\"{name}\" must be {must}, not {value}"));
                default
            }
            value => value.unwrap_or(default),
        }
    }

    /// A positive number.
    pub(super) fn positive(&mut self, cx: &mut Context, name: &'static str, default: f32) -> f32 {
        self.float_where(cx, name, default, "more than 0", |value| value > 0.0)
    }

    /// Numbers.
    pub(super) fn floats(&mut self, cx: &mut Context, name: &'static str) -> Option<Vec<f32>> {
        self.floats_of(cx, name, ParamType::Float)
    }

    /// Four numbers.
    pub(super) fn float4(&mut self, cx: &mut Context, name: &'static str) -> Option<[f32; 4]> {
        let values = self.floats(cx, name)?;
        let count = values.len();
        let four = values.try_into().ok();
        if four.is_none() {
            cx.report.error(self.span_of(name), format!("\"{name}\" takes 4 values, not {count}"));
        }
        four
    }

    /// A whole number.
    pub(super) fn opt_int(&mut self, cx: &mut Context, name: &'static str) -> Option<i32> {
        let values = self.ints(cx, name)?;
        self.only_one(cx, name, values.len());
        values.first().copied()
    }

    /// A whole number within `range`, or the default.
    pub(super) fn int(
        &mut self,
        cx: &mut Context,
        name: &'static str,
        default: u32,
        range: std::ops::RangeInclusive<u32>,
    ) -> u32 {
        let Some(value) = self.opt_int(cx, name) else { return default };
        match u32::try_from(value).ok().filter(|value| range.contains(value)) {
            Some(value) => value,
            None => {
                let text = format!("\"{name}\" must be from {} to {}, not {value}", range.start(), range.end());
                cx.report.error(self.span_of(name), text);
                default
            }
        }
    }

    /// Whole numbers.
    pub(super) fn ints(&mut self, cx: &mut Context, name: &'static str) -> Option<Vec<i32>> {
        match &mut self.find(cx, name, &[ParamType::Integer])?.values {
            Values::Integers(values) => Some(std::mem::take(values)),
            _ => None,
        }
    }

    /// A truth value, or the default.
    pub(super) fn bool(&mut self, cx: &mut Context, name: &'static str, default: bool) -> bool {
        let values = match self.find(cx, name, &[ParamType::Bool]) {
            Some(Param { values: Values::Bools(values), .. }) => std::mem::take(values),
            _ => return default,
        };
        self.only_one(cx, name, values.len());
        values.first().copied().unwrap_or(default)
    }

    /// Strings.
    pub(super) fn strings(&mut self, cx: &mut Context, name: &'static str) -> Option<Vec<String>> {
        match &self.find(cx, name, &[ParamType::String])?.values {
            Values::Strings(values) => Some(values.clone()),
            _ => None,
        }
    }

    /// A string.
    pub(super) fn string(&mut self, cx: &mut Context, name: &'static str) -> Option<String> {
        let values = self.strings(cx, name)?;
        self.only_one(cx, name, values.len());
        values.into_iter().next()
    }

    /// One of the words of `choices`, and the first of them where none is given.
    pub(super) fn choice<T: Copy>(&mut self, cx: &mut Context, name: &'static str, choices: &[(&'static str, T)]) -> T {
        let default = choices[0].1;
        let Some(word) = self.string(cx, name) else { return default };
        match choices.iter().find(|(known, _)| known.eq_ignore_ascii_case(&word)) {
            Some(&(_, value)) => value,
            None => {
                let known: Vec<_> = choices.iter().map(|&(known, _)| format!("\"{known}\"")).collect();
                let hint = did_you_mean(&word, choices.iter().map(|&(known, _)| known));
                let text = format!("\"{name}\" is one of {}, not \"{}\"{hint}", known.join(", "), shown(&word));
                cx.report.error(self.span_of(name), text);
                default
            }
        }
    }

    /// A file that must exist, by its resolved path. An empty name is none.
    pub(super) fn path(&mut self, cx: &mut Context, name: &'static str) -> Option<PathBuf> {
        let text = self.string(cx, name).filter(|text| !text.is_empty())?;
        let span = self.span_of(name);
        let path = cx.files.resolve(&text, span.file);
        if !path.is_file() {
            cx.report.error(span, format!("there is no file {}", path.display()));
        }
        Some(path)
    }

    /// Points.
    pub(super) fn point3s(&mut self, cx: &mut Context, name: &'static str) -> Vec<Vec3> {
        triples(self.floats_of(cx, name, ParamType::Point3))
    }

    /// Points in the plane. `uv` was a list of plain floats once.
    pub(super) fn point2s(&mut self, cx: &mut Context, name: &'static str) -> Vec<Vec2> {
        let values = self.floats_of(cx, name, ParamType::Point2).unwrap_or_default();
        values.chunks_exact(2).map(Vec2::from_slice).collect()
    }

    /// Normals.
    pub(super) fn normals(&mut self, cx: &mut Context, name: &'static str) -> Vec<Vec3> {
        triples(self.floats_of(cx, name, ParamType::Normal))
    }

    /// Vectors.
    pub(super) fn vector3s(&mut self, cx: &mut Context, name: &'static str) -> Vec<Vec3> {
        triples(self.floats_of(cx, name, ParamType::Vector3))
    }

    /// A point, or the default.
    pub(super) fn point3(&mut self, cx: &mut Context, name: &'static str, default: Vec3) -> Vec3 {
        let points = self.point3s(cx, name);
        self.only_one(cx, name, points.len());
        points.first().copied().unwrap_or(default)
    }

    /// A vector that is not zero, or the default.
    pub(super) fn direction(&mut self, cx: &mut Context, name: &'static str, default: Vec3) -> Vec3 {
        let vectors = self.vector3s(cx, name);
        self.only_one(cx, name, vectors.len());
        let vector = vectors.first().copied().unwrap_or(default);
        if vector.try_normalize().is_none() {
            cx.report.error(self.span_of(name), format!("\"{name}\" has no length, so it is no direction"));
            return default;
        }
        vector
    }

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
        if eta.is_finite() && eta > 0.0 {
            return eta;
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

    /// Tells about every parameter that nobody asked for.
    pub(super) fn finish(&mut self, cx: &mut Context) {
        for param in self.list.iter().filter(|p| !p.used && !p.inherited) {
            let hint = did_you_mean(&param.name, self.asked.iter().copied());
            let name = shown(&param.name);
            let cause = format!("unknown {} {} {name}", self.what, self.name);
            let text = format!("{} \"{}\" has no parameter \"{name}\"{hint}: ignored", self.what, self.name);
            cx.report.warning(cause, param.span, text);
        }
    }
}

/// What a spectrum can be given as; the first is a texture.
const SPECTRAL: [ParamType; 4] = [ParamType::Texture, ParamType::Rgb, ParamType::Spectrum, ParamType::Blackbody];

fn triples(values: Option<Vec<f32>>) -> Vec<Vec3> {
    values.unwrap_or_default().chunks_exact(3).map(Vec3::from_slice).collect()
}

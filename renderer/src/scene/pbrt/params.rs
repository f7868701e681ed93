//! The parameters of a directive, asked for by name and type.
//!
//! Whoever builds something asks for every parameter it knows and then calls [`Params::finish`], which tells what
//! nobody asked for. So the list of known names is the code that reads them, and cannot go stale.

use std::path::PathBuf;

use glam::{Vec2, Vec3};

use super::context::Context;
use super::param::{Param, ParamType, Values};
use super::report::{did_you_mean, shown};
use crate::scene::Span;

/// Parameters of one directive.
#[derive(Clone, Debug)]
pub(super) struct Params {
    /// `shape`, `material`, ... for messages.
    what: &'static str,
    /// `sphere`, `diffuse`, ...
    pub(super) name: String,
    /// Of the directive and its name.
    pub(super) span: Span,
    pub(super) list: Vec<Param>,
    asked: Vec<&'static str>,
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
    pub(super) fn find(&mut self, cx: &mut Context, name: &'static str, kinds: &[ParamType]) -> Option<&mut Param> {
        self.asked.push(name);
        let param = self.list.iter_mut().find(|p| &*p.name == name)?;
        let first = !std::mem::replace(&mut param.used, true);
        if param.values == Values::Faulty {
            return None;
        }
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
    pub(super) fn only_one(&self, cx: &mut Context, name: &str, values: usize) {
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

    /// The file `filename`, without which there is nothing.
    pub(super) fn needed_path(&mut self, cx: &mut Context) -> Option<PathBuf> {
        let given = self.has("filename");
        let path = self.path(cx, "filename");
        if path.is_none() && !given {
            cx.report.error(self.span, format!("{} \"{}\" needs \"string filename\"", self.what, self.name));
        } else if path.is_none() && self.string(cx, "filename").is_some() {
            cx.report.error(self.span_of("filename"), "\"filename\" is empty");
        }
        path
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

    /// Tells about every parameter that nobody asked for.
    pub(super) fn finish(&mut self, cx: &mut Context) {
        for param in self.list.iter().filter(|p| !p.used && !p.inherited) {
            let hint = did_you_mean(&param.name, self.asked.iter().copied());
            let name = shown(&param.name);
            let cause = format!("unknown {} {} {name}", self.what, self.name);
            let text = format!("{} \"{}\" has no parameter \"{name}\": ignored{hint}", self.what, self.name);
            cx.report.warning(cause, param.span, text);
        }
    }
}

fn triples(values: Option<Vec<f32>>) -> Vec<Vec3> {
    values.unwrap_or_default().chunks_exact(3).map(Vec3::from_slice).collect()
}

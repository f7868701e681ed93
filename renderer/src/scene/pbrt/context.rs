//! What every builder needs: where to report, where files are, what names mean.

use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;

use super::report::{Report, did_you_mean, shown};
use super::source::Files;
use super::spectra;
use super::textures::{self, TextureTable, TextureValues};
use crate::scene::description::TextureId;
use crate::scene::{PathMap, Span};
use crate::spectrum::{self, Spectrum};

/// Types of version 3 of the format, by what they are of, and the nearest type of version 4.
const OLDER_TYPES: [(&str, &str, &str); 19] = [
    ("camera", "environment", "spherical"),
    ("film", "image", "rgb"),
    ("integrator", "directlighting", "path"),
    ("integrator", "whitted", "path"),
    ("material", "disney", "coateddiffuse"),
    ("material", "fourier", "measured"),
    ("material", "glass", "dielectric"),
    ("material", "kdsubsurface", "subsurface"),
    ("material", "matte", "diffuse"),
    ("material", "metal", "conductor"),
    ("material", "mirror", "conductor"),
    ("material", "plastic", "coateddiffuse"),
    ("material", "substrate", "coateddiffuse"),
    ("material", "translucent", "diffusetransmission"),
    ("material", "uber", "coateddiffuse"),
    ("medium of type", "heterogeneous", "uniformgrid"),
    ("sampler", "02sequence", "paddedsobol"),
    ("sampler", "maxmindist", "pmj02bn"),
    ("sampler", "random", "independent"),
];

/// Numbers for names, in the order in which they were first said. What a name stands for is found out at the end, since
/// a file may use a name before it defines it.
#[derive(Debug)]
pub(super) struct Names<K> {
    ids: BTreeMap<K, u32>,
    said: Vec<(K, Span)>,
}

impl<K> Default for Names<K> {
    fn default() -> Self {
        Self { ids: BTreeMap::new(), said: Vec::new() }
    }
}

impl<K: Ord + Clone> Names<K> {
    /// The number of a name, which was said at `span`.
    pub(super) fn intern(&mut self, name: K, span: Span) -> u32 {
        let next = self.said.len() as u32;
        let id = *self.ids.entry(name.clone()).or_insert(next);
        if id == next {
            self.said.push((name, span));
        }
        id
    }

    /// Every name and the place where it was first said, by number.
    pub(super) fn into_said(self) -> Vec<(K, Span)> {
        self.said
    }
}

/// What the name of a texture gives.
#[derive(Debug)]
pub(super) enum TextureNames {
    /// While files are read: a number for the name.
    Said(Names<(TextureValues, String)>),
    /// Afterwards: the texture.
    Defined(TextureTable),
}

/// What every builder needs.
pub(super) struct Context {
    pub(super) report: Report,
    pub(super) files: Files,
    pub(super) textures: TextureNames,
    /// Spectrum files that were read.
    spectra: HashMap<PathBuf, Option<Spectrum>>,
}

impl Context {
    pub(super) fn new(folder: PathBuf, map: PathMap) -> Self {
        Self {
            report: Report::default(),
            files: Files { folder, map, ..Files::default() },
            textures: TextureNames::Said(Names::default()),
            spectra: HashMap::new(),
        }
    }

    /// The float texture of this name.
    pub(super) fn float_texture(&mut self, name: &str, span: Span) -> Option<TextureId> {
        self.texture(TextureValues::Float, name, span)
    }

    /// The spectrum texture of this name.
    pub(super) fn spectrum_texture(&mut self, name: &str, span: Span) -> Option<TextureId> {
        self.texture(TextureValues::Spectrum, name, span)
    }

    fn texture(&mut self, values: TextureValues, name: &str, span: Span) -> Option<TextureId> {
        match &mut self.textures {
            TextureNames::Said(names) => Some(TextureId(names.intern((values, name.to_owned()), span))),
            TextureNames::Defined(_) => textures::resolve(self, values, name, span),
        }
    }

    /// The spectrum that a string means: a well-known name or a file.
    pub(super) fn named_spectrum(&mut self, name: &str, span: Span) -> Option<Spectrum> {
        if let Some(known) = spectrum::named(name) {
            return Some(known);
        }
        let path = self.files.resolve(name, span.file);
        if let Some(read) = self.spectra.get(&path) {
            return read.clone();
        }
        let spectrum = match spectra::read_spd(&path) {
            Ok(spectrum) => Some(spectrum),
            Err(why) if path.is_file() => {
                self.report.error(span, format!("{}: {why}", path.display()));
                None
            }
            Err(_) => {
                let known: Vec<String> = spectrum::names().collect();
                let hint = did_you_mean(name, known.iter().map(String::as_str));
                let text = format!("\"{}\" is neither a known spectrum nor a file{hint}", shown(name));
                self.report.error(span, text);
                None
            }
        };
        self.spectra.insert(path, spectrum.clone());
        spectrum
    }

    /// Reports a type that is not one of `known`.
    pub(super) fn unknown_type(&mut self, what: &str, name: &str, span: Span, known: &[&str]) {
        let hint = match OLDER_TYPES.iter().find(|(of, older, _)| (*of, *older) == (what, name)) {
            Some((.., now)) => format!(": in version 4 of the format \"{now}\" comes closest"),
            None => did_you_mean(name, known.iter().copied()),
        };
        self.report.error(span, format!("there is no {what} \"{}\"{hint}", shown(name)));
    }
}

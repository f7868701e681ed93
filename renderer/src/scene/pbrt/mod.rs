//! Reads pbrt-v4 scene files: the complete grammar, with all that is wrong told at once.
//!
//! The way of a scene: `lexer` tokens → `syntax` directives → `reader` state and entities → `finish`ed
//! description. Each family of entities has its own module, which knows its types, parameters and defaults.
//!
//! Paths are relative to the folder of the scene file, as in pbrt, or else to the file that names them.
//!
//! # Invariants
//! No input makes the reader panic, loop or recurse without bound. The order of messages does not depend on anything
//! but the files.

mod camera;
mod context;
mod entities;
mod film;
mod finish;
mod instances;
mod lexer;
mod lights;
mod materials;
mod media;
mod options;
mod param;
mod params;
mod reader;
mod report;
mod sampling;
mod shapes;
pub(super) mod source;
mod spectra;
mod spectral_params;
mod state;
mod syntax;
mod textures;
mod world;

use std::path::Path;

pub use report::did_you_mean;

use super::{Diagnostic, PathMap, Scene, Severity};

/// The scene with the warnings about it.
pub type Loaded = (Scene, Vec<Diagnostic>);

/// Reads a scene file and everything that it includes. Files that start as gzip does are unpacked.
///
/// Meshes and images are not read, but it is an error if their files do not exist.
///
/// # Errors
/// All errors and warnings, in the order of the files and lines.
pub fn load(path: &Path) -> Result<Loaded, Vec<Diagnostic>> {
    load_mapped(path, &PathMap::default())
}

/// The same, with the files that the scene names where `map` says.
///
/// # Errors
/// As [`load`].
pub fn load_mapped(path: &Path, map: &PathMap) -> Result<Loaded, Vec<Diagnostic>> {
    let text = source::read_file(path).map_err(|why| {
        let message = format!("cannot read {}: {why}", path.display());
        vec![Diagnostic { severity: Severity::Error, message, place: None }]
    })?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut reader = reader::Reader::new(folder.to_owned(), map.clone());
    reader.read(path, text);
    finish::finish(reader)
}

/// Reads a scene from memory. `folder` is where its paths start, `name` what messages call it.
///
/// # Errors
/// As [`load`].
pub fn parse(text: &[u8], folder: &Path, name: &str) -> Result<Loaded, Vec<Diagnostic>> {
    let mut reader = reader::Reader::new(folder.to_owned(), PathMap::default());
    reader.read(&folder.join(name), text.to_vec());
    finish::finish(reader)
}

#[cfg(test)]
mod tests;

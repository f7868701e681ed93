//! A strange scene's frame, judged: whole and finite, or refused at a line of its file.

use std::path::PathBuf;

use exr::prelude::write_rgb_file;
use renderer::filtering::Filtering;
use renderer::render::{Job, RenderError, Unobserved, render};

use crate::render::describe;
use crate::small::{adaptive, values};

/// The images beside every scene: plain, and of odd texels.
pub(super) const IMAGES: [&str; 3] = ["plain.exr", "odd.exr", "texel.exr"];

/// Samples of each pixel: enough for the filter to have two trees of several paths.
const SPP: u64 = 4;

/// A place for scenes, and the images that they may look at.
pub struct Folder(tempfile::TempDir);

/// What became of a scene that went well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// A frame whose values are finite, of all samples.
    Rendered,
    /// Some samples are beyond all numbers, were left out and counted; the frame is finite.
    Rejected(u64),
    /// Messages with a place.
    Refused,
}

/// What is wrong with a scene's frame, or with the message in its place.
#[derive(Debug)]
pub struct Wrong(pub String);

impl Folder {
    /// # Panics
    /// If there is no place for temporary files.
    pub fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let texels = |x: usize, y: usize| (x as f32 / 4.0, y as f32 / 3.0, 0.5);
        let odd = |x: usize, y: usize| match (x + 3 * y) % 6 {
            0 => (f32::NAN, 1.0, 1.0),
            1 => (f32::INFINITY, 0.0, 0.0),
            2 => (-1.0, 0.5, 0.5),
            3 => (1e30, 1e30, 1e-30),
            _ => (0.5, 0.5, 0.5),
        };
        let path = |name: &str| folder.path().join(name);
        let written = write_rgb_file(path(IMAGES[0]), 4, 3, texels)
            .and_then(|()| write_rgb_file(path(IMAGES[1]), 5, 7, odd))
            .and_then(|()| write_rgb_file(path(IMAGES[2]), 1, 1, |_, _| (0.25, 0.5, 1.0)));
        written.expect("images in the temporary folder");
        Self(folder)
    }

    /// Renders the scene without a filter, then with it.
    ///
    /// # Errors
    /// A value is not finite, or a message has no place.
    ///
    /// # Panics
    /// If the scene cannot be written, or the renderer panics.
    pub fn judge(&self, text: &str) -> Result<Outcome, Wrong> {
        let path: PathBuf = self.0.path().join("scene.pbrt");
        std::fs::write(&path, text).expect("a scene in the temporary folder");
        let mut rejected = 0;
        for filtering in [Filtering::None, adaptive()] {
            let job =
                Job { scene: path.clone(), spp: Some(SPP), seed: Some(1), threads: 1, filtering, ..Job::default() };
            match render(&job, &Unobserved) {
                Ok(frame) => {
                    let wild = values(&frame).pixels.iter().flatten().filter(|x| !x.is_finite()).count();
                    if wild > 0 {
                        return Err(Wrong(format!("{wild} values are not finite ({:?})", job.filtering)));
                    }
                    rejected += frame.statistics.counters.rejected_samples;
                }
                Err(error @ (RenderError::Scene(_) | RenderError::Compile(_))) => {
                    let messages = describe(&error);
                    let placed = messages.lines().skip(1).any(|line| line.contains("scene.pbrt:"));
                    return if placed { Ok(Outcome::Refused) } else { Err(Wrong(messages)) };
                }
                Err(error) => return Err(Wrong(describe(&error))),
            }
        }
        Ok(if rejected > 0 { Outcome::Rejected(rejected) } else { Outcome::Rendered })
    }
}

impl Default for Folder {
    fn default() -> Self {
        Self::new()
    }
}

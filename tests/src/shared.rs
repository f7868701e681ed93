//! Scenes and reference images by others, which are not part of the repository.

use std::path::PathBuf;

/// The folder that holds them: `TESSERA_SHARED`, else `shared` beside the workspace. `None` says so on standard error,
/// so that a skipped test is seen.
#[allow(clippy::print_stderr)]
pub fn folder() -> Option<PathBuf> {
    let beside = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared"));
    let folder = std::env::var_os("TESSERA_SHARED").map_or(beside, PathBuf::from);
    if folder.join("scenes").is_dir() {
        return Some(folder);
    }
    eprintln!("SKIPPED: no scenes of others in {}; set TESSERA_SHARED to their folder", folder.display());
    None
}

/// A scene file of that folder.
pub fn scene(name: &str) -> Option<PathBuf> {
    folder().map(|folder| folder.join("scenes").join(name).join("scene-v4.pbrt"))
}

/// All eleven pbrt scenes of that folder.
pub const SCENES: [&str; 11] = [
    "bmw-m6",
    "buddha-fractal",
    "coffee",
    "cornell-box",
    "house",
    "kitchen",
    "living-room",
    "staircase2",
    "veach-ajar",
    "veach-mis",
    "volumetric-caustic",
];

//! The files that a scene names besides those of its description.

use std::path::Path;

use rayon::prelude::*;

use super::Scene;
use super::description::{LightKind, ShapeKind, TextureKind};
use crate::sampling::mix64;

impl Scene {
    /// Every mesh and image that the scene names, each once, in the order of their names.
    pub fn assets(&self) -> Vec<&Path> {
        let shapes = self.shapes.iter().chain(self.objects.iter().flat_map(|object| &object.shapes));
        let mut assets = Vec::new();
        assets.extend(shapes.filter_map(|shape| match &shape.kind {
            ShapeKind::Ply { path, .. } => Some(path.as_path()),
            _ => None,
        }));
        assets.extend(self.textures.iter().filter_map(|texture| match &texture.kind {
            TextureKind::Image(image) => Some(image.path.as_path()),
            _ => None,
        }));
        assets.extend(self.materials.iter().filter_map(|material| material.normal_map.as_deref()));
        assets.extend(self.area_lights.iter().filter_map(|light| light.image.as_deref()));
        assets.extend(self.lights.iter().filter_map(|light| match &light.kind {
            LightKind::Infinite { image, .. } | LightKind::Goniometric { image, .. } => image.as_deref(),
            LightKind::Projection { image, .. } => Some(image.as_path()),
            LightKind::Point { .. } | LightKind::Spot { .. } | LightKind::Distant { .. } => None,
        }));
        assets.sort_unstable();
        assets.dedup();
        assets
    }

    /// A hash of all that the scene is read from, the same on every machine: scenes with other texts, meshes or images
    /// differ in it, wherever their folders are. Reads all of those files; one that cannot be read counts as empty.
    pub fn hash(&self) -> u64 {
        let asset = |path: &&Path| {
            let bytes = std::fs::read(path).unwrap_or_default();
            let name = path.file_name().unwrap_or_default().as_encoded_bytes();
            let [bytes_hash, name_hash] = [&bytes, name].map(|bytes: &[u8]| u64::from(crc32fast::hash(bytes)));
            mix64(mix64(bytes_hash << 32 | name_hash) ^ bytes.len() as u64)
        };
        // A sum: the order of the names is not that of another machine's folders.
        let assets = self.assets().par_iter().map(asset).reduce(|| 0, u64::wrapping_add);
        mix64(self.sources.hash() ^ assets)
    }
}

#[cfg(test)]
mod tests {
    use crate::scene::pbrt;

    #[test]
    fn the_hash_is_of_all_files_and_of_no_folder() {
        let hash = |text: &str, texel: u8| {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("scene.pbrt");
            std::fs::write(&path, text).unwrap();
            std::fs::write(folder.path().join("t.pgm"), [b"P5 1 1 255 ".as_slice(), &[texel]].concat()).unwrap();
            pbrt::load(&path).unwrap().0.hash()
        };
        let scene = "Camera \"perspective\"\nWorldBegin\nTexture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"t.pgm\"\n";
        let one = hash(scene, 1);
        assert_eq!(one, hash(scene, 1), "in another folder");
        assert_ne!(one, hash(scene, 2), "another texel");
        assert_ne!(one, hash(&(scene.to_owned() + "# more"), 1), "another text");
    }
}

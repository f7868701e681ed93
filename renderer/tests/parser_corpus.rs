//! The corpus of scene files, good and bad: beside each `NAME.pbrt` stands `NAME.txt`, all that the reader says about it.
//!
//! With `TESSERA_BLESS` set the texts are written instead of compared.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use renderer::scene::{Scene, pbrt};

fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/parser_corpus")
}

fn summary(scene: &Scene) -> String {
    format!(
        "read: {} textures, {} materials, {} lights, {} area lights, {} media, {} shapes, {} objects, {} instances\n",
        scene.textures.len(),
        scene.materials.len(),
        scene.lights.len(),
        scene.area_lights.len(),
        scene.media.len(),
        scene.shapes.len(),
        scene.objects.len(),
        scene.instances.len()
    )
}

/// What is said about a file, with paths as seen from the corpus.
fn answer(path: &Path) -> String {
    let (mut text, diagnostics) = match pbrt::load(path) {
        Ok((scene, warnings)) => (summary(&scene), warnings),
        Err(all) => ("refused\n".to_owned(), all),
    };
    for diagnostic in diagnostics {
        writeln!(text, "{diagnostic}").unwrap();
    }
    text.replace(&format!("{}/", corpus().display()), "").replace(&corpus().display().to_string(), ".")
}

#[test]
fn the_reader_says_what_the_corpus_expects() {
    let bless = std::env::var_os("TESSERA_BLESS").is_some();
    let mut files: Vec<PathBuf> = fs::read_dir(corpus()).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "pbrt"));
    files.sort();
    assert!(files.len() > 10, "the corpus is gone");
    let mut differences = String::new();
    for path in files {
        let answer = answer(&path);
        let good = path.file_name().unwrap().to_string_lossy().starts_with("good-");
        assert_eq!(good, answer.starts_with("read"), "{}\n{answer}", path.display());
        let expected = path.with_extension("txt");
        if bless {
            fs::write(&expected, &answer).unwrap();
        } else if fs::read_to_string(&expected).unwrap_or_default() != answer {
            writeln!(differences, "{}:\n{answer}", path.display()).unwrap();
        }
    }
    assert!(differences.is_empty(), "{differences}");
}

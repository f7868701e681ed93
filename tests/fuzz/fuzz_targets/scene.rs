//! Any text is read or refused with a reason. Start from `renderer/tests/parser_corpus`.
#![no_main]

use std::path::Path;

libfuzzer_sys::fuzz_target!(|text: &[u8]| {
    if let Err(all) = renderer::scene::pbrt::parse(text, Path::new("/nonexistent"), "scene.pbrt") {
        assert!(!all.is_empty());
    }
});

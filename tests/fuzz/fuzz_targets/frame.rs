//! Any scene of well-formed directives is a finite frame or refused at a line. The bytes choose the directives and their
//! numbers.
#![no_main]

use std::sync::LazyLock;

use tests::strange::{Folder, scene};

static FOLDER: LazyLock<Folder> = LazyLock::new(Folder::new);

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let text = scene(bytes);
    if let Err(wrong) = FOLDER.judge(&text) {
        panic!("{wrong:?}\n{text}");
    }
});

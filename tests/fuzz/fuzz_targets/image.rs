//! Any bytes, under the name of any format that textures come in, are an image or refused with a reason. The first byte
//! chooses the format.
#![no_main]

use std::cell::RefCell;
use std::path::PathBuf;

/// Pixels beyond this are read by nobody: a header may ask for any number, and gets the memory.
const MOST_VALUES: usize = 1 << 22;

thread_local! {
    /// Where the bytes are put, one file for each format.
    static FILES: RefCell<Vec<PathBuf>> = RefCell::new(
        ["exr", "png", "hdr", "tga", "jpg", "tif"]
            .map(|extension| std::env::temp_dir().join(format!("fuzz-{}.{extension}", std::process::id())))
            .to_vec(),
    );
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((format, bytes)) = bytes.split_first() else { return };
    FILES.with_borrow(|files| {
        let path = &files[usize::from(*format) % files.len()];
        std::fs::write(path, bytes).expect("a place for temporary files");
        let Ok(mut reader) = oiio::Reader::open(path) else { return };
        let (window, channels) = (reader.data_window(), reader.channels().len());
        reader.attributes();
        if window.width.saturating_mul(window.height).saturating_mul(channels) > MOST_VALUES {
            return;
        }
        if let Ok(pixels) = reader.read_f32() {
            assert_eq!(pixels.len(), window.width * window.height * channels);
        }
    });
});

//! Any file is a part, which is then written as it was read, or refused with a reason. Checksums are mended first: what they
//! guard against is not what is looked for.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use renderer::part::{self, Part};

/// Frames of more pixels are opened but not begun: a header may ask for any number, and gets the memory.
const MOST_PIXELS: u64 = 1 << 12;

static FILES: LazyLock<[PathBuf; 2]> = LazyLock::new(|| {
    ["read", "written"].map(|name| std::env::temp_dir().join(format!("fuzz-{}-{name}.part", std::process::id())))
});

/// Gives every section its checksum: after the eight bytes that say what the file is, each has its length, that, and its
/// bytes.
fn mend(bytes: &mut [u8]) {
    let mut rest = bytes.get_mut(8..).unwrap_or_default();
    while let Some((head, body)) = rest.split_first_chunk_mut::<12>() {
        let length = u64::from_le_bytes(head[..8].try_into().expect("eight bytes"));
        let Some(length) = usize::try_from(length).ok().filter(|length| *length <= body.len()) else { return };
        let (section, after) = body.split_at_mut(length);
        head[8..].copy_from_slice(&crc32fast::hash(section).to_le_bytes());
        rest = after;
    }
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let [read, written] = &*FILES;
    let mut bytes = bytes.to_vec();
    mend(&mut bytes);
    std::fs::write(read, bytes).expect("a place for temporary files");
    let Ok(part) = Part::open(read) else { return };
    if part.description.bounds.area() > MOST_PIXELS {
        return;
    }
    let Ok(mut frame) = part.begin() else { return };
    let write = |frame: &mut _| part::write(frame, written).and_then(|part| part.publish(written));
    write(&mut frame).expect("what was read can be written");
    let once = std::fs::read(written).expect("it was written");
    let mut frame = Part::open(written).and_then(Part::begin).expect("what was written can be read");
    write(&mut frame).expect("what was read can be written");
    assert!(std::fs::read(written).expect("it was written") == once);
    frame.finish();
});

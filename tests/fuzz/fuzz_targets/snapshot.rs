//! Any words are sums of a filter's part, which are then stored as they add up, or refused.
#![no_main]

use filter::{Adaptive, Anchor, Params};

const ANCHOR: Anchor = Anchor { origin: glam::DVec3::ZERO, extent: 1.0 };

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let words: Vec<u64> = bytes.chunks_exact(8).map(|chunk| u64::from_le_bytes(chunk.try_into().unwrap())).collect();
    let filter = || Adaptive::new(&Params { trees: 1, ..Params::default() }, &ANCHOR, 1);
    let (mut read, mut again) = (filter(), filter());
    if read.load_part(0, 0..256, &words).is_ok() {
        let (mut once, mut twice) = (Vec::new(), Vec::new());
        read.store_part(0, &mut once);
        again.load_part(0, 0..256, &once).expect("what was stored");
        again.store_part(0, &mut twice);
        assert_eq!(once, twice);
    }
});

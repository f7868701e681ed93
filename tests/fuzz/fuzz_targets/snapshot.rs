//! Any words are a part's share of a tree, which is then stored as it adds up, or refused; or a piece of an
//! epoch; or sums of its slots.
#![no_main]

use filter::{Adaptive, Anchor, Branch, Params, Slots};

const ANCHOR: Anchor = Anchor { origin: glam::DVec3::ZERO, extent: 1.0 };

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let words: Vec<u64> = bytes.chunks_exact(8).map(|chunk| u64::from_le_bytes(chunk.try_into().unwrap())).collect();
    let (params, slots) = (Params { trees: 1, ..Params::default() }, 0..256);
    if let Ok(branch) = Branch::read(&params, 0, &slots, &words) {
        let stored = |branch: &Branch| {
            let mut filter = Adaptive::new(&params, &ANCHOR, 1);
            filter.add_tree(0, 0, branch);
            filter.settle();
            let mut words = vec![Vec::new(); 2];
            filter.store_trees(0, &slots, &mut words);
            words.swap_remove(0)
        };
        let once = stored(&branch);
        let again = Branch::read(&params, 0, &slots, &once).expect("what was stored");
        assert_eq!(once, stored(&again));
        Branch::sum(vec![branch, again]);
    }
    let mut filter = Adaptive::new(&params, &ANCHOR, 1);
    if filter.add_epoch(&words).is_ok() {
        for piece in filter.epoch() {
            let mut words = Vec::new();
            filter.store_epoch(&piece, &mut words);
            filter.add_epoch(&words).expect("what was stored");
        }
    }
    if let Ok(own) = Slots::read(&slots, &words) {
        let mut again = Vec::new();
        own.store(&slots, &mut again);
        assert_eq!(words, again);
    }
});

//! Names as Cryptomatte has them: ids that are numbers of a float channel, and the manifest that leads back.
//!
//! **Source**: Cryptomatte specification 1.2.0 \[Friedman15\].

use std::collections::BTreeMap;
use std::sync::Arc;

/// A name's id: the bits of a float that is finite, not zero and not denormal.
///
/// **Source**: specification 1.2.0, "ID Generation": an exponent of all zeros or ones has its lowest bit turned.
pub fn id(name: &str) -> u32 {
    let hash = murmur3(name.as_bytes());
    match hash >> 23 & 0xff {
        0 | 0xff => hash ^ 1 << 23,
        _ => hash,
    }
}

/// Metadata of a set of layers: what comes after `cryptomatte/KEY/`, all texts.
pub fn metadata(layer: &str, names: &[Arc<str>]) -> Vec<(String, String)> {
    let manifest: BTreeMap<&str, String> = names.iter().map(|name| (&**name, format!("{:08x}", id(name)))).collect();
    let manifest = serde_json::to_string(&manifest).expect("a map of texts is JSON");
    let key = &format!("{:08x}", murmur3(layer.as_bytes()))[..7];
    [("name", layer), ("hash", "MurmurHash3_32"), ("conversion", "uint32_to_float32"), ("manifest", &manifest)]
        .map(|(what, value)| (format!("cryptomatte/{key}/{what}"), value.to_owned()))
        .into()
}

/// MurmurHash3 of 32 bits with the seed 0.
///
/// **Source**: A. Appleby's `MurmurHash3_x86_32`.
fn murmur3(bytes: &[u8]) -> u32 {
    let scramble = |block: u32| block.wrapping_mul(0xcc9e_2d51).rotate_left(15).wrapping_mul(0x1b87_3593);
    let mut chunks = bytes.chunks_exact(4);
    let mut hash = 0u32;
    for chunk in &mut chunks {
        let block = u32::from_le_bytes([chunk[0], chunk[1], chunk[2], chunk[3]]);
        hash = (hash ^ scramble(block)).rotate_left(13).wrapping_mul(5).wrapping_add(0xe654_6b64);
    }
    let tail = chunks.remainder().iter().rev().fold(0, |tail, byte| tail << 8 | u32::from(*byte));
    hash ^= scramble(tail) ^ bytes.len() as u32;
    hash = (hash ^ hash >> 16).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ hash >> 13).wrapping_mul(0xc2b2_ae35);
    hash ^ hash >> 16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_those_of_other_programs() {
        assert_eq!(murmur3(b"torus"), 4_053_562_365);
        assert_eq!(f32::from_bits(id("torus")), -1.549_436_2e30);
        assert_eq!(f32::from_bits(id("равнина")), -1.319_263_1e-25);
        // Vectors that others publish for the hash itself.
        assert_eq!(murmur3(b""), 0);
        assert_eq!(murmur3(b"hello"), 0x248b_fa47);
        assert_eq!(murmur3(b"The quick brown fox jumps over the lazy dog"), 0x2e4f_f723);
    }

    #[test]
    fn every_id_is_an_ordinary_number() {
        assert_eq!(id(""), 1 << 23);
        assert!((0..100_000).all(|k| f32::from_bits(id(&k.to_string())).is_normal()));
    }

    #[test]
    fn the_manifest_leads_from_names_to_ids() {
        let metadata = metadata("CryptoObject", &["a \"b\"".into(), "torus".into()]);
        let manifest: BTreeMap<String, String> = serde_json::from_str(&metadata[3].1).unwrap();
        assert_eq!(manifest["torus"], "f19c73fd");
        assert_eq!(manifest["a \"b\""], format!("{:08x}", id("a \"b\"")));
        assert!(metadata.iter().all(|(key, _)| key.split('/').nth(1).unwrap().len() == 7));
    }
}

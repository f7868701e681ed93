//! Integer mixing.

/// A bijection of 64 bits in which every bit of the input moves half the bits of the output.
///
/// **Source**: the finaliser of SplitMix64, \[Steele14\].
#[inline]
pub fn mix64(x: u64) -> u64 {
    let x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}

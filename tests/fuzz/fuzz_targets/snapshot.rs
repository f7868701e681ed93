//! Any bytes are sums of a filter, which are then written as they were read, or refused with a reason. The checksum is
//! made good first, so that what it protects is read at all.
#![no_main]

use filter::Snapshot;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = Snapshot::from_bytes(bytes);
    // FNV-1a, as `Snapshot` has it.
    let checksum = bytes.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    if let Ok(snapshot) = Snapshot::from_bytes(&[bytes, &checksum.to_le_bytes()].concat()) {
        let again = snapshot.to_bytes();
        assert_eq!(Snapshot::from_bytes(&again), Ok(snapshot));
    }
});

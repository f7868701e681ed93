//! Any bytes are a mesh with valid indices or refused with a reason.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Ok(mesh) = renderer::scene::ply::parse(bytes) {
        let count = mesh.triangles.positions.len();
        assert!(mesh.triangles.indices.iter().flatten().all(|&index| (index as usize) < count));
    }
});

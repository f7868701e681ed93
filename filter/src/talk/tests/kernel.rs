//! What kernel the jittered cells are, measured on planes.

use glam::{DVec3, Vec3};

use super::support::*;
use crate::grid::Anchor;
use crate::packed::PackedNormal;
use crate::record::{PathRecord, Vertex};
use crate::talk::{Jitter, LevelOfDetail, Params};

const SIDE: f64 = 0.25;
/// Paths are on a square of this half side, in cells; those within `INTERIOR` see no border of it: the widest kernel
/// measured here reaches 2.5.
const HALF: f64 = 5.0;
const INTERIOR: f64 = 2.0;
/// Whole numbers of eighths of a cell, all different along each axis: the mean over them does not know where cells are.
const PHASES: [[f64; 3]; 8] = [
    [0.0, 3.0, 5.0],
    [1.0, 6.0, 2.0],
    [2.0, 1.0, 7.0],
    [3.0, 4.0, 4.0],
    [4.0, 7.0, 1.0],
    [5.0, 2.0, 6.0],
    [6.0, 5.0, 3.0],
    [7.0, 0.0, 0.0],
];

/// What the filter made of three fields on a plane, coordinates s and t in cells.
struct Measured {
    /// Mean of filtered (s², t²) less (s², t²): the kernel's variance along s and t, in cells².
    variance: [f64; 2],
    /// Width of the 10 to 90 % rise of a step at s = 0, in cells.
    edge: f64,
}

fn params(jitter: Jitter) -> Params {
    let level = LevelOfDetail::Fixed { side: SIDE as f32 };
    Params { level, jitter, normal_bins: 0, ..Params::default() }
}

fn measure(n: Vec3, jitter: Jitter, paths: u32) -> Measured {
    let (t, b) = PackedNormal::new(n).get().any_orthonormal_pair();
    let (t, b) = (t.as_dvec3(), b.as_dvec3());
    let (mut variance, mut interior) = ([0.0; 2], 0.0);
    let mut profile = [(0.0, 0.0); 96];
    for (phase, shift) in (0u64..).zip(PHASES) {
        let centre = DVec3::from_array(shift) * (SIDE / 8.0);
        // One point in each square of a grid, at random within.
        let row = f64::from(paths).sqrt() as u32;
        let places: Vec<[f64; 2]> = (0..row * row)
            .map(|i| {
                let at = |cell: u32, axis: u64| {
                    let random = random(phase << 40 | u64::from(i) << 1 | axis);
                    HALF * (2.0 * (f64::from(cell) + random) / f64::from(row) - 1.0)
                };
                [at(i % row, 0), at(i / row, 1)]
            })
            .collect();
        let records = places.iter().zip(0..).map(|(&[s, u], slot)| {
            let p = centre + (t * s + b * u) * SIDE;
            let fields = [s * s, u * u, f64::from(u8::from(s > 0.0))].map(|x| x as f32);
            let first = Vertex::new(p.as_vec3(), n, 1.0 / 64.0, 0, 0);
            PathRecord { slot, first, diffuse: lobe(Vec3::from_array(fields)), ..PathRecord::default() }
        });
        let (slots, report) = filtered(&params(jitter), &ANCHOR, records.collect());
        assert_eq!(report.unresolved + report.placeless + report.rejected, 0);
        for (&[s, u], (_, resolved)) in places.iter().zip(&slots) {
            let [ss, uu, step] = resolved.diffuse.to_array().map(f64::from);
            if s.abs().max(u.abs()) < INTERIOR {
                variance = [variance[0] + ss - s * s, variance[1] + uu - u * u];
                interior += 1.0;
            }
            // Sixteenths of a cell, from -3 to 3.
            if s.abs() < 3.0 && u.abs() < HALF - 2.5 {
                let bin = &mut profile[((s + 3.0) * 16.0) as usize];
                *bin = (bin.0 + step, bin.1 + 1.0);
            }
        }
    }
    let profile = profile.map(|(sum, n): (f64, f64)| sum / n);
    let crossing = |level: f64| {
        let i = profile.iter().position(|&x| x >= level).unwrap();
        i as f64 - (profile[i] - level) / (profile[i] - profile[i - 1])
    };
    Measured { variance: variance.map(|x| x / interior), edge: (crossing(0.9) - crossing(0.1)) / 16.0 }
}

const SQUARE: Jitter = Jitter::Square { radius: 0.5 };

#[test]
fn the_kernel_is_a_cubic_b_spline_on_any_plane() {
    // Slanted planes cut cells in triangles and hexagons, of which the variance, weighted by area, is about a square's.
    let slanted = [Vec3::new(1.0, 0.0, 1.0), Vec3::new(1.0, 1.0, 1.0), Vec3::new(-0.3, 0.2, 0.9)];
    for n in [Vec3::X, -Vec3::Y, Vec3::Z].into_iter().chain(slanted.map(Vec3::normalize)) {
        let Measured { variance: [s, u], edge } = measure(n, SQUARE, 40_000);
        // Of L = s² the Laplacian is 2: its bias is (h²/6) ΔL = h²/3.
        let bias = [3.0 * s, 3.0 * u];
        println!("normal {n:5.2}: bias / (h²/6)ΔL = {:.3} {:.3}, edge {edge:.3} h", bias[0], bias[1]);
        assert!(bias.iter().all(|bias| (bias - 1.0).abs() < 0.05), "bias {bias:?} of the kernel's");
        assert!((edge / 1.51 - 1.0).abs() < 0.05, "edge {edge} h");
    }
}

#[test]
fn the_jitters_kind_and_radius_set_the_kernels_width() {
    for (jitter, expected) in [
        (Jitter::None, 1.0 / 6.0),
        (Jitter::Square { radius: 0.25 }, 1.0 / 6.0 + 2.0 * 0.25 / 12.0),
        (Jitter::Disk { radius: 0.5 }, 1.0 / 6.0 + 2.0 * 0.25 / 4.0),
        (Jitter::Disk { radius: 0.9 }, 1.0 / 6.0 + 2.0 * 0.81 / 4.0),
    ] {
        let measured = measure(Vec3::Z, jitter, 40_000);
        println!(
            "{jitter:?}: variance {:.4} {:.4} h², expected {expected:.4}",
            measured.variance[0], measured.variance[1]
        );
        assert!(measured.variance.iter().all(|variance| (variance / expected - 1.0).abs() < 0.05));
    }
}

/// Mean of filtered less true radiance by distance across the border of two levels, on a plane seen from above; radiance
/// is the distance from the point below the eye. In bins of 1/50, the border in the middle of 40.
fn across_a_level(jitter: Jitter) -> [f64; 40] {
    let anchor = Anchor { origin: DVec3::Z, extent: 10.0 };
    let params = Params { level: LevelOfDetail::Distance { side: 0.25 }, ..params(jitter) };
    // At distance 2 from the eye, which is 1 above.
    let border = 3f64.sqrt();
    let radii: Vec<f64> = (0..400_000).map(|i| (1.0 + 5.0 * random(2 * i)).sqrt()).collect();
    let records = radii.iter().zip(0u32..).map(|(&radius, slot)| {
        let (sin, cos) = (std::f64::consts::TAU * random(2 * u64::from(slot) + 1)).sin_cos();
        diffuse(slot, DVec3::new(radius * cos, radius * sin, 0.0).as_vec3(), Vec3::Z, radius as f32)
    });
    let (slots, _) = filtered(&params, &anchor, records.collect());
    let mut bins = [(0.0, 0.0); 40];
    for (&radius, (_, resolved)) in radii.iter().zip(&slots) {
        let at = (radius - border) * 50.0 + 20.0;
        if (0.0..40.0).contains(&at) {
            let bin = &mut bins[at as usize];
            *bin = (bin.0 + f64::from(resolved.diffuse.x) - radius, bin.1 + 1.0);
        }
    }
    bins.map(|(sum, n): (f64, f64)| sum / n)
}

#[test]
fn jitter_hides_the_seam_between_levels() {
    let jump = |bins: &[f64; 40]| (bins[20] - bins[19]) / 3f64.sqrt();
    let steepest =
        |bins: &[f64; 40]| bins.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max) / 3f64.sqrt();
    let (without, with) = (across_a_level(Jitter::None), across_a_level(SQUARE));
    println!(
        "jump at the border of levels: {:.2} % without jitter, {:.2} % with; steepest {:.2} % and {:.2} %",
        100.0 * jump(&without),
        100.0 * jump(&with),
        100.0 * steepest(&without),
        100.0 * steepest(&with)
    );
    assert!(jump(&without) > 0.05, "there is no seam to hide");
    assert!(jump(&with).abs() < 0.02 && steepest(&with) < 0.02);
}

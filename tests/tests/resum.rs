//! A path cut for the filter is still the path: its pieces sum to the unfiltered sample.

use std::path::Path;

use renderer::film::{AovSet, Film};
use renderer::filtering::{Keep, Keeper, Paths};
use renderer::integrator::{AlphaTested, Cut, Opaque, Queries};
use renderer::render::{Job, Prepared, Unobserved, prepare, trace_tile};
use renderer::sampling::Sampler;
use tests::render::own_scene;
use tests::shared;

/// Compares every path's pieces with its radiance.
#[derive(Default)]
struct Resum {
    paths: u64,
    recorded: u64,
    /// Largest difference relative to the path's largest channel.
    worst: f32,
    /// That path.
    example: String,
}

impl Keeper for Resum {
    type Recorder = Cut;

    fn keep(&mut self, cut: &Cut, sample: Keep<'_>) {
        let weight = sample.weight * sample.exposure;
        let whole = sample.radiance * weight;
        let mut paths = Paths::default();
        paths.keep(cut, Keep { split: None, ..sample });
        let pieces = paths.0.iter().fold(cut.prefix() * weight, |sum, record| sum + record.unfiltered());
        let difference = (pieces - whole).abs().max_element() / whole.abs().max_element().max(f32::MIN_POSITIVE);
        self.paths += 1;
        self.recorded += paths.0.len() as u64;
        // NaN is worse than anything.
        if difference > self.worst || difference.is_nan() {
            self.worst = difference;
            self.example = format!("{pieces} instead of {whole}: {cut:?}");
        }
    }
}

/// The pieces of a path are products of at most four packed factors, each off by 2⁻¹⁷ of its largest channel; a channel
/// that is dark in one factor and bright in another carries the sum of those errors relative to the largest. On top of
/// those come some f32 roundings a vertex. Twice the sum of the packing errors leaves room for both.
const BOUND: f32 = 2.0 * 4.0 / (1 << 17) as f32;

fn trace<Q: Queries>(prepared: &Prepared, queries: &Q) -> Resum {
    let world = &prepared.world;
    let mut film = Film::new(world.sensor.resolution, world.sensor.bounds, AovSet::default());
    let mut resum = Resum::default();
    for tile in &mut film.tiles() {
        trace_tile(world, queries, tile, &(0..8), &Sampler::new(1), false, &mut resum);
    }
    resum
}

fn check(scene: &Path) {
    let job = Job { scene: scene.to_owned(), spp: Some(1), resolution: Some([64, 48]), ..Job::default() };
    let prepared = prepare(&job, &Unobserved).unwrap_or_else(|error| panic!("{}: {error}", scene.display()));
    let geometry = &prepared.world.geometry;
    let resum = match geometry.alpha_test(&prepared.world.textures) {
        None => trace(&prepared, &Opaque(geometry.scene())),
        Some(alpha) => trace(&prepared, &AlphaTested { scene: geometry.scene(), alpha }),
    };
    let Resum { paths, recorded, worst, example } = resum;
    println!("{}: {paths} paths, {recorded} recorded, worst difference {worst:e}", scene.display());
    assert!(recorded > paths / 4, "{}: only {recorded} of {paths} paths have a selected vertex", scene.display());
    assert!(worst <= BOUND, "{}: {worst:e}: {example}", scene.display());
}

#[test]
fn pieces_sum_to_the_sample() {
    check(&own_scene("show/show.pbrt"));
    for name in shared::SCENES {
        if let Some(scene) = shared::scene(name) {
            check(&scene);
        }
    }
}

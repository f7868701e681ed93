//! A path cut for the filter is still the path: its pieces sum to the unfiltered sample.

use renderer::film::{AovSet, Film};
use renderer::filtering::{Keep, Keeper, Paths};
use renderer::integrator::{Cut, Opaque};
use renderer::render::{Job, Unobserved, prepare, trace_tile};
use renderer::sampling::Sampler;
use tests::render::own_scene;
use tests::shared;

/// Compares every path's pieces with its radiance.
#[derive(Default)]
struct Resum {
    paths: u64,
    recorded: u64,
    worst: f32,
    text: String,
}

impl Keeper for Resum {
    type Recorder = Cut;

    fn keep(&mut self, cut: &Cut, sample: Keep<'_>) {
        let whole = sample.radiance;
        let mut paths = Paths::default();
        let text = format!("{cut:?}");
        paths.keep(cut, Keep { split: None, ..sample });
        let pieces = paths.0.iter().fold(cut.prefix(), |sum, record| sum + record.unfiltered());
        let difference = (pieces - whole).abs().max_element() / whole.max_element().max(1e-3);
        self.paths += 1;
        self.recorded += paths.0.len() as u64;
        if !(difference <= self.worst) {
            self.worst = difference;
            self.text = format!("{whole} {pieces} {text} {:?}", paths.0);
        }
    }
}

fn check(scene: &std::path::Path) {
    let job = Job { scene: scene.to_owned(), spp: Some(1), resolution: Some([64, 48]), ..Job::default() };
    let prepared = prepare(&job, &Unobserved).unwrap_or_else(|_| panic!("{}", scene.display()));
    let world = &prepared.world;
    let mut film = Film::new(world.sensor.resolution, world.sensor.bounds, AovSet::default());
    let mut resum = Resum::default();
    for tile in &mut film.tiles() {
        trace_tile(world, &Opaque(world.geometry.scene()), tile, &(0..8), &Sampler::new(1), false, &mut resum);
    }
    println!(
        "{}: {} paths, {} recorded, worst {:e} {}",
        scene.display(),
        resum.paths,
        resum.recorded,
        resum.worst,
        resum.text
    );
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

//! A path cut for the filter is still the path: its pieces sum to the unfiltered sample.
#![allow(clippy::print_stdout, reason = "tests print the figures that they judge")]

use std::path::Path;

use renderer::film::{AovSet, Film};
use renderer::filtering::{Filtering, Keep, Keeper, Paths, Selection};
use renderer::integrator::{AlphaTested, Cut, Opaque, Queries};
use renderer::math::Rgb;
use renderer::render::{Job, Prepared, Unobserved, prepare, trace_tile};
use renderer::sampling::Sampler;
use tests::render::{own_scene, run};
use tests::shared;
use tests::small::{PLAIN, SceneFile, room, view};

/// Compares every path's pieces with its radiance.
#[derive(Default)]
struct Resum {
    selection: Selection,
    paths: u64,
    recorded: u64,
    /// Paths of which the sensor takes only a part.
    clamped: u64,
    /// Largest difference relative to the path's largest channel.
    worst: f32,
    /// That path.
    example: String,
}

impl Keeper for Resum {
    type Recorder = Cut;

    fn recorder(&self) -> Cut {
        Paths::new(self.selection).recorder()
    }

    fn keep(&mut self, cut: &Cut, sample: Keep) -> Rgb {
        let taken = sample.weight * sample.share;
        let whole = sample.radiance * taken;
        let mut paths = Paths::default();
        let prefix = paths.keep(cut, sample);
        let pieces = paths.records.iter().fold(prefix * taken, |sum, record| sum + record.unfiltered());
        let difference = (pieces - whole).abs().max_element() / whole.abs().max_element().max(f32::MIN_POSITIVE);
        self.paths += 1;
        self.recorded += paths.records.len() as u64;
        self.clamped += u64::from(sample.share < 1.0);
        // NaN is worse than anything.
        if difference > self.worst || difference.is_nan() {
            self.worst = difference;
            self.example = format!("{pieces} instead of {whole}: {cut:?}");
        }
        prefix
    }
}

/// The pieces of a path are products of at most four packed factors, each off by 2⁻¹⁷ of its largest channel; a channel
/// that is dark in one factor and bright in another carries the sum of those errors relative to the largest. On top of
/// those come some f32 roundings a vertex. Twice the sum of the packing errors leaves room for both.
const BOUND: f32 = 2.0 * 4.0 / (1 << 17) as f32;

fn trace<Q: Queries>(prepared: &Prepared, queries: &Q, selection: Selection) -> Resum {
    let world = &prepared.world;
    let mut film = Film::new(world.sensor.resolution, world.sensor.bounds, AovSet::default(), false);
    let mut resum = Resum { selection, ..Resum::default() };
    for tile in &mut film.tiles() {
        trace_tile(world, queries, tile, &(0..8), &Sampler::new(1), false, &mut resum);
    }
    resum
}

fn check(scene: &Path) {
    let job = Job { scene: scene.to_owned(), spp: Some(1), resolution: Some([64, 48]), ..Job::default() };
    let prepared = prepare(&job, &Unobserved).unwrap_or_else(|error| panic!("{}: {error}", scene.display()));
    let geometry = &prepared.world.geometry;
    let mut before = u64::MAX;
    for (selection, least) in [(Selection::Primary, 0.25), (Selection::Secondary, 0.0), (Selection::Tertiary, 0.0)] {
        let resum = match geometry.alpha_test(&prepared.world.textures) {
            None => trace(&prepared, &Opaque(geometry.scene()), selection),
            Some(alpha) => trace(&prepared, &AlphaTested { scene: geometry.scene(), alpha }, selection),
        };
        let Resum { paths, recorded, worst, example, .. } = resum;
        let name = scene.display();
        println!("{name}: {selection:?}: {paths} paths, {recorded} recorded, worst difference {worst:e}");
        assert!(recorded as f64 > least * paths as f64, "{name}: only {recorded} of {paths} paths are cut");
        assert!(recorded < before, "{name}: {recorded} paths are cut at a later vertex, {before} at an earlier one");
        assert!(worst <= BOUND, "{name}: {worst:e}: {example}");
        before = recorded;
    }
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

#[test]
fn pieces_sum_to_the_clamped_sample_and_the_clamp_is_in_the_light() {
    let text = room([48, 36], 1.0, 1.0, PLAIN).replace("Film \"rgb\"", "Film \"rgb\" \"float maxcomponentvalue\" 0.2");
    let scene = SceneFile::new(&text);
    let prepared = prepare(&Job { scene: scene.path(), ..Job::default() }, &Unobserved).expect("a scene");
    let queries = Opaque(prepared.world.geometry.scene());
    let resum = trace(&prepared, &queries, Selection::Primary);
    println!("{} of {} paths are clamped, worst difference {:e}", resum.clamped, resum.paths, resum.worst);
    assert!(resum.clamped > resum.paths / 10, "{} of {} paths are clamped", resum.clamped, resum.paths);
    assert!(resum.worst <= BOUND, "{:e}: {}", resum.worst, resum.example);
    let mut paths = Paths::default();
    let world = &prepared.world;
    let mut film = Film::new(world.sensor.resolution, world.sensor.bounds, AovSet::default(), false);
    for tile in &mut film.tiles() {
        trace_tile(world, &queries, tile, &(0..8), &Sampler::new(1), false, &mut paths);
    }
    // With a box filter throughput is the albedo of what is seen, clamped or not: only the light is less.
    let albedos = [[0.7, 0.7, 0.7], [0.6, 0.1, 0.1], [0.1, 0.5, 0.1], [0.6, 0.6, 0.7]].map(Rgb::from_array);
    for record in paths.records {
        let throughput = record.diffuse.throughput.get();
        assert!(
            albedos.iter().any(|albedo| (throughput - *albedo).abs().max_element() <= 1.0 / f32::from(u16::MAX)),
            "{throughput}"
        );
    }
}

/// A floor of albedo 0.5 on which a block of glass stands, without a face of its own below: half of the floor is in glass.
fn floor_in_glass() -> String {
    let floor = "Material \"diffuse\" \"rgb reflectance\" [ 0.5 0.5 0.5 ]\n\
         Shape \"bilinearmesh\" \"point3 P\" [ -9 0 -1  9 0 -1  -9 9 -1  9 9 -1 ]\n";
    let block = "Material \"dielectric\" \"float eta\" 1.5\n\
         Shape \"trianglemesh\" \"point3 P\" [ 0 1 -1  9 1 -1  9 8 -1  0 8 -1  0 1 -0.5  9 1 -0.5  9 8 -0.5  0 8 -0.5 ]\n\
         \"integer indices\" [ 4 5 6 4 6 7  0 1 5 0 5 4  1 2 6 1 6 5  2 3 7 2 7 6  3 0 4 3 4 7 ]\n";
    let sky = "LightSource \"infinite\" \"rgb L\" [ 1 1 1 ]\n";
    view([32, 24], "Camera \"perspective\" \"float fov\" 60", &format!("{sky}{floor}{block}"))
}

#[test]
fn throughput_and_light_within_glass_are_those_without() {
    let scene = SceneFile::new(&floor_in_glass());
    let prepared = prepare(&Job { scene: scene.path(), ..Job::default() }, &Unobserved).expect("a scene");
    let world = &prepared.world;
    let queries = Opaque(world.geometry.scene());
    let mut film = Film::new(world.sensor.resolution, world.sensor.bounds, AovSet::default(), false);
    // Paths and light of the floor outside the block, and of that within.
    let mut sums = [[0.0_f64; 2]; 2];
    for tile in &mut film.tiles() {
        let mut paths = Paths::default();
        trace_tile(world, &queries, tile, &(0..64), &Sampler::new(1), false, &mut paths);
        for record in paths.records {
            // Fresnel's terms decide how often a path is taken and not what it carries, so this is the albedo alone.
            let throughput = record.diffuse.throughput.get();
            assert!((throughput - 0.5).abs().max_element() <= 1.0 / f32::from(u16::MAX), "{throughput}");
            let [x, y] = [0, 1].map(|axis| f64::from(record.first.p[axis]) + world.origin[axis]);
            let within = x > 0.0 && (1.0..8.0).contains(&y);
            let [count, light] = &mut sums[usize::from(within)];
            *count += 1.0;
            *light += f64::from(record.diffuse.incident(record.suffix.get()).y);
        }
    }
    let [without, within] = sums.map(|[count, light]| light / count);
    println!("light on the floor: {without:.3} without the glass, {within:.3} within");
    assert!(sums.iter().all(|[count, _]| *count > 2_000.0));
    // The sky's 1 fills the cone of refraction within, which is 1/η² = 0.44 of the cosine-weighted hemisphere, less a tenth
    // for Fresnel's reflections; what comes from beyond it has seen the floor, which absorbs half. Plain radiance would be
    // 2.25 times as much, and more than there is without.
    assert!(0.4 < within && within < without && without < 1.0);
}

#[test]
fn an_image_whose_paths_share_nothing_is_the_unfiltered_one() {
    for vertex in ["primary", "secondary", "tertiary"] {
        let mut filtering = Filtering::named("talk").expect("the talk's filter");
        // Cells of a ten-thousandth of a pixel hold one path each.
        for (key, value) in [("vertex", vertex), ("side", "1e-4"), ("jitter", "none")] {
            filtering.set(key, value).expect("a setting of the talk");
        }
        let (resolution, spp) = (Some([64, 36]), Some(4));
        let film = run(&Job { scene: own_scene("show/show.pbrt"), spp, resolution, filtering, ..Job::default() }).film;
        // The filter counts in 2⁻²⁴ of the mean's order, a few times a path.
        let quantum = f64::from(film.mean().max_element()) / f64::from(1 << 20);
        for at in film.bounds().pixels() {
            let (own, filtered) = (film.pixel(at).mean(), film.value(at));
            let difference = (own - filtered).abs().max_element();
            assert!(
                difference <= f64::from(BOUND) * own.abs().max_element() + quantum,
                "{vertex} {at:?}: {filtered}, not {own}"
            );
        }
    }
}

//! Auxiliary outputs are what they say: parts sum to the whole, and slices to the frame.

use std::path::Path;

use renderer::film::{AovSet, Film, Image, cryptomatte};
use renderer::render::{Job, Unobserved, render};
use tests::render::{add, own_scene, run};

fn aovs(names: &[&str]) -> AovSet {
    let mut aovs = AovSet::default();
    names.iter().for_each(|name| assert!(aovs.insert(name), "{name}"));
    aovs
}

fn job(scene: &Path, names: &[&str]) -> Job {
    Job { scene: scene.to_owned(), spp: Some(8), resolution: Some([48, 32]), aovs: aovs(names), ..Job::default() }
}

/// The RGB of a layer of all pixels; the root's for an empty name.
fn layer(image: &Image, name: &str) -> Vec<[f32; 3]> {
    let place = |component| {
        let channel = if name.is_empty() { String::from(component) } else { format!("{name}.{component}") };
        image.channels.iter().position(|c| c.name == channel).unwrap_or_else(|| panic!("no channel {channel}"))
    };
    let places = ['R', 'G', 'B'].map(place);
    image.values.chunks_exact(image.channels.len()).map(|pixel| places.map(|place| pixel[place])).collect()
}

/// Checks that layers add up to the beauty, and that each of them is somewhere.
///
/// Each sample is split in f32, in which a path of b vertices sums b terms per part: 64 roundings hold all of them here, of
/// the largest sample of a pixel, which is at most the number of samples times its mean; the pixel's are box filtered.
fn check_sum(film: &Film, names: &[&str]) {
    let image = film.image();
    let whole = layer(&image, "");
    let parts: Vec<_> = names.iter().map(|name| layer(&image, name)).collect();
    for (name, part) in names.iter().zip(&parts) {
        assert!(part.iter().flatten().any(|x| *x > 0.0), "nothing is in {name}");
    }
    for (index, pixel) in whole.iter().enumerate() {
        let largest = pixel.iter().fold(0.0, |a: f32, b| a.max(*b));
        for channel in 0..3 {
            let sum: f32 = parts.iter().map(|part| part[index][channel]).sum();
            let difference = (sum - pixel[channel]).abs();
            assert!(difference <= 64.0 * f32::EPSILON * largest, "pixel {index}: {sum} instead of {}", pixel[channel]);
        }
    }
}

#[test]
fn direct_indirect_and_emitted_light_are_all_light() {
    for scene in ["show/show.pbrt", "aov/groups.pbrt"] {
        let film = run(&job(&own_scene(scene), &["direct", "indirect", "emission"])).film;
        check_sum(&film, &["direct", "indirect", "emission"]);
    }
}

#[test]
fn groups_of_lights_are_all_light() {
    let film = run(&job(&own_scene("aov/groups.pbrt"), &["light"])).film;
    assert_eq!(film.outputs().groups.iter().map(|name| &**name).collect::<Vec<_>>(), ["default", "key", "sky"]);
    check_sum(&film, &["light.default", "light.key", "light.sky"]);
}

#[test]
fn a_group_is_what_its_lights_alone_give() {
    let text = std::fs::read_to_string(own_scene("aov/groups.pbrt")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    // The lamp of the group "key" alone: its light is scattered by the same numbers only if lights are chosen alike, so
    // means are compared, by their standard errors.
    let alone = folder.path().join("alone.pbrt");
    let kept = |line: &&str| !line.contains("\"string group\" \"sky\"") && !line.contains("# the one without a group");
    std::fs::write(&alone, text.lines().filter(kept).map(|line| format!("{line}\n")).collect::<String>()).unwrap();
    let mean = |image: &Image, name: &str| {
        let values: Vec<f64> = layer(image, name).iter().map(|rgb| f64::from(rgb[1])).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (mean, values)
    };
    let spp = Some(64);
    let all = run(&Job { spp, ..job(&own_scene("aov/groups.pbrt"), &["light"]) }).film.image();
    let one = run(&Job { spp, seed: Some(9), ..job(&alone, &["light"]) }).film.image();
    let ((group, a), (whole, b)) = (mean(&all, "light.key"), mean(&one, ""));
    // Pixels of the two pictures are independent, and so are their differences of each other.
    let variance = a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / (a.len() as f64).powi(2);
    assert!((group - whole).abs() < 4.0 * variance.sqrt(), "{group} and {whole}, off by {}", variance.sqrt());
    assert_eq!(mean(&one, "light.key").1, b, "the only group is all light");
}

#[test]
fn denoisers_see_through_mirrors_and_glass() {
    let film = run(&job(&own_scene("aov/mirror.pbrt"), &["albedo", "N", "denoise.albedo", "denoise.N"])).film;
    let image = film.image();
    // In the middle of the picture a mirror shows a red wall.
    let middle = 16 * 48 + 24;
    let [red, green, blue] = layer(&image, "denoise.albedo")[middle];
    assert!(red > 0.6 && green < 0.1 && blue < 0.1, "{red} {green} {blue}");
    let place = |name: &str| image.channels.iter().position(|c| c.name == name).unwrap();
    let at = |name: &str| image.values[middle * image.channels.len() + place(name)];
    assert!((at("N.X").abs() - std::f32::consts::FRAC_1_SQRT_2).abs() < 1e-6, "{}", at("N.X"));
    assert_eq!(["denoise.N.X", "denoise.N.Y", "denoise.N.Z"].map(at), [1.0, 0.0, 0.0]);
    // Where the first hit is rough, both are the same.
    let floor = 30 * 48 + 24;
    assert_eq!(layer(&image, "albedo")[floor], layer(&image, "denoise.albedo")[floor]);
}

/// Ids and coverages of a pixel's ranks.
fn ranks(image: &Image, layer: &str, pixel: usize) -> Vec<(u32, f32)> {
    let first = image.channels.iter().position(|c| c.name == format!("{layer}00.R")).expect("a first layer");
    let values = &image.values[pixel * image.channels.len() + first..][..12];
    values.chunks_exact(2).map(|rank| (rank[0].to_bits(), rank[1])).collect()
}

#[test]
fn mattes_cover_what_is_seen_and_know_it_by_name() {
    let scene = own_scene("aov/names.pbrt");
    let layers = ["CryptoObject", "CryptoMaterial"];
    let frame = run(&Job { spp: Some(64), ..job(&scene, &layers) });
    let image = frame.film.image();
    let known = [vec!["ball", "names.pbrt:28", "tree.1", "tree.2"], vec!["names.pbrt:27", "red", "white"]];
    for ((layer, names), known) in layers.iter().zip(&frame.description.names).zip(known) {
        assert_eq!(names.iter().map(|name| &**name).collect::<Vec<_>>(), known);
        let mut seen = std::collections::BTreeSet::new();
        for (index, pixel) in image.values.chunks_exact(image.channels.len()).enumerate() {
            let ranks = ranks(&image, layer, index);
            let covered: f32 = ranks.iter().map(|(_, share)| share).sum();
            assert!((covered - pixel[3]).abs() < 1e-6, "pixel {index}: {covered} of {}", pixel[3]);
            assert!(ranks.windows(2).all(|pair| pair[0].1 >= pair[1].1), "{ranks:?}");
            seen.extend(ranks.iter().map(|(id, _)| *id).filter(|id| *id != 0));
        }
        assert_eq!(seen, names.iter().map(|name| cryptomatte::id(name)).collect(), "{layer}");
    }
    // The middle of the ball is all ball, and red.
    let middle = 16 * 48 + 24;
    assert_eq!(ranks(&image, "CryptoObject", middle)[0], (cryptomatte::id("ball"), 1.0));
    assert_eq!(ranks(&image, "CryptoMaterial", middle)[0], (cryptomatte::id("red"), 1.0));
    // The trees right and left of it are two, of one material.
    for (x, tree) in [(10, "tree.2"), (37, "tree.1")] {
        let pixel = 16 * 48 + x;
        assert_eq!(ranks(&image, "CryptoObject", pixel)[0], (cryptomatte::id(tree), 1.0));
        assert_eq!(ranks(&image, "CryptoMaterial", pixel)[0], (cryptomatte::id("white"), 1.0));
    }
}

#[test]
fn slices_have_the_outputs_of_the_whole_bit_for_bit() {
    let all = |range: Option<std::ops::Range<u64>>| {
        let job = job(&own_scene("aov/names.pbrt"), &[]);
        run(&Job { aovs: AovSet::all(), sample_range: range, ..job }).film
    };
    let bits = |film: &Film| film.image().values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    let whole = bits(&all(None));
    for parts in [[0..3, 3..4, 4..8], [4..8, 0..3, 3..4]] {
        let [mut sum, second, third] = parts.map(|range| all(Some(range)));
        [second, third].iter().for_each(|part| add(&mut sum, part));
        assert!(bits(&sum) == whole);
    }
}

#[test]
fn a_wrong_name_of_a_group_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("a.pbrt");
    std::fs::write(&scene, "WorldBegin LightSource \"point\" \"string group\" \"a.b\"").unwrap();
    let error = render(&Job { scene, ..Job::default() }, &Unobserved).err().expect("no picture");
    assert!(format!("{error:?}").contains("takes letters"), "{error:?}");
}

//! A scene through other people's filters, for figures.
//!
//! `baselines SCENE.pbrt WIDTHxHEIGHT SPP FOLDER` writes `FOLDER/range-search.exr` and `FOLDER/cross-bilateral.exr`, both of
//! the samples that `tessera render --seed 1` takes.
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use renderer::film::{AovSet, Film, Layer};
use renderer::filtering::Paths;
use renderer::integrator::{AlphaTested, Opaque, Queries};
use renderer::render::{Job, Prepared, Unobserved, prepare, trace_tile};
use renderer::sampling::Sampler;
use tests::baselines::cross_bilateral::{CrossBilateral, Guides};
use tests::baselines::range_search::RangeSearch;

type Failure = Box<dyn std::error::Error + Send + Sync>;

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, resolution, spp, folder] = arguments.as_slice() else {
        return Err("usage: baselines SCENE.pbrt WIDTHxHEIGHT SPP FOLDER".into());
    };
    let (width, height) = resolution.split_once('x').ok_or("the resolution is WIDTHxHEIGHT")?;
    let resolution = Some([width.parse()?, height.parse()?]);
    let job = Job { scene: PathBuf::from(scene), spp: Some(spp.parse()?), seed: Some(1), resolution, ..Job::default() };
    let prepared = prepare(&job, &Unobserved)?;
    let geometry = &prepared.world.geometry;
    let traced = match geometry.alpha_test(&prepared.world.textures) {
        None => Traced::new(&prepared, &Opaque(geometry.scene())),
        Some(alpha) => Traced::new(&prepared, &AlphaTested { scene: geometry.scene(), alpha }),
    };
    let folder = Path::new(folder);
    std::fs::create_dir_all(folder)?;
    traced.write(&traced.range_search(&prepared), &folder.join("range-search.exr"))?;
    traced.write(&traced.cross_bilateral(), &folder.join("cross-bilateral.exr"))
}

/// A frame and its paths.
struct Traced {
    film: Film,
    paths: Paths,
}

impl Traced {
    fn new<Q: Queries>(prepared: &Prepared, queries: &Q) -> Self {
        let world = &prepared.world;
        let mut film = Film::new(world.sensor.resolution, world.sensor.bounds, AovSet::gbuffer(), true);
        let (mut paths, sampler) = (Paths::default(), Sampler::new(prepared.description.seed));
        for tile in &mut film.tiles() {
            let samples = &prepared.description.asked;
            trace_tile(world, queries, tile, samples, &sampler, true, &mut paths);
        }
        Self { film, paths }
    }

    fn range_search(&self, prepared: &Prepared) -> Vec<[f32; 3]> {
        let mut sums = vec![DVec3::ZERO; self.film.slots()];
        let records = &self.paths.records;
        for (record, brought) in records.iter().zip(RangeSearch::default().filter(records)) {
            sums[record.slot as usize] += brought.as_dvec3();
        }
        let value = |at| {
            let prefix = self.film.layer(Layer::Prefix, at).unwrap_or_default();
            let radiance = (prefix + sums[self.film.index(at)]) / self.film.pixel(at).normalisation();
            (prepared.world.sensor.response * radiance.as_vec3()).to_array()
        };
        self.film.bounds().pixels().map(value).collect()
    }

    fn cross_bilateral(&self) -> Vec<[f32; 3]> {
        let film = &self.film;
        let image: Vec<[f32; 3]> =
            film.bounds().pixels().map(|at| film.pixel(at).mean().as_vec3().to_array()).collect();
        let mean = |sum: DVec3, hits: u64| (sum / hits.max(1) as f64).as_vec3();
        let seen: Vec<(Vec3, Vec3, f32)> = film
            .bounds()
            .pixels()
            .map(|at| {
                let hits = film.pixel(at).hits();
                let seen = |layer| mean(film.layer(layer, at).unwrap_or_default(), hits);
                let depth = if hits > 0 { seen(Layer::Depth).x } else { f32::INFINITY };
                (seen(Layer::Normal), seen(Layer::Albedo), depth)
            })
            .collect();
        let normal: Vec<[f32; 3]> = seen.iter().map(|(n, _, _)| n.to_array()).collect();
        let albedo: Vec<[f32; 3]> = seen.iter().map(|(_, albedo, _)| albedo.to_array()).collect();
        let depth: Vec<f32> = seen.iter().map(|(_, _, depth)| *depth).collect();
        let guides = Guides { normal: &normal, albedo: &albedo, depth: &depth };
        CrossBilateral::default().filter(&image, film.bounds().width() as usize, &guides)
    }

    fn write(&self, image: &[[f32; 3]], path: &Path) -> Result<(), Failure> {
        let bounds = self.film.bounds();
        let window = oiio::Window::at_origin(bounds.width() as usize, bounds.height() as usize);
        let channel = |name: &str| oiio::Channel { name: name.to_owned(), format: oiio::Format::Float };
        oiio::write(&oiio::Output {
            path,
            file_format: oiio::FileFormat::Exr,
            data_window: window,
            display_window: window,
            channels: ["R", "G", "B"].map(channel).into(),
            pixels: image.as_flattened(),
            attributes: Vec::new(),
            compression: oiio::Compression::Zip,
        })?;
        Ok(())
    }
}

//! Speed of whole frames, one JSON line a scene: how fast, and what share of the time Embree alone would need.
//!
//! `bench SCENE.pbrt WIDTHxHEIGHT SPP [THREADS]`
//!
//! Embree's share is measured by recording the queries of every tile while it is traced, and asking them again with no
//! shading, all threads at work as in the render. Never a test: it only prints.
#![forbid(unsafe_code)]
#![allow(clippy::print_stdout)]

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use rayon::prelude::*;
use renderer::film::{AovSet, Film};
use renderer::filtering::Nothing;
use renderer::integrator::{AlphaTested, Opaque, Queries, Recorded, Recording};
use renderer::render::{self, Job, Prepared, Unobserved};
use renderer::sampling::Sampler;

fn main() -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [scene, resolution, spp, threads @ ..] = arguments.as_slice() else {
        return Err("usage: bench SCENE.pbrt WIDTHxHEIGHT SPP [THREADS]".into());
    };
    let (width, height) = resolution.split_once('x').ok_or("the resolution is WIDTHxHEIGHT")?;
    let spp: u64 = spp.parse()?;
    let job = Job {
        scene: PathBuf::from(scene),
        spp: Some(spp),
        resolution: Some([width.parse()?, height.parse()?]),
        threads: threads.first().map_or(Ok(0), |text| text.parse())?,
        ..Job::default()
    };
    let pool = render::thread_pool(job.threads)?;
    pool.install(|| -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
        let prepared = render::prepare(&job, &Unobserved)?;
        let embree_seconds = match prepared.world.geometry.alpha_test(&prepared.world.textures) {
            None => replay(&prepared, &Opaque(prepared.world.geometry.scene()), spp),
            Some(alpha) => replay(&prepared, &AlphaTested { scene: prepared.world.geometry.scene(), alpha }, spp),
        };
        let (parse, compile) = (prepared.statistics.parse_seconds, prepared.statistics.compile_seconds);
        let frame = render::trace(prepared, None, None, &Unobserved).develop();
        let statistics = frame.statistics;
        let rays = statistics.counters.closest_hit_rays + statistics.counters.shadow_rays;
        let line = serde_json::json!({
            "scene": scene,
            "resolution": resolution,
            "spp": spp,
            "threads": statistics.threads,
            "parse_seconds": parse,
            "compile_seconds": compile,
            "render_seconds": statistics.render_seconds,
            "embree_seconds": embree_seconds,
            "embree_share": embree_seconds / statistics.render_seconds,
            "rays_per_path": rays as f64 / statistics.counters.camera_rays as f64,
            "million_rays_per_second": rays as f64 * 1e-6 / statistics.render_seconds,
            "nanoseconds_per_ray_and_thread": statistics.render_seconds * 1e9 * statistics.threads as f64 / rays as f64,
            "rejected_samples": statistics.counters.rejected_samples,
        });
        println!("{line}");
        Ok(())
    })
}

/// Wall seconds that the queries of the whole frame take by themselves, on all threads.
fn replay<Q: Queries + Sync>(prepared: &Prepared, queries: &Q, spp: u64) -> f64 {
    let world = &prepared.world;
    let mut film = Film::new(world.sensor.resolution, world.sensor.bounds, AovSet::default(), false);
    let sampler = Sampler::new(prepared.description.seed);
    let nanoseconds = AtomicU64::new(0);
    let found = AtomicU64::new(0);
    for sample in 0..spp {
        let pass = sample..sample + 1;
        film.tiles().par_iter_mut().for_each(|tile| {
            let recording = Recording::new(queries);
            render::trace_tile(world, &recording, tile, &pass, &sampler, false, &mut Nothing);
            let log = recording.into_log();
            let start = Instant::now();
            let hits = log.iter().filter(|query| match query {
                Recorded::Closest(ray) => queries.intersect(ray).is_some(),
                Recorded::Any(ray) => queries.occluded(ray),
            });
            found.fetch_add(hits.count() as u64, Ordering::Relaxed);
            nanoseconds.fetch_add(start.elapsed().as_nanos() as u64, Ordering::Relaxed);
        });
    }
    assert!(found.into_inner() > 0, "no ray met anything, so nothing was measured");
    nanoseconds.into_inner() as f64 * 1e-9 / prepared.statistics.threads as f64
}

//! `tessera study`: what time buys.

use serde::Serialize;

use crate::args::StudyArguments;
use crate::exit::Failure;
use crate::job;
use crate::log::Log;
use crate::output::OutputFile;
use crate::progress::Progress;
use crate::stats;
use crate::study::measure::{self, Measured, Point};
use crate::study::page::{self, Study};
use crate::study::plan::Plan;
use crate::study::renders::Studio;
use crate::study::verdict::{self, Price};

/// Runs the command.
pub fn run(arguments: &StudyArguments, log: &Log) -> Result<(), Failure> {
    let progress = Progress::new(arguments.progress, 1, log);
    study(arguments, log, &progress).inspect_err(|failure| progress.fail(failure))
}

/// study.json.
#[derive(Serialize)]
struct Report<'a> {
    version: String,
    #[serde(serialize_with = "stats::shown_path")]
    scene: &'a std::path::Path,
    resolution: [usize; 2],
    reference_noise: f64,
    points: &'a [Point],
    prices: &'a [Vec<Price>],
    recommendation: &'a str,
}

fn study(arguments: &StudyArguments, log: &Log, progress: &Progress<'_>) -> Result<(), Failure> {
    let plan = Plan::new(arguments)?;
    let renders = Studio::new(arguments, progress, log)?.run(&plan)?;
    progress.phase("measure");
    let Measured { points, reference_noise } = measure::measure(&plan, &renders, arguments.cpu_time)?;
    let prices: Vec<Vec<Price>> =
        arguments.target.iter().map(|&target| verdict::prices(&points, plan.settings.len(), target)).collect();
    let recommendation = verdict::recommendation(&prices[0], &plan.settings, &points, arguments.target[0]);

    let write = |name: &str, text: String| OutputFile::prepare(&arguments.output.join(name))?.write(text.as_bytes());
    let resolution = [renders.reference[0].width, renders.reference[0].height];
    let report = Report {
        version: job::software(),
        scene: &arguments.scene,
        resolution,
        reference_noise,
        points: &points,
        prices: &prices,
        recommendation: &recommendation,
    };
    write("study.csv", csv(&points))?;
    let json = serde_json::to_string_pretty(&report).expect("the report is plain data with text keys");
    write("study.json", json + "\n")?;
    let study = Study {
        arguments,
        plan: &plan,
        renders: &renders,
        points: &points,
        reference_noise,
        prices: &prices,
        recommendation: &recommendation,
    };
    write("index.html", page::page(&study)?)?;
    progress.finish(&arguments.output.join("index.html"), None);
    log.info(&recommendation);
    Ok(())
}

fn csv(points: &[Point]) -> String {
    let mut text = String::from(
        "setting,spp,seeds,seconds,relmse,relmse_low,relmse_high,relmse_best,squared_bias,squared_bias_error,variance,predicted\n",
    );
    for p in points {
        let [low, high] = p.interval;
        text += &format!(
            "{},{},{},{},{},{low},{high},{},{},{},{},{}\n",
            p.name,
            p.spp,
            p.seeds,
            p.seconds,
            p.relmse,
            p.relmse_best,
            p.squared_bias,
            p.squared_bias_error,
            p.variance,
            p.predicted.map_or(String::new(), |predicted| predicted.to_string())
        );
    }
    text
}

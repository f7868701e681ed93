//! `tessera compare`: how far an image is from a reference.

use std::path::{Path, PathBuf};

use oiio::{Channel, Format};

use super::print;
use crate::args::{CompareArguments, ReportFormat};
use crate::exit::Failure;
use crate::job;
use crate::log::Log;
use crate::metric::{self, Comparison, Reference};
use crate::output::OutputFile;
use crate::picture::{self, Picture};
use crate::significance::{Prediction, ZTest};

/// Runs the command.
pub fn run(arguments: &CompareArguments, log: &Log) -> Result<(), Failure> {
    let output = match &arguments.output {
        None => None,
        Some(path) => {
            job::require_extension(path, "exr", "differences are written as OpenEXR, which keeps their sign and size")?;
            Some(OutputFile::prepare(path)?)
        }
    };
    let inputs = [Some(&arguments.image), Some(&arguments.reference), arguments.second_reference.as_ref()];
    output.iter().try_for_each(|output| output.spare(inputs.into_iter().flatten().map(PathBuf::as_path)))?;
    let layer = arguments.layer.as_deref();
    let image = Picture::read(&arguments.image, layer)?;
    let reference = Picture::read(&arguments.reference, layer)?;
    check_windows(&image, &reference)?;
    let second = arguments.second_reference.as_deref().map(|path| Picture::read(path, layer)).transpose()?;
    second.iter().try_for_each(|second| check_windows(&image, second))?;
    // Errors are those of R G B.
    let errors = |path: &Path| if layer.is_none() { picture::layer(path, "error") } else { Ok(None) };
    let (own, known) = (errors(&arguments.image)?, errors(&arguments.reference)?);
    if image.eight_bit != reference.eight_bit {
        log.warning(
            "one of the images has 8 bits a value, which are cut off at white and may be tone-mapped, the other is linear light: \
             their figures say more of that than of the renders",
        );
    }
    let mut comparison = metric::compare(
        &image,
        own.as_ref().map(|errors| errors.pixels.as_slice()),
        &Reference {
            picture: &reference,
            second: second.as_ref(),
            errors: known.as_ref().map(|errors| errors.pixels.as_slice()),
        },
    );
    let filter = image.filter.as_ref().or(reference.filter.as_ref()).map(String::as_str);
    // Blocks of pixels that share are not tested by their own errors.
    let untested = filter.filter(|_| comparison.z_test.take().is_some());
    print(&match arguments.format {
        ReportFormat::Text => text(&comparison, untested),
        ReportFormat::Json => json(&comparison),
    })?;
    if let Some(output) = output {
        write_difference(&image, &reference, &output)?;
        log.verbose("the difference image is written");
    }
    judge(arguments, &comparison)
}

fn check_windows(image: &Picture, reference: &Picture) -> Result<(), Failure> {
    let (a, b) = (image.data_window, reference.data_window);
    if a == b {
        return Ok(());
    }
    let shown = |w: oiio::Window| format!("{} x {} from ({}, {})", w.width, w.height, w.x, w.y);
    Err(Failure::Input(format!(
        "the images cover different pixels: the first {}, the reference {}",
        shown(a),
        shown(b)
    )))
}

/// `untested`: the filter that leaves no test of the difference.
fn text(result: &Comparison, untested: Option<&str>) -> String {
    let ratio = |ratio: &Option<f64>| ratio.map_or("undefined".to_owned(), |ratio| format!("{ratio:.5}"));
    let [red, green, blue] = &result.relmse_channels;
    let [first, last] = result.flip_exposures;
    let mut text = format!(
        "pixels       {} x {}\nrelMSE       {:.6}   R {red:.6}  G {green:.6}  B {blue:.6}   best 99.9 %: {:.6}\n\
         RMSE         {:.6}\nmean ratio   R {}  G {}  B {}\nblocks       {:.3} %\nSSIM         {:.5}\nPSNR         {:.2} dB\n\
         HDR-FLIP     {:.5}   exposures {first:+.2} to {last:+.2}\nmax |I - R|  {:.6}\n\
         not finite   {} in the image, {} in the reference\n",
        result.resolution[0],
        result.resolution[1],
        result.relmse,
        result.relmse_best,
        result.rmse,
        ratio(&result.mean_ratio[0]),
        ratio(&result.mean_ratio[1]),
        ratio(&result.mean_ratio[2]),
        100.0 * result.block_difference,
        result.ssim,
        result.psnr,
        result.flip,
        result.max_difference,
        result.non_finite[0],
        result.non_finite[1],
    );
    if let Some(Prediction { relmse, coverage, interval: [low, high] }) = &result.predicted {
        text += &format!(
            "predicted    {relmse:.6}   by its layer \"error\", {}; measured with 95 % certainty {low:.6} to {high:.6}; {:.1} % of \
             the values are within 1.96 standard errors\n",
            match relmse {
                relmse if *relmse < *low => "too low",
                relmse if *relmse > *high => "too high",
                _ => "as measured",
            },
            100.0 * coverage
        );
    }
    if let Some(ZTest { frame, worst, blocks, p }) = &result.z_test {
        text += &format!("z            {frame:+.2}   worst of {blocks} blocks {worst:+.2}, p = {p:.2e}\n");
    }
    if let Some(filter) = untested {
        text += &format!("z            not tested: pixels that the filter \"{filter}\" made are not independent\n");
    }
    text
}

/// Infinite figures become `null`, as JSON has no other word for them.
fn json(result: &Comparison) -> String {
    let text = serde_json::to_string(result).expect("figures are plain data with text keys");
    text + "\n"
}

fn write_difference(image: &Picture, reference: &Picture, output: &OutputFile) -> Result<(), Failure> {
    let difference = |(i, r): (&[f32; 3], &[f32; 3])| {
        let signed = [i[0] - r[0], i[1] - r[1], i[2] - r[2]];
        let [x, y, z] = signed.map(f32::abs);
        [x, y, z, signed[0], signed[1], signed[2]]
    };
    let pixels: Vec<f32> = image.pixels.iter().zip(&reference.pixels).flat_map(difference).collect();
    let names = ["R", "G", "B", "signed.R", "signed.G", "signed.B"];
    let channel = |name: &str| Channel { name: name.to_owned(), format: Format::Float };
    let draft = output.draft()?;
    let written = oiio::write(&oiio::Output {
        path: draft.path(),
        file_format: oiio::FileFormat::Exr,
        data_window: reference.data_window,
        display_window: reference.display_window,
        channels: names.map(channel).into(),
        pixels: &pixels,
        attributes: vec![("Software".to_owned(), oiio::Attribute::Text(job::software()))],
        compression: oiio::Compression::Zip,
    });
    written.map_err(|error| Failure::Output(error.to_string()))?;
    output.publish(draft)
}

fn judge(arguments: &CompareArguments, result: &Comparison) -> Result<(), Failure> {
    let mut misses = Vec::new();
    let mut judge = |what: &str, found: f64, limit: Option<f64>| {
        if let Some(limit) = limit.filter(|&limit| found > limit || found.is_nan()) {
            misses.push(format!("{what} is {found:.6}, above {limit}"));
        }
    };
    let from_one = |ratio: &Option<f64>| ratio.map_or(f64::INFINITY, |ratio| (ratio - 1.0).abs());
    let furthest = result.mean_ratio.iter().map(from_one).fold(0.0, f64::max);
    judge("the relMSE", result.relmse, arguments.max_relmse);
    judge("the relMSE of the best 99.9 %", result.relmse_best, arguments.max_relmse_best);
    judge("the largest difference of a channel's mean", furthest, arguments.max_mean_difference);
    judge("the median difference of blocks", result.block_difference, arguments.max_block_difference);
    if result.non_finite != [0, 0] {
        misses.push("some pixels are not finite".into());
    }
    if misses.is_empty() { Ok(()) } else { Err(Failure::Quality(misses.join("; "))) }
}

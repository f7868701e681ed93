//! The metadata of images.

use std::time::{SystemTime, UNIX_EPOCH};

use oiio::Attribute;
use renderer::error::{Estimate, Goal};
use renderer::film::{Aov, cryptomatte};
use renderer::filtering::Filtering;
use renderer::frame::{Accumulation, FrameDescription, Past, Samples};
use renderer::render::Statistics;

use crate::{job, stats};

/// The image's metadata. It depends on the job alone, so that the same job gives the same bytes, unless there is
/// provenance: what it took. OpenEXR multiplies row vectors from the left, so the columns of our matrices are the rows of its.
pub fn of_frame(
    description: &FrameDescription,
    samples: &Samples,
    error: Option<&Estimate>,
    provenance: Option<&Statistics>,
) -> Vec<(String, Attribute)> {
    let mut attributes = of_samples(description, samples);
    if let Some(error) = error {
        let text = |x: String| Attribute::Text(x);
        let [low, high] = error.interval;
        attributes.push(("tessera/relMSE".into(), text(error.relmse.to_string())));
        attributes.push(("tessera/relMSE95".into(), text(format!("{low} {high}"))));
        attributes.push(("tessera/relativeNoise".into(), text(error.noise.to_string())));
    }
    if let Some(statistics) = provenance {
        add_provenance(&mut attributes, statistics);
    }
    attributes
}

/// Of a frame that others follow from: the first of those that it follows from itself.
pub fn of_past(past: &Past) -> (String, Attribute) {
    ("tessera/averagedSince".into(), Attribute::Int(past.since()))
}

/// The metadata of an image that more samples will follow.
pub fn of_accumulation(frame: &Accumulation) -> Vec<(String, Attribute)> {
    of_samples(&frame.description, &frame.samples)
}

fn of_samples(description: &FrameDescription, samples: &Samples) -> Vec<(String, Attribute)> {
    let text = |text: String| Attribute::Text(text);
    let mut attributes = vec![
        ("Software".into(), text(job::software())),
        ("DateTime".into(), text(job::date(std::env::var("SOURCE_DATE_EPOCH").ok().as_deref()))),
        ("chromaticities".into(), Attribute::Floats(REC709.into())),
        ("worldtocamera".into(), Attribute::Matrix(description.camera_from_world.as_mat4().to_cols_array())),
        ("samplesPerPixel".into(), Attribute::Int(i32::try_from(samples.count()).unwrap_or(i32::MAX))),
        ("tessera/version".into(), text(env!("CARGO_PKG_VERSION").into())),
        ("tessera/integrator".into(), text("path".into())),
        ("tessera/seed".into(), text(description.seed.to_string())),
        ("tessera/frame".into(), Attribute::Int(description.number)),
        ("tessera/filter".into(), text(filter_settings(&description.filtering))),
    ];
    for (aov, names) in [Aov::CryptoObject, Aov::CryptoMaterial].into_iter().zip(&description.names) {
        if description.aovs.contains(aov) {
            let entries = cryptomatte::metadata(aov.name(), names).into_iter();
            attributes.extend(entries.map(|(key, value)| (key, text(value))));
        }
    }
    attributes.extend(identity(description, samples).map(|(name, value)| (name.to_owned(), value)));
    if let Some(ndc_from_world) = description.ndc_from_world {
        let matrix = Attribute::Matrix(ndc_from_world.as_mat4().to_cols_array());
        attributes.push(("worldtoNDC".into(), matrix));
    }
    attributes
}

/// What tells the image from all others: which samples of what.
pub fn identity(description: &FrameDescription, samples: &Samples) -> [(&'static str, Attribute); 4] {
    let complete = samples.missing(&description.asked).is_empty();
    [
        ("tessera/sampleRange", Attribute::Text(samples.to_string())),
        ("tessera/complete", Attribute::Int(complete.into())),
        ("tessera/sceneHash", Attribute::Text(format!("{:016x}", description.scene_hash))),
        ("tessera/settingsHash", Attribute::Text(format!("{:016x}", settings_hash(description)))),
    ]
}

/// The goal at which an image ended before all its samples were taken; `None` if there is no goal.
pub fn reached(goal: &Goal) -> Option<(&'static str, Attribute)> {
    let relmse = goal.relmse.map(|relmse| format!("relMSE {relmse}"));
    let noise = goal.noise.map(|noise| format!("relativeNoise {noise}"));
    let text = [relmse, noise].into_iter().flatten().collect::<Vec<_>>().join(" ");
    (!text.is_empty()).then_some(("tessera/goal", Attribute::Text(text)))
}

/// Says that the image lacks no sample, as it reached its goal without.
pub fn add_reached(attributes: &mut Vec<(String, Attribute)>, goal: &Goal) {
    attributes.retain(|(name, _)| name != "tessera/complete");
    attributes.push(("tessera/complete".into(), Attribute::Int(1)));
    attributes.extend(reached(goal).map(|(name, value)| (name.to_owned(), value)));
}

/// Chromaticities of red, green, blue and white: ITU-R BT.709.
const REC709: [f32; 8] = [0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290];

/// A filter as the image's metadata name it: its name and all its settings.
pub fn filter_settings(filtering: &Filtering) -> String {
    let settings = filtering.settings().into_iter().map(|(key, value)| format!(" {key}={value}"));
    filtering.name().to_owned() + &settings.collect::<String>()
}

/// What two files must share, besides the scene, for their samples to belong to one picture: not the sample range.
fn settings_hash(description: &FrameDescription) -> u64 {
    let settings = description.settings().into_iter().filter(|(name, _)| *name != "scene");
    job::hash(settings.map(|(name, value)| format!("{name} {value}\n")).collect::<String>().as_bytes())
}

/// The first sample and one past the last.
pub fn span(samples: &Samples) -> [u64; 2] {
    let (first, last) = (samples.ranges().first(), samples.ranges().last());
    first.zip(last).map_or([0, 0], |(first, last)| [first.start, last.end])
}

fn add_provenance(attributes: &mut Vec<(String, Attribute)>, statistics: &Statistics) {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_secs());
    attributes.retain(|(name, _)| name != "DateTime");
    attributes.push(("DateTime".into(), Attribute::Text(job::exif_date(now))));
    if let Ok(host) = std::fs::read_to_string("/proc/sys/kernel/hostname") {
        attributes.push(("HostComputer".into(), Attribute::Text(host.trim().into())));
    }
    attributes.push(("renderTimeSeconds".into(), Attribute::Float(statistics.render_seconds as f32)));
    attributes.push(("tessera/threads".into(), Attribute::Int(statistics.threads as i32)));
    if let Some(bytes) = stats::peak_memory() {
        attributes.push(("tessera/peakRSS".into(), Attribute::Text(bytes.to_string())));
    }
}

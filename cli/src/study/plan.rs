//! What a study renders.

use renderer::film::MOST_TERMS;
use renderer::filtering::Filtering;

use crate::args::{FilterKind, StudyArguments};
use crate::exit::Failure;
use crate::job;

/// A way to render.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    /// As it is named on the page and in files.
    pub name: String,
    /// The filter.
    pub filtering: Filtering,
    /// How `render` is told.
    pub options: String,
}

/// A render of a setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Render {
    /// Index of its setting.
    pub setting: usize,
    /// Samples per pixel.
    pub spp: u64,
    /// Seed, from 1.
    pub seed: u64,
}

/// All renders of a study.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Settings, in the order of the page.
    pub settings: Vec<Setting>,
    /// Budgets, rising.
    pub budgets: Vec<u64>,
    /// Renders, cheap ones first.
    pub renders: Vec<Render>,
    /// Samples per pixel of each part of each half of the reference.
    pub reference: [Vec<u64>; 2],
}

/// The largest part of a reference: what an interruption may cost.
const PART_SPP: u64 = 512;
/// Up to this budget a setting is rendered with all seeds.
const ALL_SEEDS_SPP: u64 = 16;
/// Seeds of the reference's parts begin here, far from those of the renders.
pub const REFERENCE_SEED: u64 = 1 << 32;

impl Plan {
    /// What the command line asks for.
    ///
    /// # Errors
    /// Settings that a filter does not take; two of one name; more samples than a render takes.
    pub fn new(arguments: &StudyArguments) -> Result<Self, Failure> {
        let settings = settings(arguments)?;
        let mut budgets = arguments.spp.clone();
        budgets.sort_unstable();
        budgets.dedup();
        let largest = budgets.last().copied().unwrap_or(1);
        let most = largest.max(arguments.reference_spp.unwrap_or(1));
        if most > MOST_TERMS {
            return Err(Failure::Usage(format!("{most} samples per pixel are more than a render takes: {MOST_TERMS}")));
        }
        let mut renders = Vec::new();
        for &spp in &budgets {
            for seed in 1..=seeds(arguments.seeds, spp) {
                renders.extend((0..settings.len()).map(|setting| Render { setting, spp, seed }));
            }
        }
        let half = match arguments.reference.as_slice() {
            [] => parts(arguments.reference_spp.unwrap_or(4 * largest)),
            [_, _] => Vec::new(),
            other => {
                let count = other.len();
                return Err(Failure::Usage(format!("--reference takes two images, separated by a comma, not {count}")));
            }
        };
        Ok(Self { settings, budgets, renders, reference: [half.clone(), half] })
    }
}

impl Render {
    /// Name of its files, without an ending.
    pub fn name(&self, settings: &[Setting]) -> String {
        format!("{}-{:06}-{}", settings[self.setting].name, self.spp, self.seed)
    }
}

fn settings(arguments: &StudyArguments) -> Result<Vec<Setting>, Failure> {
    let plain = arguments.filter.iter().map(|&kind| (kind.name().to_owned(), kind, Vec::new()));
    let variants = arguments.variant.iter().map(|v| (v.name.clone(), v.filter, v.set.clone()));
    let mut settings: Vec<Setting> = Vec::new();
    for (name, kind, set) in plain.chain(variants) {
        if settings.iter().any(|setting| setting.name == name) {
            return Err(Failure::Usage(format!(
                "two settings are called {name}: give each --variant a name of its own"
            )));
        }
        settings.push(Setting { filtering: job::filter(kind, &set)?, options: options(kind, &set), name });
    }
    Ok(settings)
}

fn options(kind: FilterKind, set: &[(String, String)]) -> String {
    let set: Vec<String> = set.iter().map(|(key, value)| format!("{key}={value}")).collect();
    let filter = format!("--filter {}", kind.name());
    if set.is_empty() { filter } else { format!("{filter} --filter-set {}", set.join(",")) }
}

/// Renders of a budget: as many at 16 samples as asked for, above that as much work as that, but two to tell noise by.
fn seeds(asked: u64, spp: u64) -> u64 {
    (asked * ALL_SEEDS_SPP / spp.max(ALL_SEEDS_SPP)).max(2)
}

fn parts(spp: u64) -> Vec<u64> {
    let count = spp.div_ceil(PART_SPP);
    (0..count).map(|part| spp * (part + 1) / count - spp * part / count).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_budgets_have_fewer_seeds_but_two() {
        assert_eq!([1, 16, 32, 64, 4096].map(|spp| seeds(8, spp)), [8, 8, 4, 2, 2]);
    }

    #[test]
    fn parts_are_small_and_sum_to_the_whole() {
        for spp in [1, 512, 513, 5000] {
            let parts = parts(spp);
            assert_eq!(parts.iter().sum::<u64>(), spp);
            assert!(parts.iter().all(|part| (1..=PART_SPP).contains(part)), "{parts:?}");
        }
    }
}

//! What the settings of filters mean, one line each.

use super::Filtering;

/// A setting for people to read about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Explanation {
    /// Its name.
    pub key: &'static str,
    /// What it decides.
    pub about: &'static str,
    /// What it may be.
    pub values: &'static str,
    /// What it is.
    pub value: String,
}

impl Filtering {
    /// All settings, their values and what they mean.
    pub fn explained(&self) -> Vec<Explanation> {
        let about = |key| ABOUT.iter().find(|(known, _)| *known == key).map_or("", |(_, about)| about);
        let explanation = |(key, values, value)| Explanation { key, about: about(key), values, value };
        self.described().into_iter().map(explanation).collect()
    }
}

/// Cells are cubes of space that paths share their light in; sides of cells are in footprints, the widths of pixels on the
/// surface.
const ABOUT: &[(&str, &str)] = &[
    // Of the adaptive filter.
    ("trees", "shifted grids of cells at first vertices; more hide their borders and take memory"),
    ("reads", "of these, how many each sample reads; auto: few samples read more"),
    ("second_trees", "shifted grids at second vertices, each read by all"),
    (
        "leaf",
        "width of the finest cells at first vertices, footprints; wider take less memory, blur more; auto: by samples",
    ),
    ("second_leaf", "width of the cells at second vertices, footprints; auto: by samples"),
    (
        "epoch",
        "samples that share second vertices; slices are whole epochs; auto: an eighth of the samples, 4 at least",
    ),
    ("growing", "cells by the samples that there are rather than by those asked for; cannot be cut into slices"),
    ("certain", "standard errors by which cells must differ before the difference is kept; more smooths more"),
    ("inherited", "share of a difference that is expected to go on within a cell before it is seen"),
    ("trusted", "paths from which on the scatter within a cell is believed"),
    ("levels", "doublings of a cell's width that it may be averaged over"),
    ("doubt", "standard errors by which the filtered image must be wrong before the unfiltered one is taken"),
    // Of the talk's.
    ("vertex", "which vertex of a path is shared, mirrors and smooth glass not counted"),
    ("level", "how wide cells are: the same all over, by distance, or by footprint"),
    ("side", "width of a cell: world units (fixed), world units at distance 1 (distance), footprints (footprint)"),
    ("jitter", "how positions are moved at random before their cell is looked up, which hides borders"),
    ("jitter_radius", "how far they are moved, in sides of a cell"),
    ("normal_bins", "directions of normals that are told apart: bins along an edge of a cube; 0: none"),
    ("normal_jitter", "how far normals are moved at random, in bins"),
    ("surface", "whether different surfaces have cells of their own"),
    ("direction", "whether glossy light is told apart by its direction"),
    ("layers", "whether diffuse and glossy light are told apart"),
    ("glossy_finer", "how many times finer cells of glossy light are"),
    ("lookups", "levels of cells to choose from, from fine to coarse"),
    ("enough", "paths that make a level good enough to be chosen"),
    ("relative_variance", "largest variance of a level's mean over its square to be chosen"),
    ("probes", "slots of the table that a cell may look at"),
    ("table_size", "slots of the table over paths of a pass"),
    ("verification_bits", "bits that tell cells of one slot apart; fewer confuse them"),
    ("temporal", "weight of earlier frames in the average, as --temporal"),
    ("reading", "whether paths read their cell after their pass or after all passes"),
    ("eviction", "which cells make room in a full table"),
    ("patience", "passes that a cell may go unused before it makes room"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_setting_is_explained_and_nothing_else() {
        let mut keys: Vec<_> = Filtering::NAMES
            .iter()
            .flat_map(|name| Filtering::named(name).unwrap().explained())
            .map(|explanation| {
                assert!(!explanation.about.is_empty() && !explanation.values.is_empty(), "{explanation:?}");
                explanation.key
            })
            .collect();
        let mut known: Vec<_> = ABOUT.iter().map(|(key, _)| *key).collect();
        keys.sort_unstable();
        known.sort_unstable();
        assert_eq!(keys, known);
    }
}

//! Piecewise constant distributions over [0, 1)², built in `f64` from tabulated values.
//!
//! A value that is negative or not finite counts as 0. A table of zeros is a uniform distribution, so that sampling
//! never fails.

use glam::Vec2;

use crate::math::BELOW_ONE;

/// A density over [0, 1)² that is constant in each of `width` × `height` equal cells.
#[derive(Clone, Debug, PartialEq)]
pub struct PiecewiseConstant2D {
    /// Of the rows.
    marginal: Cdf,
    /// Of the cells in each row, row after row.
    rows: Cdf,
    width: usize,
}

/// Cumulative distributions, one after the other.
#[derive(Clone, Debug, Default, PartialEq)]
struct Cdf {
    /// Probability before bin i: for n bins n + 1 values from 0 to 1.
    values: Vec<f32>,
    /// Where to look in them: see [`push_index`].
    index: Vec<u32>,
}

impl Cdf {
    /// Appends the distribution proportional to `weights` and returns their sum.
    fn push(&mut self, weights: impl ExactSizeIterator<Item = f64> + Clone) -> f64 {
        let first = self.values.len();
        let sum = push_cdf(weights, &mut self.values);
        push_index(&self.values[first..], &mut self.index);
        sum
    }

    /// See [`invert`], for distribution `number` of those of as many bins.
    #[inline]
    fn invert(&self, bins: usize, number: usize, u: f32) -> (usize, f32) {
        let stride = entries(bins) + 1;
        invert(&self.values[number * (bins + 1)..][..bins + 1], &self.index[number * stride..][..stride], u)
    }
}

impl PiecewiseConstant2D {
    /// The density proportional to `values`, row by row from y = 0, each from x = 0; `None` if there are none.
    ///
    /// **Panics**: if `values` is not a whole number of rows of `width`.
    pub fn new(values: &[f32], width: usize) -> Option<Self> {
        if values.is_empty() {
            return None;
        }
        assert!(width > 0 && values.len() % width == 0, "{} values in rows of {width}", values.len());
        let (mut marginal, mut rows) = (Cdf::default(), Cdf::default());
        rows.values.reserve_exact(values.len() + values.len() / width);
        let sums: Vec<f64> = values.chunks_exact(width).map(|row| rows.push(row.iter().map(|&v| usable(v)))).collect();
        marginal.push(sums.iter().copied());
        Some(Self { marginal, rows, width })
    }

    /// The cell (x, y) that `u` in [0, 1)² falls into, and where in the cell, in [0, 1)². A cell of density 0 is never
    /// returned.
    ///
    /// `u.y` selects the row, `u.x` the place in it; strata of `u` stay in one piece.
    #[inline]
    pub fn sample_cell(&self, u: Vec2) -> ([usize; 2], Vec2) {
        let (row, y) = self.marginal.invert(self.marginal.values.len() - 1, 0, u.y);
        let (column, x) = self.rows.invert(self.width, row, u.x);
        ([column, row], Vec2::new(x, y))
    }
}

/// Probabilities that no uniform number tells from 0: those have 24 bits, so only u = 0 could ever fall on them, on bins
/// whose density may be too small for an `f32`.
const RESOLUTION: f64 = 1.0 / (1_u64 << 32) as f64;

/// Entries of the index of a distribution: one to eight bins, and a power of two, so that products with it are exact.
fn entries(bins: usize) -> usize {
    (bins / 8).next_power_of_two()
}

/// Appends the index of one row: entry k is the bin of the cumulative probability k/n, for k from 0 to n.
///
/// A search then begins next to its end. The index is small enough to stay in a cache where the distribution of a large
/// image does not, and it is the misses that cost.
///
/// **Source**: \[Chen74\], the method of guide tables.
fn push_index(cdf: &[f32], index: &mut Vec<u32>) {
    let n = entries(cdf.len() - 1);
    let inner = &cdf[1..cdf.len() - 1];
    index.extend((0..=n).map(|k| inner.partition_point(|&c| c <= k as f32 / n as f32) as u32));
}

fn usable(value: f32) -> f64 {
    if value > 0.0 && value.is_finite() { f64::from(value) } else { 0.0 }
}

/// Appends the cumulative distribution of one row, from exactly 0 to exactly 1, and returns the sum of its values.
fn push_cdf(values: impl ExactSizeIterator<Item = f64> + Clone, cdf: &mut Vec<f32>) -> f64 {
    let count = values.len() as f64;
    let total: f64 = values.clone().sum();
    let mut sum = 0.0;
    cdf.push(0.0);
    for (i, value) in values.enumerate() {
        sum += value;
        // The same sum in the same order: past the last positive value the quotient is exactly 1.
        let left = if total > 0.0 { sum / total } else { (i + 1) as f64 / count };
        cdf.push(if left < RESOLUTION { 0.0 } else { left as f32 });
    }
    total
}

/// The bin in which the cumulative probability reaches `u`, and how far into it, in [0, 1).
#[inline]
fn invert(cdf: &[f32], index: &[u32], u: f32) -> (usize, f32) {
    let u = u.clamp(0.0, BELOW_ONE);
    // The last bin that starts at or before u: it cannot be empty, since the next one starts after u.
    let entry = (u * (index.len() - 1) as f32) as usize;
    let (first, last) = (index[entry] as usize, index[entry + 1] as usize);
    let bin = first + cdf[first + 1..=last].partition_point(|&c| c <= u);
    let (low, high) = (cdf[bin], cdf[bin + 1]);
    (bin, ((u - low) / (high - low)).min(BELOW_ONE))
}

#[cfg(test)]
#[path = "piecewise_tests.rs"]
mod tests;

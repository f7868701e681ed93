//! Piecewise constant distributions over [0, 1) and [0, 1)², built in `f64` from tabulated values.
//!
//! A value that is negative or not finite counts as 0. A table of zeros is a uniform distribution, so that sampling
//! never fails; its integral is still 0.

use glam::Vec2;

/// A density over [0, 1) that is constant in each of n equal bins.
#[derive(Clone, Debug, PartialEq)]
pub struct PiecewiseConstant1D {
    /// Probability left of bin i: n + 1 values from 0 to 1.
    cdf: Box<[f32]>,
    /// Where to look in it: see [`push_index`].
    index: Box<[u32]>,
    /// Density in bin i.
    density: Box<[f32]>,
    integral: f64,
}

impl PiecewiseConstant1D {
    /// The density proportional to `values`; `None` if there are none.
    pub fn new(values: &[f32]) -> Option<Self> {
        Self::from_sums(values.iter().map(|&v| usable(v)))
    }

    fn from_sums(values: impl ExactSizeIterator<Item = f64> + Clone) -> Option<Self> {
        if values.len() == 0 {
            return None;
        }
        let mut cdf = Vec::with_capacity(values.len() + 1);
        let sum = push_cdf(values.clone(), &mut cdf);
        let bins = values.len() as f64;
        let density = values.map(|v| if sum > 0.0 { (v / sum * bins) as f32 } else { 1.0 }).collect();
        let mut index = Vec::new();
        push_index(&cdf, &mut index);
        Some(Self { cdf: cdf.into(), index: index.into(), density, integral: sum / bins })
    }

    /// The integral over [0, 1) of the function that was tabulated.
    pub fn integral(&self) -> f64 {
        self.integral
    }

    /// The number of bins: at least 1.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.density.len()
    }

    /// The point that `u` in [0, 1) maps to, its density, and its bin. A bin of density 0 is never returned.
    #[inline]
    pub fn sample(&self, u: f32) -> (f32, f32, usize) {
        let (x, bin) = invert_cdf(&self.cdf, &self.index, u);
        (x, self.density[bin], bin)
    }

    /// The density at `x`, 0 outside [0, 1).
    #[inline]
    pub fn pdf(&self, x: f32) -> f32 {
        bin_of(x, self.density.len()).map_or(0.0, |bin| self.density[bin])
    }

    /// The `u` that [`Self::sample`] maps to `x`, up to rounding: the cumulative probability at `x`.
    pub fn inverse(&self, x: f32) -> f32 {
        cumulative(&self.cdf, x)
    }
}

/// A density over [0, 1)² that is constant in each of `width` × `height` equal cells.
#[derive(Clone, Debug, PartialEq)]
pub struct PiecewiseConstant2D {
    /// Of y.
    marginal: PiecewiseConstant1D,
    /// Of x in each row: `width` + 1 values a row.
    cdf: Box<[f32]>,
    /// Where to look in each row.
    index: Box<[u32]>,
    /// Joint density, row by row.
    density: Box<[f32]>,
    width: usize,
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
        let height = values.len() / width;
        let mut cdf = Vec::with_capacity(height * (width + 1));
        let sums: Vec<f64> =
            values.chunks_exact(width).map(|row| push_cdf(row.iter().map(|&v| usable(v)), &mut cdf)).collect();
        let mut index = Vec::with_capacity(height * (entries(width) + 1));
        cdf.chunks_exact(width + 1).for_each(|row| push_index(row, &mut index));
        let marginal = PiecewiseConstant1D::from_sums(sums.iter().copied())?;
        let total: f64 = sums.iter().sum();
        let scale = values.len() as f64 / total;
        let density = values.iter().map(|&v| if total > 0.0 { (usable(v) * scale) as f32 } else { 1.0 }).collect();
        Some(Self { marginal, cdf: cdf.into(), index: index.into(), density, width })
    }

    /// The integral over [0, 1)² of the function that was tabulated.
    pub fn integral(&self) -> f64 {
        self.marginal.integral / self.width as f64
    }

    /// Width and height of the table.
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.marginal.len()]
    }

    /// The point that `u` in [0, 1)² maps to, its density, and its cell (x, y). A cell of density 0 is never returned.
    ///
    /// `u.y` selects the row, `u.x` the place in it; strata of `u` stay in one piece.
    #[inline]
    pub fn sample(&self, u: Vec2) -> (Vec2, f32, [usize; 2]) {
        let (y, row) = invert_cdf(&self.marginal.cdf, &self.marginal.index, u.y);
        let (x, column) = invert_cdf(self.row_cdf(row), self.row_index(row), u.x);
        (Vec2::new(x, y), self.density[row * self.width + column], [column, row])
    }

    /// The cell (x, y) in which [`Self::sample`] finds its point, and where in the cell, in [0, 1)².
    #[inline]
    pub fn sample_cell(&self, u: Vec2) -> ([usize; 2], Vec2) {
        let (row, y) = invert_to_bin(&self.marginal.cdf, &self.marginal.index, u.y);
        let (column, x) = invert_to_bin(self.row_cdf(row), self.row_index(row), u.x);
        ([column, row], Vec2::new(x, y))
    }

    /// The density at `p`, 0 outside [0, 1)².
    #[inline]
    pub fn pdf(&self, p: Vec2) -> f32 {
        match (bin_of(p.x, self.width), bin_of(p.y, self.marginal.len())) {
            (Some(column), Some(row)) => self.density[row * self.width + column],
            _ => 0.0,
        }
    }

    /// The `u` that [`Self::sample`] maps to `p`, up to rounding.
    pub fn inverse(&self, p: Vec2) -> Vec2 {
        let row = bin_of(p.y.clamp(0.0, BELOW_ONE), self.marginal.len()).unwrap_or(0);
        Vec2::new(cumulative(self.row_cdf(row), p.x), self.marginal.inverse(p.y))
    }

    #[inline]
    fn row_index(&self, row: usize) -> &[u32] {
        let stride = entries(self.width) + 1;
        &self.index[row * stride..][..stride]
    }

    #[inline]
    fn row_cdf(&self, row: usize) -> &[f32] {
        &self.cdf[row * (self.width + 1)..][..self.width + 1]
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

/// The largest `f32` below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

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

/// The bin of `x`, decided exactly: the product of an `f32` and a count below 2²⁹ has no rounding in `f64`.
#[inline]
fn bin_of(x: f32, bins: usize) -> Option<usize> {
    (0.0..1.0).contains(&x).then(|| (f64::from(x) * bins as f64) as usize)
}

/// The bin in which the cumulative probability reaches `u`, and how far into it, in [0, 1).
#[inline]
fn invert_to_bin(cdf: &[f32], index: &[u32], u: f32) -> (usize, f32) {
    let u = u.clamp(0.0, BELOW_ONE);
    // The last bin that starts at or before u: it cannot be empty, since the next one starts after u.
    let entry = (u * (index.len() - 1) as f32) as usize;
    let (first, last) = (index[entry] as usize, index[entry + 1] as usize);
    let bin = first + cdf[first + 1..=last].partition_point(|&c| c <= u);
    let (low, high) = (cdf[bin], cdf[bin + 1]);
    (bin, ((u - low) / (high - low)).min(BELOW_ONE))
}

/// The `x` whose cumulative probability is `u`, and its bin.
#[inline]
fn invert_cdf(cdf: &[f32], index: &[u32], u: f32) -> (f32, usize) {
    let bins = cdf.len() - 1;
    let (bin, within) = invert_to_bin(cdf, index, u);
    let x = ((bin as f64 + f64::from(within)) / bins as f64) as f32;
    // Rounding can leave the bin by an ulp at either end; there the density would be another. x is not negative, so the
    // neighbouring floats have neighbouring bits.
    let x = x.min(BELOW_ONE);
    match bin_of(x, bins) {
        Some(found) if found > bin => (f32::from_bits(x.to_bits() - 1), bin),
        Some(found) if found < bin => (f32::from_bits(x.to_bits() + 1), bin),
        _ => (x, bin),
    }
}

fn cumulative(cdf: &[f32], x: f32) -> f32 {
    let bins = cdf.len() - 1;
    match bin_of(x, bins) {
        Some(bin) => {
            let within = (f64::from(x) * bins as f64 - bin as f64) as f32;
            cdf[bin] + (cdf[bin + 1] - cdf[bin]) * within
        }
        None if x >= 1.0 => 1.0,
        None => 0.0,
    }
}

#[cfg(test)]
#[path = "piecewise_tests.rs"]
mod tests;

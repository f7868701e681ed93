//! Small tables over cosθ and over the roughness of a coat.

/// What a table may hold: numbers, or several together.
pub(super) trait Entry:
    Copy + Default + std::ops::Add<Output = Self> + std::ops::Sub<Output = Self> + std::ops::Mul<f32, Output = Self>
{
}

impl Entry for f32 {}
impl Entry for glam::Vec2 {}

/// Function of cosθ in [0, 1], piecewise linear between values at multiples of 1/`INTERVALS`.
///
/// The curvature of what is tabulated here reaches that of Schlick's (1 − cosθ)⁵, 20, so an interpolated value is wrong
/// by at most 20/(8 · 64²) < 0.001.
#[derive(Clone, Debug)]
pub(super) struct CosineTable<T = f32> {
    /// The last value stands twice, so that interpolation needs no branch at cosθ = 1.
    values: [T; INTERVALS + 2],
}

/// Intervals of a [`CosineTable`].
pub(super) const INTERVALS: usize = 64;

impl<T: Entry> CosineTable<T> {
    /// Tabulates `f`.
    pub fn new(mut f: impl FnMut(f32) -> T) -> Self {
        let mut values = [T::default(); INTERVALS + 2];
        for (i, value) in values[..=INTERVALS].iter_mut().enumerate() {
            *value = f(i as f32 / INTERVALS as f32);
        }
        values[INTERVALS + 1] = values[INTERVALS];
        Self { values }
    }

    /// Value at cosθ, clamped to [0, 1].
    #[inline]
    pub fn at(&self, cos_theta: f32) -> T {
        let x = cos_theta.clamp(0.0, 1.0) * INTERVALS as f32;
        let i = x as usize;
        let (a, b) = (self.values[i], self.values[i + 1]);
        a + (b - a) * (x - i as f32)
    }

    /// One of the functions that are tabulated together.
    pub fn map(&self, f: impl Fn(T) -> f32) -> CosineTable {
        CosineTable { values: self.values.map(f) }
    }
}

impl CosineTable {
    /// ∫ 2μ f(μ) dμ: the mean under Lambertian illumination. By Simpson's rule on the nodes, which is exact for the
    /// linear pieces times μ when their midpoints are interpolated.
    pub fn cosine_mean(&self) -> f32 {
        let h = 1.0 / INTERVALS as f64;
        let piece = |i: usize| {
            let (x, a, b) = (i as f64 * h, f64::from(self.values[i]), f64::from(self.values[i + 1]));
            h / 6.0 * 2.0 * (x * a + 4.0 * (x + 0.5 * h) * 0.5 * (a + b) + (x + h) * b)
        };
        (0..INTERVALS).map(piece).sum::<f64>() as f32
    }
}

/// The widths alpha for which tables exist, ascending.
#[derive(Clone, Debug)]
pub(super) struct Axis(Vec<f32>);

/// Between entry `index` and the one after it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Position {
    pub index: u32,
    /// 0 at `index`, below 1.
    pub fraction: f32,
}

impl Axis {
    /// For a surface of one width: that, and what regularisation makes of it.
    pub fn constant(alpha: f32) -> Self {
        let regularized = super::microfacet::regularized_alpha(alpha);
        Self(if regularized > alpha { vec![alpha, regularized] } else { vec![alpha] })
    }

    /// For textured widths: `nodes`, ascending.
    pub fn textured(nodes: &[f32]) -> Self {
        Self(nodes.to_vec())
    }

    pub fn nodes(&self) -> &[f32] {
        &self.0
    }

    /// Where `alpha` lies; clamped to the ends.
    #[inline]
    pub fn locate(&self, alpha: f32) -> Position {
        let above = self.0.iter().position(|&node| node > alpha).unwrap_or(self.0.len());
        let Some(index) = above.checked_sub(1) else { return Position::default() };
        let fraction = self.0.get(above).map_or(0.0, |&next| (alpha - self.0[index]) / (next - self.0[index]));
        Position { index: index as u32, fraction }
    }
}

/// `f` of the entry of `rows`, interpolated between two where the position lies between them.
#[inline]
pub(super) fn blend<R, T: Entry>(rows: &[R], position: Position, f: impl Fn(&R) -> T) -> T {
    let index = position.index as usize;
    let a = f(&rows[index]);
    if position.fraction == 0.0 { a } else { a + (f(&rows[index + 1]) - a) * position.fraction }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_interpolate_and_average() {
        let table = CosineTable::new(|x| 1.0 - x);
        assert!((table.at(0.3) - 0.7).abs() < 1e-6);
        assert_eq!((table.at(1.0), table.at(7.0), table.at(-1.0)), (0.0, 0.0, 1.0));
        // ∫ 2μ(1 − μ) dμ = 1/3.
        assert!((table.cosine_mean() - 1.0 / 3.0).abs() < 1e-6);
    }

    #[test]
    fn an_axis_locates_and_clamps() {
        let axis = Axis::textured(&[0.0, 0.1, 0.5]);
        let rows = [0.0, 1.0, 2.0];
        for (alpha, expected) in [(-1.0, 0.0), (0.0, 0.0), (0.05, 0.5), (0.1, 1.0), (0.3, 1.5), (0.5, 2.0), (3.0, 2.0)]
        {
            assert!((blend(&rows, axis.locate(alpha), |&x| x) - expected).abs() < 1e-6, "{alpha}");
        }
        let axis = Axis::constant(0.05);
        assert_eq!((axis.locate(0.05).index, axis.locate(0.1).index, axis.locate(0.1).fraction), (0, 1, 0.0));
    }
}

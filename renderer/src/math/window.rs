//! Sums over the surroundings of pixels.

use std::ops::Add;

use rayon::prelude::*;

/// What `of` makes of the sum over each value's window, `radius` to each side and cut off at the borders, and of the number of
/// values in it. Values are row by row.
pub fn windows<T: Copy + Default + Add<Output = T> + Send + Sync, U: Send>(
    values: Vec<T>,
    width: usize,
    radius: usize,
    of: impl Fn(T, usize) -> U + Sync,
) -> Vec<U> {
    let height = values.len() / width.max(1);
    let near = |at: usize, size: usize| at.saturating_sub(radius)..(at + radius + 1).min(size);
    let all = (0..values.len()).into_par_iter();
    let row = |i: usize| near(i % width, width).map(|x| values[i / width * width + x]).fold(T::default(), T::add);
    let rows: Vec<T> = all.clone().map(row).collect();
    // Before the results need room.
    drop(values);
    all.map(|i| {
        let (columns, lines) = (near(i % width, width), near(i / width, height));
        let count = columns.len() * lines.len();
        of(lines.map(|y| rows[y * width + i % width]).fold(T::default(), T::add), count)
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_are_sums_cut_off_at_the_borders() {
        let values: Vec<i64> = (0..35).map(|i| i * i % 11).collect();
        for radius in [0, 1, 3, 9] {
            let expected = (0..35).map(|i| {
                let near = |j: &usize| (j % 7).abs_diff(i % 7) <= radius && (j / 7).abs_diff(i / 7) <= radius;
                let window: Vec<i64> = (0..35).filter(near).map(|j| values[j]).collect();
                (window.iter().sum(), window.len())
            });
            assert_eq!(windows(values.clone(), 7, radius, |sum, n| (sum, n)), expected.collect::<Vec<(i64, usize)>>());
        }
        assert!(windows(Vec::<i64>::new(), 0, 1, |sum, _| sum).is_empty());
    }
}

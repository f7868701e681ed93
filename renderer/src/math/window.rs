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

/// Sums over windows thrice the side of those that `windows` are the sums over, row by row: `side` pixels each way, around
/// each pixel.
///
/// At the borders windows are moved inside. Where all is narrower than the window, it stays as wide as it was.
pub fn widened<T: Copy + Add<Output = T> + Send + Sync>(windows: &[T], width: usize, side: usize) -> Vec<T> {
    let height = windows.len() / width.max(1);
    // The three windows side by side that make the wide one around `at`.
    let three = |at: usize, size: usize| {
        let reach = side + side / 2;
        (size >= 3 * side)
            .then(|| at.clamp(reach, size - 1 - reach))
            .map(|center| [center - side, center, center + side])
    };
    let sum = |values: &[T], at: usize, along: Option<[usize; 3]>, index: &dyn Fn(usize) -> usize| match along {
        Some([a, b, c]) => values[index(a)] + values[index(b)] + values[index(c)],
        None => values[at],
    };
    let all = (0..windows.len()).into_par_iter();
    let rows: Vec<T> =
        all.clone().map(|i| sum(windows, i, three(i % width, width), &|x| i / width * width + x)).collect();
    all.map(|i| sum(&rows, i, three(i / width, height), &|y| y * width + i % width)).collect()
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

    #[test]
    fn windows_widen_and_are_moved_inside() {
        let (width, height) = (31, 11);
        let values: Vec<u64> = (0..width * height).map(|i| (i * i % 101) as u64).collect();
        let mut windows = values.clone();
        for side in [1, 3, 9] {
            windows = widened(&windows, width, side);
            let range = |at: usize, size: usize| {
                // Of 11 lines no window is 27 high.
                let side = if size < 3 * side { side } else { 3 * side };
                let first = at.saturating_sub(side / 2).min(size - side);
                first..first + side
            };
            for (i, &sum) in windows.iter().enumerate() {
                let lines = range(i / width, height);
                let expected: u64 =
                    lines.map(|y| range(i % width, width).map(|x| values[y * width + x]).sum::<u64>()).sum();
                assert_eq!(sum, expected, "{side} {i}");
            }
        }
        assert!(widened::<u64>(&[], 0, 1).is_empty());
    }
}

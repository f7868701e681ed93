//! Sums over the surroundings of pixels.

use std::collections::VecDeque;
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

/// Sums over windows thrice the side of those that some rows are the sums over: `side` pixels each way, around each pixel.
/// Rows come and go in order, so that of a large image only those are held that the windows reach over.
///
/// At the borders windows are moved inside. Where all is narrower than the window, it stays as wide as it was.
pub struct Widening<T> {
    side: usize,
    height: usize,
    /// Rows whose windows are wide, but not yet high, from row `first` on.
    rows: VecDeque<Vec<T>>,
    first: usize,
    /// The next row that comes out.
    next: usize,
}

impl<T: Copy + Add<Output = T> + Send + Sync> Widening<T> {
    /// No row yet, of `height`.
    pub fn new(side: usize, height: usize) -> Self {
        Self { side, height, rows: VecDeque::new(), first: 0, next: 0 }
    }

    /// Takes the next rows; those that are known by now.
    pub fn push<'r>(&mut self, rows: impl IndexedParallelIterator<Item = &'r Vec<T>>) -> Vec<Vec<T>>
    where
        T: 'r,
    {
        let wide = |row: &Vec<T>| {
            let sum = |x: usize| match self.three(x, row.len()) {
                Some([a, b, c]) => row[a] + row[b] + row[c],
                None => row[x],
            };
            (0..row.len()).map(sum).collect()
        };
        let rows: Vec<Vec<T>> = rows.map(wide).collect();
        self.rows.extend(rows);
        let known = self.first + self.rows.len();
        let reach = |y: usize| self.three(y, self.height).map_or(y, |[.., last]| last);
        let end = (self.next..self.height).find(|y| reach(*y) >= known).unwrap_or(self.height);
        let row = |y: usize| &self.rows[y - self.first];
        let high = |y: usize| match self.three(y, self.height) {
            Some([a, b, c]) => (0..row(b).len()).map(|x| row(a)[x] + row(b)[x] + row(c)[x]).collect(),
            None => row(y).clone(),
        };
        let out = (self.next..end).into_par_iter().map(high).collect();
        self.next = end;
        let needed = self.three(end, self.height).map_or(end, |[first, ..]| first).min(known);
        self.rows.drain(..needed - self.first);
        self.first = needed;
        out
    }

    /// The three windows side by side that make the wide one around `at`.
    fn three(&self, at: usize, size: usize) -> Option<[usize; 3]> {
        let (side, reach) = (self.side, self.side + self.side / 2);
        let center = (size >= 3 * side).then(|| at.clamp(reach, size - 1 - reach))?;
        Some([center - side, center, center + side])
    }
}

/// All of [`Widening`]'s rows at once, from and to pixels row by row.
pub fn widened<T: Copy + Add<Output = T> + Send + Sync>(windows: &[T], width: usize, side: usize) -> Vec<T> {
    let rows: Vec<Vec<T>> = windows.chunks(width.max(1)).map(<[T]>::to_vec).collect();
    Widening::new(side, rows.len()).push(rows.par_iter()).concat()
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
            let before = windows;
            windows = widened(&before, width, side);
            let range = |at: usize, size: usize| {
                // Of 11 lines no window is 27 high.
                let side = if size < 3 * side { side } else { 3 * side };
                let first = at.saturating_sub(side / 2).min(size - side);
                first..first + side
            };
            // The same row by row, and by more of them than there are windows.
            for rows in [1, 4, 100] {
                let mut widening = Widening::new(side, height);
                let before: Vec<Vec<u64>> = before.chunks(width).map(<[u64]>::to_vec).collect();
                let out = before.chunks(rows).flat_map(|rows| widening.push(rows.par_iter())).flatten();
                assert_eq!(out.collect::<Vec<_>>(), windows, "{side}, {rows} rows");
            }
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

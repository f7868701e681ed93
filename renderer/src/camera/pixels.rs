//! Which pixels of the frame are rendered.

/// The pixels `[min, max)` of a frame that a crop window and pixel bounds leave, `[x, y]` each; `None` if none is left.
///
/// `crop` is x0 x1 y0 y1 as fractions of the frame, y down; a pixel belongs to it when its upper left corner does, so
/// that abutting crops share no pixel and miss none. `bounds` is x0 x1 y0 y1 in pixels, upper ends exclusive, and wins
/// over `crop`. Without either it is the frame and `overscan` pixels around it; what lies outside of that is cut off.
/// Columns and rows that come back begin with those of the overscan, so that none is negative.
///
/// **Source**: pbrt-v4's film, by behaviour.
pub fn rendered_pixels(
    resolution: [u32; 2],
    overscan: u32,
    crop: Option<[f32; 4]>,
    bounds: Option<[i32; 4]>,
) -> Option<[[u32; 2]; 2]> {
    let [x, y] = if let Some([x0, x1, y0, y1]) = bounds {
        let cut = |a: i32, b: i32, size: u32| {
            let (offset, end) = (i64::from(overscan), i64::from(size) + 2 * i64::from(overscan));
            [a, b].map(|at| (i64::from(at) + offset).clamp(0, end) as u32)
        };
        [cut(x0, x1, resolution[0]), cut(y0, y1, resolution[1])]
    } else if let Some([x0, x1, y0, y1]) = crop {
        // In f32, as the numbers were written: in f64 the crop 0.1 of 640 pixels would start at pixel 65.
        let cut = |a: f32, b: f32, size: u32| {
            [a.min(b), a.max(b)].map(|at| (size as f32 * at.clamp(0.0, 1.0)).ceil() as u32 + overscan)
        };
        [cut(x0, x1, resolution[0]), cut(y0, y1, resolution[1])]
    } else {
        resolution.map(|size| [0, size + 2 * overscan])
    };
    (x[0] < x[1] && y[0] < y[1]).then_some([[x[0], y[0]], [x[1], y[1]]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crops_that_abut_tile_the_frame() {
        for width in [1, 7, 640, 1921] {
            for cuts in 1..=13 {
                let mut next = 0;
                for k in 0..cuts {
                    let crop = [k as f32 / cuts as f32, (k + 1) as f32 / cuts as f32, 0.0, 1.0];
                    if let Some([min, max]) = rendered_pixels([width, 3], 0, Some(crop), None) {
                        assert_eq!((min[0], min[1], max[1]), (next, 0, 3));
                        next = max[0];
                    }
                }
                assert_eq!(next, width);
            }
        }
    }

    #[test]
    fn a_tenth_of_the_frame_starts_at_a_tenth() {
        assert_eq!(rendered_pixels([640, 360], 0, Some([0.1, 0.9, 0.25, 0.5]), None), Some([[64, 90], [576, 180]]));
    }

    #[test]
    fn what_is_around_the_frame_comes_before_it() {
        let pixels = |crop, bounds| rendered_pixels([64, 32], 8, crop, bounds);
        assert_eq!(pixels(None, None), Some([[0, 0], [80, 48]]));
        assert_eq!(pixels(Some([0.0, 0.5, 0.0, 1.0]), None), Some([[8, 8], [40, 40]]));
        assert_eq!(pixels(None, Some([-4, 70, -30, 31])), Some([[4, 0], [78, 39]]));
    }

    #[test]
    fn bounds_win_and_are_cut_to_the_frame() {
        let pixels = rendered_pixels([64, 32], 0, Some([0.0, 0.5, 0.0, 0.5]), Some([-4, 70, 30, 31]));
        assert_eq!(pixels, Some([[0, 30], [64, 31]]));
    }

    #[test]
    fn nothing_is_left_of_empty_reversed_or_foreign_bounds() {
        assert_eq!(rendered_pixels([64, 32], 0, None, Some([8, 8, 0, 32])), None);
        assert_eq!(rendered_pixels([64, 32], 0, None, Some([9, 8, 0, 32])), None);
        assert_eq!(rendered_pixels([64, 32], 0, None, Some([64, 80, 0, 32])), None);
        assert_eq!(rendered_pixels([64, 32], 0, Some([1.5, 2.0, 0.0, 1.0]), None), None);
        assert_eq!(rendered_pixels([64, 32], 0, Some([f32::NAN; 4]), None), None);
    }
}

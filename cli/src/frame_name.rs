//! Frame numbers in output names.

use std::ffi::OsString;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};

/// `path` with the frame number in place of every `####` (as many digits as signs) and `%04d` or `%d` in its file name;
/// `%%` is a single `%`. Folders are left alone.
pub fn with_frame(path: &Path, frame: i32) -> PathBuf {
    let Some(name) = path.file_name() else { return path.to_owned() };
    let mut rest = name.as_bytes();
    let mut framed = Vec::with_capacity(rest.len() + 8);
    while let Some(&first) = rest.first() {
        let (length, text) = match first {
            b'#' => {
                let width = rest.iter().take_while(|&&b| b == b'#').count();
                (width, padded(frame, width))
            }
            b'%' => percent(rest, frame).unwrap_or((1, "%".into())),
            other => {
                framed.push(other);
                rest = &rest[1..];
                continue;
            }
        };
        framed.extend_from_slice(text.as_bytes());
        rest = &rest[length..];
    }
    path.with_file_name(OsString::from_vec(framed))
}

/// The length of the conversion that `text` starts with, and what it becomes; `None` if it is not one of ours.
fn percent(text: &[u8], frame: i32) -> Option<(usize, String)> {
    if text.get(1) == Some(&b'%') {
        return Some((2, "%".into()));
    }
    let digits = text[1..].iter().take_while(|b| b.is_ascii_digit()).count();
    // Two digits pad to 99 places, which is more than a file name needs.
    if digits > 2 || text.get(1 + digits) != Some(&b'd') {
        return None;
    }
    let width = text[1..=digits].iter().fold(0, |width, digit| 10 * width + usize::from(digit - b'0'));
    Some((digits + 2, padded(frame, width)))
}

/// At least `width` characters, sign included, as printf does.
fn padded(frame: i32, width: usize) -> String {
    format!("{frame:0width$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_notations_are_padded() {
        for (pattern, frame, name) in [
            ("shot.####.exr", 7, "shot.0007.exr"),
            ("shot.%04d.exr", 7, "shot.0007.exr"),
            ("shot.%d.exr", 123, "shot.123.exr"),
            ("shot_##_%03d.exr", 12345, "shot_12345_12345.exr"),
            ("shot.####.exr", -5, "shot.-005.exr"),
            ("100%%.%02d.exr", 1, "100%.01.exr"),
            ("50%off %x %1234d.exr", 1, "50%off %x %1234d.exr"),
            ("plain.exr", 9, "plain.exr"),
            ("dir.####/plain.exr", 9, "dir.####/plain.exr"),
            ("%", 9, "%"),
        ] {
            assert_eq!(with_frame(Path::new(pattern), frame), Path::new(name), "{pattern}");
        }
    }
}

//! Frame numbers of a sequence, in the notations of farms and compositors.

use std::fmt::Write;
use std::str::FromStr;

use thiserror::Error;

/// More frames than a film has; a slip of the keyboard has more.
const MOST: usize = 1 << 20;

/// Frames in the order in which they were named, each once: `1-100x10,1-100` renders every tenth frame first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frames(Vec<i32>);

/// Why a text does not name frames.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum FramesError {
    /// Nothing is named.
    #[error("no frame is named; expected such as 1-10, 1-10:2 or 1,4,7")]
    Empty,
    /// A part of the list is in no notation.
    #[error("\"{0}\" names no frames; expected such as 7, -3--1, 1-10:2, 1-10x2 or 1..5")]
    Syntax(String),
    /// A range never reaches its end.
    #[error("\"{0}\" leads nowhere: its step is zero or points away from the range's end")]
    Step(String),
    /// More frames than anyone means.
    #[error("these are more than {MOST} frames")]
    TooMany,
}

impl Frames {
    /// The numbers, at least one.
    pub fn numbers(&self) -> &[i32] {
        &self.0
    }

    /// The same frames in ascending order as a range expression of Open Job Description, which allows no overlaps.
    pub fn ascending(&self) -> String {
        let mut sorted = self.0.clone();
        sorted.sort_unstable();
        let mut text = String::new();
        let mut rest = &sorted[..];
        while let Some(&first) = rest.first() {
            let (length, step) = run(rest);
            let comma = if text.is_empty() { "" } else { "," };
            write!(text, "{comma}{first}").expect("a string takes all text");
            if length > 1 {
                write!(text, "-{}", rest[length - 1]).expect("a string takes all text");
            }
            if step > 1 {
                write!(text, ":{step}").expect("a string takes all text");
            }
            rest = &rest[length..];
        }
        text
    }
}

/// How many of the first of `sorted` are at one distance from each other, and that distance. Two that are not neighbours
/// are no range.
fn run(sorted: &[i32]) -> (usize, i64) {
    let distance = |pair: &[i32]| i64::from(pair[1]) - i64::from(pair[0]);
    let Some(step) = sorted.get(..2).map(distance) else { return (1, 1) };
    let length = 1 + sorted.windows(2).take_while(|pair| distance(pair) == step).count();
    if length == 2 && step > 1 { (1, 1) } else { (length, step) }
}

impl FromStr for Frames {
    type Err = FramesError;

    /// A list, separated by commas, of numbers and of ranges with both ends included: `A-B`, `A-B:STEP` (Open Job
    /// Description), `A-BxSTEP` (Deadline, Nuke), `A..B` (Blender). Numbers and steps may be negative.
    fn from_str(text: &str) -> Result<Self, FramesError> {
        if text.trim().is_empty() {
            return Err(FramesError::Empty);
        }
        let mut numbers = Vec::new();
        let mut seen = std::collections::BTreeSet::new();
        for item in text.split(',').map(str::trim) {
            for frame in range(item)? {
                if numbers.len() == MOST {
                    return Err(FramesError::TooMany);
                }
                if seen.insert(frame) {
                    numbers.push(frame);
                }
            }
        }
        Ok(Self(numbers))
    }
}

/// The frames of one item of the list.
fn range(item: &str) -> Result<impl Iterator<Item = i32> + use<>, FramesError> {
    let syntax = || FramesError::Syntax(item.to_owned());
    let (first, rest) = number(item).ok_or_else(syntax)?;
    let (last, step) = match rest.strip_prefix("..").or_else(|| rest.strip_prefix('-')) {
        None if rest.is_empty() => (first, 1),
        None => return Err(syntax()),
        Some(rest) => {
            let (last, rest) = number(rest).ok_or_else(syntax)?;
            match rest.strip_prefix([':', 'x']).map(number) {
                None if rest.is_empty() => (last, 1),
                Some(Some((step, ""))) => (last, step),
                _ => return Err(syntax()),
            }
        }
    };
    // In 64 bits, where the ends of 32-bit ranges cannot overflow.
    let (first, last, step) = (i64::from(first), i64::from(last), i64::from(step));
    if step == 0 || (last - first).signum() == -step.signum() {
        return Err(FramesError::Step(item.to_owned()));
    }
    let count = (last - first) / step + 1;
    if count > MOST as i64 {
        return Err(FramesError::TooMany);
    }
    Ok((0..count).map(move |k| i32::try_from(first + k * step).expect("between two numbers of 32 bits")))
}

/// The number at the start of `text`, and what follows it.
fn number(text: &str) -> Option<(i32, &str)> {
    let sign = usize::from(text.starts_with('-'));
    let digits = text[sign..].bytes().take_while(u8::is_ascii_digit).count();
    let (number, rest) = text.split_at(sign + digits);
    Some((number.parse().ok()?, rest))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn frames(text: &str) -> Vec<i32> {
        text.parse::<Frames>().unwrap_or_else(|why| panic!("{text}: {why}")).0
    }

    #[test]
    fn all_notations_are_understood() {
        for (text, numbers) in [
            ("7", &[7][..]),
            ("-7", &[-7]),
            ("1-5", &[1, 2, 3, 4, 5]),
            ("1-5:2,7,-3--1", &[1, 3, 5, 7, -3, -2, -1]),
            ("1-10x2", &[1, 3, 5, 7, 9]),
            ("1..5", &[1, 2, 3, 4, 5]),
            ("-2..1", &[-2, -1, 0, 1]),
            ("-2..-1", &[-2, -1]),
            ("3-3", &[3]),
            ("10-12", &[10, 11, 12]),
            (" 1 , 4 ", &[1, 4]),
            ("5-1:-2", &[5, 3, 1]),
            ("2147483646-2147483647", &[i32::MAX - 1, i32::MAX]),
            ("-2147483648", &[i32::MIN]),
            ("-2147483648-2147483647:2147483647", &[i32::MIN, -1, i32::MAX - 1]),
        ] {
            assert_eq!(frames(text), numbers, "{text}");
        }
    }

    #[test]
    fn frames_come_in_the_order_of_their_names_and_once() {
        assert_eq!(frames("1-7x3,1-7"), [1, 4, 7, 2, 3, 5, 6]);
    }

    #[test]
    fn what_names_no_frames_is_refused() {
        use FramesError::{Empty, Step, Syntax, TooMany};
        for (text, why) in [
            ("", Empty),
            (" ", Empty),
            ("1,", Syntax(String::new())),
            ("a", Syntax("a".into())),
            ("1-", Syntax("1-".into())),
            ("--1", Syntax("--1".into())),
            ("1-5:", Syntax("1-5:".into())),
            ("1:2", Syntax("1:2".into())),
            ("1-5:2:2", Syntax("1-5:2:2".into())),
            ("1.5", Syntax("1.5".into())),
            ("1...5", Syntax("1...5".into())),
            ("é", Syntax("é".into())),
            ("2147483648", Syntax("2147483648".into())),
            ("1-5:0", Step("1-5:0".into())),
            ("5-1", Step("5-1".into())),
            ("1-5:-1", Step("1-5:-1".into())),
            ("1-2000000", TooMany),
            ("1-1000000,2000001-3000000", TooMany),
        ] {
            assert_eq!(text.parse::<Frames>(), Err(why), "{text}");
        }
    }

    #[test]
    fn ascending_ranges_are_short() {
        for (text, ascending) in [
            ("4", "4"),
            ("3,2,1", "1-3"),
            ("1-10x2", "1-9:2"),
            ("1,5", "1,5"),
            ("1,2,3,5,7,9,20", "1-3,5-9:2,20"),
            ("-1,-2,-3", "-3--1"),
            ("1-7x3,1-7", "1-7"),
        ] {
            assert_eq!(text.parse::<Frames>().unwrap().ascending(), ascending, "{text}");
        }
    }

    proptest! {
        #[test]
        fn the_ascending_text_names_the_same_frames(numbers in prop::collection::vec(-50_i32..50, 1..40)) {
            let text: Vec<_> = numbers.iter().map(i32::to_string).collect();
            let named: Frames = text.join(",").parse().unwrap();
            let mut sorted = numbers;
            sorted.sort_unstable();
            sorted.dedup();
            prop_assert_eq!(frames(&named.ascending()), sorted);
        }
    }
}

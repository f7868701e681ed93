//! Pairs in few bytes: a frame keeps millions of them, and seldom looks at them.

use crate::pairs::Pair;

/// Pairs in the order in which they were appended, which is best that of slots and cells: some 4 bytes each where throughput
/// is that of the pair before, 7 where it is grey and 13 where it is not, instead of 20.
#[derive(Debug, Default)]
pub(crate) struct PackedPairs {
    bytes: Vec<u8>,
    len: usize,
    /// The last one, from which the next is told.
    last: Pair,
}

/// How many bytes throughput has in a channel, by code: none if it is as expected.
const WIDTHS: [usize; 4] = [0, 2, 3, 4];

impl PackedPairs {
    /// Appends pairs.
    pub fn extend(&mut self, pairs: &[Pair]) {
        let mut bytes = Vec::with_capacity(13 * pairs.len());
        for pair in pairs {
            pack(pair, &self.last, &mut bytes);
            self.last = *pair;
        }
        self.len += pairs.len();
        self.bytes.reserve_exact(bytes.len());
        self.bytes.extend_from_slice(&bytes);
    }

    /// All pairs, as they were appended.
    pub fn iter(&self) -> impl Iterator<Item = Pair> + '_ {
        let (mut bytes, mut last) = (self.bytes.as_slice(), Pair::default());
        std::iter::from_fn(move || {
            last = unpack(&mut bytes, &last)?;
            Some(last)
        })
    }

    /// Number of pairs.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.bytes.capacity()
    }
}

/// Appends a pair that follows `last`: by how much the label is larger, seven bits to a byte; a head of two bits for each
/// number that follows; the cell, less the last one's if the label is the same; throughput.
fn pack(pair: &Pair, last: &Pair, bytes: &mut Vec<u8>) {
    let mut step = pair.label().wrapping_sub(last.label());
    let cell = pair.cell().wrapping_sub(if step == 0 { last.cell() } else { 0 });
    while step >= 0x80 {
        bytes.push(step as u8 | 0x80);
        step >>= 7;
    }
    bytes.push(step as u8);
    let throughput = pair.throughput();
    let expected = expected(throughput, last.throughput());
    let code = |c: usize| match throughput[c] {
        same if same == expected[c] => 0,
        -0x8000..0x8000 => 1,
        -0x80_0000..0x80_0000 => 2,
        _ => 3,
    };
    let codes = [code(0), code(1), code(2)];
    let width = (4 - cell.leading_zeros() as usize / 8).max(1);
    bytes.push(((width - 1) | codes[0] << 2 | codes[1] << 4 | codes[2] << 6) as u8);
    bytes.extend_from_slice(&cell.to_le_bytes()[..width]);
    for (code, x) in codes.into_iter().zip(throughput) {
        bytes.extend_from_slice(&x.to_le_bytes()[..WIDTHS[code]]);
    }
}

/// Takes a pair that follows `last` off the front.
fn unpack(bytes: &mut &[u8], last: &Pair) -> Option<Pair> {
    let (mut step, mut shift) = (0, 0);
    loop {
        let byte = take_byte(bytes)?;
        step |= u32::from(byte & 0x7f) << shift;
        shift += 7;
        if byte < 0x80 {
            break;
        }
    }
    let head = usize::from(take_byte(bytes)?);
    let cell = take(bytes, (head & 3) + 1)?.wrapping_add(if step == 0 { last.cell() } else { 0 });
    let mut throughput = last.throughput();
    for c in 0..3 {
        let width = WIDTHS[head >> (2 * c + 2) & 3];
        throughput[c] = if width == 0 {
            expected(throughput, last.throughput())[c]
        } else {
            // The sign is that of the last byte.
            let unused = 32 - 8 * width as u32;
            (take(bytes, width)? << unused) as i32 >> unused
        };
    }
    Some(Pair::of_label(last.label().wrapping_add(step), cell, throughput))
}

/// What each channel of throughput is most often: if the first is that of the last pair, so are the others, and else they are
/// as the channel before.
fn expected(throughput: [i32; 3], last: [i32; 3]) -> [i32; 3] {
    if throughput[0] == last[0] { last } else { [last[0], throughput[0], throughput[1]] }
}

/// Takes a byte off the front.
fn take_byte(bytes: &mut &[u8]) -> Option<u8> {
    let (byte, rest) = bytes.split_first()?;
    *bytes = rest;
    Some(*byte)
}

/// Takes a number of so many bytes off the front.
fn take(bytes: &mut &[u8], width: usize) -> Option<u32> {
    let (own, rest) = bytes.split_at_checked(width)?;
    *bytes = rest;
    Some(own.iter().rev().fold(0, |number, byte| number << 8 | u32::from(*byte)))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn throughput() -> impl Strategy<Value = [i32; 3]> {
        let channel = || prop_oneof![Just(1 << 20), -300i32..300, -40_000i32..40_000, any::<i32>()];
        prop_oneof![channel().prop_map(|x| [x; 3]), [channel(), channel(), channel()]]
    }

    proptest! {
        #[test]
        fn pairs_come_back(
            pairs in prop::collection::vec((any::<u32>(), any::<u32>(), 0u32..32, throughput()), 0..60), cut in 0usize..60,
        ) {
            let pair = |(label, cell, shift, throughput): (u32, u32, u32, _)| {
                Pair::of_label(label >> shift, cell >> shift, throughput)
            };
            let mut pairs: Vec<Pair> = pairs.into_iter().map(pair).collect();
            let cut = cut.min(pairs.len());
            pairs[cut..].sort_by_key(Pair::order);
            let (first, second) = pairs.split_at(cut);
            let mut packed = PackedPairs::default();
            packed.extend(first);
            packed.extend(second);
            prop_assert_eq!(packed.len(), pairs.len());
            prop_assert_eq!(packed.iter().collect::<Vec<_>>(), pairs);
        }
    }

    #[test]
    fn a_pair_like_the_last_takes_four_bytes() {
        let pairs: Vec<Pair> =
            (0..100).map(|k| Pair::of_label(16 * k, 200 + k % 50, [700_000, 600_000, 1 << 19])).collect();
        let mut packed = PackedPairs::default();
        packed.extend(&pairs);
        assert_eq!(packed.bytes(), 9 + 100 * 3);
    }
}

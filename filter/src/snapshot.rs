//! All that a filter holds between blocks, as plain data: to be stored, sent, and added to another filter's.
//!
//! Everything is a sum of integers, so adding is exact: any split of a frame's epochs over filters, added in any order,
//! resolves to the same bits as one filter that saw them all. What is written does not depend on who met a cell first.

use crate::grid::CellKey;
use crate::pairs::{Own, Pair};
use crate::sums::WideSums;

/// The sums of a filter.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Snapshot {
    /// Cells of each tree, diffuse and then glossy, by key.
    pub(crate) trees: Vec<Vec<(CellKey, WideSums)>>,
    /// Pairs of each part; their cells are indices into the trees above.
    pub(crate) pairs: Vec<Vec<Pair>>,
    /// Own sums of the slots of each part.
    pub(crate) own: Vec<Vec<(u32, Own)>>,
    /// Paths, and those of them that no cell could take.
    pub(crate) paths: [u64; 2],
}

/// What keeps stored sums from being read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SnapshotError {
    /// They do not begin as sums do.
    Foreign,
    /// They are of another version of this program.
    Version(u32),
    /// They end too early.
    Truncated,
    /// Their checksum is another: bits were changed.
    Damaged,
    /// They are of a filter with other trees or parts.
    Mismatch,
}

impl std::fmt::Display for SnapshotError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Foreign => write!(f, "these are no cell sums"),
            Self::Version(version) => {
                write!(f, "these are cell sums of version {version}; this program reads {VERSION}")
            }
            Self::Truncated => write!(f, "the cell sums end too early: the file was cut"),
            Self::Damaged => write!(f, "the cell sums are damaged: their checksum does not match"),
            Self::Mismatch => write!(f, "the cell sums are of a frame or a filter with other settings"),
        }
    }
}

impl std::error::Error for SnapshotError {}

const MAGIC: &[u8; 8] = b"TSRcells";
const VERSION: u32 = 1;

impl Snapshot {
    /// The bytes to store, little-endian: magic, version, counts and items of each list, checksum.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        let mut put = |words: &[u64]| bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        let wide = |x: u128| [x as u64, (x >> 64) as u64];
        put(&self.paths);
        put(&[self.trees.len() as u64]);
        for tree in &self.trees {
            put(&[tree.len() as u64]);
            for (key, sums) in tree {
                put(&wide(key.bits()));
                put(&[sums.count, sums.weight]);
                put(sums.rgb.map(wide).as_flattened());
                put(&wide(sums.square));
            }
        }
        put(&[self.pairs.len() as u64]);
        for (pairs, own) in self.pairs.iter().zip(&self.own) {
            put(&[pairs.len() as u64]);
            pairs.iter().for_each(|pair| put(&pair.to_words()));
            put(&[own.len() as u64]);
            for (slot, own) in own {
                put(&[(*slot).into()]);
                put(&own.to_words().map(|x| x as u64));
            }
        }
        let checksum = checksum(&bytes);
        bytes.extend(checksum.to_le_bytes());
        bytes
    }

    /// Reads what [`Self::to_bytes`] made.
    ///
    /// # Errors
    /// [`SnapshotError`]; no bytes make it panic.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, SnapshotError> {
        let Some((body, end)) = bytes.split_last_chunk::<8>() else { return Err(SnapshotError::Truncated) };
        let mut reader = Reader(body);
        if reader.take::<8>()? != *MAGIC {
            return Err(SnapshotError::Foreign);
        }
        match u32::from_le_bytes(reader.take()?) {
            VERSION => {}
            other => return Err(SnapshotError::Version(other)),
        }
        if checksum(body) != u64::from_le_bytes(*end) {
            // A file that was cut is told from one with flipped bits by its length, as far as that goes.
            return Err(Self::read(&mut reader).err().unwrap_or(SnapshotError::Damaged));
        }
        let snapshot = Self::read(&mut reader)?;
        if reader.0.is_empty() { Ok(snapshot) } else { Err(SnapshotError::Damaged) }
    }

    fn read(reader: &mut Reader<'_>) -> Result<Self, SnapshotError> {
        let paths = [reader.word()?, reader.word()?];
        let trees: Vec<Vec<_>> = reader.list(8, |reader| reader.list(96, Reader::cell))?;
        let parts = reader.list(16, |reader| {
            let pairs =
                reader.list(24, |reader| Ok(Pair::from_words([reader.word()?, reader.word()?, reader.word()?])))?;
            let own = reader.list(104, |reader| {
                let slot = reader.word()? as u32;
                let mut words = [0; 12];
                for word in &mut words {
                    *word = reader.word()? as i64;
                }
                Ok((slot, Own::from_words(words)))
            })?;
            Ok((pairs, own))
        })?;
        let (pairs, own): (Vec<Vec<Pair>>, Vec<_>) = parts.into_iter().unzip();
        let known = |pair: &Pair| trees.get(pair.tree_of(trees.len())).is_some_and(|tree| pair.index() < tree.len());
        if !pairs.iter().flatten().all(known) {
            return Err(SnapshotError::Damaged);
        }
        Ok(Self { trees, pairs, own, paths })
    }
}

/// Takes words off the front.
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], SnapshotError> {
        let (first, rest) = self.0.split_first_chunk::<N>().ok_or(SnapshotError::Truncated)?;
        self.0 = rest;
        Ok(*first)
    }

    fn word(&mut self) -> Result<u64, SnapshotError> {
        self.take().map(u64::from_le_bytes)
    }

    fn wide(&mut self) -> Result<u128, SnapshotError> {
        Ok(u128::from(self.word()?) | u128::from(self.word()?) << 64)
    }

    /// A count and so many items, each of at least `size` bytes, so that no count asks for more memory than there are bytes.
    fn list<T>(
        &mut self,
        size: usize,
        mut item: impl FnMut(&mut Self) -> Result<T, SnapshotError>,
    ) -> Result<Vec<T>, SnapshotError> {
        let count = usize::try_from(self.word()?).unwrap_or(usize::MAX);
        if count.saturating_mul(size) > self.0.len() {
            return Err(SnapshotError::Truncated);
        }
        (0..count).map(|_| item(self)).collect()
    }

    fn cell(&mut self) -> Result<(CellKey, WideSums), SnapshotError> {
        let key = CellKey::from_bits(self.wide()?);
        let (count, weight) = (self.word()?, self.word()?);
        let rgb = [self.wide()?, self.wide()?, self.wide()?];
        Ok((key, WideSums { count, weight, rgb, square: self.wide()? }))
    }
}

/// Tells accidents, not adversaries.
///
/// **Source**: FNV-1a, 64 bits.
fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

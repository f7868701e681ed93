//! Sections: a length in bytes (u64), the CRC-32 of the bytes (u32), and the bytes. Little-endian.
//!
//! Where they are words, the bytes are the number of words (u64) and then, for each two of them, a byte that says how many
//! bytes each takes (the first in its lower half), and those bytes. A word takes the fewest bytes, 0 to 8, from which sign
//! extension gives it back: most are small numbers of either sign.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

use super::PartError;

/// Bytes before those of a section.
const PREFIX: usize = 12;

/// Appends a section of any bytes.
pub fn append_bytes(file: &mut Vec<u8>, bytes: &[u8]) {
    let begin = file.len();
    file.resize(begin + PREFIX, 0);
    file.extend(bytes);
    seal(&mut file[begin..]);
}

/// Appends a section of words.
pub fn append_words(file: &mut Vec<u8>, words: &[u64]) {
    let begin = file.len();
    file.resize(begin + PREFIX, 0);
    file.extend((words.len() as u64).to_le_bytes());
    // Some pairs at a time, with room for eight bytes from wherever a word begins.
    const PAIRS: usize = 32;
    let mut room = [0; 17 * PAIRS + 8];
    for words in words.chunks(2 * PAIRS) {
        let mut end = 0;
        for pair in words.chunks(2) {
            let pair = [pair[0], pair.get(1).copied().unwrap_or(0)];
            let lengths = pair.map(length);
            room[end] = (lengths[0] | lengths[1] << 4) as u8;
            end += 1;
            for (word, length) in pair.iter().zip(lengths) {
                // What is behind the length is written over next.
                room[end..end + 8].copy_from_slice(&word.to_le_bytes());
                end += length;
            }
        }
        file.extend_from_slice(&room[..end]);
    }
    seal(&mut file[begin..]);
}

fn seal(section: &mut [u8]) {
    let (prefix, bytes) = section.split_at_mut(PREFIX);
    prefix[..8].copy_from_slice(&(bytes.len() as u64).to_le_bytes());
    prefix[8..].copy_from_slice(&crc32fast::hash(bytes).to_le_bytes());
}

/// Bytes from which sign extension gives a word back.
fn length(word: u64) -> usize {
    // Bits that differ from the sign; the sign takes one more.
    let bits = 64 - (word ^ (word as i64 >> 63) as u64).leading_zeros() as usize;
    bits / 8 + usize::from(word != 0)
}

/// The words of such a section's bytes, which eight more bytes follow; `None` where there are none.
fn words(bytes: &[u8]) -> Option<Vec<u64>> {
    let (count, _) = bytes.split_first_chunk::<8>()?;
    let end = bytes.len() - PADDING;
    // Two of them take a byte at least, so that no number asks for more memory than eight times the file.
    let count = usize::try_from(u64::from_le_bytes(*count)).ok().filter(|count| *count <= 2 * end)?;
    let mut words = Vec::with_capacity(count + 1);
    let mut at = 8;
    while words.len() < count {
        let tag = *bytes[..end].get(at)?;
        at += 1;
        for length in [tag & 15, tag >> 4] {
            let length = usize::from(length);
            let padded = bytes.get(at..)?.first_chunk::<8>()?;
            let unused = 64 - 8 * u32::try_from(length).ok().filter(|length| *length <= 8)?;
            let word = u64::from_le_bytes(*padded);
            words.push(if length == 0 { 0 } else { ((word << unused) as i64 >> unused) as u64 });
            at += length;
        }
    }
    words.truncate(count);
    (at == end).then_some(words)
}

/// Zeros behind what is read, so that a word can be read as eight bytes wherever it begins.
const PADDING: usize = 8;

/// A file that is read section by section.
pub struct Sections {
    path: PathBuf,
    reader: BufReader<File>,
    length: u64,
    /// Bytes before the next one.
    at: u64,
}

impl Sections {
    /// Those that follow the first `N` bytes, and these.
    pub fn open<const N: usize>(path: &Path) -> Result<(Self, [u8; N]), PartError> {
        let error = |why| PartError::File { what: "read", path: path.to_owned(), why };
        let file = File::open(path).map_err(error)?;
        let length = file.metadata().map_err(error)?.len();
        let reader = BufReader::with_capacity(1 << 18, file);
        let mut sections = Self { path: path.to_owned(), reader, length, at: 0 };
        let mut first = [0; N];
        sections.read(&mut first)?;
        Ok((sections, first))
    }

    /// Bytes before the next section.
    pub fn position(&self) -> u64 {
        self.at
    }

    /// Bytes behind the last section that was read.
    pub fn rest(&self) -> u64 {
        self.length.saturating_sub(self.at)
    }

    /// Goes to the section that begins at a position.
    pub fn go_to(&mut self, position: u64) -> Result<(), PartError> {
        if position > self.length {
            return Err(PartError::Truncated(self.path.clone()));
        }
        // Files have less than 2^63 bytes.
        let step = position as i64 - self.at as i64;
        self.reader.seek_relative(step).map_err(|why| self.unreadable(why))?;
        self.at = position;
        Ok(())
    }

    fn unreadable(&self, why: io::Error) -> PartError {
        PartError::File { what: "read", path: self.path.clone(), why }
    }

    /// The bytes of the next section.
    pub fn bytes(&mut self) -> Result<Vec<u8>, PartError> {
        let Unread { mut padded, checksum } = self.unread()?;
        padded.truncate(padded.len() - PADDING);
        if crc32fast::hash(&padded) == checksum { Ok(padded) } else { Err(self.damaged()) }
    }

    /// The words of the next section.
    pub fn words(&mut self) -> Result<Vec<u64>, PartError> {
        self.unread()?.words().ok_or_else(|| self.damaged())
    }

    /// What is said where checksums do not tell, but sense does.
    pub fn damaged(&self) -> PartError {
        PartError::Damaged(self.path.clone())
    }

    /// The next section as it is in the file.
    pub fn unread(&mut self) -> Result<Unread, PartError> {
        let mut prefix = [0; PREFIX];
        self.read(&mut prefix)?;
        let [length @ .., c0, c1, c2, c3] = prefix;
        let length = u64::from_le_bytes(length);
        // So that no length asks for more memory than there are bytes.
        if length > self.rest() {
            return Err(PartError::Truncated(self.path.clone()));
        }
        let mut padded = vec![0; length as usize + PADDING];
        self.read(&mut padded[..length as usize])?;
        Ok(Unread { padded, checksum: u32::from_le_bytes([c0, c1, c2, c3]) })
    }

    fn read(&mut self, bytes: &mut [u8]) -> Result<(), PartError> {
        self.reader.read_exact(bytes).map_err(|why| match why.kind() {
            io::ErrorKind::UnexpectedEof => PartError::Truncated(self.path.clone()),
            _ => self.unreadable(why),
        })?;
        self.at += bytes.len() as u64;
        Ok(())
    }
}

/// A section of which nobody has looked at the bytes yet: several threads may, of one file.
pub struct Unread {
    /// The bytes, and [`PADDING`] zeros.
    padded: Vec<u8>,
    checksum: u32,
}

impl Unread {
    /// The words; `None` where the bytes are not those that were written.
    pub fn words(&self) -> Option<Vec<u64>> {
        let whole = crc32fast::hash(&self.padded[..self.padded.len() - PADDING]) == self.checksum;
        whole.then(|| words(&self.padded)).flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_words(words: &[u64]) -> Vec<u8> {
        // What stands before it is left alone.
        let mut file = vec![7; 5];
        append_words(&mut file, words);
        assert_eq!(file[..5], [7; 5]);
        file.split_off(5)
    }

    fn read(section: &[u8]) -> Option<Vec<u64>> {
        words(&[&section[PREFIX..], &[0; PADDING]].concat())
    }

    #[test]
    fn words_of_all_lengths_come_back_in_the_fewest_bytes() {
        for (word, bytes) in [(0, 0), (1, 1), (127, 1), (128, 2), (u64::MAX, 1), (u64::MAX - 128, 2), (1 << 63, 8)] {
            assert_eq!(length(word), bytes, "{word:x}");
        }
        let edges = (0..64).flat_map(|bit| [1u64 << bit, (1 << bit) - 1, !(1 << bit), u64::MAX << bit]);
        let all: Vec<u64> = edges.collect();
        for count in 0..all.len() {
            assert_eq!(read(&of_words(&all[..count])).as_deref(), Some(&all[..count]));
        }
    }

    #[test]
    fn what_is_no_list_of_words_is_refused() {
        let section = of_words(&[1, 1 << 40, 3]);
        for end in PREFIX..section.len() {
            assert_eq!(read(&section[..end]), None, "{end} bytes");
        }
        for (at, value) in [(0, 2), (0, 5), (7, 1), (8, 0x99), (8, 0x11)] {
            let mut wrong = section.clone();
            wrong[PREFIX + at] = value;
            assert_eq!(read(&wrong), None, "byte {at} is {value}");
        }
        assert_eq!(read(&[&section[..], &[0]].concat()), None);
    }
}

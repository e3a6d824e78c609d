//! Journal of the bands that are rendered, in a file that survives a kill: a head that says which
//! picture it is of, then one record a band with its compressed values and sums. A record counts
//! only with its checksum, so that a torn one is rendered again.

use super::tally::Tally;
use kerrlight_common::memory::Scratch;
use std::io::{Error, ErrorKind, Read, Result, Seek, SeekFrom, Write};

const MAGIC: &[u8; 20] = b"kerrlight journal 1\n";

/// A record larger than this is damage, whatever its checksum says.
const LARGEST_RECORD: u32 = 1 << 30;

/// A journal in a file, or in memory.
#[derive(Debug)]
pub struct Journal<F: ?Sized> {
    /// Checksum of the head, from which those of the records go on: a record of another
    /// picture is never taken for one of this.
    salt: u32,
    records: Vec<Option<Record>>,
    /// Place of the next record.
    end: u64,
    file: F,
}

/// A journal in a file of any kind.
pub type AnyJournal<'a> = Journal<dyn Scratch + 'a>;

#[derive(Debug, Clone, Copy)]
struct Record {
    offset: u64,
    length: u32,
    tally: Tally,
}

/// Contents of a file before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Found {
    /// Nothing.
    Nothing,
    /// This many bands of the same picture.
    Bands(usize),
    /// A journal of another picture, which has been given up.
    Other,
}

impl<F: Read + Write + Seek> Journal<F> {
    /// Goes on with the journal in `file` if it is of the picture that `identity` describes;
    /// else starts it anew.
    ///
    /// # Errors
    /// If the file holds anything but a journal, or on a failure to read or write.
    pub fn open(file: F, identity: &str, bands: usize) -> Result<(Self, Found)> {
        let mut journal = Journal { salt: 0, records: vec![None; bands], end: 0, file };
        let head = head(identity);
        journal.salt = crc32fast::hash(&head);
        journal.end = head.len() as u64;
        let length = journal.file.seek(SeekFrom::End(0))?;
        journal.file.rewind()?;
        let mut there = vec![0; head.len().min(length as usize)];
        journal.file.read_exact(&mut there)?;
        if length > 0 && !there.starts_with(&MAGIC[..MAGIC.len().min(there.len())]) {
            return Err(Error::new(ErrorKind::InvalidData, "it is no journal of kerrlight"));
        }
        if there == head {
            while let Some(band) = journal.scan(length)? {
                debug_assert!(journal.records[band].is_some());
            }
            let found = Found::Bands(bands - journal.missing().len());
            return Ok((journal, found));
        }
        // Records of the other picture may stay behind the head: the salt keeps them out.
        journal.file.rewind()?;
        journal.file.write_all(&head)?;
        Ok((journal, if length == 0 { Found::Nothing } else { Found::Other }))
    }
}

impl<F: Read + Write + Seek + ?Sized> Journal<F> {
    /// Takes in the record at the end, if it is a whole one; its band.
    fn scan(&mut self, length: u64) -> Result<Option<usize>> {
        let mut front = [0; FRONT];
        if self.end + (FRONT as u64) > length {
            return Ok(None);
        }
        self.file.seek(SeekFrom::Start(self.end))?;
        self.file.read_exact(&mut front)?;
        let (band, size, tally) = unpack(&front);
        let after = self.end + FRONT as u64 + u64::from(size) + 4;
        if band as usize >= self.records.len() || size > LARGEST_RECORD || after > length {
            return Ok(None);
        }
        let mut bytes = vec![0; size as usize];
        let mut sum = [0; 4];
        self.file.read_exact(&mut bytes)?;
        self.file.read_exact(&mut sum)?;
        if u32::from_le_bytes(sum) != self.checksum(&front, &bytes) {
            return Ok(None);
        }
        let offset = self.end + FRONT as u64;
        self.records[band as usize] = Some(Record { offset, length: size, tally });
        self.end = after;
        Ok(Some(band as usize))
    }

    fn checksum(&self, front: &[u8], bytes: &[u8]) -> u32 {
        let mut hasher = crc32fast::Hasher::new_with_initial(self.salt);
        hasher.update(front);
        hasher.update(bytes);
        hasher.finalize()
    }

    /// The bands that are not there yet, in order.
    pub fn missing(&self) -> Vec<usize> {
        (0..self.records.len()).filter(|band| self.records[*band].is_none()).collect()
    }

    /// Adds the compressed bytes and the sums of a band; a later record of a band replaces an
    /// earlier one.
    ///
    /// # Errors
    /// On a failure to write; the band is then missing, all others stay.
    pub(super) fn append(&mut self, band: usize, tally: Tally, bytes: &[u8]) -> Result<()> {
        let too_large = || Error::new(ErrorKind::InvalidInput, "a band is too large");
        let size = u32::try_from(bytes.len()).ok().filter(|size| *size <= LARGEST_RECORD);
        let length = size.ok_or_else(too_large)?;
        let slot = self.records.get_mut(band).ok_or_else(too_large)?;
        let offset = self.end + FRONT as u64;
        *slot = None;
        let mut record = Vec::with_capacity(FRONT + bytes.len() + 4);
        record.extend((band as u32).to_le_bytes());
        record.extend(length.to_le_bytes());
        record.extend(tally.to_bytes());
        record.extend(bytes);
        let sum = self.checksum(&record[..FRONT], bytes);
        record.extend(sum.to_le_bytes());
        // Over what a kill has left of a record, if anything.
        self.file.seek(SeekFrom::Start(self.end))?;
        self.file.write_all(&record)?;
        self.records[band] = Some(Record { offset, length, tally });
        self.end += record.len() as u64;
        Ok(())
    }

    /// The compressed bytes of a band.
    ///
    /// # Errors
    /// If it is not there, or on a failure to read.
    pub(super) fn read(&mut self, band: usize) -> Result<Vec<u8>> {
        let absent = || Error::new(ErrorKind::NotFound, "a band is missing");
        let record = self.records.get(band).copied().flatten().ok_or_else(absent)?;
        let mut bytes = vec![0; record.length as usize];
        self.file.seek(SeekFrom::Start(record.offset))?;
        self.file.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    /// The sums over all bands that are there, added from the top.
    pub(super) fn tally(&self) -> Tally {
        let tallies = self.records.iter().flatten().map(|record| record.tally);
        tallies.fold(Tally::default(), Tally::plus)
    }
}

/// Bytes before those of a record's band: its number, length and sums.
const FRONT: usize = 8 + Tally::BYTES;

fn unpack(front: &[u8; FRONT]) -> (u32, u32, Tally) {
    let [b0, b1, b2, b3, l0, l1, l2, l3, tally @ ..] = *front;
    let (band, length) = ([b0, b1, b2, b3], [l0, l1, l2, l3]);
    (u32::from_le_bytes(band), u32::from_le_bytes(length), Tally::from_bytes(&tally))
}

fn head(identity: &str) -> Vec<u8> {
    let mut head = MAGIC.to_vec();
    head.extend((identity.len() as u64).to_le_bytes());
    head.extend(identity.as_bytes());
    head
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn tally(k: usize) -> Tally {
        Tally { rays: 7, unresolved: k as u64, intensity: 0.1 * k as f64, ..Tally::default() }
    }

    fn filled(identity: &str) -> Vec<u8> {
        let (mut journal, found) = Journal::open(Cursor::new(vec![]), identity, 5).unwrap();
        assert_eq!(found, Found::Nothing);
        for band in [3, 0, 1] {
            journal.append(band, tally(band), &vec![band as u8; 10 * (band + 1)]).unwrap();
        }
        journal.file.into_inner()
    }

    #[test]
    fn exact_goes_on_wherever_it_was_cut_or_damaged() {
        let whole = filled("picture A");
        let open = |bytes: Vec<u8>| Journal::open(Cursor::new(bytes), "picture A", 5).unwrap();
        for cut in 0..=whole.len() {
            let (mut journal, _) = open(whole[..cut].to_vec());
            let there = 5 - journal.missing().len();
            for band in journal.missing() {
                journal.append(band, tally(band), &vec![band as u8; 10 * (band + 1)]).unwrap();
            }
            let (mut again, found) = open(journal.file.into_inner());
            assert_eq!(found, Found::Bands(5), "cut at {cut}, {there} bands left");
            for band in 0..5 {
                assert_eq!(again.read(band).unwrap(), vec![band as u8; 10 * (band + 1)]);
            }
            assert_eq!(again.tally().unresolved, 10);
        }
        let mut flipped = whole.clone();
        let last = whole.len() - 10;
        flipped[last] ^= 1;
        assert_eq!(open(flipped).1, Found::Bands(2));
        assert_eq!(open(whole).1, Found::Bands(3));
    }

    #[test]
    fn exact_another_picture_starts_anew() {
        let (journal, found) = Journal::open(Cursor::new(filled("a")), "b", 5).unwrap();
        assert_eq!((found, journal.missing().len()), (Found::Other, 5));
        // The old records lie behind the new head, at the same places, and are not taken up.
        let (journal, found) =
            Journal::open(Cursor::new(journal.file.into_inner()), "b", 5).unwrap();
        assert_eq!((found, journal.missing().len()), (Found::Bands(0), 5));
        let foreign = Cursor::new(b"somebody's notes".to_vec());
        assert!(Journal::open(foreign, "b", 5).is_err());
    }
}

//! NPZ archives.

use super::{NumpyError, Stream};
use crate::Error;
use crate::memory;
use npyz::WriterBuilder;
use std::io::{BufWriter, Cursor, Read, Seek, Write};
use zip::result::ZipError;

/// An NPZ archive.
#[derive(Debug)]
pub struct Archive<R>(zip::ZipArchive<R>);

impl<'a> Archive<Cursor<&'a [u8]>> {
    /// The archive that these bytes are.
    ///
    /// # Errors
    /// If they are none.
    pub fn open(bytes: &'a [u8]) -> Result<Self, Error> {
        Self::of(Cursor::new(bytes))
    }
}

impl<R: Read + Seek> Archive<R> {
    /// The archive that a file is.
    ///
    /// # Errors
    /// If it is none.
    pub fn of(file: R) -> Result<Self, Error> {
        let archive = zip::ZipArchive::new(file);
        let not = |error| NumpyError::content(format!("not an npz archive: {error}"));
        Ok(archive.map(Archive).map_err(not)?)
    }

    /// The names of its arrays, without `.npy`.
    ///
    /// # Errors
    /// If the archive is damaged.
    pub fn names(&mut self) -> Result<Vec<String>, Error> {
        let count = self.0.len();
        let name = |k| -> Result<String, ZipError> {
            let name = self.0.by_index(k)?.name()?.into_owned();
            Ok(name.strip_suffix(".npy").unwrap_or(&name).to_owned())
        };
        let damaged = |error| NumpyError::content(format!("damaged npz archive: {error}"));
        Ok((0..count).map(name).collect::<Result<_, _>>().map_err(damaged)?)
    }

    /// An array that is read number by number; its checksum is compared at its end.
    ///
    /// # Errors
    /// If there is none, or it is damaged.
    pub fn stream(&mut self, name: &str) -> Result<Stream<impl Read>, Error> {
        let failed = |error: Error| NumpyError::member(format!("{name}.npy"), error);
        let file = self.0.by_name(&format!("{name}.npy")).map_err(std::io::Error::from);
        Ok(Stream::new(file.map_err(|error| failed(error.into()))?).map_err(failed)?)
    }

    /// The bytes of an array, whose checksum must be right; `None` if there is no such array.
    ///
    /// # Errors
    /// If it is damaged, or there is no memory for it.
    pub fn member(&mut self, name: &str) -> Result<Option<Vec<u8>>, Error> {
        let at = || format!("array {name}");
        let failed = |error: &dyn std::error::Error| {
            NumpyError::member(format!("array {name}"), NumpyError::content(error.to_string()))
        };
        let file = match self.0.by_name(&format!("{name}.npy")) {
            Ok(file) => file,
            Err(ZipError::FileNotFound) => return Ok(None),
            Err(error) => return Err(failed(&error).into()),
        };
        let size = file.size();
        // Numbers of four bytes, the smallest that are usual.
        memory::afford(at, memory::array(size as f64, size as f64 / 4.0))?;
        let mut bytes = Vec::new();
        // Its checksum is compared at its end, which is one byte behind its last.
        let mut file = file.take(size.saturating_add(1));
        file.read_to_end(&mut bytes).map_err(|error| failed(&error))?;
        if bytes.len() as u64 != size {
            let damaged = format!("{} is damaged: its size is stated as {size} bytes", at());
            return Err(NumpyError::content(damaged).into());
        }
        Ok(Some(bytes))
    }
}

/// The bytes of an archive of arrays, each with its name and the bytes that [`write_array`](super::write_array) makes.
///
/// # Panics
/// Never: writing to memory does not fail.
pub fn write_archive<'n>(arrays: impl IntoIterator<Item = (&'n str, Vec<u8>)>) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default();
    for (name, bytes) in arrays {
        archive.start_file(format!("{name}.npy"), options).expect("a name that is short");
        archive.write_all(&bytes).expect("memory");
    }
    archive.finish().expect("memory").into_inner()
}

/// An archive of arrays that need not be in memory, array after array.
pub struct ArchiveWriter<W: Write + Seek>(zip::ZipWriter<W>);

impl<W: Write + Seek> ArchiveWriter<W> {
    /// Writes into this file.
    pub fn new(out: W) -> Self {
        Self(zip::ZipWriter::new(out))
    }

    /// Adds an array of this shape, whose values `fill` hands over in C's order, some at a time.
    ///
    /// # Errors
    /// Those of `fill`; if the file cannot be written, or there are not as many values as the shape says.
    pub fn add<T: npyz::AutoSerialize + Copy>(
        &mut self,
        name: &str,
        shape: &[u64],
        fill: impl FnOnce(&mut dyn FnMut(&[T]) -> Result<(), Error>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let count = shape.iter().fold(size_of::<T>() as u64, |bytes, n| bytes.saturating_mul(*n));
        let options = zip::write::SimpleFileOptions::default();
        // An entry beyond 4 GiB needs the 64-bit format, chosen before its data are written.
        let options = options.large_file(count >= u64::from(u32::MAX) / 2);
        self.0.start_file(format!("{name}.npy"), options).map_err(std::io::Error::from)?;
        // npyz writes number by number, too few bytes at a time for a compressor.
        let mut buffer = BufWriter::with_capacity(1 << 16, &mut self.0);
        let options = npyz::WriteOptions::new().default_dtype().shape(shape);
        let mut array = options.writer(&mut buffer).begin_nd()?;
        fill(&mut |values: &[T]| Ok(array.extend(values.iter().copied())?))?;
        array.finish()?;
        // A buffer that is dropped would hide its error.
        Ok(buffer.flush()?)
    }

    /// Ends the archive.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(self) -> Result<W, Error> {
        Ok(self.0.finish().map_err(std::io::Error::from)?)
    }
}

#[cfg(test)]
mod tests {
    use super::super::write_array;
    use super::*;

    /// Arrays written piece by piece have the bytes of arrays written at once.
    #[test]
    fn exact_arrays_in_pieces() {
        let values: Vec<f32> = (0..6000).map(|k| (k as f32).sin()).collect();
        let mut pieces = ArchiveWriter::new(Cursor::new(Vec::new()));
        let fill =
            |sink: &mut dyn FnMut(&[f32]) -> Result<(), Error>| values.chunks(7).try_for_each(sink);
        pieces.add("a", &[20, 300], fill).unwrap();
        let pieces = pieces.finish().unwrap().into_inner();
        let array = Archive::open(&pieces).unwrap().member("a").unwrap().unwrap();
        assert_eq!(array, write_array(&[20, 300], values.iter().copied()));
        let mut short = ArchiveWriter::new(Cursor::new(Vec::new()));
        assert!(short.add::<f32>("a", &[2], |sink| sink(&[1.0])).is_err());
    }

    fn archive(bytes: &[u8]) -> Vec<u8> {
        let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
        let options = zip::write::SimpleFileOptions::default();
        archive.start_file("a.npy", options).unwrap();
        archive.write_all(bytes).unwrap();
        archive.finish().unwrap().into_inner()
    }

    /// No flipped bit changes an array: it is an error, or in what nobody reads (dates, attributes).
    #[test]
    fn exact_every_flipped_bit_is_found() {
        let content: Vec<u8> =
            (0..600u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        let whole = archive(&content);
        let read = |bytes: &[u8]| Archive::open(bytes)?.member("a");
        assert_eq!(read(&whole).unwrap(), Some(content.clone()));
        let mut refused = 0;
        for at in 0..whole.len() {
            for bit in 0..8 {
                let mut flipped = whole.clone();
                flipped[at] ^= 1 << bit;
                match read(&flipped) {
                    Ok(Some(bytes)) => assert!(bytes == content, "byte {at}, bit {bit}"),
                    Ok(None) | Err(_) => refused += 1,
                }
            }
        }
        assert!(refused > 8 * 300, "{refused}");
    }

    /// Sizes in the archive that are not those of its members.
    #[test]
    fn exact_false_sizes_are_named() {
        let mut whole = archive(&[7; 4096]);
        let central = whole.windows(4).position(|window| window == b"PK\x01\x02").unwrap();
        for size in [100u32, 5000, u32::MAX - 1] {
            whole[central + 24..central + 28].copy_from_slice(&size.to_le_bytes());
            assert!(Archive::open(&whole).unwrap().member("a").is_err(), "{size}");
        }
    }
}

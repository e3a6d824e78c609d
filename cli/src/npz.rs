//! Arrays in NPZ archives, which state sizes that need not be true.

use anyhow::{Context, bail};
use kerrlight_tomo::memory;
use std::io::{Cursor, Read};

/// An archive in memory.
pub type Archive<'a> = zip::ZipArchive<Cursor<&'a [u8]>>;

/// The archive that these bytes are.
pub fn open(bytes: &[u8]) -> anyhow::Result<Archive<'_>> {
    zip::ZipArchive::new(Cursor::new(bytes)).context("not an npz archive")
}

/// The bytes of a member, whose checksum must be right; none if there is no such member.
pub fn member(archive: &mut Archive<'_>, name: &str) -> anyhow::Result<Option<Vec<u8>>> {
    let at = || format!("array {}", name.trim_end_matches(".npy"));
    let file = match archive.by_name(name) {
        Ok(file) => file,
        Err(zip::result::ZipError::FileNotFound) => return Ok(None),
        Err(error) => return Err(error).with_context(at),
    };
    let size = file.size();
    // Numbers of four bytes, the smallest that are usual.
    memory::afford(at, memory::array(size as f64, size as f64 / 4.0))?;
    let mut bytes = Vec::new();
    // Its checksum is compared at its end, which is one byte behind its last.
    file.take(size.saturating_add(1)).read_to_end(&mut bytes).with_context(at)?;
    if bytes.len() as u64 != size {
        bail!("{} is damaged: its size is stated as {size} bytes", at());
    }
    Ok(Some(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

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
        let read = |bytes: &[u8]| member(&mut open(bytes)?, "a.npy");
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
            assert!(member(&mut open(&whole).unwrap(), "a.npy").is_err(), "{size}");
        }
    }
}

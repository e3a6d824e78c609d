//! Parts of the FITS standard that UVFITS needs (version 4.0, Pence et al. 2010 and the IAU FITS
//! Working Group): headers, and binary tables. Written for files that may be damaged: every size is
//! checked against the bytes that there are before anything is done with it.

mod header;
mod table;
mod writer;

pub use header::Header;
pub use table::Table;
pub use writer::{Cards, ColumnData, binary_table, padded};

use super::FileError;

/// FITS files are made of blocks of this many bytes.
pub const BLOCK: usize = 2880;
/// A line of a header.
pub const CARD: usize = 80;

/// A header and the data behind it.
pub struct Unit<'a> {
    /// The header.
    pub header: Header<'a>,
    /// Its data, without the padding.
    pub data: &'a [u8],
    /// Offset of the data in the file.
    pub offset: usize,
    /// Offset of the next unit.
    pub next: usize,
}

impl<'a> Unit<'a> {
    /// The unit that starts at `offset`.
    pub fn read(bytes: &'a [u8], offset: usize) -> Result<Self, FileError> {
        let (header, start) = Header::read(bytes, offset)?;
        let size = header.data_size()?;
        let rest = bytes.len() - start;
        let padded = size.checked_next_multiple_of(BLOCK).filter(|padded| *padded <= rest);
        let Some(padded) = padded else {
            return Err(FileError::byte(
                start,
                format!("the header declares {size} bytes of data, the file has {rest}"),
            ));
        };
        let data = &bytes[start..start + size];
        Ok(Unit { header, data, offset: start, next: start + padded })
    }

    /// Returns whether it is an extension of this name.
    pub fn is_named(&self, name: &str) -> bool {
        self.header.text("EXTNAME").as_deref() == Some(name)
    }
}

/// A number of the data: of 2 or 4 bytes a whole one unless it is a `float`, of 8 bytes a double.
pub fn stored(float: bool, cell: &[u8]) -> f64 {
    match (float, cell) {
        (false, &[a, b]) => i16::from_be_bytes([a, b]).into(),
        (false, &[a, b, c, d]) => i32::from_be_bytes([a, b, c, d]).into(),
        (true, &[a, b, c, d]) => f32::from_be_bytes([a, b, c, d]).into(),
        (_, cell) => f64::from_be_bytes(cell.try_into().unwrap_or([0; 8])),
    }
}

/// All units of a file.
pub fn units(bytes: &[u8]) -> Result<Vec<Unit<'_>>, FileError> {
    if bytes.is_empty() {
        return Err(FileError::whole("the file is empty"));
    }
    let mut units = Vec::new();
    let mut offset = 0;
    while offset < bytes.len() {
        let unit = Unit::read(bytes, offset)?;
        offset = unit.next;
        units.push(unit);
    }
    Ok(units)
}

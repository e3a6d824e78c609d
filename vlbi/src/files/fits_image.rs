//! Images in FITS files, as eht-imaging and other imaging programs write them.

mod write;

pub use write::write;

use super::FileError;
use super::fits::{Header, Unit, stored};
use super::fits_axes::{self, Place};
use crate::Error;
use crate::operator::ImageGrid;
use crate::simulate::{Movie, StokesMovie};

/// Reads the images of a file: two axes longer than 1 (right ascension and declination, square pixels given in degrees
/// by CDELT1 and CDELT2), of Jy/pixel, of one frequency. Stokes parameters are planes of an axis STOKES, or units of their
/// own that are named Q, U and V; an image that does not say is Stokes I. Rows are brought from south up to north first.
///
/// # Errors
/// If the file is damaged, no image, of another unit, without Stokes I, holds values that are not finite, or a card says
/// of the image what is not read: rotation, a reference pixel off the middle, further axes.
pub fn read(bytes: &[u8]) -> Result<StokesMovie, Error> {
    let first = Unit::read(bytes, 0)?;
    let place = fits_axes::place(&first.header)?;
    let mut planes = [None, None, None, None];
    take(&first, &place, &mut planes)?;
    let mut next = first.next;
    // What follows the units and begins otherwise is allowed, and means nothing.
    while bytes[next..].starts_with(b"XTENSION") {
        let unit = Unit::read(bytes, next)?;
        next = unit.next;
        if !is_image(&unit.header) {
            continue;
        }
        let other = fits_axes::place(&unit.header)?;
        if other.grid != place.grid || other.east_to_west != place.east_to_west {
            let message = "other pixels than the file's first image";
            return Err(unit.header.error("NAXIS1", message).into());
        }
        if other.stokes.is_none() {
            let message =
                "an image named I, Q, U or V (EXTNAME or STOKES): what this one is it does not say";
            return Err(unit.header.error("EXTNAME", message).into());
        }
        take(&unit, &other, &mut planes)?;
    }
    let [i, q, u, v] = planes;
    let Some(i) = i else {
        return Err(
            FileError::whole("holds no Stokes I (CRVAL of the axis STOKES, or STOKES)").into()
        );
    };
    if q.is_some() != u.is_some() {
        return Err(
            FileError::whole("holds one of Stokes Q and U: both are needed, or none").into()
        );
    }
    Ok(StokesMovie { i: Movie { grid: place.grid, pixels: i }, polarized: [q, u, v] })
}

/// Returns whether an extension is an image with pixels, rather than a table.
fn is_image(header: &Header<'_>) -> bool {
    let is_image = header.text("XTENSION").is_some_and(|kind| kind.trim() == "IMAGE");
    is_image && header.axes().is_ok_and(|axes| axes.len() >= 2)
}

/// Reads all planes of a unit into those of I, Q, U and V.
fn take(
    unit: &Unit<'_>,
    place: &Place,
    planes: &mut [Option<Vec<f64>>; 4],
) -> Result<(), FileError> {
    let ImageGrid { width, height, .. } = place.grid;
    let only = [0];
    let stokes = place.stokes.as_deref().unwrap_or(&only);
    let values = values(unit, place.grid.pixels() * stokes.len())?;
    for (k, values) in stokes.iter().zip(values.chunks_exact(place.grid.pixels())) {
        let row = |row: usize| {
            let row = &values[row * width..(row + 1) * width];
            (0..width).map(move |k| if place.east_to_west { row[k] } else { row[width - 1 - k] })
        };
        let there = planes[*k].replace((0..height).rev().flat_map(row).collect());
        if there.is_some() {
            let name = fits_axes::STOKES[*k];
            return Err(FileError::whole(format!("holds two images of Stokes {name}")));
        }
    }
    Ok(())
}

/// The first `count` numbers of the data.
fn values(unit: &Unit<'_>, count: usize) -> Result<Vec<f64>, FileError> {
    let header = &unit.header;
    let size = header.number_size()?;
    let scale = header.number_or("BSCALE", 1.0)?;
    let zero = header.number_or("BZERO", 0.0)?;
    // Below, 8 bytes are a double, and 1 byte is no number.
    if header.integer("BITPIX")? == Some(8) || header.integer("BITPIX")? == Some(64) {
        return Err(header.error("BITPIX", "16, 32, -32 or -64 in an image"));
    }
    let float = header.integer("BITPIX")? < Some(0);
    let blank = if float { None } else { header.number("BLANK")? };
    // `Unit` has seen to it that all axes' data are there; one of length 0 leaves none.
    let data = unit.data.get(..count * size);
    let data = data.ok_or_else(|| header.error("NAXIS", "axes of positive length"))?;
    let value = |(index, cell): (usize, &[u8])| {
        let stored = stored(float, cell);
        let value = if blank == Some(stored) { f64::NAN } else { stored * scale + zero };
        if f64::is_finite(value) {
            Ok(value)
        } else {
            Err(FileError::byte(unit.offset + index * size, format!("a pixel is {value}")))
        }
    };
    data.chunks_exact(size).enumerate().map(value).collect()
}

#[cfg(test)]
mod tests;

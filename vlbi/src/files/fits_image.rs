//! Images in FITS files, as eht-imaging and other imaging programs write them.

use super::FileError;
use super::fits::{Header, Unit};
use crate::Error;
use crate::operator::ImageGrid;
use crate::simulate::Movie;

/// Reads the image of a file's first unit: two axes longer than 1 (right ascension and
/// declination, square pixels given in degrees by CDELT1 and CDELT2), of Jy/pixel, the first
/// polarisation and frequency. Rows are brought from south up to north first.
///
/// # Errors
/// If the file is damaged, no image, of another unit, or holds values that are not finite.
pub fn read(bytes: &[u8]) -> Result<Movie, Error> {
    let unit = Unit::read(bytes, 0)?;
    let header = &unit.header;
    let axes = header.axes()?;
    let (Some(&width), Some(&height)) = (axes.first(), axes.get(1)) else {
        return Err(header.error("NAXIS", "2 or more: an image").into());
    };
    if header.is_true("GROUPS") || width == 0 {
        return Err(FileError::whole("visibilities (UVFITS), not an image").into());
    }
    let unit_name = header.text("BUNIT").unwrap_or_default().to_ascii_uppercase();
    if unit_name.trim() != "JY/PIXEL" {
        return Err(header.error("BUNIT", "JY/PIXEL").into());
    }
    let (east_to_west, pixel_rad) = pixel(header)?;
    let field_rad = pixel_rad * width as f64;
    if !(field_rad > 0.0 && field_rad < 1.0) {
        let degrees = field_rad.to_degrees();
        let message = format!("{width} pixels span {degrees} degrees, in (0, 57.29) is expected");
        return Err(header.error("CDELT1", message).into());
    }
    let grid =
        ImageGrid::new(width, height, field_rad).map_err(|error| header.error("NAXIS1", error))?;
    let values = values(&unit, grid.pixels())?;
    let pixels = (0..height)
        .rev()
        .flat_map(|row| {
            let row = &values[row * width..(row + 1) * width];
            (0..width).map(move |k| if east_to_west { row[k] } else { row[width - 1 - k] })
        })
        .collect();
    Ok(Movie { grid, pixels })
}

/// Whether columns run from east to west, and the side of a pixel in radians.
fn pixel(header: &Header<'_>) -> Result<(bool, f64), FileError> {
    let step = |keyword| header.number(keyword).map(|step| step.unwrap_or(0.0));
    let (east, north) = (step("CDELT1")?, step("CDELT2")?);
    if (east.abs() - north.abs()).abs() > 1e-6 * north.abs() || north <= 0.0 {
        return Err(header.error("CDELT2", "positive degrees, and square pixels with CDELT1"));
    }
    Ok((east < 0.0, east.abs().to_radians()))
}

/// The first `count` numbers of the data.
fn values(unit: &Unit<'_>, count: usize) -> Result<Vec<f64>, FileError> {
    let header = &unit.header;
    let size = header.number_size()?;
    let scale = header.number("BSCALE")?.unwrap_or(1.0);
    let zero = header.number("BZERO")?.unwrap_or(0.0);
    if header.integer("BITPIX")? == Some(8) || header.integer("BITPIX")? == Some(64) {
        return Err(header.error("BITPIX", "16, 32, -32 or -64 in an image"));
    }
    let float = header.integer("BITPIX")? < Some(0);
    // `Unit` has seen to it that all axes' data are there; one of length 0 leaves none.
    let data = unit.data.get(..count * size);
    let data = data.ok_or_else(|| header.error("NAXIS", "axes of positive length"))?;
    let value = |(index, cell): (usize, &[u8])| {
        let stored = match (float, cell) {
            (false, &[a, b]) => i16::from_be_bytes([a, b]).into(),
            (false, &[a, b, c, d]) => i32::from_be_bytes([a, b, c, d]).into(),
            (true, &[a, b, c, d]) => f32::from_be_bytes([a, b, c, d]).into(),
            (_, cell) => f64::from_be_bytes(cell.try_into().unwrap_or([0; 8])),
        };
        let value = stored * scale + zero;
        if f64::is_finite(value) {
            Ok(value)
        } else {
            Err(FileError::byte(unit.offset + index * size, format!("a pixel is {value}")))
        }
    };
    data.chunks_exact(size).enumerate().map(value).collect()
}

#[cfg(test)]
mod tests {
    use super::super::fits::{Cards, padded};
    use super::*;

    /// Two rows of three pixels, the southern row first.
    fn file(east_step: f64) -> Vec<u8> {
        let mut cards = Cards::default();
        cards.value("SIMPLE", "T").value("BITPIX", -64).value("NAXIS", 3);
        cards.value("NAXIS1", 3).value("NAXIS2", 2).value("NAXIS3", 1).text("BUNIT", "JY/PIXEL");
        cards.number("CDELT1", east_step).number("CDELT2", 1e-9);
        let mut bytes = cards.finish();
        let values = [4.0, 5.0, 6.0, 1.0, 2.0, 3.0f64];
        bytes.extend(padded(values.iter().flat_map(|x| x.to_be_bytes()).collect(), 0));
        bytes
    }

    #[test]
    fn exact_north_comes_first_and_east_is_left() {
        let movie = read(&file(-1e-9)).unwrap();
        assert_eq!(movie.pixels, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert!((movie.grid.pixel_rad / 1e-9f64.to_radians() - 1.0).abs() < 1e-15);
        assert_eq!(read(&file(1e-9)).unwrap().pixels, [3.0, 2.0, 1.0, 6.0, 5.0, 4.0]);
        assert!(read(&file(-2e-9)).unwrap_err().to_string().contains("square"));
    }

    #[test]
    fn exact_damaged_files_are_errors() {
        let good = file(-1e-9);
        for end in 0..good.len() {
            assert!(read(&good[..end]).is_err(), "{end}");
        }
        let text = |from: &str, to: &str| {
            let at = good.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
            let mut bytes = good.clone();
            bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
            read(&bytes).unwrap_err().to_string()
        };
        assert!(text("JY/PIXEL", "JY/BEAM ").contains("JY/PIXEL"));
        assert!(
            text("NAXIS1  =                    3", "NAXIS1  = 99999999999999999999")
                .contains("NAXIS1")
        );
        let mut nan = good.clone();
        nan[2880..2888].copy_from_slice(&f64::NAN.to_be_bytes());
        assert!(read(&nan).unwrap_err().to_string().contains("byte 2880: a pixel is NaN"));
    }
}

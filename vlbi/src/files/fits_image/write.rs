//! Images to FITS, with the cards that eht-imaging writes and reads.

use super::super::fits::{Cards, padded};
use super::super::fits_axes::STOKES;
use crate::observation::Observation;
use crate::operator::ImageGrid;

/// Images of Stokes I and, where they are known, Q and U in Jy/pixel, north first and east left, each as a unit of its own: rows from
/// south, CDELT1 < 0. Source, place, frequency and day are those of the observation, as far as it knows them.
pub fn write(images: &[&[f64]], grid: ImageGrid, seen: &Observation) -> Vec<u8> {
    let units = STOKES.iter().zip(images).enumerate();
    units.flat_map(|(k, (name, image))| unit(name, image, grid, seen, k == 0)).collect()
}

fn unit(name: &str, image: &[f64], grid: ImageGrid, seen: &Observation, first: bool) -> Vec<u8> {
    let mut cards = Cards::default();
    if first {
        cards.value("SIMPLE", "T");
    } else {
        cards.text("XTENSION", "IMAGE");
    }
    cards.value("BITPIX", -64).value("NAXIS", 2);
    cards.value("NAXIS1", grid.width).value("NAXIS2", grid.height);
    if first {
        cards.value("EXTEND", "T");
    } else {
        cards.value("PCOUNT", 0).value("GCOUNT", 1).text("EXTNAME", name);
    }
    let step = grid.pixel_rad.to_degrees();
    let middle = |n: usize| 0.5 * (n as f64 + 1.0);
    cards.text("OBJECT", seen.source.trim()).text("STOKES", name).text("BUNIT", "JY/PIXEL");
    cards.text("CTYPE1", "RA---SIN").text("CTYPE2", "DEC--SIN");
    cards.number("CDELT1", -step).number("CDELT2", step);
    cards.number("CRPIX1", middle(grid.width)).number("CRPIX2", middle(grid.height));
    if let Some(at) = seen.position {
        let (ra, dec) = (15.0 * at.ra_hours, at.dec_deg);
        cards.number("CRVAL1", ra).number("CRVAL2", dec).number("OBSRA", ra).number("OBSDEC", dec);
    }
    let hertz: Option<Vec<f64>> = seen.rows.iter().map(|row| seen.frequency_of(row)).collect();
    if let Some(hertz) = hertz.filter(|hertz| !hertz.is_empty()) {
        cards.number("FREQ", hertz.iter().sum::<f64>() / hertz.len() as f64);
    }
    if let Some(mjd) = seen.mjd {
        cards.number("MJD", mjd.into());
    }
    cards.text("TELESCOP", "VLBI");
    let rows = image.chunks_exact(grid.width).rev().flatten();
    let mut bytes = cards.finish();
    bytes.extend(padded(rows.flat_map(|x| x.to_be_bytes()).collect(), 0));
    bytes
}

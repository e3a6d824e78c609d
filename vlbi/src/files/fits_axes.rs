//! Axes of FITS images: where pixels are on the sky, and which Stokes parameters they hold.

use super::FileError;
use super::fits::Header;
use crate::operator::ImageGrid;

/// Names of Stokes parameters, in the order of their numbers in FITS (1 to 4).
pub const STOKES: [&str; 4] = ["I", "Q", "U", "V"];

/// Position of pixels, and their Stokes parameters.
pub struct Place {
    /// The grid, its middle being the phase centre.
    pub grid: ImageGrid,
    /// True if columns run from east to west.
    pub east_to_west: bool,
    /// Index in [`STOKES`] of each plane; none where the header does not say.
    pub stokes: Option<Vec<usize>>,
}

/// Reads the header of an image.
///
/// # Errors
/// Names the card that says what is not read.
pub fn place(header: &Header<'_>) -> Result<Place, FileError> {
    let axes = header.axes()?;
    let (Some(&width), Some(&height)) = (axes.first(), axes.get(1)) else {
        return Err(header.error("NAXIS", "2 or more: an image"));
    };
    if header.is_true("GROUPS") || width == 0 {
        return Err(FileError::whole("visibilities (UVFITS), not an image"));
    }
    let unit = header.text("BUNIT").unwrap_or_default().to_ascii_uppercase();
    if unit.trim() != "JY/PIXEL" {
        return Err(header.error("BUNIT", "JY/PIXEL"));
    }
    sky(header)?;
    unrotated(header, axes.len())?;
    centred(header, [width, height])?;
    let (east_to_west, pixel_rad) = pixel(header)?;
    let field_rad = pixel_rad * width as f64;
    if !(field_rad > 0.0 && field_rad < 1.0) {
        let degrees = field_rad.to_degrees();
        let message = format!("{width} pixels span {degrees} degrees, in (0, 57.29) is expected");
        return Err(header.error("CDELT1", message));
    }
    let grid =
        ImageGrid::new(width, height, field_rad).map_err(|error| header.error("NAXIS1", error))?;
    Ok(Place { grid, east_to_west, stokes: stokes(header, &axes)? })
}

/// Projections that are the plane of the sky within any field of an interferometer.
const PROJECTIONS: [&str; 6] = ["", "SIN", "TAN", "ARC", "STG", "ZEA"];

/// Refuses axes that are not right ascension and declination in degrees.
fn sky(header: &Header<'_>) -> Result<(), FileError> {
    for (axis, wanted) in [(1, "RA"), (2, "DEC")] {
        let keyword = format!("CTYPE{axis}");
        let said = header.text(&keyword).filter(|kind| !kind.trim().is_empty());
        let kind = said.map_or_else(|| wanted.to_owned(), |kind| kind.to_ascii_uppercase());
        let (name, projection) = kind.split_once('-').unwrap_or((&kind, ""));
        if name.trim() != wanted || !PROJECTIONS.contains(&projection.trim_matches('-')) {
            let message = format!("{wanted}, {wanted} in SIN, TAN, ARC, STG or ZEA");
            return Err(header.error(&keyword, message));
        }
        let keyword = format!("CUNIT{axis}");
        let unit = header.text(&keyword).unwrap_or_default().to_ascii_lowercase();
        if !["", "deg", "degree", "degrees"].contains(&unit.trim()) {
            return Err(header.error(&keyword, "deg"));
        }
    }
    header.check_equinox()?;
    for (keyword, upright) in [("LONPOLE", 180.0), ("PV2_1", 0.0), ("PV2_2", 0.0)] {
        if header.number(keyword)?.is_some_and(|value| value != upright) {
            return Err(header.error(keyword, format!("{upright}: the plane of the sky, upright")));
        }
    }
    Ok(())
}

/// Refuses rotated and sheared axes: CROTA, and matrices that are more than the identity.
fn unrotated(header: &Header<'_>, axes: usize) -> Result<(), FileError> {
    let is = |keyword: &str, allowed: f64, why: &str| match header.number(keyword)? {
        Some(value) if value != allowed => Err(header.error(keyword, why)),
        _ => Ok(()),
    };
    for i in 1..=axes.min(99) {
        is(&format!("CROTA{i}"), 0.0, "0: rotated images are not read")?;
        for j in 1..=axes.min(99) {
            let same = f64::from(u8::from(i == j));
            for keyword in [format!("PC{i}_{j}"), format!("PC{i:03}{j:03}")] {
                is(&keyword, same, "the identity: rotated images are not read")?;
            }
            let keyword = format!("CD{i}_{j}");
            if header.number(&keyword)?.is_some() {
                return Err(header.error(&keyword, "CDELT1 and CDELT2 instead of a matrix"));
            }
        }
    }
    Ok(())
}

/// Refuses a reference pixel off the middle. Programs number the middle of N pixels N/2, (N + 1)/2 or N/2 + 1, and all
/// of them mean the middle.
fn centred(header: &Header<'_>, sizes: [usize; 2]) -> Result<(), FileError> {
    for (axis, size) in (1..).zip(sizes) {
        let keyword = format!("CRPIX{axis}");
        let middle = 0.5 * (size as f64 + 1.0);
        if header.number(&keyword)?.is_some_and(|pixel| (pixel - middle).abs() > 1.0) {
            let message = format!(
                "the middle of the image, {middle}, within a pixel: it is the phase centre"
            );
            return Err(header.error(&keyword, message));
        }
    }
    Ok(())
}

/// Returns whether columns run from east to west, and the side of a pixel in radians.
fn pixel(header: &Header<'_>) -> Result<(bool, f64), FileError> {
    let (east, north) = (header.number_or("CDELT1", 0.0)?, header.number_or("CDELT2", 0.0)?);
    if (east.abs() - north.abs()).abs() > 1e-6 * north.abs() || north <= 0.0 {
        return Err(header.error("CDELT2", "positive degrees, and square pixels with CDELT1"));
    }
    Ok((east < 0.0, east.abs().to_radians()))
}

/// Stokes parameters of the planes: of an axis STOKES, or of a card STOKES or EXTNAME.
fn stokes(header: &Header<'_>, axes: &[usize]) -> Result<Option<Vec<usize>>, FileError> {
    let mut planes = None;
    for (axis, length) in (1..).zip(axes).skip(2) {
        let kind = header.text(&format!("CTYPE{axis}")).unwrap_or_default().to_ascii_uppercase();
        if kind.trim() == "STOKES" {
            planes = Some(numbered(header, axis, *length)?);
        } else if *length != 1 {
            let message = format!(
                "1: of the axis `{}` one plane is read, not the first of many",
                kind.trim()
            );
            return Err(header.error(&format!("NAXIS{axis}"), message));
        }
    }
    let named = |keyword| {
        let name = header.text(keyword)?.trim().to_ascii_uppercase();
        STOKES.iter().position(|stokes| *stokes == name)
    };
    match header.text("STOKES") {
        _ if planes.is_some() => Ok(planes),
        Some(_) => match named("STOKES") {
            Some(k) => Ok(Some(vec![k])),
            None => Err(header.error("STOKES", "I, Q, U or V")),
        },
        None => Ok(named("EXTNAME").map(|k| vec![k])),
    }
}

/// Stokes parameters along an axis of numbers: 1 to 4 for I, Q, U and V.
fn numbered(header: &Header<'_>, axis: usize, length: usize) -> Result<Vec<usize>, FileError> {
    let number = |name: &str| header.number_or(&format!("{name}{axis}"), 1.0);
    let (value, step, pixel) = (number("CRVAL")?, number("CDELT")?, number("CRPIX")?);
    let of_plane = |k: usize| {
        let code = value + (k as f64 + 1.0 - pixel) * step;
        let stokes = (1..=4).find(|stokes| f64::from(*stokes) == code);
        stokes.map(|stokes| stokes as usize - 1).ok_or_else(|| {
            let message =
                format!("plane {} has the number {code}: 1 to 4, for Stokes I, Q, U and V", k + 1);
            header.error(&format!("CRVAL{axis}"), message)
        })
    };
    // Four at most are allowed: a fifth is refused before anything is made for it.
    (0..length).map(of_plane).collect()
}

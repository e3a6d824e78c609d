//! Images and movies to be observed: grids of numbers as CSV, arrays as npy or npz, images as FITS,
//! pictures as EXR.

use crate::output;
use anyhow::{Context, anyhow, bail};
use kerrlight_tomo::image::exr;
use kerrlight_tomo::interferometry::files;
use kerrlight_tomo::interferometry::operator::ImageGrid;
use kerrlight_tomo::interferometry::simulate::Movie;
use kerrlight_tomo::scene::Scene;
use kerrlight_tomo::units::{MICROARCSECOND, gravitational_angle};
use std::io::Read;
use std::path::Path;

/// Numbers of a file before one knows how large they are on the sky: images of Jy/pixel.
struct Pixels {
    width: usize,
    height: usize,
    values: Vec<f64>,
}

/// Reads an image or a movie; `fov_uas` is the width of the field in µas, which an EXR of
/// kerrlight knows itself.
pub fn read(path: &Path, fov_uas: Option<f64>) -> anyhow::Result<Movie> {
    let name = || path.display().to_string();
    let bytes = output::read(path)?;
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    if matches!(extension.to_ascii_lowercase().as_str(), "fits" | "fit") {
        if fov_uas.is_some() {
            bail!("--fov-uas is not for FITS images, which have a field of view");
        }
        return files::read_fits_image(&bytes).with_context(name);
    }
    let (pixels, own_fov) = match extension.to_ascii_lowercase().as_str() {
        "csv" | "txt" => (csv_grid(&bytes).with_context(name)?, None),
        "npy" => (npy(&bytes).with_context(name)?, None),
        "npz" => (npz(&bytes).with_context(name)?, None),
        "exr" => exr_picture(&bytes, fov_uas).with_context(name)?,
        _ => {
            bail!("{}: an image ends in .csv, .npy, .npz, .fits or .exr, a scene in .toml", name())
        }
    };
    let fov = fov_uas.or(own_fov).ok_or_else(|| {
        anyhow!("{} does not tell how large it is on the sky: give --fov-uas", name())
    })?;
    let grid = ImageGrid::new(pixels.width, pixels.height, fov * MICROARCSECOND);
    let grid = grid.context("--fov-uas")?;
    if let Some(k) = pixels.values.iter().position(|value| !value.is_finite()) {
        let (row, column) = (k / pixels.width % pixels.height, k % pixels.width);
        bail!(
            "{}: row {}, column {}: {} is not finite",
            name(),
            row + 1,
            column + 1,
            pixels.values[k]
        );
    }
    Ok(Movie { grid, pixels: pixels.values })
}

/// A row of pixels a line, separated by commas; lines that start with `#` are passed over.
fn csv_grid(bytes: &[u8]) -> anyhow::Result<Pixels> {
    let text = core::str::from_utf8(bytes).context("not UTF-8 text")?;
    let mut pixels = Pixels { width: 0, height: 0, values: Vec::new() };
    for (index, line) in text.lines().enumerate() {
        let (number, line) = (index + 1, line.trim());
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let before = pixels.values.len();
        for (column, cell) in line.trim_end_matches(',').split(',').enumerate() {
            let value = cell.trim().parse().map_err(|_| {
                let cell: String = cell.chars().take(20).collect();
                anyhow!("line {number}, column {}: `{cell}` is not a number", column + 1)
            })?;
            pixels.values.push(value);
        }
        let width = pixels.values.len() - before;
        if pixels.height > 0 && width != pixels.width {
            bail!("line {number}: {width} pixels, the lines before have {}", pixels.width);
        }
        pixels.width = width;
        pixels.height += 1;
    }
    if pixels.values.is_empty() {
        bail!("no pixels");
    }
    Ok(pixels)
}

/// An array of shape (height, width) or (frames, height, width).
fn npy(bytes: &[u8]) -> anyhow::Result<Pixels> {
    let file = npyz::NpyFile::new(bytes).context("not an npy file")?;
    if file.order() != npyz::Order::C {
        bail!("the array is in Fortran's order: save it in C's");
    }
    let (height, width) = match *file.shape() {
        [height, width] | [_, height, width] => (height, width),
        ref shape => {
            bail!("shape {shape:?}: (height, width) or (frames, height, width) is expected")
        }
    };
    let count = file.shape().iter().try_fold(1u64, |product, n| product.checked_mul(*n));
    // At least 4 bytes each, so that a header cannot ask for more memory than there is file.
    if count.is_none_or(|count| count == 0 || count > bytes.len() as u64 / 4) {
        bail!("shape {:?} does not go with {} bytes", file.shape(), bytes.len());
    }
    let values: Vec<f64> = match file.dtype() {
        npyz::DType::Plain(t) if t.type_char() == npyz::TypeChar::Float && t.size_field() == 4 => {
            file.into_vec::<f32>()?.into_iter().map(f64::from).collect()
        }
        _ => file.into_vec::<f64>().context("an array of float32 or float64 is expected")?,
    };
    Ok(Pixels { width: width as usize, height: height as usize, values })
}

/// The only array of an archive, or the one named `movie` or `image`.
fn npz(bytes: &[u8]) -> anyhow::Result<Pixels> {
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(bytes)).context("not an npz")?;
    let names: Vec<String> = (0..archive.len())
        .map(|k| Ok(archive.by_index(k)?.name()?.into_owned()))
        .collect::<anyhow::Result<_>>()?;
    let wanted = |name: &&String| matches!(name.as_str(), "movie.npy" | "image.npy");
    let name = match (names.as_slice(), names.iter().find(wanted)) {
        ([only], _) => only,
        (_, Some(name)) => name,
        _ => bail!("holds {}: an array named movie or image is expected", names.join(", ")),
    };
    let mut array = Vec::new();
    // A deflated array of zeros is a thousand times smaller than the array.
    let most = 20 * bytes.len() as u64 + 4096;
    archive.by_name(name)?.take(most).read_to_end(&mut array)?;
    npy(&array).with_context(|| name.clone())
}

/// The channel `intensity` of a picture. One in Jy/µas² knows its scale; others are taken as
/// Jy/pixel if the field of view is given.
fn exr_picture(bytes: &[u8], fov_uas: Option<f64>) -> anyhow::Result<(Pixels, Option<f64>)> {
    let (picture, attributes) = exr::decode(bytes).context("damaged or unusual EXR")?;
    let channel = picture.channel("intensity").context("has no channel named intensity")?;
    let (width, height) = (picture.width, picture.height);
    let attribute = |name: &str| attributes.get(name).map(String::as_str);
    let is_kerrlight = attribute("intensity_unit").is_some();
    let mut factor = 1.0;
    let mut own_fov = None;
    if attribute("intensity_unit") == Some("Jy/uas^2") {
        let scene = attribute("scene_resolved").context("holds no scene")?;
        let scene = Scene::parse(scene).context("scene in the EXR")?;
        let angle = gravitational_angle(scene.hole.mass_msun, scene.hole.distance_kpc);
        let pixel_uas = scene.pixel_size() * angle;
        factor = pixel_uas * pixel_uas;
        own_fov = Some(pixel_uas * width as f64);
    } else if is_kerrlight {
        bail!("its intensity has no unit of the sky: render it with screen.total_flux_jy");
    } else if fov_uas.is_none() {
        bail!("is not of kerrlight: give --fov-uas, and its intensity counts as Jy/pixel");
    }
    let values = channel.iter().map(|value| f64::from(*value) * factor).collect();
    Ok((Pixels { width, height, values }, own_fov))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_grids_of_numbers() {
        let pixels = csv_grid(b"# Jy/pixel\n1, 2,3\n\n4,5e-1,-6\n").unwrap();
        assert_eq!((pixels.width, pixels.height), (3, 2));
        assert_eq!(pixels.values, [1.0, 2.0, 3.0, 4.0, 0.5, -6.0]);
        let fail = |text: &str| csv_grid(text.as_bytes()).err().unwrap().to_string();
        assert!(fail("1,2\n3\n").contains("line 2: 1 pixels"));
        assert!(fail("#\n1,x\n").contains("line 2, column 2: `x`"));
        assert!(fail("# nothing\n").contains("no pixels"));
    }
}

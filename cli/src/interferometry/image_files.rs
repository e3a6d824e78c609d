//! Images and movies of one file to be observed: grids of numbers as CSV, arrays as npy or npz,
//! images as FITS, pictures as EXR.

use crate::{npz, output};
use anyhow::{Context, anyhow, bail};
use kerrlight_tomo::image::exr;
use kerrlight_tomo::interferometry::files;
use kerrlight_tomo::interferometry::operator::ImageGrid;
use kerrlight_tomo::interferometry::simulate::Movie;
use kerrlight_tomo::memory;
use kerrlight_tomo::scene::Scene;
use kerrlight_tomo::units::MICROARCSECOND;
use std::path::Path;

/// Numbers of a file before one knows how large they are on the sky: images of Jy/pixel.
#[derive(Default)]
struct Pixels {
    width: usize,
    height: usize,
    values: Vec<f64>,
    /// Width of the field in µas, where the file tells.
    field_uas: Option<f64>,
    times: OwnTimes,
}

/// When the images of a file show the source, as far as it tells.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum OwnTimes {
    /// It does not tell.
    #[default]
    Unknown,
    /// Hours of UTC.
    Utc(Vec<f64>),
    /// Hours since some moment.
    Since(Vec<f64>),
}

/// Reads an image or a movie; `fov_uas` is the width of the field in µas, which FITS and an EXR of
/// kerrlight know themselves.
pub fn read(path: &Path, fov_uas: Option<f64>) -> anyhow::Result<(Movie, OwnTimes)> {
    let name = || path.display().to_string();
    let bytes = output::read(path)?;
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    let pixels = match extension.to_ascii_lowercase().as_str() {
        "fits" | "fit" if fov_uas.is_some() => {
            bail!("--fov-uas is not for FITS images, which have a field of view")
        }
        "fits" | "fit" => {
            let movie = files::read_fits_image(&bytes).with_context(name)?;
            return Ok((movie, OwnTimes::Unknown));
        }
        "csv" | "txt" => csv_grid(&bytes),
        "npy" => npy(&bytes),
        "npz" => npz_movie(&bytes),
        "exr" => exr_picture(&bytes, fov_uas),
        _ => {
            bail!("{}: an image ends in .csv, .npy, .npz, .fits or .exr, a scene in .toml", name())
        }
    };
    let pixels = pixels.with_context(name)?;
    let fov = fov_uas.or(pixels.field_uas).ok_or_else(|| {
        anyhow!("{} does not tell how large it is on the sky: give --fov-uas", name())
    })?;
    let grid = ImageGrid::new(pixels.width, pixels.height, fov * MICROARCSECOND);
    let grid = grid.context("--fov-uas")?;
    all_finite(&pixels).with_context(name)?;
    Ok((Movie { grid, pixels: pixels.values }, pixels.times))
}

fn all_finite(pixels: &Pixels) -> anyhow::Result<()> {
    let bad = pixels.values.iter().position(|value| !value.is_finite());
    let Some(k) = bad else { return Ok(()) };
    let (row, column) = (k / pixels.width % pixels.height + 1, k % pixels.width + 1);
    bail!("row {row}, column {column}: {} is not finite", pixels.values[k])
}

/// A row of pixels a line, separated by commas; lines that start with `#` are passed over.
fn csv_grid(bytes: &[u8]) -> anyhow::Result<Pixels> {
    let text = core::str::from_utf8(bytes).context("not UTF-8 text")?;
    let mut pixels = Pixels::default();
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
    let (shape, values) = npy_array(bytes)?;
    let [.., height, width] = shape[..] else { bail!("shape {shape:?}: {IMAGE_SHAPES}") };
    if shape.len() > 3 {
        bail!("shape {shape:?}: {IMAGE_SHAPES}");
    }
    Ok(Pixels { width: width as usize, height: height as usize, values, ..Pixels::default() })
}

const IMAGE_SHAPES: &str = "(height, width) or (frames, height, width) is expected";

/// Shape and numbers of an array.
pub fn npy_array(bytes: &[u8]) -> anyhow::Result<(Vec<u64>, Vec<f64>)> {
    let file = npyz::NpyFile::new(bytes).context("not an npy file")?;
    let in_fortran = file.order() == npyz::Order::Fortran;
    let shape = file.shape().to_vec();
    let count = shape.iter().try_fold(1u64, |product, n| product.checked_mul(*n));
    // At least a byte each, so that a header cannot ask for more memory than there is file.
    if count.is_none_or(|count| count == 0 || count > bytes.len() as u64) {
        bail!("shape {shape:?} does not go with {} bytes", bytes.len());
    }
    let values = 8.0 * count.unwrap_or_default() as f64;
    memory::afford(|| format!("the array of shape {shape:?}"), values)?;
    let values = numbers(file)?;
    let values = if in_fortran { in_c_order(&shape, &values) } else { values };
    Ok((shape, values))
}

/// Values whose first index runs fastest, with the last running fastest.
fn in_c_order(shape: &[u64], values: &[f64]) -> Vec<f64> {
    let shape: Vec<usize> = shape.iter().map(|n| *n as usize).collect();
    let mut index = vec![0; shape.len()];
    let mut ordered = Vec::with_capacity(values.len());
    for _ in 0..values.len() {
        let at = index.iter().zip(&shape).rev().fold(0, |at, (k, n)| at * n + k);
        ordered.push(values[at]);
        for (k, n) in index.iter_mut().zip(&shape).rev() {
            *k += 1;
            if *k < *n {
                break;
            }
            *k = 0;
        }
    }
    ordered
}

/// The values of an array of any number type that does not depend on the machine.
fn numbers(file: npyz::NpyFile<&[u8]>) -> anyhow::Result<Vec<f64>> {
    use npyz::TypeChar::{Float, Int, Uint};
    fn widened<T: npyz::Deserialize + Into<f64>>(
        file: npyz::NpyFile<&[u8]>,
    ) -> anyhow::Result<Vec<f64>> {
        Ok(file.into_vec::<T>()?.into_iter().map(Into::into).collect())
    }
    let kind = match file.dtype() {
        npyz::DType::Plain(plain) => Some((plain.type_char(), plain.size_field())),
        _ => None,
    };
    match kind {
        Some((Float, 4)) => widened::<f32>(file),
        Some((Float, 8)) => widened::<f64>(file),
        Some((Int, 1)) => widened::<i8>(file),
        Some((Int, 2)) => widened::<i16>(file),
        Some((Int, 4)) => widened::<i32>(file),
        Some((Int, 8)) => Ok(file.into_vec::<i64>()?.into_iter().map(|n| n as f64).collect()),
        Some((Uint, 1)) => widened::<u8>(file),
        Some((Uint, 2)) => widened::<u16>(file),
        Some((Uint, 4)) => widened::<u32>(file),
        Some((Uint, 8)) => Ok(file.into_vec::<u64>()?.into_iter().map(|n| n as f64).collect()),
        _ => bail!(
            "values of type {}: whole numbers, float32 or float64 are expected",
            file.dtype().descr()
        ),
    }
}

/// The only array of an archive, or the one named `movie`, `image` or `recovered` (of a fit); `times` are hours of
/// UTC, `hours` those since some moment, `field_uas` is the width of the field.
fn npz_movie(bytes: &[u8]) -> anyhow::Result<Pixels> {
    let mut archive = npz::open(bytes)?;
    let names: Vec<String> = (0..archive.len())
        .map(|k| Ok(archive.by_index(k)?.name()?.into_owned()))
        .collect::<anyhow::Result<_>>()?;
    let there = |wanted: &str| names.iter().find(|name| *name == wanted);
    let name = match (names.as_slice(), IMAGES.iter().find_map(|name| there(name))) {
        ([only], _) => only,
        (_, Some(name)) => name,
        _ => bail!(
            "holds {}: an array named movie, image or recovered is expected",
            names.join(", ").replace(".npy", "")
        ),
    };
    let mut member = |name: &str| -> anyhow::Result<Vec<u8>> {
        npz::member(&mut archive, name)?.with_context(|| format!("holds no {name}"))
    };
    let mut pixels = npy(&member(name)?).with_context(|| name.clone())?;
    let mut numbers = |of: &str| -> anyhow::Result<Option<Vec<f64>>> {
        let bytes = there(of).filter(|of| *of != name).map(|of| member(of)).transpose()?;
        Ok(bytes
            .map(|bytes| npy_array(&bytes).context(of.to_owned()))
            .transpose()?
            .map(|(_, all)| all))
    };
    if let Some(hours) = numbers("hours.npy")? {
        pixels.times = OwnTimes::Since(hours);
    }
    if let Some(hours) = numbers("times.npy")? {
        pixels.times = OwnTimes::Utc(hours);
    }
    pixels.field_uas = numbers("field_uas.npy")?.and_then(|all| all.first().copied());
    Ok(pixels)
}

/// Names of arrays that are images, the first that is there counts.
const IMAGES: [&str; 3] = ["movie.npy", "image.npy", "recovered.npy"];

/// The channel `intensity` of a picture. One in Jy/µas² knows its scale; others are taken as
/// Jy/pixel if the field of view is given.
fn exr_picture(bytes: &[u8], fov_uas: Option<f64>) -> anyhow::Result<Pixels> {
    let (picture, attributes) = exr::decode(bytes).context("damaged or unusual EXR")?;
    let channel = picture.channel("intensity").context("has no channel named intensity")?;
    let (width, height) = (picture.width, picture.height);
    let attribute = |name: &str| attributes.get(name).map(String::as_str);
    let in_pixels = |factor: f64| Pixels {
        width,
        height,
        values: channel.iter().map(|value| f64::from(*value) * factor).collect(),
        ..Pixels::default()
    };
    match attribute("intensity_unit") {
        Some("Jy/uas^2") => {
            let scene = attribute("scene_resolved").context("holds no scene")?;
            let scene = Scene::parse(scene).context("scene in the EXR")?;
            let angle = scene.hole.angle_uas().context("its scene has no mass or distance")?;
            let seconds = scene.hole.seconds().context("its scene has no mass")?;
            let pixel_uas = scene.pixel_size() * angle;
            let hours = scene.observer.time * seconds / 3600.0;
            let field_uas = Some(pixel_uas * width as f64);
            let times = OwnTimes::Since(vec![hours]);
            Ok(Pixels { field_uas, times, ..in_pixels(pixel_uas * pixel_uas) })
        }
        Some(_) => {
            bail!("its intensity has no unit of the sky: render it with screen.total_flux_jy")
        }
        None if fov_uas.is_none() => {
            bail!("is not of kerrlight: give --fov-uas, and its intensity counts as Jy/pixel")
        }
        None => Ok(in_pixels(1.0)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An array and its transpose in the other order are the same bytes of numbers.
    #[test]
    fn exact_fortran_order() {
        let write = |order, values: &[f64]| {
            use npyz::WriterBuilder;
            let mut bytes = Vec::new();
            let options = npyz::WriteOptions::new().default_dtype().order(order);
            let mut writer = options.shape(&[2, 3, 4]).writer(&mut bytes).begin_nd().unwrap();
            writer.extend(values.iter().copied()).unwrap();
            writer.finish().unwrap();
            bytes
        };
        let value = |i: usize, j: usize, k: usize| (100 * i + 10 * j + k) as f64;
        let in_c: Vec<f64> = (0..24).map(|n| value(n / 12, n / 4 % 3, n % 4)).collect();
        let in_fortran: Vec<f64> = (0..24).map(|n| value(n % 2, n / 2 % 3, n / 6)).collect();
        let c = npy_array(&write(npyz::Order::C, &in_c)).unwrap();
        let fortran = npy_array(&write(npyz::Order::Fortran, &in_fortran)).unwrap();
        assert_eq!(c, (vec![2, 3, 4], in_c));
        assert_eq!(fortran, c);
    }

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

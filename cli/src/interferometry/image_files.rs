//! Images and movies of one file to be observed: grids of numbers as CSV, arrays as npy or npz,
//! images as FITS, pictures as EXR.

use crate::{output, paths};
use anyhow::{Context, anyhow, bail};
use kerrlight_vlbi::files::{self, images};
use kerrlight_vlbi::simulate::StokesMovie;
use std::path::Path;

pub use images::OwnTimes;

/// Reads an image or a movie; `fov_uas` is the width of the field in µas, which FITS and an EXR of
/// kerrlight know themselves.
pub fn read(path: &Path, fov_uas: Option<f64>) -> anyhow::Result<(StokesMovie, OwnTimes)> {
    let name = || path.display().to_string();
    let bytes = output::read(path)?;
    let extension = paths::ending(path);
    let pixels = match extension.as_str() {
        "fits" | "fit" if fov_uas.is_some() => {
            bail!("--fov-uas is not for FITS images, which have a field of view")
        }
        "csv" | "txt" if files::is_text_image(&bytes) => {
            if fov_uas.is_some() {
                bail!("--fov-uas is not for text images of eht-imaging, which have a field of view")
            }
            files::parse_text_image(&bytes).with_context(name)?
        }
        "fits" | "fit" => {
            let movie = files::read_fits_image(&bytes).with_context(name)?;
            return Ok((movie, OwnTimes::Unknown));
        }
        "csv" | "txt" => images::csv_grid(&bytes).with_context(name)?,
        "npy" => images::npy(&bytes).with_context(name)?,
        "npz" => images::npz_movie(&bytes).with_context(name)?,
        "exr" => kerrlight_tomo::exr_picture::read(&bytes).with_context(name)?,
        _ => {
            bail!("{}: an image ends in .csv, .npy, .npz, .fits or .exr, a scene in .toml", name())
        }
    };
    let field = fov_uas.or(pixels.field_uas).ok_or_else(|| match extension.as_str() {
        "exr" => anyhow!(
            "{}: is not of kerrlight: give --fov-uas, and its intensity counts as Jy/pixel",
            name()
        ),
        _ => anyhow!("{} does not tell how large it is on the sky: give --fov-uas", name()),
    })?;
    let times = pixels.times.clone();
    let source = || if fov_uas.is_some() { format!("{}, --fov-uas", name()) } else { name() };
    Ok((pixels.movie(field).with_context(source)?, times))
}

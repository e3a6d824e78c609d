//! Starter file for images.

use super::template::{complete, digits};
use crate::interferometry::image_files::OwnTimes;
use crate::interferometry::movie_files;
use anyhow::bail;
use kerrlight_common::units::MICROARCSECOND;
use kerrlight_vlbi::simulate::{Movie, StokesMovie};
use std::path::Path;

/// Images, their times and the width of their field in µas, as far as the file tells.
pub struct Images {
    movie: Movie,
    times: OwnTimes,
    field_uas: Option<f64>,
}

pub fn read_movie(path: &Path) -> anyhow::Result<Images> {
    let files = movie_files::files(path)?;
    let of = |(StokesMovie { i: movie, .. }, times): (StokesMovie, OwnTimes), known: bool| {
        let field = movie.grid.pixel_rad * movie.grid.width as f64 / MICROARCSECOND;
        Images { movie, times, field_uas: known.then_some(field) }
    };
    // First without a field: FITS and text images, which have one, refuse another.
    movie_files::read(&files, None).map(|read| of(read, true)).or_else(|first| {
        movie_files::read(&files, Some(1.0)).map(|read| of(read, false)).map_err(|_| first)
    })
}

pub fn of_movie(images: &Images, path: &str) -> anyhow::Result<String> {
    let Images { movie, times, field_uas } = images;
    let grid = movie.grid;
    if grid.width != grid.height {
        bail!("images of {} x {} pixels: a fit needs square images", grid.width, grid.height);
    }
    let flux =
        movie.pixels.chunks(grid.pixels()).map(|image| image.iter().sum()).fold(0.0, f64::max);
    let peak = movie.pixels.iter().copied().fold(0.0, f64::max);
    if flux <= 0.0 {
        bail!("all pixels of the images are zero");
    }
    let jy = flux / (grid.pixels() as f64 * 4.0 * 0.02);
    let span = field_uas
        .map_or(String::new(), |field| format!("; on the sky it is {field:.1} microarcseconds"));
    let hours = match times {
        OwnTimes::Unknown => String::new(),
        OwnTimes::Utc(hours) | OwnTimes::Since(hours) => match hours[..] {
            [first, .., last] => format!("; they span {:.4} hours", last - first),
            _ => String::new(),
        },
    };
    let fields = [
        ("title", "Images".to_owned()),
        ("pixels", grid.width.to_string()),
        ("jy", digits(jy)),
        ("upper", digits(10.0 * (peak / jy).max(1.0))),
        ("flux", digits(flux)),
        ("peak", digits(peak)),
        ("span", span),
        ("hours", hours),
        ("path", path.to_owned()),
    ];
    complete(include_str!("movie.toml"), &fields)
}

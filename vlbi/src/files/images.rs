//! Images and movies as grids of numbers, arrays of NumPy, and pictures in EXR.

use super::{FileError, shortened};
use crate::Error;
use crate::operator::ImageGrid;
use crate::simulate::{Movie, StokesMovie};
use kerrlight_common::frames::Frames;
use kerrlight_common::memory;
use kerrlight_common::numpy::{
    Archive, ArchiveWriter, NumpyError, Stream, read_array, write_archive, write_array,
};
use kerrlight_common::simd::Float;
use kerrlight_common::units::MICROARCSECOND;
use std::io::{Read, Seek, Write};

type Result<T> = std::result::Result<T, FileError>;

/// Numbers of a file before one knows how large they are on the sky: images of Jy/pixel.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Pixels {
    /// Pixels of a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Stokes I in Jy/pixel, image after image, rows from the north.
    pub values: Vec<f64>,
    /// Q, U and V, as far as the file has them.
    pub polarized: [Option<Vec<f64>>; 3],
    /// Width of the field in µas, where the file tells.
    pub field_uas: Option<f64>,
    /// Times of the images.
    pub times: OwnTimes,
}

/// Times of the images of a file, as far as it tells.
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

impl Pixels {
    /// The movie on a field of this width in microarcseconds.
    ///
    /// # Errors
    /// If the field is out of range, a pixel is not finite, or there is one of Q and U.
    pub fn movie(self, field_uas: f64) -> Result<StokesMovie> {
        let grid = ImageGrid::new(self.width, self.height, field_uas * MICROARCSECOND);
        let grid = grid.map_err(|error| FileError::whole(error.to_string()))?;
        let size = [self.width, self.height];
        all_finite(&self.values, size)?;
        for (name, values) in ["Q", "U", "V"].iter().zip(&self.polarized) {
            let named = |error: FileError| FileError::whole(format!("Stokes {name}: {error}"));
            values.iter().try_for_each(|values| all_finite(values, size).map_err(named))?;
        }
        if self.polarized[0].is_some() != self.polarized[1].is_some() {
            return Err(FileError::whole("has one of Stokes Q and U: both are needed, or none"));
        }
        let i = Movie { grid, pixels: self.values };
        Ok(StokesMovie { i, polarized: self.polarized })
    }
}

/// Refuses pixels that are no numbers.
fn all_finite(values: &[f64], [width, height]: [usize; 2]) -> Result<()> {
    let bad = values.iter().position(|value| !value.is_finite());
    let Some(k) = bad else { return Ok(()) };
    let (row, column) = (k / width % height + 1, k % width + 1);
    Err(FileError::whole(format!("row {row}, column {column}: {} is not finite", values[k])))
}

/// A row of pixels a line, separated by commas; lines that start with `#` are passed over.
///
/// # Errors
/// Names the line and the column that is no number, and lines of other lengths.
pub fn csv_grid(bytes: &[u8]) -> Result<Pixels> {
    let text = core::str::from_utf8(bytes);
    let text = text.map_err(|error| FileError::whole(format!("not UTF-8 text: {error}")))?;
    let mut pixels = Pixels::default();
    for (index, line) in text.lines().enumerate() {
        let (number, line) = (index + 1, line.trim());
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let before = pixels.values.len();
        for (column, cell) in line.trim_end_matches(',').split(',').enumerate() {
            let value = cell.trim().parse().map_err(|_| {
                let (cell, at) = (shortened(cell), format!("line {number}, column {}", column + 1));
                FileError::whole(format!("{at}: `{cell}` is not a number"))
            })?;
            pixels.values.push(value);
        }
        let width = pixels.values.len() - before;
        if pixels.height > 0 && width != pixels.width {
            let message = format!("{width} pixels, the lines before have {}", pixels.width);
            return Err(FileError::line(number, message));
        }
        pixels.width = width;
        pixels.height += 1;
    }
    if pixels.values.is_empty() {
        return Err(FileError::whole("no pixels"));
    }
    Ok(pixels)
}

/// An array of shape (height, width) or (frames, height, width).
///
/// # Errors
/// If it has another shape.
pub fn npy(bytes: &[u8]) -> std::result::Result<Pixels, Error> {
    let (shape, values) = read_array(bytes)?;
    let (&[height, width] | &[_, height, width]) = &shape[..] else {
        return Err(NumpyError::content(format!("shape {shape:?}: {IMAGE_SHAPES}")).into());
    };
    Ok(Pixels { width: width as usize, height: height as usize, values, ..Pixels::default() })
}

const IMAGE_SHAPES: &str = "(height, width) or (frames, height, width) is expected";

/// The only array of an archive, or the one named `movie`, `image` or `recovered` (of a fit); `times` are hours of
/// UTC, `hours` those since some moment, `field_uas` is the width of the field.
///
/// # Errors
/// If there is no such array, or it has another shape.
pub fn npz_movie(bytes: &[u8]) -> std::result::Result<Pixels, Error> {
    let mut archive = Archive::open(bytes)?;
    let names = archive.names()?;
    let name = image_of(&names)?.to_owned();
    let (field_uas, times) = facts(&mut archive, &names, &name)?;
    let none = || NumpyError::content(format!("holds no {name}"));
    let pixels = npy(&archive.member(&name)?.ok_or_else(none)?);
    let pixels = pixels.map_err(|error| NumpyError::member(format!("{name}.npy"), error))?;
    Ok(Pixels { times, field_uas, ..pixels })
}

/// Width of the field in µas and times of an archive, as [`npz_movie`] finds them, without its images.
///
/// # Errors
/// As those of [`npz_movie`].
pub fn npz_facts(file: impl Read + Seek) -> std::result::Result<(Option<f64>, OwnTimes), Error> {
    let mut archive = Archive::of(file)?;
    let names = archive.names()?;
    let name = image_of(&names)?.to_owned();
    facts(&mut archive, &names, &name)
}

fn facts<R: Read + Seek>(
    archive: &mut Archive<R>,
    names: &[String],
    image: &str,
) -> std::result::Result<(Option<f64>, OwnTimes), Error> {
    let mut member = |wanted: &str| -> std::result::Result<_, Error> {
        if wanted == image || !names.iter().any(|name| name == wanted) {
            return Ok(None);
        }
        let bytes = archive.member(wanted)?;
        let array = bytes.map(|bytes| read_array(&bytes)).transpose();
        Ok(array
            .map_err(|error| NumpyError::member(format!("{wanted}.npy"), error))?
            .map(|(_, all)| all))
    };
    let (hours, times) = (member("hours")?, member("times")?);
    let field_uas = match member("field_uas")?.as_deref() {
        None => None,
        Some([field]) => Some(*field),
        Some(several) => {
            let message = format!("field_uas.npy: {} numbers: one is expected", several.len());
            return Err(NumpyError::content(message).into());
        }
    };
    let times = times.map(OwnTimes::Utc).or(hours.map(OwnTimes::Since)).unwrap_or_default();
    Ok((field_uas, times))
}

/// Images with their width and height.
pub type WithSize = (Frames<f64>, [usize; 2]);

/// Images of an NPY file as [`npy`] takes them, read one after the other: they need not fit into memory.
///
/// # Errors
/// If it has another shape, or a number that is not finite.
pub fn npy_frames(file: impl Read) -> std::result::Result<WithSize, Error> {
    frames_of(Stream::new(file)?)
}

/// The same of an archive as [`npz_movie`] takes it.
///
/// # Errors
/// As those of [`npy_frames`], or if there is no such array.
pub fn npz_frames(file: impl Read + Seek) -> std::result::Result<WithSize, Error> {
    let mut archive = Archive::of(file)?;
    let names = archive.names()?;
    let name = image_of(&names)?;
    let frames = frames_of(archive.stream(name)?);
    Ok(frames.map_err(|error| NumpyError::member(format!("{name}.npy"), error))?)
}

fn frames_of<R: Read>(array: Stream<R>) -> std::result::Result<WithSize, Error> {
    let shape = array.shape().to_vec();
    let (count, [height, width]) = match shape[..] {
        [height, width] => (1, [height, width]),
        [count, height, width] => (count, [height, width]),
        _ => return Err(NumpyError::content(format!("shape {shape:?}: {IMAGE_SHAPES}")).into()),
    };
    let [count, height, width] = [count, height, width].map(|n| n as usize);
    let pixels = height.checked_mul(width).filter(|pixels| *pixels > 0 && count > 0);
    let bytes = |pixels: &usize| count.checked_mul(8).and_then(|all| pixels.checked_mul(all));
    let pixels = pixels.filter(|pixels| bytes(pixels).is_some());
    let pixels =
        pixels.ok_or_else(|| NumpyError::content(format!("shape {shape:?}: no pixels")))?;
    // Images need not be in memory together; one has to.
    let what = || format!("an image of {width} x {height} pixels");
    memory::afford(what, memory::movie(1.0, pixels as f64))?;
    let frames = Frames::made(count, pixels, |sink| {
        array.chunks(pixels, |image: &[f64]| -> std::result::Result<(), Error> {
            all_finite(image, [width, height])?;
            Ok(sink(image)?)
        })
    });
    Ok((frames?, [width, height]))
}

/// The array that is images, of those with these names: the only one, or the one named `movie`, `image` or `recovered`.
///
/// # Errors
/// If there is no such array.
pub fn image_of(names: &[String]) -> std::result::Result<&str, NumpyError> {
    let there = |wanted: &&&str| names.iter().any(|name| name == **wanted);
    match (names, IMAGES.iter().find(there)) {
        ([only], _) => Ok(only),
        (_, Some(name)) => Ok(name),
        _ => Err(NumpyError::content(format!(
            "holds {}: an array named movie, image or recovered is expected",
            names.join(", ")
        ))),
    }
}

/// Names of arrays that are images, the first that is there counts.
const IMAGES: [&str; 3] = ["movie", "image", "recovered"];

/// The bytes of an NPZ archive of movies of one shape (frames, rows from the top, columns), with lists of numbers
/// such as the times of the frames.
pub fn movie_archive(
    shape: [usize; 3],
    movies: &[(&str, Vec<f32>)],
    lists: &[(&str, Vec<f64>)],
) -> Vec<u8> {
    let shape = shape.map(|n| n as u64);
    let movies =
        movies.iter().map(|(name, movie)| (*name, write_array(&shape, movie.iter().copied())));
    let lists = lists
        .iter()
        .map(|(name, list)| (*name, write_array(&[list.len() as u64], list.iter().copied())));
    write_archive(movies.chain(lists))
}

/// The same of movies that need not be in memory, one after the other.
pub struct MovieWriter<W: Write + Seek> {
    archive: ArchiveWriter<W>,
    side: usize,
}

impl<W: Write + Seek> MovieWriter<W> {
    /// Writes images of `side` × `side` pixels into this file.
    pub fn new(out: W, side: usize) -> Self {
        Self { archive: ArchiveWriter::new(out), side }
    }

    /// Adds a movie in single precision.
    ///
    /// # Errors
    /// If it cannot be read or written.
    pub fn add<T: Float>(
        &mut self,
        name: &str,
        movie: &Frames<T>,
    ) -> std::result::Result<(), Error> {
        let shape = [movie.count(), self.side, self.side].map(|n| n as u64);
        let added = self.archive.add(name, &shape, |sink| {
            movie.images().try_for_each(|image| {
                let image: Vec<f32> = image?.iter().map(|x| x.double() as f32).collect();
                sink(&image)
            })
        });
        Ok(added?)
    }

    /// Adds a list of numbers.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn list(&mut self, name: &str, list: &[f64]) -> std::result::Result<(), Error> {
        Ok(self.archive.add(name, &[list.len() as u64], |sink| sink(list))?)
    }

    /// Ends the file.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(self) -> std::result::Result<(), Error> {
        self.archive.finish()?;
        Ok(())
    }
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

    /// Planes of numbers that are not finite, and Q without U, are refused by name.
    #[test]
    fn exact_polarised_pixels_are_checked() {
        let of = |polarized| {
            let pixels =
                Pixels { width: 1, height: 1, values: vec![1.0], polarized, ..Pixels::default() };
            pixels.movie(10.0)
        };
        assert!(of([Some(vec![0.5]), Some(vec![0.25]), None]).is_ok());
        let message = of([Some(vec![0.5]), Some(vec![f64::NAN]), None]).unwrap_err().to_string();
        assert!(message.contains("Stokes U: row 1, column 1"), "{message}");
        assert!(of([Some(vec![0.5]), None, None]).unwrap_err().to_string().contains("Q and U"));
    }
}

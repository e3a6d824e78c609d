//! A movie through an array: what [`schedule::observe`](super::schedule::observe) lays out, filled
//! with the visibilities of images.

use super::Complex64;
use super::observation::{Basis, Observation};
use super::operator::{ImageGrid, Method, Operator, Pulse, Transform};
use crate::Error;
use core::ops::Range;
use kerrlight_common::frames::Frames;
use kerrlight_common::memory;

/// Exponentials up to this many bytes are kept while a movie is transformed.
const MEMORY: usize = 256 << 20;

/// Images in Jy/pixel that follow each other.
#[derive(Debug, Clone, PartialEq)]
pub struct Movie {
    /// Grid of pixels.
    pub grid: ImageGrid,
    /// Jy per pixel: image after image, row by row from the north, each row from the east.
    pub pixels: Vec<f64>,
}

impl Movie {
    /// Returns the number of images.
    pub fn frames(&self) -> usize {
        self.pixels.len() / self.grid.pixels().max(1)
    }
}

/// Images of Stokes I, and of Q, U and V as far as they are known.
#[derive(Debug, Clone, PartialEq)]
pub struct StokesMovie {
    /// Total intensity.
    pub i: Movie,
    /// Q, U and V in Jy per pixel, each as the pixels of I are.
    pub polarized: [Option<Vec<f64>>; 3],
}

impl From<Movie> for StokesMovie {
    fn from(i: Movie) -> Self {
        StokesMovie { i, polarized: [None, None, None] }
    }
}

/// Sets the visibilities of unpolarised emission. Image k shows the source at `times_h[k]` (hours
/// of UTC, increasing); between two images it is the linear interpolation of both, which is that of
/// their visibilities. An only image is seen always, and its time does not matter. Says which
/// transform it has taken.
///
/// # Errors
/// If the accuracy of the transform is out of range, the number of images is not that of times, times do not increase, a row lies before the
/// first or after the last image, or a visibility overflows.
pub fn fill(
    observation: &mut Observation,
    movie: &Movie,
    pulse: Pulse,
    times_h: &[f64],
    method: Method,
) -> Result<String, Error> {
    let (how, seen) = all_seen(observation, movie.grid, &movie.pixels, pulse, times_h, method)?;
    set(observation, &seen);
    Ok(how)
}

/// The same of images that need not be in memory, by direct sums.
///
/// # Errors
/// As those of [`fill`], or if an image cannot be read.
pub fn fill_from(
    observation: &mut Observation,
    grid: ImageGrid,
    movie: &Frames<f64>,
    pulse: Pulse,
    times_h: &[f64],
) -> Result<(), Error> {
    let shares = shares(observation, movie.count(), times_h)?;
    let mut visibilities = Vec::new();
    for first in (0..movie.count()).step_by(AT_A_TIME) {
        let range = first..(first + AT_A_TIME).min(movie.count());
        let some = some_of(movie, range.clone())?;
        let shares = &shares[range];
        visibilities.extend(seen(observation, shares, grid, pulse, Method::Direct, &some)?.1);
    }
    let seen = summed(observation.rows.len(), &shares, visibilities)?;
    set(observation, &seen);
    Ok(())
}

/// Images that are transformed together.
const AT_A_TIME: usize = 16;

fn some_of(movie: &Frames<f64>, range: Range<usize>) -> Result<Vec<f64>, Error> {
    let mut some = Vec::with_capacity(range.len() * movie.pixels());
    for frame in range {
        some.extend_from_slice(&movie.image(frame)?);
    }
    Ok(some)
}

/// Rows that see an image, each with its share.
type Shares = Vec<(usize, f64)>;

/// The shares of all images.
fn shares(observation: &Observation, frames: usize, times_h: &[f64]) -> Result<Vec<Shares>, Error> {
    check(frames, times_h)?;
    let mut shares: Vec<Shares> = vec![Vec::new(); frames];
    for (index, row) in observation.rows.iter().enumerate() {
        for (frame, weight) in neighbours(times_h, row.time_h)? {
            shares[frame].push((index, weight));
        }
    }
    Ok(shares)
}

/// Returns the visibilities of images at the rows, image after image.
fn seen(
    observation: &Observation,
    shares: &[Shares],
    grid: ImageGrid,
    pulse: Pulse,
    method: Method,
    pixels: &[f64],
) -> Result<(Transform<f64>, Vec<Complex64>), Error> {
    let uv_of = |shares: &Shares| shares.iter().map(|(row, _)| observation.rows[*row].uv).collect();
    let uv: Vec<Vec<[f64; 2]>> = shares.iter().map(uv_of).collect();
    let memory = MEMORY.min(memory::part(1.0 / 8.0) as usize);
    let operator = Transform::<f64>::new(grid, pulse, &uv, method, memory)?;
    let mut visibilities = vec![Complex64::new(0.0, 0.0); operator.data()];
    operator.forward(pixels, &mut visibilities);
    Ok((operator, visibilities))
}

/// Returns the visibilities of a movie at every row, and how it was transformed.
fn all_seen(
    observation: &Observation,
    grid: ImageGrid,
    pixels: &[f64],
    pulse: Pulse,
    times_h: &[f64],
    method: Method,
) -> Result<(String, Vec<Complex64>), Error> {
    let shares = shares(observation, pixels.len() / grid.pixels().max(1), times_h)?;
    let (operator, visibilities) = seen(observation, &shares, grid, pulse, method, pixels)?;
    Ok((operator.describe(), summed(observation.rows.len(), &shares, visibilities)?))
}

/// The sums of the shares of every row.
fn summed(
    rows: usize,
    shares: &[Shares],
    visibilities: Vec<Complex64>,
) -> Result<Vec<Complex64>, Error> {
    let mut sums = vec![Complex64::new(0.0, 0.0); rows];
    for ((row, weight), v) in shares.iter().flatten().zip(visibilities) {
        sums[*row] += v * weight;
    }
    let size = |v: &Complex64| v.re.abs() + v.im.abs();
    match sums.iter().map(size).find(|size| !size.is_finite()) {
        Some(size) => {
            let allowed = "finite: the sum of so bright pixels overflows";
            Err(Error::out_of_range("visibility", size, allowed))
        }
        None => Ok(sums),
    }
}

/// Sets the rows to these visibilities of Stokes I.
fn set(observation: &mut Observation, seen: &[Complex64]) {
    let none = Complex64::new(0.0, 0.0);
    let circular = observation.basis == Basis::Circular;
    for (row, i) in observation.rows.iter_mut().zip(seen) {
        row.products = [*i, if circular { *i } else { none }, none, none];
    }
}

/// Sets the visibilities of all Stokes parameters that are known: RR = I + V, LL = I − V, RL = Q + iU, LR = Q − iU.
/// Without V, both parallel hands are I; without Q and U, RL and LR are marked as not measured (σ = NaN). Otherwise as
/// [`fill`].
///
/// # Errors
/// As [`fill`], if Q is known without U or the other way round, or if there is polarised light and the observation's
/// products are not those of circular feeds.
pub fn fill_stokes(
    observation: &mut Observation,
    movie: &StokesMovie,
    pulse: Pulse,
    times_h: &[f64],
    method: Method,
) -> Result<String, Error> {
    let [q, u, v] = &movie.polarized;
    let circular = observation.basis == Basis::Circular;
    if !circular && movie.polarized.iter().any(Option::is_some) {
        let allowed = "those of circular feeds: RR, LL, RL, LR";
        return Err(Error::out_of_range("products of the observation", 0.0, allowed));
    }
    if q.is_some() != u.is_some() {
        let known = f64::from(u8::from(q.is_some()) + u8::from(u.is_some()));
        let allowed = "both or none: RL and LR are Q ± iU";
        return Err(Error::out_of_range("images of Stokes Q and U", known, allowed));
    }
    let of = |pixels: &Option<Vec<f64>>| {
        let grid = movie.i.grid;
        let seen = |pixels: &Vec<f64>| all_seen(observation, grid, pixels, pulse, times_h, method);
        pixels.as_ref().map(seen).transpose()
    };
    // Before anything is set: a refusal leaves the observation as it was.
    let (linear, v) = (of(q)?.zip(of(u)?), of(v)?);
    let how = fill(observation, &movie.i, pulse, times_h, method)?;
    match linear {
        Some(((_, q), (_, u))) => {
            for ((row, q), u) in observation.rows.iter_mut().zip(q).zip(u) {
                let turned = Complex64::new(0.0, 1.0) * u;
                (row.products[2], row.products[3]) = (q + turned, q - turned);
            }
        }
        None if circular => {
            observation.rows.iter_mut().for_each(|row| row.noise_sigma[2..].fill(f64::NAN));
        }
        None => {}
    }
    for (row, v) in observation.rows.iter_mut().zip(v.map(|(_, v)| v).unwrap_or_default()) {
        row.products[0] += v;
        row.products[1] -= v;
    }
    Ok(how)
}

fn check(frames: usize, times_h: &[f64]) -> Result<(), Error> {
    let range = |name, value, allowed| Err(Error::out_of_range(name, value, allowed));
    if frames == 0 || frames != times_h.len() {
        return range("number of images", frames as f64, "1 at least, and as many as times");
    }
    if let Some(time) = times_h.iter().find(|time| !time.is_finite()) {
        return range("time of an image", *time, "finite");
    }
    if let Some(pair) = times_h.windows(2).find(|pair| pair[0] >= pair[1]) {
        return range("time of an image", pair[1], "hours later than the image before");
    }
    Ok(())
}

/// The images that a time lies between, with their weights; one where it is that of an image.
fn neighbours(times_h: &[f64], time_h: f64) -> Result<impl Iterator<Item = (usize, f64)>, Error> {
    let after = times_h.partition_point(|time| *time <= time_h);
    // Before the first image 0 wraps to an index that no list has.
    let weight = match (times_h.get(after.wrapping_sub(1)), times_h.get(after)) {
        _ if times_h.len() == 1 => 0.0,
        (Some(before), Some(after)) => (time_h - before) / (after - before),
        (Some(last), None) if *last == time_h => 0.0,
        _ => {
            let allowed = "hours from the first image to the last";
            return Err(Error::out_of_range("time of a scan", time_h, allowed));
        }
    };
    // An image of weight 0 is dropped: at the last time it would be one that is not there.
    let before = after.saturating_sub(1);
    Ok([(before, 1.0 - weight), (before + 1, weight)].into_iter().filter(|(_, w)| *w > 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::{Measured, Row};

    #[test]
    fn exact_images_go_to_their_scans() {
        let grid = ImageGrid::new(1, 1, 1e-10).unwrap();
        let i = Measured { visibility: Complex64::new(0.0, 0.0), noise_sigma: 1.0 };
        let rows = [2.0, 1.0, 2.0].map(|time| Row::total_intensity(time, [0, 1], [1e9, 0.0], i));
        let mut observation =
            Observation { rows: rows.to_vec(), ..Observation::empty(Basis::Stokes) };
        let mut movie = Movie { grid, pixels: vec![3.0, 5.0] };
        fill(&mut observation, &movie, Pulse::Delta, &[1.0, 2.0], Method::Direct).unwrap();
        let found: Vec<f64> = observation.rows.iter().map(|row| row.products[0].re).collect();
        assert_eq!(found, [5.0, 3.0, 5.0]);
        fill(&mut observation, &movie, Pulse::Delta, &[0.0, 4.0], Method::Fast(1e-12)).unwrap();
        let found: Vec<f64> = observation.rows.iter().map(|row| row.products[0].re).collect();
        let error = |(a, b): (&f64, f64)| (a - b).abs();
        assert!(found.iter().zip([4.0, 3.5, 4.0]).map(error).all(|e| e < 1e-11), "{found:?}");
        let mut fail = |times: &[f64]| {
            fill(&mut observation, &movie, Pulse::Delta, times, Method::Direct)
                .unwrap_err()
                .to_string()
        };
        assert!(fail(&[1.0, 1.5]).contains("time of a scan = 2 "));
        assert!(fail(&[1.5, 2.0]).contains("time of a scan = 1 "));
        assert!(fail(&[2.0, 1.0]).contains("time of an image = 1 "));
        assert!(fail(&[1.0, f64::NAN]).contains("time of an image = NaN"));
        assert!(fail(&[1.0]).contains("number of images = 2"));
        movie.pixels.truncate(1);
        fill(&mut observation, &movie, Pulse::Delta, &[99.0], Method::Direct).unwrap();
        assert_eq!(observation.rows[0].products[0].re, 3.0);
    }

    /// A point of I = 2, Q = 0.3, U = −0.4, V = 0.1 Jy in the middle: the same on every baseline.
    #[test]
    fn exact_all_stokes_parameters_of_a_point() {
        let grid = ImageGrid::new(1, 1, 1e-10).unwrap();
        let row = Row { noise_sigma: [1.0; 4], ..Row::empty(1.0, [0, 1], [1e9, 0.0]) };
        let mut observation =
            Observation { rows: vec![row], ..Observation::empty(Basis::Circular) };
        let mut see = |polarized: [Option<f64>; 3]| {
            observation.rows[0].noise_sigma = [1.0; 4];
            let i = Movie { grid, pixels: vec![2.0] };
            let polarized = polarized.map(|value| value.map(|value| vec![value]));
            let movie = StokesMovie { i, polarized };
            fill_stokes(&mut observation, &movie, Pulse::Delta, &[0.0], Method::Direct)
                .map(|_| [0, 1, 2, 3].map(|k| observation.rows[0].product(k).map(|p| p.visibility)))
                .map_err(|error| error.to_string())
        };
        let c = |re, im| Some(Complex64::new(re, im));
        let all = see([Some(0.3), Some(-0.4), Some(0.1)]).unwrap();
        assert_eq!(all, [c(2.1, 0.0), c(1.9, 0.0), c(0.3, -0.4), c(0.3, 0.4)]);
        let linear = see([Some(0.3), Some(-0.4), None]).unwrap();
        assert_eq!(linear, [c(2.0, 0.0), c(2.0, 0.0), c(0.3, -0.4), c(0.3, 0.4)]);
        assert_eq!(see([None; 3]).unwrap(), [c(2.0, 0.0), c(2.0, 0.0), None, None]);
        assert_eq!(see([None, None, Some(0.1)]).unwrap(), [c(2.1, 0.0), c(1.9, 0.0), None, None]);
        assert!(see([Some(0.3), None, None]).unwrap_err().contains("Stokes Q and U = 1 "));
    }

    #[test]
    fn exact_overflow_is_an_error() {
        let grid = ImageGrid::new(4, 4, 1e-10).unwrap();
        let i = Measured { visibility: Complex64::new(0.0, 0.0), noise_sigma: 1.0 };
        let row = Row::total_intensity(1.0, [0, 1], [1e3, 0.0], i);
        let mut observation = Observation { rows: vec![row], ..Observation::empty(Basis::Stokes) };
        let movie = Movie { grid, pixels: vec![1e308; 16] };
        let error = fill(&mut observation, &movie, Pulse::Delta, &[0.0], Method::Direct);
        assert!(error.unwrap_err().to_string().contains("visibility"));
    }
}

//! A movie through an array: what [`schedule::observe`](super::schedule::observe) lays out, filled
//! with the visibilities of images.

use super::observation::{Basis, Observation, Row};
use super::operator::{Dtft, ImageGrid, Operator, Pulse};
use super::{Complex64, schedule::ScheduleError};

/// Exponentials up to this many bytes are kept while a movie is transformed.
const MEMORY: usize = 256 << 20;

/// Images in Jy/pixel that follow each other.
#[derive(Debug, Clone, PartialEq)]
pub struct Movie {
    /// Where pixels are.
    pub grid: ImageGrid,
    /// Image after image, row by row from the north, each row from the east.
    pub pixels: Vec<f64>,
}

impl Movie {
    /// How many images.
    pub fn frames(&self) -> usize {
        self.pixels.len() / self.grid.pixels().max(1)
    }
}

/// Sets the visibilities of unpolarised emission: image k is seen at the k-th of `times_h`, an
/// only one always. Rows at no such time keep what they have.
///
/// # Errors
/// If the number of images is neither 1 nor that of times.
pub fn fill(
    observation: &mut Observation,
    movie: &Movie,
    pulse: Pulse,
    times_h: &[f64],
) -> Result<(), ScheduleError> {
    let frames = movie.frames();
    if frames != 1 && frames != times_h.len() {
        return Err(ScheduleError::Range {
            name: "number of images",
            value: frames as f64,
            allowed: "1, or one for each scan",
        });
    }
    let mut rows: Vec<Vec<&mut Row>> = (0..frames).map(|_| Vec::new()).collect();
    for row in &mut observation.rows {
        let frame = times_h.iter().position(|time| *time == row.time_h);
        if let Some(frame) = frame {
            rows[frame.min(frames - 1)].push(row);
        }
    }
    let uv: Vec<Vec<[f64; 2]>> =
        rows.iter().map(|rows| rows.iter().map(|row| row.uv).collect()).collect();
    let operator = Dtft::<f64>::new(movie.grid, pulse, &uv, MEMORY);
    let mut visibilities = vec![Complex64::new(0.0, 0.0); operator.data()];
    operator.forward(&movie.pixels, &mut visibilities);
    let none = Complex64::new(0.0, 0.0);
    for (row, v) in rows.into_iter().flatten().zip(visibilities) {
        row.products = match observation.basis {
            Basis::Circular => [v, v, none, none],
            Basis::Stokes => [v, none, none, none],
        };
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interferometry::observation::Measured;

    #[test]
    fn exact_images_go_to_their_scans() {
        let grid = ImageGrid::new(1, 1, 1e-10).unwrap();
        let i = Measured { visibility: Complex64::new(0.0, 0.0), noise_sigma: 1.0 };
        let rows = [2.0, 1.0, 2.0].map(|time| Row::total_intensity(time, [0, 1], [1e9, 0.0], i));
        let mut observation =
            Observation { rows: rows.to_vec(), ..Observation::empty(Basis::Stokes) };
        let mut movie = Movie { grid, pixels: vec![3.0, 5.0] };
        fill(&mut observation, &movie, Pulse::Delta, &[1.0, 2.0]).unwrap();
        let found: Vec<f64> = observation.rows.iter().map(|row| row.products[0].re).collect();
        assert_eq!(found, [5.0, 3.0, 5.0]);
        movie.pixels.push(7.0);
        assert!(fill(&mut observation, &movie, Pulse::Delta, &[1.0, 2.0]).is_err());
    }
}

//! Ticks of linear polarisation over a drawn picture.
//!
//! Q and U follow the IAU's convention: the electric vector position angle
//! χ = ½ atan2(U, Q) counts from North (up on the picture) through East (left).

use super::Picture;
use super::canvas::{BLACK, Canvas, WHITE};

/// A tick: where, in which direction, and how strong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tick {
    /// Its middle in pixels from the upper left corner.
    pub middle: [f64; 2],
    /// χ in radians, East of North.
    pub evpa: f64,
    /// √(Q² + U²), the mean over its cell.
    pub polarized: f64,
}

/// Ticks with less than this share of the strongest one's polarised intensity are left out.
const FAINTEST: f64 = 0.02;

/// One tick for each cell of a net of about `across` columns, from means of the channels `Q` and
/// `U`; `None` if the picture does not have them.
pub fn ticks(picture: &Picture, across: usize) -> Option<Vec<Tick>> {
    let (q, u) = (picture.channel("Q")?, picture.channel("U")?);
    let cell = (picture.width / across.max(1)).max(1);
    let (columns, rows) = (picture.width / cell, picture.height / cell);
    let mean = |values: &[f32], column: usize, row: usize| {
        let line = |y: usize| &values[y * picture.width + column * cell..][..cell];
        let sum: f64 = (row * cell..(row + 1) * cell)
            .flat_map(|y| line(y).iter().map(|v| f64::from(*v)))
            .sum();
        sum / (cell * cell) as f64
    };
    let places = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row)));
    let all: Vec<Tick> = places
        .map(|(column, row)| {
            let (q, u) = (mean(q, column, row), mean(u, column, row));
            let middle = [column, row].map(|k| (k as f64 + 0.5) * cell as f64);
            Tick { middle, evpa: 0.5 * u.atan2(q), polarized: q.hypot(u) }
        })
        .collect();
    let most = all.iter().map(|tick| tick.polarized).fold(0.0, f64::max);
    let seen = |tick: &Tick| tick.polarized > FAINTEST * most;
    Some(all.into_iter().filter(seen).collect())
}

/// Draws ticks as long as they are strong, the strongest as long as `longest` pixels.
pub fn draw(canvas: &mut Canvas, ticks: &[Tick], longest: f64) {
    let most = ticks.iter().map(|tick| tick.polarized).fold(0.0, f64::max);
    let thick = (longest / 9.0).max(1.0);
    for (width, color) in [(thick + 1.5, BLACK), (thick, WHITE)] {
        for tick in ticks {
            let half = 0.5 * longest * tick.polarized / most;
            let (sin, cos) = tick.evpa.sin_cos();
            // North is up, East to the left.
            let [x, y] = tick.middle;
            let ends = [[x - half * sin, y - half * cos], [x + half * sin, y + half * cos]];
            canvas.line(&ends, false, width, color);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Channel;

    fn picture(q: f32, u: f32) -> Picture {
        let channel =
            |name: &str, value| Channel { name: name.to_owned(), values: vec![value; 40 * 40] };
        Picture { width: 40, height: 40, channels: vec![channel("Q", q), channel("U", u)] }
    }

    /// Q > 0 is North–South, U > 0 North-East–South-West: from the upper left to the lower right.
    #[test]
    fn exact_position_angles() {
        for (q, u, degrees, there, not) in [
            (1.0, 0.0, 0.0, [20, 12], [12, 20]),
            (-1.0, 0.0, 90.0, [12, 20], [20, 12]),
            (0.0, 1.0, 45.0, [15, 15], [25, 15]),
            (0.0, -1.0, -45.0, [25, 15], [15, 15]),
        ] {
            let ticks = ticks(&picture(q, u), 1).unwrap();
            assert_eq!(ticks.len(), 1);
            // Modulo half a turn.
            let off = (ticks[0].evpa.to_degrees() - degrees + 90.0).rem_euclid(180.0) - 90.0;
            assert!(off.abs() < 1e-5, "{} in place of {degrees}", ticks[0].evpa.to_degrees());
            let mut canvas = Canvas::new(40, 40, [90; 3]).unwrap();
            draw(&mut canvas, &ticks, 24.0);
            let drawn = canvas.into_picture();
            assert!(drawn.get_pixel(there[0], there[1]).0[0] > 150, "{degrees}");
            assert_eq!(drawn.get_pixel(not[0], not[1]).0, [90; 3], "{degrees}");
        }
    }

    #[test]
    fn exact_means_and_missing_channels() {
        let mut p = picture(1.0, 0.0);
        // Half of every cell is crossed: nothing is left of it.
        for (k, q) in p.channels[0].values.iter_mut().enumerate() {
            if k % 2 == 0 && k % 40 < 20 {
                *q = -1.0;
            }
        }
        let left = ticks(&p, 4).unwrap();
        assert_eq!(left.len(), 8);
        assert!(left.iter().all(|t| t.middle[0] > 20.0 && (t.polarized - 1.0).abs() < 1e-6));
        p.channels.pop();
        assert!(ticks(&p, 4).is_none());
    }
}

//! Letters and digits that shine: emission whose shape everybody can judge.

use crate::Error;
use crate::fit::settings::GlyphShape;
use kerrlight_geodesic::vector::{cross, dot};
use kerrlight_render::image::canvas::coverage;

/// Pixels of a letter's height.
const RESOLUTION: usize = 96;

/// A letter, extruded along an axis, with soft edges. It lies in the plane across the axis with its upper side
/// away from the hole.
#[derive(Clone, Debug)]
pub struct Glyph {
    axis: [f64; 3],
    center: [f64; 3],
    /// Unit vectors to the right and upward.
    right: [f64; 3],
    up: [f64; 3],
    height: f64,
    half_thickness: f64,
    softness: f64,
    amplitude: f64,
    /// Blurred coverage, rows from the top, with a margin on all sides.
    values: Vec<f32>,
    columns: usize,
    rows: usize,
}

impl Glyph {
    /// Extrudes this shape along a unit vector.
    ///
    /// # Errors
    /// If a number is out of its range, the font has no such letter, or its centre lies on the axis.
    pub fn new(shape: &GlyphShape, axis: [f64; 3]) -> Result<Self, Error> {
        let GlyphShape { letter, center, height, thickness, softness, amplitude } = *shape;
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let up = across(center, axis);
        let check = Error::check;
        check("height", height, positive(height), "above 0")?;
        check("thickness", thickness, positive(thickness), "above 0")?;
        let is_soft = positive(softness) && softness <= height;
        check("softness", softness, is_soft, "above 0, at most height")?;
        check("amplitude", amplitude, amplitude >= 0.0 && amplitude.is_finite(), "0 or above")?;
        check("distance of center from the axis", 0.0, up.is_some(), "above 0")?;
        let no_letter = Error::out_of_range(
            "letter",
            f64::from(u32::from(letter)),
            "one that the font has a picture of",
        );
        let (Some(up), Some((width, covered))) = (up, coverage(letter, RESOLUTION)) else {
            return Err(no_letter);
        };
        if width == 0 || covered.is_empty() {
            return Err(no_letter);
        }
        let tall = covered.len() / width;
        let sigma = softness / height * tall as f64;
        let (values, columns) = blurred(&covered, width, sigma);
        let rows = values.len() / columns;
        Ok(Self {
            axis,
            center,
            right: cross(up, axis),
            up,
            // The height that was asked for is that of the letter without its margin.
            height: height * rows as f64 / tall as f64,
            half_thickness: 0.5 * thickness,
            softness,
            amplitude,
            values,
            columns,
            rows,
        })
    }

    /// Returns whether its amplitude is 0.
    pub fn is_dark(&self) -> bool {
        self.amplitude == 0.0
    }

    /// Emission at a point.
    pub fn at(&self, point: [f64; 3]) -> f64 {
        let offset = core::array::from_fn(|c| point[c] - self.center[c]);
        // Edges along the axis are as soft as those of the letter: a step blurred by a Gaussian.
        let depth = (self.half_thickness - dot(offset, self.axis).abs()) / self.softness;
        // Four deviations outside 3e-5 is left, as at the margin of the letter.
        if depth < -4.0 {
            return 0.0;
        }
        let unit = self.rows as f64 / self.height;
        // The middle of pixel k is at k + ½.
        let column = dot(offset, self.right) * unit + 0.5 * self.columns as f64 - 0.5;
        let row = -dot(offset, self.up) * unit + 0.5 * self.rows as f64 - 0.5;
        self.amplitude * self.value(column, row) * 0.5 * (1.0 + libm::erf(depth / 2f64.sqrt()))
    }

    /// Interpolates between pixels.
    fn value(&self, column: f64, row: f64) -> f64 {
        let (x, y) = (column.floor(), row.floor());
        let (u, v) = (column - x, row - y);
        let (x, y) = (x as i64, y as i64);
        let at = |x: i64, y: i64| {
            let inside =
                (0..self.columns as i64).contains(&x) && (0..self.rows as i64).contains(&y);
            if inside {
                f64::from(self.values[y as usize * self.columns + x as usize])
            } else {
                0.0
            }
        };
        (1.0 - v) * ((1.0 - u) * at(x, y) + u * at(x + 1, y))
            + v * ((1.0 - u) * at(x, y + 1) + u * at(x + 1, y + 1))
    }
}

/// The unit vector from the axis to a point.
fn across(point: [f64; 3], axis: [f64; 3]) -> Option<[f64; 3]> {
    let along = dot(point, axis);
    let across: [f64; 3] = core::array::from_fn(|c| point[c] - along * axis[c]);
    let length = dot(across, across).sqrt();
    (length > 0.0 && length.is_finite()).then(|| across.map(|x| x / length))
}

/// A picture with a margin of four standard deviations, blurred along both sides; and its new width.
fn blurred(picture: &[u8], width: usize, sigma: f64) -> (Vec<f32>, usize) {
    let (margin, tall) = ((4.0 * sigma).ceil() as usize, picture.len() / width);
    let weight = |k: i64| (-0.5 * (k as f64 / sigma).powi(2)).exp();
    let reach = margin as i64;
    let all: f64 = (-reach..=reach).map(weight).sum();
    let kernel: Vec<f64> = (-reach..=reach).map(|k| weight(k) / all).collect();
    let (columns, rows) = (width + 2 * margin, tall + 2 * margin);
    let mut wide = vec![0.0; columns * tall];
    for (k, value) in picture.iter().enumerate().filter(|(_, value)| **value > 0) {
        let start = k / width * columns + k % width;
        for (w, out) in kernel.iter().zip(&mut wide[start..]) {
            *out += w * f64::from(*value) / 255.0;
        }
    }
    let mut both = vec![0.0f64; columns * rows];
    for (k, value) in wide.iter().enumerate().filter(|(_, value)| **value > 0.0) {
        let start = k / columns * columns + k % columns;
        for (j, w) in kernel.iter().enumerate() {
            both[start + j * columns] += w * value;
        }
    }
    (both.into_iter().map(|x| x as f32).collect(), columns)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPE: GlyphShape = GlyphShape {
        letter: 'L',
        center: [4.0, 0.0, 0.0],
        height: 2.0,
        thickness: 1.0,
        softness: 0.1,
        amplitude: 3.0,
    };
    const AXIS: [f64; 3] = [0.0, 0.0, 1.0];

    /// An L seen against the axis, its upper side away from the hole: its long stroke is on the left, its foot
    /// towards the hole.
    #[test]
    fn exact_strokes_are_where_the_letter_has_them() {
        let glyph = Glyph::new(&SHAPE, AXIS).unwrap();
        let peak = |points: &mut dyn Iterator<Item = [f64; 3]>| {
            points.map(|x| glyph.at(x)).fold(0.0, f64::max)
        };
        // Up is +x, so that right is −y.
        let along = |x: f64, sign: f64| (0..40).map(move |k| [x, sign * 0.03 * f64::from(k), 0.0]);
        assert!(peak(&mut along(4.7, 1.0)) > 1.0, "the stroke");
        assert!(peak(&mut along(4.7, -1.0)) < 0.1, "nothing beside it");
        assert!(peak(&mut along(3.1, -1.0)) > 1.0, "the foot");
        assert!(glyph.at([4.0, 0.0, 2.0]) == 0.0);
    }

    /// Half of the emission is left at half the thickness.
    #[test]
    fn exact_edges() {
        let glyph = Glyph::new(&SHAPE, AXIS).unwrap();
        let (y, middle) = (0..80)
            .map(|k| 0.01 * f64::from(k))
            .map(|y| (y, glyph.at([4.3, y, 0.0])))
            .fold((0.0, 0.0), |best, now| if now.1 > best.1 { now } else { best });
        assert!(middle > 1.5);
        assert!((glyph.at([4.3, y, 0.5]) - 0.5 * middle).abs() < 1e-3 * middle);
    }

    #[test]
    fn numbers_out_of_range_are_named() {
        let text = |shape: GlyphShape| Glyph::new(&shape, AXIS).unwrap_err().to_string();
        assert!(text(GlyphShape { height: -1.0, ..SHAPE }).contains("height = -1 "));
        assert!(text(GlyphShape { letter: ' ', ..SHAPE }).contains("letter"));
        assert!(text(GlyphShape { center: [0.0, 0.0, 1.0], ..SHAPE }).contains("center"));
    }
}

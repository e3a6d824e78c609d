//! A picture of a scan: the sphere in Mollweide's projection, which keeps areas.

use super::AxisScan;
use crate::Error;
use core::f64::consts::{FRAC_PI_2, PI, SQRT_2};
use image::RgbImage;
use kerrlight_render::dynamics::Axis;
use kerrlight_render::image::canvas::{Align, BLACK, Canvas, Rgb, WHITE};
use kerrlight_render::image::colormap::Colormap;

/// Points of the lattice that a pixel's loss is the weighted mean of.
const NEAREST: usize = 4;

/// Returns the place of a direction, in [−2, 2] × [−1, 1]; longitude 0 (+x) in the middle, +y to the right, +z above.
fn projected(axis: Axis) -> [f64; 2] {
    let [x, y, z] = axis.vector();
    let (longitude, latitude) = (y.atan2(x), z.clamp(-1.0, 1.0).asin());
    let t = auxiliary(latitude);
    [2.0 / PI * longitude * t.cos(), t.sin()]
}

/// t with 2t + sin 2t = π sin(latitude), by bisection: the slope vanishes at the poles.
fn auxiliary(latitude: f64) -> f64 {
    let wanted = PI * latitude.sin();
    let (mut low, mut high) = (-FRAC_PI_2, FRAC_PI_2);
    for _ in 0..60 {
        let t = 0.5 * (low + high);
        if 2.0 * t + (2.0 * t).sin() < wanted { low = t } else { high = t }
    }
    0.5 * (low + high)
}

/// The direction that lies at a point of the plane; none outside of the ellipse.
fn direction([u, v]: [f64; 2]) -> Option<Axis> {
    if 0.25 * u * u + v * v > 1.0 {
        return None;
    }
    let t = v.asin();
    let sine = ((2.0 * t + (2.0 * t).sin()) / PI).clamp(-1.0, 1.0);
    // A pole is at every longitude.
    let longitude = if t.cos() > 0.0 { PI * u / (2.0 * t.cos()) } else { 0.0 };
    let (s, (sin, cos)) = ((1.0 - sine * sine).sqrt(), longitude.sin_cos());
    Axis::new([s * cos, s * sin, sine]).ok()
}

impl AxisScan {
    /// The map's losses as colours, bright where they are small (linear in the logarithm); a ring about the best axis,
    /// a cross on the runner-up. `width` pixels wide, half as high.
    ///
    /// # Errors
    /// If the width is not 64 to 8192.
    pub fn picture(&self, width: u32, colors: Colormap) -> Result<RgbImage, Error> {
        let refused = Error::out_of_range("map width", width.into(), "64 to 8192");
        if !(64..=8192).contains(&width) {
            return Err(refused);
        }
        let (height, table) = (width / 2, colors.table());
        let scale = 0.24 * f64::from(width);
        let logs: Vec<f64> = self.map.iter().map(|p| p.loss.max(f64::MIN_POSITIVE).ln()).collect();
        let least = logs.iter().copied().fold(f64::INFINITY, f64::min);
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let span = if most > least { most - least } else { 1.0 };
        let middle = [0.5 * f64::from(width), 0.5 * f64::from(height)];
        let color = |x: u32, y: u32| -> Rgb {
            let at = [f64::from(x) + 0.5 - middle[0], middle[1] - f64::from(y) - 0.5];
            let Some(axis) = direction(at.map(|x| x / scale)) else { return BLACK };
            let bright = 1.0 - (self.between(axis, &logs) - least) / span;
            let index = (bright.clamp(0.0, 1.0) * (table.len() - 1) as f64).round();
            table.get(index as usize).copied().unwrap_or(BLACK)
        };
        let picture = RgbImage::from_fn(width, height, |x, y| image::Rgb(color(x, y)));
        let mut canvas = Canvas::of(&picture).ok_or(refused)?;
        let on = |axis: Axis| {
            let [u, v] = projected(axis);
            [middle[0] + scale * u, middle[1] - scale * v]
        };
        ring(&mut canvas, on(self.best.axis), 0.012 * f64::from(width));
        cross(&mut canvas, on(self.runner_up.axis), 0.008 * f64::from(width));
        let size = 0.02 * f64::from(width);
        for (vector, name) in
            [([0.0, 0.0, 1.0], "+z"), ([0.0, 0.0, -1.0], "−z"), ([1.0, 0.0, 0.0], "+x")]
        {
            if let Ok(axis) = Axis::new(vector) {
                let [x, y] = on(axis);
                canvas.label(
                    name,
                    [x, y.clamp(1.2 * size, f64::from(height) - 4.0)],
                    size,
                    Align::Center,
                );
            }
        }
        Ok(canvas.into_picture())
    }

    /// Mean over the nearest points of the lattice, weighted by the inverse squares of their distances.
    fn between(&self, axis: Axis, logs: &[f64]) -> f64 {
        let mut nearest = [(f64::INFINITY, 0.0); NEAREST];
        for (point, log) in self.map.iter().zip(logs) {
            // Squares of chords, above 0 so that a pixel on a lattice point has its value.
            let square = (2.0 - 2.0 * point.axis.dot(axis)).max(1e-12);
            if square < nearest[NEAREST - 1].0 {
                nearest[NEAREST - 1] = (square, *log);
                nearest.sort_by(|a, b| a.0.total_cmp(&b.0));
            }
        }
        let sum: f64 = nearest.iter().map(|(square, log)| log / square).sum();
        sum / nearest.iter().map(|(square, _)| 1.0 / square).sum::<f64>()
    }
}

fn ring(canvas: &mut Canvas, [x, y]: [f64; 2], radius: f64) {
    let point = |k: u32| {
        let (sin, cos) = (f64::from(k) * PI / 24.0).sin_cos();
        [x + radius * cos, y + radius * sin]
    };
    let points: Vec<[f64; 2]> = (0..48).map(point).collect();
    canvas.line(&points, true, 0.5 * radius, BLACK);
    canvas.line(&points, true, 0.2 * radius, WHITE);
}

fn cross(canvas: &mut Canvas, [x, y]: [f64; 2], size: f64) {
    let half = size / SQRT_2;
    for (width, color) in [(0.7 * size, BLACK), (0.3 * size, WHITE)] {
        for sign in [1.0, -1.0] {
            let ends = [[x - half, y - sign * half], [x + half, y + sign * half]];
            canvas.line(&ends, false, width, color);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{AxisLoss, lattice};
    use super::*;

    #[test]
    fn exact_projection_and_its_inverse() {
        for axis in lattice(50) {
            let back = direction(projected(axis)).unwrap();
            assert!(back.dot(axis) > 1.0 - 1e-12, "{axis:?} {back:?}");
        }
        assert!(direction([1.9, 0.5]).is_none());
    }

    /// The pixel under the best axis is the brightest colour within the ring, that of the antipode the darkest.
    #[test]
    fn exact_bright_where_the_loss_is_least() {
        let truth = Axis::new([0.5, 0.3, 0.4]).unwrap();
        let map: Vec<AxisLoss> = lattice(400)
            .into_iter()
            .map(|axis| AxisLoss { axis, loss: (2.0 - 2.0 * axis.dot(truth)).exp() })
            .collect();
        let best = AxisLoss { axis: truth, loss: 1.0 };
        let runner_up = AxisLoss { axis: truth.antipode(), loss: 9.0 };
        let scan = AxisScan { map, best, runner_up };
        let picture = scan.picture(512, Colormap::Gray).unwrap();
        let [u, v] = projected(truth).map(|x| x * 0.24 * 512.0);
        let at = |x: f64, y: f64| picture.get_pixel((256.0 + x) as u32, (128.0 - y) as u32).0[0];
        assert!(at(u, v) > 240, "{}", at(u, v));
        assert!(at(u - 60.0, v) < at(u, v));
        assert_eq!(picture.get_pixel(1, 1).0, BLACK);
        assert!(scan.picture(10, Colormap::Gray).is_err());
    }
}

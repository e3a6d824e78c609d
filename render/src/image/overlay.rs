//! Marks over a drawn picture: a scale bar and the critical curve.

use super::canvas::{Align, Canvas, Rgb};
use kerrlight_geodesic::analytic::CriticalCurve;
use kerrlight_geodesic::{Inclination, Kerr};

/// Colour of the critical curve: seen on every colour map.
const CYAN: Rgb = [70, 220, 255];

/// Points of the critical curve.
const POINTS: u32 = 720;

/// Draws the critical curve of a hole seen at an inclination from infinity; `pixel` is the width
/// of a pixel in M, `size` that of the field in pixels; the screen's origin is in its middle.
pub fn critical_curve(canvas: &mut Canvas, size: [f64; 2], pixel: f64, curve: [f64; 2]) {
    let [spin, degrees] = curve;
    let (Ok(hole), Ok(place)) = (Kerr::new(spin), Inclination::from_degrees(degrees)) else {
        return;
    };
    let [middle_x, middle_y] = size.map(|n| 0.5 * n);
    let points: Vec<[f64; 2]> = CriticalCurve::new(&hole, place)
        .points(POINTS)
        .map(|p| [middle_x + p.alpha / pixel, middle_y - p.beta / pixel])
        .collect();
    canvas.line(&points, true, (size[0] / 400.0).max(1.0), CYAN);
}

/// Draws a scale bar in the lower left corner: a round length in M of about a quarter of the
/// picture, and, for an observer at infinity, what that is in microarcseconds. `pixel` is the
/// width of a pixel in M, `size` that of the field in pixels.
pub fn scale_bar(canvas: &mut Canvas, size: [f64; 2], pixel: f64, uas_per_m: Option<f64>) {
    let [width, height] = size;
    let length = round_length(0.25 * width * pixel);
    let angle = uas_per_m.map(|scale| format!(" = {} µas", digits(length * scale)));
    let text = format!("{} M{}", digits(length), angle.unwrap_or_default());
    let font = (height / 24.0).max(10.0);
    let margin = 0.04 * width.min(height);
    let (left, base) = (margin, height - margin);
    let (long, thick) = (length / pixel, (height / 160.0).max(2.0));
    canvas.rectangle(left - 1.0, base - thick - 1.0, long + 2.0, thick + 2.0, [0; 3]);
    canvas.rectangle(left, base - thick, long, thick, [255; 3]);
    canvas.label(&text, [left, base - thick - 0.4 * font], font, Align::Left);
}

/// The longest of 1, 2, 5, 10, … that is not above `length`.
fn round_length(length: f64) -> f64 {
    let decade = 10f64.powf(length.log10().floor());
    let part = length / decade;
    decade
        * if part >= 5.0 {
            5.0
        } else if part >= 2.0 {
            2.0
        } else {
            1.0
        }
}

/// Three digits, and no exponent where it can be helped.
pub fn digits(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    let exponent = x.abs().log10().floor() as i32;
    if !(-4..7).contains(&exponent) {
        return format!("{x:.2e}");
    }
    let text = format!("{x:.*}", (2 - exponent).max(0) as usize);
    if !text.contains('.') {
        return text;
    }
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_round_numbers() {
        for (x, y) in [(7.3, 5.0), (2.0, 2.0), (0.019, 0.01), (4999.0, 2000.0)] {
            assert!((round_length(x) / y - 1.0).abs() < 1e-12, "{x}");
        }
        for (x, text) in [(5.0, "5"), (25.07, "25.1"), (1234.0, "1234"), (0.1, "0.1"), (0.0, "0")] {
            assert_eq!(digits(x), text);
        }
        assert_eq!(digits(-2.5e-7), "-2.50e-7");
    }

    /// Without spin the critical curve is the circle of radius √27.
    #[test]
    fn exact_critical_curve_of_schwarzschild() {
        let mut canvas = Canvas::new(200, 200, [0; 3]).unwrap();
        critical_curve(&mut canvas, [200.0; 2], 0.1, [0.0, 30.0]);
        let drawn = canvas.into_picture();
        let radius = 10.0 * 27f64.sqrt();
        for (x, y, pixel) in drawn.enumerate_pixels() {
            let distance = (f64::from(x) - 99.5).hypot(f64::from(y) - 99.5);
            let far = (distance - radius).abs() > 2.0;
            assert!(!far || pixel.0 == [0; 3], "{x} {y}");
            assert!((distance - radius).abs() > 0.2 || pixel.0[1] > 60, "{x} {y}");
        }
    }

    /// The bar is as long as it says.
    #[test]
    fn exact_length_of_the_scale_bar() {
        let mut canvas = Canvas::new(400, 300, [0; 3]).unwrap();
        // A quarter of the picture is 20 M.
        scale_bar(&mut canvas, [400.0, 300.0], 0.2, Some(5.0));
        let drawn = canvas.into_picture();
        let row = |y: u32| (0..400).filter(|x| drawn.get_pixel(*x, y).0 == [255; 3]).count();
        assert_eq!(row(300 - 12 - 1), 100);
    }
}

//! Lines and text on pictures.

use fontdue::{Font, FontSettings};
use image::RgbImage;
use std::sync::OnceLock;
use tiny_skia::{
    Color, FillRule, LineCap, Paint, PathBuilder, Pixmap, PremultipliedColorU8, Rect, Stroke,
    Transform,
};

/// An 8-bit colour.
pub type Rgb = [u8; 3];

/// White.
pub const WHITE: Rgb = [255; 3];
/// Black.
pub const BLACK: Rgb = [0; 3];

/// A picture to draw on. Lengths in pixels, from the upper left corner; the middle of the first
/// pixel is at (0.5, 0.5).
pub struct Canvas(Pixmap);

/// Alignment of a text to its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Align {
    /// It begins there.
    Left,
    /// It is centred there.
    Center,
    /// It ends there.
    Right,
}

/// Ubuntu Light, which the crate carries in it; without it there is no text.
fn font() -> Option<&'static Font> {
    static FONT: OnceLock<Option<Font>> = OnceLock::new();
    let load = || Font::from_bytes(epaint_default_fonts::UBUNTU_LIGHT, FontSettings::default());
    FONT.get_or_init(|| load().ok()).as_ref()
}

impl Canvas {
    /// A canvas of one colour; `None` if it has no pixels or too many.
    pub fn new(width: u32, height: u32, [r, g, b]: Rgb) -> Option<Self> {
        let mut map = Pixmap::new(width, height)?;
        map.fill(Color::from_rgba8(r, g, b, 255));
        Some(Canvas(map))
    }

    /// A canvas with a picture on it.
    pub fn of(picture: &RgbImage) -> Option<Self> {
        let mut canvas = Canvas::new(picture.width(), picture.height(), BLACK)?;
        canvas.paste(picture, 0, 0);
        Some(canvas)
    }

    /// Lays a picture over the canvas with its upper left corner at a pixel.
    pub fn paste(&mut self, picture: &RgbImage, left: u32, top: u32) {
        for (x, y, pixel) in picture.enumerate_pixels() {
            self.put(i64::from(left + x), i64::from(top + y), pixel.0, 1.0);
        }
    }

    /// The drawn picture.
    pub fn into_picture(self) -> RgbImage {
        let (width, height) = (self.0.width(), self.0.height());
        RgbImage::from_fn(width, height, |x, y| {
            let pixel = self.0.pixel(x, y).map_or(BLACK, |p| [p.red(), p.green(), p.blue()]);
            image::Rgb(pixel)
        })
    }

    /// Mixes a colour into one pixel, if it is on the canvas.
    fn put(&mut self, x: i64, y: i64, color: Rgb, part: f32) {
        let (width, height) = (i64::from(self.0.width()), i64::from(self.0.height()));
        if !(0..width).contains(&x) || !(0..height).contains(&y) {
            return;
        }
        let place = &mut self.0.pixels_mut()[(y * width + x) as usize];
        let old = [place.red(), place.green(), place.blue()];
        let mix = |k: usize| {
            let (old, new) = (f32::from(old[k]), f32::from(color[k]));
            (old + (new - old) * part).round() as u8
        };
        if let Some(new) = PremultipliedColorU8::from_rgba(mix(0), mix(1), mix(2), 255) {
            *place = new;
        }
    }

    /// A polygon line through points, closed or open.
    pub fn line(&mut self, points: &[[f64; 2]], closed: bool, width: f64, color: Rgb) {
        let mut builder = PathBuilder::new();
        for (k, [x, y]) in points.iter().enumerate() {
            let (x, y) = (*x as f32, *y as f32);
            if k == 0 { builder.move_to(x, y) } else { builder.line_to(x, y) }
        }
        if closed {
            builder.close();
        }
        let Some(path) = builder.finish() else { return };
        let stroke = Stroke { width: width as f32, line_cap: LineCap::Round, ..Stroke::default() };
        let still = Transform::identity();
        self.0.stroke_path(&path, &paint(color), &stroke, still, None);
    }

    /// A filled rectangle.
    pub fn rectangle(&mut self, left: f64, top: f64, width: f64, height: f64, color: Rgb) {
        let shape = Rect::from_xywh(left as f32, top as f32, width as f32, height as f32);
        if let Some(path) = shape.map(PathBuilder::from_rect) {
            let still = Transform::identity();
            self.0.fill_path(&path, &paint(color), FillRule::Winding, still, None);
        }
    }

    /// A line of text of a size in pixels on the base line `y`.
    pub fn text(&mut self, text: &str, [x, y]: [f64; 2], size: f64, align: Align, color: Rgb) {
        let Some(font) = font() else { return };
        let length = text_width(text, size);
        let shift = match align {
            Align::Left => 0.0,
            Align::Center => 0.5 * length,
            Align::Right => length,
        };
        let mut pen = x - shift;
        for letter in text.chars() {
            let (metrics, coverage) = font.rasterize(letter, size as f32);
            let left = (pen + f64::from(metrics.xmin)).round() as i64;
            let top = y.round() as i64 - i64::from(metrics.ymin) - metrics.height as i64;
            for (k, part) in coverage.iter().enumerate() {
                let (column, row) = (k % metrics.width, k / metrics.width);
                let part = f32::from(*part) / 255.0;
                self.put(left + column as i64, top + row as i64, color, part);
            }
            pen += f64::from(metrics.advance_width);
        }
    }

    /// The same with a dark edge, readable on any picture.
    pub fn label(&mut self, text: &str, [x, y]: [f64; 2], size: f64, align: Align) {
        let edge = (size / 14.0).max(1.0).round();
        for (dx, dy) in [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)] {
            let at = [x + edge * f64::from(dx), y + edge * f64::from(dy)];
            self.text(text, at, size, align, BLACK);
        }
        self.text(text, [x, y], size, align, WHITE);
    }
}

/// Length of a line of text of a size in pixels.
pub fn text_width(text: &str, size: f64) -> f64 {
    let Some(font) = font() else { return 0.0 };
    text.chars().map(|c| f64::from(font.metrics(c, size as f32).advance_width)).sum()
}

/// Returns the cover of each pixel by a letter, 0 to 255, and the width of that picture, whose edges
/// are the letter's; `None` without a font. A capital letter is about `size` pixels high.
pub fn coverage(letter: char, size: usize) -> Option<(usize, Vec<u8>)> {
    let font = font()?;
    // Capitals of this font are seven tenths of its nominal size high.
    let (metrics, covered) = font.rasterize(letter, size as f32 / 0.7);
    (font.lookup_glyph_index(letter) != 0).then_some((metrics.width, covered))
}

fn paint([r, g, b]: Rgb) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(r, g, b, 255);
    paint.anti_alias = true;
    paint
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
    fn exact_marks_where_they_are_asked_for() {
        let mut canvas = Canvas::new(60, 30, BLACK).unwrap();
        canvas.rectangle(10.0, 5.0, 20.0, 4.0, WHITE);
        canvas.text("µ", [50.0, 25.0], 16.0, Align::Center, WHITE);
        canvas.line(&[[0.0, 0.5], [60.0, 0.5]], false, 1.0, [255, 0, 0]);
        let drawn = canvas.into_picture();
        assert_eq!(drawn.get_pixel(10, 5).0, WHITE);
        assert_eq!(drawn.get_pixel(9, 5).0, BLACK);
        assert_eq!(drawn.get_pixel(29, 8).0, WHITE);
        assert_eq!(drawn.get_pixel(29, 9).0, BLACK);
        assert_eq!(drawn.get_pixel(30, 0).0, [255, 0, 0]);
        let lit = drawn.enumerate_pixels().filter(|(x, y, p)| *x > 40 && *y > 10 && p.0[0] > 99);
        assert!(lit.count() > 10, "the font has a µ");
        // Nothing is drawn off the canvas, and nothing panics there.
        let mut canvas = Canvas::of(&drawn).unwrap();
        canvas.label("beyond", [-20.0, 500.0], 12.0, Align::Left);
        assert_eq!(canvas.into_picture(), drawn);
    }

    #[test]
    fn exact_three_digits() {
        for (x, text) in [(5.0, "5"), (25.07, "25.1"), (1234.0, "1234"), (0.1, "0.1"), (0.0, "0")] {
            assert_eq!(digits(x), text);
        }
        assert_eq!(digits(-2.5e-7), "-2.50e-7");
    }
}

//! Small pictures in rows, each with axes in M, and one colour scale for all of them.

use super::Volume;
use crate::image::canvas::{Align, BLACK, Canvas, Rgb, WHITE, digits, text_width};
use crate::image::colormap::Colormap;
use image::RgbImage;

/// A volume and what it is called on pictures.
#[derive(Clone, Copy, Debug)]
pub struct Shown<'a> {
    /// Name, for instance `recovered`.
    pub name: &'a str,
    /// Its emission.
    pub volume: &'a Volume,
}

/// Width and height of a small picture in pixels.
pub(super) const PANEL: u32 = 300;
/// Space for the axes, and above and below a small picture.
const LEFT: u32 = 58;
const ABOVE: u32 = 28;
const BELOW: u32 = 46;
/// Space for the name of a row, and for the colour bar under all of them.
const NAME: u32 = 30;
const FOOT: u32 = 74;
const BAR: [u32; 2] = [420, 16];
const TEXT: f64 = 15.0;
const GRAY: Rgb = [150; 3];

/// A picture, which is square in pixels, and what its sides are.
pub(super) struct Panel {
    pub title: String,
    pub drawn: RgbImage,
    /// Labels of the axes to the right and upward.
    pub axes: [String; 2],
    /// Coordinates of the outer edges of the picture along them, M.
    pub ends: [[f64; 2]; 2],
}

/// Rows of pictures, each with a name; colours go from 0 to `most`, of which `quantity` says what it is.
pub(super) struct Page {
    pub rows: Vec<(String, Vec<Panel>)>,
    pub most: f64,
    pub quantity: String,
}

/// The colour map of emission, and the colour of a value on a scale that ends at `most`.
pub(super) fn shade(table: &[Rgb], value: f32, most: f64) -> Rgb {
    let part = if most > 0.0 { (f64::from(value) / most).clamp(0.0, 1.0) } else { 0.0 };
    table.get((part * 1023.0).round() as usize).copied().unwrap_or(BLACK)
}

/// The largest of many values, and 0 if none is above.
pub(super) fn largest<'a>(maps: impl IntoIterator<Item = &'a Vec<f32>>) -> f64 {
    f64::from(maps.into_iter().flatten().copied().fold(0.0, f32::max))
}

/// The colours of emission.
pub(super) fn colors() -> Vec<Rgb> {
    Colormap::AfmhotUs.table()
}

impl Page {
    /// Puts the pictures together; `None` if there are none or too many.
    pub(super) fn draw(&self) -> Option<RgbImage> {
        let columns = self.rows.iter().map(|(_, panels)| panels.len()).max()? as u32;
        let cell = [LEFT + PANEL + 14, ABOVE + PANEL + BELOW];
        let width = (columns * cell[0] + 14).max(BAR[0] + 2 * LEFT);
        let tall = NAME + cell[1];
        let mut canvas = Canvas::new(width, self.rows.len() as u32 * tall + FOOT, BLACK)?;
        for (row, (name, panels)) in (0u32..).zip(&self.rows) {
            let top = row * tall;
            canvas.text(name, [14.0, f64::from(top) + 22.0], 19.0, Align::Left, WHITE);
            for (column, panel) in (0u32..).zip(panels) {
                panel.place(&mut canvas, column * cell[0] + LEFT, top + NAME + ABOVE);
            }
        }
        self.bar(&mut canvas, self.rows.len() as u32 * tall + 8);
        Some(canvas.into_picture())
    }

    fn bar(&self, canvas: &mut Canvas, top: u32) {
        let table = colors();
        let color = |x: u32| image::Rgb(shade(&table, x as f32, f64::from(BAR[0] - 1)));
        let strip = RgbImage::from_fn(BAR[0], BAR[1], |x, _| color(x));
        let (left, edge) = (f64::from(LEFT), f64::from(top));
        let [long, thick] = BAR.map(f64::from);
        canvas.rectangle(left - 1.0, edge - 1.0, long + 2.0, thick + 2.0, GRAY);
        canvas.paste(&strip, LEFT, top);
        let base = edge + thick + 19.0;
        for k in 0..=2 {
            let part = 0.5 * f64::from(k);
            let text = digits(part * self.most);
            canvas.text(&text, [left + part * long, base], TEXT, Align::Center, WHITE);
        }
        canvas.text(&self.quantity, [left, base + 20.0], TEXT, Align::Left, WHITE);
    }
}

impl Panel {
    fn place(&self, canvas: &mut Canvas, left: u32, top: u32) {
        let [x, y] = [left, top].map(f64::from);
        let size = f64::from(PANEL);
        canvas.rectangle(x - 1.0, y - 1.0, size + 2.0, size + 2.0, GRAY);
        canvas.paste(&self.drawn, left, top);
        canvas.text(&self.title, [x, y - 9.0], TEXT, Align::Left, WHITE);
        for tick in ticks(self.ends[0]) {
            let at = x + size * part(self.ends[0], tick);
            canvas.line(&[[at, y + size], [at, y + size + 5.0]], false, 1.0, GRAY);
            canvas.text(&number(tick), [at, y + size + 20.0], TEXT, Align::Center, WHITE);
        }
        for tick in ticks(self.ends[1]) {
            let at = y + size * (1.0 - part(self.ends[1], tick));
            canvas.line(&[[x - 5.0, at], [x, at]], false, 1.0, GRAY);
            canvas.text(&number(tick), [x - 8.0, at + 5.0], TEXT, Align::Right, WHITE);
        }
        let [right, up] = &self.axes;
        canvas.text(right, [x + 0.5 * size, y + size + 38.0], TEXT, Align::Center, WHITE);
        let start = x + size - text_width(up, TEXT);
        canvas.text(up, [start, y - 9.0], TEXT, Align::Left, GRAY);
    }
}

/// Returns the place of a number between two ends.
fn part([low, high]: [f64; 2], value: f64) -> f64 {
    (value - low) / (high - low)
}

/// Round numbers, at most five of them.
fn ticks([low, high]: [f64; 2]) -> Vec<f64> {
    let raw = (high - low) / 5.0;
    let decade = 10f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 2.5, 5.0, 10.0].map(|k| k * decade).into_iter().find(|s| *s >= raw);
    let step = step.unwrap_or(10.0 * decade);
    let first = (low / step).ceil() as i64;
    let last = (high / step).floor() as i64;
    (first..=last).take(8).map(|k| k as f64 * step).collect()
}

fn number(x: f64) -> String {
    digits(x).replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_ticks_and_parts() {
        assert_eq!(ticks([-5.0, 5.0]), [-4.0, -2.0, 0.0, 2.0, 4.0]);
        assert_eq!(ticks([0.0, 25.0]), [0.0, 5.0, 10.0, 15.0, 20.0, 25.0]);
        assert_eq!(ticks([0.2, 0.3]), [0.2, 0.22, 0.24, 0.26, 0.28, 0.3].map(|x: f64| x));
        assert_eq!(part([-5.0, 5.0], 2.5), 0.75);
    }
}

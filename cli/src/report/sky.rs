//! Images of the sky as a paper shows them: axes, a colour bar, a scale, directions, the beam and ticks of polarisation.

use super::pictures::{Figure, encode, enlarged};
use anyhow::Context;
use kerrlight_render::image::canvas::{Align, BLACK, Canvas, Rgb, WHITE};
use kerrlight_render::image::colormap::Colormap;
use kerrlight_render::image::ticks::{self, Tick};
use kerrlight_render::image::{Channel, Picture};

/// An image of the sky.
pub struct SkyPanel<'a> {
    /// Title above it.
    pub name: &'a str,
    /// Pixels, Jy, north first and east left.
    pub image: Vec<f64>,
    /// Q and U of the pixels.
    pub polarized: Option<[Vec<f64>; 2]>,
    /// Full width at half maximum of the beam that it is seen with, µas.
    pub beam_uas: Option<f64>,
}

/// Pixels of a drawn image along a side, about.
const DRAWN: usize = 320;
/// Room beside an image: left, above, right and below, pixels.
const ROOM: [usize; 4] = [52, 26, 84, 40];
/// Size of letters, pixels.
const TEXT: f64 = 13.0;
/// Ticks of polarisation from left to right.
const ACROSS: usize = 22;
/// Ticks stand where there is this part of the brightest light at least, as in published images.
const LEAST_LIGHT: f64 = 0.1;

/// Images of n × n pixels in a field of so many µas beside each other, each on a scale of its own; `what` says what they are.
///
/// # Errors
/// If they cannot be drawn.
pub fn sky(
    panels: &[SkyPanel<'_>],
    n: usize,
    field_uas: f64,
    what: &str,
) -> anyhow::Result<Figure> {
    let side = n * (DRAWN / n).max(1);
    let [left, top, right, bottom] = ROOM;
    let pitch = left + side + right;
    let [width, height] = [pitch * panels.len(), top + side + bottom].map(|x| x as u32);
    let canvas = Canvas::new(width, height, WHITE);
    let mut canvas = canvas.context("the picture is too large to draw on")?;
    for (k, panel) in panels.iter().enumerate() {
        let at = [(k * pitch + left) as f64, top as f64];
        Drawn { panel, n, side, field_uas, at }.draw(&mut canvas)?;
    }
    let names = panels.iter().map(|panel| panel.name).collect::<Vec<_>>().join(", right of it ");
    let ticks = match panels.iter().any(|panel| panel.polarized.is_some()) {
        true => {
            " Ticks lie along the electric vector and are as long as polarised light is bright; they stand where total intensity is above \
             a tenth of the brightest."
        }
        false => "",
    };
    let caption = format!(
        "{what} Shown: {names}, each on a linear scale of its own. North (N) is up, east (E) to the left; a circle is the beam (full \
         width at half maximum).{ticks}"
    );
    let alt = format!("Images of the sky: {names}.");
    Ok(Figure { png: encode(Some(canvas.into_picture()))?, caption, alt })
}

/// A panel where it is drawn.
struct Drawn<'a> {
    panel: &'a SkyPanel<'a>,
    n: usize,
    side: usize,
    field_uas: f64,
    /// Upper left corner of its image.
    at: [f64; 2],
}

impl Drawn<'_> {
    fn draw(&self, canvas: &mut Canvas) -> anyhow::Result<()> {
        let fine = self.fine(&self.panel.image);
        let most = fine.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        self.image(canvas, &fine, most);
        let [x, y] = self.at;
        let side = self.side as f64;
        canvas.text(self.panel.name, [x + 0.5 * side, y - 8.0], TEXT, Align::Center, BLACK);
        self.axes(canvas);
        self.marks(canvas);
        if let Some(stokes) = &self.panel.polarized {
            self.ticks(canvas, stokes, &fine, most)?;
        }
        let pixel = self.field_uas / self.n as f64;
        self.bar(
            canvas,
            self.panel.image.iter().fold(0.0, |a: f64, b| a.max(*b)) / (pixel * pixel),
        );
        Ok(())
    }

    fn fine(&self, image: &[f64]) -> Vec<f32> {
        let single: Vec<f32> = image.iter().map(|x| *x as f32).collect();
        enlarged(&single, self.n, self.side / self.n)
    }

    fn image(&self, canvas: &mut Canvas, fine: &[f32], most: f32) {
        let table = Colormap::Inferno.table();
        let picture = image::RgbImage::from_fn(self.side as u32, self.side as u32, |x, y| {
            let part = (fine[y as usize * self.side + x as usize] / most).clamp(0.0, 1.0);
            image::Rgb(table[(part * (table.len() - 1) as f32).round() as usize])
        });
        canvas.paste(&picture, self.at[0] as u32, self.at[1] as u32);
    }

    /// Pixels of a length on the sky.
    fn pixels(&self, uas: f64) -> f64 {
        uas * self.side as f64 / self.field_uas
    }

    /// Offsets from the middle to the east (left) and to the north (up), µas.
    fn axes(&self, canvas: &mut Canvas) {
        let [x, y] = self.at;
        let side = self.side as f64;
        let step = round_below(0.26 * self.field_uas);
        let last = (0.5 * self.field_uas / step) as i32;
        for offset in (-last..=last).map(|k| f64::from(k) * step) {
            let text = format!("{offset}").replace('-', "−");
            // East is left and north up: both offsets run against those of the canvas.
            let across = x + 0.5 * side - self.pixels(offset);
            let down = y + 0.5 * side - self.pixels(offset);
            let foot = y + side;
            canvas.line(&[[across, foot], [across, foot + 5.0]], false, 1.0, BLACK);
            canvas.text(&text, [across, foot + 18.0], TEXT, Align::Center, BLACK);
            canvas.line(&[[x - 5.0, down], [x, down]], false, 1.0, BLACK);
            canvas.text(&text, [x - 8.0, down + 4.0], TEXT, Align::Right, BLACK);
        }
        let below = [x + 0.5 * side, y + side + 34.0];
        canvas.text("east, µas", below, TEXT, Align::Center, BLACK);
        canvas.text("north, µas", [x - 8.0, y - 8.0], TEXT, Align::Center, BLACK);
    }

    /// A scale, directions and the beam.
    fn marks(&self, canvas: &mut Canvas) {
        let [x, y] = self.at;
        let (side, line) = (self.side as f64, |canvas: &mut Canvas, points: &[[f64; 2]]| {
            canvas.line(points, false, 1.5, WHITE);
        });
        let length = round_below(0.3 * self.field_uas);
        let [from, foot] = [x + 12.0, y + side - 12.0];
        let end = from + self.pixels(length);
        line(canvas, &[[from, foot], [end, foot]]);
        let place = [0.5 * (from + end), foot - 6.0];
        canvas.label(&format!("{length} µas"), place, TEXT, Align::Center);
        let [corner, top] = [x + side - 14.0, y + 50.0];
        let arrow = |canvas: &mut Canvas, [dx, dy]: [f64; 2], name: &str, at: [f64; 2]| {
            let tip = [corner + 26.0 * dx, top + 26.0 * dy];
            line(canvas, &[[corner, top], tip]);
            let barb = |turn: f64| [tip[0] - 6.0 * dx + turn * dy, tip[1] - 6.0 * dy + turn * dx];
            line(canvas, &[barb(3.0), tip, barb(-3.0)]);
            canvas.label(name, at, TEXT, Align::Center);
        };
        arrow(canvas, [0.0, -1.0], "N", [corner, top - 30.0]);
        arrow(canvas, [-1.0, 0.0], "E", [corner - 36.0, top + 4.0]);
        let Some(beam) = self.panel.beam_uas else { return };
        let radius = 0.5 * self.pixels(beam);
        let [middle, height] = [x + side - 10.0 - radius, y + side - 10.0 - radius];
        let turn = |k: i32| f64::from(k) * core::f64::consts::TAU / 60.0;
        let circle = (0..60).map(|k| [turn(k).cos(), turn(k).sin()]);
        let circle: Vec<[f64; 2]> =
            circle.map(|[c, s]| [middle + radius * c, height + radius * s]).collect();
        canvas.line(&circle, true, 1.5, WHITE);
    }

    fn ticks(
        &self,
        canvas: &mut Canvas,
        [q, u]: &[Vec<f64>; 2],
        light: &[f32],
        most: f32,
    ) -> anyhow::Result<()> {
        let side = self.side;
        let channel =
            |name: &str, image| Channel { name: name.to_owned(), values: self.fine(image) };
        let channels = vec![channel("Q", q), channel("U", u)];
        let all = ticks::ticks(&Picture { width: side, height: side, channels }, ACROSS);
        let mut all: Vec<Tick> = all.context("there is no polarisation to draw")?;
        all.retain(|tick| {
            let [x, y] = tick.middle.map(|x| (x as usize).min(side - 1));
            f64::from(light[y * side + x]) >= LEAST_LIGHT * f64::from(most)
        });
        for tick in &mut all {
            tick.middle = [tick.middle[0] + self.at[0], tick.middle[1] + self.at[1]];
        }
        ticks::draw(canvas, &all, 1.1 * side as f64 / ACROSS as f64);
        Ok(())
    }

    /// The colour bar, up to a brightness in Jy/µas².
    fn bar(&self, canvas: &mut Canvas, most: f64) {
        let [x, y] = [self.at[0] + self.side as f64 + 8.0, self.at[1]];
        let (side, table) = (self.side as f64, Colormap::Inferno.table());
        for row in 0..self.side {
            let part = 1.0 - (row as f64 + 0.5) / side;
            let color: Rgb = table[(part * (table.len() - 1) as f64).round() as usize];
            canvas.rectangle(x, y + row as f64, 12.0, 1.0, color);
        }
        let (factor, unit) = [(1.0, "Jy"), (1e3, "mJy"), (1e6, "µJy"), (1e9, "nJy")]
            .into_iter()
            .find(|(factor, _)| factor * most >= 0.1)
            .unwrap_or((1e9, "nJy"));
        let step = round_below(0.34 * factor * most);
        for value in (0..).map(|k| f64::from(k) * step).take_while(|v| *v <= factor * most) {
            let height = y + side * (1.0 - value / (factor * most));
            canvas.line(&[[x + 12.0, height], [x + 16.0, height]], false, 1.0, BLACK);
            // As many digits as the step has.
            let digits = (-step.log10().floor()).max(0.0) as usize;
            let text = format!("{value:.digits$}");
            canvas.text(&text, [x + 19.0, height + 4.0], TEXT, Align::Left, BLACK);
        }
        canvas.text(&format!("{unit}/µas²"), [x, y - 8.0], TEXT, Align::Left, BLACK);
    }
}

/// The largest of 1, 2 and 5 times a power of ten that is not above a number.
fn round_below(x: f64) -> f64 {
    let power = 10f64.powf(x.max(f64::MIN_POSITIVE).log10().floor());
    [5.0, 2.0].into_iter().map(|k| k * power).find(|y| *y <= x).unwrap_or(power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_round_numbers() {
        for (x, round) in [(33.0, 20.0), (0.7, 0.5), (1.0, 1.0), (9.9, 5.0), (0.019, 0.01)] {
            assert!((round_below(x) - round).abs() < 1e-12, "{x}: {}", round_below(x));
        }
    }

    /// A tick where there is light and none where there is not, though both are polarised alike; the brightest pixel has the
    /// last colour on its own scale, and a beam is drawn where there is one.
    #[test]
    fn exact_ticks_stand_where_there_is_light() {
        let n = 32;
        // Between pixels light is interpolated: the last lit one is a pixel away from the middle.
        let lit = |k: usize| if k % n < n / 2 - 1 { 1.0 } else { 0.01 };
        let light: Vec<f64> = (0..n * n).map(lit).collect();
        let panel = |polarized, beam_uas| SkyPanel {
            name: "a sky",
            image: light.clone(),
            polarized,
            beam_uas,
        };
        let drawn = |panel| {
            let figure = sky(&[panel], n, 100.0, "A sky.").unwrap();
            image::load_from_memory(&figure.png).unwrap().to_rgb8()
        };
        let plain = drawn(panel(None, None));
        let ticked = drawn(panel(Some([vec![0.3; n * n], vec![0.0; n * n]]), None));
        let differ = |a: &image::RgbImage, b: &image::RgbImage, half: u32| {
            let (left, top, side) = (ROOM[0] as u32, ROOM[1] as u32, 320);
            // Pixels between the halves have light of both.
            let from = left + half * (side / 2 + 20);
            (from..from + side / 2 - 20)
                .flat_map(|x| (top..top + side).map(move |y| (x, y)))
                .filter(|(x, y)| a.get_pixel(*x, *y) != b.get_pixel(*x, *y))
                .count()
        };
        assert!(differ(&plain, &ticked, 0) > 500);
        assert!(differ(&plain, &ticked, 1) < 40, "{}", differ(&plain, &ticked, 1));
        let seen = drawn(panel(None, Some(20.0)));
        assert!(differ(&plain, &seen, 1) > 100 && differ(&plain, &seen, 0) == 0);
        let last = *Colormap::Inferno.table().last().unwrap();
        assert_eq!(plain.get_pixel(ROOM[0] as u32 + 80, ROOM[1] as u32 + 100).0, last);
    }
}

//! Pictures with ticks of linear polarisation.

use super::pictures::{Figure, Sheet, encode};
use anyhow::Context;
use kerrlight_render::image::canvas::Canvas;
use kerrlight_render::image::ticks::{self, Tick};
use kerrlight_render::image::{Channel, Picture};

/// Ticks from left to right of an image.
const ACROSS: usize = 22;

/// Images of I, Q and U of n × n pixels beside each other, each on a scale of its own: brightness with ticks along the
/// polarisation.
///
/// # Errors
/// If it cannot be drawn.
pub fn ticked(images: &[(&str, [Vec<f32>; 3])], n: usize, what: &str) -> anyhow::Result<Figure> {
    let mut sheet = Sheet::new([images.len(), 1], n, 1, 1.0);
    for (k, (_, [light, ..])) in images.iter().enumerate() {
        let most = light.iter().fold(f32::MIN_POSITIVE, |most, x| most.max(*x));
        let scaled: Vec<f32> = light.iter().map(|x| x / most).collect();
        sheet.put([k, 0], &scaled);
    }
    let mut canvas = Canvas::of(sheet.drawn()).context("the picture is too large to draw on")?;
    for (k, (_, stokes)) in images.iter().enumerate() {
        let ticks = ticks_of(stokes, n)?;
        let left = (k * sheet.pitch()) as f64;
        let moved: Vec<Tick> = ticks
            .into_iter()
            .map(|tick| Tick { middle: [tick.middle[0] + left, tick.middle[1]], ..tick })
            .collect();
        ticks::draw(&mut canvas, &moved, 1.1 * n as f64 / ACROSS as f64);
    }
    let names = images.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", right of it ");
    let caption = format!(
        "{what} Shown: {names}, each on a linear scale of its own from black (0) to yellow. North is up, east to the left."
    );
    let alt = format!("Polarised images: {names}.");
    Ok(Figure { png: encode(Some(canvas.into_picture()))?, caption, alt })
}

fn ticks_of([_, q, u]: &[Vec<f32>; 3], n: usize) -> anyhow::Result<Vec<Tick>> {
    let channel =
        |name: &str, values: &Vec<f32>| Channel { name: name.to_owned(), values: values.clone() };
    let picture = Picture { width: n, height: n, channels: vec![channel("Q", q), channel("U", u)] };
    ticks::ticks(&picture, ACROSS).context("there is no polarisation to draw")
}

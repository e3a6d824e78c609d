//! A contact sheet: every channel of a picture as a small picture with its name and a colour bar.

use super::canvas::{Align, BLACK, Canvas, Rgb, WHITE};
use super::colormap::Colormap;
use super::overlay::digits;
use super::preview::{self, Look};
use super::{Channel, Picture};
use crate::Error;
use image::RgbImage;
use image::imageops::{FilterType, resize};
use std::f64::consts::PI;

/// Width of a small picture in pixels.
const PANEL: u32 = 320;
/// Space around it, size of text, and thickness of a colour bar.
const MARGIN: u32 = 14;
const TEXT: u32 = 18;
const BAR: u32 = 12;
/// Where there is no value.
const NOTHING: Rgb = [48; 3];

/// A panel: its title, the picture and the ends of its colour bar, if it has one.
struct Panel {
    title: String,
    drawn: RgbImage,
    bar: Option<(Colormap, [f64; 2])>,
}

/// Draws the contact sheet: the R, G, B channels together, then each of the others. A colour bar
/// spans all but the outermost 0.2 % of the values (whole numbers and angles: all of them); where a quantity of the emission has none
/// (`radius` is 0) the panel is grey.
///
/// # Errors
/// If the picture is too small or too large to be drawn.
pub fn sheet(picture: &Picture) -> Result<RgbImage, Error> {
    let mut panels = Vec::new();
    if ["R", "G", "B"].iter().all(|name| picture.channel(name).is_some()) {
        let white = preview::white(picture, Look::Color)?;
        let drawn = small(&preview::draw(picture, Look::Color, white)?, FilterType::Triangle);
        panels.push(Panel { title: "R, G, B".to_owned(), drawn, bar: None });
    }
    let others = picture.channels.iter().filter(|c| !["R", "G", "B"].contains(&c.name.as_str()));
    for channel in others {
        panels.push(panel(picture, channel)?);
    }
    arrange(&panels).ok_or_else(preview::missing)
}

fn panel(picture: &Picture, channel: &Channel) -> Result<Panel, Error> {
    let there = mask(picture, &channel.name);
    let seen = channel.values.iter().zip(&there).filter(|(_, there)| **there);
    let (map, ends) = scale(&channel.name, seen.map(|(value, _)| *value).collect());
    let table = map.table();
    let shade = |(value, there): (&f32, &bool)| {
        let part = (f64::from(*value) - ends[0]) / (ends[1] - ends[0]);
        let color = table[(part.clamp(0.0, 1.0) * 1023.0).round() as usize];
        if *there { color } else { NOTHING }
    };
    let pixels = channel.values.iter().zip(&there).flat_map(shade).collect();
    let (width, height) = (picture.width as u32, picture.height as u32);
    let drawn = RgbImage::from_raw(width, height, pixels).ok_or_else(preview::missing)?;
    // Whole numbers and angles have no mean.
    let drawn = small(&drawn, FilterType::Nearest);
    Ok(Panel { title: channel.name.clone(), drawn, bar: Some((map, ends)) })
}

/// Colours of a channel, and the values at their ends: Stokes parameters about 0, angles all around,
/// whole numbers up to the largest of them.
fn scale(name: &str, values: Vec<f32>) -> (Colormap, [f64; 2]) {
    let largest = |values: &[f32]| values.iter().copied().fold(0.0, f32::max);
    match name {
        "intensity" => (Colormap::AfmhotUs, range(values)),
        "Q" | "U" | "V" => {
            let [low, high] = range(values);
            let most = low.abs().max(high.abs());
            (Colormap::RedBlue, [-most, most])
        }
        "azimuth" => (Colormap::Sinebow, [-PI, PI]),
        "crossings" => (Colormap::Viridis, [0.0, f64::from(largest(&values)).max(1.0)]),
        "outcome" => (Colormap::Viridis, [0.0, 3.0]),
        _ => (Colormap::Viridis, range(values)),
    }
}

/// Where a channel has values.
fn mask(picture: &Picture, name: &str) -> Vec<bool> {
    let of_emission = ["redshift", "radius", "azimuth", "delay"].contains(&name);
    match picture.channel("radius") {
        Some(radius) if of_emission => radius.iter().map(|r| *r > 0.0).collect(),
        _ => vec![true; picture.width * picture.height],
    }
}

/// The range of values without the outermost 0.2 % on either side; never empty.
fn range(mut values: Vec<f32>) -> [f64; 2] {
    if values.is_empty() {
        return [0.0, 1.0];
    }
    values.sort_unstable_by(f32::total_cmp);
    let last = (values.len() - 1) as f64;
    let [low, high] = [0.002, 0.998].map(|part| f64::from(values[(part * last).round() as usize]));
    if high > low { [low, high] } else { [low, low + low.abs().max(1.0)] }
}

fn small(drawn: &RgbImage, filter: FilterType) -> RgbImage {
    let (width, height) = drawn.dimensions();
    let tall = (f64::from(PANEL) * f64::from(height) / f64::from(width)).round();
    resize(drawn, PANEL, tall.clamp(1.0, 4.0 * f64::from(PANEL)) as u32, filter)
}

fn arrange(panels: &[Panel]) -> Option<RgbImage> {
    let columns = (panels.len() as f64).sqrt().ceil().max(1.0) as u32;
    let rows = (panels.len() as u32).div_ceil(columns).max(1);
    let tall = panels.first()?.drawn.height();
    let cell = [PANEL + 2 * MARGIN, tall + 2 * MARGIN + 2 * TEXT + BAR + 14];
    let mut canvas = Canvas::new(columns * cell[0], rows * cell[1], BLACK)?;
    for (k, panel) in panels.iter().enumerate() {
        let (column, row) = (k as u32 % columns, k as u32 / columns);
        place(&mut canvas, panel, column * cell[0] + MARGIN, row * cell[1] + MARGIN);
    }
    Some(canvas.into_picture())
}

fn place(canvas: &mut Canvas, panel: &Panel, left: u32, top: u32) {
    let (x, size) = (f64::from(left), f64::from(TEXT));
    canvas.text(&panel.title, [x, f64::from(top) + 0.8 * size], size, Align::Left, WHITE);
    let top = top + TEXT + 4;
    canvas.paste(&panel.drawn, left, top);
    let Some((map, ends)) = panel.bar else { return };
    let table = map.table();
    let top = top + panel.drawn.height() + 6;
    let shade = |k: u32| table[(k * 1023 / (PANEL - 1)) as usize];
    let strip = RgbImage::from_fn(PANEL, BAR, |x, _| image::Rgb(shade(x)));
    canvas.paste(&strip, left, top);
    let base = f64::from(top + BAR) + 0.95 * size;
    canvas.text(&digits(ends[0]), [x, base], size, Align::Left, WHITE);
    let right = x + f64::from(PANEL);
    canvas.text(&digits(ends[1]), [right, base], size, Align::Right, WHITE);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_panels_and_colours() {
        let channel =
            |name: &str, values: &[f32]| Channel { name: name.to_owned(), values: values.to_vec() };
        let channels = vec![
            channel("intensity", &[0.0, 1.0, 0.5, 0.25]),
            channel("radius", &[0.0, 6.0, 8.0, 10.0]),
            channel("azimuth", &[0.0, -1.0, 1.0, 0.0]),
        ];
        let drawn = sheet(&Picture { width: 2, height: 2, channels }).unwrap();
        // Two columns, two rows; without R, G, B three panels.
        let cell = [PANEL + 2 * MARGIN, PANEL + 2 * MARGIN + 2 * TEXT + BAR + 14];
        assert_eq!(drawn.dimensions(), (2 * cell[0], 2 * cell[1]));
        let at = |column: u32, x: u32, y: u32| {
            let (left, top) = (column * cell[0] + MARGIN, MARGIN + TEXT + 4);
            drawn.get_pixel(left + PANEL / 4 + x * PANEL / 2, top + PANEL / 4 + y * PANEL / 2).0
        };
        assert_eq!((at(0, 0, 0), at(0, 1, 0)), ([0; 3], [255; 3]));
        let viridis = Colormap::Viridis.table();
        assert_eq!((at(1, 0, 0), at(1, 1, 0), at(1, 1, 1)), (NOTHING, viridis[0], viridis[1023]));
        assert_eq!(range(vec![3.0; 5]), [3.0, 6.0]);
        assert_eq!(scale("V", vec![-2.0, 1.0]), (Colormap::RedBlue, [-2.0, 2.0]));
        assert_eq!(scale("azimuth", vec![0.1]), (Colormap::Sinebow, [-PI, PI]));
        let mut counts = vec![0.0; 999];
        counts.push(4.0);
        assert_eq!(scale("crossings", counts).1, [0.0, 4.0]);
    }
}

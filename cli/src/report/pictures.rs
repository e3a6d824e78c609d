//! Pictures of volumes with the captions that belong to them.

use anyhow::{Context, anyhow};
use kerrlight_tomo::image::colormap::Colormap;
use kerrlight_tomo::volume::Shown;
use kerrlight_tomo::volume::projection::{self, Surroundings, VIEWS};
use kerrlight_tomo::volume::slices::{self, Through};
use std::io::Cursor;

/// A picture of the page.
#[derive(Debug)]
pub struct Figure {
    /// The bytes of its PNG file.
    pub png: Vec<u8>,
    /// What it shows and how it was made.
    pub caption: String,
    /// What somebody who does not see it should know.
    pub alt: String,
}

/// The bytes of a picture's PNG file.
///
/// # Errors
/// If there is no picture.
pub fn encode(drawn: Option<image::RgbImage>) -> anyhow::Result<Vec<u8>> {
    let drawn = drawn.ok_or_else(|| anyhow!("there is nothing to draw"))?;
    let mut bytes = Cursor::new(Vec::new());
    drawn.write_to(&mut bytes, image::ImageFormat::Png).context("cannot encode a picture")?;
    Ok(bytes.into_inner())
}

fn names(shown: &[Shown]) -> String {
    shown.iter().map(|s| s.name).collect::<Vec<_>>().join(" and ")
}

/// Slices of volumes along three planes through one point, which is sought in the last of them (the
/// truth, where there is one); `unit` is that of the emission, `hole_radius` in M.
///
/// # Errors
/// If there is no volume.
pub fn slices(
    shown: &[Shown],
    through: Through,
    hole_radius: f64,
    unit: &str,
) -> anyhow::Result<Figure> {
    let last = shown.last().ok_or_else(|| anyhow!("there is nothing to draw"))?;
    let point = through.point(last.volume);
    let [x, y, z] = point.map(|x| format!("{x:.2}").replace('-', "−"));
    let (all, from, name) = (names(shown), through.name(), last.name);
    let caption = format!(
        "Emission ({all}) in the planes through ({x}, {y}, {z}) M, the {from} of the volume \
         \"{name}\". All panels have one colour scale; short marks at the edges show where the planes \
         cut each other, a circle is the hole's horizon in that plane."
    );
    let alt = format!("Three orthogonal slices of the emission: {all}.");
    Ok(Figure { png: encode(slices::sheet(shown, point, hole_radius, unit))?, caption, alt })
}

/// Volumes from four sides; `unit` is that of the emission.
///
/// # Errors
/// If there is no volume.
pub fn projections(shown: &[Shown], around: &Surroundings, unit: &str) -> anyhow::Result<Figure> {
    let all = names(shown);
    let (hole, ring) = (around.hole_radius, around.ring_radius);
    let caption = format!(
        "Emission ({all}) summed up along straight parallel rays, seen from four directions: a drawing \
         of the volume in flat space, without lensing, delay or Doppler shift. All panels have one \
         colour scale. The dark ball has the radius of the horizon, {hole:.3} M, and hides what is \
         behind it; the blue line is the axis that matter turns about, the green circle has a radius \
         of {ring:.2} M in the hole's equatorial plane."
    );
    let alt = format!("The emission seen from four directions: {all}.");
    Ok(Figure { png: encode(projection::sheet(shown, &VIEWS, around, unit))?, caption, alt })
}

/// Frames of a strip of a movie.
const STRIP: usize = 6;

/// Some frames of movies of n × n pixels, a row each, on one scale of brightness; `times` in M.
///
/// # Errors
/// If it cannot be encoded.
pub fn frames(movies: &[(&str, Vec<f32>)], n: usize, times: &[f64]) -> anyhow::Result<Figure> {
    let count = times.len().min(STRIP);
    let chosen: Vec<usize> =
        (0..count).map(|k| k * (times.len() - 1) / (count.max(2) - 1)).collect();
    let most = movies.iter().flat_map(|(_, movie)| movie).fold(0.0f32, |most, x| most.max(*x));
    let table = Colormap::Inferno.table();
    let (zoom, gap) = ((160 / n).max(1), 4);
    let side = n * zoom + gap;
    let mut drawn = image::RgbImage::from_pixel(
        (side * count) as u32,
        (side * movies.len()) as u32,
        image::Rgb([128; 3]),
    );
    for (row, (_, movie)) in movies.iter().enumerate() {
        for (column, frame) in chosen.iter().enumerate() {
            for (k, value) in movie[frame * n * n..(frame + 1) * n * n].iter().enumerate() {
                let part = (value / most.max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
                let last = (table.len() - 1) as f32;
                let color = table[(part * last).round() as usize];
                for pixel in 0..zoom * zoom {
                    let x = column * side + k % n * zoom + pixel % zoom;
                    let y = row * side + k / n * zoom + pixel / zoom;
                    drawn.put_pixel(x as u32, y as u32, image::Rgb(color));
                }
            }
        }
    }
    let at: Vec<String> = chosen.iter().map(|k| format!("{:.1}", times[*k])).collect();
    let names = movies.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", below it ");
    let caption = format!(
        "Lensed images as the observer sees them ({names}), at times {} GM/c³. All have one linear \
         scale of brightness, from 0 to {most:.3e} Jy a pixel; north is up, east to the left.",
        at.join(", ")
    );
    let alt = format!("Frames of the movie: {names}.");
    Ok(Figure { png: encode(Some(drawn))?, caption, alt })
}

//! Pictures of volumes with the captions that belong to them.

use anyhow::{Context, anyhow};
use kerrlight_common::frames::Frames;
use kerrlight_render::image::colormap::Colormap;
use kerrlight_render::volume::Shown;
use kerrlight_render::volume::projection::{self, Surroundings, VIEWS};
use kerrlight_render::volume::slices::{self, Outlines, Through};
use kerrlight_vlbi::operator::Float;
use std::io::Cursor;

/// A picture of the page.
#[derive(Debug)]
pub struct Figure {
    /// The bytes of its PNG file.
    pub png: Vec<u8>,
    /// Caption: what it shows, and how it was made.
    pub caption: String,
    /// Description for somebody who does not see it.
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
/// truth, where there is one), with outlines of another volume; `unit` is that of the emission, `hole_radius` in M.
///
/// # Errors
/// If there is no volume.
pub fn slices(
    shown: &[Shown],
    through: Through,
    hole_radius: f64,
    outlines: Option<Outlines<'_>>,
    unit: &str,
) -> anyhow::Result<Figure> {
    let last = shown.last().ok_or_else(|| anyhow!("there is nothing to draw"))?;
    let point = through.point(last.volume);
    let [x, y, z] = point.map(|x| format!("{x:.2}").replace('-', "−"));
    let (all, from, name) = (names(shown), through.name(), last.name);
    let caption = format!(
        "Emission ({all}) in three planes at right angles through one point, ({x}, {y}, {z}) M, the {from} \
         of the volume \"{name}\": cuts through the volume at the reference time. 1 M is half the radius of \
         a hole without spin. All panels have one colour scale; short marks at the edges show where the planes \
         cut each other, a circle is the hole's horizon in that plane."
    );
    let alt = format!("Three orthogonal slices of the emission: {all}.");
    Ok(Figure {
        png: encode(slices::sheet(shown, point, hole_radius, outlines, unit))?,
        caption,
        alt,
    })
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
         of the volume in flat space, without lensing, delay or Doppler shift, not what a telescope sees. All panels have one \
         colour scale. The dark ball has the radius of the horizon, {hole:.3} M, and hides what is \
         behind it; the blue line is the axis that matter turns about, the green circle has a radius \
         of {ring:.2} M in the hole's equatorial plane."
    );
    let alt = format!("The emission seen from four directions: {all}.");
    Ok(Figure { png: encode(projection::sheet(shown, &VIEWS, around, unit))?, caption, alt })
}

/// Frames of a strip of a movie.
const STRIP: usize = 6;

/// Images of n × n pixels on a sheet of equal cells, on one scale of colours.
struct Sheet {
    drawn: image::RgbImage,
    n: usize,
    zoom: usize,
    /// The values of the first and the last colour.
    ends: [f32; 2],
    table: Vec<[u8; 3]>,
}

/// Grey lines between images, pixels.
const GAP: usize = 4;

impl Sheet {
    /// Brightness from 0 to `most`.
    fn new(cells: [usize; 2], n: usize, zoom: usize, most: f32) -> Self {
        // Dark images have no scale of their own.
        let ends = [0.0, most.max(f32::MIN_POSITIVE)];
        Self::colored(cells, n, zoom, ends, Colormap::Inferno)
    }

    fn colored(
        [columns, rows]: [usize; 2],
        n: usize,
        zoom: usize,
        ends: [f32; 2],
        colors: Colormap,
    ) -> Self {
        let side = n * zoom + GAP;
        let [width, height] = [columns, rows].map(|count| (side * count) as u32);
        let drawn = image::RgbImage::from_pixel(width, height, image::Rgb([128; 3]));
        Self { drawn, n, zoom, ends, table: colors.table() }
    }

    fn put(&mut self, [column, row]: [usize; 2], image: &[f32]) {
        let (n, zoom, table, [low, high]) = (self.n, self.zoom, &self.table, self.ends);
        let [left, top] = [column, row].map(|k| k * (n * zoom + GAP));
        for (k, value) in image.iter().enumerate() {
            let part = ((value - low) / (high - low)).clamp(0.0, 1.0);
            let color = image::Rgb(table[(part * (table.len() - 1) as f32).round() as usize]);
            for pixel in 0..zoom * zoom {
                let (x, y) = (k % n * zoom + pixel % zoom, k / n * zoom + pixel / zoom);
                self.drawn.put_pixel((left + x) as u32, (top + y) as u32, color);
            }
        }
    }
}

/// Some frames of a movie.
pub struct Strip<'a> {
    name: &'a str,
    images: Vec<Vec<f32>>,
    /// The largest pixel of all frames.
    most: f32,
}

impl<'a> Strip<'a> {
    /// Takes a movie of this name.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn new<T: Float>(name: &'a str, movie: &Frames<T>) -> anyhow::Result<Self> {
        let mut images = Vec::new();
        for frame in chosen(movie.count()) {
            images.push(movie.image(frame)?.iter().map(|x| x.double() as f32).collect());
        }
        Ok(Self { name, images, most: movie.largest()?.double() as f32 })
    }
}

/// Frames of a strip, of so many.
fn chosen(all: usize) -> Vec<usize> {
    let count = all.min(STRIP);
    // With the first and the last.
    (0..count).map(|k| k * (all - 1) / (count.max(2) - 1)).collect()
}

/// Some frames of movies of n × n pixels, a row each, on one scale of brightness; `times` in M.
///
/// # Errors
/// If it cannot be encoded.
pub fn frames(movies: &[Strip<'_>], n: usize, times: &[f64]) -> anyhow::Result<Figure> {
    let chosen = chosen(times.len());
    let most = movies.iter().fold(0.0f32, |most, movie| most.max(movie.most));
    let mut sheet = Sheet::new([chosen.len(), movies.len()], n, (160 / n).max(1), most);
    for (row, movie) in movies.iter().enumerate() {
        for (column, image) in movie.images.iter().enumerate() {
            sheet.put([column, row], image);
        }
    }
    let at: Vec<String> = chosen.iter().map(|k| format!("{:.1}", times[*k])).collect();
    let names = movies.iter().map(|movie| movie.name).collect::<Vec<_>>().join(", below it ");
    let caption = format!(
        "Frames of the movie as the observer sees them, bent light included ({names}), at times {} GM/c³. \
         These pixels are what is compared with the data. All have one linear scale of brightness, from \
         black (0) to yellow ({most:.3e} Jy a pixel); north is up, east to the left.",
        at.join(", ")
    );
    let alt = format!("Frames of the movie: {names}.");
    Ok(Figure { png: encode(Some(sheet.drawn))?, caption, alt })
}

/// Colours of residuals reach at least so many σ to both sides: noise alone stays pale.
const FAINTEST: f32 = 5.0;

/// Residuals of n × n pixels in units of σ beside each other; `what` says how they were made.
///
/// # Errors
/// If it cannot be encoded.
pub fn residuals(maps: &[(&str, &Vec<f32>)], n: usize, what: &str) -> anyhow::Result<Figure> {
    let all = maps.iter().flat_map(|(_, map)| *map);
    let (worst, most) = all.fold((0.0f32, FAINTEST), |(worst, most), x| {
        (if x.abs() > worst.abs() { *x } else { worst }, most.max(x.abs()))
    });
    let (cells, zoom) = ([maps.len(), 1], (320 / n).max(1));
    let mut sheet = Sheet::colored(cells, n, zoom, [-most, most], Colormap::RedBlue);
    maps.iter().enumerate().for_each(|(k, (_, map))| sheet.put([k, 0], map));
    let names = maps.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", right of it ");
    let worst = format!("{worst:.1}").replace('-', "−");
    let caption = format!(
        "{what} Shown: {names}. Red is below 0, white 0, blue above; the colours end at ±{most:.1}. The pixel \
         that is furthest off has {worst}. Noise alone gives a pale pattern without structure; what has the shape of \
         the source is light that the model puts elsewhere. North is up, east to the left."
    );
    let alt = format!("Map of the residuals: {names}.");
    Ok(Figure { png: encode(Some(sheet.drawn))?, caption, alt })
}

/// An image of n × n pixels with `zoom` times as many along each side, linear between the centres of its own.
pub fn enlarged(image: &[f32], n: usize, zoom: usize) -> Vec<f32> {
    let last = n.saturating_sub(1);
    // Beyond the centres of the outer pixels their own values go on.
    let place = |k: usize| ((k as f32 + 0.5) / zoom as f32 - 0.5).clamp(0.0, last as f32);
    let at = |row: f32, column: f32| {
        let (i, j) = (row as usize, column as usize);
        let (a, b) = (row - i as f32, column - j as f32);
        let value = |i: usize, j: usize| image[i.min(last) * n + j.min(last)];
        let along = |i: usize| value(i, j) * (1.0 - b) + value(i, j + 1) * b;
        along(i) * (1.0 - a) + along(i + 1) * a
    };
    let side = n * zoom;
    (0..side * side).map(|k| at(place(k / side), place(k % side))).collect()
}

/// Images of n × n pixels beside each other, north up; `what` says what they are.
///
/// # Errors
/// If it cannot be encoded.
pub fn images(images: &[(&str, Vec<f32>)], n: usize, what: &str) -> anyhow::Result<Figure> {
    let most = images.iter().flat_map(|(_, image)| image).fold(0.0f32, |most, x| most.max(*x));
    let mut sheet = Sheet::new([images.len(), 1], n, 1, most);
    images.iter().enumerate().for_each(|(k, (_, image))| sheet.put([k, 0], image));
    let names = images.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", right of it ");
    let caption = format!(
        "{what} Shown: {names}, on one linear scale of brightness from black (0) to yellow. North is up, east to the left."
    );
    let alt = format!("Images: {names}.");
    Ok(Figure { png: encode(Some(sheet.drawn))?, caption, alt })
}

/// Sharp images of n × n rays beside each other, at a time in M; `with` says what of light is in them.
///
/// # Errors
/// If it cannot be encoded.
pub fn still(
    images: &[(&str, &Vec<f32>)],
    n: usize,
    time: f64,
    with: &str,
) -> anyhow::Result<Figure> {
    let most = images.iter().flat_map(|(_, image)| *image).fold(0.0f32, |most, x| most.max(*x));
    let mut sheet = Sheet::new([images.len(), 1], n, 2, most);
    images.iter().enumerate().for_each(|(k, (_, image))| sheet.put([k, 0], image));
    let names = images.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", right of it ");
    let caption = format!(
        "The volume as the observer sees it at time {time:.1} GM/c³ ({names}), with {n} × {n} rays that are bent by \
         the hole; {with}. Light that passes close to the hole goes around it: a spot has fainter second \
         images on the other side, and what is behind the hole is seen around it. This is sharper than the pixels \
         that are fitted to the data, which are shown further down; photon rings have as many more rays as they need. One linear scale of brightness, from black (0) to yellow \
         ({most:.3e}: emission summed up along the ray, in M)."
    );
    let alt = format!("The lensed image of the volume: {names}.");
    Ok(Figure { png: encode(Some(sheet.drawn))?, caption, alt })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_enlarged_pixels_lie_between() {
        let fine = enlarged(&[0.0, 1.0, 2.0, 3.0], 2, 2);
        assert_eq!(fine.len(), 16);
        assert_eq!((fine[0], fine[15], fine[5]), (0.0, 3.0, 0.75));
    }
}

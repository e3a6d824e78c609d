//! An equirectangular picture of the whole sky.

use super::beam::Beam;
use super::exr_sky;
use crate::Error;
use crate::image::decode::{Colors, bilinear, dimensions, linear_colors};
use crate::image::exr;
use crate::image::profile::other_than_srgb;
use core::f64::consts::{PI, TAU};
use kerrlight_common::memory;

/// A decoded equirectangular picture in linear colour.
#[derive(Debug, Clone)]
pub struct Panorama {
    width: usize,
    height: usize,
    /// Rows from the top (+z), linear R, G, B.
    pixels: Vec<[f32; 3]>,
    /// The same with half as many pixels a side, again and again; only where beams ask for it.
    coarser: Vec<Panorama>,
    warnings: Vec<String>,
}

/// First bytes of an OpenEXR file.
const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Reason why a picture cannot be the sky.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PanoramaError {
    /// The bytes are no picture that can be read.
    #[error("not a readable PNG, JPEG, HDR or EXR picture: {0}")]
    Decode(#[from] image::ImageError),
    /// There is no memory for it.
    #[error(transparent)]
    Memory(#[from] memory::TooLarge),
    /// An EXR that cannot be read.
    #[error("damaged or unusual EXR: {0}")]
    Exr(#[source] Box<Error>),
    /// The picture is empty or has a value that is no colour.
    #[error("{0}")]
    Content(String),
}

impl PanoramaError {
    pub(super) fn exr(error: Error) -> Self {
        PanoramaError::Exr(Box::new(error))
    }
}

impl Panorama {
    /// Decodes a PNG, JPEG, Radiance HDR or OpenEXR picture; 8- and 16-bit colours are taken as sRGB,
    /// those of HDR and EXR (channels R, G, B, or Y) as linear.
    ///
    /// # Errors
    /// If the bytes are no such picture.
    pub fn decode(bytes: &[u8]) -> Result<Self, Error> {
        let is_exr = bytes.starts_with(&EXR_MAGIC);
        let size = if is_exr {
            exr::dimensions(bytes).map_err(PanoramaError::exr)
        } else {
            dimensions(bytes).map_err(PanoramaError::Decode)
        };
        let (width, height) = size?;
        let what = || format!("a sky of {width} x {height} pixels");
        memory::afford(what, memory::colours(width.into(), height.into()))?;
        if is_exr {
            let (width, height, pixels) = exr_sky::colors(bytes)?;
            return Ok(Self::new(width, height, pixels)?);
        }
        let Colors { width, height, pixels } =
            linear_colors(bytes).map_err(PanoramaError::Decode)?;
        let mut sky = Self::new(width, height, pixels)?;
        let other = other_than_srgb(bytes).map_err(PanoramaError::Decode)?;
        // Radiance HDR.
        let taken = if bytes.starts_with(b"#?") { "linear" } else { "sRGB" };
        sky.warnings.extend(other.map(|says| format!("taken as {taken}, though it has {says}")));
        Ok(sky)
    }

    fn new(width: usize, height: usize, mut pixels: Vec<[f32; 3]>) -> Result<Self, PanoramaError> {
        if width == 0 || height == 0 {
            return Err(PanoramaError::Content("the picture has no pixels".to_owned()));
        }
        let most = pixels.iter().flatten().copied().fold(0.0, f32::max);
        let least = -SMALL * most;
        let is_color = |c: &f32| (least..=BRIGHTEST).contains(c);
        if let Some(k) = pixels.iter().position(|pixel| !pixel.iter().all(is_color)) {
            let (row, column, pixel) = (k / width + 1, k % width + 1, pixels[k]);
            let message = format!(
                "row {row}, column {column}: R, G, B = {pixel:?} are not allowed: numbers in [0, {BRIGHTEST:e}], or below 0 by at \
                 most {SMALL} of the largest"
            );
            return Err(PanoramaError::Content(message));
        }
        let mut warnings = Vec::new();
        let negative = pixels.iter().filter(|pixel| pixel.iter().any(|c| *c < 0.0)).count();
        if negative > 0 {
            pixels.iter_mut().flatten().for_each(|c| *c = c.max(0.0));
            warnings.push(format!("colours below 0 are taken for 0: {negative} pixels"));
        }
        Ok(Panorama { width, height, pixels, coarser: Vec::new(), warnings })
    }

    /// Returns the properties of the picture that are not shown as it says.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Bilinear look-up; azimuth wraps around.
    pub(super) fn color(&self, direction: [f64; 3]) -> [f32; 3] {
        let [x, y, z] = direction;
        // Seen from inside with +z up, azimuth grows to the left.
        let u = 0.5 - y.atan2(x) / TAU;
        let v = x.hypot(y).atan2(z) / PI;
        let fx = u * self.width as f64 - 0.5;
        let fy = (v * self.height as f64 - 0.5).clamp(0.0, (self.height - 1) as f64);
        let (cx, cy) = (fx.floor(), fy.floor());
        let column = |k: f64| k.rem_euclid(self.width as f64) as usize % self.width;
        let columns = (column(cx), column(cx + 1.0), (fx - cx) as f32);
        let rows = (cy as usize, (cy as usize + 1).min(self.height - 1), (fy - cy) as f32);
        bilinear(&self.pixels, self.width, columns, rows)
    }

    /// The picture with its coarser versions, for [`mean_color`](Self::mean_color).
    pub(super) fn with_pyramid(mut self) -> Self {
        let mut level = self.halved();
        while level.height >= SMALLEST {
            let next = level.halved();
            self.coarser.push(level);
            level = next;
        }
        self
    }

    /// Half as many rows and columns: means over the areas of the sphere that they cover.
    fn halved(&self) -> Panorama {
        let (width, height) = ((self.width / 2).max(1), (self.height / 2).max(1));
        let mut pixels = Vec::with_capacity(width * height);
        for row in 0..height {
            let rows = overlaps(row, height, self.height);
            for column in 0..width {
                let (mut sum, mut total) = ([0.0; 3], 0.0);
                for (y, share) in rows.clone() {
                    let area = share * self.row_sin(y);
                    for (x, share) in overlaps(column, width, self.width) {
                        let weight = area * share;
                        total += weight;
                        let pixel = self.pixels[y * self.width + x];
                        for (sum, c) in sum.iter_mut().zip(pixel) {
                            *sum += weight * f64::from(c);
                        }
                    }
                }
                pixels.push(sum.map(|c| (c / total) as f32));
            }
        }
        Panorama { width, height, pixels, coarser: Vec::new(), warnings: Vec::new() }
    }

    /// sin θ at the middle of a row.
    fn row_sin(&self, row: usize) -> f64 {
        (PI * (row as f64 + 0.5) / self.height as f64).sin()
    }

    /// Mean over a beam: an elliptical weighted average (Heckbert 1989) of the pixels of that
    /// level whose pixels are just smaller than the beam is wide.
    pub(super) fn mean_color(&self, beam: &Beam) -> [f32; 3] {
        // A needle of a beam is made broader: its cost grows with its length over its width.
        let [long, wide] = beam.spread();
        let wide = wide.max(long / LONGEST_BEAM);
        let levels = (1.5 * PI / self.height as f64 / wide).log2();
        let level = (-levels).floor().clamp(0.0, self.coarser.len() as f64) as usize;
        let level = level.checked_sub(1).map_or(self, |k| &self.coarser[k]);
        // At least half a pixel wide, or it might fall between pixels.
        level.average(&beam.at_least(wide).widened(0.5 * PI / level.height as f64))
    }

    /// Weighted sum over the pixels inside a beam that is no narrower than they are.
    fn average(&self, beam: &Beam) -> [f32; 3] {
        let [x, y, z] = beam.direction();
        let (polar, azimuth) = (x.hypot(y).atan2(z), y.atan2(x));
        let [across, along] = beam.reach();
        let (height, last) = (self.height as f64, (self.height - 1) as f64);
        let row = |angle: f64| (angle / PI * height - 0.5).clamp(0.0, last);
        let (top, bottom) =
            (row(polar - along).floor() as usize, row(polar + along).ceil() as usize);
        let (mut sum, mut total) = ([0.0; 3], 0.0);
        for row in top..=bottom {
            let theta = PI * (row as f64 + 0.5) / height;
            // How far the beam reaches around the axis in this row.
            let sin = theta.sin().min(polar.sin());
            let half = if sin > 1.2 * across { (across / sin).asin() * 1.2 } else { PI };
            self.average_row(beam, row, [azimuth - half, azimuth + half], &mut sum, &mut total);
        }
        // The beam may miss the centres of all pixels.
        if total > 0.0 { sum.map(|c| (c / total) as f32) } else { self.color(beam.direction()) }
    }

    fn average_row(
        &self,
        beam: &Beam,
        row: usize,
        [from, to]: [f64; 2],
        sum: &mut [f64; 3],
        total: &mut f64,
    ) {
        let width = self.width as f64;
        let (sin, cos) = (PI * (row as f64 + 0.5) / self.height as f64).sin_cos();
        // Columns run against the azimuth.
        let column = |azimuth: f64| (0.5 - azimuth / TAU) * width - 0.5;
        let first = column(to).floor() as i64;
        let count = ((column(from).ceil() as i64) - first + 1).min(self.width as i64);
        let start = TAU * (0.5 - (first as f64 + 0.5) / width);
        // Columns are a rotation apart, which costs less than a sine and a cosine each.
        let (turn_sin, turn_cos) = (-TAU / width).sin_cos();
        let (mut y, mut x) = start.sin_cos();
        for k in first..first + count {
            let weight = sin * beam.weight([sin * x, sin * y, cos]);
            (x, y) = (x * turn_cos - y * turn_sin, x * turn_sin + y * turn_cos);
            if weight > 0.0 {
                *total += weight;
                let pixel =
                    self.pixels[row * self.width + k.rem_euclid(self.width as i64) as usize];
                for (sum, c) in sum.iter_mut().zip(pixel) {
                    *sum += weight * f64::from(c);
                }
            }
        }
    }
}

/// Largest colour, as the brightness of a scene.
const BRIGHTEST: f32 = 1e12;

/// Colours below 0 by no more than this part of the largest are what lossy compression and changes of primaries leave.
const SMALL: f32 = 0.01;

/// Rows of the coarsest picture of a pyramid.
const SMALLEST: usize = 8;

/// Longer beams are treated as this many times as long as they are wide.
const LONGEST_BEAM: f64 = 16.0;

/// Iterates over those of `many` equal intervals that overlap interval `k` of `few`, and by how much.
fn overlaps(k: usize, few: usize, many: usize) -> impl Iterator<Item = (usize, f64)> + Clone {
    let ratio = many as f64 / few as f64;
    let (from, to) = (k as f64 * ratio, (k + 1) as f64 * ratio);
    let last = (to.ceil() as usize).min(many);
    (from as usize..last)
        .map(move |j| (j, (to.min(j as f64 + 1.0) - from.max(j as f64)).max(0.0)))
        .filter(|(_, share)| *share > 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of an EXR are light itself, those of a PNG are sRGB.
    #[test]
    fn exact_exr_values_are_linear() {
        use crate::image::{Channel, Picture};
        let picture = |names: &[&str], value: f32| {
            let channel = |name: &&str| Channel {
                name: (*name).to_owned(),
                values: vec![value * f32::from(name.as_bytes()[0]); 8],
            };
            let channels = names.iter().map(channel).collect();
            let picture = Picture { width: 4, height: 2, channels };
            exr::encode(&picture, &exr::Attributes::new(), exr::Style::default()).unwrap()
        };
        let color = |bytes: &[u8]| Panorama::decode(bytes).unwrap().color([1.0, 0.0, 0.0]);
        assert_eq!(
            color(&picture(&["R", "G", "B"], 2.0)),
            [b'R', b'G', b'B'].map(|c| 2.0 * f32::from(c))
        );
        assert_eq!(color(&picture(&["Y"], 0.25)), [0.25 * f32::from(b'Y'); 3]);
        let fail = |bytes: &[u8]| Panorama::decode(bytes).unwrap_err().to_string();
        let said = fail(&picture(&["depth", "intensity"], 1.0));
        assert_eq!(said, "channels depth, intensity: R, G, B or Y are expected");
        let said = fail(&picture(&["R", "G", "B"], f32::NAN));
        assert!(said.starts_with("row 1, column 1: R, G, B = [NaN, NaN, NaN]"), "{said}");
        // Blender's layers, and lower case.
        let layers = ["ViewLayer.Combined.R", "ViewLayer.Combined.G", "ViewLayer.Combined.B"];
        let others = ["ViewLayer.Emit.R", "ViewLayer.Emit.G", "ViewLayer.Emit.B"];
        let v = f32::from(b'V');
        assert_eq!(color(&picture(&layers, 1.0)), [v; 3]);
        assert_eq!(color(&picture(&[layers, others].concat(), 1.0)), [v; 3]);
        assert_eq!(color(&picture(&["r", "g", "b"], 1.0)), [b'r', b'g', b'b'].map(f32::from));
        let unclear = ["A.R", "A.G", "A.B", "B.R", "B.G", "B.B"];
        assert!(fail(&picture(&unclear, 1.0)).contains(r#"layers ["A", "B"] have colours"#));
        assert!(fail(&picture(&["Y", "RY", "BY"], 1.0)).contains("R, G, B or Y are expected"));
        assert!(fail(&picture(&["Y"], 1e12)).contains("numbers in [0, 1e12]"));
        assert!(fail(&picture(&["Y"], -1.0)).contains("numbers in [0, 1e12]"));
        let whole = picture(&["Y"], 1.0);
        assert!(fail(&whole[..whole.len() - 9]).contains("damaged"));
        assert!(fail(b"\x89PNG\r\n\x1a\n garbage").starts_with("not a readable PNG"));
    }

    #[test]
    fn exact_small_negative_colors_are_dark() {
        let pixels = vec![[1.0, 0.5, -1.2e-7], [0.0; 3]];
        let sky = Panorama::new(2, 1, pixels).unwrap();
        assert_eq!(sky.pixels[0], [1.0, 0.5, 0.0]);
        assert_eq!(sky.warnings(), ["colours below 0 are taken for 0: 1 pixels"]);
        assert!(Panorama::new(2, 1, vec![[1.0, 0.5, -0.02], [0.0; 3]]).is_err());
    }

    /// Seen from inside, facing −x (azimuth 180°) is at the left and right edges, azimuth 90°
    /// is a quarter from the left.
    #[test]
    fn exact_panorama_orientation() {
        let mut picture = image::RgbImage::new(8, 4);
        picture.put_pixel(1, 1, image::Rgb([255, 0, 0]));
        picture.put_pixel(2, 1, image::Rgb([255, 0, 0]));
        let mut bytes = Vec::new();
        let mut cursor = std::io::Cursor::new(&mut bytes);
        picture.write_to(&mut cursor, image::ImageFormat::Png).unwrap();
        let sky = Panorama::decode(&bytes).unwrap();
        let up = 3f64.to_radians().sin();
        let red = |d: [f64; 3]| sky.color(d)[0];
        assert!(red([0.0, 0.9, 0.3 + up]) > 0.3);
        assert_eq!(red([0.0, -1.0, 0.3]), 0.0);
        assert_eq!(red([1.0, 0.0, 0.0]), 0.0);
        assert!(Panorama::decode(b"no picture").is_err());
    }

    /// The mean over the sphere of cos²θ is 1/3, of a linear function of the direction that at the
    /// centre of the beam; odd sizes too.
    #[test]
    fn exact_averages_of_smooth_skies() {
        let (width, height) = (77, 39);
        let direction = |k: usize| {
            let theta = PI * ((k / width) as f64 + 0.5) / height as f64;
            let phi = TAU * (0.5 - ((k % width) as f64 + 0.5) / width as f64);
            [theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()]
        };
        let of = |f: &dyn Fn([f64; 3]) -> [f64; 3]| {
            let pixels = (0..width * height).map(|k| f(direction(k)).map(|c| c as f32)).collect();
            Panorama { width, height, pixels, coarser: Vec::new(), warnings: Vec::new() }
                .with_pyramid()
        };
        let square = of(&|d| d.map(|x| x * x));
        let coarsest = square.coarser.last().unwrap();
        let area = |row| coarsest.row_sin(row);
        let rows: f64 = (0..coarsest.height).map(area).sum();
        let mean: f64 = (0..coarsest.width * coarsest.height)
            .map(|k| area(k / coarsest.width) * f64::from(coarsest.pixels[k][2]))
            .sum::<f64>()
            / (rows * coarsest.width as f64);
        assert!((mean - 1.0 / 3.0).abs() < 2e-3, "{mean}");
        let linear = of(&|d| d.map(|x| 2.0 + x));
        for n in [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [-0.6, -0.0, 0.8], [0.0, 0.06, -0.998]] {
            let beam = Beam::of_circle(n, 0.05);
            for (seen, x) in linear.mean_color(&beam).iter().zip(n) {
                assert!((f64::from(*seen) - 2.0 - x).abs() < 6e-3, "{n:?}: {seen}");
            }
        }
    }
}

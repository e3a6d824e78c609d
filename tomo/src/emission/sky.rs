//! The sky behind everything, as a function of direction.
//!
//! Directions are unit vectors with z along the spin axis and the observer at azimuth 0
//! unless the scene turns it.

use crate::scene::{Checker, Sky, Stars};
use kerrlight_geodesic::flow::dot;

/// A decoded equirectangular picture in linear colour.
#[derive(Debug, Clone)]
pub struct Panorama {
    width: usize,
    height: usize,
    /// Rows from the top (+z), linear R, G, B.
    pixels: Vec<[f32; 3]>,
}

/// Why a picture cannot be the sky.
#[derive(Debug, thiserror::Error)]
pub enum PanoramaError {
    /// The bytes are no picture that can be read.
    #[error("not a readable PNG, JPEG or HDR picture: {0}")]
    Decode(#[from] image::ImageError),
    /// The picture is empty or has a value that is no colour.
    #[error("{0}")]
    Content(&'static str),
}

impl Panorama {
    /// Decodes a PNG, JPEG or Radiance HDR picture; 8- and 16-bit colours are taken as sRGB.
    ///
    /// # Errors
    /// If the bytes are no such picture.
    pub fn decode(bytes: &[u8]) -> Result<Self, PanoramaError> {
        let picture = image::load_from_memory(bytes)?;
        let linear = matches!(
            picture,
            image::DynamicImage::ImageRgb32F(_) | image::DynamicImage::ImageRgba32F(_)
        );
        let picture = picture.into_rgb32f();
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        if width == 0 || height == 0 {
            return Err(PanoramaError::Content("the picture has no pixels"));
        }
        let decode = |c: f32| if linear { c } else { srgb_to_linear(c) };
        let pixels: Vec<[f32; 3]> = picture.pixels().map(|p| p.0.map(decode)).collect();
        if pixels.iter().flatten().any(|c| !c.is_finite() || *c < 0.0) {
            return Err(PanoramaError::Content("the picture has values that are no colours"));
        }
        Ok(Panorama { width, height, pixels })
    }

    /// Bilinear look-up; azimuth wraps around.
    fn look(&self, direction: [f64; 3]) -> [f32; 3] {
        use core::f64::consts::{PI, TAU};
        let [x, y, z] = direction;
        // Seen from inside with +z up, azimuth grows to the left.
        let u = 0.5 - y.atan2(x) / TAU;
        let v = x.hypot(y).atan2(z) / PI;
        let fx = u * self.width as f64 - 0.5;
        let fy = (v * self.height as f64 - 0.5).clamp(0.0, (self.height - 1) as f64);
        let (cx, cy) = (fx.floor(), fy.floor());
        let (tx, ty) = ((fx - cx) as f32, (fy - cy) as f32);
        let column = |k: f64| k.rem_euclid(self.width as f64) as usize % self.width;
        let (x0, x1) = (column(cx), column(cx + 1.0));
        let (y0, y1) = (cy as usize, (cy as usize + 1).min(self.height - 1));
        let at = |x: usize, y: usize| self.pixels[y * self.width + x];
        let (a, b, c, d) = (at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1));
        core::array::from_fn(|k| {
            (1.0 - ty) * ((1.0 - tx) * a[k] + tx * b[k]) + ty * ((1.0 - tx) * c[k] + tx * d[k])
        })
    }
}

pub(super) fn srgb_to_linear(c: f32) -> f32 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// A sky ready to be looked at.
#[derive(Debug, Clone)]
pub enum SkyModel {
    /// A checkered sphere.
    Checker(Checker),
    /// Stars in cells of equal area.
    Stars(StarField),
    /// A picture and its brightness.
    Picture(Panorama, f32),
}

impl SkyModel {
    /// The sky of a scene; `picture` is the decoded file of a `[sky.image]`.
    pub fn new(sky: &Sky, picture: Option<Panorama>) -> Option<Self> {
        match sky {
            Sky::Checker(checker) => Some(SkyModel::Checker(checker.clone())),
            Sky::Stars(stars) => Some(SkyModel::Stars(StarField::new(stars))),
            Sky::Image(image) => {
                picture.map(|picture| SkyModel::Picture(picture, image.brightness as f32))
            }
        }
    }

    /// Linear colour in a direction.
    pub fn look(&self, direction: [f64; 3]) -> [f32; 3] {
        match self {
            SkyModel::Checker(checker) => look_checker(checker, direction),
            SkyModel::Stars(stars) => stars.look(direction),
            SkyModel::Picture(picture, brightness) => {
                picture.look(direction).map(|c| c * brightness)
            }
        }
    }
}

/// Light and dark fields; a colour for each quadrant of azimuth, paler below the equator.
fn look_checker(checker: &Checker, [x, y, z]: [f64; 3]) -> [f32; 3] {
    let azimuth = y.atan2(x).to_degrees().rem_euclid(360.0);
    let polar = x.hypot(y).atan2(z).to_degrees();
    let field = |angle: f64| (angle / checker.field_deg).floor() as i64;
    let light = (field(azimuth) + field(polar)).rem_euclid(2) == 0;
    let colors = [[0.9, 0.25, 0.2], [0.95, 0.75, 0.15], [0.2, 0.65, 0.35], [0.2, 0.4, 0.9]];
    let color: [f32; 3] = colors[((azimuth / 90.0) as usize).min(3)];
    let factor = if light { 1.0 } else { 0.12 } * checker.brightness as f32;
    let pale = if polar > 90.0 { 0.35 } else { 0.0 };
    color.map(|c| (c + (1.0 - c) * pale) * factor)
}

/// Stars strewn over cells of equal area: rings of constant width in z, each cut into as
/// many cells. A cell holds at most one star, whose place, colour and brightness are a
/// hash of its number.
#[derive(Debug, Clone)]
pub struct StarField {
    rings: i64,
    sectors: i64,
    probability: f64,
    cos_radius: f64,
    radius: f64,
    brightness: f64,
    seed: u64,
}

impl StarField {
    fn new(stars: &Stars) -> Self {
        // Half the cells hold a star.
        let cells = 2.0 * f64::from(stars.count);
        let rings = (cells / core::f64::consts::PI).sqrt().ceil().max(2.0);
        let sectors = (cells / rings).ceil().max(4.0);
        let radius = stars.radius_deg.to_radians();
        StarField {
            rings: rings as i64,
            sectors: sectors as i64,
            probability: f64::from(stars.count) / (rings * sectors),
            cos_radius: radius.cos(),
            radius,
            brightness: stars.brightness,
            seed: stars.seed,
        }
    }

    fn look(&self, direction: [f64; 3]) -> [f32; 3] {
        use core::f64::consts::TAU;
        let [x, y, z] = direction;
        let ring_at =
            |z: f64| ((0.5 * (z + 1.0) * self.rings as f64) as i64).clamp(0, self.rings - 1);
        let polar = x.hypot(y).atan2(z);
        let (lowest, highest) = (
            ring_at((polar + self.radius).min(core::f64::consts::PI).cos()),
            ring_at((polar - self.radius).max(0.0).cos()),
        );
        let azimuth = y.atan2(x).rem_euclid(TAU) / TAU;
        // A star's disc spans this much azimuth; all of it next to a pole.
        let sin = (polar - self.radius).max(0.0).sin().min((polar + self.radius).sin());
        let reach = if sin > self.radius.sin() { self.radius.sin() / sin } else { 4.0 };
        let width = self.sectors as f64;
        let from = ((azimuth - reach / TAU * 1.6) * width).floor() as i64;
        let to = ((azimuth + reach / TAU * 1.6) * width).floor() as i64;
        let to = to.min(from + self.sectors - 1);
        let mut color = [0.0; 3];
        for ring in lowest..=highest {
            for sector in from..=to {
                self.add_star(ring, sector.rem_euclid(self.sectors), direction, &mut color);
            }
        }
        color
    }

    fn add_star(&self, ring: i64, sector: i64, direction: [f64; 3], color: &mut [f32; 3]) {
        let mut random = Hash(self.seed ^ (ring * self.sectors + sector) as u64);
        if random.unit() > self.probability {
            return;
        }
        let z = 2.0 * (ring as f64 + random.unit()) / self.rings as f64 - 1.0;
        let angle = core::f64::consts::TAU * (sector as f64 + random.unit()) / self.sectors as f64;
        let sin = (1.0 - z * z).max(0.0).sqrt();
        let cos_distance = dot(direction, [sin * angle.cos(), sin * angle.sin(), z]);
        if cos_distance < self.cos_radius {
            return;
        }
        // Counts of stars fall with brightness as for a uniform Euclidean population.
        let luminosity = self.brightness * 0.05 * (random.unit() + 1e-3).powf(-2.0 / 3.0);
        let warmth = random.unit();
        let edge = (1.0 - cos_distance) / (1.0 - self.cos_radius);
        let value = luminosity * (1.0 - edge).powi(2);
        let tint = [0.7 + 0.3 * warmth, 0.85, 1.0 - 0.45 * warmth];
        for (channel, tint) in color.iter_mut().zip(tint) {
            *channel += (value * tint) as f32;
        }
    }
}

/// A sequence of numbers hashed from a counter (the finaliser of SplitMix64, Steele et al.
/// 2014): a star needs the same few numbers whichever ray asks for it.
struct Hash(u64);

impl Hash {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        (z >> 11) as f64 / (1u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checker() -> Checker {
        Checker { field_deg: 15.0, brightness: 1.0 }
    }

    #[test]
    fn exact_poles_and_axes_have_colours() {
        let stars = Stars { count: 2000, radius_deg: 0.5, brightness: 1.0, seed: 7 };
        let skies = [SkyModel::Checker(checker()), SkyModel::Stars(StarField::new(&stars))];
        for sky in &skies {
            for d in [
                [0.0, 0.0, 1.0],
                [0.0, 0.0, -1.0],
                [1.0, 0.0, 0.0],
                [-1.0, 0.0, 0.0],
                [-1.0, -0.0, 0.0],
            ] {
                assert!(sky.look(d).iter().all(|c| c.is_finite() && *c >= 0.0), "{d:?}");
            }
        }
    }

    /// As many stars as asked for, evenly over the sphere: the share of the sphere that is
    /// lit is count (1 − cos radius)/2 but for overlaps.
    #[test]
    fn exact_star_count_by_lit_area() {
        let config = Stars { count: 3000, radius_deg: 0.5, brightness: 1.0, seed: 3 };
        let sky = StarField::new(&config);
        let mut random = Hash(99);
        let (n, mut lit) = (200_000, [0.0f64; 2]);
        for _ in 0..n {
            let (z, phi) = (2.0 * random.unit() - 1.0, std::f64::consts::TAU * random.unit());
            let s = (1.0f64 - z * z).sqrt();
            let half = usize::from(z > 0.0);
            lit[half] += f64::from(u8::from(sky.look([s * phi.cos(), s * phi.sin(), z])[1] > 0.0));
        }
        let expected = 3000.0 * 0.5 * (1.0 - 0.5f64.to_radians().cos());
        let found = (lit[0] + lit[1]) / f64::from(n);
        assert!((found / expected - 1.0).abs() < 0.05, "{found} {expected}");
        assert!((lit[0] / lit[1] - 1.0).abs() < 0.1, "{lit:?}");
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
        let red = |d: [f64; 3]| sky.look(d)[0];
        assert!(red([0.0, 0.9, 0.3 + up]) > 0.3);
        assert_eq!(red([0.0, -1.0, 0.3]), 0.0);
        assert_eq!(red([1.0, 0.0, 0.0]), 0.0);
        assert!(Panorama::decode(b"no picture").is_err());
    }
}

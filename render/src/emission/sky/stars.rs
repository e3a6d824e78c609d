//! Random stars.

use super::beam::Beam;
use super::cells::Cells;
use crate::scene::Stars;
use kerrlight_geodesic::vector::dot;

/// Stars strewn over cells of equal area: rings of constant width in z, each cut into as
/// many cells. A cell holds at most one star, whose place, colour and brightness are a
/// hash of its number.
#[derive(Debug, Clone)]
pub struct StarField {
    cells: Cells,
    probability: f64,
    radius: f64,
    /// 1 − cos of it.
    versine: f64,
    brightness: f64,
    seed: u64,
}

impl StarField {
    pub(super) fn new(stars: &Stars) -> Self {
        // Half the cells hold a star.
        let cells = Cells::about(2.0 * f64::from(stars.count));
        let radius = stars.radius_deg.to_radians();
        StarField {
            cells,
            probability: f64::from(stars.count) / cells.count() as f64,
            radius,
            versine: 2.0 * (0.5 * radius).sin().powi(2),
            brightness: stars.brightness,
            seed: stars.seed,
        }
    }

    pub(super) fn color(&self, direction: [f64; 3]) -> [f32; 3] {
        let mut color = [0.0; 3];
        self.near(direction, [self.radius; 2], |star| {
            // Half of the squared chord: 1 less a cosine has no digits for tiny stars.
            let chord = [0, 1, 2].map(|k| direction[k] - star.direction[k]);
            let edge = 0.5 * dot(chord, chord) / self.versine;
            if edge <= 1.0 {
                star.shine((1.0 - edge).powi(2), &mut color);
            }
        });
        color
    }

    /// Mean brightness over a beam. A star is taken for a Gaussian with the flux,
    /// 2π(1 − cos R)/3 times its peak, and the variance, R²/8, of its disc.
    pub(super) fn mean_color(&self, beam: &Beam) -> [f32; 3] {
        let beam = beam.widened(self.radius / 8f64.sqrt());
        let flux = core::f64::consts::TAU * self.versine / 3.0;
        let peak = flux * beam.peak_density();
        let mut color = [0.0; 3];
        self.near(beam.direction(), beam.reach(), |star| {
            let weight = beam.weight(star.direction);
            if weight > 0.0 {
                star.shine(peak * weight, &mut color);
            }
        });
        color
    }

    /// All stars within `across` and `along` the meridian of a direction, and some more.
    fn near(&self, direction: [f64; 3], [across, along]: [f64; 2], mut see: impl FnMut(&Star)) {
        self.cells.near(direction, [across, along], |ring, sector| {
            if let Some(star) = self.star(ring, sector) {
                see(&star);
            }
        });
    }

    /// The star of a cell, if it holds one.
    fn star(&self, ring: i64, sector: i64) -> Option<Star> {
        let mut random = Hash(self.seed ^ (ring * self.cells.sectors + sector) as u64);
        if random.unit() > self.probability {
            return None;
        }
        let z = 2.0 * (ring as f64 + random.unit()) / self.cells.rings as f64 - 1.0;
        let angle =
            core::f64::consts::TAU * (sector as f64 + random.unit()) / self.cells.sectors as f64;
        let sin = (1.0 - z * z).max(0.0).sqrt();
        let direction = [sin * angle.cos(), sin * angle.sin(), z];
        Some(Star { direction, brightness: self.brightness, random })
    }

    /// Directions and fluxes (peak brightness times solid angle, of the green channel) of all
    /// stars.
    pub fn catalogue(&self) -> Vec<([f64; 3], f64)> {
        let flux = core::f64::consts::TAU * self.versine / 3.0;
        let Cells { rings, sectors } = self.cells;
        let cells = (0..rings).flat_map(|ring| (0..sectors).map(move |k| (ring, k)));
        let stars = cells.filter_map(|(ring, sector)| self.star(ring, sector));
        let seen = stars.map(|star| {
            let mut color = [0.0; 3];
            star.shine(1.0, &mut color);
            (star.direction, flux * f64::from(color[1]))
        });
        seen.collect()
    }
}

/// A star, whose light is a hash that is worked out when it is seen.
struct Star {
    direction: [f64; 3],
    brightness: f64,
    random: Hash,
}

impl Star {
    /// Adds its light, `part` of its peak brightness.
    fn shine(&self, part: f64, color: &mut [f32; 3]) {
        // Of a copy, so that every ray draws the same numbers.
        let mut random = Hash(self.random.0);
        // Counts of stars fall with brightness as for a uniform Euclidean population.
        // 1e-3 keeps the brightest at a hundred times the faintest.
        let luminosity = self.brightness * 0.05 * (random.unit() + 1e-3).powf(-2.0 / 3.0);
        let warmth = random.unit();
        let tint = [0.7 + 0.3 * warmth, 0.85, 1.0 - 0.45 * warmth];
        for (channel, tint) in color.iter_mut().zip(tint) {
            *channel += (luminosity * part * tint) as f32;
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

    /// The requested number of stars, evenly over the sphere: the share of the sphere that is
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
            lit[half] += f64::from(u8::from(sky.color([s * phi.cos(), s * phi.sin(), z])[1] > 0.0));
        }
        let expected = 3000.0 * 0.5 * (1.0 - 0.5f64.to_radians().cos());
        let found = (lit[0] + lit[1]) / f64::from(n);
        assert!((found / expected - 1.0).abs() < 0.05, "{found} {expected}");
        assert!((lit[0] / lit[1] - 1.0).abs() < 0.1, "{lit:?}");
    }

    /// Tiny stars have the flux of a small disc, and shine at their place.
    #[test]
    fn exact_tiny_stars_keep_their_light() {
        for radius_deg in [1e-2, 1e-5, 1e-7, 1e-9] {
            let field = StarField::new(&Stars { count: 30, radius_deg, brightness: 1.0, seed: 5 });
            let area = std::f64::consts::PI * radius_deg.to_radians().powi(2) / 3.0;
            for (direction, flux) in field.catalogue() {
                let peak = f64::from(field.color(direction)[1]);
                assert!((flux / (area * peak) - 1.0).abs() < 1e-6, "{radius_deg}: {flux} {peak}");
            }
        }
    }

    /// Beams that lie side by side mean_color all light of all stars: the sum over a fine net of
    /// directions is the catalogue's, here on a patch and at a pole.
    #[test]
    fn exact_flux_of_gathered_stars() {
        let config = Stars { count: 3000, radius_deg: 0.01, brightness: 1.0, seed: 5 };
        let field = StarField::new(&config);
        for (pole, turned) in [(false, [1.0, 0.0, 0.0]), (true, [0.0, 0.0, 1.0])] {
            let step = 0.004;
            let mut sum = 0.0;
            for (i, j) in (-200..200).flat_map(|i| (-200..200).map(move |j| (i, j))) {
                let (u, v) = (step * f64::from(i), step * f64::from(j));
                let n = if pole { [u, v, 1.0] } else { [1.0, u, v] };
                let length = dot(n, n).sqrt();
                // Solid angle of a field of this plane; the beam is that of a field, too.
                let area = step * step / length.powi(3);
                let beam = Beam::of_circle(n.map(|c| c / length), 0.65 * step);
                sum += area * f64::from(field.mean_color(&beam)[1]);
            }
            let inside = |d: [f64; 3]| {
                let depth = dot(d, turned);
                let side = d.iter().zip(turned).map(|(d, t)| (d - depth * t).abs() / depth);
                depth > 0.0 && side.fold(0.0, f64::max) < 200.0 * step
            };
            let stars = field.catalogue();
            let expected: f64 = stars.iter().filter(|s| inside(s.0)).map(|s| s.1).sum();
            assert!((sum / expected - 1.0).abs() < 0.01, "{sum} {expected}");
        }
    }
}

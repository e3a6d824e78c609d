//! More rays for the pixels that the photon ring passes through.
//!
//! Subrings are narrower than pixels and as bright as what they are images of (Gralla, Holz & Wald 2019): a single ray
//! in the middle of a pixel meets one or misses it. The mean over several rays is the pixel's flux, and changes
//! smoothly with the geometry.

use kerrlight_geodesic::analytic::CriticalCurve;
use kerrlight_geodesic::{Kerr, Observer};

/// Rays of pixels near the critical curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RingRays {
    /// Rays of each of them.
    pub count: usize,
    /// Width of a pixel on the screen, M.
    pub spacing: f64,
    /// Number of their lattice, 0 for the usual one.
    pub lattice: u64,
}

/// Rays of all pixels, pixel after pixel.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::fit) struct PixelRays {
    /// Places on the screen, M to the right and upwards.
    pub places: Vec<[f64; 2]>,
    /// Pixel k has the rays `starts[k]..starts[k + 1]`.
    pub starts: Vec<usize>,
}

/// Half the diagonal of a pixel of width 1.
const HALF_DIAGONAL: f64 = core::f64::consts::FRAC_1_SQRT_2;
/// Largest distance of the critical curve from the pixel, M: the second image lies within that.
const BEYOND: f64 = 0.3;
/// Points of the critical curve.
const POINTS: u32 = 256;
/// Distance of neighbours in the sequence k φ mod 1, which is the most even one: the golden ratio less 1.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

impl PixelRays {
    /// One ray in the middle of each pixel.
    pub fn single(x: &[f64], y: &[f64]) -> Self {
        let places = x.iter().zip(y).map(|(x, y)| [*x, *y]).collect();
        Self { places, starts: (0..=x.len()).collect() }
    }

    /// `ring.count` rays for each pixel near the critical curve, one for the others; `screen` gives (α, β) in M of a
    /// place on the screen.
    pub fn new(
        ring: RingRays,
        hole: &Kerr,
        observer: &Observer,
        [x, y]: [&[f64]; 2],
        screen: impl Fn([f64; 2]) -> [f64; 2],
    ) -> Self {
        // The critical curve is known in (α, β): distances are taken there.
        let width = distance(screen([0.0, 0.0]), screen([ring.spacing, 0.0]));
        let places: Vec<[f64; 2]> = x.iter().zip(y).map(|(x, y)| screen([*x, *y])).collect();
        let near = near_the_ring(hole, observer, &places, HALF_DIAGONAL * width + BEYOND);
        let (mut all, several) = (Self { places: Vec::new(), starts: vec![0] }, ring.places());
        for ((x, y), near) in x.iter().zip(y).zip(near) {
            if near {
                let at = |[u, v]: &[f64; 2]| [x + u * ring.spacing, y + v * ring.spacing];
                all.places.extend(several.iter().map(at));
            } else {
                all.places.push([*x, *y]);
            }
            all.starts.push(all.places.len());
        }
        all
    }

    /// Puts a ray in the middle of each of n × n parts of the pixels (M wide) that have one ray.
    pub fn divided(self, spacing: f64, n: usize) -> Self {
        let place = |k: usize| ((k as f64 + 0.5) / n as f64 - 0.5) * spacing;
        let mut all = Self { places: Vec::new(), starts: vec![0] };
        for range in self.starts.windows(2) {
            match self.places[range[0]..range[1]] {
                [[x, y]] => {
                    let parts = (0..n * n).map(|k| [x + place(k / n), y + place(k % n)]);
                    all.places.extend(parts);
                }
                ref several => all.places.extend_from_slice(several),
            }
            all.starts.push(all.places.len());
        }
        all
    }

    /// The pixel of a ray.
    pub fn pixel_of(&self, ray: usize) -> usize {
        self.starts.partition_point(|start| *start <= ray) - 1
    }

    /// Returns the weight of a ray in its pixel.
    pub fn share(&self, pixel: usize) -> f64 {
        1.0 / (self.starts[pixel + 1] - self.starts[pixel]) as f64
    }
}

/// Returns the places on the screen that are nearer to the critical curve than a limit, M.
pub(in crate::fit) fn near_the_ring(
    hole: &Kerr,
    observer: &Observer,
    places: &[[f64; 2]],
    limit: f64,
) -> Vec<bool> {
    let curve = CriticalCurve::new(hole, observer.inclination()).points(POINTS);
    let curve: Vec<[f64; 2]> = curve.map(|point| [point.alpha, point.beta]).collect();
    // Neighbours on the curve are about 0.13 M apart, which changes distances of 0.3 M and more by
    // less than 0.01 M.
    let is_near = |place: &[f64; 2]| curve.iter().any(|point| distance(*point, *place) < limit);
    places.iter().map(is_near).collect()
}

impl RingRays {
    /// Places spread over a pixel of width 1 about 0, such that none are behind each other from any side. Their mean is 0, so
    /// that sums over them are exact for light that is linear across the pixel.
    fn places(&self) -> Vec<[f64; 2]> {
        // Of all hundredths one that interleaves the rows and columns of six lattices of 8, 12 and 16 rays best.
        const SHIFT: f64 = 0.87;
        let (count, shift) = (self.count as f64, ((self.lattice / 4) as f64 * SHIFT).fract());
        // A golden-ratio lattice on a torus: shifted and wrapped round, it stays as even.
        let rows = (0..self.count).map(|k| (k as f64 * GOLDEN + 0.5 + shift).fract());
        let middle = rows.clone().sum::<f64>() / count;
        let columns = (0..self.count).map(|k| (k as f64 + 0.5) / count - 0.5);
        // About a mean of 0 a shift moves few places: four lattices of each are mirror images.
        let (is_mirrored, is_turned) = (self.lattice / 2 % 2 == 1, self.lattice % 2 == 1);
        let place = |(u, v): (f64, f64)| {
            let v = if is_mirrored { middle - v } else { v - middle };
            if is_turned { [v, u] } else { [u, v] }
        };
        columns.zip(rows).map(place).collect()
    }
}

fn distance([a, b]: [f64; 2], [c, d]: [f64; 2]) -> f64 {
    (a - c).hypot(b - d)
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_geodesic::Inclination;

    fn rays(count: usize) -> PixelRays {
        let hole = Kerr::new(0.0).unwrap();
        let observer = Observer::at_infinity(Inclination::from_degrees(60.0).unwrap());
        // The critical curve is a circle of 3√3 = 5.196.
        let (x, y) = ([5.3, 0.0, 8.0, -3.6], [0.0, 0.0, 0.0, 3.6]);
        PixelRays::new(
            RingRays { count, spacing: 0.5, lattice: 0 },
            &hole,
            &observer,
            [&x, &y],
            |place| place,
        )
    }

    #[test]
    fn exact_pixels_of_the_ring_have_more_rays() {
        let rays = rays(8);
        assert_eq!(rays.starts, [0, 8, 9, 10, 18]);
        assert_eq!([0, 7, 8, 9, 17].map(|ray| rays.pixel_of(ray)), [0, 0, 1, 2, 3]);
        assert_eq!([0, 1, 3].map(|pixel| rays.share(pixel)), [0.125, 1.0, 0.125]);
        assert_eq!((rays.places[8], rays.places[9]), ([0.0, 0.0], [8.0, 0.0]));
        // The mean of the places is that of the pixel, so that some lie a little beyond it.
        let inside = |place: &[f64; 2]| (place[0] - 5.3).abs() < 0.28 && place[1].abs() < 0.28;
        assert!(rays.places[..8].iter().all(inside));
    }

    #[test]
    fn exact_divided_pixels_are_those_with_one_ray() {
        let rays = rays(8).divided(0.5, 2);
        assert_eq!(rays.starts, [0, 8, 12, 16, 24]);
        assert_eq!(rays.places[8..12], [[-0.125; 2], [-0.125, 0.125], [0.125, -0.125], [0.125; 2]]);
    }

    /// No line through the pixel meets more than a few of the places: seen along any direction they are spread.
    #[test]
    fn exact_lattices_are_spread_from_all_sides() {
        let count = 13;
        let ring = RingRays { count, spacing: 1.0, lattice: 3 };
        for turn in 0..90 {
            let (sin, cos) = (f64::from(turn) * 0.035).sin_cos();
            let mut seen: Vec<f64> = ring.places().iter().map(|[u, v]| u * cos + v * sin).collect();
            seen.sort_by(f64::total_cmp);
            let widest = seen.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0f64, f64::max);
            assert!(widest < 0.35, "{turn}: {widest}");
            let mean = seen.iter().sum::<f64>() / count as f64;
            assert!(mean.abs() < 1e-12, "{turn}: {mean}");
        }
    }

    /// Columns and rows of several lattices interleave, whatever the number of rays.
    #[test]
    fn exact_lattices_have_columns_of_their_own() {
        let of = |count, lattice| RingRays { count, spacing: 1.0, lattice }.places();
        for count in 2..32 {
            for (a, b) in (0..6).flat_map(|b| (0..b).map(move |a| (a, b))) {
                let there = of(count, b);
                let is_there =
                    |place: &[f64; 2]| there.iter().any(|other| distance(*place, *other) < 1e-9);
                assert!(!of(count, a).iter().all(is_there), "{count} rays, {a} and {b}");
            }
        }
        for count in [8, 12, 16] {
            let of = |lattice| of(count, lattice);
            let all: Vec<[f64; 2]> = (0..6).flat_map(of).collect();
            for c in [0, 1] {
                let mut seen: Vec<f64> = all.iter().map(|place| place[c]).collect();
                seen.sort_by(f64::total_cmp);
                let widest = seen.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0f64, f64::max);
                assert!(widest < 0.8 / count as f64, "{count} rays, {c}: {widest}");
            }
        }
    }
}

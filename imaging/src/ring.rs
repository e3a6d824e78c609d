//! A ring in an image, as the EHT Collaboration (2019, ApJL 875, L4, section 9.1) measures it.

use crate::settings::RingSettings;
use core::f64::consts::{PI, TAU};
use kerrlight_common::units::MICROARCSECOND;
use kerrlight_vlbi::operator::ImageGrid;

/// Numbers of a ring. Angles on the sky in µas, position angles in degrees east of north.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ring {
    /// Its centre, to the east and to the north of the middle of the field: where distances of the brightest points vary
    /// least, as a part of their mean.
    pub centre_uas: [f64; 2],
    /// Twice the mean distance of the brightest point from the centre, over all directions.
    pub diameter_uas: f64,
    /// Twice the standard deviation of that distance.
    pub diameter_scatter_uas: f64,
    /// Mean full width at half maximum of the profile, above the brightness at the largest radius.
    pub width_uas: f64,
    /// Direction in which it is brightest: of the first moment along the ring.
    pub position_angle_deg: f64,
    /// Modulus of that moment over the light: 0 for an even ring, 1 for a point.
    pub asymmetry: f64,
    /// Mean brightness at the centre over that at the ring's radius.
    pub central_brightness: f64,
    /// Part of the directions in which the ring is twice as bright as the centre, and a twentieth as bright as where it is
    /// brightest.
    pub coverage: f64,
}

/// Directions.
const DIRECTIONS: usize = 120;
/// Samples a pixel along a direction.
const SAMPLES: f64 = 6.0;
/// Part of the directions whose brightest point may lie at a limit of the radii: there is no ring with more.
const MOST_AT_LIMITS: f64 = 0.1;
/// Mean brightness at the centre over that of the ring: what is brighter inside is a disc.
pub const MOST_CENTRAL: f64 = 0.5;
/// Part of the directions that a ring has light in: two knots have gaps between them, a crescent one.
const LEAST_COVERAGE: f64 = 0.7;
/// Brightness over that of the centre, and over that of the brightest direction, from which on a direction has light.
const ABOVE_CENTRE: f64 = 2.0;
const ABOVE_BRIGHTEST: f64 = 0.05;
/// Radius of what counts as the centre, µas (the published 5 µas).
const CENTRE: f64 = 5.0;

/// An image that is linear between the centres of its pixels, as pixels that are pyramids make it.
struct Sky<'a> {
    pixels: &'a [f64],
    grid: ImageGrid,
    radii: Vec<f64>,
}

impl Ring {
    /// The ring of an image: it encloses the centroid of the light. None where fewer than nine directions in ten have their
    /// brightest point between the radii, whatever the centre, where it is filled, and where it has gaps.
    pub fn measure(pixels: &[f64], grid: ImageGrid, settings: &RingSettings) -> Option<Self> {
        let pixel = grid.pixel_rad / MICROARCSECOND;
        let (least, most) = (settings.least_radius_uas, settings.most_radius_uas);
        let count = ((most - least) / pixel * SAMPLES).ceil().max(2.0) as usize;
        let radius = |k: usize| least + (most - least) * k as f64 / count as f64;
        let sky = Sky { pixels, grid, radii: (0..=count).map(radius).collect() };
        let centre = sky.centre(pixel, most)?;
        let peaks = sky.peaks(centre)?;
        let mean = peaks.iter().sum::<f64>() / peaks.len() as f64;
        let square: f64 = peaks.iter().map(|r| (r - mean).powi(2)).sum();
        let scatter = (square / peaks.len() as f64).sqrt();
        let width_uas = sky.width(centre, most);
        let [position_angle_deg, asymmetry] = sky.moment(centre, [mean, width_uas]);
        let central = sky.within(centre, CENTRE);
        let coverage = sky.coverage(centre, central);
        let central_brightness = central / sky.around(centre, mean);
        // Negated, so that a quotient that is no number makes no ring.
        if !(central_brightness <= MOST_CENTRAL && coverage >= LEAST_COVERAGE) {
            return None;
        }
        Some(Ring {
            centre_uas: centre,
            diameter_uas: 2.0 * mean,
            diameter_scatter_uas: 2.0 * scatter,
            width_uas,
            position_angle_deg,
            asymmetry,
            central_brightness,
            coverage,
        })
    }
}

/// Angles east of north.
fn directions() -> impl Iterator<Item = f64> {
    (0..DIRECTIONS).map(|k| TAU * k as f64 / DIRECTIONS as f64)
}

impl Sky<'_> {
    /// Brightness at a place to the east and north of the middle, µas; 0 beyond the outermost pixels.
    fn at(&self, [east, north]: [f64; 2]) -> f64 {
        let pixel = self.grid.pixel_rad / MICROARCSECOND;
        let middle = |n: usize| 0.5 * (n as f64 - 1.0);
        let column = middle(self.grid.width) - east / pixel;
        let row = middle(self.grid.height) - north / pixel;
        let value = |row: f64, column: f64| {
            let inside = |x: f64, n: usize| x >= 0.0 && x < n as f64;
            if inside(row, self.grid.height) && inside(column, self.grid.width) {
                self.pixels[row as usize * self.grid.width + column as usize]
            } else {
                0.0
            }
        };
        let (i, j) = (row.floor(), column.floor());
        let (a, b) = (row - i, column - j);
        let along = |i: f64| value(i, j) * (1.0 - b) + value(i, j + 1.0) * b;
        along(i) * (1.0 - a) + along(i + 1.0) * a
    }

    fn on(&self, [east, north]: [f64; 2], angle: f64, radius: f64) -> f64 {
        self.at([east + radius * angle.sin(), north + radius * angle.cos()])
    }

    /// Distances of the brightest points of all directions that have one between the radii; none if too few have.
    fn peaks(&self, centre: [f64; 2]) -> Option<Vec<f64>> {
        let last = self.radii.len() - 1;
        let brightest = |angle: f64| {
            let light = self.radii.iter().map(|r| self.on(centre, angle, *r)).enumerate();
            let (k, _) = light.max_by(|(_, a), (_, b)| a.total_cmp(b))?;
            // At a limit the profile still rises beyond it: no peak.
            (k > 0 && k < last).then(|| self.radii[k])
        };
        let peaks: Vec<f64> = directions().filter_map(brightest).collect();
        let missing = (DIRECTIONS - peaks.len()) as f64;
        (missing <= MOST_AT_LIMITS * DIRECTIONS as f64).then_some(peaks)
    }

    /// Part of the directions whose brightest point between the radii is well above the centre and not far below the brightest.
    fn coverage(&self, centre: [f64; 2], central: f64) -> f64 {
        let most =
            |angle: f64| self.radii.iter().map(|r| self.on(centre, angle, *r)).fold(0.0, f64::max);
        let light: Vec<f64> = directions().map(most).collect();
        let brightest = light.iter().copied().fold(0.0, f64::max);
        let enough = (ABOVE_CENTRE * central).max(ABOVE_BRIGHTEST * brightest);
        light.iter().filter(|light| **light >= enough).count() as f64 / DIRECTIONS as f64
    }

    /// Relative scatter of the distances about a centre.
    ///
    /// None where the middle of the light lies outside: a dark place beside a bright one has light all around as well.
    fn scatter(&self, centre: [f64; 2], middle: [f64; 2]) -> Option<f64> {
        let peaks = self.peaks(centre)?;
        let mean = peaks.iter().sum::<f64>() / peaks.len() as f64;
        if (centre[0] - middle[0]).hypot(centre[1] - middle[1]) >= mean {
            return None;
        }
        let square: f64 = peaks.iter().map(|r| (r - mean).powi(2)).sum();
        // Directions without a ring count as scattered by all of their distance.
        let missing = (DIRECTIONS - peaks.len()) as f64;
        Some((square / (mean * mean) + missing) / DIRECTIONS as f64)
    }

    /// Returns the place from which distances scatter least: on a grid about the centroid of the light, which is then refined.
    fn centre(&self, pixel: f64, most: f64) -> Option<[f64; 2]> {
        let middle = self.centroid();
        let mut centre = middle;
        let mut step = (0.1 * most).max(pixel);
        let mut reach = (0.5 * most / step).ceil() as i32;
        let mut found = None;
        for _ in 0..8 {
            let offsets = || (-reach..=reach).map(|k| f64::from(k) * step);
            let places = offsets()
                .flat_map(|x| offsets().map(move |y| [x, y]))
                .map(|[x, y]| [centre[0] + x, centre[1] + y]);
            let scores = places.filter_map(|place| Some((place, self.scatter(place, middle)?)));
            found = scores.min_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(place, _)| place);
            centre = found?;
            // Two halved steps reach the neighbours, between which the minimum is.
            (step, reach) = (0.5 * step, 2);
        }
        found
    }

    fn centroid(&self) -> [f64; 2] {
        let mut sums = [0.0; 3];
        for (k, light) in self.pixels.iter().enumerate() {
            let (row, column) = (k / self.grid.width, k % self.grid.width);
            sums[0] += light * self.grid.east(column) / MICROARCSECOND;
            sums[1] += light * self.grid.north(row) / MICROARCSECOND;
            sums[2] += light;
        }
        [sums[0] / sums[2], sums[1] / sums[2]]
    }

    /// Mean brightness of a circle.
    fn around(&self, centre: [f64; 2], radius: f64) -> f64 {
        directions().map(|angle| self.on(centre, angle, radius)).sum::<f64>() / DIRECTIONS as f64
    }

    /// Mean brightness of a disc.
    fn within(&self, centre: [f64; 2], radius: f64) -> f64 {
        // Equal areas between the circles.
        let circle = |k: usize| radius * ((k as f64 + 0.5) / 8.0).sqrt();
        (0..8).map(|k| self.around(centre, circle(k))).sum::<f64>() / 8.0
    }

    /// Mean full width at half maximum over directions, from the centre to twice the largest radius.
    fn width(&self, centre: [f64; 2], most: f64) -> f64 {
        let floor = self.around(centre, most);
        let step = self.radii[1] - self.radii[0];
        let last = (2.0 * most / step) as usize;
        let of = |angle: f64| {
            let light = |k: usize| self.on(centre, angle, step * k as f64) - floor;
            // The peak lies between the ring's radii; its flanks may reach beyond them.
            let inside = |k: &usize| {
                let r = step * *k as f64;
                r >= self.radii[0] && r <= most
            };
            let peak = (0..=last).filter(inside).max_by(|a, b| light(*a).total_cmp(&light(*b)));
            let peak = peak.unwrap_or(0);
            let half = 0.5 * light(peak);
            let inner = (0..peak).rev().find(|k| light(*k) < half).unwrap_or(0);
            let outer = (peak..=last).find(|k| light(*k) < half).unwrap_or(last);
            step * (outer - inner) as f64
        };
        directions().map(of).sum::<f64>() / DIRECTIONS as f64
    }

    /// Position angle (degrees east of north, 0 to 360) and size of the first moment, means over the ring's width.
    fn moment(&self, centre: [f64; 2], [radius, width]: [f64; 2]) -> [f64; 2] {
        const CIRCLES: usize = 11;
        let (mut east, mut north, mut size) = (0.0, 0.0, 0.0);
        for k in 0..CIRCLES {
            // A ring that is wider than its diameter has no innermost circles.
            let r = (radius + width * (k as f64 / (CIRCLES - 1) as f64 - 0.5)).max(0.0);
            let mut sums = [0.0; 3];
            for angle in directions() {
                let light = self.on(centre, angle, r);
                sums[0] += light * angle.sin();
                sums[1] += light * angle.cos();
                sums[2] += light;
            }
            let length = sums[0].hypot(sums[1]);
            if length > 0.0 && sums[2] > 0.0 {
                // The published mean is one of directions: every circle counts the same.
                east += sums[0] / length;
                north += sums[1] / length;
                size += length / sums[2];
            }
        }
        let angle = (east.atan2(north) * 180.0 / PI).rem_euclid(360.0);
        [angle, size / CIRCLES as f64]
    }
}

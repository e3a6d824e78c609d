//! Numbers of a polarised image, as the EHT Collaboration (2021, ApJL 910, L13) defines them; β₂ is that of Palumbo, Wong &
//! Prather (2020, ApJ 894, 156).

use crate::beam::blurred;
use kerrlight_common::units::MICROARCSECOND;
use kerrlight_vlbi::operator::ImageGrid;
use num_complex::Complex;

/// Numbers of the linear polarisation of an image. Position angles in degrees east of north.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearPolarization {
    /// |ΣP|/ΣI: the fraction that an array sees which does not resolve the source.
    pub net_fraction: f64,
    /// Position angle of the electric vector of all light together, in [−90°, 90°).
    pub net_evpa_deg: f64,
    /// Σ|P|/ΣI of the image convolved with the beam.
    pub mean_fraction: f64,
    /// |P|/I of the image convolved with the beam, where its polarised light is brightest.
    pub brightest_fraction: f64,
    /// The direction of that place from the centre.
    pub brightest_deg: f64,
    /// Modulus of β₂ = Σ P e^{−2iφ}/ΣI, the image convolved with the beam; φ is the position angle from the centre.
    pub beta2: f64,
    /// Its argument, in [−180°, 180°): 0 for radial electric vectors, 180° for tangential ones.
    pub beta2_deg: f64,
}

/// The place of a peak between pixels, east and north of the middle, µas: that of parabolas through the brightest pixel and its
/// neighbours.
fn peak(values: &[f64], grid: ImageGrid, brightest: usize) -> [f64; 2] {
    let n = grid.width;
    let [row, column] = [brightest / n, brightest % n];
    let off = |before: f64, after: f64| {
        let curvature = before - 2.0 * values[brightest] + after;
        if curvature < 0.0 { 0.5 * (before - after) / curvature } else { 0.0 }
    };
    let inside = |k: usize, end: usize| (1..end.saturating_sub(1)).contains(&k);
    let columns = inside(column, n).then(|| off(values[brightest - 1], values[brightest + 1]));
    let rows = inside(row, grid.height).then(|| off(values[brightest - n], values[brightest + n]));
    let [east, north] = grid.place_uas(brightest);
    let pixel = grid.pixel_rad / MICROARCSECOND;
    // Columns run to the west, rows to the south.
    [east - columns.unwrap_or(0.0) * pixel, north - rows.unwrap_or(0.0) * pixel]
}

impl LinearPolarization {
    /// Measures images of I, Q and U that follow each other; the centre is to the east and north of the middle of the field,
    /// µas, the beam a full width at half maximum.
    pub fn measure(images: &[f64], grid: ImageGrid, centre_uas: [f64; 2], beam_uas: f64) -> Self {
        let n = grid.pixels();
        let all = |k: usize| &images[k * n..(k + 1) * n];
        let beam = beam_uas * MICROARCSECOND / grid.pixel_rad;
        let [light, q, u] = [0, 1, 2].map(|k| blurred(all(k), grid.width, beam));
        let total = |k: usize| all(k).iter().sum::<f64>();
        let net = Complex::new(total(1), total(2));
        let seen: f64 = light.iter().sum();
        let polarized: Vec<Complex<f64>> =
            q.iter().zip(&u).map(|(q, u)| Complex::new(*q, *u)).collect();
        let direction =
            |[east, north]: [f64; 2]| (east - centre_uas[0]).atan2(north - centre_uas[1]);
        let angle = |k: usize| direction(grid.place_uas(k));
        let turned = |(k, p): (usize, &Complex<f64>)| p * Complex::cis(-2.0 * angle(k));
        let beta2: Complex<f64> = polarized.iter().enumerate().map(turned).sum();
        let bright: Vec<f64> = polarized.iter().map(|p| p.norm()).collect();
        let brightest = (0..n).max_by(|a, b| bright[*a].total_cmp(&bright[*b])).unwrap_or(0);
        Self {
            net_fraction: net.norm() / total(0),
            net_evpa_deg: 0.5 * net.arg().to_degrees(),
            mean_fraction: bright.iter().sum::<f64>() / seen,
            brightest_fraction: bright[brightest] / light[brightest],
            brightest_deg: direction(peak(&bright, grid, brightest)).to_degrees(),
            beta2: beta2.norm() / seen,
            beta2_deg: beta2.arg().to_degrees(),
        }
    }
}

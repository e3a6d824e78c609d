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
        let angle = |k: usize| {
            let [east, north] = grid.place_uas(k);
            (east - centre_uas[0]).atan2(north - centre_uas[1])
        };
        let turned = |(k, p): (usize, &Complex<f64>)| p * Complex::cis(-2.0 * angle(k));
        let beta2: Complex<f64> = polarized.iter().enumerate().map(turned).sum();
        let brightest = (0..n).max_by(|a, b| polarized[*a].norm().total_cmp(&polarized[*b].norm()));
        let brightest = brightest.unwrap_or(0);
        Self {
            net_fraction: net.norm() / total(0),
            net_evpa_deg: 0.5 * net.arg().to_degrees(),
            mean_fraction: polarized.iter().map(|p| p.norm()).sum::<f64>() / seen,
            brightest_fraction: polarized[brightest].norm() / light[brightest],
            brightest_deg: angle(brightest).to_degrees(),
            beta2: beta2.norm() / seen,
            beta2_deg: beta2.arg().to_degrees(),
        }
    }
}

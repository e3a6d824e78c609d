//! The colour of black bodies: Planck's law through the CIE 1931 standard observer (2°), as linear
//! light in the primaries of IEC 61966-2-1 (sRGB).
//!
//! The observer's functions are the sums of piecewise Gaussians of Wyman, Sloan & Shirley (2013,
//! Journal of Computer Graphics Techniques 2(2), 1), within about 0.004 of the tabulated ones in
//! chromaticity along the Planckian locus.

/// Colours of black bodies of one total intensity, by temperature.
#[derive(Debug, Clone)]
pub struct BlackBody {
    /// ln of X, Y, Z over the total intensity, at equidistant ln T.
    table: Vec<[f64; 3]>,
    /// Y over the total intensity at the reference temperature.
    reference: f64,
}

/// Temperatures of the table, K: below there is no visible light, above its colour is the same.
const COLDEST: f64 = 300.0;
const HOTTEST: f64 = 1e9;

/// Temperatures that are computed.
const ROWS: usize = 2048;

/// hc/k, m K (CODATA 2018, exact).
const SECOND_RADIATION: f64 = 1.438_776_877e-2;

impl BlackBody {
    /// Colours in units of the luminance of a black body at `temperature` (K): for that Y = 1.
    pub fn new(temperature: f64) -> Self {
        let step = (HOTTEST / COLDEST).ln() / (ROWS - 1) as f64;
        // In logarithms: from 300 to 1000 K alone X, Y, Z rise by twenty decades or more.
        let row = |k: usize| tristimulus(COLDEST * (k as f64 * step).exp()).map(f64::ln);
        let table = (0..ROWS).map(row).collect();
        BlackBody { table, reference: tristimulus(temperature)[1] }
    }

    /// Linear R, G, B of luminance 1 at `temperature` (K).
    pub fn at(temperature: f64) -> [f32; 3] {
        let xyz = tristimulus(temperature);
        linear_srgb(xyz.map(|x| x / xyz[1])).map(|c| c.max(0.0) as f32)
    }

    /// Linear R, G, B at temperature `t` (K), for total intensity 1. What is outside of the
    /// primaries' triangle (deep red below 1900 K) loses its negative part.
    pub fn color(&self, t: f64) -> [f32; 3] {
        let places = (ROWS - 1) as f64 / (HOTTEST / COLDEST).ln();
        let place = (t / COLDEST).ln() * places;
        if place.is_nan() || place < 0.0 {
            return [0.0; 3];
        }
        let first = (place as usize).min(ROWS - 2);
        let part = (place - first as f64).min(1.0);
        let (a, b) = (self.table[first], self.table[first + 1]);
        let xyz = core::array::from_fn(|k| (a[k] + part * (b[k] - a[k])).exp() / self.reference);
        linear_srgb(xyz).map(|c| c.max(0.0) as f32)
    }
}

/// Converts from CIE XYZ to linear light in the primaries of sRGB.
fn linear_srgb([x, y, z]: [f64; 3]) -> [f64; 3] {
    [
        3.240_625_5 * x - 1.537_208_0 * y - 0.498_628_6 * z,
        -0.968_930_7 * x + 1.875_756_1 * y + 0.041_517_5 * z,
        0.055_710_1 * x - 0.204_021_1 * y + 1.056_995_9 * z,
    ]
}

/// X, Y, Z of a black body over its total intensity, from 360 to 830 nm.
fn tristimulus(temperature: f64) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for k in 0..=470 {
        let nanometres = 360.0 + f64::from(k);
        // π B/(σT⁴) = 15/π⁴ x⁴/(λ(eˣ − 1)) per wavelength, x = hc/(λkT).
        let x = SECOND_RADIATION / (nanometres * 1e-9 * temperature);
        // exp_m1 keeps the digits of hot bodies, where x is small.
        let share = x.powi(4) / (nanometres * x.exp_m1());
        for (sum, matching) in sums.iter_mut().zip(matching(nanometres)) {
            *sum += share * matching;
        }
    }
    sums.map(|sum| 15.0 / core::f64::consts::PI.powi(4) * sum)
}

/// The colour-matching functions x̄, ȳ, z̄ at a wavelength in nm.
fn matching(l: f64) -> [f64; 3] {
    let lobe = |height: f64, center: f64, rise: f64, fall: f64| {
        let t = (l - center) * if l < center { rise } else { fall };
        height * (-0.5 * t * t).exp()
    };
    [
        lobe(0.362, 442.0, 0.0624, 0.0374)
            + lobe(1.056, 599.8, 0.0264, 0.0323)
            + lobe(-0.065, 501.1, 0.0490, 0.0382),
        lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322),
        lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::LUMINANCE;
    use kerrlight_geodesic::vector::dot;

    /// Chromaticities of the Planckian locus for the CIE 1931 observer: illuminant A (2856 K),
    /// 6504 K, 2000 K, 10,000 K and the limit of infinite temperature.
    #[test]
    fn paper_planckian_locus() {
        for (t, x, y) in [
            (2856.0, 0.4476, 0.4074),
            (6504.0, 0.3135, 0.3236),
            (2000.0, 0.5267, 0.4133),
            (10_000.0, 0.2807, 0.2884),
            (1e9, 0.2399, 0.2340),
        ] {
            let xyz = tristimulus(t);
            let sum: f64 = xyz.iter().sum();
            let (dx, dy) = (xyz[0] / sum - x, xyz[1] / sum - y);
            assert!(dx.hypot(dy) < 0.004, "{t} K: {dx:e} {dy:e}");
        }
    }

    /// The visible share of its energy, as luminous efficacy: 683 lm/W times Y over σT⁴.
    #[test]
    fn paper_luminous_efficacy() {
        for (t, efficacy) in [(4000.0, 54.7), (7000.0, 95.0)] {
            let found = 683.0 * tristimulus(t)[1];
            assert!((found / efficacy - 1.0).abs() < 0.03, "{t} K: {found} lm/W");
        }
    }

    /// The white of sRGB is D65, x = 0.3127 and y = 0.3290.
    #[test]
    fn exact_white_and_unit_luminance() {
        let white = linear_srgb([0.3127 / 0.3290, 1.0, (1.0 - 0.3127 - 0.3290) / 0.3290]);
        assert!(white.iter().all(|c| (c - 1.0).abs() < 1e-3), "{white:?}");
        for t in [1500.0, 4000.0, 30_000.0] {
            let luminance = dot(LUMINANCE, BlackBody::new(t).color(t).map(f64::from));
            let outside = if t < 1900.0 { 0.02 } else { 1e-3 };
            assert!((luminance - 1.0).abs() < outside, "{t} K: {luminance}");
        }
        let body = BlackBody::new(5000.0);
        assert_eq!(body.color(100.0), [0.0; 3]);
        assert_eq!(body.color(f64::NAN), [0.0; 3]);
        // Rayleigh and Jeans: visible light goes like T, its share of the whole like T⁻³.
        let ratio = body.color(2e8)[1] / body.color(4e8)[1];
        assert!((ratio - 8.0).abs() < 0.01, "{ratio}");
    }
}

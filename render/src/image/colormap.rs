//! Colour maps from [0, 1] to sRGB.

use super::LUMINANCE;
use kerrlight_geodesic::vector::dot;

/// Colour maps by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Colormap {
    /// `afmhot` stretched so that lightness rises evenly: the way the EHT shows its images.
    AfmhotUs,
    /// Black, red, yellow, white.
    Afmhot,
    /// matplotlib's inferno.
    Inferno,
    /// matplotlib's magma.
    Magma,
    /// matplotlib's viridis.
    Viridis,
    /// Grey with even lightness.
    Gray,
    /// ColorBrewer's red over white to blue, for values on both sides of 0.
    RedBlue,
    /// A circle of colours, for angles.
    Sinebow,
}

/// The hot ramp of AFM images: three straight lines.
fn afmhot(x: f64) -> [f64; 3] {
    [2.0 * x, 2.0 * x - 0.5, 2.0 * x - 1.0].map(|c| c.clamp(0.0, 1.0))
}

/// CIE L* in [0, 100] of an sRGB colour (IEC 61966-2-1 and CIE 15).
fn lightness(rgb: [f64; 3]) -> f64 {
    let linear =
        rgb.map(|c| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) });
    let y = dot(LUMINANCE, linear);
    if y > 216.0 / 24389.0 { 116.0 * y.cbrt() - 16.0 } else { y * 24389.0 / 27.0 }
}

impl Colormap {
    /// sRGB in [0, 1] of x ∈ [0, 1].
    fn srgb(self, x: f64) -> [f64; 3] {
        let of = |gradient: colorous::Gradient| {
            let c = gradient.eval_continuous(x);
            [c.r, c.g, c.b].map(|c| f64::from(c) / 255.0)
        };
        match self {
            Colormap::AfmhotUs => afmhot(even_lightness(afmhot, x)),
            Colormap::Afmhot => afmhot(x),
            Colormap::Inferno => of(colorous::INFERNO),
            Colormap::Magma => of(colorous::MAGMA),
            Colormap::Viridis => of(colorous::VIRIDIS),
            Colormap::RedBlue => of(colorous::RED_BLUE),
            Colormap::Sinebow => of(colorous::SINEBOW),
            Colormap::Gray => [even_lightness(|x| [x; 3], x); 3],
        }
    }

    /// The map as a table of 1024 8-bit colours.
    pub fn table(self) -> Vec<[u8; 3]> {
        (0..1024)
            .map(|k| self.srgb(f64::from(k) / 1023.0).map(|c| (c * 255.0).round() as u8))
            .collect()
    }
}

/// Returns the place at which a map whose lightness rises from 0 to 100 reaches the lightness 100
/// x.
fn even_lightness(map: impl Fn(f64) -> [f64; 3], x: f64) -> f64 {
    let (mut lo, mut hi) = (0.0, 1.0);
    for _ in 0..40 {
        let middle = 0.5 * (lo + hi);
        if lightness(map(middle)) < 100.0 * x { lo = middle } else { hi = middle }
    }
    0.5 * (lo + hi)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_ends_and_even_lightness() {
        for map in [Colormap::AfmhotUs, Colormap::Gray] {
            let table = map.table();
            assert_eq!(table[0], [0, 0, 0]);
            assert_eq!(table[1023], [255, 255, 255]);
            for k in (0..1024).step_by(64) {
                let l = lightness(table[k].map(|c| f64::from(c) / 255.0));
                assert!((l - 100.0 * k as f64 / 1023.0).abs() < 0.8, "{map:?} {k}: {l}");
            }
        }
        assert_eq!(Colormap::Viridis.table()[0], [68, 1, 84]);
    }
}

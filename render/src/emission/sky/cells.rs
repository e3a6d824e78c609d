//! Cells of equal area on the sphere.

use core::f64::consts::{PI, TAU};

/// Rings of constant width in z, each cut into as many sectors of azimuth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Cells {
    pub rings: i64,
    pub sectors: i64,
}

impl Cells {
    /// Makes about `count` cells, about as wide as high at the equator.
    pub fn about(count: f64) -> Self {
        let rings = (count / PI).sqrt().ceil().max(2.0);
        let sectors = (count / rings).ceil().max(4.0);
        Cells { rings: rings as i64, sectors: sectors as i64 }
    }

    /// Number of cells.
    pub fn count(&self) -> usize {
        (self.rings * self.sectors) as usize
    }

    /// The number of the cell that holds a direction.
    pub fn holding(&self, [x, y, z]: [f64; 3]) -> usize {
        let azimuth = y.atan2(x).rem_euclid(TAU) / TAU;
        // The remainder of a tiny negative angle may be rounded to a whole turn.
        let sector = ((azimuth * self.sectors as f64) as i64).min(self.sectors - 1);
        (self.ring(z) * self.sectors + sector) as usize
    }

    fn ring(&self, z: f64) -> i64 {
        ((0.5 * (z + 1.0) * self.rings as f64) as i64).clamp(0, self.rings - 1)
    }

    /// Ring and sector of all cells within `across` and `along` the meridian of a direction, and of some more.
    pub fn near(
        &self,
        [x, y, z]: [f64; 3],
        [across, along]: [f64; 2],
        mut see: impl FnMut(i64, i64),
    ) {
        let polar = x.hypot(y).atan2(z);
        let (least, most) = ((polar - along).max(0.0), (polar + along).min(PI));
        let (lowest, highest) = (self.ring(most.cos()), self.ring(least.cos()));
        let azimuth = y.atan2(x).rem_euclid(TAU) / TAU;
        // So much azimuth is spanned; all of it next to a pole.
        let sin = least.sin().min(most.sin());
        // A cap spans asin(sin(across)/sin θ) of azimuth, and asin x ≤ 1.6 x, the factor below.
        let reach = if sin > across.sin() { across.sin() / sin } else { 4.0 };
        let width = self.sectors as f64;
        let from = ((azimuth - reach / TAU * 1.6) * width).floor() as i64;
        let to = ((azimuth + reach / TAU * 1.6) * width).floor() as i64;
        let to = to.min(from + self.sectors - 1);
        for ring in lowest..=highest {
            (from..=to).for_each(|sector| see(ring, sector.rem_euclid(self.sectors)));
        }
    }
}

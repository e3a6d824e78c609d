//! Light of the thin disc.

use super::PreparedScene;
use super::polarized::share;
use super::result::{Accumulator, Place};
use crate::emission::disc::{DiscModel, Photon};
use kerrlight_geodesic::ScreenPoint;
use kerrlight_geodesic::simd::Crossing;

/// Where a ray crosses the equatorial plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hit {
    pub mino_time: f64,
    pub place: Place,
    /// dw/dτ and d cos θ/dτ, for polarised light and for matter that plunges.
    pub rates: [f64; 2],
    /// Optical depth of the gas in front of it.
    pub depth: f64,
}

/// How light of a surface reaches the eye.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen<'a> {
    pub lambda: f64,
    pub eta: f64,
    /// Its place on the screen, if light is polarised.
    pub screen: Option<&'a ScreenPoint>,
    /// What a camera adds to the redshift.
    pub shift: Option<f64>,
    /// Spectral index α, if redshift is simulated.
    pub spectral_index: Option<f64>,
}

impl Hit {
    /// A crossing of the closed form, without its rates.
    pub fn new(crossing: &Crossing) -> Self {
        let Crossing { radius, azimuth, delay, mino_time, .. } = *crossing;
        Hit { mino_time, place: Place { radius, azimuth, delay }, rates: [0.0; 2], depth: 0.0 }
    }
}

impl PreparedScene {
    /// The first of `hits` before Mino time `until` that hides the rest.
    pub(super) fn surface(&self, hits: impl Iterator<Item = Hit>, until: f64) -> Option<f64> {
        let disc = self.disc.as_ref().filter(|disc| disc.opaque)?;
        let mut times = hits.filter(|hit| disc.covers(hit.place.radius));
        times.next().map(|hit| hit.mino_time).filter(|time| *time <= until)
    }

    /// Light of the disc: I = g^{3+α} I_em at every crossing up to Mino time `end`.
    ///
    /// Always inlined: who knows that an effect is off asks nothing about it.
    #[inline(always)]
    pub(super) fn add_disc(
        &self,
        hits: impl Iterator<Item = Hit>,
        seen: Seen<'_>,
        end: f64,
        gathered: &mut Accumulator,
    ) {
        let Some(disc) = &self.disc else { return };
        for (number, hit) in hits.take_while(|hit| hit.mino_time <= end).enumerate() {
            if disc.covers(hit.place.radius) {
                let kind = if disc.plunges_at(hit.place.radius) { 16 } else { 0 };
                gathered.disc_images |= 1 << (kind + number.min(15));
                self.add_hit(disc, &hit, seen, gathered);
            }
        }
    }

    #[inline(always)]
    fn add_hit(&self, disc: &DiscModel, hit: &Hit, seen: Seen<'_>, gathered: &mut Accumulator) {
        let Seen { lambda, eta, screen, shift, spectral_index } = seen;
        let r = hit.place.radius;
        let g = match spectral_index {
            Some(_) => disc.redshift(r, &Photon { lambda, eta, outward: hit.rates[0] > 0.0 }),
            None => 1.0,
        };
        let stokes = screen.map(|screen| self.polarized_hit(disc, hit, lambda, screen));
        let boost = match stokes {
            Some(stokes) => stokes.i,
            None => spectral_index.map_or(1.0, |index| g.powf(3.0 + index)),
        };
        let mut intensity = boost * disc.intensity(r);
        if hit.depth > 0.0 {
            intensity *= (-hit.depth).exp();
        }
        gathered.add(intensity, g, disc.color(r, g * shift.unwrap_or(1.0)));
        if let Some(stokes) = stokes {
            gathered.add_stokes(intensity, share(&stokes));
        }
        gathered.mark(intensity, hit.place);
    }
}

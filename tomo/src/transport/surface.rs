//! Light of the thin disc.

use super::Stage;
use super::glimpse::Gather;
use kerrlight_geodesic::flow::keplerian_redshift;
use kerrlight_geodesic::{Path, Ray};

impl Stage {
    /// Light of the disc: I = g^{3+α} I_em at every crossing up to Mino time `end` and the first
    /// that hides the rest, whose Mino time is returned.
    pub(super) fn add_disc(
        &self,
        ray: &Ray,
        path: &Path,
        end: f64,
        gather: &mut Gather,
    ) -> Option<f64> {
        let disc = self.disc.as_ref()?;
        for mino_time in path.equatorial_crossings().take_while(|time| *time <= end) {
            let point = path.at(mino_time);
            let r = point.radius();
            if !disc.covers(r) {
                continue;
            }
            let g = match self.redshift {
                Some(_) => keplerian_redshift(&self.hole, r, ray.lambda).unwrap_or(0.0),
                None => 1.0,
            };
            let boost = self.redshift.map_or(1.0, |index| g.powf(3.0 + index));
            let intensity = boost * disc.intensity(r);
            gather.add(intensity, g, disc.color);
            gather.mark(intensity, &point);
            if disc.opaque {
                return Some(mino_time);
            }
        }
        None
    }
}

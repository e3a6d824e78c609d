//! One sharp image of the volume as the observer sees it, with more rays than the data have pixels and as many
//! along photon rings as these take.

use super::instrument::{opacity, upright};
use super::{Instrument, Result, Truth, observer, spacing};
use crate::fit::settings::FitFile;
use crate::fit::{
    ForwardModel, Motion, Observable, PolarizedView, Sampling, SightlineRequest, Sightlines, State,
    Trainer,
};
use kerrlight_render::picture::{RingStrata, Stratum};
use kerrlight_render::transport::View;

/// Pixels along each side: six times those of the fit, no more than this.
const MOST: usize = 256;
/// Rays that are traced at a time, about: the memory that they need goes like their number.
pub(super) const AT_A_TIME: usize = 4096;
/// Spacing of rays along photon rings, in the logarithm of their distance from the critical curve: less than a
/// cell of a volume by its radius.
const SPACING: f64 = 0.1;

/// Square images, rows from the top: Σ emission · path, in M.
pub struct PreviewImage {
    /// Pixels along each side.
    pub side: usize,
    /// Time at which it is seen, M.
    pub time: f64,
    /// Image of the recovered field.
    pub recovered: Vec<f32>,
    /// Image of the true one, if it is known.
    pub truth: Option<Vec<f32>>,
}

/// View of a still.
pub struct PreviewView<'a> {
    /// The settings.
    pub file: &'a FitFile,
    /// Hole, redshift and polarisation.
    pub instrument: &'a Instrument,
    /// Motion of matter.
    pub motion: &'a Motion,
    /// The true field, if it is known.
    pub truth: Option<&'a Truth>,
}

impl PreviewView<'_> {
    /// The recovered field and the true one at a time, M.
    ///
    /// # Errors
    /// If the memory for its rays is not there.
    pub fn at(
        &self,
        time: f64,
        trainer: &Trainer<'_, f32>,
        state: &State<f32>,
    ) -> Result<PreviewImage> {
        let motion = Motion { times: vec![time], ..self.motion.clone() };
        let side = self.side();
        let mut still = PreviewImage { side, time, recovered: Vec::new(), truth: None };
        // That of the fit: a mean over the rays of a still, or of a part of it, is another one.
        let Instrument { lines, hole, polarized, .. } = self.instrument;
        let unit = polarized.as_ref().map(|view| view.unit_along(lines, hole, &motion.velocity));
        let mut first = 0;
        while first < side * side {
            let rays = self.rays(first)?;
            first += rays.count.len();
            let mut model = self.forward_model(&rays, &motion, unit)?;
            model.weigh(state.now.axis);
            let image = model.images(state.now.field(trainer.representation), &[0]);
            still.recovered.extend(rays.pixels(&image));
            if let Some(truth) = self.truth {
                let image = truth.movie_through(&mut model);
                let image: Vec<f32> = image.into_iter().map(|x| x as f32).collect();
                still.truth.get_or_insert_default().extend(rays.pixels(&image));
            }
        }
        Ok(still)
    }

    fn side(&self) -> usize {
        (6 * self.file.screen.pixels).min(MOST)
    }

    /// The rays of pixels from the `first` on: one through the centre of each, or several along photon rings.
    fn rays(&self, first: usize) -> Result<Rays> {
        let (screen, side) = (&self.file.screen, self.side());
        let step = spacing(screen)? * screen.pixels as f64 / side as f64;
        let at = |k: usize| (k as f64 - 0.5 * (side as f64 - 1.0)) * step;
        let view = View::Screen(observer(&self.file.observer)?);
        let turned = upright(self.file);
        let strata = RingStrata::new(&self.instrument.hole, &view, SPACING);
        let mut rays = Rays::default();
        let mut ring = Vec::new();
        for k in first..side * side {
            // Pixels stay whole: all rays of one are averaged at once.
            if rays.alpha.len() >= AT_A_TIME {
                break;
            }
            let [x, y] = turned([at(k % side), -at(k / side)]);
            ring.clear();
            strata.place((x, y), step, &mut ring);
            if ring.is_empty() {
                ring.push(Stratum { x, y, share: 1.0 });
            }
            rays.add(&ring);
        }
        Ok(rays)
    }

    /// Nodes of rays, with the weights of integrals along them.
    fn forward_model(
        &self,
        rays: &Rays,
        motion: &Motion,
        unit: Option<f64>,
    ) -> Result<ForwardModel<f32>> {
        let Instrument { hole, redshift, polarized, .. } = self.instrument;
        let request = SightlineRequest {
            region: self.file.region.limits(),
            sampling: Sampling::Gauss { order: 6, split: 1 },
            delay: self.file.effects.slow_light,
            momentum: redshift.is_some() || polarized.is_some(),
        };
        let observer = observer(&self.file.observer)?;
        let mut lines = Sightlines::trace(hole, &observer, &rays.alpha, &rays.beta, &request)?;
        if let Some(medium) = self.file.effects.absorption {
            lines.absorb(opacity(medium));
        }
        let model = ForwardModel::new(&lines, motion, hole, *redshift)?;
        let Some(view) = polarized else { return Ok(model) };
        let view = PolarizedView { unit, ..view.clone() };
        let factors = view.factors(&lines, hole, &motion.velocity)?;
        model.seen(Some(&factors), &Observable::Images)
    }
}

/// Rays of pixels, one pixel after the other.
#[derive(Default)]
struct Rays {
    alpha: Vec<f64>,
    beta: Vec<f64>,
    /// Shares of their pixels' areas.
    share: Vec<f64>,
    /// Number of rays of each pixel.
    count: Vec<usize>,
}

impl Rays {
    fn add(&mut self, pixel: &[Stratum]) {
        self.alpha.extend(pixel.iter().map(|ray| ray.x));
        self.beta.extend(pixel.iter().map(|ray| ray.y));
        self.share.extend(pixel.iter().map(|ray| ray.share));
        self.count.push(pixel.len());
    }

    /// Means over the pixels of what the rays see.
    fn pixels(&self, seen: &[f32]) -> Vec<f32> {
        let mut rays = seen.iter().zip(&self.share);
        let mut mean = |count: &usize| {
            rays.by_ref().take(*count).map(|(light, share)| f64::from(*light) * share).sum::<f64>()
        };
        self.count.iter().map(|count| mean(count) as f32).collect()
    }
}

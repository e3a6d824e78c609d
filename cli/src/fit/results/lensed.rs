//! One sharp image of the volume as the observer sees it, with more rays than the data have pixels.

use super::Estimate;
use crate::fit::setup::{self, Instrument};
use kerrlight_tomo::fit::{
    Batch, Chain, Field, Motion, Sampling, SightlineRequest, Sightlines, State, Trainer,
};
use kerrlight_tomo::representation::Workspace;

/// Rays along each side.
pub const SIDE: usize = 256;
/// Rows that are traced at a time: what they need goes like their number.
const ROWS: usize = 32;

/// Images of SIDE × SIDE rays, rows from the top: Σ emission · path, in M.
pub struct Still {
    /// When it is seen, M.
    pub time: f64,
    /// Of the recovered field.
    pub recovered: Vec<f32>,
    /// Of the true one, if it is known.
    pub truth: Option<Vec<f32>>,
}

impl Estimate<'_> {
    /// The recovered field and the true one at the reference time, or in the middle of the data if that lies outside
    /// of them.
    pub fn still(&self, trainer: &Trainer<'_, f32>, state: &State<f32>) -> anyhow::Result<Still> {
        let time = self.time_of_still();
        let motion = Motion { times: vec![time], ..self.motion.clone() };
        let mut still = Still { time, recovered: Vec::new(), truth: None };
        for row in (0..SIDE).step_by(ROWS) {
            let mut chain = self.rows(row, &motion)?;
            still.recovered.extend(recovered(&mut chain, trainer, state));
            if let Some(truth) = &self.measured.truth {
                chain.weigh(truth.axis());
                let image = chain.movie_of(truth.axis(), &|x| truth.at(x), &mut Batch::default());
                let image = image.into_iter().map(|x| x as f32);
                still.truth.get_or_insert_default().extend(image);
            }
        }
        Ok(still)
    }

    fn time_of_still(&self) -> f64 {
        let (times, reference) = (&self.measured.times, self.motion.reference);
        let within = times.first().is_some_and(|first| reference >= *first)
            && times.last().is_some_and(|last| reference <= *last);
        if within { reference } else { times[times.len() / 2] }
    }

    /// Nodes of some rows of rays, with the weights of integrals along them.
    fn rows(&self, first: usize, motion: &Motion) -> anyhow::Result<Chain<f32>> {
        let screen = &self.file.screen;
        let step = setup::spacing(screen)? * screen.pixels as f64 / SIDE as f64;
        let at = |k: usize| (k as f64 - 0.5 * (SIDE as f64 - 1.0)) * step;
        let rays = first * SIDE..(first + ROWS) * SIDE;
        let (alpha, beta): (Vec<f64>, Vec<f64>) =
            rays.map(|k| (at(k % SIDE), -at(k / SIDE))).unzip();
        let Instrument { hole, redshift, .. } = self.instrument;
        let request = SightlineRequest {
            region: setup::region(&self.file.region),
            sampling: Sampling::Gauss { order: 6, split: 1 },
            delay: self.file.effects.slow_light,
            momentum: redshift.is_some(),
        };
        let observer = setup::observer(&self.file.observer)?;
        let lines = Sightlines::trace(hole, &observer, &alpha, &beta, &request)?;
        Ok(Chain::new(&lines, motion, hole, *redshift)?)
    }
}

fn recovered(chain: &mut Chain<f32>, trainer: &Trainer<'_, f32>, state: &State<f32>) -> Vec<f32> {
    let now = &state.now;
    chain.weigh(now.axis);
    let field = Field {
        representation: trainer.representation,
        parameters: &now.parameters,
        axis: now.axis,
        occupancy: now.occupancy.as_ref(),
    };
    let mut image = vec![0.0; chain.pixels()];
    chain.movie(field, &[0], &mut Batch::default(), &mut Workspace::new(), &mut image);
    image
}

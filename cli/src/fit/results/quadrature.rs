//! Error of the sums along rays, beside the errors of the data.

use super::Estimate;
use kerrlight_tomo::fit::setup::finer_images;
use kerrlight_tomo::fit::{Sampling, State, Trainer};

/// Frames that are looked at.
const FRAMES: usize = 4;
/// Off by this part of the errors of the data, sums begin to count.
const LIMIT: f64 = 0.3;

impl Estimate<'_> {
    /// The root mean square difference of what data are compared with from the same with twice the nodes on rays, over
    /// the errors of the data, in a few frames. None where that cannot be told, and where data are simulated by the same
    /// sums.
    pub fn quadrature_error(
        &self,
        trainer: &mut Trainer<'_, f32>,
        state: &State<f32>,
    ) -> anyhow::Result<Option<f64>> {
        if self.file.data.is_none() {
            return Ok(None);
        }
        let observed = trainer.objective.observed();
        let every = observed.len().div_ceil(FRAMES).max(1);
        let frames: Vec<usize> = observed.into_iter().skip(every / 2).step_by(every).collect();
        let field = state.now.field(trainer.representation);
        let finer = finer_images(self.file, self.motion, field, &frames)?;
        let Some(finer) = finer else { return Ok(None) };
        let plain = trainer.movie(&state.now, &frames, true);
        Ok(Some(trainer.objective.apart(&frames, [&plain, &finer])))
    }
}

/// A sentence where they count: sums over rays that are cut into so many panels.
pub fn sentence(off: f64, nodes: Sampling) -> Option<String> {
    let Sampling::Gauss { order, split } = nodes else { return None };
    (off > LIMIT).then(|| {
        format!(
            "Sums along rays are off by {off:.1} σ of the data: take region.nodes = {{ gauss = {{ order = {order}, \
             split = {} }} }}.",
            2 * split
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_only_what_counts_is_said() {
        let nodes = Sampling::Gauss { order: 12, split: 2 };
        assert_eq!(sentence(0.29, nodes), None);
        let said = sentence(1.44, nodes).unwrap();
        assert!(said.contains("1.4 σ of the data") && said.contains("split = 4"), "{said}");
    }
}

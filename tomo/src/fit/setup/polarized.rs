//! Polarised visibilities as the data of a fit.

use super::Result;
use crate::fit::settings::{FitFile, Kind, Loss, LossKind, Start, refuse};
use kerrlight_render::polarization::StokesParameter;
use kerrlight_vlbi::polarimetry::MODELLED;

/// Stokes parameters that polarised visibilities are made of, in the order of a frame's images.
pub(super) const PARAMETERS: [StokesParameter; MODELLED] =
    [StokesParameter::I, StokesParameter::Q, StokesParameter::U];

/// Returns whether any of the data compare Q and U of baselines.
pub(super) fn is_polarized(losses: &[Loss]) -> bool {
    losses.iter().any(|loss| loss.data.is_polarized())
}

/// Images of a frame that these losses see.
pub(super) fn images(losses: &[Loss]) -> usize {
    if is_polarized(losses) { MODELLED } else { 1 }
}

/// Refuses what is not solved for together with polarised visibilities or leakage.
///
/// # Errors
/// Says what.
pub(super) fn check(file: &FitFile) -> Result<()> {
    if is_polarized(&file.loss) && file.unknown_geometry()?.is_some() {
        refuse!(
            "numbers with a prior are not searched with polarized-visibilities or polarimetric-ratios"
        );
    }
    let solves = file.instrument.as_ref().is_some_and(|instrument| instrument.leakage.is_some());
    let draws = file.observation().is_some_and(|seen| seen.leakage.is_some());
    let has = |kind| file.loss.iter().any(|loss| loss.data == kind);
    let products = has(LossKind::PolarizedVisibilities);
    if solves && !products {
        refuse!("instrument.leakage needs a loss with data = \"polarized-visibilities\"");
    }
    if draws && !products {
        refuse!(
            "simulation.observation.leakage needs a loss with data = \"polarized-visibilities\""
        );
    }
    if solves && has(LossKind::PolarimetricRatios) {
        refuse!(
            "instrument.leakage and a loss of polarimetric-ratios exclude each other: leakage does not cancel in ratios"
        );
    }
    if solves && file.held_out.is_some() {
        refuse!("instrument.leakage and held_out exclude each other");
    }
    let is_linear = file.representation.kind == Kind::LinearGrid;
    if solves && !is_linear && !matches!(file.training.start, Start::Linear { .. }) {
        refuse!(
            "instrument.leakage needs representation.kind = \"linear-grid\", or training.start = {{ linear = {{ nodes, stride, steps }} }}: leakage is solved for beside a linear grid"
        );
    }
    Ok(())
}

/// Movies of I, Q and U of images that follow each other in each frame.
pub(super) fn split(all: &[f64], pixels: usize) -> [Vec<f64>; MODELLED] {
    let of = |k: usize| all.chunks_exact(pixels).skip(k).step_by(MODELLED).flatten().copied();
    [0, 1, 2].map(|k| of(k).collect())
}

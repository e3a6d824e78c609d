//! Errors of a geometry that the model of the fit makes: its voxels, its pixels, and its sums along rays.

use super::detail::{MORE, Place, RaySampling};
use super::refinement::finer;
use super::search_data::SearchData;
use super::seen_through;
use crate::fit::geometry::{
    Effort, GeometryModel, GeometryProblem, ModelErrors, Refined, Refinement, Spread, Standing,
};
use crate::fit::settings::UnknownGeometry;
use crate::fit::setup::Result;
use kerrlight_vlbi::operator::Pulse;

/// Voxels along each axis, at most.
const MOST: usize = 128;

/// Errors that the model has of itself in a geometry that a search has found with χ²/N of `reduced`.
pub(super) fn errors(
    unknown: &UnknownGeometry,
    place: &Place,
    problem: &GeometryProblem<'_, f32>,
    spread: &Spread,
    reduced: f64,
) -> Result<ModelErrors> {
    if let Some(why) = left_out(&place.seen, problem) {
        let known = spread.unexplained(problem.excess(reduced), reduced).into_iter().collect();
        return Ok(ModelErrors { known, left_out: Some(why) });
    }
    let geometry = spread.geometry;
    place.seen.smoothly(problem, geometry, |problem| {
        let standing = problem.standing(geometry)?;
        let voxels = voxels(&standing, problem)?;
        let sums = sums(&standing, problem)?;
        let pixels = pixels(unknown, place, &standing, problem)?;
        let ring = ring(place, &standing, problem)?;
        let refined: Vec<Refined> = [voxels, sums, pixels, ring].into_iter().flatten().collect();
        Ok(ModelErrors { known: standing.errors(problem.free, &refined), left_out: None })
    })
}

/// Data of which no bowl is known, through which finer models could be compared.
fn left_out(seen: &SearchData, problem: &GeometryProblem<'_, f32>) -> Option<&'static str> {
    let has_gains = seen.view.measured.gains.is_some();
    match (problem.change.is_any(), problem.is_convex(), has_gains) {
        (true, _, _) => Some("emission that changes"),
        (false, true, _) => None,
        (false, false, true) => Some("visibilities with unknown gains"),
        (false, false, false) => Some("amplitudes and closure quantities"),
    }
}

/// None with a [prior](crate::fit::linear::GaussianField) of the voxels, which says what lies between them.
fn voxels(standing: &Standing, problem: &GeometryProblem<'_, f32>) -> Result<Option<Refined>> {
    let few = problem.effort.nodes;
    let nodes = finer(few).min(MOST);
    if problem.gaussian.is_some() || nodes <= few {
        return Ok(None);
    }
    let effort = Effort { nodes, ..problem.effort };
    // Splines of degree d have d + 1 taps, and errors that go with the size to that power.
    let onwards = onwards(effort.degree.taps() as f64, nodes as f64 / few as f64);
    let kind = Refinement { source: "voxels", onwards };
    standing.refined(kind, &GeometryProblem { effort, ..*problem })
}

/// Gauss–Legendre panels converge faster than any power of their length.
fn sums(standing: &Standing, problem: &GeometryProblem<'_, f32>) -> Result<Option<Refined>> {
    let model = GeometryModel { split: 2 * problem.model.split, ..problem.model.clone() };
    let kind = Refinement { source: "sums along rays", onwards: 1.0 };
    standing.refined(kind, &GeometryProblem { model: &model, ..*problem })
}

/// Images may be samples or means over pixels, or have rays on an even lattice. Visibilities are those of a smooth image, whose
/// sums converge faster than any power of the pixel, unless the data are known to have pixels. Polarised light is seen along single
/// rays.
fn pixels(
    unknown: &UnknownGeometry,
    Place { seen, at, view, errors, even }: &Place,
    standing: &Standing,
    problem: &GeometryProblem<'_, f32>,
) -> Result<Option<Refined>> {
    let kind = Refinement { source: "pixels", onwards: 1.0 };
    if problem.model.polarization.is_some() {
        return Ok(None);
    }
    if seen.is_images() {
        let means = Refinement { onwards: onwards(2.0, 2.0), ..kind };
        // The rays of the data themselves leave nothing to refine further.
        let (kind, rays) = even.map_or((means, at.rays.denser()), |even| (kind, even));
        // The model has the panels of the search already, and `seen_through` multiplies them.
        let rays = RaySampling { panels: 1, ..rays };
        let model = seen_through(&seen.view.file, problem.model.clone(), rays)?;
        return standing.refined(kind, &GeometryProblem { model: &model, ..*problem });
    }
    if seen.view.measured.pulse != Pulse::Delta {
        return Ok(None);
    }
    let other = seen.sampled(finer(seen.view.file.screen.pixels))?;
    other.with(unknown, view, *errors, problem.memory, |finer| {
        // The panels of the search, not of the settings: pixels alone are to differ.
        let model = GeometryModel { split: problem.model.split, ..finer.model.clone() };
        standing.refined(kind, &GeometryProblem { model: &model, ..*finer })
    })
}

/// Images of another program through more rays in the pixels near the critical curve, whose error falls as their number.
fn ring(
    Place { seen, at, even, .. }: &Place,
    standing: &Standing,
    problem: &GeometryProblem<'_, f32>,
) -> Result<Option<Refined>> {
    // Rays that somebody has asked for stay.
    let is_open = seen.view.file.screen.ring_rays.is_none() && even.is_none();
    let is_plain = seen.is_images() && problem.model.polarization.is_none();
    let Some(rays) = at.rays.ringed().filter(|_| is_open && is_plain) else { return Ok(None) };
    // The model has the panels of the search already, and `seen_through` multiplies them.
    let rays = RaySampling { panels: 1, ..rays };
    let model = seen_through(&seen.view.file, problem.model.clone(), rays)?;
    let kind = Refinement { source: "rays of the photon ring", onwards: onwards(1.0, MORE as f64) };
    standing.refined(kind, &GeometryProblem { model: &model, ..*problem })
}

/// Returns the ratio of endless refinement to a `finer`-fold one, where errors go with this power of the size of parts.
fn onwards(power: f64, finer: f64) -> f64 {
    // Richardson: of an error c hᵖ one refinement removes c hᵖ (1 − f⁻ᵖ).
    1.0 / (1.0 - finer.powf(-power))
}

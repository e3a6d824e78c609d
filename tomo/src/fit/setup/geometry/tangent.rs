//! Amplitudes and closure quantities about a volume, for which χ² is convex in the volumes of all geometries.
//!
//! Amplitudes with closure phases are visibilities whose phases each station may turn. About the visibilities of a volume
//! that explains them well, phases and gains move in proportion to what another volume changes: χ² is then quadratic
//! ([`TangentTerm`]), and geometries are compared as from calibrated visibilities. The volume that is found is the next one
//! to start from.

use super::search_data::{SearchData, counted};
use crate::fit::geometry::{Estimate, Geometry, GeometryProblem};
use crate::fit::journal::{bits, key};
use crate::fit::linear::{Voxels, Weighted};
use crate::fit::settings::{Loss, LossKind};
use crate::fit::setup::{FitData, Result};
use crate::fit::{Scan, ScanTerm};
use kerrlight_vlbi::data_terms::GainTerm;
use kerrlight_vlbi::gains::GainPriors;
use kerrlight_vlbi::observation::{Observation, Row};
use kerrlight_vlbi::operator::Operator;
use num_complex::Complex32;

/// A volume in a geometry.
pub(super) struct Anchor {
    pub geometry: Geometry,
    /// Its voxels.
    pub voxels: Voxels,
    /// Their values.
    pub x: Vec<f64>,
}

impl Anchor {
    /// The volume of an estimate.
    pub fn of(problem: &GeometryProblem<'_, f32>, estimate: &Estimate) -> Self {
        Self { geometry: estimate.geometry, voxels: problem.voxels(), x: estimate.x.clone() }
    }
}

impl SearchData {
    /// Does something with data about a volume; none where there are such as have no convex form.
    pub fn about<R>(
        &self,
        problem: &GeometryProblem<'_, f32>,
        anchor: &Anchor,
        work: impl FnOnce(&GeometryProblem<'_, f32>) -> Result<R>,
    ) -> Result<Option<R>> {
        let images = problem.images(anchor.geometry, &anchor.voxels, &anchor.x)?;
        let measured = &self.view.measured;
        let Some(weight) = tangent_weight(measured, &self.view.file.loss) else { return Ok(None) };
        let Some(term) = measured.tangents(problem.frames, &images)? else { return Ok(None) };
        let term = counted(Weighted { weight, term: &term }, problem.frames);
        let anchor = key((anchor.geometry.bits(), bits(&anchor.x)));
        // The same geometry has another value about another volume.
        let memory = problem.memory.about(anchor);
        work(&GeometryProblem { terms: &[term], memory, ..*problem }).map(Some)
    }
}

/// The weight of losses that have a convex form about a volume: visibilities or, with closure phases, amplitudes.
fn tangent_weight(measured: &FitData, losses: &[Loss]) -> Option<f64> {
    let weight = |kind: LossKind| losses.iter().find(|loss| loss.data == kind).map(|l| l.weight);
    match (&measured.gains, losses.len()) {
        (Some(_), 1) => weight(LossKind::Visibilities),
        (None, 2) => weight(LossKind::ClosurePhases).and(weight(LossKind::Amplitudes)),
        _ => None,
    }
}

impl FitData {
    /// Visibilities with free phases, and gains as far as priors say, about images of some frames; none if a frame has
    /// several times or channels, whose phases differ.
    fn tangents(&self, frames: &[usize], images: &[f32]) -> Result<Option<ScanTerm<f32>>> {
        let mut scans: Vec<Option<Scan<f32>>> = (0..self.times.len()).map(|_| None).collect();
        let pixels = images.len() / frames.len().max(1);
        for (frame, image) in frames.iter().zip(images.chunks(pixels.max(1))) {
            let (part, sky) = self.part(*frame)?;
            // Gains that are solved for are those of all channels.
            let channel = |row: &Row| self.gains.is_none().then_some(row.channel);
            let mut places = part.stokes_i().map(|(row, _)| (row.time_h, channel(row)));
            let Some(place) = places.next() else { continue };
            if places.any(|other| other != place) {
                return Ok(None);
            }
            let transform = self.transform(&part, sky)?;
            let mut model = vec![Complex32::default(); transform.data()];
            transform.forward(image, &mut model);
            let term = GainTerm::visibilities(&part, &self.free_phases(&part))?;
            let Some(term) = term.tangent(&model) else { return Ok(None) };
            scans[*frame] = Some(Scan { transform, term: Box::new(term) });
        }
        Ok(Some(ScanTerm::new("visibilities with free phases", pixels, true, scans)))
    }

    /// Returns the priors of gains; amplitudes where nothing is said of them.
    fn free_phases(&self, part: &Observation) -> GainPriors {
        // Without a spread of amplitudes stations turn phases and no more.
        let known = vec![0.0; part.stations.len()];
        let priors = || GainPriors { free_phases: true, amplitude_sigma: known };
        self.gains.clone().unwrap_or_else(priors)
    }
}

//! A rotation of all position angles that is not known, such as that of a Faraday screen: the one in which the emission
//! that is solved for explains the data best.

use super::linear_problem::Of;
use super::{Result, linear};
use crate::fit::linear::{Change, LinearProblem};
use crate::fit::settings::{FaradaySettings, FitError, FitFile, Kind, LossKind, Start, refuse};
use crate::fit::{ForwardModel, Objective, Seen};
use kerrlight_render::dynamics::Axis;
use kerrlight_render::polarization::StokesParameter;

/// Times that the distance of angles is halved about the best one.
const HALVINGS: usize = 3;

/// A rotation that was tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tried {
    /// Degrees east of north.
    pub angle_deg: f64,
    /// χ² per datum of the emission that explains the data best, with penalties.
    pub loss: f64,
}

/// The rotation that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Rotation {
    /// All that were tried.
    pub tried: Vec<Tried>,
    /// The best one, 0 to 180 degrees east of north.
    pub angle_deg: f64,
    /// Its standard deviation, from the curvature of χ² with the emission solved for, degrees; none where it has no minimum.
    pub sigma_deg: Option<f64>,
}

/// Told how many rotations are done of about how many; says whether to go on.
pub type RotationWatch<'a> = dyn FnMut(usize, usize) -> bool + 'a;

/// Refuses a search that data or settings do not allow.
///
/// # Errors
/// Says why.
pub(super) fn check(file: &FitFile) -> Result<()> {
    if file.faraday.is_none() {
        return Ok(());
    }
    linear(file)?;
    let [loss] = &file.loss[..] else { refuse!("faraday needs one loss, and not several") };
    let sees = match loss.data {
        LossKind::PolarizedVisibilities => true,
        _ => [StokesParameter::Q, StokesParameter::U]
            .iter()
            .all(|wanted| loss.stokes.as_ref().is_some_and(|stokes| stokes.contains(wanted))),
    };
    if !sees || file.polarization.is_none() {
        let why = "faraday needs Q and U: a loss of polarized-visibilities, or of a light curve with stokes = [\"Q\", \"U\"]";
        return Err(FitError::Conflict(why.to_owned()).into());
    }
    if file.band.is_some() {
        refuse!(
            "faraday and band exclude each other: band.position_angles_deg has the same rotation"
        );
    }
    if file.instrument.is_some() {
        refuse!(
            "faraday and instrument exclude each other: rotations are compared without gains and leakage"
        );
    }
    Ok(())
}

/// Nodes along each axis and every how many-eth frame of the problem that is solved for each rotation.
fn effort(file: &FitFile) -> (usize, usize) {
    match file.training.start {
        Start::Linear { nodes, stride, .. } if file.representation.kind != Kind::LinearGrid => {
            (nodes, stride.max(1))
        }
        _ => (file.representation.grid_nodes(), 1),
    }
}

/// The search, with the emission solved for in each rotation; none if it was cancelled.
///
/// # Errors
/// If the linear problem has none.
pub fn find_rotation(
    (file, settings): (&FitFile, &FaradaySettings),
    objective: &Objective<f32>,
    (axis, seen): (Axis, &Seen),
    watch: &mut RotationWatch<'_>,
) -> Result<Option<Rotation>> {
    let FaradaySettings { angles, .. } = *settings;
    let mut search =
        Search { file, settings, objective, axis, seen, tried: Vec::new(), start: None };
    let expected = angles + 2 * HALVINGS;
    let mut step = 180.0 / angles as f64;
    let first = (0..angles).map(|k| k as f64 * step).collect::<Vec<_>>();
    for angle in first {
        search.add(angle)?;
        if !watch(search.tried.len(), expected) {
            return Ok(None);
        }
    }
    for _ in 0..HALVINGS {
        let best = search.best().angle_deg;
        step *= 0.5;
        for angle in [best - step, best + step] {
            search.add(angle)?;
            if !watch(search.tried.len(), expected) {
                return Ok(None);
            }
        }
    }
    search.ended(step).map(Some)
}

struct Search<'a> {
    file: &'a FitFile,
    settings: &'a FaradaySettings,
    objective: &'a Objective<f32>,
    axis: Axis,
    seen: &'a Seen,
    tried: Vec<Tried>,
    /// The emission of the rotation before.
    start: Option<Vec<f64>>,
}

impl Search<'_> {
    fn best(&self) -> Tried {
        let least = |a: &&Tried, b: &&Tried| a.loss.total_cmp(&b.loss);
        self.tried.iter().min_by(least).copied().unwrap_or(Tried { angle_deg: 0.0, loss: f64::NAN })
    }

    fn add(&mut self, angle_deg: f64) -> Result<()> {
        let (nodes, stride) = effort(self.file);
        let model = turned(&self.objective.model, self.seen, angle_deg)?;
        let frames: Vec<usize> = self.objective.observed().into_iter().step_by(stride).collect();
        let (file, how) = (self.file, (self.axis, Change::NONE));
        let of = Of { file, objective: self.objective, how, nodes, seed: None };
        let (iterations, start) = (self.settings.iterations, self.start.as_deref());
        let least = of.with(&frames, |problem| {
            LinearProblem { model: &model, ..*problem }.least_from(start, iterations)
        })?;
        self.tried.push(Tried { angle_deg, loss: least.value });
        self.start = Some(least.x);
        Ok(())
    }

    /// The minimum of the parabola through the best rotation and its neighbours.
    fn ended(mut self, step: f64) -> Result<Rotation> {
        let best = self.best();
        let mut around = [best.loss; 2];
        for (loss, angle) in around.iter_mut().zip([best.angle_deg - step, best.angle_deg + step]) {
            let known = self.tried.iter().find(|tried| (tried.angle_deg - angle).abs() < 1e-9);
            *loss = match known {
                Some(tried) => tried.loss,
                None => {
                    self.add(angle)?;
                    self.tried[self.tried.len() - 1].loss
                }
            };
        }
        let [below, above] = around;
        let bend = (above - 2.0 * best.loss + below) / (step * step);
        let slope = (above - below) / (2.0 * step);
        let moved = if bend > 0.0 { (-slope / bend).clamp(-step, step) } else { 0.0 };
        // The loss is weight · χ²/data.
        let term = self.objective.terms().next();
        let data = term.map_or(1.0, |(term, weight)| {
            let count: usize =
                self.objective.observed().iter().map(|f| term.degrees_of_freedom(*f)).sum();
            count as f64 / weight
        });
        let sigma_deg = (bend > 0.0).then(|| (2.0 / (bend * data)).sqrt());
        let angle_deg = (best.angle_deg + moved).rem_euclid(180.0);
        self.tried.sort_by(|a, b| a.angle_deg.total_cmp(&b.angle_deg));
        Ok(Rotation { tried: self.tried, angle_deg, sigma_deg })
    }
}

/// The same model with all position angles turned.
fn turned(model: &ForwardModel<f32>, seen: &Seen, angle_deg: f64) -> Result<ForwardModel<f32>> {
    let mut model = model.clone();
    model.turn(seen.parameters(), angle_deg.to_radians())?;
    Ok(model)
}

//! The recovered and the true emission on the nodes of a box, and how well they agree.

use crate::Error;
use crate::fit::settings::FitFile;
use crate::fit::setup::Truth;
use crate::fit::{Motion, State, Trainer};
use kerrlight_render::volume::Volume;
use kerrlight_render::volume::metrics::{self, Comparison};

/// The nodes of the volume.
struct Box3 {
    nodes: [usize; 3],
    half: f64,
}

impl Box3 {
    fn new(file: &FitFile) -> Self {
        Self { nodes: [file.output.nodes; 3], half: file.region.r_max }
    }

    fn volume(&self, values: Vec<f32>) -> Result<Volume, Error> {
        Ok(Volume::new(self.nodes, [-self.half; 3], [self.half; 3], values)?)
    }

    fn positions(&self) -> Vec<[f64; 3]> {
        let n = self.nodes[0];
        let at = |k: usize| -self.half + 2.0 * self.half * k as f64 / (n - 1) as f64;
        (0..n.pow(3)).map(|k| [at(k / (n * n)), at(k / n % n), at(k % n)]).collect()
    }
}

/// The field at the reference time, zero outside the region, and where matter would be faster than light: nothing is seen of it, and
/// a representation has any value there.
///
/// # Errors
/// If the volume is larger than memory, or out of range.
pub fn recovered(
    file: &FitFile,
    trainer: &mut Trainer<'_, f32>,
    state: &State<f32>,
) -> Result<Volume, Error> {
    let region = file.region.limits();
    let (circles, axis) = (trainer.objective.model.circles().cloned(), state.now.axis);
    let is_dark = |x| circles.as_ref().is_some_and(|circles| circles.is_dark(axis, x));
    on_nodes(file, trainer, None, state, &|x| region.holds(x) && !is_dark(x))
}

/// The field at the reference time at all nodes whose matter passes the region at some time, or next to it: what a
/// scene needs that carries it along.
///
/// # Errors
/// If the volume is larger than memory, or out of range.
pub fn carried(
    file: &FitFile,
    trainer: &mut Trainer<'_, f32>,
    state: &State<f32>,
) -> Result<Volume, Error> {
    let (region, axis) = (file.region.limits(), state.now.axis.vector());
    let nodes = Box3::new(file);
    // The diagonal of a cell: values between nodes of the region need their neighbours.
    let margin = 2.0 * nodes.half / (nodes.nodes[0] - 1) as f64 * 3f64.sqrt();
    on_nodes(file, trainer, None, state, &|x| region.is_passed(axis, x, margin))
}

/// The field at the reference time or another one, zero where nothing is wanted.
fn on_nodes(
    file: &FitFile,
    trainer: &mut Trainer<'_, f32>,
    at: Option<(&Motion, f64)>,
    state: &State<f32>,
    wanted: &dyn Fn([f64; 3]) -> bool,
) -> Result<Volume, Error> {
    let nodes = Box3::new(file);
    let positions = nodes.positions();
    let inside: Vec<usize> = (0..positions.len()).filter(|k| wanted(positions[*k])).collect();
    let column = |c: usize| inside.iter().map(|k| positions[*k][c] as f32).collect::<Vec<f32>>();
    let [x, y, z] = [0, 1, 2].map(column);
    let found = match at {
        Some((motion, since)) => trainer.emission_at(&state.now, motion, since, [&x, &y, &z]),
        None => trainer.emission(&state.now, [&x, &y, &z]),
    };
    let mut values = vec![0.0; positions.len()];
    inside.iter().zip(found).for_each(|(k, value)| values[*k] = value);
    nodes.volume(values)
}

/// The field at another time, M since the reference time; zero outside the region, where matter has come from outside of it,
/// and before emission is injected.
///
/// # Errors
/// If the volume is larger than memory, or out of range.
pub fn recovered_at(
    file: &FitFile,
    trainer: &mut Trainer<'_, f32>,
    motion: &Motion,
    state: &State<f32>,
    since: f64,
) -> Result<Volume, Error> {
    let region = file.region.limits();
    let shines = motion.injection.is_none_or(|start| motion.reference + since >= start.time);
    // What is not carried knows the places of the time itself.
    let is_carried = trainer.representation.is_carried();
    let was_inside = |[x, y, z]: [f64; 3]| {
        let radius = x.hypot(y).hypot(z);
        let flow = motion.velocity.falling().filter(|_| is_carried);
        flow.is_none_or(|flow| {
            (region.r_min..=region.r_max).contains(&flow.radius_before(radius, since))
        })
    };
    let wanted = |x: [f64; 3]| shines && region.holds(x) && was_inside(x);
    on_nodes(file, trainer, Some((motion, since)), state, &wanted)
}

/// The truth at a time since the reference time, M.
///
/// # Errors
/// If the volume is larger than memory, or out of range.
pub fn true_volume(file: &FitFile, truth: &Truth, since: f64) -> Result<Volume, Error> {
    let nodes = Box3::new(file);
    let light = |x: &[f64; 3]| truth.seen_at(*x, since) as f32;
    nodes.volume(nodes.positions().iter().map(light).collect())
}

/// Compares the field with the truth.
pub fn compare(
    file: &FitFile,
    trainer: &mut Trainer<'_, f32>,
    state: &State<f32>,
    truth: &Volume,
) -> Option<Comparison> {
    metrics::compare(&recovered(file, trainer, state).ok()?, truth, None).ok()
}

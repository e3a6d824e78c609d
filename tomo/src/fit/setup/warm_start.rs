//! A start of a representation from the solution of a linear problem.

use super::change::change;
use super::{Result, linear};
use crate::fit::linear::{LinearSolution, Voxels};
use crate::fit::settings::{FitFile, Kind, Start, refuse};
use crate::fit::{Region, State};
use crate::optimise::{AdamState, Muon};
use crate::representation::{
    Activation, Changing, Coordinates, Gradient, Groups, Knots, Representation, WeightMatrix,
    Workspace,
};
use core::ops::Range;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Points of a step of [`warm_start`].
const POINTS: usize = 4096;
/// Its first rate, which falls to nothing.
const RATE: f64 = 2e-3;
/// Steps over which the rate of networks grows to that.
const RAMP: u64 = 30;
/// Root mean square difference from the solution, over that of the solution, below which a start is good enough.
const CLOSE: f64 = 0.05;
/// Rounds of steps, at most: filaments take more of them than spots.
const ROUNDS: u64 = 4;
/// Draws of points that tell how close it is.
const DRAWS: usize = 4;

/// Result of a warm start.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WarmStarted {
    /// Steps.
    pub steps: u64,
    /// Root mean square difference from the solution over that of the solution; 0 where its nodes were read off.
    pub relative_error: f64,
}

/// Fits a representation to the solution of a linear problem, at random points of the region and, where emission changes, at
/// random times, with what does not move beside it: rounds of `steps` steps, until it is within a twentieth of the solution
/// or four rounds are over. `times` are those of the first and the last emission, M since the reference time.
///
/// # Errors
/// If there is no table `linear`, or the emission does not have a value for each node and knot.
pub fn warm_start(
    file: &FitFile,
    representation: &dyn Representation<f32>,
    solution: &LinearSolution<f32>,
    times: [f64; 2],
    state: &mut State<f32>,
) -> Result<WarmStarted> {
    let quiescent = &solution.quiescent;
    let own = state.now.parameters.len() - quiescent.len();
    state.now.parameters[own..].copy_from_slice(quiescent);
    let (r, region) = (file.region.r_max, file.region.limits());
    let solution = Solution::of(file, solution, change(file, times)?.knots)?;
    if file.representation.kind == Kind::Grid {
        read_off(file, &solution, &mut state.now.parameters[..own]);
        return Ok(WarmStarted { steps: 0, relative_error: 0.0 });
    }
    let steps = match file.training.start {
        Start::Linear { steps, .. } => steps,
        Start::Drawn => 0,
    };
    let matrices = representation.matrices();
    let mut random = Pcg64::seed_from_u64(file.seed ^ 0x1157_a27e);
    let mut memory = AdamState::new(state.now.parameters.len());
    let (mut workspace, mut gradient) = (Workspace::new(), vec![0.0; state.now.parameters.len()]);
    let mut found = WarmStarted { steps: 0, relative_error: f64::INFINITY };
    while found.steps < ROUNDS * steps && found.relative_error > CLOSE {
        for step in 0..steps {
            let draw = Draw::new(&mut random, r, &region, &solution);
            gradient.fill(0.0);
            draw.gradient(representation, &state.now.parameters, &mut gradient, &mut workspace);
            let fallen = RATE * (1.0 - step as f64 / steps as f64);
            let rate = fallen * grown(found.steps + step, &matrices);
            let parameters = &mut state.now.parameters;
            // Without matrices these are Adam's steps.
            Muon::default().step(rate, &gradient, &matrices, &mut memory, parameters);
            representation.project(&mut state.now.parameters);
        }
        found.steps += steps;
        let draws = (0..DRAWS).map(|_| Draw::new(&mut random, r, &region, &solution));
        let mut sums = [0.0; 2];
        for draw in draws {
            let [apart, square] =
                draw.squares(representation, &state.now.parameters, &mut workspace);
            sums = [sums[0] + apart, sums[1] + square];
        }
        // A dark solution has nothing to come close to.
        found.relative_error = if sums[1] > 0.0 { (sums[0] / sums[1]).sqrt() } else { 0.0 };
    }
    Ok(found)
}

/// Part of the rate at a step: matrices change as much by a small gradient as by a large one, and the first steps would
/// turn a network off that starts in the dark.
fn grown(step: u64, matrices: &[WeightMatrix]) -> f64 {
    if matrices.is_empty() { 1.0 } else { ((step + 1) as f64 / RAMP as f64).min(1.0) }
}

/// Result of a linear problem.
struct Solution<'a> {
    /// Field between the nodes, and between the knots.
    field: Changing<f32>,
    knots: Knots,
    emission: &'a [f32],
}

impl<'a> Solution<'a> {
    fn of(file: &FitFile, solution: &'a LinearSolution<f32>, knots: Knots) -> Result<Self> {
        let voxels = Voxels::cube(file.voxel_nodes(), file.region.r_max, linear(file)?.degree);
        let (has, wanted) = (solution.emission.len(), voxels.count() * knots.count);
        if has != wanted {
            refuse!("the solution of the linear problem has {has} values; {wanted} are wanted");
        }
        let field = Changing::new(Box::new(voxels.field()?), knots, None)?;
        Ok(Self { field, knots, emission: &solution.emission })
    }

    fn at(&self, [time, x, y, z]: &[Vec<f32>; 4]) -> Vec<f32> {
        let mut values = vec![0.0; x.len()];
        let at = Coordinates::txyz(time, x, y, z);
        self.field.eval(self.emission, at, &mut values, &mut Workspace::new());
        values
    }

    /// A time at which it shines.
    fn time(&self, random: &mut Pcg64) -> f64 {
        match self.knots.count {
            1 => 0.0,
            _ => random.random_range(self.knots.first..self.knots.last()),
        }
    }
}

/// Random points of the region with what they should have.
struct Draw {
    /// t, M since the reference time, and x, y and z, M.
    columns: [Vec<f32>; 4],
    wanted: Vec<f32>,
}

impl Draw {
    fn new(random: &mut Pcg64, r: f64, region: &Region, solution: &Solution<'_>) -> Self {
        let mut columns: [Vec<f32>; 4] = Default::default();
        while columns[0].len() < POINTS {
            let [x, y, z]: [f64; 3] = [0, 1, 2].map(|_| random.random_range(-r..r));
            if region.holds([x, y, z]) {
                let point = [solution.time(random), x, y, z];
                columns.iter_mut().zip(point).for_each(|(column, x)| column.push(x as f32));
            }
        }
        let wanted = solution.at(&columns);
        Draw { columns, wanted }
    }

    /// Sums of squares of the difference and of the solution.
    fn squares(
        &self,
        representation: &dyn Representation<f32>,
        parameters: &[f32],
        workspace: &mut Workspace,
    ) -> [f64; 2] {
        let mut values = vec![0.0; POINTS];
        representation.eval(parameters, self.at(representation), &mut values, workspace);
        let pairs = values.iter().zip(&self.wanted);
        pairs.fold([0.0; 2], |[apart, square], (e, wanted)| {
            [apart + f64::from(e - wanted).powi(2), square + f64::from(*wanted).powi(2)]
        })
    }

    /// The points as a representation takes them.
    fn at(&self, representation: &dyn Representation<f32>) -> Coordinates<'_, f32> {
        let [time, x, y, z] = &self.columns;
        Coordinates::of(representation.dimension(), time, [x, y, z])
    }

    /// Adds the gradient of the mean square difference.
    fn gradient(
        &self,
        representation: &dyn Representation<f32>,
        parameters: &[f32],
        gradient: &mut [f32],
        workspace: &mut Workspace,
    ) {
        let link = |groups: Range<usize>, values: &[f32], out: &mut [f32]| {
            let pairs = values.iter().zip(&self.wanted[groups]).zip(out);
            pairs.for_each(|((e, wanted), out)| *out = 2.0 * (e - wanted) / POINTS as f32);
        };
        let (starts, mut values): (Vec<usize>, _) = ((0..=POINTS).collect(), vec![0.0; POINTS]);
        let at = self.at(representation);
        let into = Gradient { parameters: gradient, coordinates: None };
        let groups = Groups { starts: &starts, link: &link };
        representation.eval_vjp(parameters, at, groups, &mut values, into, workspace);
    }
}

/// The parameters of a grid whose nodes have these values, knot after knot.
fn read_off(file: &FitFile, solution: &Solution<'_>, parameters: &mut [f32]) {
    let (n, r) = (file.representation.grid.nodes, file.region.r_max);
    let at = |k: usize| (-r + 2.0 * r * k as f64 / (n - 1) as f64) as f32;
    let of = |node: fn(usize, usize) -> usize| -> Vec<f32> {
        (0..n * n * n).map(|k| at(node(k, n))).collect()
    };
    let [x, y, z] = [of(|k, n| k / (n * n)), of(|k, n| k / n % n), of(|k, n| k % n)];
    let knots = solution.knots.times().into_iter().zip(parameters.chunks_exact_mut(n * n * n));
    for (time, parameters) in knots {
        let time = vec![time as f32; n * n * n];
        let values = solution.at(&[time, x.clone(), y.clone(), z.clone()]);
        set_nodes(file.representation.activation, &values, parameters);
    }
}

/// The parameters of nodes that have these values.
fn set_nodes(activation: Activation, values: &[f32], parameters: &mut [f32]) {
    for (parameter, value) in parameters.iter_mut().zip(values) {
        let value = f64::from(*value);
        *parameter = match activation {
            // As dark and as bright as a sigmoid is at ±10.
            Activation::Sigmoid => {
                let held = value.clamp(4.54e-5, 1.0 - 4.54e-5);
                (held / (1.0 - held)).ln() as f32
            }
            // The inverse of ln(1 + eˣ).
            Activation::Softplus => value.max(4.54e-5).exp_m1().ln() as f32,
            Activation::Linear => value.max(0.0) as f32,
        };
    }
}

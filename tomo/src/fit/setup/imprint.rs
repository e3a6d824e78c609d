//! A start of a representation from the solution of a linear problem.

use super::Result;
use crate::fit::settings::{FitFile, Kind};
use crate::fit::{Region, State};
use crate::optimise::{Adam, AdamState};
use crate::representation::{Activation, Coordinates, Gradient, Groups, Representation, Workspace};
use crate::volume::Volume;
use core::ops::Range;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Points of a step of [`imprint`].
const POINTS: usize = 4096;
/// Its first rate, which falls to nothing.
const RATE: f64 = 2e-3;

/// Fits a representation to the solution of a linear problem on a grid of `nodes` along each axis, at random points of
/// the region.
///
/// # Errors
/// If the emission does not have `nodes`³ values.
pub fn imprint(
    file: &FitFile,
    representation: &dyn Representation<f32>,
    emission: &[f32],
    nodes: usize,
    steps: u64,
    state: &mut State<f32>,
) -> Result<()> {
    let (r, region) = (file.region.r_max, file.region.limits());
    let volume = Volume::new([nodes; 3], [-r; 3], [r; 3], emission.to_vec())?;
    if file.representation.kind == Kind::Grid {
        read_off(file, &volume, &mut state.now.parameters);
        return Ok(());
    }
    let mut random = Pcg64::seed_from_u64(file.seed ^ 0x1157_a27e);
    let mut memory = AdamState::new(state.now.parameters.len());
    let (mut workspace, mut gradient) = (Workspace::new(), vec![0.0; state.now.parameters.len()]);
    for step in 0..steps {
        let draw = Draw::new(&mut random, r, &region, &volume);
        gradient.fill(0.0);
        draw.gradient(representation, &state.now.parameters, &mut gradient, &mut workspace);
        let rate = RATE * (1.0 - step as f64 / steps as f64);
        Adam::default().step(rate, &gradient, &mut memory, &mut state.now.parameters);
        representation.project(&mut state.now.parameters);
    }
    Ok(())
}

/// Random points of the region with what they should have.
struct Draw {
    /// x, y and z, M.
    columns: [Vec<f32>; 3],
    wanted: Vec<f32>,
}

impl Draw {
    fn new(random: &mut Pcg64, r: f64, region: &Region, volume: &Volume) -> Self {
        let mut columns: [Vec<f32>; 3] = Default::default();
        let mut wanted = Vec::with_capacity(POINTS);
        while wanted.len() < POINTS {
            let x: [f64; 3] = [0, 1, 2].map(|_| random.random_range(-r..r));
            if region.holds(x) {
                columns.iter_mut().zip(x).for_each(|(column, x)| column.push(x as f32));
                wanted.push(volume.at(x) as f32);
            }
        }
        Draw { columns, wanted }
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
        let ([x, y, z], zero) = (&self.columns, vec![0.0; POINTS]);
        let at = match representation.dimension() {
            4 => Coordinates::txyz(&zero, x, y, z),
            _ => Coordinates::xyz(x, y, z),
        };
        let into = Gradient { parameters: gradient, coordinates: None };
        let groups = Groups { starts: &starts, link: &link };
        representation.eval_vjp(parameters, at, groups, &mut values, into, workspace);
    }
}

/// The parameters of a grid whose nodes have these values.
fn read_off(file: &FitFile, volume: &Volume, parameters: &mut [f32]) {
    let (n, r) = (file.representation.nodes, file.region.r_max);
    let at = |k: usize| -r + 2.0 * r * k as f64 / (n - 1) as f64;
    for (k, parameter) in parameters.iter_mut().enumerate() {
        let value = volume.at([at(k / (n * n)), at(k / n % n), at(k % n)]);
        *parameter = match file.representation.activation {
            // As dark and as bright as a sigmoid is at ±10.
            Activation::Sigmoid => {
                let held = value.clamp(4.54e-5, 1.0 - 4.54e-5);
                (held / (1.0 - held)).ln() as f32
            }
            Activation::Softplus => value.max(4.54e-5).exp_m1().ln() as f32,
            Activation::Linear => value.max(0.0) as f32,
        };
    }
}

//! Muon's steps of weight matrices on the device, all matrices at once.

use super::adam::Learning;
use super::bytes::words;
use super::kernels::{Task, compiled, run};
use crate::optimise::Muon;
use crate::representation::WeightMatrix;
use kerrlight_geodesic::gpu::{Buffer, Commands, Compute, GpuError};

/// Side of a tile of a product.
const TILE: usize = 16;
const ENTRIES: [&str; 6] = ["look_ahead", "normalise", "gram", "power", "advance", "step_along"];

/// Matrices with what their steps need.
#[derive(Debug)]
pub struct Turning {
    muon: Muon,
    rule: Buffer,
    tasks: Vec<Task>,
}

/// Bindings of the shader, in its order, but for which of two places is that of X.
struct Binding<'a> {
    device: &'a Compute,
    buffers: [&'a Buffer; 6],
    turns: &'a [Buffer; 2],
}

impl Turning {
    /// Takes these matrices among the parameters; none if there are none.
    ///
    /// # Errors
    /// If the device has no room, or fails.
    pub fn new(
        device: &Compute,
        muon: Muon,
        matrices: &[WeightMatrix],
        learning: &Learning,
    ) -> Result<Option<Self>, GpuError> {
        if matrices.is_empty() {
            return Ok(None);
        }
        let (table, numbers) = table(matrices);
        let of_matrices = device.storage(4 * table.len() as u64)?;
        device.write(&of_matrices, &words(&table))?;
        let (work, rule) = (device.storage(4 * numbers as u64)?, device.uniform(&[0; 32])?);
        let turn = |of, to| device.uniform(&words(&[of, to, 0, 0]));
        let Learning { parameters, gradient, moments: [means, _], .. } = learning;
        let buffers = [&rule, &of_matrices, gradient, means, parameters, &work];
        let binding = Binding { device, buffers, turns: &[turn(0, 1)?, turn(1, 0)?] };
        let tasks = binding.tasks(matrices)?;
        Ok(Some(Self { muon, rule, tasks }))
    }

    /// Puts the numbers of the next step there.
    ///
    /// # Errors
    /// If the device fails.
    pub fn set(&self, device: &Compute, rate: f64) -> Result<(), GpuError> {
        let Muon { beta, scale, .. } = self.muon;
        let [a, b, c] = Muon::QUINTIC;
        let numbers = [beta, 1.0 - beta, -rate * scale, 0.0, a, b, c, 0.0];
        device.write(&self.rule, &words(&numbers.map(|x| (x as f32).to_bits())))
    }

    /// Takes the step.
    pub fn learn(&self, commands: &mut Commands) {
        run(commands, &self.tasks);
    }
}

impl Binding<'_> {
    fn tasks(&self, matrices: &[WeightMatrix]) -> Result<Vec<Task>, GpuError> {
        let kernels = compiled(self.device, include_str!("shaders/muon.wgsl"), &ENTRIES)?;
        let most = |of: fn(&WeightMatrix) -> usize| matrices.iter().map(of).max().unwrap_or(0);
        let each = most(|matrix| matrix.rows * matrix.columns).div_ceil(64);
        let square = most(|matrix| matrix.rows.min(matrix.columns).div_ceil(TILE).pow(2));
        let area = most(|matrix| matrix.rows.div_ceil(TILE) * matrix.columns.div_ceil(TILE));
        let task = |entry: usize, turn: usize, bindings: &[u32], groups: usize| {
            let [rule, table, gradient, means, parameters, work] = self.buffers;
            let all = [rule, table, &self.turns[turn], gradient, means, parameters, work];
            let buffers: Vec<_> = bindings.iter().map(|k| (*k, all[*k as usize])).collect();
            let bound = self.device.bind(&kernels[entry], &buffers)?;
            Ok((bound, [groups as u32, matrices.len() as u32]))
        };
        let mut tasks = vec![task(0, 0, &[0, 1, 3, 4, 6], each)?, task(1, 0, &[1, 6], 1)?];
        // X and the next X take turns, so that nothing is copied.
        for k in 0..Muon::ITERATIONS {
            tasks.push(task(2, k % 2, &[1, 2, 6], square)?);
            tasks.push(task(3, 0, &[0, 1, 6], square)?);
            tasks.push(task(4, k % 2, &[0, 1, 2, 6], area)?);
        }
        tasks.push(task(5, Muon::ITERATIONS % 2, &[0, 1, 2, 5, 6], each)?);
        Ok(tasks)
    }
}

/// Returns the table of matrices for the shader, and how many numbers they work on.
fn table(matrices: &[WeightMatrix]) -> (Vec<u32>, usize) {
    let (mut table, mut place) = (Vec::new(), 0);
    for WeightMatrix { offset, rows, columns } in matrices {
        let side = *rows.min(columns);
        let mut after = |count: usize| {
            place += count;
            place - count
        };
        let places = [rows * columns, rows * columns, side * side, side * side].map(&mut after);
        let numbers = [[*offset, *rows, *columns, side], places];
        table.extend(numbers.as_flattened().iter().map(|x| *x as u32));
    }
    (table, place)
}

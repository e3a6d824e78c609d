//! The fall of matter as the device reads it.

use crate::fit::forward::fall::Fall;
use kerrlight_render::dynamics::infall::{Origin, Table};

/// Floats of a cell of the table.
const CELL: usize = 16;
/// Later than any time: of matter that stays at its radius.
const NEVER: f32 = 1e30;

/// A table of a fall, and the region in which matter shines.
#[derive(Clone, Debug, PartialEq)]
pub struct FallTable {
    /// Cell after cell, then both ends.
    pub numbers: Vec<f32>,
    /// Cells.
    pub cells: usize,
    /// Least and largest radius, M.
    pub limits: [f32; 2],
}

impl FallTable {
    /// Takes a fall.
    pub fn new(fall: &Fall) -> Self {
        let (flow, _, limits) = fall.parts();
        let Table { cells, last, ends } = flow.numbers();
        let mut numbers = Vec::with_capacity(CELL * (cells.len() + 1));
        for (start, per_time, [radius, azimuth]) in &cells {
            // Times in the table may be large beside their differences, which a float would lose.
            numbers.extend(two_floats(*start));
            numbers.extend([*per_time as f32, 0.0]);
            numbers.extend(radius.iter().chain(azimuth).map(|x| *x as f32));
        }
        let [first, end] = ends.map(|end| end.map(|x| x as f32));
        let [high, low] = two_floats(last);
        numbers.extend([first[0], first[1], first[2], 0.0, end[0], end[1], end[2], 0.0]);
        numbers.extend([high, low, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        Self { numbers, cells: cells.len(), limits: limits.map(|x| x as f32) }
    }
}

/// Returns the values of a node in place of its rate and phase: its time in the table as the sum of two floats, and its
/// azimuth, or its angular velocity where its matter stays at its radius.
pub fn of_node(origin: &Origin) -> [f32; 3] {
    let [time, azimuth] = origin.in_table();
    let [high, low] = if time.is_nan() { [NEVER, 0.0] } else { two_floats(time) };
    [high, low, azimuth as f32]
}

fn two_floats(x: f64) -> [f32; 2] {
    let high = x as f32;
    [high, (x - f64::from(high)) as f32]
}

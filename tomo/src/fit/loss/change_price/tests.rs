//! The price of change against that of the linear problem, and of spheres.

use super::*;
use crate::fit::linear::Change;
use crate::fit::{Occupancy, OccupancySettings};
use crate::representation::{Activation, Allowed, Changing, Grid, GridSettings, Representation};
use kerrlight_render::dynamics::Axis;

const KNOTS: Knots = Knots { first: -3.0, spacing: 2.0, count: 4, allowed: Allowed::Any };
const R: f64 = 5.0;

fn field() -> Changing<f64> {
    let (low, high) = ([-R; 3], [R; 3]);
    let activation = Activation::Linear;
    let settings = GridSettings { nodes: [11; 3], low, high, activation, initial: 0.0 };
    Changing::new(Box::new(Grid::new(settings).unwrap()), KNOTS, None).unwrap()
}

/// The mean over many seeds, and its standard error.
fn price(parameters: &[f64], linear: bool, occupancy: Option<&Occupancy>) -> [f64; 2] {
    let (field, axis) = (field(), Axis::new([0.0, 0.0, 1.0]).unwrap());
    let region = Region { r_min: 0.0, r_max: R, z_width: f64::INFINITY };
    let price = ChangePrice { weight: 0.3, knots: KNOTS, linear, region };
    let field = Field { representation: &field, parameters, axis, occupancy };
    let (mut buffers, mut workspace) = (ChangeBuffers::default(), Workspace::new());
    let mut unused = vec![0.0; parameters.len()];
    let mut one = |seed: u64| {
        price.value_and_gradient(field, seed, &mut unused, &mut buffers, &mut workspace)
    };
    let found: Vec<f64> = (0..64).map(&mut one).collect();
    let mean = found.iter().sum::<f64>() / 64.0;
    let square: f64 = found.iter().map(|x| (x - mean).powi(2)).sum();
    [mean, (square / 63.0 / 64.0).sqrt()]
}

/// Emission that is the same everywhere and jumps from knot to knot: the volume of the sphere times the jumps.
#[test]
fn exact_price_of_a_sphere_is_its_volume_times_its_jumps() {
    let levels = [0.0, 2.0, 0.5, 0.5];
    let parameters: Vec<f64> = levels.iter().flat_map(|level| vec![*level; 1331]).collect();
    let known = 0.3 * 4.0 / 3.0 * core::f64::consts::PI * R.powi(3) * 3.5;
    let [mean, error] = price(&parameters, true, None);
    assert!((mean - known).abs() < 4.0 * error + 2e-3 * known, "{mean} {error} {known}");
    assert!(error < 0.01 * known, "{error}");
    // Between knots jumps go half-way twice, and are compared less often than they are large.
    let [between, _] = price(&parameters, false, None);
    assert!(between > 0.5 * known && between < known, "{between} {known}");
}

/// The same price as the linear problem's, and the same with a mask that leaves out what is dark.
#[test]
fn exact_price_is_that_of_the_linear_problem() {
    let nodes = field().parameters() / KNOTS.count;
    let mut parameters = vec![0.0; KNOTS.count * nodes];
    // Far from the edge, nodes that shine at one knot and have dark neighbours.
    let node = |x: usize, y: usize, z: usize| (x * 11 + y) * 11 + z;
    for (knot, node, value) in [(1, node(5, 5, 5), 2.0), (2, node(3, 5, 6), 5.0)] {
        parameters[knot * nodes + node] = value;
    }
    let change = Change { knots: KNOTS, weight: 0.3, within: None, sharpen: None };
    let mut slopes = vec![0.0; parameters.len()];
    let known = change.penalty(&parameters, 1.0, 1e-9, &[], &mut slopes);
    assert!((known - 0.3 * 14.0).abs() < 1e-6);
    let [mean, error] = price(&parameters, true, None);
    assert!((mean - known).abs() < 4.0 * error + 0.02 * known, "{mean} {error} {known}");
    let (threshold, memory, rest) = (1e-4, 0.9, OccupancySettings::default());
    let settings = OccupancySettings { cells: 10, threshold, memory, ..rest };
    let region = Region { r_min: 0.0, r_max: R, z_width: f64::INFINITY };
    let mut mask = Occupancy::new(settings, region);
    mask.refresh(&field(), &parameters, 3, &KNOTS.times(), &mut Workspace::new());
    assert!(mask.fraction() < 0.2, "{}", mask.fraction());
    let [masked, masked_error] = price(&parameters, true, Some(&mask));
    assert!(
        (masked - known).abs() < 4.0 * masked_error + 0.02 * known,
        "{masked} {masked_error} {known}"
    );
    assert!(masked_error < 0.6 * error, "{masked_error} {error}");
}

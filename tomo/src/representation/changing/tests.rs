use super::*;
use crate::representation::conformance::{Subject, check};
use crate::representation::grid::tests::plain;
use crate::representation::{Activation, Grid, GridSettings};
use kerrlight_geodesic::vector::{cross, rotate};
use kerrlight_render::dynamics::Velocity;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

const AXIS: [f64; 3] = [0.36, 0.48, 0.8];

fn settings() -> GridSettings {
    GridSettings {
        nodes: [5, 4, 6],
        low: [-2.0; 3],
        high: [2.0; 3],
        activation: Activation::Softplus,
        initial: 0.1,
    }
}

fn velocity() -> AngularVelocity {
    AngularVelocity::PowerLaw { radius: 1.0, rate: 0.4, exponent: 1.0 }
}

fn field(count: usize, allowed: Allowed) -> Changing<f64> {
    let knots = Knots { first: -0.3, spacing: 0.25, count, allowed };
    let axis = Axis::new(AXIS).unwrap();
    let carrier = Carrier { axis, velocity: velocity(), limits: [0.0, 2.0] };
    Changing::new(Box::new(Grid::new(settings()).unwrap()), knots, Some(carrier)).unwrap()
}

/// Shares of the knots at a time, and their growth: hat functions, or ramps that stay up.
fn shares(knots: Knots, time: f64) -> Vec<(f64, f64)> {
    let u = (time - knots.first) / knots.spacing;
    let last = knots.count as f64 - 1.0;
    let per_time = if u < 0.0 || u > last { 0.0 } else { 1.0 / knots.spacing };
    let u = u.clamp(0.0, last);
    let hat = |k: usize| {
        let d = u - k as f64;
        ((1.0 - d.abs()).max(0.0), if d.abs() < 1.0 { -d.signum() * per_time } else { 0.0 })
    };
    let hats: Vec<(f64, f64)> = (0..knots.count).map(hat).collect();
    match knots.allowed {
        Allowed::Any => hats,
        // What is there is what was born so far.
        Allowed::Births => {
            let rest = |k: usize| hats[k..].iter().fold((0.0, 0.0), |s, h| (s.0 + h.0, s.1 + h.1));
            (0..knots.count).map(rest).collect()
        }
    }
}

/// The same written plainly, and its derivative.
fn plain_in_time(knots: Knots, p: &[f64], dp: &[f64], at: &[f64], dat: &[f64]) -> (f64, f64) {
    let n = settings().nodes.iter().product::<usize>();
    let (mut sum, mut change) = (0.0, 0.0);
    for (knot, (share, growth)) in shares(knots, at[0]).into_iter().enumerate() {
        let births = knots.count > 1 && knots.allowed == Allowed::Births;
        let label = if births { knots.times()[knot] } else { 0.0 };
        let (x, dx) = ([at[1], at[2], at[3]], [dat[1], dat[2], dat[3]]);
        let r = x.iter().map(|x| x * x).sum::<f64>().sqrt();
        let dr = x.iter().zip(dx).map(|(x, d)| x * d).sum::<f64>() / r;
        let angle = -0.4 / r * (at[0] - label);
        let dangle = -0.4 / r * dat[0] - angle * dr / r;
        let (here, along) = (rotate(AXIS, angle, x), rotate(AXIS, angle, dx));
        let across = cross(AXIS, here);
        let slope = [0, 1, 2].map(|c| along[c] + dangle * across[c]);
        let own = knot * n..(knot + 1) * n;
        let (e, de) = plain(&settings(), &p[own.clone()], &dp[own], &here, &slope);
        sum += share * e;
        change += share * de + growth * dat[0] * e;
    }
    (sum, change)
}

#[test]
fn exact_changing_fields_conform() {
    for (count, allowed) in
        [(1, Allowed::Any), (2, Allowed::Any), (4, Allowed::Any), (3, Allowed::Births)]
    {
        let field = field(count, allowed);
        let tangent = |p: &[f64], dp: &[f64], at: &[f64], dat: &[f64]| {
            plain_in_time(field.knots, p, dp, at, dat)
        };
        let (representation, within) = (&field, 1.3);
        check(&Subject { representation, within, parameter_noise: 1.0, tangent: &tangent });
    }
}

#[test]
fn exact_values_are_linear_between_knots_and_constant_outside() {
    let softplus = |x: f64| x.exp().ln_1p();
    let [a, b, c] = [0.0, 1.0, 5.0].map(softplus);
    let times = [-9.0, -0.3, -0.175, -0.05, 0.15, 0.2, 7.0];
    let cases = [
        (Allowed::Any, [a, a, 0.5 * (a + b), b, b + 0.8 * (c - b), c, c]),
        (Allowed::Births, [a, a, a + 0.5 * b, a + b, a + b + 0.8 * c, a + b + c, a + b + c]),
    ];
    for (allowed, expected) in cases {
        let field = field(3, allowed);
        let n = field.inner.parameters();
        let parameters: Vec<f64> = (0..3 * n).map(|k| [0.0, 1.0, 5.0][k / n]).collect();
        let (one, zero, mut values) = ([0.3; 7], [0.0; 7], [0.0; 7]);
        let at = Coordinates::txyz(&times, &one, &zero, &zero);
        field.eval(&parameters, at, &mut values, &mut Workspace::new());
        for (value, expected) in values.iter().zip(expected) {
            assert!((value - expected).abs() < 1e-13, "{value} {expected}");
        }
    }
}

/// Slopes along random directions are those of central differences where matter falls.
#[test]
fn exact_slopes_of_falling_fields_are_those_of_differences() {
    let law = Velocity::Infall { xi: 0.8, beta_r: 0.8, beta_phi: 0.9, drag: None };
    let settings = GridSettings { low: [-9.0; 3], high: [9.0; 3], ..settings() };
    for allowed in [Allowed::Any, Allowed::Births] {
        let knots = Knots { first: -3.0, spacing: 2.5, count: 3, allowed };
        let velocity = law.angular(0, 0.3).unwrap();
        let axis = Axis::new(AXIS).unwrap();
        let carrier = Carrier { axis, velocity, limits: [2.0, 12.0] };
        let grid = Grid::new(settings.clone()).unwrap();
        let field = Changing::<f64>::new(Box::new(grid), knots, Some(carrier)).unwrap();
        let mut random = Pcg64::seed_from_u64(3);
        let mut draw = |low: f64, high: f64| random.random_range(low..high);
        let parameters: Vec<f64> = (0..field.parameters()).map(|_| draw(-1.0, 1.0)).collect();
        for _ in 0..40 {
            let at = [draw(-2.9, 1.9), draw(3.0, 6.0), draw(-5.0, 5.0), draw(-3.0, 3.0)];
            let along = [0; 4].map(|_| draw(-1.0, 1.0));
            let value = |s: f64| {
                let [t, x, y, z]: [f64; 4] = core::array::from_fn(|k| at[k] + s * along[k]);
                let (columns, mut value) = ([[t], [x], [y], [z]], [0.0]);
                let [t, x, y, z] = &columns;
                let at = Coordinates::txyz(t, x, y, z);
                field.eval(&parameters, at, &mut value, &mut Workspace::new());
                value[0]
            };
            let [t, x, y, z] = at.map(|x| [x]);
            let mut slopes = [[0.0]; 4];
            let [dt, dx, dy, dz] = &mut slopes;
            let mut unused = vec![0.0; parameters.len()];
            let coordinates = Some(CoordinatesMut::txyz(dt, dx, dy, dz));
            let into = Gradient { parameters: &mut unused, coordinates };
            let at = Coordinates::txyz(&t, &x, &y, &z);
            field.vjp(&parameters, at, &[1.0], into, &mut Workspace::new());
            let slope: f64 = slopes.iter().zip(along).map(|([s], d)| s * d).sum();
            let h = 1e-5;
            let difference = (value(h) - value(-h)) / (2.0 * h);
            assert!((slope - difference).abs() < 1e-6, "{slope} {difference} {at:?}");
        }
    }
}

#[test]
fn exact_knots_cover_the_time_that_is_asked_for() {
    let between = |from, to, spacing| Knots::between([from, to], spacing, Allowed::Births);
    let knots = between(-10.0, 25.0, 4.0).unwrap();
    assert_eq!((knots.count, *knots.times().last().unwrap()), (10, 25.0));
    assert!(knots.spacing <= 4.0 && knots.label_time(9) == 25.0);
    assert_eq!(between(3.0, 3.0, 4.0).unwrap().count, 2);
    assert!(between(0.0, 1.0, 0.0).is_err());
}

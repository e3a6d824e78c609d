use super::*;
use ode_solvers::dop_shared::OutputType;
use ode_solvers::{Dop853, System, Vector2};

fn family(spin: f64, [xi, beta_r, beta_phi]: [f64; 3]) -> Falling {
    let mixture = Mixture { xi, beta_r, beta_phi };
    Falling::new(Law::Family(Family { spin, mixture })).unwrap()
}

/// Matter on its way back.
struct Back<'a>(&'a Falling);

impl System<f64, Vector2<f64>> for Back<'_> {
    fn system(&self, _: f64, y: &Vector2<f64>, dy: &mut Vector2<f64>) {
        let [fall, turn] = self.0.rates(y[0]);
        dy[0] = -fall;
        dy[1] = -turn;
    }
}

/// Radius and angle `elapsed` before, step by step.
fn followed(flow: &Falling, radius: f64, elapsed: f64) -> [f64; 2] {
    let start = Vector2::new(radius, 0.0);
    let (equations, tolerance, none) = (Back(flow), 1e-13, 0.0);
    let output = OutputType::Sparse;
    let mut solver = Dop853::from_param(
        equations,
        0.0,
        elapsed,
        none,
        start,
        tolerance,
        tolerance,
        0.9,
        none,
        0.333,
        6.0,
        elapsed,
        none,
        100_000,
        u32::MAX,
        output,
    );
    solver.integrate().unwrap();
    let end = solver.y_out().last().unwrap();
    [end[0], end[1]]
}

#[test]
fn exact_pull_back_is_that_of_the_equations_of_motion() {
    let profile = |radial: [f64; 4]| {
        let radii = vec![2.5, 5.0, 9.0, 15.0];
        let profile = Profile::new(radii, vec![0.2, 0.08, 0.04, 0.015], radial.to_vec());
        Falling::new(Law::Profile(profile.unwrap())).unwrap()
    };
    let flows = [
        family(0.2, [0.7, 0.9, 0.9]),
        family(-0.9, [0.8, 0.99, 1.0]),
        family(0.9, [1.0, 0.5, 0.6]),
        family(0.5, [0.3, 0.0, 0.0]),
        family(0.0, [1.0, 0.999, 0.7]),
        profile([-0.3, -0.1, -0.05, -0.02]),
        profile([0.05, 0.1, 0.04, 0.02]),
    ];
    for flow in &flows {
        for radius in [2.8, 4.7, 6.3, 8.0, 13.0] {
            for elapsed in [-3.0, 1.0, 20.0, 200.0] {
                let expected = followed(flow, radius, elapsed);
                if expected[0] < 2.2 || expected[0] > 1e3 {
                    continue;
                }
                let [stretch, turn] = flow.before(&flow.origin(radius), elapsed);
                let miss = [radius * stretch - expected[0], turn - expected[1]];
                // Roots at the innermost stable orbit cost the integration steps and digits.
                assert!(
                    miss.iter().all(|x| x.abs() < 2e-9 * expected[0]),
                    "{:?}: {radius} {elapsed} {miss:?}",
                    flow.law
                );
            }
        }
    }
}

/// dr/dt = −(1 − 2/r)√(2/r): t = −⅔ x³ − 2x + ln[(x + 1)/(x − 1)] with x = √(r/2), in units of 2 M.
#[test]
fn exact_free_fall_without_spin() {
    let flow = family(0.0, [1.0, 0.0, 0.0]);
    let time = |r: f64| {
        let x = (0.5 * r).sqrt();
        2.0 * (-2.0 / 3.0 * x.powi(3) - 2.0 * x + ((x + 1.0) / (x - 1.0)).ln())
    };
    for (from, to) in [(3.0, 2.01), (30.0, 5.0), (9.0, 8.999), (6.0, 4.0), (500.0, 2.5)] {
        let [stretch, turn] = flow.before(&flow.origin(to), time(to) - time(from));
        assert!((to * stretch / from - 1.0).abs() < 1e-11, "{from} {to} {stretch}");
        assert_eq!(turn, 0.0);
    }
}

#[test]
fn exact_circular_orbits_keep_their_radius() {
    for spin in [-0.9, 0.0, 0.9] {
        let flow = family(spin, [1.0; 3]);
        let isco = kerrlight_geodesic::orbits::isco(&Kerr::new(spin).unwrap());
        for radius in [isco, 1.001 * isco, 2.0 * isco, 1e4] {
            let [stretch, turn] = flow.before(&flow.origin(radius), 37.0);
            let rate = 1.0 / (radius.powf(1.5) + spin);
            assert!(stretch == 1.0 && (turn / (37.0 * rate) + 1.0).abs() < 1e-12);
        }
        // Inside, matter has left the orbit long ago, and left it again.
        let [stretch, _] = flow.before(&flow.origin(0.9 * isco), 1e3);
        assert!(0.9 * stretch < 1.0 && 0.9 * stretch > 0.99, "{stretch}");
        // Sub-Keplerian matter has left it a short time ago.
        let flow = family(spin, [0.7, 1.0, 1.0]);
        let [stretch, _] = flow.before(&flow.origin(0.9 * isco), 1e3);
        assert!((0.9 * stretch - 1.0).abs() < 1e-15);
    }
}

#[test]
fn exact_forth_and_back_is_the_identity() {
    for flow in [family(0.3, [0.7, 0.9, 0.9]), family(-0.6, [0.9, 0.3, 0.2])] {
        for radius in [2.5, 5.0, 6.0, 9.0, 40.0] {
            let [same, none] = flow.before(&flow.origin(radius), 0.0);
            assert!((same - 1.0).abs() < 1e-14 && none.abs() < 1e-13, "{radius} {same} {none}");
            for elapsed in [0.1, 5.0, 80.0] {
                let [stretch, turn] = flow.before(&flow.origin(radius), elapsed);
                let [back, again] = flow.before(&flow.origin(radius * stretch), -elapsed);
                assert!((stretch * back - 1.0).abs() < 1e-12, "{radius} {elapsed}");
                assert!((turn + again).abs() < 1e-11, "{radius} {elapsed} {turn} {again}");
            }
        }
    }
}

/// Matter turns right-handed about the axis unless a retrograde hole drags it along.
#[test]
fn exact_signs_of_rotation() {
    let of = |spin: f64, mixture: [f64; 3]| family(spin, mixture).rates(4.0)[1];
    assert!(of(-0.9, [1.0; 3]) > 0.0 && of(0.9, [1.0; 3]) > 0.0);
    assert!(of(-0.9, [1.0, 0.0, 0.0]) < 0.0 && of(0.9, [1.0, 0.0, 0.0]) > 0.0);
    assert!(family(-0.9, [1.0; 3]).before(&family(-0.9, [1.0; 3]).origin(12.0), 3.0)[1] < 0.0);
}

#[test]
fn exact_numbers_out_of_range_are_named() {
    let refused = |xi, beta_r| {
        let mixture = Mixture { xi, beta_r, beta_phi: 1.0 };
        Falling::new(Law::Family(Family { spin: 0.5, mixture })).unwrap_err().to_string()
    };
    assert!(refused(1.5, 1.0).contains("xi = 1.5 is not allowed"));
    assert!(refused(1.0, f64::NAN).contains("beta_r = NaN"));
    for spin in [-1.0, 0.999_999_999, 1.0] {
        for mixture in [[1.0; 3], [0.7, 0.9, 0.9]] {
            let flow = family(spin, mixture);
            let [stretch, turn] = flow.before(&flow.origin(8.0), 30.0);
            assert!(stretch >= 1.0 && turn < 0.0 && turn > -3.0, "{spin} {stretch} {turn}");
        }
    }
}

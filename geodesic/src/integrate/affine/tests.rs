use super::*;
use crate::{Inclination, Path, Quantities, Tracer};

/// Every force is −∂H/∂x: central differences of the Hamiltonian.
#[test]
fn exact_forces_are_gradients_of_the_hamiltonian() {
    let hamiltonian = |a: f64, [x, y, z]: [f64; 3], p: [f64; 3]| {
        let r = radius(a, [x, y, z]);
        let f = 2.0 * r.powi(3) / (r.powi(4) + a * a * z * z);
        let sum = r * r + a * a;
        let l = [(r * x + a * y) / sum, (r * y - a * x) / sum, z / r];
        let along = 1.0 + l[0] * p[0] + l[1] * p[1] + l[2] * p[2];
        0.5 * (p[0] * p[0] + p[1] * p[1] + p[2] * p[2] - 1.0 - f * along * along)
    };
    for a in [0.0, 0.6, -0.95] {
        let (q, p) = ([2.1, -1.3, 0.9], [0.3, -0.8, 0.5]);
        let f = derivative(a, &[q[0], q[1], q[2], p[0], p[1], p[2], 0.0, 0.0]);
        for k in 0..3 {
            let h = 1e-5;
            let shifted = |v: [f64; 3], step: f64| {
                let mut v = v;
                v[k] += step;
                v
            };
            let force =
                -(hamiltonian(a, shifted(q, h), p) - hamiltonian(a, shifted(q, -h), p)) / (2.0 * h);
            let speed =
                (hamiltonian(a, q, shifted(p, h)) - hamiltonian(a, q, shifted(p, -h))) / (2.0 * h);
            assert!((f[3 + k] - force).abs() < 1e-9, "a = {a}, force {k}");
            assert!((f[k] - speed).abs() < 1e-9, "a = {a}, speed {k}");
        }
    }
}

/// Two tracers without a common equation of motion.
#[test]
fn code_affine_and_mino_tracers_agree() {
    let mut worst = [0.0f64; 4];
    for (k, spin) in [0.0, 0.5, 0.94, -0.8, 1.0].into_iter().enumerate() {
        let hole = Kerr::new(spin).unwrap();
        let inclination = Inclination::from_degrees(10.0 + 38.0 * k as f64).unwrap();
        let observer = Observer::at_radius(inclination, 200.0).unwrap();
        for (alpha, beta) in [(-7.0, 2.0), (3.0, 9.0), (0.5, -1.0), (8.0, -3.0), (-1.0, 0.25)] {
            let affine = AffineTracer::new(1e-13).unwrap();
            let referee = affine.trace(&hole, &observer, alpha, beta).unwrap();
            let ray = observer.ray(&hole, alpha, beta).unwrap();
            let mut path = Path::new();
            Tracer::new(1e-13).unwrap().trace(&hole, &ray, Quantities::ALL, &mut path);
            assert_eq!(referee.outcome(), path.outcome(), "a = {spin}: ({alpha}, {beta})");
            assert!(referee.largest_hamiltonian() < 1e-10);
            let end = referee.mino_total();
            for part in [0.1, 0.5, 0.9, 0.98] {
                let (a, b) = (referee.at(part * end), path.at(part * end));
                let turn = (a.azimuth - b.azimuth) / TAU;
                // A relative error in r moves both azimuths by this much more, without
                // bound at the horizon: dφ = a dr/Δ.
                let r = b.radius();
                let amplified = 1.0 + spin.abs() * r / hole.delta(r);
                let miss = [
                    (a.radius() / b.radius() - 1.0).abs(),
                    (a.theta() - b.theta()).abs(),
                    (turn - turn.round()).abs() * TAU / amplified,
                    (a.delay - b.delay).abs() / b.delay.max(1.0),
                ];
                assert!(miss.iter().all(|x| x.is_finite()), "{spin} {alpha} {beta}: {miss:?}");
                for (worst, miss) in worst.iter_mut().zip(miss) {
                    *worst = worst.max(miss);
                }
                // The interpolant's slope, in the rates that momenta are made of.
                let scale = ray.eta.abs().sqrt() + ray.lambda.abs() + 1.0;
                assert!((a.inverse_radius_rate - b.inverse_radius_rate).abs() < 1e-7 * scale);
                for (a, b) in a.velocity.into_iter().zip(b.velocity) {
                    assert!((a - b).abs() < 1e-6 * scale * amplified, "{spin}: {a} {b}");
                }
                assert!(a.azimuth.abs() <= PI);
            }
            // The referee ends at the horizon, or where it began.
            let crossings = path.equatorial_crossings().filter(|time| *time <= end).count();
            assert_eq!(referee.equatorial_crossings().len(), crossings, "{spin} {alpha} {beta}");
        }
    }
    assert!(worst.iter().all(|w| *w < 1e-10), "{worst:?}");
}

#[test]
fn an_observer_at_infinity_is_refused() {
    let hole = Kerr::new(0.5).unwrap();
    let observer = Observer::at_infinity(Inclination::from_degrees(30.0).unwrap());
    assert!(AffineTracer::new(1e-9).unwrap().trace(&hole, &observer, 1.0, 1.0).is_err());
    assert!(AffineTracer::new(0.5).is_err());
}

use kerrlight_geodesic::*;
use std::time::Instant;
fn main() {
    let hole = Kerr::new(0.94).unwrap();
    let observer = Observer::at_infinity(Inclination::from_degrees(60.0).unwrap());
    for tol in [1e-8, 1e-10] {
        for want in [
            Want::POLAR,
            Want { azimuth: false, time: true },
            Want { azimuth: true, time: false },
            Want::ALL,
        ] {
            let tracer = Tracer::new(tol).unwrap();
            let mut path = Path::new();
            let n = 64;
            let t = Instant::now();
            let mut steps = 0;
            let mut acc = 0.0;
            for j in 0..n {
                for i in 0..n {
                    let al = -8.0 + 16.0 * i as f64 / 63.0;
                    let be = -8.0 + 16.0 * j as f64 / 63.0;
                    tracer.trace(&hole, &observer.ray(&hole, al, be).unwrap(), want, &mut path);
                    steps += path.steps();
                    acc += path.mino_total();
                }
            }
            let us = t.elapsed().as_secs_f64() * 1e6 / (n * n) as f64;
            println!(
                "{tol:e} {want:?} {us:.2} us/ray {:.1} steps {:.0} ns/step {acc}",
                steps as f64 / 4096.0,
                us * 1e3 * 4096.0 / steps as f64
            );
        }
    }
}

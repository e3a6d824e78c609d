//! Measuring spin and inclination: light from a few points of the screen meets the disc at radii
//! that somebody has measured. Exact derivatives make Gauss and Newton find the hole in a few
//! steps.
//!
//! `cargo run --release -p kerrlight-geodesic --example fit_spin`

use kerrlight_geodesic::derivatives;
use kerrlight_geodesic::{Error, Inclination, Integrator, Kerr, Observer, Request};

const ALPHA: [f64; 5] = [-7.0, -5.5, -3.0, 6.0, 8.0];
const BETA: [f64; 5] = [1.0, 3.0, -5.0, 2.5, -1.0];

fn observer(radians: f64) -> Result<Observer, Error> {
    Ok(Observer::at_infinity(Inclination::from_radians(radians)?))
}

fn main() -> Result<(), Error> {
    let request = Request { crossings: 1, ..Request::default() };
    let (hole, truth) = (Kerr::new(0.7)?, observer(0.9)?);
    let measured = Integrator::TaylorMino
        .trace(&hole, &truth, &ALPHA, &BETA, 1e-12, &request)?
        .crossings
        .radius;

    let (mut spin, mut angle) = (0.2, 0.8);
    for step in 0..6 {
        let (hole, observer) = (Kerr::new(spin)?, observer(angle)?);
        let rays = derivatives::trace(&hole, &observer, &ALPHA, &BETA, 1e-12, &request)?;
        // The normal equations of the linear problem, two by two.
        let (mut square, mut side, mut rest) = ([0.0; 3], [0.0; 2], 0.0);
        for (k, by) in rays.crossings.radius.iter().enumerate() {
            let miss = measured[k] - rays.values.crossings.radius[k];
            let (a, i) = (by.spin, by.inclination);
            square = [square[0] + a * a, square[1] + a * i, square[2] + i * i];
            side = [side[0] + a * miss, side[1] + i * miss];
            rest += miss * miss;
        }
        println!("{step}: a = {spin:.12}, i = {angle:.12}, misses {:.1e} M", rest.sqrt());
        let det = square[0] * square[2] - square[1] * square[1];
        spin += (square[2] * side[0] - square[1] * side[1]) / det;
        angle += (square[0] * side[1] - square[1] * side[0]) / det;
    }
    Ok(())
}

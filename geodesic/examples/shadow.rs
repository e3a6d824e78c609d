//! The shadow of a fast hole in 30 lines: which photons would have to come from the horizon.
//!
//! `cargo run --release -p kerrlight-geodesic --example shadow`

use kerrlight_geodesic::{Error, Inclination, Integrator, Kerr, Observer, Outcome, Request};

const COLUMNS: usize = 60;

fn main() -> Result<(), Error> {
    let hole = Kerr::new(0.998)?;
    let observer = Observer::at_infinity(Inclination::from_degrees(90.0)?);
    let place = |k: usize| (0.25 * (k % COLUMNS) as f64 - 5.5, 6.0 - 0.5 * (k / COLUMNS) as f64);
    let (alpha, beta): (Vec<f64>, Vec<f64>) = (0..COLUMNS * 25).map(place).unzip();

    // Fates and numbers of crossings come with every ray: nothing else is requested.
    let request = Request::default();
    let rays = Integrator::TaylorMino.trace(&hole, &observer, &alpha, &beta, 1e-6, &request)?;
    let letter = |k: usize| match rays.outcome[k] {
        Outcome::Captured => ' ',
        // Light that went through the equatorial plane more than once is lensed.
        _ if rays.crossing_count[k] > 1 => 'o',
        _ => '.',
    };
    for row in 0..25 {
        println!("{}", (0..COLUMNS).map(|k| letter(row * COLUMNS + k)).collect::<String>());
    }
    Ok(())
}

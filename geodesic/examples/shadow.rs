//! The shadow of a fast hole in 30 lines: which photons would have to come from the horizon.
//!
//! `cargo run --release -p kerrlight-geodesic --example shadow`

use kerrlight_geodesic::{Inclination, Kerr, Observer, OutOfRange, Outcome, Path, Tracer, Want};

fn main() -> Result<(), OutOfRange> {
    let hole = Kerr::new(0.998)?;
    let observer = Observer::at_infinity(Inclination::from_degrees(90.0)?);
    let tracer = Tracer::new(1e-6)?;
    let mut path = Path::new();
    for row in 0..25 {
        let mut line = String::new();
        for column in 0..60 {
            let (alpha, beta) = (0.25 * f64::from(column) - 5.5, 6.0 - 0.5 * f64::from(row));
            tracer.trace(&hole, &observer.ray(&hole, alpha, beta)?, Want::POLAR, &mut path);
            line.push(match path.outcome() {
                Outcome::Captured => ' ',
                // Light that went through the equatorial plane more than once is lensed.
                _ if path.equatorial_crossings().len() > 1 => 'o',
                _ => '.',
            });
        }
        println!("{line}");
    }
    Ok(())
}

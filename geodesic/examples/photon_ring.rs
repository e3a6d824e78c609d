//! The photon ring: images of one circle of light around the hole pile up at the critical
//! curve, each fainter than the last by e^γ (π without spin), and later by τ.
//!
//! `cargo run --release -p kerrlight-geodesic --example photon_ring`

use kerrlight_geodesic::{Error, Inclination, Kerr, Observer, Path, PathPoint, Quantities, Tracer};

const CIRCLE: f64 = 10.0;

fn main() -> Result<(), Error> {
    let hole = Kerr::new(0.0)?;
    let face_on = Observer::at_infinity(Inclination::from_degrees(0.0)?);
    let tracer = Tracer::new(1e-13)?;
    let critical = 27f64.sqrt();

    // The n-th crossing of the disc by the ray with impact parameter b.
    let crossing = |b: f64, n: usize| -> Result<Option<PathPoint>, Error> {
        let mut path = Path::new();
        tracer.trace(&hole, &face_on.ray(&hole, b, 0.0)?, Quantities::ALL, &mut path);
        let time = path.equatorial_crossings().nth(n);
        Ok(time.map(|time| path.at(time)))
    };

    let mut last: Option<(f64, f64)> = None;
    for n in 0..7 {
        let (mut inside, mut outside) = (critical, 13.0);
        while outside - inside > 1e-15 * critical {
            let b = 0.5 * (inside + outside);
            if b <= inside || b >= outside {
                break;
            }
            let met = crossing(b, n)?.is_some_and(|p| p.radius() < CIRCLE);
            if met { inside = b } else { outside = b }
        }
        let Some(image) = crossing(inside, n)? else { continue };
        print!("n = {n}: b = {inside:.12}, delay {:+9.4} M", image.delay);
        if let Some((b, delay)) = last {
            let gamma = ((b - critical) / (inside - critical)).ln();
            print!(", γ = {gamma:.6}, τ = {:.6}", image.delay - delay);
        }
        println!();
        last = Some((inside, image.delay));
    }
    println!("limits:                                      γ = 3.141593, τ = 16.324194");
    Ok(())
}

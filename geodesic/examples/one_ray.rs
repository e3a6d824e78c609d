//! One photon: where it comes from and what it meets on its way.
//!
//! `cargo run --release -p kerrlight-geodesic --example one_ray`

use kerrlight_geodesic::{Inclination, Kerr, Observer, OutOfRange, Path, Tracer, Want};

fn main() -> Result<(), OutOfRange> {
    let hole = Kerr::new(0.94)?;
    let observer = Observer::at_infinity(Inclination::from_degrees(60.0)?);
    // 5.5 M to the left of the hole's centre on the sky, 1 M up.
    let ray = observer.ray(&hole, -5.5, 1.0)?;
    println!("λ = {:.6}, η = {:.6}", ray.lambda, ray.eta);

    let mut path = Path::new();
    Tracer::new(1e-12)?.trace(&hole, &ray, Want::ALL, &mut path);
    println!("{:?} after Mino time {:.9}", path.outcome(), path.mino_total());
    if let Some((_, r)) = path.turning_point() {
        println!("closest approach: r = {r:.9} M");
    }
    for (k, time) in path.equatorial_crossings().enumerate() {
        let p = path.at(time);
        let (k, r, phi, t) = (k + 1, p.radius(), p.azimuth, p.delay);
        println!("crossing {k}: r = {r:.9} M, φ = {phi:+.9}, delay = {t:+.9} M");
    }
    println!("\n     τ         r         θ         φ");
    for k in 0..=10 {
        let p = path.at(path.mino_total() * f64::from(k) / 10.0);
        println!("{:.5} {:>9.4} {:>9.5} {:>+9.5}", p.mino_time, p.radius(), p.theta(), p.azimuth);
    }
    Ok(())
}

//! One photon: where it comes from and what it meets on its way.
//!
//! `cargo run --release -p kerrlight-geodesic --example one_ray`

use kerrlight_geodesic::{Error, Inclination, Integrator, Kerr, Observer, Placement, Request};

fn main() -> Result<(), Error> {
    let hole = Kerr::new(0.94)?;
    let observer = Observer::at_infinity(Inclination::from_degrees(60.0)?);
    // Everything about the first three crossings of the equatorial plane, and ten points.
    let request =
        Request { samples: Placement::MinoTime(10), uncertainty: true, ..Request::crossings(3) };
    // 5.5 M to the left of the hole's centre on the sky, 1 M up.
    let rays = Integrator::default().trace(&hole, &observer, &[-5.5], &[1.0], 1e-12, &request)?;

    println!("{:?} after Mino time {:.9}", rays.outcome[0], rays.mino_total[0]);
    println!("closest approach: r = {:.9} M", rays.turning_radius[0]);
    let hits = &rays.crossings;
    for k in hits.of(0) {
        let (r, phi, t) = (hits.radius[k], hits.azimuth[k], hits.delay[k]);
        println!("crossing {}: r = {r:.9} M, φ = {phi:+.9}, delay = {t:+.9} M", k + 1);
    }
    println!("relative error of r at most {:.0e}", rays.uncertainty[0].radius);
    println!("\n     τ         r         θ         φ");
    let p = &rays.samples;
    for k in p.of(0) {
        let (time, r, theta, phi) = (p.mino_time[k], p.radius[k], p.theta[k], p.azimuth[k]);
        println!("{time:.5} {r:>9.4} {theta:>9.5} {phi:>+9.5}");
    }
    Ok(())
}

//! Your own emitter: the profile of a spectral line from a ring of gas, by a loop over the
//! screen. Everything that shines is yours; the crate supplies where rays meet it, and g.
//!
//! `cargo run --release -p kerrlight-geodesic --example emitter`

use kerrlight_geodesic::flow::keplerian_redshift;
use kerrlight_geodesic::{Error, Inclination, Integrator, Kerr, Observer, Request, orbits};

/// Rest-frame intensity of the line at radius r: yours to change.
fn emissivity(r: f64) -> f64 {
    r.powi(-3)
}

fn main() -> Result<(), Error> {
    let hole = Kerr::new(0.9)?;
    let observer = Observer::at_infinity(Inclination::from_degrees(40.0)?);
    let (inner, outer) = (orbits::isco(&hole), 20.0);

    let at = |k: u32| 0.2 * f64::from(k) - 25.0;
    let (alpha, beta): (Vec<f64>, Vec<f64>) =
        (0..250 * 250).map(|k| (at(k % 250), at(k / 250))).unzip();
    // r alone is requested, so nothing else is integrated.
    let request = Request { crossings: 1, ..Request::default() };
    let rays = Integrator::TaylorMino.trace(&hole, &observer, &alpha, &beta, 1e-8, &request)?;

    let mut line = [0.0; 30];
    for (ray, alpha) in alpha.iter().enumerate() {
        for r in rays.crossings.of(ray).map(|k| rays.crossings.radius[k]) {
            let lambda = -alpha * observer.inclination().sin();
            let Some(g) = keplerian_redshift(&hole, r, lambda) else { continue };
            if (inner..outer).contains(&r) {
                // Photons per frequency bin: g³ from the intensity, one more from its width.
                line[((g * 20.0) as usize).min(29)] += g.powi(4) * emissivity(r);
            }
        }
    }
    let most = line.iter().copied().fold(0.0, f64::max);
    println!("  g    flux");
    for (k, flux) in line.iter().enumerate().take(27).skip(4) {
        println!("{:.3}  {}", (k as f64 + 0.5) / 20.0, "#".repeat((60.0 * flux / most) as usize));
    }
    Ok(())
}

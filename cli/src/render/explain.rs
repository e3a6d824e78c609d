//! What a scene calls for, what that is going to cost, and what it did cost.

use kerrlight_tomo::plan::Plan;
use kerrlight_tomo::render::{Raster, RenderError};
use kerrlight_tomo::scene::Scene;
use kerrlight_tomo::transport::{Meter, Part};
use std::time::{Duration, Instant};

/// Most rays of the trial by which costs are estimated.
const TRIAL: usize = 2048;
/// Longer than that no more rays are tried.
const ENOUGH: Duration = Duration::from_millis(500);

/// Prints the plan with the estimated cost of each part.
pub fn before(scene: &Scene, raster: &Raster) -> Result<(), RenderError> {
    let screen = &scene.screen;
    let grid =
        f64::from(screen.width) * f64::from(screen.rows()) * f64::from(screen.samples_per_pixel);
    let rings = raster.ring_rays() as f64;
    let rays = grid + rings;
    let (trial, tried) = trial(raster)?;
    let refined = if screen.image_error.is_some() { " and those of refined pixels" } else { "" };
    let threads = rayon::current_num_threads();
    let placed = if rings > 0.0 { format!(" ({rings} along photon rings)") } else { String::new() };
    eprintln!(
        "plan: {rays} rays{placed}{refined} on {threads} threads, estimated from {tried} rays"
    );
    let plan = Plan::new(scene);
    for part in Part::ALL {
        let each = trial.spent(part).as_secs_f64() / tried as f64;
        let whole = each * rays / threads as f64;
        eprintln!("  {:<9}{:>9.3} us a ray {:>9.2} s", part.name(), each * 1e6, whole);
        for step in plan.steps.iter().filter(|step| step.part == part) {
            eprintln!("    {} {}", if step.done { "+" } else { "-" }, step.what);
        }
    }
    Ok(())
}

/// The costs of some rays, and how many these are: fewer where rays are slow.
fn trial(raster: &Raster) -> Result<(Meter, usize), RenderError> {
    // The first rays warm caches up.
    let mut rays = TRIAL / 32;
    raster.trial(rays)?;
    loop {
        let clock = Instant::now();
        let trial = raster.trial(rays)?;
        if rays >= TRIAL || clock.elapsed() > ENOUGH {
            return Ok((trial, rays));
        }
        rays *= 2;
    }
}

/// Prints the measured cost of each part.
pub fn after(meter: &Meter, rays: u64) {
    let threads = rayon::current_num_threads() as f64;
    eprintln!("measured:");
    for part in Part::ALL {
        let spent = meter.spent(part).as_secs_f64();
        let each = spent / rays.max(1) as f64 * 1e6;
        eprintln!("  {:<9}{each:>9.3} us a ray {:>9.2} s", part.name(), spent / threads);
    }
}

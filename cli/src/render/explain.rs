//! What a scene calls for, what that is going to cost, and what it did cost.

use kerrlight_tomo::plan::Plan;
use kerrlight_tomo::render::{Raster, RenderError};
use kerrlight_tomo::scene::Scene;
use kerrlight_tomo::transport::{Meter, Part};

/// Rays of the trial by which costs are estimated.
const TRIAL: usize = 2048;

/// Prints the plan with the estimated cost of each part.
pub fn before(scene: &Scene, raster: &Raster) -> Result<(), RenderError> {
    let screen = &scene.screen;
    let grid =
        f64::from(screen.width) * f64::from(screen.height) * f64::from(screen.samples_per_pixel);
    let rings = raster.ring_rays() as f64;
    let rays = grid + rings;
    // The first rays warm caches up.
    raster.trial(TRIAL / 8)?;
    let trial = raster.trial(TRIAL)?;
    let refined = if screen.image_error.is_some() { " and those of refined pixels" } else { "" };
    let threads = rayon::current_num_threads();
    let placed = if rings > 0.0 { format!(" ({rings} along photon rings)") } else { String::new() };
    eprintln!(
        "plan: {rays} rays{placed}{refined} on {threads} threads, estimated from {TRIAL} rays"
    );
    let plan = Plan::new(scene);
    for part in Part::ALL {
        let each = trial.spent(part).as_secs_f64() / TRIAL as f64;
        let whole = each * rays / threads as f64;
        eprintln!("  {:<9}{:>9.3} us a ray {:>9.2} s", part.name(), each * 1e6, whole);
        for step in plan.steps.iter().filter(|step| step.part == part) {
            eprintln!("    {} {}", if step.done { "+" } else { "-" }, step.what);
        }
    }
    Ok(())
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

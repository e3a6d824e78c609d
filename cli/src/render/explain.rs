//! Effects of a scene, and their cost.

use crate::answer::Answer;
use kerrlight_render::Error;
use kerrlight_render::emission::medium::Part;
use kerrlight_render::picture::Raster;
use kerrlight_render::scene::Scene;
use kerrlight_render::transport::Meter;
use serde_json::json;
use std::time::{Duration, Instant};

/// Most rays of the trial by which costs are estimated.
const TRIAL: usize = 2048;
/// Longer than that no more rays are tried.
const ENOUGH: Duration = Duration::from_millis(500);

/// The plan with the estimated cost of each part.
pub fn before(scene: &Scene, raster: &Raster) -> anyhow::Result<Answer> {
    let screen = &scene.screen;
    let grid =
        f64::from(screen.width) * f64::from(screen.rows()) * f64::from(screen.samples_per_pixel);
    let rings = raster.ring_rays() as f64;
    let rays = grid + rings;
    let (trial, tried) = trial(raster)?;
    let refined = if screen.image_error.is_some() { " and those of refined pixels" } else { "" };
    let threads = rayon::current_num_threads();
    let placed = if rings > 0.0 { format!(" ({rings} along photon rings)") } else { String::new() };
    let mut text = format!(
        "plan: {rays} rays{placed}{refined} on {threads} threads, estimated from {tried} rays\n"
    );
    let plan = raster.plan();
    let mut parts = Vec::new();
    for part in Part::ALL {
        let each = trial.spent(part).as_secs_f64() / tried as f64;
        let whole = each * rays / threads as f64;
        let name = part.name();
        text += &format!("  {name:<9}{:>9.3} us a ray {whole:>9.2} s\n", each * 1e6);
        let steps: Vec<_> = plan.steps.iter().filter(|step| step.part == part).collect();
        for step in &steps {
            text += &format!("    {} {}\n", if step.done { "+" } else { "-" }, step.what);
        }
        let steps: Vec<_> =
            steps.iter().map(|step| json!({"what": step.what, "done": step.done})).collect();
        parts.push(json!({"part": name, "us_a_ray": each * 1e6, "seconds": whole, "steps": steps}));
    }
    let answer = Answer::text(text).with("rays", rays).with("ring_rays", rings);
    Ok(answer.with("threads", threads).with("estimated_from", tried).with("parts", parts))
}

/// The costs of some rays, and how many these are: fewer where rays are slow.
fn trial(raster: &Raster) -> Result<(Meter, usize), Error> {
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

//! Times a scene with each effect off and on, alone and together, and a disc without effects against
//! a loop that knows none, and writes docs/measurements/effects.md.

mod off;

use anyhow::Context;
use kerrlight_render::scene::{Scene, apply_override};
use kerrlight_render::transport::{PreparedScene, RayResult, Scratch};
use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;
use std::time::Instant;

/// Scene that is timed: a disc, gas, a hot spot and stars.
const SCENE: &str = include_str!("scene.toml");

/// The text around the table.
const PAGE: &str = include_str!("page.md");

/// An effect: its name and the changes that switch it on.
struct Effect {
    name: &'static str,
    on: &'static [&'static str],
}

/// The order matters: polarization needs the redshift.
const EFFECTS: [Effect; 8] = [
    Effect { name: "lensing", on: &["effects.lensing=true"] },
    Effect { name: "redshift", on: &["effects.redshift=true"] },
    Effect { name: "slow light", on: &["effects.slow_light=true"] },
    Effect { name: "absorption", on: &["effects.absorption=true"] },
    Effect {
        name: "plunging matter",
        on: &["disc.plunging.intensity=1.0", "disc.plunging.exponent=1.0"],
    },
    Effect { name: "first half-orbit only", on: &["effects.half_orbits=1"] },
    Effect { name: "ray bundles", on: &["effects.ray_bundles=true"] },
    Effect {
        name: "polarization",
        on: &[
            "effects.polarization=true",
            "magnetic_field.vertical=1.0",
            "magnetic_field.radial=0.0",
            "magnetic_field.toroidal=0.0",
        ],
    },
];

/// Pixels a side.
const SIDE: usize = 64;

/// Runs of which the fastest counts.
const RUNS: usize = 5;

fn main() -> anyhow::Result<()> {
    let [library, plain] = off::compare()?;
    let mut table = String::new();
    let off = time(&[])?;
    writeln!(table, "| none, lensing apart | {off:.2} | | |")?;
    let everything: Vec<usize> = (0..EFFECTS.len()).collect();
    let all = time(&everything)?;
    for (k, effect) in EFFECTS.iter().enumerate().skip(1) {
        let needed: &[usize] = if effect.name == "polarization" { &[1, k] } else { &[k] };
        let alone = time(needed)?;
        let without: Vec<usize> = everything
            .iter()
            .copied()
            // What needs it goes with it.
            .filter(|j| *j != k && !(k == 1 && EFFECTS[*j].name == "polarization"))
            .collect();
        let others = time(&without)?;
        let dearer = 100.0 * (alone / off - 1.0);
        writeln!(table, "| {} | {alone:.2} | {dearer:+.0} % | {others:.2} |", effect.name)?;
    }
    writeln!(table, "| all of them | {all:.2} | {:+.0} % | |", 100.0 * (all / off - 1.0))?;
    let straight = straight()?;
    writeln!(table, "| no lensing, no spot | {straight:.2} | | |")?;
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/measurements");
    let mut file = tempfile::NamedTempFile::new_in(&folder).context("docs/measurements")?;
    let dearer = 100.0 * (library / plain - 1.0);
    let off = format!("{library:.3} µs against {plain:.3} µs per ray ({dearer:+.1} %)");
    let page = PAGE.replace("TABLE\n", &table).replace("OFF", &off);
    file.write_all(page.as_bytes())?;
    file.persist(folder.join("effects.md"))?;
    print!("{table}\noff: {off}\n");
    Ok(())
}

/// Straight rays see no spots.
fn straight() -> anyhow::Result<f64> {
    let text = SCENE.split("[[spot]]").next().unwrap_or_default();
    seconds(&Scene::parse(&apply_override(text, "effects.lensing=false")?)?)
}

/// Microseconds a ray with these effects on.
fn time(on: &[usize]) -> anyhow::Result<f64> {
    let changes = on.iter().flat_map(|k| EFFECTS[*k].on);
    let mut text = SCENE.to_owned();
    for change in changes {
        text = apply_override(&text, change)?;
    }
    seconds(&Scene::parse(&text)?)
}

/// Microseconds a ray of the fastest of several runs, on one thread.
fn seconds(scene: &Scene) -> anyhow::Result<f64> {
    let prepared = PreparedScene::new(scene, None)?;
    let size = scene.pixel_size();
    let place = |k: usize| (k as f64 + 0.5 - 0.5 * SIDE as f64) * size;
    let points = (0..SIDE * SIDE).map(|k| (place(k % SIDE), -place(k / SIDE)));
    let (alpha, beta): (Vec<f64>, Vec<f64>) = points.unzip();
    let mut scratch = Scratch::default();
    let mut seen = vec![RayResult::default(); alpha.len()];
    let mut least = f64::INFINITY;
    for _ in 0..RUNS {
        let start = Instant::now();
        prepared.observe_block(&alpha, &beta, &[prepared.time()], &mut scratch, &mut seen)?;
        least = least.min(start.elapsed().as_secs_f64());
    }
    Ok(least / alpha.len() as f64 * 1e6)
}

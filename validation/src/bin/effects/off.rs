//! Cost of effects that are off: rays of a disc through the library, which has every effect, and
//! through a loop over the same traced rays that knows none.

use kerrlight_geodesic::simd::Crossings;
use kerrlight_geodesic::{Inclination, Kerr, Observer, Outcome};
use kerrlight_render::emission::disc::DiscModel;
use kerrlight_render::scene::Scene;
use kerrlight_render::transport::{PreparedScene, RayResult, Scratch};
use std::time::Instant;

/// An opaque disc and nothing else.
const SCENE: &str = include_str!("disc.toml");

/// Rays of a block, as in a picture.
const BLOCK: usize = 1024;

/// Crossings that the library asks for.
const CROSSINGS: usize = 4;

/// Light of a ray where there are no effects.
#[derive(Debug, Clone, Copy)]
struct Seen {
    intensity: f64,
    rgb: [f32; 3],
    crossings: u32,
    /// Crossings that are on the disc.
    images: u32,
    radius: f64,
    azimuth: f64,
    delay: f64,
    outcome: Outcome,
}

/// Both ways to the same picture.
pub struct Off {
    prepared: PreparedScene,
    scratch: Scratch,
    results: Vec<RayResult>,
    observer: Observer,
    hole: Kerr,
    disc: DiscModel,
    color: [f32; 3],
    crossings: Crossings,
    seen: Vec<Seen>,
    alpha: Vec<f64>,
    beta: Vec<f64>,
}

impl Off {
    pub fn new() -> anyhow::Result<Self> {
        let scene = Scene::parse(SCENE)?;
        let (side, size) = (scene.screen.width as usize, scene.pixel_size());
        let place = |k: usize| (k as f64 + 0.5 - 0.5 * side as f64) * size;
        let points = (0..side * side).map(|k| (place(k % side), -place(k / side)));
        let (alpha, beta): (Vec<f64>, Vec<f64>) = points.unzip();
        let hole = Kerr::new(scene.hole.spin)?;
        let disc = scene.disc.as_ref().ok_or_else(|| anyhow::anyhow!("a disc"))?;
        let inclination = Inclination::from_degrees(scene.observer.inclination_deg)?;
        Ok(Off {
            prepared: PreparedScene::new(&scene, None)?,
            scratch: Scratch::default(),
            results: vec![RayResult::default(); alpha.len()],
            observer: Observer::at_infinity(inclination),
            hole,
            disc: DiscModel::new(disc, &hole),
            color: disc.color,
            crossings: Crossings::default(),
            seen: Vec::with_capacity(alpha.len()),
            alpha,
            beta,
        })
    }

    /// Number of rays.
    pub fn rays(&self) -> usize {
        self.alpha.len()
    }

    /// Traces with the library.
    pub fn library(&mut self) -> anyhow::Result<()> {
        let rays = self.alpha.chunks(BLOCK).zip(self.beta.chunks(BLOCK));
        for ((alpha, beta), seen) in rays.zip(self.results.chunks_mut(BLOCK)) {
            let times = [self.prepared.time()];
            self.prepared.observe_block(alpha, beta, &times, &mut self.scratch, seen)?;
        }
        Ok(())
    }

    /// Traces with a loop that knows no effects.
    pub fn plain_loop(&mut self) -> anyhow::Result<()> {
        self.seen.clear();
        for (alpha, beta) in self.alpha.chunks(BLOCK).zip(self.beta.chunks(BLOCK)) {
            self.crossings.trace(&self.hole, &self.observer, alpha, beta, CROSSINGS)?;
            for k in 0..alpha.len() {
                let seen = self.along(k);
                self.seen.push(seen);
            }
        }
        Ok(())
    }

    fn along(&self, k: usize) -> Seen {
        let ends = self.crossings.ends(k);
        let mut seen = Seen {
            intensity: 0.0,
            rgb: [0.0; 3],
            crossings: ends.crossings,
            images: 0,
            radius: 0.0,
            azimuth: 0.0,
            delay: 0.0,
            outcome: if ends.escapes { Outcome::Escaped } else { Outcome::Captured },
        };
        for (number, crossing) in self.crossings.ray(k).enumerate() {
            if self.disc.covers(crossing.radius) {
                seen.intensity = self.disc.intensity(crossing.radius);
                seen.rgb = self.color.map(|tint| tint * seen.intensity as f32);
                seen.images = 1 << number;
                seen.radius = crossing.radius;
                let turns = (crossing.azimuth / std::f64::consts::TAU).round();
                seen.azimuth = crossing.azimuth - std::f64::consts::TAU * turns;
                seen.delay = crossing.delay;
                seen.outcome = Outcome::Surface;
                return seen;
            }
        }
        // As in the library, such a ray would have to be traced by steps.
        if self.crossings.ray(k).count() < ends.crossings as usize || ends.error.is_nan() {
            seen.outcome = Outcome::default();
        }
        seen
    }

    /// Returns whether both see the same.
    pub fn agree(&self) -> bool {
        let same = |(seen, result): (&Seen, &RayResult)| {
            let unmet = seen.outcome.is_unresolved();
            let light = seen.intensity == result.intensity && seen.rgb == result.rgb;
            let place = [seen.radius, seen.azimuth, seen.delay];
            let place = place == [result.radius, result.azimuth, result.delay];
            let rest = seen.crossings == result.crossings && seen.images == result.disc_images;
            unmet || (light && place && rest && seen.outcome == result.outcome)
        };
        let unmet = self.seen.iter().filter(|seen| seen.outcome.is_unresolved()).count();
        unmet * 1000 < self.seen.len() && self.seen.iter().zip(&self.results).all(same)
    }
}

/// Microseconds a ray with the library and with the loop: the fastest of many runs, in turns.
///
/// # Errors
/// If they do not see the same.
pub fn compare() -> anyhow::Result<[f64; 2]> {
    const RUNS: usize = 200;
    let mut off = Off::new()?;
    let mut least = [f64::INFINITY; 2];
    for _ in 0..RUNS {
        let start = Instant::now();
        off.library()?;
        least[0] = least[0].min(start.elapsed().as_secs_f64());
        let start = Instant::now();
        off.plain_loop()?;
        least[1] = least[1].min(start.elapsed().as_secs_f64());
    }
    anyhow::ensure!(off.agree(), "the library and the loop do not see the same");
    Ok(least.map(|seconds| seconds / off.rays() as f64 * 1e6))
}

//! The tracer for graphics cards: WGSL source of a ray's fate, crossings, samples and direction of escape, and the
//! bytes of its uniform. Text and numbers alone, for whatever runs shaders: wgpu, Bevy, a browser's WebGPU, or Unity
//! and Godot through a translator such as naga. `gpu` (feature `wgpu`) runs it.
//!
//! [`library`] has the functions without bindings or entry points, all named `kerr_…`, to be put before your own
//! shader:
//!
//! ```wgsl
//! var walk: KerrWalk;
//! var series: KerrSeries;
//! let photon = kerr_on_screen(hole, place, vec2<f32>(alpha, 0.0), vec2<f32>(beta, 0.0));
//! let ray = kerr_begin(hole, place, photon, &walk); // ray.outcome and ray.flags are known here
//! for (var i = 0u; i < KERR_MOST_STEPS; i++) {
//!     kerr_expand(ray, walk, true, &series);        // a polynomial that holds for the next series.h
//!     var x = 0.0;
//!     let done = kerr_ends(ray, walk, &series, &x);
//!     let point = kerr_point(hole, ray, walk, &series, 0.5 * x); // anywhere in the step
//!     if done { break; }
//!     kerr_advance(hole, ray, &walk, &series, x);
//! }
//! ```
//!
//! [`program`] adds bindings and the kernels `kerr_trace` and `kerr_sample`, one invocation a ray; [`places`] adds
//! `kerr_place`, which finds where rays are at given Mino times; [`paths`] adds `kerr_path`, which gives the series of every
//! step.
//!
//! # Numbers
//! Coordinates, constants and outcomes are those of the rest of the crate. Floats are enough for a ray but for two
//! numbers: the minimum of W(w), whose sign decides the fate, and the constants of motion that it is made of. Those are
//! sums of two floats. Compilers may reorder sums, which would undo them; a zero that is read from the uniform at run
//! time (`veil`) keeps them from it. Points of the picture are sums of two floats as well, so that a deep zoom keeps its
//! digits; leave the second at 0 if you have none. `KERR_NEAR_CRITICAL` and the other flags mark the rays whose answer
//! floats cannot vouch for: trace them again in doubles, or draw them as they are.
//!
//! # Layout
//! All structures keep their offsets in std140 (uniform) and std430 (storage). `KerrTask`, 224 bytes, from
//! [`Task::bytes`]:
//!
//! | offset | type | name | meaning |
//! |---|---|---|---|
//! | 0 | 2 × f32 | `hole.spin` | a, as the sum of two floats |
//! | 8 | 2 × f32 | `hole.horizon` | 1/r₊, as the sum of two |
//! | 16 | f32 | `hole.outer` | r₊ |
//! | 20 | f32 | `hole.inner` | r₋ |
//! | 24 | f32 | `hole.gap` | r₊ − r₋ |
//! | 28 | u32 | `hole.veil` | 0 |
//! | 32 | 2 × f32 | `place.sin_i` | sin i, as the sum of two |
//! | 40 | 2 × f32 | `place.cos_i` | cos i, as the sum of two |
//! | 48 | 2 × f32 | `place.inverse_radius` | 1/r of the observer, as the sum of two; 0 at infinity |
//! | 56 | f32 | `place.end` | 1/r at which rays that escape end |
//! | 60 | f32 | `place.azimuth` | azimuth of the observer, radians |
//! | 64 | 4 × 4 f32 | `lens.high` | a camera's lens by rows; 0 for a screen |
//! | 128 | 4 × 4 f32 | `lens.low` | what the first floats leave of it |
//! | 192 | u32 | `rays` | number of rays |
//! | 196 | u32 | `crossings` | room for crossings, per ray |
//! | 200 | u32 | `samples` | samples per ray |
//! | 204 | u32 | `camera` | 1: points are (x, y) of the lens; 0: (α, β) |
//! | 208 | u32 | `row` | invocations in a row of the grid |
//! | 212 | u32 | `quadratures` | 1: azimuths, delays and directions of escape are wanted |
//! | 216 | f32 | `sphere` | 1/r of a sphere: when rays enter and leave it is wanted; 0 for none |
//! | 220 | 4 bytes | | unused |
//!
//! Bindings of group 0:
//!
//! | binding | what | element |
//! |---|---|---|
//! | 0 | uniform | `KerrTask` |
//! | 1 | storage, read | 4 × f32 a ray: x, y (or α, β in M), and what the first floats leave of each |
//! | 2 | storage | `KerrEnd`, 64 bytes a ray |
//! | 3 | storage | `KerrCrossing`, 32 bytes, `crossings` of them a ray |
//! | 4 | storage | 4 × f32 a sample: r in M, θ, φ in radians, delay in M; `samples` of them a ray |
//!
//! In [`places`], bindings 2 to 4 are the first time of each ray and their number (2 × u32), the Mino times (f32, ascending
//! along each ray), and `KerrNode`, 32 bytes a time: 1/r, cos θ, φ, delay, dw/dτ, d cos θ/dτ (f32 at 0, 4, … 20).
//!
//! In [`paths`], bindings 2 and 3 are the first step of each ray and room for how many (2 × u32), and the steps, 72 × f32
//! each: length in bτ, leg (+1 inwards, −1 outwards), b w₀ of the ray, b, 1 for its last step, one unused, then 11
//! coefficients each of b/r − b w₀, cos θ, sin θ cos φ, sin θ sin φ, and the regular parts of azimuth and delay/b.
//!
//! `KerrEnd`: direction of escape (3 × f32 at 0), outcome (u32 at 12: 0 captured, 1 escaped, 3 lost), flags (u32 at 16),
//! number of crossings (u32 at 20), Mino time of the whole ray (f32 at 24), estimated error (f32 at 28: relative in r,
//! radians in φ), λ and η (f32 at 32 and 36), steps (u32 at 40), Mino times of the
//! turning point, of entry into the sphere and of leaving it (f32 at 44, 48, 52, negative if there is none; 8 bytes
//! unused). `KerrCrossing`: r, φ, Mino time, delay, dw/dτ, d cos θ/dτ
//! and the estimated
//! error of that ray (f32 at 0, 4, … 24; 4 bytes unused). Delays lack the tortoise coordinate of the observer, r* = r + 2 ln r + …, which
//! [`Task::delay_start`] has in doubles.

use crate::screen::view::View;
use crate::spacetime::kerr::Kerr;

/// Sums of two floats.
pub const TWO_FLOATS: &str = include_str!("two_floats.wgsl");

/// Elementary functions to the last digits of a float.
pub const FUNCTIONS: &str = include_str!("functions.wgsl");

/// Holes, views, photons, and the fate of their rays.
pub const PHOTONS: &str = include_str!("photons.wgsl");

/// Rays under way, step by step.
pub const STEPS: &str = include_str!("steps.wgsl");

/// The uniform and the points.
pub const TASK: &str = include_str!("task.wgsl");

/// The kernels of whole rays.
pub const RAYS: &str = include_str!("rays.wgsl");

/// The kernel of places on rays.
pub const NODES: &str = include_str!("nodes.wgsl");

/// The kernel of whole rays as the series of their steps.
pub const PATHS: &str = include_str!("paths.wgsl");

/// Flags of a ray: what of it cannot be trusted. The numbers are those of the shader.
pub mod flags {
    /// W is 0 at its minimum within rounding: the ray circles on a photon orbit.
    pub const NEAR_CRITICAL: u32 = 1;
    /// The ray leaves the observer at its turning point.
    pub const GRAZING: u32 = 2;
    /// The steps that a ray may have were not enough.
    pub const OUT_OF_STEPS: u32 = 4;
    /// No photon arrives there.
    pub const NO_PHOTON: u32 = 8;
    /// There are more crossings than there is room for; those that are there are right.
    pub const MORE_CROSSINGS: u32 = 16;
}

/// Bytes of the uniform, of a point, of `KerrEnd`, of `KerrCrossing` and of a sample.
pub const TASK_BYTES: usize = 224;
/// Bytes of a point.
pub const POINT_BYTES: usize = 16;
/// Bytes of `KerrEnd`.
pub const END_BYTES: usize = 64;
/// Bytes of `KerrCrossing`.
pub const CROSSING_BYTES: usize = 32;
/// Bytes of `KerrNode`.
pub const NODE_BYTES: usize = 32;
/// Bytes of a step of a path.
pub const STEP_BYTES: usize = 288;
/// Bytes of a sample.
pub const SAMPLE_BYTES: usize = 16;

/// The tracer without bindings and entry points.
pub fn library() -> String {
    [TWO_FLOATS, FUNCTIONS, PHOTONS, STEPS].join("\n")
}

/// The tracer with bindings and the kernels `kerr_trace` and `kerr_sample`, workgroups of 64.
pub fn program() -> String {
    [TWO_FLOATS, FUNCTIONS, PHOTONS, STEPS, TASK, RAYS].join("\n")
}

/// The tracer with bindings and the kernel `kerr_place`, workgroups of 64.
pub fn places() -> String {
    [TWO_FLOATS, FUNCTIONS, PHOTONS, STEPS, TASK, NODES].join("\n")
}

/// The tracer with bindings and the kernel `kerr_path`, workgroups of 64.
pub fn paths() -> String {
    [TWO_FLOATS, FUNCTIONS, PHOTONS, STEPS, TASK, PATHS].join("\n")
}

/// `x` as the sum of two floats.
pub fn two_floats(x: f64) -> [f32; 2] {
    let high = x as f32;
    [high, (x - f64::from(high)) as f32]
}

/// Task of the kernels, as their uniform holds it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Task {
    /// The hole.
    pub hole: Kerr,
    /// The screen or camera.
    pub view: View,
    /// Number of rays.
    pub rays: u32,
    /// Room for crossings, per ray.
    pub crossings: u32,
    /// Samples of each ray.
    pub samples: u32,
    /// Invocations in a row of the grid: a multiple of 64.
    pub row: u32,
    /// True if azimuths, delays and directions of escape are wanted.
    pub quadratures: bool,
    /// 1/r in M⁻¹ at which rays that escape end: 0 for infinity.
    pub end: f64,
    /// 1/r in M⁻¹ of a sphere that rays enter and leave; 0 for none.
    pub sphere: f64,
}

impl Task {
    /// A task of no rays yet, and of all quantities: to be completed by its other fields.
    pub fn new(hole: Kerr, view: View) -> Self {
        Task {
            hole,
            view,
            rays: 0,
            crossings: 0,
            samples: 0,
            row: 0,
            quadratures: true,
            end: 0.0,
            sphere: 0.0,
        }
    }

    /// The bytes of the uniform.
    pub fn bytes(&self) -> [u8; TASK_BYTES] {
        let Task { hole, view, .. } = self;
        let wide = |x: f64| two_floats(x).map(f32::to_bits);
        let (inclination, azimuth, lens) = match view {
            View::Screen(observer) => (observer.inclination(), observer.azimuth(), [[0.0; 4]; 4]),
            View::Camera(camera) => (camera.inclination(), camera.azimuth(), camera.lens()),
        };
        let mut words = Vec::with_capacity(TASK_BYTES / 4);
        words.extend([hole.spin(), 1.0 / hole.horizon()].into_iter().flat_map(wide));
        let radii = [hole.horizon(), hole.inner_horizon(), hole.horizon_gap()];
        words.extend(radii.map(|radius| (radius as f32).to_bits()));
        words.push(0);
        let place = [inclination.sin(), inclination.cos(), self.inverse_radius()];
        words.extend(place.into_iter().flat_map(wide));
        words.extend([self.end as f32, azimuth as f32].map(f32::to_bits));
        for part in 0..2 {
            words.extend(lens.iter().flatten().map(|x| wide(*x)[part]));
        }
        words.extend([self.rays, self.crossings, self.samples]);
        words.push(u32::from(view.observer().is_none()));
        words.extend([self.row, u32::from(self.quadratures)]);
        words.extend([(self.sphere as f32).to_bits(), 0]);
        let mut bytes = [0; TASK_BYTES];
        for (place, word) in bytes.chunks_exact_mut(4).zip(words) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        bytes
    }

    fn inverse_radius(&self) -> f64 {
        match &self.view {
            View::Screen(observer) => observer.inverse_radius(),
            View::Camera(camera) => 1.0 / camera.radius(),
        }
    }

    /// Offset of a delay of the shader, in M: the tortoise coordinate of the observer, 0 at infinity.
    pub fn delay_start(&self) -> f64 {
        let w = self.inverse_radius();
        if w > 0.0 { self.hole.tortoise(w) } else { 0.0 }
    }
}

/// The bytes of points (`x[k]`, `y[k]`): (α, β) in M of a screen, or places in a camera's picture plane.
pub fn point_bytes(x: &[f64], y: &[f64]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(x.len() * POINT_BYTES);
    for (x, y) in x.iter().zip(y) {
        let ([x, x_low], [y, y_low]) = (two_floats(*x), two_floats(*y));
        bytes.extend([x, y, x_low, y_low].into_iter().flat_map(f32::to_le_bytes));
    }
    bytes
}

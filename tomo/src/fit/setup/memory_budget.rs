//! The least memory that a fit runs in, estimated before anything is traced: what is known to be too little is refused
//! with the number that is enough.

use super::learning::of_matter;
use super::preview_image::AT_A_TIME;
use super::{Instrument, Result, motion};
use crate::fit::ForwardModel;
use crate::fit::forward::fall::Fall;
use crate::fit::forward::shift::Shift;
use crate::fit::forward::stokes::Planes;
use crate::fit::settings::{FitFile, Kind, LossKind, Start};
use crate::representation::Registry;
use crate::representation::spline::STENCIL;
use kerrlight_common::memory::{self, TooLarge, shown};
use kerrlight_common::simd::Float;

/// Nodes of a ray of the still image, about: most of its rays are those of the photon ring.
const STILL_NODES: usize = 48;
/// Bytes of a node of a frame on its way through the model: place, time, weight, value and slopes.
const OF_BATCH: f64 = 64.0;
/// Bytes of a node of a linear problem: numbers of its steps in double precision, and gradients of pieces.
const OF_LINEAR: f64 = 512.0;
/// Memory beside all of this: the page, pictures, files that are read, blocks of threads.
const OTHERS: f64 = 32.0 * 1048576.0;
/// Shares of the limit for movies, one that is seen and one that is found, and for rows and slopes of linear problems: as
/// much as they need, up to that.
const MOVIE: f64 = 1.0 / 8.0;
const LINEAR: [f64; 2] = [1.0 / 4.0, 1.0 / 16.0];

/// A part of what is held, and what decides its size.
struct Part {
    what: String,
    bytes: f64,
}

/// Refuses a limit that is less than what the fit holds at once, all parts together. What is wrong with the settings
/// themselves is told elsewhere.
///
/// # Errors
/// Says what takes most of it, the setting that decides that, and the least limit that is enough.
pub fn check_memory_budget(file: &FitFile, registry: &Registry) -> Result<()> {
    let limit = memory::limit();
    let Ok(Some((parts, least))) = estimate(file, registry) else { return Ok(()) };
    let most = parts.into_iter().max_by(|a, b| a.bytes.total_cmp(&b.bytes));
    let Some(most) = most.filter(|_| least > limit as f64) else { return Ok(()) };
    let what = format!("the fit, {} of it {},", shown(most.bytes), most.what);
    // What is said with one digit behind the point is still enough.
    Err(TooLarge { what, needed: 1.01 * least, limit }.into())
}

/// Parts of what is held, and the least limit.
fn estimate(file: &FitFile, registry: &Registry) -> Result<Option<([Part; 3], f64)>> {
    let Some((few, of_all)) = Instrument::trial(file)? else { return Ok(None) };
    let parts = [nodes(file, &few, of_all)?, parameters(file, registry)?, volumes(file)];
    let fixed = parts.iter().map(|part| part.bytes).sum::<f64>() + OTHERS;
    let least = least(fixed, &shares(file, few.lines.points() as f64 * of_all));
    Ok(Some((parts, least)))
}

/// The least limit that leaves `fixed` bytes beside parts that take what they need, but no more than a share of the limit:
/// bytes and share of each.
fn least(fixed: f64, parts: &[[f64; 2]]) -> f64 {
    let [mut low, mut high] = [fixed, fixed];
    let taken = |limit: f64| {
        fixed + parts.iter().map(|[bytes, share]| bytes.min(share * limit)).sum::<f64>()
    };
    // All shares together are less than 1: some limit is enough.
    while taken(high) > high {
        high *= 2.0;
    }
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if taken(middle) > middle { low = middle } else { high = middle }
    }
    high
}

/// Rays with all models of them that are held at once.
fn nodes(file: &FitFile, few: &Instrument, of_all: f64) -> Result<Part> {
    let motion = motion(file, vec![file.motion.reference_time])?;
    let lines = few.lines.bytes() as f64;
    let (seen, simulated) =
        (bytes_of(&few.forward::<f32>(&motion)?), bytes_of(&few.pictured::<f64>(&motion)?));
    let images = file.loss.iter().all(|loss| loss.data == LossKind::Image);
    let models = if images { seen } else { 2 * seen };
    let simulated = if file.simulation.is_some() { simulated } else { 0 };
    // While they are traced, columns grow by doubling.
    let points = few.lines.points() as f64;
    let each = (lines + models.max(simulated) as f64 + OF_BATCH * points).max(2.0 * lines);
    let (count, pixels) = (points * of_all, file.screen.pixels);
    let still = each / points * (AT_A_TIME * STILL_NODES) as f64;
    let what = format!("for about {count:.0} nodes on rays (screen.pixels = {pixels})");
    Ok(Part { what, bytes: each * of_all + still })
}

/// Bytes of a model's nodes.
fn bytes_of<T: Float>(model: &ForwardModel<T>) -> usize {
    let singles = [&model.rate, &model.phase, &model.delay, &model.weight];
    let columns = model.position.iter().chain(singles).map(|column| size_of_val(&**column));
    // Weights for no axis, and factors of the redshift.
    let doubles = [&model.plain_weight, &model.factors].map(|column| size_of_val(&**column));
    let shift = model.shift.as_ref().map_or(0, Shift::bytes);
    let fall = model.fall.as_ref().map_or(0, Fall::bytes);
    let planes = model.planes.as_ref().map_or(0, Planes::bytes);
    columns.chain(doubles).sum::<usize>() + shift + fall + planes
}

/// The representation, and grids of linear problems.
fn parameters(file: &FitFile, registry: &Registry) -> Result<Part> {
    let count = of_matter(file, registry)?.parameters();
    let (start, of_start) = match file.training.start {
        Start::Linear { nodes, .. } => {
            let from = format!(" and a start (training.start.linear.nodes = {nodes})");
            (OF_LINEAR * (nodes as f64).powi(3), from)
        }
        Start::Drawn => (0.0, String::new()),
    };
    let solved = file.representation.kind == Kind::LinearGrid;
    let grid = if solved { OF_LINEAR * count as f64 } else { 0.0 };
    let what = format!("for {count} parameters of the representation{of_start}");
    Ok(Part { what, bytes: memory::parameters(count as f64) + start.max(grid) })
}

fn volumes(file: &FitFile) -> Part {
    let nodes = file.output.nodes;
    let what = format!("for volumes (output.nodes = {nodes})");
    Part { what, bytes: memory::volume(nodes as f64) }
}

/// Bytes of what takes no more than a share of the limit, and that share, with so many nodes on rays.
fn shares(file: &FitFile, nodes: f64) -> Vec<[f64; 2]> {
    let pixels = (file.screen.pixels as f64).powi(2);
    let seen = file.observation().map(|observation| f64::from(observation.scans));
    let movie = file.simulation.as_ref().and_then(|simulation| simulation.movie.as_ref());
    // Of measured data it is not known yet: they take what they are given.
    let frames = seen.or(movie.map(|movie| movie.frames as f64)).unwrap_or(f64::INFINITY);
    let stride = match (&file.representation.kind, file.training.start) {
        (Kind::LinearGrid, _) => Some(1.0),
        (_, Start::Linear { stride, .. }) => Some(stride.max(1) as f64),
        (_, Start::Drawn) => None,
    };
    // The data in double precision, what is found in single.
    let movies = if frames.is_finite() { [8.0, 4.0] } else { [0.0; 2] };
    let movies =
        movies.map(|bytes| [if bytes > 0.0 { bytes * frames * pixels } else { 0.0 }, MOVIE]);
    let linear = stride.map(|stride| {
        // A number and its column for each node of the grid about a node of a ray.
        let of_frame = [(size_of::<f32>() + 4) as f64 * STENCIL as f64 * nodes, 4.0 * pixels];
        [0, 1].map(|k| [of_frame[k] * frames / stride, LINEAR[k]])
    });
    movies.into_iter().chain(linear.into_iter().flatten()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_least_limits() {
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-9;
        assert!(near(least(100.0, &[]), 100.0));
        // All of what is wanted fits into its share.
        assert!(near(least(100.0, &[[10.0, 0.125]]), 110.0));
        // It does not: 100 + L/8 = L.
        assert!(near(least(100.0, &[[1e9, 0.125]]), 800.0 / 7.0));
        assert!(near(least(100.0, &[[1e9, 0.125], [f64::INFINITY, 0.25], [5.0, 0.125]]), 168.0));
    }
}

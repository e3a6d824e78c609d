//! The affine parameter along rays, for samples equidistant in Mino time.

use crate::call::{detached, refused};
use crate::rays::Place;
use kerrlight_geodesic::quadrature::gauss_legendre;
use kerrlight_geodesic::{Error, Kerr, Observer, Path, Quantities, Tracer, interrupt};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use rayon::prelude::*;

/// Adds the functions of this module.
pub fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(path_lengths, module)?)
}

/// Nodes between two samples.
const NODES: usize = 16;

/// ∫Σ dτ (M) from the observer to each of `samples` points equidistant in Mino time, from the observer to the end of
/// each ray; ray after ray. Needs an observer at a finite radius. NaN for unresolved rays.
#[pyfunction]
fn path_lengths<'py>(
    py: Python<'py>,
    spin: f64,
    place: Place,
    screen: (PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, f64>),
    samples: usize,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (hole, observer) = (Kerr::new(spin).map_err(refused)?, place.observer()?);
    let (alpha, beta) = (screen.0.as_slice()?, screen.1.as_slice()?);
    if alpha.len() != beta.len() {
        return Err(refused(format!("{} of beta for {} of alpha", beta.len(), alpha.len())));
    }
    let work = || along(&hole, &observer, alpha, beta, samples);
    Ok(detached(py, work)?.into_pyarray(py))
}

fn along(
    hole: &Kerr,
    observer: &Observer,
    alpha: &[f64],
    beta: &[f64],
    samples: usize,
) -> Result<Vec<f64>, Error> {
    let (tracer, rule) = (Tracer::new(1e-12)?, gauss_legendre(NODES));
    let mut lengths = vec![f64::NAN; alpha.len() * samples];
    let rows = lengths.par_chunks_mut(samples.max(1)).zip(alpha.par_iter().zip(beta));
    rows.try_for_each_init(Path::new, |path, (row, (alpha, beta))| {
        let ray = observer.ray(hole, *alpha, *beta)?;
        tracer.trace(hole, &ray, Quantities::POLAR, path);
        interrupt::check();
        if !path.outcome().is_unresolved() {
            fill(hole, path, observer.inverse_radius(), &rule, row);
        }
        Ok(())
    })?;
    Ok(lengths)
}

/// Lengths of one ray. Far out r is 1/(τ + 1/r_o) on the way in, and the like on the way out: in the logarithm of that
/// the density is smooth, however far the observer.
fn fill(hole: &Kerr, path: &Path, near: f64, rule: &[(f64, f64)], row: &mut [f64]) {
    let turning = path.turning_point();
    let total = turning.map_or(path.mino_total(), |(time, _)| 2.0 * time);
    let step = total / (row.len().max(2) - 1) as f64;
    let density = |time: f64| {
        let point = path.at(time);
        hole.sigma(point.radius(), point.cos_theta())
    };
    let mut sum = 0.0;
    for (k, length) in row.iter_mut().enumerate() {
        let (from, to) = (step * k.saturating_sub(1) as f64, step * k as f64);
        let mirrored = turning.is_some() && from + to > total;
        let [start, end] = [from, to].map(|t| near + if mirrored { total - t } else { t });
        let span = (end / start).ln();
        let piece = rule.iter().map(|(x, weight)| {
            let clock = start * (span * x).exp();
            let time = if mirrored { total - (clock - near) } else { clock - near };
            weight * clock * density(time.clamp(0.0, total))
        });
        sum += piece.sum::<f64>() * span.abs();
        *length = sum;
    }
}

//! Points along rays that are equidistant in Mino time, as far as is wanted, and the affine parameter there.

use crate::call::detached;
use crate::rays::Place;
use crate::refusal::refused;
use kerrlight_geodesic::quadrature::gauss_legendre;
use kerrlight_geodesic::{Error, Kerr, Observer, Path, Quantities, Tracer, interrupt};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use rayon::prelude::*;

/// Nodes between two samples.
const NODES: usize = 16;

/// The points of a ray, equidistant in Mino time from the observer to a part of the whole ray.
#[derive(Clone, Copy, FromPyObject)]
pub struct Spacing(usize, f64);

impl Spacing {
    /// Mino time of a whole ray, and that between two points.
    fn of(self, path: &Path) -> (f64, f64) {
        let total = path.turning_point().map_or(path.mino_total(), |(time, _)| 2.0 * time);
        (total, self.1 * total / (self.0.max(2) - 1) as f64)
    }
}

/// ∫Σ dτ (M) from the observer to each point; ray after ray. Needs an observer at a finite radius. NaN for unresolved rays.
#[pyfunction]
pub fn path_lengths<'py>(
    py: Python<'py>,
    spin: f64,
    place: Place,
    screen: (PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, f64>),
    spacing: Spacing,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let rule = gauss_legendre(NODES);
    let fill = |hole: &Kerr, observer: &Observer, path: &Path, row: &mut [f64]| {
        fill(hole, path, spacing, observer.inverse_radius(), &rule, row);
    };
    let rays = Rays { spin, place, quantities: Quantities::POLAR, width: spacing.0 };
    rays.each(py, screen, fill)
}

/// Mino time (1/M), radius (M), polar angle, azimuth (radians) and delay (M) of each point, one after the other. NaN for
/// unresolved rays.
#[pyfunction]
pub fn path_points<'py>(
    py: Python<'py>,
    spin: f64,
    place: Place,
    screen: (PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, f64>),
    spacing: Spacing,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let fill = |_: &Kerr, _: &Observer, path: &Path, row: &mut [f64]| {
        let (total, step) = spacing.of(path);
        for (k, numbers) in row.chunks_exact_mut(5).enumerate() {
            let time = (step * k as f64).min(total);
            let at = path.at(time);
            numbers.copy_from_slice(&[time, at.radius(), at.theta(), at.azimuth, at.delay]);
        }
    };
    let rays = Rays { spin, place, quantities: Quantities::ALL, width: 5 * spacing.0 };
    rays.each(py, screen, fill)
}

/// Rays of one observer, and how many numbers are wanted of each.
struct Rays {
    spin: f64,
    place: Place,
    quantities: Quantities,
    width: usize,
}

impl Rays {
    fn each<'py>(
        self,
        py: Python<'py>,
        screen: (PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, f64>),
        fill: impl Fn(&Kerr, &Observer, &Path, &mut [f64]) + Sync,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (hole, observer) = (Kerr::new(self.spin).map_err(refused)?, self.place.observer()?);
        let (alpha, beta) = (screen.0.as_slice()?, screen.1.as_slice()?);
        if alpha.len() != beta.len() {
            return Err(refused(format!("{} of beta for {} of alpha", beta.len(), alpha.len())));
        }
        let work = || -> Result<Vec<f64>, Error> {
            let tracer = Tracer::new(1e-12)?;
            let mut numbers = vec![f64::NAN; alpha.len() * self.width];
            let rows = numbers.par_chunks_mut(self.width.max(1)).zip(alpha.par_iter().zip(beta));
            rows.try_for_each_init(Path::new, |path, (row, (alpha, beta))| {
                interrupt::check();
                tracer.trace(&hole, &observer.ray(&hole, *alpha, *beta)?, self.quantities, path);
                if !path.outcome().is_unresolved() {
                    fill(&hole, &observer, path, row);
                }
                Ok(())
            })?;
            Ok(numbers)
        };
        Ok(detached(py, work)?.into_pyarray(py))
    }
}

/// Lengths of one ray. Far out r is 1/(τ + 1/r_o) on the way in, and the like on the way out: in the logarithm of that
/// the density is smooth, however far the observer.
fn fill(
    hole: &Kerr,
    path: &Path,
    spacing: Spacing,
    near: f64,
    rule: &[(f64, f64)],
    row: &mut [f64],
) {
    let (turning, (total, step)) = (path.turning_point(), spacing.of(path));
    let density = |time: f64| {
        let point = path.at(time);
        hole.sigma(point.radius(), point.cos_theta())
    };
    let mut sum = 0.0;
    for (k, length) in row.iter_mut().enumerate() {
        let (from, to) = (step * k.saturating_sub(1) as f64, step * k as f64);
        // On the way out the clock counts back from the end of the ray.
        let mirrored = turning.is_some() && from + to > total;
        let [start, end] = [from, to].map(|t| near + if mirrored { total - t } else { t });
        // ∫Σ dτ = ∫Σ · clock d ln(clock).
        let span = (end / start).ln();
        let piece = rule.iter().map(|(x, weight)| {
            let clock = start * (span * x).exp();
            let time = if mirrored { total - (clock - near) } else { clock - near };
            weight * clock * density(time.clamp(0.0, total))
        });
        // A clock that counts back has a negative span; lengths grow all the same.
        sum += piece.sum::<f64>() * span.abs();
        *length = sum;
    }
}

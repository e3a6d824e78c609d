//! Paths of rays that a device has followed.

use crate::integrate::assembly::{RaySteps, TaylorStep};
use crate::integrate::outcome::Outcome;
use crate::integrate::path::Path;
use crate::screen::observer::Ray;
use crate::spacetime::kerr::Kerr;
use core::ops::Range;

/// Rays that a device has followed to their ends, step by step; memory is reused.
#[derive(Debug, Default)]
pub struct DevicePaths {
    rays: Vec<Option<Followed>>,
    steps: Vec<TaylorStep>,
}

/// A ray, and which of the steps are its own.
#[derive(Debug)]
struct Followed {
    scale: f64,
    outcome: Outcome,
    error: f64,
    steps: Range<usize>,
}

impl DevicePaths {
    /// Forgets all rays.
    pub fn clear(&mut self) {
        self.rays.clear();
        self.steps.clear();
    }

    /// Takes the next ray, which ends at the horizon or at infinity: `scale` is b (see [`TaylorStep`]), `error` what
    /// [`DeviceEnd::error`](crate::DeviceEnd::error) is.
    pub fn push(
        &mut self,
        (scale, outcome, error): (f64, Outcome, f64),
        steps: impl Iterator<Item = TaylorStep>,
    ) {
        let first = self.steps.len();
        self.steps.extend(steps.filter(|step| step.length > 0.0));
        let steps = first..self.steps.len();
        let whole = !steps.is_empty() && !outcome.is_unresolved();
        self.rays.push(whole.then_some(Followed { scale, outcome, error, steps }));
    }

    /// Takes the next ray as one that the device does not vouch for.
    pub fn push_unknown(&mut self) {
        self.rays.push(None);
    }

    /// Returns the number of rays, those that the device does not vouch for among them.
    pub fn len(&self) -> usize {
        self.rays.len()
    }

    /// Returns whether there is none.
    pub fn is_empty(&self) -> bool {
        self.rays.is_empty()
    }

    /// Makes `path` that of ray number `k`, which is `ray`, with all quantities. Its estimated error, relative in radii and
    /// in radians; `None` where the device does not vouch for it, or there is no such ray: `path` is then as it was.
    pub fn assemble(&self, k: usize, hole: &Kerr, ray: &Ray, path: &mut Path) -> Option<f64> {
        let Followed { scale, outcome, error, steps } = self.rays.get(k)?.as_ref()?;
        let (steps, error) = (&self.steps[steps.clone()], *error);
        path.assemble(hole, ray, RaySteps { scale: *scale, outcome: *outcome, error, steps });
        Some(error)
    }
}

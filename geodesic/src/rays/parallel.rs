//! Many rays on all cores.

use crate::integrate::path::Path;
use crate::integrate::trace::Tracer;
use crate::interrupt;
use crate::screen::observer::Ray;
use crate::spacetime::kerr::Kerr;
use crate::spacetime::quantities::Quantities;
use rayon::prelude::*;

impl Tracer {
    /// Traces all `rays` and keeps of each what `keep` takes from its path, in the order of
    /// the rays. A ray depends on nothing but itself: neither the number of threads nor
    /// their order changes a bit of the result.
    ///
    /// ```
    /// use kerrlight_geodesic::{Inclination, Kerr, Observer, Outcome, Path, Tracer, Quantities};
    /// let hole = Kerr::new(0.0)?;
    /// let observer = Observer::at_infinity(Inclination::from_degrees(30.0)?);
    /// let rays = (0..100).map(|k| observer.ray(&hole, 0.1 * f64::from(k), 0.0));
    /// let rays = rays.collect::<Result<Vec<_>, _>>()?;
    /// let outcomes = Tracer::new(1e-8)?.map(&hole, &rays, Quantities::POLAR, Path::outcome);
    /// assert_eq!(outcomes.iter().filter(|o| **o == Outcome::Captured).count(), 52); // α < √27
    /// # Ok::<(), kerrlight_geodesic::Error>(())
    /// ```
    pub fn map<T: Send>(
        &self,
        hole: &Kerr,
        rays: &[Ray],
        quantities: Quantities,
        keep: impl Fn(&Path) -> T + Sync + Send,
    ) -> Vec<T> {
        rays.par_iter()
            .map_init(Path::new, |path, ray| {
                interrupt::check();
                self.trace(hole, ray, quantities, path);
                keep(path)
            })
            .collect()
    }
}

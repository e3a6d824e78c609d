//! Rays by their screen coordinates, and where on the screen something changes.

use kerrlight_geodesic::{Inclination, Kerr, Observer, Path, Quantities, Tracer};

/// The path of the ray (α, β) to an observer at infinity, at the tightest useful tolerance.
pub fn trace(spin: f64, degrees: f64, alpha: f64, beta: f64, want: Quantities) -> Path {
    let mut path = Path::new();
    let mut traced = || -> Result<(), kerrlight_geodesic::Error> {
        let hole = Kerr::new(spin)?;
        let observer = Observer::at_infinity(Inclination::from_degrees(degrees)?);
        let ray = observer.ray(&hole, alpha, beta)?;
        Tracer::new(1e-13)?.trace(&hole, &ray, want, &mut path);
        Ok(())
    };
    traced().expect("oracles ask for rays that exist");
    path
}

/// Bisects for where `holds` changes from true at `lo` to false at `hi`.
pub fn edge(mut lo: f64, mut hi: f64, holds: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..54 {
        let middle = 0.5 * (lo + hi);
        if holds(middle) { lo = middle } else { hi = middle }
    }
    0.5 * (lo + hi)
}

//! Tests of the crate's public interface, as one program: it links once.

mod capi;
mod derivatives;
mod footprint;
mod hard;
mod kerr_schild;
mod misuse;
mod nodes;
mod parallel_transport;
mod requests;

use kerrlight_geodesic::{Inclination, Observer};

fn inclination(degrees: f64) -> Inclination {
    Inclination::from_degrees(degrees).unwrap()
}

fn at_infinity(degrees: f64) -> Observer {
    Observer::at_infinity(inclination(degrees))
}

/// An observer at this radius (M), which may be infinite.
fn at_radius(degrees: f64, radius: f64) -> Observer {
    match radius {
        f64::INFINITY => at_infinity(degrees),
        _ => Observer::at_radius(inclination(degrees), radius).unwrap(),
    }
}

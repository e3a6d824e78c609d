//! Checks of sources whose values depend on each other: gas, discs, spots, meshes and the sky.

use super::invalid::{Invalid, number, positive, square_of_axis};
use super::{Disc, Gas, Mesh, Sky, Spot};
use kerrlight_geodesic::{Kerr, orbits};

pub(super) fn check_gas(gas: &Gas, hole: &Kerr) -> Result<(), Invalid> {
    positive("gas.scale_radius", gas.scale_radius)?;
    let (outer, least) = (gas.outer_radius, hole.horizon());
    let allowed = format!("a radius above the horizon's, {least:.6}");
    number("gas.outer_radius", outer, outer > least, &allowed)
}

pub(super) fn check_disc(disc: &Disc, hole: &Kerr) -> Result<(), Invalid> {
    let isco = orbits::isco(hole);
    if let Some(inner) = disc.inner_edge {
        let ok = inner.is_finite() && inner >= isco;
        let allowed = format!("a radius of at least the innermost stable orbit, {isco:.6}");
        number("disc.inner_edge", inner, ok, &allowed)?;
    }
    let inner = disc.inner_edge.unwrap_or(isco);
    let outer = disc.outer_edge;
    let allowed = format!("a radius above the inner edge, {inner:.6}");
    number("disc.outer_edge", outer, outer > inner, &allowed)?;
    if disc.plunging.is_some() { check_plunging(disc, isco) } else { Ok(()) }
}

fn check_plunging(disc: &Disc, isco: f64) -> Result<(), Invalid> {
    if let Some(inner) = disc.inner_edge {
        let allowed =
            format!("the innermost stable orbit, {isco}, or left out: `plunging` starts there");
        number("disc.inner_edge", inner, (inner / isco - 1.0).abs() < 1e-12, &allowed)?;
    }
    let (peak, allowed) = (disc.peak_intensity, "above 0 with `plunging` and `peak_temperature_k`");
    number("disc.peak_intensity", peak, peak > 0.0 || disc.peak_temperature_k.is_none(), allowed)
}

/// Differential rotation winds a spot up, and the work to follow it grows with the windings.
const LONGEST_SHEAR: f64 = 2000.0;

pub(super) fn check_spot(spot: &Spot, k: usize, hole: &Kerr, time: f64) -> Result<(), Invalid> {
    let key = |name: &str| format!("spot.{k}.{name}");
    let square = square_of_axis(key("axis"), spot.axis)?;
    // Matter about another axis meets the component of the spin along it.
    let along = Kerr::new(hole.spin() * spot.axis[2] / square.sqrt());
    let least = along.map_or(3.0, |hole| orbits::photon_orbit(&hole).max(3.0));
    let allowed = format!("a radius above {least:.4}, where circular orbits end");
    number(key("radius"), spot.radius, spot.radius > least, &allowed)?;
    number(key("sigma"), spot.sigma, spot.sigma <= spot.radius, "at most the radius")?;
    if let Some(since) = spot.sheared_since {
        let ok = since.is_finite() && time - since <= LONGEST_SHEAR;
        let allowed = format!(
            "at most {LONGEST_SHEAR} M before observer.time = {time}: it is wound up by then"
        );
        number(key("sheared_since"), since, ok, &allowed)?;
    }
    Ok(())
}

pub(super) fn check_mesh(mesh: &Mesh, k: usize, redshift: bool) -> Result<(), Invalid> {
    let key = |name: &str| format!("mesh.{k}.{name}");
    square_of_axis(key("rotation_axis"), mesh.rotation_axis)?;
    if redshift && mesh.velocity.is_none() {
        let why = "needed with redshift = true: \"static\" or \"keplerian\"";
        return Err(Invalid::missing(key("velocity"), why));
    }
    Ok(())
}

pub(super) fn check_sky(sky: &Sky) -> Result<(), Invalid> {
    match sky {
        Sky::Checker(checker) => {
            let fields = 180.0 / checker.field_deg;
            let ok = checker.field_deg > 0.5 && (fields - fields.round()).abs() < 1e-9;
            let allowed = "an angle above 0.5 that divides 180";
            number("sky.checker.field_deg", checker.field_deg, ok, allowed)
        }
        Sky::Stars(stars) => positive("sky.stars.radius_deg", stars.radius_deg),
        _ => Ok(()),
    }
}

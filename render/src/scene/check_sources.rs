//! Ranges of the values of sources: gas, discs, spots, meshes and the sky.

use super::invalid::{Invalid, brightness, number, positive};
use super::{Disc, Gas, GasMotion, GasProfile, Mesh, Plunging, Sky, Spot};
use kerrlight_geodesic::{Kerr, orbits};

pub(super) fn check_gas(gas: &Gas, hole: &Kerr) -> Result<(), Invalid> {
    positive("gas.scale_radius", gas.scale_radius)?;
    let within = |key: &str, value: f64, most: f64| {
        let allowed = format!("a number in [0, {most:e}]");
        number(key, value, (0.0..=most).contains(&value), &allowed)
    };
    within("gas.flatness", gas.flatness, 1e4)?;
    within("gas.emissivity", gas.emissivity, 1e12)?;
    within("gas.absorptivity", gas.absorptivity, 1e30)?;
    let (outer, least) = (gas.outer_radius, hole.horizon());
    let allowed = format!("a radius above the horizon's, {least:.6}, and at most 1e6");
    number("gas.outer_radius", outer, outer > least && outer <= 1e6, &allowed)?;
    if let GasProfile::PowerLaw { slope } = gas.profile {
        let ok = (0.0..=20.0).contains(&slope);
        number("gas.profile.power-law.slope", slope, ok, "a number in [0, 20]")?;
    }
    if let GasMotion::AngularMomentum { l0 } = gas.motion {
        number("gas.motion.angular-momentum.l0", l0, l0.abs() <= 10.0, "a number in [-10, 10]")?;
    }
    check_color("gas.color", gas.color)
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
    let allowed = format!("a radius above the inner edge, {inner:.6}, and at most 1e9");
    number("disc.outer_edge", outer, outer <= 1e9 && outer > inner, &allowed)?;
    brightness("disc.peak_intensity", disc.peak_intensity)?;
    if let Some(plunging) = &disc.plunging {
        check_plunging(plunging, disc, isco)?;
    }
    if let Some(t) = disc.peak_temperature_k {
        let ok = (300.0..=1e8).contains(&t);
        number("disc.peak_temperature_k", t, ok, "a temperature in [300, 1e8] (K)")?;
    }
    check_color("disc.color", disc.color)
}

fn check_plunging(plunging: &Plunging, disc: &Disc, isco: f64) -> Result<(), Invalid> {
    brightness("disc.plunging.intensity", plunging.intensity)?;
    let exponent = plunging.exponent;
    let ok = exponent.abs() <= 20.0;
    number("disc.plunging.exponent", exponent, ok, "a number in [-20, 20]")?;
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
    let least = orbits::photon_orbit(hole).max(3.0);
    let allowed = format!("a radius above {least:.4}, where circular orbits end, and at most 1e6");
    let ok = spot.radius <= 1e6 && spot.radius > least;
    number(key("radius"), spot.radius, ok, &allowed)?;
    let ok = (-3600.0..=3600.0).contains(&spot.phase_deg);
    number(key("phase_deg"), spot.phase_deg, ok, "an angle in [-3600, 3600]")?;
    let norm = spot.axis.iter().map(|x| x * x).sum::<f64>();
    if !(1e-30..=1e30).contains(&norm) {
        let allowed = "three numbers that are not all 0, with a length in [1e-15, 1e15]";
        return Err(Invalid::new(key("axis"), format!("{:?}", spot.axis), allowed));
    }
    let ok = spot.sigma >= 1e-3 && spot.sigma <= spot.radius;
    number(key("sigma"), spot.sigma, ok, "a width in [0.001, radius]")?;
    brightness(key("peak_emissivity"), spot.peak_emissivity)?;
    if let Some(since) = spot.sheared_since {
        let ok = since.is_finite() && time - since <= LONGEST_SHEAR;
        let allowed = format!(
            "at most {LONGEST_SHEAR} M before observer.time = {time}: it is wound up by then"
        );
        number(key("sheared_since"), since, ok, &allowed)?;
    }
    check_color(&key("color"), spot.color)
}

pub(super) fn check_mesh(mesh: &Mesh, k: usize, redshift: bool) -> Result<(), Invalid> {
    let key = |name: &str| format!("mesh.{k}.{name}");
    let ok = (1e-9..=1e9).contains(&mesh.scale);
    number(key("scale"), mesh.scale, ok, "a number in [1e-9, 1e9] (M per unit of the file)")?;
    if !mesh.position.iter().all(|x| x.abs() <= 1e6) {
        let value = format!("{:?}", mesh.position);
        return Err(Invalid::new(key("position"), value, "three numbers in [-1e6, 1e6] (M)"));
    }
    let norm = mesh.rotation_axis.iter().map(|x| x * x).sum::<f64>();
    if !(1e-30..=1e30).contains(&norm) {
        let allowed = "three numbers that are not all 0, with a length in [1e-15, 1e15]";
        return Err(Invalid::new(
            key("rotation_axis"),
            format!("{:?}", mesh.rotation_axis),
            allowed,
        ));
    }
    let ok = mesh.rotation_deg.abs() <= 3600.0;
    number(key("rotation_deg"), mesh.rotation_deg, ok, "an angle in [-3600, 3600]")?;
    brightness(key("brightness"), mesh.brightness)?;
    if redshift && mesh.velocity.is_none() {
        let why = "needed with redshift = true: \"static\" or \"keplerian\"";
        return Err(Invalid::missing(key("velocity"), why));
    }
    mesh.color.map_or(Ok(()), |color| check_color(&key("color"), color))
}

pub(super) fn check_color(key: &str, color: [f32; 3]) -> Result<(), Invalid> {
    if color.iter().all(|c| (0.0..=1e6).contains(c)) {
        return Ok(());
    }
    Err(Invalid::new(key, format!("{color:?}"), "three numbers in [0, 1e6]"))
}

pub(super) fn check_sky(sky: &Sky) -> Result<(), Invalid> {
    match sky {
        Sky::Checker(checker) => {
            let fields = 180.0 / checker.field_deg;
            let ok = checker.field_deg > 0.5 && (fields - fields.round()).abs() < 1e-9;
            let allowed = "an angle above 0.5 that divides 180";
            number("sky.checker.field_deg", checker.field_deg, ok, allowed)?;
            brightness("sky.checker.brightness", checker.brightness)
        }
        Sky::Stars(stars) => {
            if !(1..=10_000_000).contains(&stars.count) {
                let allowed = "a whole number in [1, 10000000]";
                return Err(Invalid::new("sky.stars.count", stars.count, allowed));
            }
            let ok = stars.radius_deg > 0.0 && stars.radius_deg <= 2.0;
            number("sky.stars.radius_deg", stars.radius_deg, ok, "an angle in (0, 2]")?;
            brightness("sky.stars.brightness", stars.brightness)
        }
        Sky::Catalogue(stars) => {
            let (key, fwhm) = ("sky.catalogue.psf_fwhm_pixels", stars.psf_fwhm_pixels);
            number(key, fwhm, (1.6..=64.0).contains(&fwhm), "a width in [1.6, 64] (pixels)")?;
            brightness("sky.catalogue.brightness", stars.brightness)
        }
        Sky::Image(image) => brightness("sky.image.brightness", image.brightness),
    }
}

//! Ranges of a scene's values.

use super::check_sources::{check_disc, check_gas, check_mesh, check_sky, check_spot};
use super::check_volume::{check_falls, check_volume};
use super::invalid::{Invalid, number, positive};
use super::{Scene, Sky};
use crate::Error;
use crate::polarization::PowerLaw;
use kerrlight_common::toml_file::shown;
use kerrlight_geodesic::Kerr;

pub(super) fn check(scene: &Scene) -> Result<(), Invalid> {
    check_hole_and_observer(scene)?;
    check_screen(scene)?;
    check_effects(scene)?;
    check_combinations(scene)?;
    // Its range is that of its key.
    let Ok(hole) = Kerr::new(scene.hole.spin) else { return Ok(()) };
    if let Some(disc) = &scene.disc {
        check_disc(disc, &hole)?;
    }
    if let Some(gas) = &scene.gas {
        check_gas(gas, &hole)?;
    }
    for (k, spot) in scene.spot.iter().enumerate() {
        check_spot(spot, k, &hole, scene.observer.time)?;
    }
    for (k, mesh) in scene.mesh.iter().enumerate() {
        check_mesh(mesh, k, scene.effects.redshift)?;
    }
    for (k, volume) in scene.volume.iter().enumerate() {
        check_volume(volume, k)?;
    }
    scene.sky.as_ref().map_or(Ok(()), check_sky)
}

fn check_hole_and_observer(scene: &Scene) -> Result<(), Invalid> {
    check_scales(scene)?;
    let observer = &scene.observer;
    if scene.camera.is_some() {
        return super::camera::check(scene);
    }
    let degrees = observer.inclination_deg;
    if degrees.is_nan() {
        let why = "give it, or a `[camera]`";
        return Err(Invalid::missing("observer.inclination_deg", why));
    }
    let (radius, allowed) = (observer.radius, "10 to 1e9 (M), or inf");
    number(
        "observer.radius",
        radius,
        radius == f64::INFINITY || (10.0..=1e9).contains(&radius),
        allowed,
    )
}

/// Mass and distance of the hole, and that they are given where anything depends on them.
fn check_scales(scene: &Scene) -> Result<(), Invalid> {
    let (hole, screen) = (&scene.hole, &scene.screen);
    let on_sky = [
        (screen.field_of_view_uas.is_some(), "screen.field_of_view_uas"),
        (screen.total_flux_jy.is_some(), "screen.total_flux_jy"),
    ];
    let on_sky = || on_sky.iter().find_map(|(given, key)| given.then_some(*key));
    let in_units = || scene.gas.is_some().then_some("[gas]");
    let asks = on_sky().or_else(in_units);
    let scales = [
        ("mass_msun", hole.mass_msun, "4.154e6", "mass in solar masses"),
        ("distance_kpc", hole.distance_kpc, "8.178", "distance in kpc"),
    ];
    for (name, value, such_as, what) in scales {
        if let (None, Some(asks)) = (value, asks) {
            let why = format!(
                "{asks} needs the {what}; give `{name} = …` in [hole], e.g. {such_as} for Sgr A*"
            );
            return Err(Invalid::missing(format!("hole.{name}"), why));
        }
    }
    Ok(())
}

fn check_screen(scene: &Scene) -> Result<(), Invalid> {
    let screen = &scene.screen;
    match (screen.field_of_view_m, screen.field_of_view_uas) {
        _ if scene.camera.is_some() => {}
        (Some(m), None) => positive("screen.field_of_view_m", m)?,
        (None, Some(angle)) => positive("screen.field_of_view_uas", angle)?,
        (None, None) => {
            let why = "give field_of_view_m or field_of_view_uas";
            return Err(Invalid::missing("screen.field_of_view_m", why));
        }
        (Some(_), Some(angle)) => {
            let allowed = "give field_of_view_m or field_of_view_uas, not both";
            return Err(Invalid::new("screen.field_of_view_uas", shown(angle), allowed));
        }
    }
    let root = screen.samples_per_pixel.isqrt();
    if root * root != screen.samples_per_pixel {
        let allowed = "a square number: 1, 4, 9, 16, …";
        return Err(Invalid::new("screen.samples_per_pixel", screen.samples_per_pixel, allowed));
    }
    if screen.image_error.is_some() && root != 1 {
        let allowed = "1 with image_error, by which pixels are refined";
        return Err(Invalid::new("screen.samples_per_pixel", screen.samples_per_pixel, allowed));
    }
    if screen.channels.as_ref().is_some_and(Vec::is_empty) {
        return Err(Invalid::new("screen.channels", "[]", "one name at least"));
    }
    if scene.camera.is_some() { Ok(()) } else { check_reach(scene) }
}

/// Impact parameters so large that their squares lose the hole are no picture of it.
fn check_reach(scene: &Scene) -> Result<(), Invalid> {
    let m = scene.field_of_view_m();
    let (key, given) = match (scene.screen.field_of_view_m, scene.screen.field_of_view_uas) {
        (Some(m), _) => ("screen.field_of_view_m", m),
        (None, angle) => ("screen.field_of_view_uas", angle.unwrap_or(f64::NAN)),
    };
    let height = scene.pixel_size() * f64::from(scene.screen.rows());
    let ok = m.max(height) <= 1e7 && m.min(height) >= 1e-9;
    number(key, given, ok, "a field between 1e-9 and 1e7 M on either side")?;
    let radius = scene.observer.radius;
    let allowed = format!(
        "a field inside the sky of an observer at r = {radius}: half its diagonal, now {:.3} M, below 0.9 r",
        0.5 * m.hypot(height)
    );
    number(key, given, 0.5 * m.hypot(height) < 0.9 * radius, &allowed)
}

fn check_effects(scene: &Scene) -> Result<(), Invalid> {
    let key = "effects.spectral_index";
    if let Some(power) = scene.effects.redshift_power {
        let (key, value) = ("effects.redshift_power", shown(power));
        if scene.effects.spectral_index.is_some() {
            let allowed = "redshift_power or spectral_index, which is 2 less, not both";
            return Err(Invalid::new(key, value, allowed));
        }
        if !scene.effects.redshift {
            return Err(Invalid::new(key, value, "only with redshift = true"));
        }
        return Ok(());
    }
    match (scene.effects.redshift, scene.effects.spectral_index) {
        (true, None) => {
            let why = "needed with redshift = true (1 is the law of bolometric intensity)";
            Err(Invalid::missing(key, why))
        }
        _ => Ok(()),
    }
}

/// Effects that have nothing to act upon, or that do not go together.
fn check_combinations(scene: &Scene) -> Result<(), Invalid> {
    let effects = &scene.effects;
    if effects.absorption && scene.gas.as_ref().is_none_or(|gas| gas.absorptivity == 0.0) {
        let allowed = "only with a [gas] whose absorptivity is above 0";
        return Err(Invalid::new("effects.absorption", true, allowed));
    }
    if effects.absorption && !scene.volume.is_empty() {
        let allowed = "false with a [[volume]]: only surfaces hide it";
        return Err(Invalid::new("effects.absorption", true, allowed));
    }
    let hot = scene.disc.as_ref().and_then(|disc| disc.peak_temperature_k);
    if let (Some(t), true) = (hot, effects.redshift && effects.index() != Some(1.0)) {
        let allowed = "only with effects.spectral_index = 1: intensities of all wavelengths";
        return Err(Invalid::new("disc.peak_temperature_k", shown(t), allowed));
    }
    let bodies = !scene.spot.is_empty() || !scene.mesh.is_empty();
    if bodies && !effects.lensing {
        let allowed =
            "true with hot spots or meshes: straight rays see discs, gas, volumes and skies";
        return Err(Invalid::new("effects.lensing", false, allowed));
    }
    if scene.camera.is_some() && !effects.lensing {
        let allowed = "true with a [camera]: straight rays are those of a distant observer";
        return Err(Invalid::new("effects.lensing", false, allowed));
    }
    if matches!(scene.sky, Some(Sky::Catalogue(_))) && !effects.lensing {
        let allowed = "true with a [sky.catalogue], whose stars are seen by bundles of rays";
        return Err(Invalid::new("effects.lensing", false, allowed));
    }
    let plunges = scene.disc.as_ref().is_some_and(|disc| disc.plunging.is_some());
    if plunges && effects.redshift && !effects.lensing {
        let allowed =
            "true with redshift and [disc.plunging]: straight rays have no momentum near the hole";
        return Err(Invalid::new("effects.lensing", false, allowed));
    }
    check_falls(scene)?;
    check_polarization(scene)
}

fn check_polarization(scene: &Scene) -> Result<(), Invalid> {
    let effects = &scene.effects;
    let (key, circular) = ("effects.polarization", effects.circular_polarization_lorentz_factor);
    if !effects.polarization {
        let unused = match scene.magnetic_field {
            Some(_) => "magnetic_field",
            None => "effects.circular_polarization_lorentz_factor",
        };
        if scene.magnetic_field.is_some() || circular.is_some() {
            let allowed = format!("true with `{unused}`, or without it and what belongs to it");
            return Err(Invalid::new(key, false, allowed));
        }
        return Ok(());
    }
    if scene.disc.as_ref().is_some_and(|disc| disc.peak_temperature_k.is_some()) {
        let allowed = "false with disc.peak_temperature_k: black bodies are no synchrotron sources";
        return Err(Invalid::new(key, true, allowed));
    }
    if !(effects.redshift && effects.lensing && scene.camera.is_none()) {
        let allowed = "only with redshift = true, with lensing and without a [camera]";
        return Err(Invalid::new(key, true, allowed));
    }
    let Some(field) = &scene.magnetic_field else {
        return Err(Invalid::missing("magnetic_field", "needed with polarization = true"));
    };
    let wrong = |error: Error| Invalid::of("", &error);
    field.check().map_err(wrong)?;
    let index = effects.index().unwrap_or(f64::NAN);
    PowerLaw::new(index, circular).map(|_| ()).map_err(wrong)
}

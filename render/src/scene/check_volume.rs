//! Ranges of a volume's values.

use super::check_sources::check_color;
use super::invalid::{Invalid, brightness, number};
use super::{Rotation, Scene, VolumeRegion, VolumeSource, rotation};

pub(super) fn check_volume(volume: &VolumeSource, k: usize) -> Result<(), Invalid> {
    let key = |name: &str| format!("volume.{k}.{name}");
    brightness(key("factor"), volume.factor)?;
    check_box(volume, &key)?;
    check_rotation(volume, &key)?;
    check_region(volume, &key)?;
    if let Some(axis) = volume.axis {
        let norm = axis.iter().map(|x| x * x).sum::<f64>();
        if !(1e-30..=1e30).contains(&norm) {
            let allowed = "three numbers that are not all 0, with a length in [1e-15, 1e15]";
            return Err(Invalid::new(key("axis"), format!("{axis:?}"), allowed));
        }
    }
    for (name, time) in
        [("reference_time", volume.reference_time), ("injection_time", volume.injection_time)]
    {
        let time = time.unwrap_or(0.0);
        number(key(name), time, time.abs() <= 1e9, "a time in [-1e9, 1e9] (M)")?;
    }
    check_color(&key("color"), volume.color)
}

fn check_box(volume: &VolumeSource, key: &impl Fn(&str) -> String) -> Result<(), Invalid> {
    for (name, corner) in [("low", volume.low), ("high", volume.high)] {
        let inside = |corner: [f64; 3]| corner.iter().all(|x| x.abs() <= 1e6);
        if let Some(corner) = corner.filter(|corner| !inside(*corner)) {
            let allowed = "three numbers in [-1e6, 1e6] (M)";
            return Err(Invalid::new(key(name), format!("{corner:?}"), allowed));
        }
    }
    match (volume.low, volume.high) {
        (Some(_), None) => Err(Invalid::missing(key("high"), "needed with low")),
        (None, Some(_)) => Err(Invalid::missing(key("low"), "needed with high")),
        (Some(low), Some(high)) if (0..3).any(|axis| high[axis] <= low[axis]) => {
            let allowed = format!("above low = {low:?} along every axis");
            Err(Invalid::new(key("high"), format!("{high:?}"), allowed))
        }
        _ => Ok(()),
    }
}

fn check_rotation(volume: &VolumeSource, key: &impl Fn(&str) -> String) -> Result<(), Invalid> {
    if volume.rotation != Rotation::None && volume.reference_time.is_none() {
        let why = "needed if it turns: the time (M) at which it is as in the file";
        return Err(Invalid::missing(key("reference_time"), why));
    }
    let Rotation::Law(law) = &volume.rotation else { return Ok(()) };
    if law.falls() && volume.region.is_none() {
        let why = "needed if matter falls: how far out and in it is followed, { r_min, r_max }";
        return Err(Invalid::missing(key("region"), why));
    }
    rotation::check(law, &key("rotation"))
}

fn check_region(volume: &VolumeSource, key: &impl Fn(&str) -> String) -> Result<(), Invalid> {
    let Some(VolumeRegion { r_min, r_max, z_width }) = volume.region else { return Ok(()) };
    let ok = (0.0..=1e6).contains(&r_min);
    number(key("region.r_min"), r_min, ok, "a radius in [0, 1e6] (M)")?;
    let ok = r_max > r_min && r_max <= 1e6;
    number(key("region.r_max"), r_max, ok, "a radius above r_min and at most 1e6 (M)")?;
    let width = z_width.unwrap_or(1.0);
    let ok = width > 0.0 && width <= 1e6;
    number(key("region.z_width"), width, ok, "a height above 0 and at most 1e6 (M)")
}

/// Straight rays have no momentum along the radius near the hole.
pub(super) fn check_falls(scene: &Scene) -> Result<(), Invalid> {
    let effects = &scene.effects;
    let falls =
        |volume: &VolumeSource| matches!(&volume.rotation, Rotation::Law(law) if law.falls());
    if scene.volume.iter().any(falls) && effects.redshift && !effects.lensing {
        let allowed = "true with redshift and a volume that falls: straight rays have no momentum near the hole";
        return Err(Invalid::new("effects.lensing", false, allowed));
    }
    Ok(())
}

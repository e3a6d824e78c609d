//! Checks of volumes whose values depend on each other.

use super::invalid::{Invalid, number, positive, square_of_axis};
use super::{Rotation, Scene, VolumeRegion, VolumeSource, rotation};

pub(super) fn check_volume(volume: &VolumeSource, k: usize) -> Result<(), Invalid> {
    let key = |name: &str| format!("volume.{k}.{name}");
    check_box(volume, &key)?;
    check_rotation(volume, &key)?;
    check_region(volume, &key)?;
    if let Some(axis) = volume.axis {
        square_of_axis(key("axis"), axis)?;
    }
    Ok(())
}

fn check_box(volume: &VolumeSource, key: &impl Fn(&str) -> String) -> Result<(), Invalid> {
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
    number(key("region.r_max"), r_max, r_max > r_min, "a radius above r_min")?;
    positive(key("region.z_width"), z_width.unwrap_or(1.0))
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

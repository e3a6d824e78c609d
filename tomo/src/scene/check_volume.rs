//! Ranges of a volume's values.

use super::check::check_color;
use super::invalid::{Invalid, brightness, number};
use super::{Rotation, VolumeSource};

pub(super) fn check_volume(volume: &VolumeSource, k: usize) -> Result<(), Invalid> {
    let key = |name: &str| format!("volume.{k}.{name}");
    brightness(key("factor"), volume.factor)?;
    check_box(volume, &key)?;
    check_rotation(volume, &key)?;
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
    let Rotation::PowerLaw { radius, rate, exponent } = volume.rotation else { return Ok(()) };
    let key = |name: &str| key(&format!("rotation.power-law.{name}"));
    let ok = (1e-6..=1e6).contains(&radius);
    number(key("radius"), radius, ok, "a radius in [1e-6, 1e6] (M)")?;
    let ok = rate.abs() <= 1e3;
    number(key("rate"), rate, ok, "a number in [-1000, 1000] (radians per M)")?;
    let ok = (-10.0..=10.0).contains(&exponent);
    number(key("exponent"), exponent, ok, "a number in [-10, 10]")
}

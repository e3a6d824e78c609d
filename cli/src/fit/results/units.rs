//! Units of settings, as docs/reference/fit-file.md gives them.

/// Keys as they end, without the numbers of lists, and their units; the first that fits counts.
const UNITS: [(&str, &str); 66] = [
    ("hole.spin", "M"),
    ("hole.mass_msun", "solar masses"),
    ("hole.distance_kpc", "kpc"),
    ("observer.inclination_deg", "°"),
    ("observer.radius", "M"),
    ("screen.width", "M"),
    ("screen.field_uas", "µas"),
    ("screen.jy_per_pixel", "Jy per M of emission 1"),
    ("region.r_min", "M"),
    ("region.r_max", "M"),
    ("region.z_width", "M"),
    ("absorption.coefficient", "1/M"),
    ("absorption.radius", "M"),
    ("absorption.height", "M"),
    ("keplerian.drag", "M^(3/2)"),
    ("power-law.radius", "M"),
    ("power-law.rate", "rad/(GM/c³)"),
    ("table.radii", "M"),
    ("table.rates", "rad/(GM/c³)"),
    ("perturbed.deviation", "rad/(GM/c³)"),
    ("correlation_length", "M"),
    ("field.mean", "model units"),
    ("prior.mean", "model units"),
    ("perturbed.radii", "M"),
    ("motion.reference_time", "GM/c³"),
    ("motion.injection_time", "GM/c³"),
    ("movie.from", "GM/c³"),
    ("movie.to", "GM/c³"),
    ("center", "M"),
    ("spot.sigma", "M"),
    ("ring.radius", "M"),
    ("ring.sigma", "M"),
    ("flux_jy", "Jy"),
    ("q_jy", "Jy"),
    ("u_jy", "Jy"),
    ("brightest_deg", "°"),
    ("quiescent.upper", "M of emission; Jy of a light curve"),
    ("gains.amplitude", ""),
    ("leakage.amplitude", ""),
    ("amplitude", "model units"),
    ("wound_for", "GM/c³"),
    ("glyph.height", "M"),
    ("glyph.thickness", "M"),
    ("glyph.softness", "M"),
    ("observation.mjd", "days"),
    ("observation.utc", "h"),
    ("observation.gmst", "h"),
    ("integration_s", "s"),
    ("frequency_ghz", "GHz"),
    ("bandwidth_ghz", "GHz"),
    ("elevation_deg", "°"),
    ("first_time", "GM/c³"),
    ("visibilities.average_s", "s"),
    ("light_curve.times_h", "h"),
    ("light-curve.utc_h", "h"),
    ("most_gap_s", "s"),
    ("validate_after_min", "min"),
    ("azimuth_deg", "°"),
    ("turn_deg", "°"),
    ("derotation_deg", "°"),
    ("mean_flux.jy", "Jy"),
    ("loss.sigma", "Jy"),
    ("length_scale", "M"),
    ("time_scale", "GM/c³"),
    ("checkpoint_seconds", "s"),
    ("linear.upper", "model units"),
];

/// The unit of a setting with dots; nothing for a number without one.
pub fn unit(key: &str) -> &'static str {
    let words: Vec<&str> = key.split('.').filter(|word| word.parse::<usize>().is_err()).collect();
    let key = words.join(".");
    let is = |end: &str| {
        key.strip_suffix(end).is_some_and(|rest| rest.is_empty() || rest.ends_with('.'))
    };
    UNITS.iter().find(|(end, _)| is(end)).map_or("", |(_, unit)| unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_units_of_settings() {
        for (key, expected) in [
            ("observer.inclination_deg", "°"),
            ("world.observer.inclination_deg", "°"),
            ("loss.0.sigma", "Jy"),
            ("truth.spot.2.sigma", "M"),
            ("motion.velocity.perturbed.of.keplerian.drag", "M^(3/2)"),
            ("training.steps", ""),
            ("observation.gains.constant_amplitude", ""),
            ("movie.frames", ""),
        ] {
            assert_eq!(unit(key), expected, "{key}");
        }
    }
}

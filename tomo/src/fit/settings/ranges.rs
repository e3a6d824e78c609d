//! Ranges of a fit's numbers, by key: a number outside of them gives a fit that means nothing.

use super::FitError;
use kerrlight_common::toml_file;
use kerrlight_render::scene::shown;
use toml::Value;

/// Key (`*` stands for the number of a list's element, `?` for any name), least and largest value, unit.
type Range = (&'static str, f64, f64, &'static str);

const TIME: f64 = 1e9;
const LENGTH: f64 = 1e6;
/// With a smaller learning rate nothing is learnt.
const RATE: f64 = 1e-12;

const RANGES: &[Range] = &[
    ("hole.spin", -1.0, 1.0, "a/M"),
    ("hole.mass_msun", 1e-20, 1e15, "solar masses"),
    ("hole.distance_kpc", 1e-9, 1e12, "kpc"),
    ("observer.inclination_deg", 0.0, 180.0, "degrees"),
    ("screen.pixels", 2.0, 4096.0, "pixels along a side"),
    ("screen.width", 1e-3, LENGTH, "M"),
    ("screen.field_uas", 1e-6, 1e12, "microarcseconds"),
    ("screen.jy_per_pixel", 1e-15, 1e15, "Jy per M of emission 1"),
    ("region.r_min", 0.0, LENGTH, "M"),
    ("region.r_max", 1e-3, LENGTH, "M"),
    ("region.z_width", 1e-3, f64::INFINITY, "M"),
    ("region.nodes.gauss.order", 1.0, 16.0, "nodes of a panel"),
    ("region.nodes.gauss.split", 1.0, 1e9, "cuts of the coarsest panels"),
    ("region.nodes.equal-mino-time.per_ray", 2.0, 1e5, "nodes of a ray"),
    ("effects.redshift_power", -20.0, 20.0, "an exponent"),
    ("effects.absorption.coefficient", 0.0, 1e6, "per M"),
    ("effects.absorption.radius", 1e-3, LENGTH, "M"),
    ("effects.absorption.height", 1e-3, LENGTH, "M"),
    ("motion.velocity.keplerian.drag", -1.0, 1.0, "a/M, as Ω = 1/(r^{3/2} + drag)"),
    ("motion.velocity.power-law.radius", 1e-3, LENGTH, "M"),
    ("motion.velocity.power-law.rate", -1e3, 1e3, "radians per M"),
    ("motion.velocity.power-law.exponent", -20.0, 20.0, "an exponent"),
    ("motion.velocity.table.radii.*", 1e-3, LENGTH, "M"),
    ("motion.velocity.table.rates.*", -1e3, 1e3, "radians per M"),
    ("motion.velocity.infall.xi", 0.0, 1.0, "an angular momentum over that of circular orbits"),
    ("motion.velocity.infall.beta_r", 0.0, 1.0, "0: free fall, 1: circular"),
    ("motion.velocity.infall.beta_phi", 0.0, 1.0, "0: free fall, 1: circular"),
    ("motion.velocity.infall.drag", -1.0, 1.0, "a/M"),
    ("motion.velocity.profile.radii.*", 1e-3, LENGTH, "M"),
    ("motion.velocity.profile.angular.*", -1e3, 1e3, "radians per M"),
    ("motion.velocity.profile.radial.*", -1.0, 1.0, "dr/dt"),
    ("polarization.field.vertical", -1e12, 1e12, "a share of the field"),
    ("polarization.field.radial", -1e12, 1e12, "a share of the field"),
    ("polarization.field.toroidal", -1e12, 1e12, "a share of the field"),
    ("polarization.field.radial_sine_power", 0.0, 20.0, "an exponent"),
    ("polarization.redshift_power", -20.0, 20.0, "an exponent"),
    ("polarization.field_power", 0.0, 20.0, "an exponent"),
    ("polarization.sine_power", 0.0, 20.0, "an exponent"),
    ("polarization.fraction", 0.0, 1.0, "a part of the light"),
    ("polarization.turn_deg", -360.0, 360.0, "degrees east of north"),
    ("motion.reference_time", -TIME, TIME, "M"),
    ("motion.injection_time", -TIME, TIME, "M"),
    ("held_out.values.*", 0.0, 1e12, "a factor"),
    ("held_out.folds", 2.0, 1000.0, "parts of the data"),
    ("change.weight", 0.0, 1e12, "a factor"),
    ("change.spacing", 1e-6, TIME, "M"),
    ("change.sharpen", 1e-12, 1e12, "an emission"),
    ("faraday.angles", 4.0, 360.0, "rotations over 180 degrees"),
    ("faraday.iterations", 1.0, 1e5, "iterations"),
    ("quiescent.upper", 1e-15, 1e15, "M of emission; Jy, of a light curve"),
    ("quiescent.smoothness", 0.0, 1e12, "a factor"),
    ("quiescent.sparsity", 0.0, 1e12, "a factor"),
    ("movie.frames", 1.0, 1e5, "frames"),
    ("movie.from", -TIME, TIME, "M"),
    ("movie.to", -TIME, TIME, "M"),
    ("truth.spot.*.center.*", -LENGTH, LENGTH, "M"),
    ("truth.spot.*.sigma", 1e-3, LENGTH, "M"),
    ("truth.spot.*.amplitude", 0.0, 1e12, "emission at the centre"),
    ("truth.spot.*.wound_for", -LENGTH, LENGTH, "M"),
    ("truth.spot.*.shines.from", -TIME, TIME, "M"),
    ("truth.spot.*.shines.until", -TIME, TIME, "M"),
    ("truth.spot.*.shines.rise", 1e-6, TIME, "M"),
    ("truth.tube.*.radius", 1e-3, LENGTH, "M"),
    ("truth.tube.*.sigma", 1e-3, LENGTH, "M"),
    ("truth.tube.*.azimuth_deg.*", -720.0, 720.0, "degrees"),
    ("truth.tube.*.amplitude", 0.0, 1e12, "emission on the arc"),
    ("truth.field.mean", -1e12, 1e12, "emission, or its logarithm"),
    ("truth.field.amplitude", 1e-12, 1e12, "a standard deviation"),
    ("truth.field.correlation_length", 1e-3, LENGTH, "M"),
    ("truth.field.nodes", 4.0, 256.0, "nodes along each axis"),
    ("truth.ring.*.radius", 0.0, LENGTH, "M"),
    ("truth.ring.*.sigma", 1e-3, LENGTH, "M"),
    ("truth.ring.*.flux_jy", 0.0, 1e15, "Jy"),
    ("truth.ring.*.q_jy", -1e15, 1e15, "Jy"),
    ("truth.ring.*.u_jy", -1e15, 1e15, "Jy"),
    ("truth.ring.*.asymmetry", 0.0, 1.0, "a part of the mean brightness"),
    ("truth.ring.*.brightest_deg", -360.0, 360.0, "degrees east of north"),
    ("light_curve.times_h.*", -1e4, 1e4, "hours of UTC"),
    ("light_curve.first_time", -TIME, TIME, "M"),
    ("light_curve.mean_flux.jy", 1e-15, 1e15, "Jy"),
    ("light_curve.mean_flux.minutes", 0.0, 1e9, "minutes"),
    ("light_curve.validate_after_min", 0.0, 1e9, "minutes"),
    ("data.light-curve.first_time", -TIME, TIME, "M"),
    ("data.light-curve.utc_h.*", -1e4, 1e4, "hours of UTC"),
    ("data.light-curve.average", 1.0, 1e9, "samples"),
    ("data.light-curve.most_gap_s", 0.0, 1e9, "seconds"),
    ("data.light-curve.derotation_deg", -360.0, 360.0, "degrees east of north"),
    ("data.light-curve.intensity", -1e15, 1e15, "Jy"),
    ("data.light-curve.validate_after_min", 0.0, 1e9, "minutes"),
    ("truth.glyph.*.amplitude", 0.0, 1e12, "emission in the strokes"),
    ("observation.gains.constant_amplitude", 0.0, 10.0, "a standard deviation of ln |g|"),
    ("observation.gains.scan_amplitude", 0.0, 10.0, "a standard deviation of ln |g|"),
    ("instrument.gains.stations.?", 0.0, 10.0, "a standard deviation of ln |g|"),
    ("observation.gains.stations.?", 0.0, 10.0, "a standard deviation of ln |g|"),
    ("instrument.gains.amplitude", 0.0, 10.0, "a standard deviation of ln |g|"),
    ("observation.leakage", 0.0, 1.0, "a root mean square of |d|"),
    ("instrument.leakage.amplitude", 1e-6, 1.0, "a root mean square of |d|"),
    ("instrument.leakage.rounds", 1.0, 1000.0, "times that both are solved for"),
    ("observation.first_time", -TIME, TIME, "M"),
    ("data.visibilities.first_time", -TIME, TIME, "M"),
    ("data.visibilities.average_s", 0.0, f64::INFINITY, "seconds"),
    ("data.visibilities.uv_min", 0.0, f64::INFINITY, "wavelengths"),
    ("data.visibilities.systematic", 0.0, 10.0, "part of the amplitude"),
    ("observation.systematic", 0.0, 10.0, "part of the amplitude"),
    ("loss.*.weight", 1e-12, 1e12, "a factor"),
    ("loss.*.sigma", 1e-15, 1e15, "Jy"),
    ("loss.*.least_snr", 0.0, 1e9, "a signal-to-noise ratio"),
    ("regulariser.*.weight", 0.0, 1e12, "a factor"),
    ("probe.nodes", 4.0, 256.0, "nodes along each axis"),
    ("representation.length_scale", 1e-3, LENGTH, "M"),
    ("representation.time_scale", 1e-3, TIME, "M"),
    ("training.rate", RATE, 10.0, "a learning rate"),
    ("training.last_rate", 0.0, 10.0, "a learning rate"),
    ("training.grid_rate", RATE, 10.0, "a learning rate"),
    ("training.grid_last_rate", 0.0, 10.0, "a learning rate"),
    ("training.feature_rate", RATE, 10.0, "a learning rate"),
    ("training.feature_last_rate", 0.0, 10.0, "a learning rate"),
    ("training.batch.pixels", 1.0, 1e9, "pixels"),
    ("training.batch.frames", 1.0, f64::INFINITY, "frames"),
    ("training.log_every", 1.0, f64::INFINITY, "steps"),
    ("training.occupancy.cells", 2.0, 256.0, "cells along each axis"),
    ("training.checkpoint_seconds", 0.0, 1e9, "seconds"),
    ("linear.upper", 1e-12, 1e12, "the largest emission"),
    ("linear.flux_jy", 1e-15, 1e15, "Jy"),
    ("linear.smoothness", 0.0, 1e12, "a factor"),
    ("linear.sparsity", 0.0, 1e12, "a factor"),
    ("linear.prior.mean", -1e12, 1e12, "emission, or its logarithm"),
    ("linear.prior.amplitude", 1e-12, 1e12, "a standard deviation"),
    ("linear.prior.correlation_length", 1e-3, LENGTH, "M"),
    ("axis.from.rate", RATE, 10.0, "a learning rate"),
    ("axis.from.last_rate", 0.0, 10.0, "a learning rate"),
    ("axis.scan.directions", 12.0, 1e5, "directions"),
    ("axis.scan.frames", 2.0, f64::INFINITY, "frames"),
    ("axis.scan.pixels", 8.0, f64::INFINITY, "pixels along a side"),
    ("axis.scan.refine", 8.0, 128.0, "nodes along each axis"),
    ("axis.scan.rate", 0.0, 10.0, "a learning rate"),
    ("axis.scan.last_rate", 0.0, 10.0, "a learning rate"),
    ("band.inclinations_deg.from", 0.0, 180.0, "degrees"),
    ("band.inclinations_deg.to", 0.0, 180.0, "degrees"),
    ("band.inclinations_deg.step", 1e-3, 180.0, "degrees"),
    ("band.rotation_factors.*", -10.0, 10.0, "a factor"),
    ("band.position_angles_deg.*", -360.0, 360.0, "degrees east of north"),
    ("band.radii.from", 1e-3, LENGTH, "M"),
    ("band.radii.to", 1e-3, LENGTH, "M"),
    ("band.radii.step", 1e-3, LENGTH, "M"),
    ("band.widths.*", 1e-3, LENGTH, "M"),
    ("band.height", 1e-3, LENGTH, "M"),
    ("band.lengths.*", 1e-3, LENGTH, "M"),
    ("band.nodes", 4.0, 128.0, "rings between the axis and region.r_max"),
    ("output.nodes", 2.0, 512.0, "nodes along each axis"),
    ("image.pixels", 8.0, 512.0, "pixels along a side"),
    ("image.field_uas", 1e-6, 1e12, "microarcseconds"),
    ("image.flux_jy", 1e-12, 1e9, "Jy"),
    ("image.flux_sigma_jy", 1e-12, 1e9, "Jy"),
    ("image.iterations", 1.0, 1e6, "iterations"),
    ("image.draws", 2.0, 1000.0, "draws"),
    ("image.starts.*.ring.diameter_uas", 1e-6, 1e12, "microarcseconds"),
    ("image.starts.*.ring.width_uas", 1e-6, 1e12, "microarcseconds"),
    ("image.starts.*.gaussian.fwhm_uas", 1e-6, 1e12, "microarcseconds"),
    ("envelope.fwhm_uas", 1e-6, 1e12, "microarcseconds"),
    ("envelope.weight", 1e-12, 1e12, "a factor"),
    ("strength.values.*", 1e-12, 1e12, "a factor"),
    ("strength.folds", 2.0, 1000.0, "parts of the frames"),
    ("polarization.least_snr", 0.0, 1e12, "a signal-to-noise ratio"),
    ("polarization.leakage_left", 0.0, 1.0, "a part of the light"),
    ("polarization.variability.jy", 0.0, 1e9, "Jy"),
    ("polarization.variability.uv", 1e-3, 1e18, "wavelengths"),
    ("polarization.variability.power", 0.0, 20.0, "an exponent"),
    ("polarization.smoothness", 1e-12, 1e12, "a factor"),
    ("polarization.iterations", 1.0, 1e6, "iterations"),
    ("polarization.beam_uas", 1e-6, 1e12, "microarcseconds"),
    ("polarization.strength.values.*", 1e-12, 1e12, "a factor"),
    ("polarization.strength.folds", 2.0, 1000.0, "parts of the frames"),
    ("ring.least_radius_uas", 0.0, 1e12, "microarcseconds"),
    ("ring.most_radius_uas", 1e-6, 1e12, "microarcseconds"),
    ("data.visibilities.utc_h.*", 0.0, 1000.0, "hours"),
    ("data.visibilities.variability.jy", 0.0, 1e9, "Jy"),
    ("data.visibilities.variability.uv", 1.0, f64::INFINITY, "wavelengths"),
    ("data.visibilities.variability.power", 0.0, 20.0, "an exponent"),
];

/// Numbers of these tables are a representation's own; whoever adds it checks them.
const OWN: &str = "representation.own";

/// Refuses the first number of a fit's text that is out of its range, or not a number at all.
pub fn check(text: &str) -> Result<(), FitError> {
    let table: toml::Table = toml_file::read(text)?;
    walk(&Value::Table(table), &mut String::new()).map_err(|error| error.located(text))
}

fn walk(value: &Value, key: &mut String) -> Result<(), FitError> {
    match value {
        Value::Table(table) => table.iter().try_for_each(|(name, value)| below(value, key, name)),
        Value::Array(values) => {
            values.iter().enumerate().try_for_each(|(k, value)| below(value, key, &k.to_string()))
        }
        Value::Float(number) => one(key, *number),
        Value::Integer(number) => one(key, *number as f64),
        _ => Ok(()),
    }
}

fn below(value: &Value, key: &mut String, name: &str) -> Result<(), FitError> {
    let length = key.len();
    if !key.is_empty() {
        key.push('.');
    }
    key.push_str(name);
    let result = walk(value, key);
    key.truncate(length);
    result
}

fn one(key: &str, number: f64) -> Result<(), FitError> {
    let (least, most, unit) = range_of(key);
    if key.starts_with(OWN) || (least..=most).contains(&number) {
        return Ok(());
    }
    let allowed = match (least, most) {
        (f64::MIN, _) => "a finite number".to_owned(),
        (_, f64::INFINITY) => format!("at least {}", shown(least)),
        _ => format!("{} to {}", shown(least), shown(most)),
    };
    let unit = if unit.is_empty() { String::new() } else { format!(" ({unit})") };
    Err(FitError::range(key, shown(number), &format!("{allowed}{unit}")))
}

/// The range of a key; any finite number where the table has none. What data are simulated with has the
/// ranges of what a fit assumes, and a perturbed velocity those of the one that it perturbs.
fn range_of(key: &str) -> (f64, f64, &'static str) {
    let key = key.strip_prefix("world.").unwrap_or(key);
    let key = key.replace("velocity.perturbed.of.", "velocity.");
    let of = |(pattern, least, most, unit): &Range| {
        matches(pattern, &key).then_some((*least, *most, *unit))
    };
    RANGES.iter().find_map(of).unwrap_or((f64::MIN, f64::MAX, ""))
}

fn matches(pattern: &str, key: &str) -> bool {
    let (mut wanted, mut given) = (pattern.split('.'), key.split('.'));
    loop {
        match (wanted.next(), given.next()) {
            (None, None) => return true,
            (Some("*"), Some(part)) if part.parse::<usize>().is_ok() => {}
            (Some("?"), Some(_)) => {}
            (Some(name), Some(part)) if name == part => {}
            _ => return false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_render::scene::apply_override;

    const BUILT_IN: &str = include_str!("../../../../cli/src/fit/built_in.toml");

    fn refused(assignment: &str) -> String {
        check(&apply_override(BUILT_IN, assignment).unwrap()).unwrap_err().to_string()
    }

    /// Each of these used to end in a report of nothing, with exit code 0.
    #[test]
    fn regress_numbers_that_mean_nothing_are_refused_by_name() {
        for (assignment, says) in [
            (
                "hole.mass_msun=1e300",
                "hole.mass_msun = 1e300 is not allowed: 1e-20 to 1e15 (solar masses)",
            ),
            ("screen.width=1e-300", "screen.width = 1e-300 is not allowed: 0.001 to 1000000 (M)"),
            ("effects.redshift_power=-1e9", "effects.redshift_power = -1e9"),
            ("motion.velocity.keplerian.drag=1e300", "motion.velocity.keplerian.drag = 1e300"),
            ("motion.reference_time=inf", "motion.reference_time = inf"),
            ("truth.spot.0.sigma=1e-300", "truth.spot.0.sigma = 1e-300"),
            ("truth.spot.0.center=[0.0, nan, 0.0]", "truth.spot.0.center.1 = NaN"),
            ("truth.spot.0.amplitude=-1", "truth.spot.0.amplitude = -1"),
            ("loss.0.weight=1e-300", "loss.0.weight = 1e-300"),
            ("representation.length_scale=nan", "representation.length_scale = NaN"),
            (
                "training.rate=-1",
                "training.rate = -1 is not allowed: 1e-12 to 10 (a learning rate)",
            ),
            ("training.rate=0", "training.rate = 0 is not allowed: 1e-12 to 10 (a learning rate)"),
            ("world.hole.spin=2", "world.hole.spin = 2"),
            ("output.nodes=nan", "output.nodes = NaN is not allowed: 2 to 512"),
            ("observer.radius=nan", "observer.radius = NaN is not allowed: a finite number"),
        ] {
            let text = refused(assignment);
            assert!(text.contains(says), "{assignment}: {text}");
        }
        assert!(
            refused("hole.spin=1.5").starts_with("line 7: hole.spin = 1.5"),
            "{}",
            refused("hole.spin=1.5")
        );
    }

    #[test]
    fn exact_what_is_carried_along_is_allowed() {
        check(BUILT_IN).unwrap();
        let own = apply_override(BUILT_IN, "representation.own.width=1e20").unwrap();
        check(&own).unwrap();
        check(&apply_override(BUILT_IN, "region.z_width=inf").unwrap()).unwrap();
    }

    #[test]
    fn exact_every_key_of_the_table_is_one_of_a_fit() {
        let documents = include_str!("../../../../docs/reference/fit-file.md");
        for (pattern, least, most, _) in RANGES {
            assert!(least < most, "{pattern}");
            let name = pattern
                .trim_end_matches(".*")
                .trim_end_matches(".?")
                .rsplit('.')
                .next()
                .unwrap_or_default();
            assert!(documents.contains(name), "docs/reference/fit-file.md does not know {pattern}");
        }
    }
}

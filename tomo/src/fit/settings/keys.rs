//! Keys of a fit's file: their ranges are checked, their documentation is handed on.

use super::{FitError, FitFile};
use kerrlight_common::toml_file::{self, Keys, OutOfRange, shown};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::sync::LazyLock;

static FIT: LazyLock<Keys> = LazyLock::new(Keys::of::<FitFile>);

impl FitFile {
    /// All keys of such a file, with their documentation.
    pub fn keys() -> &'static Keys {
        &FIT
    }

    /// Refuses the first number that is out of the range of its key.
    ///
    /// # Errors
    /// With the key, its value and what is allowed.
    pub fn check_ranges(&self) -> Result<(), FitError> {
        check_ranges(self, &FIT)
    }
}

/// Refuses the first number of settings that is out of the range of its key.
///
/// # Errors
/// With the key, its value and what is allowed.
pub fn check_ranges<T: Serialize>(settings: &T, keys: &Keys) -> Result<(), FitError> {
    keys.check(&toml_file::table_of(settings)?).map_err(|wrong| range_error(&wrong))
}

/// Settings in a TOML text, which have these keys.
///
/// # Errors
/// On syntax, unknown or missing keys, wrong types and numbers out of range: with the line, the key and what is allowed.
pub fn read<T: DeserializeOwned>(text: &str, keys: &Keys) -> Result<T, FitError> {
    let settings = toml_file::read(text)?;
    check(text, keys)?;
    Ok(settings)
}

/// Refuses the first number of a text that is out of its range, or not a number at all.
fn check(text: &str, keys: &Keys) -> Result<(), FitError> {
    let table: toml::Table = toml_file::read(text)?;
    keys.check(&table).map_err(|wrong| range_error(&wrong).located(text))
}

fn range_error(wrong: &OutOfRange) -> FitError {
    FitError::range(&*wrong.key, shown(wrong.value), &wrong.allowed())
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_render::scene::apply_override;

    const BUILT_IN: &str = include_str!("../../../../cli/src/fit/built_in.toml");

    fn refused(assignment: &str) -> String {
        check(&apply_override(BUILT_IN, assignment).unwrap(), FitFile::keys())
            .expect_err(assignment)
            .to_string()
    }

    /// Each of these used to end in a report of nothing, with exit code 0.
    #[test]
    fn regress_numbers_that_mean_nothing_are_refused_by_name() {
        for (assignment, says) in [
            (
                "hole.mass_msun=1e300",
                "hole.mass_msun = 1e300 is not allowed: 1e-20 to 1e15 (solar masses)",
            ),
            ("screen.width=1e-300", "screen.width = 1e-300 is not allowed: 0.001 to 1e6 (M)"),
            ("effects.redshift_power=-1e9", "effects.redshift_power = -1e9"),
            ("motion.velocity.keplerian.drag=1e300", "motion.velocity.keplerian.drag = 1e300"),
            ("motion.reference_time=inf", "motion.reference_time = inf"),
            ("simulation.truth.spot.0.sigma=1e-300", "simulation.truth.spot.0.sigma = 1e-300"),
            (
                "simulation.truth.spot.0.center=[0.0, nan, 0.0]",
                "simulation.truth.spot.0.center.1 = NaN",
            ),
            ("simulation.truth.spot.0.amplitude=-1", "simulation.truth.spot.0.amplitude = -1"),
            ("loss.0.weight=1e-300", "loss.0.weight = 1e-300"),
            (
                "representation.network.length_scale=nan",
                "representation.network.length_scale = NaN",
            ),
            (
                "representation.network.rate=-1",
                "representation.network.rate = -1 is not allowed: 1e-12 to 10 (a learning rate)",
            ),
            (
                "representation.network.rate=0",
                "representation.network.rate = 0 is not allowed: 1e-12 to 10 (a learning rate)",
            ),
            ("simulation.hole.spin=2", "simulation.hole.spin = 2"),
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
        check(BUILT_IN, FitFile::keys()).unwrap();
        let own = apply_override(BUILT_IN, "representation.own.settings.width=1e20").unwrap();
        check(&own, FitFile::keys()).unwrap();
        check(&apply_override(BUILT_IN, "region.z_width=inf").unwrap(), FitFile::keys()).unwrap();
    }
}

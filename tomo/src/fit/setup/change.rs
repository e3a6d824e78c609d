//! Change of emission while matter carries it, from settings.

use super::{Instrument, Result};
use crate::fit::linear::Change;
use crate::fit::settings::{AxisSearch, ChangeSettings, FitFile, Kind, Within, refuse};
use crate::fit::{Motion, Region};
use crate::representation::{Allowed, Knots};

impl ChangeSettings {
    /// The change in a region with its knots over these times of emission, M since the reference time.
    ///
    /// # Errors
    /// If a number is out of range.
    pub fn over(&self, times: [f64; 2], region: Region) -> Result<Change> {
        let knots = Knots::between(times, self.spacing, self.allowed).within("change")?;
        Change { knots, weight: self.weight, within: Some(region), sharpen: self.sharpen }
            .checked()
            .within("change")
    }
}

/// First and last time at which light of the movie is emitted, M since the reference time.
pub fn emission_times(instrument: &Instrument, motion: &Motion) -> [f64; 2] {
    let delays = &instrument.lines.delay;
    let bound = |of: fn(f64, f64) -> f64, none: f64| match delays.is_empty() {
        true => 0.0,
        false => delays.iter().fold(none, |bound, delay| of(bound, *delay)),
    };
    let (least, most) = (bound(f64::min, f64::INFINITY), bound(f64::max, f64::NEG_INFINITY));
    // Light of the first frame with the longest delay left first.
    let first = motion.times.iter().fold(f64::INFINITY, |first, time| first.min(*time)) - most;
    let last = motion.times.iter().fold(f64::NEG_INFINITY, |last, time| last.max(*time)) - least;
    let from = motion.injection.map_or(first, |injection| injection.time.max(first));
    // An injection after the last light leaves no time, rather than a negative one.
    [from - motion.reference, last.max(from) - motion.reference]
}

/// Returns the change of emission in a fit, with the knots over these times of emission, M since the
/// reference time.
///
/// # Errors
/// If a number is out of range.
pub fn change(file: &FitFile, times: [f64; 2]) -> Result<Change> {
    file.change.map_or(Ok(Change::NONE), |change| change.over(times, file.region.limits()))
}

/// Refuses what emission that changes does not go with.
pub(super) fn check(file: &FitFile) -> Result<()> {
    let Some(change) = file.change else { return Ok(()) };
    // Of any length: the spacing against the data is told once rays are traced.
    change.over([0.0, 0.0], file.region.limits())?;
    check_sharpen(file, change)?;
    match file.representation.kind {
        Kind::LinearGrid if file.axis != (AxisSearch::Known {}) => refuse!(
            "change with a linear-grid needs a known axis; add `[axis.known]` and `axis` in [motion]"
        ),
        Kind::LinearGrid => {}
        Kind::Mlp4d => refuse!("change does not apply to mlp4d, which is free at every time"),
        _ if change.allowed == Allowed::Births => refuse!(
            "change.allowed = \"births\" needs representation.kind = \"linear-grid\"; what is learnt in steps may appear \
             and fade: \"any\""
        ),
        _ => {}
    }
    Ok(())
}

/// Refuses cheaper births where there are none, or no round that knows of them.
fn check_sharpen(file: &FitFile, change: ChangeSettings) -> Result<()> {
    if change.sharpen.is_none() {
        return Ok(());
    }
    if change.allowed != Allowed::Births {
        refuse!("change.sharpen needs change.allowed = \"births\"");
    }
    let rounds = file.linear.as_ref().map_or(0, |linear| linear.rounds);
    if rounds < 2 {
        refuse!(
            "change.sharpen needs linear.rounds of 2 or more, not {rounds}: the first does not know yet where births are"
        );
    }
    Ok(())
}

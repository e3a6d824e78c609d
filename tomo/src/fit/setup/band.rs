//! Geometries that are weighed by the light curve of a flare in an orbital band, from settings.

mod background;
mod kept;

use super::{Curve, FitData, Instrument, Result, axis, hours_per_m, motion};
use crate::fit::band::{
    Band, BandPrior, CurveRows, Interval, PolarGrid, Sampling, UNLIKELY, Weighed, evidence, places,
    together, validation, without_flare,
};
use crate::fit::journal::{self, Journal};
use crate::fit::settings::{BandSettings, FitError, FitFile, refuse};
use crate::fit::{BackgroundDatum, ForwardModel, Motion};
use background::{backgrounds, expected};
use kerrlight_render::dynamics::AngularVelocity;
use kerrlight_render::polarization::StokesParameter;
use rayon::prelude::*;
use std::sync::Arc;

/// A geometry, and how probable it is.
#[derive(Clone, Debug, PartialEq)]
pub struct BandGeometry {
    /// Angle from the spin to the observer, degrees.
    pub inclination_deg: f64,
    /// Angular velocity over that of the law.
    pub rotation_factor: f64,
    /// Position angle of the spin, degrees east of north.
    pub position_angle_deg: f64,
    /// ln of the probability, up to what all geometries share: the evidence, and sin i of axes in any direction.
    pub ln_posterior: f64,
    /// ln of the evidence of each radius.
    pub by_radius: Vec<f64>,
    /// The most probable band.
    pub band: Band,
    /// Bands that are nearly as probable, with the ln of the evidence of each.
    pub likely: Vec<(Band, f64)>,
}

/// Result of a scan of bands.
#[derive(Clone, Debug)]
pub struct BandScan {
    /// All geometries.
    pub geometries: Vec<BandGeometry>,
    /// Radii of the bands, M.
    pub radii: Vec<f64>,
    /// Index of the most probable geometry.
    pub best: usize,
    /// Distance of the emission from the axis, M, in all geometries that are likely.
    pub radius: Interval,
    /// Its azimuth at the reference time, radians.
    pub azimuth: Interval,
    /// χ² per datum of the data that were not used, with the covariance that the best geometry expects of them; none without
    /// any.
    pub validation: Option<f64>,
    /// ln of the probability of the data with a flare, all geometries together, over that without one.
    pub ln_bayes_factor: Option<f64>,
    /// Periods of the orbit in minutes, geometry by geometry and radius by radius; infinite where matter stands still.
    pub periods_min: Vec<Vec<f64>>,
    /// Expected background at all data in the best geometry and its standard deviation, Jy; none if there is none.
    pub background: Option<Vec<BackgroundDatum>>,
}

/// Told how many geometries are done; says whether to go on.
pub type BandWatch<'a> = dyn Fn(usize) -> bool + Sync + 'a;

/// Weighs all geometries; none if it was cancelled. Geometries that the journal knows of an earlier call are not weighed again.
///
/// # Errors
/// If there is no light curve, or a setting is out of range.
pub fn scan_band(
    file: &FitFile,
    measured: &FitData,
    settings: &BandSettings,
    journal: &dyn Journal,
    watch: &BandWatch<'_>,
) -> Result<Option<BandScan>> {
    let curve = check_band(file, measured, settings)?;
    let scanner = Scanner { file, measured, settings, curve };
    let flows = flows(settings);
    let done = std::sync::atomic::AtomicUsize::new(0);
    let one = |flow: &Flow| -> Result<Option<Vec<BandGeometry>>> {
        let count = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        if !watch(count) {
            return Ok(None);
        }
        // One entry for all position angles, which share the rows.
        let Flow { inclination_deg, rotation_factor } = *flow;
        let key = journal::key(("band", inclination_deg.to_bits(), rotation_factor.to_bits()));
        let kept = journal.recall(key).and_then(|numbers| BandGeometry::of_numbers(&numbers));
        if kept.is_some() {
            return Ok(kept);
        }
        let found = scanner.weighed(*flow)?;
        journal.keep(key, &BandGeometry::numbers(&found));
        Ok(Some(found))
    };
    let all: Vec<Option<Vec<BandGeometry>>> = flows.par_iter().map(one).collect::<Result<_>>()?;
    let Some(all) = all.into_iter().collect::<Option<Vec<_>>>() else { return Ok(None) };
    let geometries: Vec<BandGeometry> = all.into_iter().flatten().collect();
    let better =
        |a: &usize, b: &usize| geometries[*a].ln_posterior.total_cmp(&geometries[*b].ln_posterior);
    let best = (0..geometries.len()).max_by(better).unwrap_or(0);
    let [azimuth, radius] = scanner.placed(&geometries, best)?;
    let geometry = &geometries[best];
    let rows = scanner.rows(geometry.flow())?;
    let data = turned(curve, geometry.position_angle_deg);
    let validation = validation(&rows, &data, &geometry.band)?;
    // Against noise alone anything that varies is a flare.
    let has_background = settings.background.is_some();
    let ln_bayes_factor = || ln_bayes_factor(&rows, &data, &geometries, settings);
    let ln_bayes_factor = has_background.then(ln_bayes_factor).transpose()?;
    let background = has_background.then(|| expected(&rows, curve, &data, geometry)).transpose()?;
    let radii = settings.radii.values();
    let period = |geometry: &BandGeometry| scanner.periods(geometry, &radii);
    let periods_min = geometries.iter().map(period).collect::<Result<_>>()?;
    Ok(Some(BandScan {
        geometries,
        radii,
        best,
        radius,
        azimuth,
        validation,
        ln_bayes_factor,
        periods_min,
        background,
    }))
}

/// A light curve, and the settings by which it weighs geometries.
struct Scanner<'a> {
    file: &'a FitFile,
    measured: &'a FitData,
    settings: &'a BandSettings,
    curve: &'a Curve,
}

impl Scanner<'_> {
    /// Periods of orbits at some radii in a geometry, minutes.
    fn periods(&self, geometry: &BandGeometry, radii: &[f64]) -> Result<Vec<f64>> {
        let velocity = band_motion(self.file, self.measured, geometry.rotation_factor)?.velocity;
        let minutes = 60.0 * hours_per_m(self.file)?;
        let of = |radius: &f64| core::f64::consts::TAU / velocity.rate(*radius).abs() * minutes;
        Ok(radii.iter().map(of).collect())
    }

    /// Azimuth and radius of the emission, in all geometries that are likely.
    fn placed(&self, geometries: &[BandGeometry], best: usize) -> Result<[Interval; 2]> {
        let most = geometries[best].ln_posterior;
        let likely: Vec<&BandGeometry> =
            geometries.iter().filter(|geometry| geometry.ln_posterior > most - UNLIKELY).collect();
        let one = |geometry: &&BandGeometry| {
            let rows = self.rows(geometry.flow())?;
            let of = |(band, ln): &(Band, f64)| (*band, ln + direction(geometry.inclination_deg));
            let bands: Vec<(Band, f64)> = geometry.likely.iter().map(of).collect();
            places(&rows, &turned(self.curve, geometry.position_angle_deg), &bands)
        };
        let all = likely.par_iter().map(one).collect::<Result<Vec<_>>>()?.concat();
        let none =
            || FitError::Conflict("band: the data do not say where any emission is".to_owned());
        Ok(together(&all).ok_or_else(none)?)
    }

    /// All position angles of a geometry.
    fn weighed(&self, flow: Flow) -> Result<Vec<BandGeometry>> {
        let rows = self.rows(flow)?;
        let angles = &self.settings.position_angles_deg;
        let data: Vec<Vec<f64>> = angles.iter().map(|angle| turned(self.curve, *angle)).collect();
        let weighed = evidence(&rows, &data, &prior(self.settings))?;
        let Flow { inclination_deg, rotation_factor } = flow;
        let one = |(angle, weighed): (&f64, Weighed)| BandGeometry {
            inclination_deg,
            rotation_factor,
            position_angle_deg: *angle,
            ln_posterior: weighed.ln_evidence + direction(inclination_deg),
            by_radius: weighed.by_radius,
            band: weighed.best,
            likely: weighed.likely,
        };
        Ok(angles.iter().zip(weighed).map(one).collect())
    }

    /// The rows of a geometry, over the errors of the data.
    fn rows(&self, flow: Flow) -> Result<CurveRows> {
        // All position angles share the rows: data are turned in place of them.
        let file = in_band_geometry(self.file, flow.inclination_deg, 0.0);
        let instrument = Instrument::new(&file)?;
        let mut model: ForwardModel<f32> =
            instrument.forward(&band_motion(&file, self.measured, flow.rotation_factor)?)?;
        let axis = axis(&file)?.0;
        model.weigh(axis);
        let Curve { parameters, hours, data, fitted, .. } = self.curve;
        let scale = |datum: &Option<[f64; 2]>| datum.map_or(0.0, |[_, sigma]| 1.0 / sigma);
        let scales = data.iter().map(scale).collect();
        let minutes = hours.iter().map(|hour| 60.0 * (hour - hours[0])).collect();
        let sampling = Sampling { minutes, scales };
        // What was not measured has a row and a value of 0: used, it changes no probability; unused, it
        // would count among the data that judge.
        let used = |k: usize| fitted[k / parameters.len()] || data[k].is_none();
        let used = (0..data.len()).map(used).collect();
        Ok(CurveRows::of(&model, axis, grid(&file, self.settings), sampling, used))
    }
}

/// ln of the probability of the data with a flare over that without one: the mean over the prior of the geometries.
fn ln_bayes_factor(
    rows: &CurveRows,
    data: &[f64],
    geometries: &[BandGeometry],
    settings: &BandSettings,
) -> Result<f64> {
    let most =
        geometries.iter().map(|geometry| geometry.ln_posterior).fold(f64::NEG_INFINITY, f64::max);
    let (mut with, mut prior) = (0.0, 0.0);
    for geometry in geometries {
        with += (geometry.ln_posterior - most).exp();
        prior += direction(geometry.inclination_deg).exp();
    }
    let without = without_flare(rows, &[data.to_vec()], &backgrounds(settings))?[0];
    // sin i in both sums: their ratio is the mean evidence over the prior.
    Ok(most + (with / prior).ln() - without)
}

impl BandGeometry {
    /// Inclination and angular velocity.
    fn flow(&self) -> Flow {
        let Self { inclination_deg, rotation_factor, .. } = *self;
        Flow { inclination_deg, rotation_factor }
    }
}

/// ln of the prior of an axis that points anywhere; just above the poles, where it is 0.
fn direction(inclination_deg: f64) -> f64 {
    inclination_deg.to_radians().sin().max(1e-6).ln()
}

/// The light curve, if geometries can be weighed by it with these settings.
///
/// # Errors
/// If there is none, or a setting is out of range.
pub fn check_band<'a>(
    file: &FitFile,
    measured: &'a FitData,
    settings: &BandSettings,
) -> Result<&'a Curve> {
    let Some(curve) = &measured.curve else {
        refuse!("band needs a light curve of its own: [light_curve] or [data.light-curve]");
    };
    if let Some(background) = &settings.background {
        background::check(background, curve)?;
    }
    for (key, steps) in [("inclinations_deg", settings.inclinations_deg), ("radii", settings.radii)]
    {
        if steps.values().is_empty() {
            let allowed = format!("from ({}) or above", steps.from);
            return Err(FitError::range(format!("band.{key}.to"), steps.to, &allowed).into());
        }
    }
    prior(settings).checked()?;
    check_rings(file, settings)?;
    if settings.rotation_factors.is_empty() || settings.position_angles_deg.is_empty() {
        refuse!("band: rotation_factors and position_angles_deg need one value or more");
    }
    let all = [
        ("rotation_factors", &settings.rotation_factors),
        ("position_angles_deg", &settings.position_angles_deg),
        ("widths", &settings.widths),
        ("lengths", &settings.lengths),
    ];
    for (key, values) in all {
        let is_twice = |k: &usize| values[..*k].contains(&values[*k]);
        if let Some(k) = (1..values.len()).find(is_twice) {
            let allowed = "a value once: each is as probable as the others";
            return Err(FitError::range(format!("band.{key}.{k}"), values[k], allowed).into());
        }
    }
    let turns = settings.position_angles_deg.iter().any(|angle| *angle != 0.0);
    if turns && !can_turn(curve) {
        refuse!(
            "band.position_angles_deg needs loss.0.stokes = [\"Q\", \"U\"] with the same error of both"
        );
    }
    if file.change.is_some() {
        refuse!(
            "[change] is not allowed with [band]: matter of a band carries its emission unchanged"
        );
    }
    let angle = file.observer.position_angle_deg.value();
    if angle != 0.0 {
        let allowed = "0 with [band], whose position_angles_deg are those of the spin";
        return Err(FitError::range("observer.position_angle_deg", angle, allowed).into());
    }
    let vector = axis(file)?.0.vector();
    if vector[2].abs() < 1.0 - 1e-9 {
        let [x, y, z] = vector;
        refuse!(
            "an axis of [{x}, {y}, {z}] is not allowed with [band], whose circles lie about [0, 0, 1]"
        );
    }
    Ok(curve)
}

/// Refuses rings that are farther apart than the narrowest band is wide.
fn check_rings(file: &FitFile, settings: &BandSettings) -> Result<()> {
    let narrowest = settings.widths.iter().copied().fold(f64::INFINITY, f64::min);
    let apart = file.region.r_max / (settings.nodes as f64 - 1.0);
    if apart > narrowest {
        let least = (file.region.r_max / narrowest).ceil() + 1.0;
        let allowed = format!(
            "{least} or more: rings would be {apart:.2} M apart, and the narrowest band is {narrowest} M wide (band.widths)"
        );
        return Err(FitError::range("band.nodes", settings.nodes, &allowed).into());
    }
    Ok(())
}

/// Returns whether every frame has Q and U, in this order, with the same error: noise then has no direction.
fn can_turn(curve: &Curve) -> bool {
    let same = |pair: &[Option<[f64; 2]>]| match pair {
        [Some([_, a]), Some([_, b])] => (a - b).abs() <= 1e-9 * a,
        pair => pair.iter().all(Option::is_none),
    };
    curve.parameters == [StokesParameter::Q, StokesParameter::U] && curve.data.chunks(2).all(same)
}

fn prior(settings: &BandSettings) -> BandPrior {
    let BandSettings { radii, widths, lengths, height, .. } = settings;
    let usual = BandPrior::usual(radii.values(), widths.clone(), lengths.clone(), *height);
    BandPrior { backgrounds: backgrounds(settings), ..usual }
}

/// A flow as it is seen.
#[derive(Clone, Copy)]
struct Flow {
    inclination_deg: f64,
    /// Velocity of the matter over that of the law of motion.
    rotation_factor: f64,
}

fn flows(settings: &BandSettings) -> Vec<Flow> {
    let inclinations = settings.inclinations_deg.values();
    let of = |factor: &f64| -> Vec<Flow> {
        let of = |i: &f64| Flow { inclination_deg: *i, rotation_factor: *factor };
        inclinations.iter().map(of).collect()
    };
    settings.rotation_factors.iter().flat_map(of).collect()
}

/// The settings of a geometry.
pub fn in_band_geometry(file: &FitFile, inclination_deg: f64, position_angle_deg: f64) -> FitFile {
    let mut file = file.clone();
    file.observer.inclination_deg = inclination_deg.into();
    file.observer.position_angle_deg = position_angle_deg.into();
    file
}

/// Returns the motion of matter in a geometry.
///
/// # Errors
/// If the motion is out of range.
pub fn band_motion(file: &FitFile, measured: &FitData, factor: f64) -> Result<Motion> {
    let plain = motion(file, measured.times.clone())?;
    let velocity = match plain.velocity {
        law if factor == 1.0 => law,
        AngularVelocity::Falling(flow) => AngularVelocity::Falling(Arc::new(flow.scaled(factor))),
        law => AngularVelocity::Scaled { of: Box::new(law), factor },
    };
    Ok(Motion { velocity, ..plain })
}

/// Three times as many nodes round the axis as away from it, and layers twice as far apart.
fn grid(file: &FitFile, settings: &BandSettings) -> PolarGrid {
    let (radius, rings) = (file.region.r_max, settings.nodes);
    // Beyond three scale heights the envelope is below 1.2 %.
    let height = file.region.z_width.unwrap_or(radius).min(3.0 * settings.height).min(radius);
    let apart = 2.0 * radius / (rings - 1) as f64;
    let layers = (2.0 * height / apart).ceil() as usize + 1;
    PolarGrid { radius, rings, azimuths: 3 * rings, height, layers }
}

/// The data over their errors, seen by who is turned by a position angle; 0 where there are none.
fn turned(curve: &Curve, angle_deg: f64) -> Vec<f64> {
    let value = |datum: &Option<[f64; 2]>| datum.map_or(0.0, |[flux, sigma]| flux / sigma);
    let mut all: Vec<f64> = curve.data.iter().map(value).collect();
    turn(&mut all, angle_deg);
    all
}

/// Pairs of Q and U, seen by who is turned by a position angle.
fn turn(pairs: &mut [f64], angle_deg: f64) {
    if angle_deg == 0.0 {
        return;
    }
    let (sin, cos) = (2.0 * angle_deg.to_radians()).sin_cos();
    for pair in pairs.chunks_exact_mut(2) {
        let (q, u) = (pair[0], pair[1]);
        (pair[0], pair[1]) = (q * cos + u * sin, u * cos - q * sin);
    }
}

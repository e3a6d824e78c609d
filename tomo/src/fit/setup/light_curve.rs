//! Light curves as the data of a fit: simulated, or measured.

use super::curve::Curve;
use super::observable::seen;
use super::{FitData, Instrument, Result, Truth, hours_per_m, motion};
use crate::fit::band::Background;
use crate::fit::settings::{
    DataFiles, FitError, FitFile, MeasuredCurve, Noise, PerStokes, SimulatedCurve, Within, refuse,
};
use crate::fit::{FluxDatum, Observable};
use kerrlight_render::polarization::StokesParameter;
use kerrlight_vlbi::light_curve::LightCurve;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

impl FitData {
    /// Takes a measured light curve as the data. `name` is what it is called in messages.
    ///
    /// # Errors
    /// If nothing is left of it, a parameter or an error is missing, or mass or settings are.
    pub fn of_light_curve(file: &FitFile, curve: LightCurve, name: &str) -> Result<Self> {
        let (Some(DataFiles::LightCurve(settings)), Observable::Fluxes(parameters)) =
            (&file.data, seen(file)?)
        else {
            refuse!("{name} holds a light curve, and there is no [data.light-curve]")
        };
        check_samples(&curve).within(name)?;
        let curve = prepared(curve, settings).within(name)?;
        let hours: Vec<f64> = curve.samples.iter().map(|sample| sample.time_h).collect();
        let data = curve.samples.iter().flat_map(|sample| {
            parameters.iter().map(|parameter| datum(sample, *parameter)).collect::<Vec<_>>()
        });
        let data = data.collect::<Result<Vec<_>>>().within(name)?;
        if data.iter().all(Option::is_none) {
            refuse!("{name}: there are no fluxes of the parameters of loss.0.stokes");
        }
        let fitted = fitted(&hours, settings.validate_after_min)?;
        let times = times(file, &hours, settings.first_time)?;
        let curve = Curve { parameters, hours, data, fitted, background: None };
        Ok(Self { times, curve: Some(curve), ..Self::default() })
    }
}

/// Refuses samples that are not in order of time, and numbers that are none.
fn check_samples(curve: &LightCurve) -> Result<()> {
    let times: Vec<f64> = curve.samples.iter().map(|sample| sample.time_h).collect();
    if times.iter().any(|time| !time.is_finite()) || times.windows(2).any(|pair| pair[1] < pair[0])
    {
        refuse!("times of samples are finite and ascend");
    }
    for sample in &curve.samples {
        for flux in sample.stokes.iter().flatten() {
            if !flux.jy.is_finite() || flux.sigma_jy.is_some_and(|s| !(s >= 0.0 && s.is_finite())) {
                refuse!(
                    "a flux of {} Jy with an error of {:?} at {} h is not allowed: finite, with a finite error",
                    flux.jy,
                    flux.sigma_jy,
                    sample.time_h
                );
            }
        }
    }
    Ok(())
}

/// The flux of a parameter with its error, if it was measured.
fn datum(
    sample: &kerrlight_vlbi::light_curve::Sample,
    parameter: StokesParameter,
) -> Result<Option<FluxDatum>> {
    let Some(flux) = sample.stokes[parameter.index()] else { return Ok(None) };
    let Some(sigma) = flux.sigma_jy else {
        let name = parameter.name();
        refuse!(
            "{name} at {} h has no error: give a column sigma_{name}, or `sigma = {{ {name} = … }}` in [data.light-curve]",
            sample.time_h
        )
    };
    Ok(Some([flux.jy, sigma]))
}

/// Returns a file's light curve after its selection.
fn prepared(mut curve: LightCurve, settings: &MeasuredCurve) -> Result<LightCurve> {
    check_positive("data.light-curve.average", settings.average.map(|count| count as f64))?;
    check_positive("data.light-curve.average_s", settings.average_s)?;
    check_positive("data.light-curve.most_gap_s", settings.most_gap_s)?;
    if settings.average.is_some() && settings.average_s.is_some() {
        refuse!("average and average_s of [data.light-curve] exclude each other");
    }
    if let Some(hours) = settings.utc_h {
        if hours[0] > hours[1] {
            let allowed = format!("the first hour ({}) or later", hours[0]);
            return Err(FitError::range("data.light-curve.utc_h.1", hours[1], &allowed).into());
        }
        curve = curve.cropped(hours);
    }
    if let Some(count) = settings.average {
        curve = curve.averaged(count);
    }
    if let Some(seconds) = settings.average_s {
        curve = curve.averaged_over(seconds);
    }
    if let Some(most) = settings.most_gap_s {
        curve = curve.without_gaps(most);
    }
    // Averaging would lower them: stated errors are those of the averages.
    if let Some(sigmas) = settings.sigma {
        curve = curve.with_sigmas(checked(sigmas, "data.light-curve.sigma")?.all());
    }
    if let Some(steady) = settings.steady {
        curve = curve.less(steady.all().map(|jy| jy.unwrap_or(0.0)));
    }
    if let Some(angle) = settings.derotation_deg {
        curve = curve.turned(angle);
    }
    if let Some(jy) = settings.intensity {
        // Of I alone: errors of Q and U have been turned.
        curve = curve.with_intensity(jy, settings.sigma.and_then(|sigma| sigma.all()[0]));
    }
    if curve.samples.is_empty() {
        refuse!("no samples are left: see utc_h, average and most_gap_s of [data.light-curve]");
    }
    Ok(curve)
}

fn checked(sigmas: PerStokes, key: &str) -> Result<PerStokes> {
    for parameter in StokesParameter::ALL {
        check_positive(&format!("{key}.{}", parameter.name()), sigmas.of(parameter))?;
    }
    Ok(sigmas)
}

fn check_positive(key: &str, value: Option<f64>) -> Result<()> {
    match value.filter(|value| !(*value > 0.0 && value.is_finite())) {
        Some(bad) => Err(FitError::range(key, bad, "above 0").into()),
        None => Ok(()),
    }
}

/// Returns whether each frame is fitted.
fn fitted(hours: &[f64], after_min: Option<f64>) -> Result<Vec<bool>> {
    let last = after_min.unwrap_or(f64::INFINITY);
    let fitted: Vec<bool> = hours.iter().map(|h| (h - hours[0]) * 60.0 <= last).collect();
    if !fitted.contains(&true) {
        refuse!("validate_after_min = {last} leaves nothing to fit");
    }
    Ok(fitted)
}

fn times(file: &FitFile, hours: &[f64], first: f64) -> Result<Vec<f64>> {
    let per_m = hours_per_m(file)?;
    Ok(hours.iter().map(|h| first + (h - hours[0]) / per_m).collect())
}

/// The light curve of a truth.
pub(super) fn simulate(
    file: &FitFile,
    fit: &FitFile,
    instrument: &Instrument,
    settings: &SimulatedCurve,
) -> Result<FitData> {
    let Observable::Fluxes(parameters) = seen(fit)? else {
        refuse!("there is no loss of a light curve")
    };
    let hours = hours(settings)?;
    let times = times(file, &hours, settings.first_time)?;
    let mut truth = Truth::new(file)?;
    let motion = motion(file, times.clone())?;
    if let Some(mean) = settings.mean_flux {
        check_positive("simulation.light_curve.mean_flux.jy", Some(mean.jy))?;
        let fluxes = truth.movie_through(&mut instrument.summed(&motion, &[StokesParameter::I])?);
        let first = hours.iter().take_while(|h| (*h - hours[0]) * 60.0 <= mean.minutes).count();
        let now = fluxes[..first].iter().sum::<f64>() / first.max(1) as f64;
        if !(now > 0.0 && first > 0) {
            refuse!("simulation.light_curve.mean_flux: the truth is dark in these {first} samples");
        }
        truth.scale(mean.jy / now);
    }
    let mut fluxes = truth.movie_through(&mut instrument.summed(&motion, &parameters)?);
    // What does not move has fluxes of its own, which `mean_flux` does not scale.
    truth.rings.add_to_fluxes(&mut fluxes, &parameters);
    if let Some(background) = settings.background {
        add_background(&mut fluxes, &parameters, &hours, background, file.seed)?;
    }
    let data = measure(&fluxes, &parameters, settings, file.seed)?;
    let movie = Some(truth.movie(file, instrument, &times)?);
    let fitted = fitted(&hours, settings.validate_after_min)?;
    let curve = Some(Curve { parameters, hours, data, fitted, background: None });
    Ok(FitData { times, movie, curve, truth: Some(truth), ..FitData::default() })
}

/// Adds a draw of a background to Q and U.
fn add_background(
    fluxes: &mut [f64],
    parameters: &[StokesParameter],
    hours: &[f64],
    background: Background,
    seed: u64,
) -> Result<()> {
    let minutes: Vec<f64> = hours.iter().map(|hour| 60.0 * hour).collect();
    // Streams of their own: background and noise of one seed are independent.
    let mut random = Pcg64Mcg::seed_from_u64(seed ^ 0xbac6_0d17);
    for (place, parameter) in parameters.iter().enumerate() {
        let normal: Vec<f64> = hours.iter().map(|_| random.sample(StandardNormal)).collect();
        if !matches!(parameter, StokesParameter::Q | StokesParameter::U) {
            continue;
        }
        let light =
            background.drawn(&minutes, &normal).within("simulation.light_curve.background")?;
        let own = fluxes.iter_mut().skip(place).step_by(parameters.len());
        own.zip(light).for_each(|(flux, light)| *flux += light);
    }
    Ok(())
}

fn hours(settings: &SimulatedCurve) -> Result<Vec<f64>> {
    let hours = settings.times_h.clone().unwrap_or_default();
    if hours.is_empty() {
        let why =
            "give `times_h = [ … ]`, hours of UTC, or `times = \"FILE.csv\"` with such a column";
        return Err(FitError::missing("simulation.light_curve.times_h", why).into());
    }
    if !hours.is_sorted() || hours.iter().any(|h| !(-1e4..=1e4).contains(h)) {
        refuse!("simulation.light_curve.times_h: hours of UTC in growing order");
    }
    Ok(hours)
}

/// Fluxes with noise of their own for each parameter.
fn measure(
    fluxes: &[f64],
    parameters: &[StokesParameter],
    settings: &SimulatedCurve,
    seed: u64,
) -> Result<Vec<Option<FluxDatum>>> {
    let sigmas = checked(settings.sigma, "simulation.light_curve.sigma")?;
    let mut random = Pcg64Mcg::seed_from_u64(seed ^ 0x1165_c04e);
    let mut one = |k: usize| {
        let parameter = parameters[k % parameters.len()];
        let missing = || {
            let key = format!("simulation.light_curve.sigma.{}", parameter.name());
            FitError::missing(&key, "its standard deviation in Jy")
        };
        let sigma = sigmas.of(parameter).ok_or_else(missing)?;
        let drawn: f64 = random.sample(StandardNormal);
        let noise = if settings.noise == Noise::Thermal { drawn * sigma } else { 0.0 };
        Ok(Some([fluxes[k] + noise, sigma]))
    };
    (0..fluxes.len()).map(&mut one).collect()
}

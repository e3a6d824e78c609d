//! Settings for a light curve: what its numbers tell, and what has to be assumed.

use super::sources::Source;
use super::template::{complete, digits, plain_words};
use anyhow::bail;
use kerrlight_render::polarization::StokesParameter;
use kerrlight_vlbi::light_curve::{LightCurve, Sample};
use std::fmt::Write;

/// Samples that are left, at most about.
const SAMPLES: f64 = 100.0;
/// Hours that a flare is taken to last.
const SPAN_H: f64 = 2.0;
/// Hours of a curve that is taken as a whole.
const WHOLE_H: f64 = 2.5;
/// Part of the span's samples that is fitted; the rest judges the fit.
const FITTED: f64 = 0.8;
/// Part of the mean polarised flux that calibration and leakage are taken to leave as an error.
const CALIBRATED: f64 = 0.02;
/// Part of its flux by which a curve has to vary.
const STEADY: f64 = 1e-9;

/// Emission 1 in a flare of 0.3 Jy, with the pixels of the template.
const JY_PER_PIXEL: f64 = 0.08 / 0.3;

/// A field and a law, where there is polarised light to fit.
const POLARIZATION: &str = "[polarization]
field = { vertical = 1.0, radial = 0.0, toroidal = 0.0, radial_sine_power = 0.0 } #! a vertical field
components = \"orthonormal\"
frame = \"ideal\"
redshift_power = 3.0 #! a spectral index of 1
field_power = 2.0
sine_power = 2.0
fraction = 0.75 #! what a spectral index of 1 allows
normalisation = \"mean-field\"
turn_deg = 0.0 #! no Faraday rotation is left in the data";

/// Parts of a curve that are fitted.
struct Fitted {
    parameters: Vec<StokesParameter>,
    /// Samples of the span, averaged.
    curve: LightCurve,
    samples: usize,
    /// First and last hour, where the curve is longer.
    span: Option<[f64; 2]>,
    average_s: Option<f64>,
}

/// The plain settings of a fit of this curve; `path` is quoted, and `source` what the file or its name says of the source.
///
/// # Errors
/// If it has no fluxes to speak of.
pub fn of_light_curve(
    curve: &LightCurve,
    path: &str,
    name: &str,
    source: Option<&Source>,
) -> anyhow::Result<String> {
    let fitted = Fitted::of(curve)?;
    let polarized = fitted.parameters.len() == 2;
    let (mean, scatter, sigma) = (fitted.means(), fitted.scatter(), fitted.sigma());
    let most = mean.iter().fold(0.0f64, |most, x| most.max(x.abs()));
    if scatter <= STEADY * most || sigma.0 <= 0.0 {
        bail!("{name}: the light curve does not vary: there is nothing to fit");
    }
    let all = |values: &[f64]| {
        let one = |(p, x): (&StokesParameter, &f64)| format!("{} = {}", p.name(), digits(*x));
        let each: Vec<String> = fitted.parameters.iter().zip(values).map(one).collect();
        format!("{{ {} }}", each.join(", "))
    };
    let errors = all(&vec![sigma.0; fitted.parameters.len()]);
    let turned: Vec<String> = (0..9).map(|k| format!("{}.0", 20 * k)).collect();
    let flare = if polarized { 2.0 * scatter } else { scatter };
    let names: Vec<String> =
        fitted.parameters.iter().map(|p| format!("\"{}\"", p.name())).collect();
    let fields = [
        ("read", fitted.read(name)),
        ("title", plain_words(name)),
        ("mass", mass(source)),
        ("jy", digits(flare * JY_PER_PIXEL)),
        (
            "redshift",
            if polarized { "" } else { "\nredshift_power = 3.0 #! a spectral index of 1" }
                .to_owned(),
        ),
        ("polarization", if polarized { POLARIZATION } else { "" }.to_owned()),
        ("path", path.to_owned()),
        ("prepared", fitted.prepared()),
        ("validate", format!("{:?}", fitted.validate_after_min())),
        ("held", fitted.held().to_string()),
        ("all", fitted.curve.samples.len().to_string()),
        ("errors", format!("sigma = {errors} #! {}", sigma.1)),
        ("steady", all(&mean)),
        (
            "steadiness",
            match polarized {
                true => "the middle of what may not move (band.background)",
                false => "what does not move is taken to be as bright as that",
            }
            .to_owned(),
        ),
        (
            "background",
            if polarized {
                background(scatter / (fitted.parameters.len() as f64).sqrt(), &fitted.curve)
            } else {
                String::new()
            },
        ),
        ("stokes", format!("[{}]", names.join(", "))),
        ("upper", "10.0".to_owned()),
        ("angles", format!("[{}]", if polarized { turned.join(", ") } else { "0.0".to_owned() })),
    ];
    complete(include_str!("light_curve.toml"), &fields)
}

/// The mass of a source that is known, or that it is left to the user.
fn mass(source: Option<&Source>) -> String {
    match source {
        Some(of) => format!("mass_msun = {:?} #! {}", of.mass_msun, of.mass),
        None => "#? mass_msun = 4.154e6 # neither the file's name nor a line `# source: SGRA` above its table names a source; this is Sgr A* (GRAVITY Collaboration 2019, A&A 625, L10)".to_owned(),
    }
}

/// Backgrounds about as bright as what varies in each of Q and U of the data, Jy, as fast as samples tell and as slow as all of
/// them: one that is faster than those of the list would look like a flare.
fn background(scatter: f64, curve: &LightCurve) -> String {
    let hours = |k: Option<&Sample>| k.map_or(0.0, |sample| sample.time_h);
    let span = 60.0 * (hours(curve.samples.last()) - hours(curve.samples.first())).max(1.0 / 60.0);
    let apart = curve.samples.windows(2).map(|pair| 60.0 * (pair[1].time_h - pair[0].time_h));
    let mut steps: Vec<f64> = apart.filter(|step| *step > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    let least = 2.0 * steps.get(steps.len() / 2).copied().unwrap_or(span);
    let times = core::iter::successors(Some(least.min(span)), |time| {
        (*time < span).then(|| (3.0 * time).min(span))
    });
    let times = times.map(digits).collect::<Vec<_>>().join(", ");
    let constant = digits(scatter);
    let variations = [0.2, 0.5, 1.0].map(|part| digits(part * scatter)).join(", ");
    format!(
        "
[band.background]
constant_jy = {constant} #! what does not move differs from the mean by as much as the data vary
variation_jy = [{variations}] #! of what varies, a small part, half or all does not orbit
correlation_min = [{times}] #! from two samples to the span: a background that varies faster looks like a flare
matern = [\"1/2\", \"5/2\"] #! as a damped random walk, or smoothly"
    )
}

impl Fitted {
    /// Q and U where both are there, I otherwise.
    fn of(curve: &LightCurve) -> anyhow::Result<Self> {
        let count = |parameter: StokesParameter| {
            curve.samples.iter().filter(|s| s.stokes[parameter.index()].is_some()).count()
        };
        let parameters = match [StokesParameter::Q, StokesParameter::U].map(count) {
            [q, u] if q.min(u) > 1 => vec![StokesParameter::Q, StokesParameter::U],
            _ if count(StokesParameter::I) > 1 => vec![StokesParameter::I],
            _ => bail!("a fit needs two samples or more of Q and U, or of I"),
        };
        let span = span(curve);
        let cropped = span.map_or_else(|| curve.clone(), |span| curve.clone().cropped(span));
        let samples = cropped.samples.len();
        let average_s = average_s(&cropped);
        let curve = match average_s {
            Some(seconds) => cropped.averaged_over(seconds),
            None => cropped,
        };
        Ok(Self { parameters, curve, samples, span, average_s })
    }

    /// Describes what is done with the file's samples before they are fitted, line by line.
    fn prepared(&self) -> String {
        let mut lines = Vec::new();
        if let Some([from, to]) = self.span {
            lines.push(format!(
                "utc_h = [{from:?}, {to:?}] #! the {SPAN_H:.0} hours with most samples: flares last about that long"
            ));
        }
        if let Some(seconds) = self.average_s {
            lines.push(format!(
                "average_s = {seconds:?} #! at most about {SAMPLES:.0} samples are left"
            ));
        }
        lines.iter().map(|line| format!("{line}\n")).collect()
    }

    /// Samples that judge the fit: a part of their number, wherever gaps lie.
    fn held(&self) -> usize {
        let all = self.curve.samples.len();
        // At least one sample is fitted, and at least one judges.
        all - ((FITTED * all as f64).round() as usize).clamp(1, all.saturating_sub(1).max(1))
    }

    /// Minutes from the first sample to the middle between the last that is fitted and the first that is not.
    fn validate_after_min(&self) -> f64 {
        let samples = &self.curve.samples;
        let minutes = |k: usize| {
            let [first, sample] = [0, k].map(|k| samples.get(k).or(samples.last()));
            60.0 * (sample.map_or(0.0, |s| s.time_h) - first.map_or(0.0, |s| s.time_h))
        };
        let fitted = samples.len() - self.held();
        // Half-way between two samples, so that rounding carries neither across.
        let middle = 0.5 * (minutes(fitted.saturating_sub(1)) + minutes(fitted));
        (1e4 * middle).round() / 1e4
    }

    /// Mean of the root of Q² + U², Jy; 0 where these are not fitted.
    fn polarized_flux(&self) -> f64 {
        if self.parameters.len() < 2 {
            return 0.0;
        }
        let [q, u] = [StokesParameter::Q, StokesParameter::U].map(|p| self.fluxes(p));
        let all = q.iter().zip(&u).map(|(q, u)| q.hypot(*u));
        all.sum::<f64>() / q.len().max(1) as f64
    }

    fn fluxes(&self, parameter: StokesParameter) -> Vec<f64> {
        let flux = |s: &Sample| s.stokes[parameter.index()].map(|flux| flux.jy);
        self.curve.samples.iter().filter_map(flux).collect()
    }

    fn means(&self) -> Vec<f64> {
        let mean = |p: &StokesParameter| {
            let fluxes = self.fluxes(*p);
            fluxes.iter().sum::<f64>() / fluxes.len().max(1) as f64
        };
        self.parameters.iter().map(mean).collect()
    }

    /// Root mean square about the means, of all parameters together, Jy.
    fn scatter(&self) -> f64 {
        let square = |(p, mean): (&StokesParameter, f64)| {
            let fluxes = self.fluxes(*p);
            fluxes.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / fluxes.len().max(1) as f64
        };
        self.parameters.iter().zip(self.means()).map(square).sum::<f64>().sqrt()
    }

    /// One error for all samples, Jy, and where it comes from.
    fn sigma(&self) -> (f64, String) {
        let errors = self
            .parameters
            .iter()
            .flat_map(|p| self.curve.samples.iter().filter_map(|s| s.stokes[p.index()]?.sigma_jy));
        let (sigma, from) = match median(errors.collect()) {
            Some(sigma) => (sigma, "the median of the file's errors"),
            None => {
                (self.jumps(), "the file has no errors: the scatter from one sample to the next")
            }
        };
        let calibrated = CALIBRATED * self.polarized_flux();
        if calibrated > sigma {
            let percent = 100.0 * CALIBRATED;
            let why =
                format!("{percent:.0} % of the mean polarised flux, for calibration and leakage");
            return (calibrated, why);
        }
        (sigma, from.to_owned())
    }

    /// Returns the errors from the scatter from one sample to the next, Jy.
    fn jumps(&self) -> f64 {
        let jumps = self.parameters.iter().flat_map(|p| {
            let fluxes = self.fluxes(*p);
            fluxes.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect::<Vec<_>>()
        });
        // The median of |x − y| of two normal numbers is 0.954 σ.
        median(jumps.collect()).unwrap_or(0.0) / 0.954
    }

    /// Describes the file, in a line.
    fn read(&self, name: &str) -> String {
        let hours: Vec<f64> = self.curve.samples.iter().map(|sample| sample.time_h).collect();
        let mut text = format!("{name}: {} samples", self.samples);
        if let [first, .., last] = hours[..] {
            // Writing to a string does not fail.
            let _ = write!(text, " from {first:.3} h to {last:.3} h UTC");
        }
        let names: Vec<&str> = self.parameters.iter().map(|p| p.name()).collect();
        text + &format!("; {} are fitted", names.join(" and "))
    }
}

/// The hours of a long curve with most samples.
fn span(curve: &LightCurve) -> Option<[f64; 2]> {
    let hours: Vec<f64> = curve.samples.iter().map(|sample| sample.time_h).collect();
    let (first, last) = (*hours.first()?, *hours.last()?);
    if last - first <= WHOLE_H {
        return None;
    }
    let count = |from: f64| hours.iter().filter(|h| (from..=from + SPAN_H).contains(*h)).count();
    let best = hours.iter().fold(first, |best, h| if count(*h) > count(best) { *h } else { best });
    let inside = hours.iter().filter(|h| (best..=best + SPAN_H).contains(*h));
    let end = inside.fold(best, |end, h| end.max(*h));
    // Outward, so that rounding cuts off no sample.
    Some([(1e3 * best).floor() / 1e3, (1e3 * end).ceil() / 1e3])
}

/// Seconds over which samples are averaged so that not too many are left; none where there are few.
fn average_s(curve: &LightCurve) -> Option<f64> {
    let count = curve.samples.len() as f64;
    if count < 1.2 * SAMPLES {
        return None;
    }
    let steps = curve.samples.windows(2).map(|pair| pair[1].time_h - pair[0].time_h);
    // Of one scan; gaps are longer, and several baselines have the same time.
    let step = 3600.0 * median(steps.filter(|step| *step > 0.0).collect())?;
    let rounded = 10.0 * (step * count / SAMPLES / 10.0).ceil();
    (rounded > step).then_some(rounded)
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_vlbi::files::parse_light_curve;

    /// 60 samples, a gap of half an hour, and 16 more: a fifth of them is 15, whatever the clock says.
    #[test]
    fn exact_a_fifth_of_the_samples_is_held_back() {
        let mut text = "time,I\n".to_owned();
        for k in 0..76 {
            let hours = 9.0 + f64::from(k) / 60.0 + if k < 60 { 0.0 } else { 0.5 };
            text += &format!("{hours},{}\n", 2.0 + 0.1 * f64::from(k % 7));
        }
        let curve = parse_light_curve(&text).unwrap();
        let fitted = Fitted::of(&curve).unwrap();
        let after = fitted.validate_after_min() / 60.0;
        let later = fitted.curve.samples.iter().filter(|sample| sample.time_h - 9.0 > after);
        assert_eq!((fitted.curve.samples.len(), fitted.held(), later.count()), (76, 15, 15));
        let text = of_light_curve(&curve, "\"a.csv\"", "a.csv", None).unwrap();
        assert!(text.contains("#! the last 15 of 76 samples, a fifth, judge the fit"), "{text}");
    }
}

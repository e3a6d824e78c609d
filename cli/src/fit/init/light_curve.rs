//! Settings for a light curve: what its numbers tell, and what has to be assumed.

use super::{complete, digits};
use anyhow::bail;
use kerrlight_tomo::interferometry::light_curve::LightCurve;
use kerrlight_tomo::polarization::StokesParameter;
use std::fmt::Write;

/// Samples that are left, about.
const SAMPLES: usize = 100;

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

/// What is fitted of a curve.
struct Fitted {
    parameters: Vec<StokesParameter>,
    curve: LightCurve,
    average: usize,
}

/// The plain settings of a fit of this curve; `path` is quoted.
///
/// # Errors
/// If it has no fluxes to speak of.
pub fn of_light_curve(curve: &LightCurve, path: &str, name: &str) -> anyhow::Result<String> {
    let fitted = Fitted::of(curve)?;
    let polarized = fitted.parameters.len() == 2;
    let (mean, scatter, sigma) = (fitted.means(), fitted.scatter(), fitted.sigma());
    if scatter <= 0.0 || sigma.0 <= 0.0 {
        bail!("the light curve does not vary: there is nothing to fit");
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
        ("title", super::plain_words(name)),
        ("jy", digits(flare * JY_PER_PIXEL)),
        (
            "redshift",
            if polarized { "" } else { "\nredshift_power = 3.0 #! a spectral index of 1" }
                .to_owned(),
        ),
        ("polarization", if polarized { POLARIZATION } else { "" }.to_owned()),
        ("path", path.to_owned()),
        ("average", fitted.average.to_string()),
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
        ("background", if polarized { background(scatter) } else { String::new() }),
        ("stokes", format!("[{}]", names.join(", "))),
        ("upper", "10.0".to_owned()),
        ("angles", format!("[{}]", if polarized { turned.join(", ") } else { "0.0".to_owned() })),
    ];
    complete(include_str!("light_curve.toml"), &fields)
}

/// A background about as bright as what varies in the data, Jy.
fn background(scatter: f64) -> String {
    let [constant, variation] = [scatter, 0.4 * scatter].map(digits);
    format!(
        "
[band.background]
constant_jy = {constant} #! what does not move differs from the mean by as much as the data vary
variation_jy = [{variation}] #! a part of what varies does not orbit
correlation_min = [20.0, 80.0] #! the source varies within such times
matern = [\"1/2\"] #! a damped random walk"
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
        let average = (curve.samples.len() / SAMPLES).max(1);
        Ok(Self { parameters, curve: curve.clone().averaged(average), average })
    }

    fn fluxes(&self, parameter: StokesParameter) -> Vec<f64> {
        let flux = |s: &kerrlight_tomo::interferometry::light_curve::Sample| {
            s.stokes[parameter.index()].map(|flux| flux.jy)
        };
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
    fn sigma(&self) -> (f64, &'static str) {
        let errors = self
            .parameters
            .iter()
            .flat_map(|p| self.curve.samples.iter().filter_map(|s| s.stokes[p.index()]?.sigma_jy));
        if let Some(sigma) = median(errors.collect()) {
            return (sigma, "the median of the file's errors; Q and U have to have the same");
        }
        let jumps = self.parameters.iter().flat_map(|p| {
            let fluxes = self.fluxes(*p);
            fluxes.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect::<Vec<_>>()
        });
        // The median of |x − y| of two normal numbers is 0.954 σ.
        let sigma = median(jumps.collect()).unwrap_or(0.0) / 0.954;
        (sigma, "the file has no errors: this is the scatter from one sample to the next")
    }

    /// What the file says, in a line.
    fn read(&self, name: &str) -> String {
        let hours: Vec<f64> = self.curve.samples.iter().map(|sample| sample.time_h).collect();
        let mut text = format!("{name}: {} samples", self.curve.samples.len() * self.average);
        if let [first, .., last] = hours[..] {
            // Writing to a string does not fail.
            let _ = write!(text, " from {first:.3} h to {last:.3} h UTC");
        }
        let names: Vec<&str> = self.parameters.iter().map(|p| p.name()).collect();
        text + &format!("; {} are fitted", names.join(" and "))
    }
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

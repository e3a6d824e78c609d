//! Settings of a static image, guessed from visibilities.

use super::{Source, complete, digits, gains, has_closures, plain_words, read, short_baselines};
use anyhow::Context;
use kerrlight_tomo::interferometry::observation::Observation;
use kerrlight_tomo::units::MICROARCSECOND;

/// The plain settings of a static image of these data, for annotation.
pub fn of_visibilities(
    observation: &Observation,
    source: Option<&Source>,
    name: &str,
    (path, file): (&str, &str),
) -> anyhow::Result<String> {
    let longest = observation.stokes_i().map(|(row, _)| row.uv[0].hypot(row.uv[1]));
    let longest = longest.fold(0.0, f64::max);
    let beam = (longest > 0.0).then(|| 1.0 / longest / MICROARCSECOND);
    let beam = beam.context("there is no baseline that resolves anything")?;
    let short = short_baselines(observation)?;
    let (flux, sigma, why) = match source.and_then(|source| source.compact_jy) {
        Some([flux, sigma]) => {
            (flux, sigma, "published for what is compact: shorter baselines see the jet as well")
        }
        None => (short, 0.1 * short, "the amplitude of the shortest baselines"),
    };
    let long_only = source.and_then(|source| source.uv_min);
    let mut losses = String::new();
    let kinds = ["amplitudes", "closure-phases", "log-closure-amplitudes"];
    let kinds =
        if has_closures(observation, long_only.is_some()) { &kinds[..] } else { &kinds[..1] };
    for kind in kinds {
        losses += &format!("[[loss]]\ndata = {kind:?}\nweight = 1.0\n");
        if *kind != "amplitudes" {
            losses += "least_snr = 3.0 #! weaker ones are not Gaussian\n";
        }
    }
    let extra = [long_only, source.and_then(|source| source.blur)].into_iter().flatten();
    let mut extra: Vec<String> = extra.map(str::to_owned).collect();
    if source.is_some_and(|source| source.varies) {
        // At 4e9 wavelengths 2 % of the flux.
        extra.push(format!(
            "variability = {{ jy = {}, uv = 2e9, power = 1.25 }} #! the source varies by 2 % of its flux on baselines of 4e9 wavelengths, and with their length to the power of -1.25 (EHT Collaboration 2022, ApJL 930, L14)",
            digits(0.02 * short * 5f64.powf(0.625))
        ));
    }
    let day = observation.mjd.map_or(String::new(), |mjd| format!(", MJD {mjd}"));
    let scaled = |factor: f64| digits(factor * beam);
    let fields = [
        ("title", format!("{}{day}", plain_words(name))),
        ("field", scaled(5.0)),
        ("flux", digits(flux)),
        ("flux_sigma", digits(sigma)),
        ("flux_why", why.to_owned()),
        ("wide", scaled(2.4)),
        ("narrow", scaled(1.6)),
        ("thick", scaled(1.2)),
        ("thin", scaled(0.8)),
        ("least", scaled(0.2)),
        ("most", scaled(1.8)),
        ("extra", extra.join("\n")),
        ("losses", losses.trim_end().to_owned()),
        ("gains", gains(observation)),
        ("read", read(observation, file, name, source.is_some())),
        ("path", path.to_owned()),
    ];
    complete(include_str!("image.toml"), &fields)
}

//! Settings of a static image, guessed from visibilities.

use super::polarized::Tables;
use super::sources::{Seen, Source};
use super::template::{complete, digits, plain_words};
use super::visibilities::{gains, has_closures, read, short_baselines};
use anyhow::Context;
use kerrlight_common::units::MICROARCSECOND;
use kerrlight_tomo::fit::setup;
use kerrlight_vlbi::observation::Observation;

/// The plain settings of a static image of these data, for annotation.
pub fn of_visibilities(seen: &Seen, path: &str) -> anyhow::Result<String> {
    let (observation, source) = (&seen.observation, seen.source.as_ref());
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
    let losses = losses(has_closures(observation, average(source), long_only.is_some()));
    let extra = [long_only, source.and_then(|source| source.blur)].into_iter().flatten();
    let mut extra: Vec<String> = extra.map(str::to_owned).collect();
    let has_law = source.is_some_and(|source| source.varies && source.image.is_some());
    if has_law {
        // (1 + (4e9/2e9)²)^(1.25/2) = 5^0.625: 2 % of the flux at 4e9 wavelengths.
        extra.push(format!(
            "variability = {{ jy = {}, uv = 2e9, power = 1.25 }} #! the source varies by 2 % of its flux on baselines of 4e9 wavelengths, and with their length to the power of -1.25 (EHT Collaboration 2022, ApJL 930, L14)",
            digits(0.02 * short * 5f64.powf(0.625))
        ));
    }
    let folds = folds(observation, average(source), long_only.is_some());
    let tables = Tables::of(observation, &seen.file, has_law, folds);
    let day = observation.mjd.map_or(String::new(), |mjd| format!(", MJD {mjd}"));
    let published = source.and_then(|source| source.image.as_ref());
    let field = published.map_or(5.0 * beam, |images| images.field_uas);
    let field_why = published.map_or(
        "five times what the longest baseline resolves: all compact light lies in this field",
        |images| images.source,
    );
    let envelope = published.map_or(String::new(), |images| {
        format!("fwhm_uas = {} #! {}", digits(images.envelope_uas), images.source)
    });
    let start = published.map_or(START * field, |images| images.envelope_uas);
    let scaled = |part: f64| digits(part * field);
    let fields = [
        ("title", format!("{}{day}", plain_words(&seen.name))),
        ("field", scaled(1.0)),
        ("field_why", field_why.to_owned()),
        ("envelope", envelope),
        ("start", digits(start)),
        ("flux", digits(flux)),
        ("flux_sigma", digits(sigma)),
        ("flux_why", why.to_owned()),
        ("thick", digits(0.5 * start)),
        ("least", scaled(0.04)),
        ("most", scaled(0.36)),
        ("average", format!("{:?}", average(source))),
        ("extra", extra.join("\n")),
        ("strength", strength(folds)),
        ("losses", losses.trim_end().to_owned()),
        ("gains", gains(observation)),
        ("leakage", tables.leakage),
        ("polarization", tables.polarization),
        ("read", read(seen)),
        ("path", path.to_owned()),
    ];
    complete(include_str!("image.toml"), &fields)
}

/// Width of images to start from, where no images are published, as a part of the field.
const START: f64 = 0.32;

/// Parts of the frames that a strength is chosen by, if there are so many.
const FOLDS: usize = 4;

/// The choice of a strength by frames that are held out, two or more in each part; nothing where there are too few.
fn strength(folds: usize) -> String {
    match folds {
        0 | 1 => String::new(),
        folds => format!("[strength]\nvalues = [10.0, 30.0, 100.0]\nfolds = {folds}"),
    }
}

/// Parts of the frames that the template's fit keeps.
fn folds(observation: &Observation, average_s: f64, long_only: bool) -> usize {
    let frames = setup::prepared(observation.clone(), average_s, long_only.then_some(1e8))
        .map_or(0, |mut kept| setup::frames_of(&mut kept).0.len());
    FOLDS.min(frames / 2)
}

/// Seconds of an average. The longer they are, the fewer closure quantities are left; a source that varies asks for frames in
/// which all baselines see the same.
fn average(source: Option<&Source>) -> f64 {
    if source.is_some_and(|source| !source.varies) { 60.0 } else { 300.0 }
}

/// Amplitudes, and closure quantities where there are any.
fn losses(has_closures: bool) -> String {
    let kinds = ["amplitudes", "closure-phases", "log-closure-amplitudes"];
    let kinds = if has_closures { &kinds[..] } else { &kinds[..1] };
    let one = |kind: &&str| {
        let weak = match *kind {
            "amplitudes" => "",
            _ => "least_snr = 3.0 #! closure quantities of weaker baselines are not Gaussian\n",
        };
        format!("[[loss]]\ndata = {kind:?}\nweight = 1.0\n{weak}")
    };
    kinds.iter().map(one).collect()
}

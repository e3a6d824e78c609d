//! Settings of a static image, guessed from visibilities.

use super::polarized::Tables;
use super::sources::PublishedImages;
use super::{Source, complete, digits, gains, has_closures, plain_words, read, short_baselines};
use anyhow::Context;
use core::f64::consts::{LN_2, PI};
use kerrlight_common::units::MICROARCSECOND;
use kerrlight_tomo::fit::setup::{self, VisibilitySettings};
use kerrlight_vlbi::observation::Observation;
use std::collections::BTreeMap;

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
    let losses = losses(has_closures(observation, long_only.is_some()));
    let extra = [long_only, source.and_then(|source| source.blur)].into_iter().flatten();
    let mut extra: Vec<String> = extra.map(str::to_owned).collect();
    if source.is_some_and(|source| source.varies) {
        // At 4e9 wavelengths 2 % of the flux.
        extra.push(format!(
            "variability = {{ jy = {}, uv = 2e9, power = 1.25 }} #! the source varies by 2 % of its flux on baselines of 4e9 wavelengths, and with their length to the power of -1.25 (EHT Collaboration 2022, ApJL 930, L14)",
            digits(0.02 * short * 5f64.powf(0.625))
        ));
    }
    let tables = Tables::of(observation, file, source.is_some_and(|source| source.varies));
    let day = observation.mjd.map_or(String::new(), |mjd| format!(", MJD {mjd}"));
    let published = source.and_then(|source| source.image.as_ref());
    let field = published.map_or(5.0 * beam, |images| images.field_uas);
    let field_why = published.map_or(
        "five times what the longest baseline resolves: all compact light lies in this field",
        |images| images.source,
    );
    let (envelope, envelope_why) = envelope(observation, published, [flux, beam, field]);
    let scaled = |part: f64| digits(part * field);
    let fields = [
        ("title", format!("{}{day}", plain_words(name))),
        ("field", scaled(1.0)),
        ("field_why", field_why.to_owned()),
        ("envelope", digits(envelope)),
        ("envelope_why", envelope_why.to_owned()),
        ("flux", digits(flux)),
        ("flux_sigma", digits(sigma)),
        ("flux_why", why.to_owned()),
        ("thick", digits(0.5 * envelope)),
        ("least", scaled(0.04)),
        ("most", scaled(0.36)),
        ("average", format!("{:?}", average(source))),
        ("extra", extra.join("\n")),
        ("strength", strength(observation, average(source), long_only.is_some())),
        ("losses", losses.trim_end().to_owned()),
        ("gains", gains(observation)),
        ("leakage", tables.leakage),
        ("polarization", tables.polarization),
        ("read", read(observation, file, name, source.is_some())),
        ("path", path.to_owned()),
    ];
    complete(include_str!("image.toml"), &fields)
}

/// Parts of the frames that a strength is chosen by, if there are so many.
const FOLDS: usize = 4;

/// The choice of a strength by frames that are held out, two or more in each part; nothing where there are too few.
fn strength(observation: &Observation, average_s: f64, long_only: bool) -> String {
    let settings = VisibilitySettings { average_s, uv_min: long_only.then_some(1e8) };
    let frames = setup::prepared(observation.clone(), &settings)
        .map_or(0, |mut kept| setup::frames_of(&mut kept).0.len());
    match FOLDS.min(frames / 2) {
        0 | 1 => String::new(),
        folds => format!("[strength]\nvalues = [10.0, 30.0, 100.0]\nfolds = {folds}"),
    }
}

/// Width of the envelope, µas, and why: as published, or as wide as the fall of the flux says, at least the beam.
fn envelope(
    observation: &Observation,
    published: Option<&PublishedImages>,
    [flux, beam, field]: [f64; 3],
) -> (f64, &'static str) {
    let seen = resolved_width(observation, flux).map(|width| width.clamp(beam, 0.48 * field));
    match (published, seen) {
        (Some(images), _) => (images.envelope_uas, images.source),
        (None, Some(width)) => (
            width,
            "the second moment of a ring whose flux falls as that of baselines up to half of the longest, by their median",
        ),
        (None, None) => (0.48 * field, "light is expected within as much"),
    }
}

/// Full width at half maximum of a round Gaussian, µas, that has the flux of the shortest baselines that resolve it: the median over
/// baselines of a twentieth to half of the longest, in intervals of ten minutes, that see less than the flux and more than three times their
/// noise. ln(F/|V|) is large there, so that gains of tens of per cent change little; longer baselines see parts of the source.
/// None with fewer than five.
fn resolved_width(observation: &Observation, flux_jy: f64) -> Option<f64> {
    let length = |uv: [f64; 2]| uv[0].hypot(uv[1]);
    let longest = observation.stokes_i().map(|(row, _)| length(row.uv)).fold(0.0, f64::max);
    let mut intervals: BTreeMap<_, [f64; 4]> = BTreeMap::new();
    for (row, i) in observation.stokes_i() {
        let [first, second] = row.stations;
        let key = (first.min(second), first.max(second), (row.time_h * 6.0).floor() as i64);
        let [count, lengths, power, variance] = intervals.entry(key).or_default();
        *count += 1.0;
        *lengths += length(row.uv);
        *power += i.visibility.norm_sqr() - 2.0 * i.noise_sigma.powi(2);
        *variance += i.noise_sigma.powi(2);
    }
    let width = |[count, lengths, power, variance]: &[f64; 4]| {
        let (power, variance, length) =
            (power / count, variance / (count * count), lengths / count);
        let counts = (0.05 * longest..=0.5 * longest).contains(&length)
            && power > 9.0 * variance
            && power < flux_jy.powi(2);
        let fall = 0.5 * (flux_jy.powi(2) / power).ln();
        counts.then(|| (4.0 * LN_2 * fall).sqrt() / (PI * length) / MICROARCSECOND)
    };
    let mut widths: Vec<f64> = intervals.values().filter_map(width).collect();
    widths.sort_by(f64::total_cmp);
    (widths.len() >= 5).then(|| HOLLOW * widths[widths.len() / 2])
}

/// Width of the Gaussian with the second moment of a thin ring over that of the Gaussian which has the ring's visibility where a fifth of
/// the flux is left: √(ln 2)/1.06. The envelope of what is hollow is no wider, and the data may ask for more.
const HOLLOW: f64 = 0.785;

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
            _ => "least_snr = 3.0 #! weaker ones are not Gaussian\n",
        };
        format!("[[loss]]\ndata = {kind:?}\nweight = 1.0\n{weak}")
    };
    kinds.iter().map(one).collect()
}

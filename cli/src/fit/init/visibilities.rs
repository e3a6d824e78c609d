//! Starter file for a volume from visibilities, and what every starter file says of them.

use super::sources::{Seen, Source, is_simulated};
use super::template::{complete, digits, plain_words};
use anyhow::bail;
use kerrlight_common::units::{SPEED_OF_LIGHT, gravitational_angle, gravitational_time};
use kerrlight_tomo::fit::setup;
use kerrlight_vlbi::data_terms::ClosureTerm;
use kerrlight_vlbi::gains::prior_table;
use kerrlight_vlbi::light_curve::{SITE_M, SITE_WAVELENGTHS};
use kerrlight_vlbi::observation::Observation;
use kerrlight_vlbi::products::ClosureKind;
use std::collections::BTreeSet;

pub fn of_visibilities(seen: &Seen, path: &str) -> anyhow::Result<String> {
    let Seen { observation, source, name, .. } = seen;
    let flux = short_baselines(observation)?;
    let average_s = average(source.as_ref());
    let day = observation.mjd.map_or(String::new(), |mjd| format!(", MJD {mjd}"));
    let (mass, inclination, field) = match source {
        Some(of) => (
            format!(
                "mass_msun = {:?} #! {}\ndistance_kpc = {:?} #! {}",
                of.mass_msun, of.mass, of.distance_kpc, of.mass
            ),
            format!("inclination_deg = {:?} #! {}", of.inclination_deg, of.inclination),
            format!(
                "{:.0} microarcseconds",
                24.0 * gravitational_angle(of.mass_msun, of.distance_kpc)
            ),
        ),
        None => (
            format!(
                "#? mass_msun = 4.154e6 # no built-in value for {name}\n#? distance_kpc = 8.178 # the same"
            ),
            "#? inclination_deg = 60.0 # the data do not determine the inclination".to_owned(),
            "from the mass and distance".to_owned(),
        ),
    };
    let mut losses = "[[loss]]\ndata = \"amplitudes\"\nweight = 1.0".to_owned();
    if has_closures(observation, average_s, source.is_some_and(|source| source.uv_min.is_some())) {
        losses += "\n[[loss]]\ndata = \"closure-phases\"\nweight = 1.0\nleast_snr = 3.0 #! closure quantities of weaker baselines are not Gaussian";
    }
    let of_source = source.iter().flat_map(|source| [source.uv_min, source.blur]);
    let of_source: Vec<&str> = of_source.flatten().collect();
    // Pixels of the region, 8 M deep, with emission 0.02.
    let per_pixel = flux / (core::f64::consts::PI * (10.0f64 / 24.0 * 32.0).powi(2) * 8.0 * 0.02);
    let kind = if is_simulated(observation) { "simulated" } else { "measured" };
    let unfitted = match observation.is_polarized() {
        true => "; its polarisation is not fitted without [polarization]",
        false => "",
    };
    let fields = [
        ("title", format!("{}{day}: {kind} visibilities", plain_words(name))),
        ("mass", mass),
        ("inclination", inclination),
        ("field", field),
        ("jy", digits(per_pixel)),
        ("flux", digits(flux)),
        ("losses", losses),
        ("average", format!("{average_s:?}")),
        ("source", of_source.join("\n")),
        ("gains", gains(observation)),
        ("read", read(seen) + unfitted),
        ("path", path.to_owned()),
    ];
    complete(include_str!("visibilities.toml"), &fields)
}

/// Seconds of an average, in which gas that orbits at 6 M turns by 11° at most: 3 M.
fn average(source: Option<&Source>) -> f64 {
    let still_s = source.map_or(f64::INFINITY, |of| 3.0 * gravitational_time(of.mass_msun));
    // Scans last some minutes: longer averages hold no more.
    [300.0, 120.0, 60.0, 30.0, 10.0].into_iter().find(|s| *s <= still_s).unwrap_or(10.0)
}

/// Returns whether closure phases are left of the rows that the template's fit keeps.
pub fn has_closures(observation: &Observation, average_s: f64, long_only: bool) -> bool {
    // Averages and the shortest baseline of the template decide what still closes.
    let kept = setup::prepared(observation.clone(), average_s, long_only.then_some(1e8));
    let Ok(mut kept) = kept else { return false };
    setup::frames_of(&mut kept);
    ClosureTerm::<f64>::new(&kept, ClosureKind::Phase, 3.0).is_ok()
}

/// Describes the assumed gains of the stations.
pub fn gains(observation: &Observation) -> String {
    let seen = |k: usize| observation.rows.iter().any(|r| r.stations.contains(&(k as u16)));
    let names = observation.stations.iter().enumerate().filter(|(k, _)| seen(*k));
    let known = |name: &str| prior_table("EHT2017", name).is_some();
    match names.map(|(_, station)| &station.name).all(|name| known(name)) {
        true => "table = \"EHT2017\" #! 10 % of the amplitude, 60 % at the LMT, which lost light by pointing".to_owned(),
        false => "amplitude = 0.1 #! stations are calibrated to 10 % of their amplitudes".to_owned(),
    }
}

/// Describes the file, in a line.
pub fn read(seen: &Seen) -> String {
    let Seen { observation, file, source, name } = seen;
    let rows: Vec<f64> = observation.stokes_i().map(|(row, _)| row.time_h).collect();
    let stations: BTreeSet<u16> =
        observation.stokes_i().flat_map(|(row, _)| row.stations).collect();
    let [first, last] = rows
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], time| [a.min(*time), b.max(*time)]);
    let known = if source.is_some() { ", recognised by position or name" } else { "" };
    let day = observation.mjd.map_or(String::new(), |mjd| format!(", MJD {mjd}"));
    let frequency =
        observation.frequency_hz.map_or(String::new(), |hz| format!(" at {:.1} GHz", hz * 1e-9));
    format!(
        "{file}: {name}{known}{day}, {first:.2} h to {last:.2} h UTC, {} stations, {} visibilities of Stokes I{frequency}",
        stations.len(),
        rows.len()
    )
}

/// Median amplitude of the baselines within a site, or else of those nearly as short as the shortest, Jy.
pub fn short_baselines(observation: &Observation) -> anyhow::Result<f64> {
    let mut all: Vec<[f64; 2]> = observation
        .rows
        .iter()
        .filter_map(|row| {
            let i = row.stokes_i(observation.basis)?;
            Some([row.uv[0].hypot(row.uv[1]), i.visibility.norm()])
        })
        .filter(|pair| pair.iter().all(|x| x.is_finite()))
        .collect();
    // The shortest resolve least; their median does not hang on a single datum.
    let shortest = all.iter().fold(f64::INFINITY, |least, [length, _]| least.min(*length));
    let site = observation.frequency_hz.map_or(SITE_WAVELENGTHS, |hz| SITE_M * hz / SPEED_OF_LIGHT);
    all.retain(|[length, _]| *length <= site.max(1.5 * shortest));
    all.sort_by(|a, b| a[1].total_cmp(&b[1]));
    match all.get(all.len() / 2) {
        Some([_, flux]) if *flux > 0.0 => Ok(*flux),
        _ => bail!("there are no nonzero visibilities of total intensity"),
    }
}

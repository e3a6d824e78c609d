//! Contents of an observation.

use crate::answer::Answer;
use kerrlight_vlbi::observation::{Basis, Observation, Repeats, Row};
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};

/// Describes visibilities.
pub fn describe(name: &str, format: &str, observation: &Observation) -> Answer {
    let text = text(name, format, observation);
    let [times, baselines] = counts(observation);
    let position = observation.position.map(|p| json!({"ra_h": p.ra_hours, "dec_deg": p.dec_deg}));
    let channels: Vec<f64> = observation.channels.iter().map(|c| c.frequency_hz).collect();
    let [first, last] = span(observation);
    Answer::text(text).with("file", name).with("format", format).with_all(json!({
        "source": observation.source,
        "position": position,
        "mjd": observation.mjd,
        "utc_h": [first, last],
        "times": times,
        "frequency_hz": observation.frequency_hz,
        "bandwidth_hz": observation.bandwidth_hz,
        "channels_hz": channels,
        "baselines": baselines,
        "rows": observation.rows.len(),
        "repeated_rows": observation.repeats().rows,
        "scans": observation.scans(),
        "products": product_counts(observation).into_iter().collect::<BTreeMap<_, _>>(),
        "amplitude_jy": amplitudes(observation),
        "stations": observation.stations.iter().enumerate().map(|(k, s)| json!({
            "name": s.name, "position_m": s.position, "sefd_jy": s.sefd, "rows": rows_of(observation, k),
        })).collect::<Vec<_>>(),
        "history": observation.history,
    }))
}

/// Distinct times and baselines.
fn counts(observation: &Observation) -> [usize; 2] {
    let rows = &observation.rows;
    let times: BTreeSet<u64> = rows.iter().map(|row| row.time_h.to_bits()).collect();
    // A baseline is the same in either order of its stations.
    let sorted = |[a, b]: [u16; 2]| [a.min(b), a.max(b)];
    let baselines: BTreeSet<[u16; 2]> = rows.iter().map(|row| sorted(row.stations)).collect();
    [times.len(), baselines.len()]
}

/// First and last time, hours of UTC.
fn span(observation: &Observation) -> [f64; 2] {
    let times = || observation.rows.iter().map(|row| row.time_h);
    [times().fold(f64::INFINITY, f64::min), times().fold(f64::NEG_INFINITY, f64::max)]
}

fn text(name: &str, format: &str, observation: &Observation) -> String {
    let rows = &observation.rows;
    let or_unknown = |value: Option<String>| value.unwrap_or_else(|| "not told".to_owned());
    let position = observation.position;
    let place = position.map(|p| format!("RA {} h, Dec {} deg", p.ra_hours, p.dec_deg));
    let ghz = |hz: Option<f64>| or_unknown(hz.map(|hz| format!("{} GHz", hz / 1e9)));
    let ([first, last], [times, baselines]) = (span(observation), counts(observation));
    let mut text = format!("{name}: {format}\n\n");
    let mut line = |key: &str, value: String| text += &format!("{key:<12}{value}\n");
    line("source", format!("{}, {}", observation.source, or_unknown(place)));
    line("MJD", or_unknown(observation.mjd.map(|mjd| mjd.to_string())));
    line("UTC", format!("{first:.6} to {last:.6} h, {times} times"));
    line("frequency", ghz(observation.frequency_hz));
    line("bandwidth", ghz(observation.bandwidth_hz));
    if !observation.channels.is_empty() {
        let all = observation.channels.iter().map(|c| (c.frequency_hz / 1e9).to_string());
        let shown: Vec<String> = all.take(16).collect();
        let rest = if observation.channels.len() > 16 { ", ..." } else { "" };
        let count = observation.channels.len();
        line("channels", format!("{count}: {}{rest} GHz", shown.join(", ")));
    }
    let repeats = match observation.repeats() {
        Repeats { rows: 0, .. } => String::new(),
        Repeats { rows, copies } => {
            format!(
                ", {rows} of them with the baseline, channel and time of another ({copies} copies)"
            )
        }
    };
    line("baselines", format!("{baselines}, {} rows{repeats}", rows.len()));
    line("scans", observation.scans().to_string());
    line("products", products(observation));
    text + &station_table(observation) + &history(observation)
}

/// Counts the rows that have each product.
fn product_counts(observation: &Observation) -> [(&'static str, usize); 4] {
    let names = match observation.basis {
        Basis::Circular => ["RR", "LL", "RL", "LR"],
        Basis::Stokes => ["I", "Q", "U", "V"],
    };
    let count = |k: usize| observation.rows.iter().filter(|row| row.measured(k).is_some()).count();
    std::array::from_fn(|k| (names[k], count(k)))
}

/// Least and largest amplitude of Stokes I, Jy; none where no row has it.
fn amplitudes(observation: &Observation) -> Option<[f64; 2]> {
    let all = observation.stokes_i().map(|(_, i)| [i.visibility.norm(); 2]);
    all.reduce(|[least, most], [_, a]| [least.min(a), most.max(a)])
}

/// Describes the number of each product, and the size of Stokes I.
fn products(observation: &Observation) -> String {
    let counts = product_counts(observation).map(|(name, count)| format!("{name} {count}"));
    let of_i = match amplitudes(observation) {
        Some([least, most]) => format!("|I| {least:.4e} to {most:.4e} Jy"),
        None => "no Stokes I".to_owned(),
    };
    format!("{}; {of_i}", counts.join(", "))
}

fn station_table(observation: &Observation) -> String {
    let mut table = format!(
        "\n{:<12}{:>16}{:>16}{:>16}{:>10}{:>10}{:>8}\n",
        "station", "x (m)", "y (m)", "z (m)", "SEFD R", "SEFD L", "rows"
    );
    for (k, station) in observation.stations.iter().enumerate() {
        let rows = rows_of(observation, k);
        let place = match station.position {
            Some([x, y, z]) => format!("{x:>16.4}{y:>16.4}{z:>16.4}"),
            None => format!("{:>48}", "not told"),
        };
        let [r, l] = station.sefd;
        table += &format!("{:<12}{place}{r:>10}{l:>10}{rows:>8}\n", station.name);
    }
    table
}

/// Rows of a station.
fn rows_of(observation: &Observation, station: usize) -> usize {
    let has = |row: &&Row| row.stations.iter().any(|k| usize::from(*k) == station);
    observation.rows.iter().filter(has).count()
}

fn history(observation: &Observation) -> String {
    let lines = observation.history.iter().map(|line| format!("\n{line}"));
    let text: String = lines.collect();
    if text.is_empty() { text } else { text + "\n" }
}

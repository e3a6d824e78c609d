//! Closure traces as a table.

use crate::columns::Column;
use kerrlight_vlbi::observation::Observation;
use kerrlight_vlbi::products::{TracePart, TraceQuantity, TraceSet};

/// A line a number of a trace, from baselines stronger than `least_snr` times their noise: time, stations, which number,
/// value and error; how many lines there are.
pub fn table(observation: &Observation, least_snr: f64) -> (Vec<Column>, usize) {
    let sets = TraceSet::of(observation, least_snr);
    let all: Vec<(f64, &TraceQuantity)> =
        sets.iter().flat_map(|set| set.quantities.iter().map(|q| (set.time_h, q))).collect();
    let station = |k: usize| {
        let name = |(_, q): &(f64, &TraceQuantity)| {
            observation.stations[usize::from(q.trace.stations[k])].name.clone()
        };
        Column::Words(format!("t{}", k + 1), all.iter().map(name).collect())
    };
    let numbers = |name: &str, of: fn(&(f64, &TraceQuantity)) -> f64| {
        Column::Numbers(name.to_owned(), all.iter().map(of).collect())
    };
    let part = |(_, q): &(f64, &TraceQuantity)| match q.part {
        TracePart::LogAmplitude => "log_amplitude".to_owned(),
        TracePart::Phase => "phase_rad".to_owned(),
    };
    let columns = vec![
        numbers("time_utc_h", |(time_h, _)| *time_h),
        station(0),
        station(1),
        station(2),
        station(3),
        Column::Words("quantity".to_owned(), all.iter().map(part).collect()),
        numbers("value", |(_, q)| q.value),
        numbers("sigma", |(_, q)| q.noise_sigma),
    ];
    let count = all.len();
    (columns, count)
}

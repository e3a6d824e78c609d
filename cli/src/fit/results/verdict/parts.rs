//! Residuals by frame, by baseline and by station.

use super::DataVerdict;
use crate::report::{Axis, LinePlot, Marks, Series, Table};
use kerrlight_tomo::fit::verdict::{Errors, Part, Tested};
use kerrlight_tomo::recovery::short;
use std::collections::BTreeSet;

/// χ² per data point of parts at x, with the scatter of chance √(2/n).
fn series<'a>(name: &str, parts: impl Iterator<Item = (f64, &'a Part)>) -> Series {
    let (mut points, mut errors) = (Vec::new(), Vec::new());
    for (x, part) in parts {
        if let Some(chi2) = part.per_datum() {
            points.push([x, chi2]);
            errors.push((2.0 / part.freedom).sqrt());
        }
    }
    Series::new(name, points, Marks::Points).with_errors(errors)
}

/// Draws a plot with a line where χ² is expected, on a logarithmic axis if most of it would be lost on a linear
/// one.
fn plot(
    [title, caption]: [&str; 2],
    [label, unit]: [&str; 2],
    mut series: Vec<Series>,
    expected: Option<f64>,
) -> Option<LinePlot> {
    series.retain(|series| series.points.len() > 1);
    let points = || series.iter().flat_map(|series| &series.points);
    let ends = |c: usize| {
        let fold = |[low, high]: [f64; 2], x: f64| [low.min(x), high.max(x)];
        points().map(|point| point[c]).fold([f64::INFINITY, f64::NEG_INFINITY], fold)
    };
    let ([first, last], [least, most]) = (ends(0), ends(1));
    let log = least > 0.0 && most > 20.0 * least.max(1.0);
    if series.is_empty() {
        return None;
    }
    if log {
        series.iter_mut().for_each(|series| series.errors.clear());
    }
    series.extend(expected.map(|expected| {
        Series::new("expected", vec![[first, expected], [last, expected]], Marks::Line)
    }));
    Some(LinePlot {
        title: title.to_owned(),
        caption: caption.to_owned(),
        x: Axis::new(label, unit),
        y: Axis { log, ..Axis::new("χ² per data point", "") },
        series,
    })
}

/// Returns the expected χ² of the first data with errors.
fn expected(judged: &DataVerdict) -> Option<f64> {
    let noisy = |tested: &&Tested| tested.errors != Errors::Weight;
    judged.terms.iter().map(|(_, tested)| tested).find(noisy).map(|tested| tested.expected.chi2)
}

/// Residuals of each frame; nothing of a single one.
pub fn over_time(judged: &DataVerdict) -> Option<LinePlot> {
    let of = |(name, tested): &(String, Tested)| {
        series(name, judged.times.iter().copied().zip(&tested.statistics.frames))
    };
    let caption = "χ² per data point of each frame. Bars are the scatter of chance, √(2/n) for n data points. A frame that \
                   stands out, or a trend, is something that the model cannot do at that time.";
    let series = judged.terms.iter().map(of).collect();
    let unit = if judged.is_static { "h UTC" } else { "GM/c³" };
    plot(["Residuals over time", caption], ["time", unit], series, expected(judged))
}

/// Residuals of each baseline, triangle and quadrangle against its longest baseline, whose length the caller knows.
pub fn over_baselines(
    judged: &DataVerdict,
    length: impl Fn([u16; 2]) -> Option<f64>,
) -> Option<LinePlot> {
    let longest = |stations: &[u16]| {
        let pairs = stations.iter().flat_map(|a| stations.iter().map(|b| [*a, *b]));
        pairs.filter_map(&length).reduce(f64::max)
    };
    let of = |(name, tested): &(String, Tested)| {
        let groups = tested.statistics.groups.iter();
        series(name, groups.filter_map(|(stations, part)| Some((longest(stations)?, part))))
    };
    let caption = "χ² per data point of each pair of stations, triangle and quadrangle over all frames, against the mean \
                   length of its longest baseline. Bars are the scatter of chance. What rises to long baselines is \
                   detail that the model lacks; single points far up are stations that are not calibrated.";
    let series = judged.terms.iter().map(of).collect();
    let axis = ["longest baseline", "10⁹ wavelengths"];
    plot(["Residuals of baselines", caption], axis, series, expected(judged))
}

/// Residuals of all data that a station is part of; nothing without stations.
pub fn by_station(judged: &DataVerdict) -> Option<Table> {
    let measured: Vec<_> =
        judged.terms.iter().filter(|(_, t)| !t.statistics.stations.is_empty()).collect();
    let stations: BTreeSet<u16> =
        measured.iter().flat_map(|(_, t)| t.statistics.stations.keys().copied()).collect();
    let cells = |station: u16, tested: &Tested| {
        let part = tested.statistics.stations.get(&station).copied().unwrap_or_default();
        let chi2 = part.per_datum().map_or("–".to_owned(), short);
        [chi2, part.count().to_string()]
    };
    let row = |station: u16| {
        let cells = measured.iter().flat_map(|(_, tested)| cells(station, tested));
        [judged.names(&[station])].into_iter().chain(cells).collect()
    };
    let heads =
        measured.iter().flat_map(|(name, _)| [format!("χ² of {name}"), "number".to_owned()]);
    (!stations.is_empty()).then(|| {
        Table::new(
            "Residuals of stations",
            "χ² per data point of all data that a station is part of, and their number.",
            ["station".to_owned()].into_iter().chain(heads),
            stations.iter().map(|station| row(*station)).collect(),
        )
    })
}

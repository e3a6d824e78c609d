//! Plots of a fit to a light curve: what the data say of the geometry, and the loop in Q and U.

use crate::report::{Axis, LinePlot, Marks, Series};
use kerrlight_tomo::recovery::results::BandResults;

/// Values of a quantity with their probabilities.
type SharesOf = fn(&BandResults) -> &[[f64; 2]];

/// Quantities with probabilities: their place, words, unit.
const QUANTITIES: [(SharesOf, &str, &str); 4] = [
    (|of| &of.inclinations, INCLINATION, "degrees"),
    (
        |of| &of.position_angle_deg.probabilities,
        "position angle of the axis",
        "degrees east of north",
    ),
    (|of| &of.radii, "radius of the orbit", "M"),
    (|of| &of.periods, "period of the orbit", "minutes"),
];
const INCLINATION: &str = "inclination";
/// Curves of a plot, at most.
const CURVES: usize = 6;

/// The probability of each value of the geometry, one curve for each run that is named.
pub fn of_runs(runs: &[(String, BandResults)], caption: &str) -> Vec<LinePlot> {
    let plot = |(of, words, unit): (SharesOf, &str, &str)| {
        let curve = |(name, results): &(String, BandResults)| {
            let points = of(results).to_vec();
            (points.len() > 1).then(|| Series::new(name, points, Marks::Joined))
        };
        let mut series: Vec<Series> = runs.iter().filter_map(curve).take(CURVES).collect();
        let first = series.first()?;
        if words == INCLINATION && series.len() < CURVES {
            let prior = prior(&first.points);
            series.push(Series::new("before any data", prior, Marks::Joined));
        }
        Some(LinePlot {
            title: format!("Probability of the {words}"),
            caption: format!("Summed over all other unknowns. {caption}").trim_end().to_owned(),
            x: Axis::new(words, unit),
            y: Axis::new("probability", ""),
            series,
        })
    };
    QUANTITIES.into_iter().filter_map(plot).collect()
}

/// Returns the prior of axes in any direction, at the inclinations that were looked at.
fn prior(at: &[[f64; 2]]) -> Vec<[f64; 2]> {
    // Axes in any direction, dΩ ∝ sin i di, and just above 0 at the poles as in the search.
    let weight = |[degrees, _]: &[f64; 2]| degrees.to_radians().sin().max(1e-6);
    let all: f64 = at.iter().map(weight).sum();
    at.iter().map(|point| [point[0], weight(point) / all]).collect()
}

/// The loop in Q and U, from a run's table of its light curve; none without both.
pub fn loop_plot(table: &str, name: &str) -> Option<LinePlot> {
    let mut lines = table.lines();
    let heading: Vec<&str> = lines.next()?.split(',').collect();
    let at = |name: &str| heading.iter().position(|column| *column == name);
    let columns = [at("Q")?, at("U")?, at("model_Q")?, at("model_U")?];
    let row = |line: &str| {
        let cells: Vec<f64> = line.split(',').map(|x| x.parse().unwrap_or(f64::NAN)).collect();
        columns.map(|k| cells.get(k).copied().unwrap_or(f64::NAN))
    };
    let rows: Vec<[f64; 4]> = lines.map(row).filter(|r| r.iter().all(|x| x.is_finite())).collect();
    let points = |a: usize| rows.iter().map(|row| [row[a], row[a + 1]]).collect::<Vec<_>>();
    let data = Series::new("data", points(0), Marks::Points);
    let model = Series::new("model", points(2), Marks::Line);
    (rows.len() > 1).then(|| LinePlot {
        title: format!("Loop in Q and U{name}"),
        caption: "Linear polarisation of the unresolved source through the plane of Q and U, less what is steady: a flare that orbits in a field draws a loop, twice an orbit where the field is vertical and seen face-on. Data, and the model through the same times, samples that were not fitted included.".to_owned(),
        x: Axis::new("Q", "Jy"),
        y: Axis::new("U", "Jy"),
        series: vec![model, data],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn exact_curves_and_loops_of_results() {
        let middle = json!({"best": 8.0, "median": 8.0, "low": 7.0, "high": 9.0});
        let results = json!({
            "background_ends": [],
            "inclinations": [[10.0, 0.7], [20.0, 0.3]],
            "position_angle_deg": {"best": 0.0, "probabilities": [[0.0, 1.0]]},
            "rotation_factor": {"best": 1.0, "probabilities": [[1.0, 1.0]]},
            "radii": [[7.0, 0.5], [8.0, 0.5]], "periods": [], "geometries": [], "truth": {},
            "inclination_deg": middle, "radius": middle, "period_min": middle,
            "emission_radius": middle, "azimuth_deg": middle,
            "band": {
                "radius": 8.0, "width": 2.0, "height": 1.0, "length": 4.0, "power": 1.0, "mean": 1.0,
            },
        });
        let results: BandResults = serde_json::from_value(results).unwrap();
        let plots = of_runs(&[("a".to_owned(), results)], "");
        assert_eq!(plots.len(), 2);
        assert_eq!(plots[0].series.len(), 2);
        let before: f64 = plots[0].series[1].points.iter().map(|[_, share]| share).sum();
        assert!((before - 1.0).abs() < 1e-12);
        let table = "time_utc_h,fitted,Q,sigma_Q,model_Q,U,sigma_U,model_U\n1,1,0.1,0.01,0.11,0.2,0.01,0.21\n2,1,0.3,0.01,0.31,NaN,NaN,0.1\n3,0,0.5,0.01,0.51,0.6,0.01,0.61\n";
        let plot = loop_plot(table, "").unwrap();
        assert_eq!(plot.series[1].points, [[0.1, 0.2], [0.5, 0.6]]);
        assert_eq!(plot.series[0].points, [[0.11, 0.21], [0.51, 0.61]]);
        assert!(loop_plot("time_utc_h,Q,model_Q\n1,2,3\n", "").is_none());
    }
}

//! Closure phases over time, beside those of the image.

use super::Found;
use crate::fit::results::verdict::Evidence;
use crate::report::{Axis, LinePlot, Marks, Series};
use kerrlight_tomo::fit::settings::LossKind;
use kerrlight_vlbi::products::{ClosureKind, ClosureSet};
use std::collections::BTreeMap;

/// Triangles that are drawn.
const TRIANGLES: usize = 6;

impl Found<'_> {
    /// Closure phases of the triangles that have most of those that are fitted.
    pub fn closure_phases(&self, evidence: &Evidence<'_>) -> anyhow::Result<Vec<LinePlot>> {
        let Some((seen, _)) = &self.measured.visibilities else { return Ok(Vec::new()) };
        let model = evidence.model_visibilities(&self.movie)?.unwrap_or_default();
        let of_phases = self.file.loss.iter().find(|loss| loss.data == LossKind::ClosurePhases);
        let least_snr = of_phases.map_or(3.0, |loss| loss.least_snr.unwrap_or(0.0));
        let sets = ClosureSet::of(seen, ClosureKind::Phase, least_snr);
        // Hour, datum, its standard deviation and the image's phase, which is the one that is nearest to the datum.
        let mut triangles: BTreeMap<&[u16], Vec<[f64; 4]>> = BTreeMap::new();
        for (set, closure) in sets.iter().flat_map(|set| set.closures.iter().map(move |c| (set, c)))
        {
            let phases =
                closure.legs.iter().map(|leg| f64::from(leg.sign) * model[leg.visibility].arg());
            let off = (phases.sum::<f64>() - closure.value).to_degrees();
            let off = (off + 180.0).rem_euclid(360.0) - 180.0;
            let [datum, sigma] = [closure.value, closure.noise_sigma].map(f64::to_degrees);
            let of = triangles.entry(&closure.stations).or_default();
            of.push([set.time_h, datum, sigma, datum + off]);
        }
        let mut all: Vec<(&[u16], Vec<[f64; 4]>)> = triangles.into_iter().collect();
        all.sort_by_key(|(_, points)| core::cmp::Reverse(points.len()));
        all.truncate(TRIANGLES);
        let name = |stations: &[u16]| {
            let names = stations.iter().map(|k| seen.stations[usize::from(*k)].name.as_str());
            names.collect::<Vec<_>>().join("–")
        };
        Ok(all.iter().map(|(stations, points)| plot(&name(stations), points)).collect())
    }
}

fn plot(triangle: &str, points: &[[f64; 4]]) -> LinePlot {
    let series = |name: &str, column: usize, marks| {
        let points = points.iter().map(|point| [point[0], point[column]]);
        Series::new(name, points.collect(), marks)
    };
    let sigma = points.iter().map(|point| point[2]).collect();
    LinePlot {
        title: format!("Closure phase {triangle}"),
        caption: "The sum of phases around a triangle, which gains of stations do not change. Bars are standard deviations for \
                  high signal to noise; the line is the image."
            .to_owned(),
        x: Axis::new("time", "h UTC"),
        y: Axis::new("closure phase", "°"),
        series: vec![
            series("data", 1, Marks::Points).with_errors(sigma),
            series("recovered", 3, Marks::Line),
        ],
    }
}

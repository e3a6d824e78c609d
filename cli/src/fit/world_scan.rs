//! The map of a scan over parameters of the world: as a table, as a picture and in words.

use super::folder::Folder;
use crate::output;
use crate::report::{Drawing, GridAxis, GridMap};
use kerrlight_tomo::fit::world::{Parameter, Scanned, World, WorldScan};
use serde_json::{Value, json};

/// Half χ² of all worlds of the grid.
const TABLE: &str = "world_scan.csv";
/// The map.
const PICTURE: &str = "world_scan.svg";

/// Writes table and picture; `truth` is the world of a simulation.
pub fn write(folder: &Folder, scan: &WorldScan, truth: Option<&World>) -> anyhow::Result<()> {
    folder.file(TABLE)?.write(table(scan).as_bytes())?;
    folder.file(PICTURE)?.write(map(scan, truth).svg().as_bytes())
}

/// For world.json.
pub fn json(scan: &WorldScan) -> Value {
    let of = |Scanned { parameter, values }: &Scanned| {
        let ends = [values.first(), values.last()].map(|x| x.map(|x| x / parameter.unit()));
        json!({ "parameter": parameter.name(), "values": values.len(), "from": ends[0], "to": ends[1] })
    };
    let best = scan.best().map(|best| best.reduced_chi2);
    json!({
        "over": scan.over.iter().map(of).collect::<Vec<_>>(),
        "worlds": scan.points.len(),
        "chi2_per_datum": best,
    })
}

/// The sentence about a scan in world.json.
pub fn sentence(scan: &Value) -> Option<String> {
    let over = scan["over"].as_array()?.iter();
    let names = over.filter_map(|over| {
        let parameter = Parameter::ALL.into_iter().find(|p| over["parameter"] == p.name())?;
        Some(parameter.label().0)
    });
    let names: Vec<&str> = names.collect();
    Some(format!(
        "The world was looked for on a grid of {} worlds over {}.",
        scan["worlds"],
        names.join(" and ")
    ))
}

/// A row a world.
fn table(scan: &WorldScan) -> String {
    let mut parameters: Vec<Parameter> = scan.over.iter().map(|over| over.parameter).collect();
    // Parameters that are free beside the grid change from world to world.
    if let Some(first) = scan.points.first() {
        let changes = |parameter: &Parameter| {
            let value = first.world.get(*parameter);
            !parameters.contains(parameter)
                && scan.points.iter().any(|point| point.world.get(*parameter) != value)
        };
        let more: Vec<Parameter> = Parameter::ALL.into_iter().filter(changes).collect();
        parameters.extend(more);
    }
    let head = parameters.iter().map(|p| p.name()).collect::<Vec<_>>().join(",");
    let mut text = format!("{head},half_chi2,chi2_per_datum\n");
    for point in &scan.points {
        for parameter in &parameters {
            text += &format!("{},", point.world.get(*parameter) / parameter.unit());
        }
        text += &format!("{},{}\n", point.value, point.reduced_chi2);
    }
    text
}

fn map(scan: &WorldScan, truth: Option<&World>) -> GridMap {
    let best = scan.best();
    let least = best.map_or(0.0, |best| best.value);
    let sigmas = |values: Vec<f64>| -> Vec<f64> {
        values.into_iter().map(|value| (2.0 * (value - least)).max(0.0).sqrt()).collect()
    };
    let axis = |Scanned { parameter, values }: &Scanned| {
        let (name, unit) = parameter.label();
        let unit = if unit.is_empty() { String::new() } else { format!(" ({})", unit.trim()) };
        let of = |world: &World| world.get(*parameter) / parameter.unit();
        GridAxis {
            name: format!("{name}{unit}"),
            values: values.iter().map(|x| x / parameter.unit()).collect(),
            best: best.map_or(f64::NAN, |best| of(&best.world)),
            truth: truth.map(of),
        }
    };
    let n = scan.over.len();
    let pairs = (0..n).flat_map(|row| (0..row).map(move |column| [row, column]));
    GridMap {
        axes: scan.over.iter().map(axis).collect(),
        name: "distance from the best, σ".to_owned(),
        alone: (0..n).map(|k| sigmas(scan.profile(&[k]))).collect(),
        pairs: pairs.map(|pair| sigmas(scan.profile(&pair))).collect(),
    }
}

/// The picture of a run that scanned.
pub fn drawing(folder: &Folder) -> anyhow::Result<Option<Drawing>> {
    let path = folder.path().join(PICTURE);
    if !path.is_file() {
        return Ok(None);
    }
    Ok(Some(Drawing {
        svg: output::read_text(&path)?,
        caption: "How well the worlds of the grid explain the data, each with the emission of coarse voxels that does it \
                  best: √(2ΔF), where ΔF is half of χ² (and of the priors) above the best world. On the diagonal along one \
                  parameter, below it over two, the least over all others; dark is better. The white point is the best \
                  world of the grid, from which a finer search went on; orange is the truth, where it is known. \
                  Voxels are coarse and rays next to the critical curve come and go: small steps are ripples."
            .to_owned(),
        alt: "Map of χ² over the scanned parameters of the world.".to_owned(),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_tomo::fit::world::ScanPoint;

    #[test]
    fn exact_scans_are_told_in_degrees() {
        let over = vec![
            Scanned::even(Parameter::Spin, [0.0, 0.5], 2),
            Scanned::even(Parameter::Inclination, [0.5f64.to_radians(), 1.0f64.to_radians()], 2),
        ];
        let world = |k: usize| {
            let world = World::new(0.0, 0.0);
            let world = world.with(Parameter::Spin, over[0].values[k / 2]);
            world.with(Parameter::Inclination, over[1].values[k % 2])
        };
        let point = |k: usize| ScanPoint {
            world: world(k),
            value: (k as f64 - 2.0).powi(2),
            reduced_chi2: 1.0 + k as f64,
        };
        let points = (0..4).map(point).collect();
        let scan = WorldScan { over: over.clone(), points };
        let text = table(&scan);
        assert!(
            text.starts_with("spin,inclination_deg,half_chi2,chi2_per_datum\n0,0.5,4,1\n"),
            "{text}"
        );
        let said = sentence(&json(&scan)).unwrap();
        assert!(said.contains("4 worlds over spin and inclination"), "{said}");
        let map = map(&scan, None);
        assert_eq!(map.axes[0].best, 0.5);
        // Rows of the pair are values of the second parameter.
        let expected = [4.0, 0.0, 1.0, 1.0].map(|value: f64| (2.0 * value).sqrt());
        assert_eq!(map.pairs[0], expected);
    }
}

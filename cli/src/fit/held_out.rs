//! A weight of the linear problem that is chosen by frames that are held out.

use super::folder::Folder;
use crate::checksum::sealed;
use crate::report::{Axis, LinePlot, Marks, Series};
use anyhow::Context;
use kerrlight_tomo::fit::settings::{FitFile, HeldOutSettings};
use kerrlight_tomo::fit::setup::{self, Held};
use kerrlight_tomo::recovery::Choice;
use serde_json::{Value, json};

/// What was found, in the folder of the run.
pub const FILE: &str = "held_out.json";

/// Keeps the values that were compared.
pub fn write(folder: &Folder, file: &FitFile, held: &[Held]) -> anyhow::Result<()> {
    let Some(settings) = &file.held_out else { return Ok(()) };
    folder.file(FILE)?.write(sealed(results(settings, held)).as_bytes())
}

/// The weight that a run has chosen, which is told; none if it has not.
pub fn chosen(folder: &Folder) -> anyhow::Result<Option<Choice>> {
    let Some(results) = folder.found(FILE)? else { return Ok(None) };
    sentence(&results).iter().for_each(|line| eprintln!("{line}"));
    Ok(Some(Choice::Weight(weight(&results, folder)?)))
}

fn weight(results: &Value, folder: &Folder) -> anyhow::Result<f64> {
    results["chosen"].as_f64().with_context(|| folder.damaged(FILE))
}

/// The settings with the weight that a run has chosen.
pub fn settled(file: &FitFile, folder: &Folder) -> anyhow::Result<FitFile> {
    let (Some(settings), Some(results)) = (&file.held_out, folder.found(FILE)?) else {
        return Ok(file.clone());
    };
    Ok(settings.setting.put(file.clone(), weight(&results, folder)?))
}

fn results(settings: &HeldOutSettings, held: &[Held]) -> Value {
    let best = setup::best_held(held);
    let one = |held: &Held| {
        json!({
            "value": held.value, "loss": held.mean(), "losses": held.losses,
            "error": best.map(|best| held.error_beside(best)),
        })
    };
    json!({
        "setting": settings.setting.name(),
        "chosen": best.map(|best| best.value),
        "folds": settings.folds,
        "values": held.iter().map(one).collect::<Vec<_>>(),
    })
}

/// What was chosen, and whether the best value lies at an end of the list.
pub fn sentence(results: &Value) -> Option<String> {
    let (setting, chosen) = (results["setting"].as_str()?, results["chosen"].as_f64()?);
    let values = results["values"].as_array()?;
    let loss = |value: &Value| value["loss"].as_f64();
    let least = values.iter().filter_map(loss).fold(f64::INFINITY, f64::min);
    let listed = values.iter().filter_map(|value| value["value"].as_f64());
    let ends = listed.fold([f64::INFINITY, 0.0f64], |[low, high], x| [low.min(x), high.max(x)]);
    let end = match ends.contains(&chosen) {
        true => "; it is the first or the last of the list, a better one may lie beyond",
        false => "",
    };
    Some(format!(
        "{setting} = {chosen} was chosen from {} values: the frames that were held out have χ² {least:.3} per data \
         point with it{end}.",
        values.len()
    ))
}

/// The loss of held-out frames against the weight.
pub fn plot(results: &Value) -> Option<LinePlot> {
    let values = results["values"].as_array()?;
    let point = |value: &Value| Some([value["value"].as_f64()?, value["loss"].as_f64()?]);
    let points: Vec<[f64; 2]> = values.iter().filter_map(point).collect();
    let errors = values.iter().filter_map(|value| value["error"].as_f64()).collect();
    let log = points.iter().all(|[x, _]| *x > 0.0);
    Some(LinePlot {
        title: "Held-out frames".to_owned(),
        caption: format!(
            "χ² per data point of frames that were not fitted, against the weight: each of {} parts of the frames was \
             held out once. Too small a weight fits noise, too large a one cannot fit the data; both predict frames badly \
             that they have not seen. Bars are standard errors of the difference from the best weight.",
            results["folds"]
        ),
        x: Axis { label: results["setting"].as_str()?.to_owned(), unit: String::new(), log },
        y: Axis { label: "χ² of held-out data".to_owned(), unit: String::new(), log: false },
        series: vec![Series { name: "held out".to_owned(), points, errors, marks: Marks::Joined }],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_tomo::fit::settings::Weight;

    #[test]
    fn exact_the_best_value_is_told_with_its_place() {
        let settings =
            HeldOutSettings { setting: Weight::Smoothness, values: vec![0.1, 1.0, 10.0], folds: 2 };
        let held = |losses: [[f64; 2]; 3]| -> Vec<Held> {
            let pairs = settings.values.iter().zip(losses);
            pairs.map(|(value, losses)| Held { value: *value, losses: losses.to_vec() }).collect()
        };
        let inside = results(&settings, &held([[1.2, 1.4], [1.0, 1.1], [3.0, 3.0]]));
        assert_eq!(inside["chosen"], 1.0);
        let said = sentence(&inside).unwrap();
        assert!(
            said.contains("linear.smoothness = 1 was chosen from 3") && !said.contains("beyond"),
            "{said}"
        );
        let at_end = results(&settings, &held([[0.9, 1.0], [1.0, 1.1], [3.0, 3.0]]));
        assert!(sentence(&at_end).unwrap().contains("beyond"));
        let plot = plot(&inside).unwrap();
        assert_eq!(plot.series[0].errors.len(), 3);
        assert!(plot.x.log);
    }
}

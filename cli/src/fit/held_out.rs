//! A weight of the linear problem that is chosen by frames or baselines that are held out.

use super::failed;
use super::folder::Folder;
use super::journal::Journal;
use crate::checksum::sealed;
use crate::interrupt::{Interrupted, Keeper};
use crate::output;
use crate::progress;
use crate::report::{Axis, LinePlot, Marks, Series};
use anyhow::Context;
use kerrlight_render::dynamics;
use kerrlight_tomo::fit::settings::{FitFile, HeldOutSettings, Kind};
use kerrlight_tomo::fit::setup::{self, Held, HeldData};
use serde_json::{Value, json};

/// What was found, in the folder of the run.
const FILE: &str = "held_out.json";

/// The settings with the weight that held-out frames choose, or have chosen in an earlier run.
pub fn place(
    file: &FitFile,
    folder: &Folder,
    data: HeldData<'_>,
    about: (dynamics::Axis, [f64; 2]),
) -> anyhow::Result<FitFile> {
    let Some(settings) = &file.held_out else { return Ok(file.clone()) };
    if found(folder)?.is_none() {
        let journal = Journal::open(folder)?;
        let held = compare((file, settings), data, about, (&journal, &folder.stopped()))?;
        folder.file(FILE)?.write(sealed(results(settings, &held)).as_bytes())?;
        journal.end();
    }
    for line in found(folder)?.iter().filter_map(sentence) {
        eprintln!("{line}");
    }
    settled(file, folder)
}

/// The same for a representation that is learnt in steps, whose price of change is part of every step. What a linear grid
/// chooses is chosen where it is solved.
pub fn before_steps(
    file: &FitFile,
    folder: &Folder,
    data: HeldData<'_>,
    about: (dynamics::Axis, [f64; 2]),
) -> anyhow::Result<FitFile> {
    match file.representation.kind {
        Kind::LinearGrid => Ok(file.clone()),
        _ => place(file, folder, data, about),
    }
}

/// The settings with the weight that a run has chosen.
pub fn settled(file: &FitFile, folder: &Folder) -> anyhow::Result<FitFile> {
    let (Some(settings), Some(results)) = (&file.held_out, found(folder)?) else {
        return Ok(file.clone());
    };
    let chosen = results["chosen"].as_f64();
    let chosen = chosen.with_context(|| format!("{FILE} is damaged: remove it to look again"))?;
    Ok(settings.setting.put(file.clone(), chosen))
}

fn compare(
    (file, settings): (&FitFile, &HeldOutSettings),
    data: HeldData<'_>,
    about: (dynamics::Axis, [f64; 2]),
    (journal, stopped): (&Journal, &str),
) -> anyhow::Result<Vec<Held>> {
    let keeper = Keeper::brief(stopped);
    let bar = progress::held_out((settings.values.len() * settings.folds) as u64);
    let mut watch = |value: usize, fold: usize| {
        bar.set_position((fold * settings.values.len() + value) as u64);
        bar.set_message(format!("{} = {}", settings.setting.name(), settings.values[value]));
        !keeper.stopped()
    };
    let held = setup::hold_out(file, settings, data, about, journal, &mut watch)
        .map_err(|error| failed::linear(error).context("held_out"))?;
    bar.finish_and_clear();
    held.ok_or_else(|| Interrupted(stopped.to_owned()).into())
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
        "by": settings.by.name(),
        "values": held.iter().map(one).collect::<Vec<_>>(),
    })
}

/// What a run has chosen, if it chose.
pub fn found(folder: &Folder) -> anyhow::Result<Option<Value>> {
    let path = folder.path().join(FILE);
    if !path.exists() {
        return Ok(None);
    }
    let text = output::read_text(&path)?;
    let damaged = || format!("{} is damaged: remove it to look again", path.display());
    serde_json::from_str(&text).map(Some).with_context(damaged)
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
    let by = results["by"].as_str().unwrap_or("frames");
    Some(format!(
        "{setting} = {chosen} was chosen from {} values: the {by} that were held out have χ² {least:.3} per data \
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
    let by = results["by"].as_str().unwrap_or("frames");
    Some(LinePlot {
        title: format!("Held-out {by}"),
        caption: format!(
            "χ² per data point of {by} that were not fitted, against the weight: each of {} parts of the {by} was \
             held out once. Too small a weight fits noise, too large a one cannot fit the data; both predict {by} badly \
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
    use kerrlight_tomo::fit::settings::HeldOutBy;
    use kerrlight_tomo::fit::settings::Weight;

    #[test]
    fn exact_the_best_value_is_told_with_its_place() {
        let settings = HeldOutSettings {
            setting: Weight::Smoothness,
            values: vec![0.1, 1.0, 10.0],
            folds: 2,
            by: HeldOutBy::Frames,
        };
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

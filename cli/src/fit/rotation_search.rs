//! A rotation of all position angles that is looked for before the emission is fitted.

use super::folder::Folder;
use crate::checksum::sealed;
use crate::output;
use crate::report::{Axis, LinePlot, Marks, Series};
use anyhow::Context;
use kerrlight_tomo::fit::settings::FitFile;
use kerrlight_tomo::fit::setup::Rotation;
use kerrlight_tomo::recovery::{Choice, Problem};
use serde_json::{Value, json};

/// What was found, in the folder of the run.
pub const FILE: &str = "faraday.json";

/// Keeps the rotations that were compared.
pub fn write(folder: &Folder, problem: &Problem, rotation: &Rotation) -> anyhow::Result<()> {
    folder.file(FILE)?.write(sealed(results(rotation, &problem.settings)?).as_bytes())
}

/// The rotation that a run has found, which is told; none if it has not looked.
pub fn chosen(folder: &Folder) -> anyhow::Result<Option<Choice>> {
    let Some(results) = found(folder)? else { return Ok(None) };
    sentences(&results).iter().for_each(|line| eprintln!("{line}"));
    let angle = results["angle_deg"].as_f64();
    let angle = angle.with_context(|| format!("{FILE} is damaged: remove it to look again"))?;
    Ok(Some(Choice::Rotation(angle)))
}

fn results(rotation: &Rotation, file: &FitFile) -> anyhow::Result<Value> {
    let turn = |file: &FitFile| file.polarization.map_or(0.0, |law| law.turn_deg);
    let truth = match file.truth {
        Some(_) => Some((turn(&file.simulated()?) - turn(file)).rem_euclid(180.0)),
        None => None,
    };
    let tried: Vec<[f64; 2]> =
        rotation.tried.iter().map(|tried| [tried.angle_deg, tried.loss]).collect();
    Ok(json!({
        "angle_deg": rotation.angle_deg, "sigma_deg": rotation.sigma_deg, "truth_deg": truth,
        "tried": tried,
    }))
}

/// What a run has found, if it has looked.
pub fn found(folder: &Folder) -> anyhow::Result<Option<Value>> {
    let path = folder.path().join(FILE);
    if !path.exists() {
        return Ok(None);
    }
    Ok(Some(serde_json::from_str(&output::read_text(&path)?)?))
}

/// What was found, in sentences.
pub fn sentences(results: &Value) -> Vec<String> {
    let Some(angle) = results["angle_deg"].as_f64() else { return Vec::new() };
    let sigma = match results["sigma_deg"].as_f64() {
        Some(sigma) => format!(" ± {sigma:.2}°"),
        None => "°: χ² has no minimum there, and the data leave it open".to_owned(),
    };
    let truth = results["truth_deg"].as_f64();
    let truth = truth.map_or(String::new(), |truth| format!(" (truth: {truth:.2}°)"));
    vec![format!(
        "Position angles are rotated by {angle:.2}{sigma}{truth} between the source and the data, up to 180°."
    )]
}

/// χ² over the rotation.
pub fn plot(results: &Value) -> Option<LinePlot> {
    let number = |value: &Value| value.as_f64();
    let pair = |pair: &Value| Some([number(&pair[0])?, number(&pair[1])?]);
    let points: Vec<[f64; 2]> = results["tried"].as_array()?.iter().filter_map(pair).collect();
    Some(LinePlot {
        title: "Rotation of position angles".to_owned(),
        caption: "χ² per data point, with penalties, of the emission that explains the data best if all position angles are rotated by this angle on the way.".to_owned(),
        x: Axis { label: "rotation".to_owned(), unit: "° east of north".to_owned(), log: false },
        y: Axis { label: "χ² per data point".to_owned(), unit: String::new(), log: true },
        series: vec![Series {
            name: "best emission".to_owned(),
            points,
            errors: Vec::new(),
            marks: Marks::Line,
        }],
    })
}

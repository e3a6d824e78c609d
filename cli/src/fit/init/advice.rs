//! Advice beside errors in settings.

use kerrlight_imaging::settings::StaticImageFile;
use kerrlight_tomo::Error;
use kerrlight_tomo::fit::settings::{FitError, FitFile};

/// An error of settings, with what to write where a key is missing.
pub fn explained(error: Error) -> anyhow::Error {
    let error = match error {
        Error::Fit(FitError::Syntax(error)) => error,
        other => return other.into(),
    };
    let text = error.to_string();
    // The reader of TOML tells the kind of error and the name in its words alone.
    let missing = text.split_once("missing field `").and_then(|(_, rest)| rest.split('`').next());
    let unknown = text.split_once("unknown field `").and_then(|(_, rest)| rest.split('`').next());
    let advice = match (missing, unknown) {
        (Some(missing), _) => advice(missing, &error.key()),
        (_, Some(unknown)) => moved(&error.key(), unknown).to_owned(),
        _ => String::new(),
    };
    anyhow::anyhow!("{text}{advice}")
}

/// Names the present place of a key or a table that a table does not have.
fn moved(table: &str, key: &str) -> &'static str {
    match (table, key) {
        ("", "world") => {
            "\na number that is not known has a prior in place of its value, such as `spin = { uniform = [0.0, 0.9] }` in \
             [hole]; the search for it is [search], and what differs in a simulation stands in [simulation]"
        }
        ("", "truth" | "observation" | "light_curve" | "movie") => {
            "\nwhat is simulated stands in [simulation]: [simulation.truth], [simulation.movie], \
             [simulation.observation], [simulation.light_curve]; times of images that are read stand in [data.movie]"
        }
        ("training", rate) if rate.ends_with("rate") => {
            "\nlearning rates stand with what is learnt: [representation.network], [representation.feature-grid], \
             [representation.grid], [representation.own]"
        }
        _ => "",
    }
}

/// Advises on a key that is missing in a table; `loss.0` is one of the tables `loss`.
fn advice(missing: &str, table: &str) -> String {
    let is_name = |part: &&str| !part.is_empty() && part.parse::<u32>().is_err();
    let place: Vec<&str> = table.split('.').filter(is_name).collect();
    let path: Vec<&str> = place.iter().copied().chain([missing]).collect();
    let (place, path) = (place.join("."), path.join("."));
    let key = FitFile::keys().at(&path).or_else(|| StaticImageFile::keys().at(&path));
    match key {
        Some(key) if key.is_table() => {
            format!(
                "\nadd a table [{path}]: {} `kerrlight fit --init` writes an example",
                key.meaning
            )
        }
        Some(key) if place.is_empty() => format!("\ngive `{missing} = …`: {}", key.note()),
        Some(key) => format!("\ngive `{missing} = …` in [{place}]: {}", key.note()),
        None => String::new(),
    }
}

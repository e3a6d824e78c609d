//! `kerrlight fit --init`: a commented file to start from, for given data or for the built-in experiment.

mod advice;
mod annotate;
mod guess;
mod light_curve;
mod movie;
mod polarized;
mod quick_look;
mod sources;
mod static_image;
mod template;
mod visibilities;

use super::BUILT_IN;
use crate::answer::Answer;
use crate::output::Output;
use crate::{paths, plain};
pub use advice::explained;
use annotate::annotate;
use anyhow::{Context, bail};
pub use guess::{Guess, guess};
use kerrlight_vlbi::array::Station;
use kerrlight_vlbi::files;
use kerrlight_vlbi::observation::{Observation, Row};
use movie::{of_movie, read_movie};
use quick_look::QuickLook;
use sources::Seen;
use std::path::{Path, PathBuf};

/// Model that is fitted to visibilities.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Model {
    /// An image that does not change.
    Image,
    /// Emission around a hole that moves.
    Volume,
}

/// Name of the file unless the user says.
const NAME: &str = "my_fit.toml";

/// Writes the file and says what is left to the user.
pub fn write(
    data: Option<&Path>,
    to: Option<&Path>,
    model: Option<Model>,
) -> anyhow::Result<Answer> {
    let path = to.unwrap_or(Path::new(NAME));
    if path.exists() {
        bail!("{} exists: give another name with -o", path.display());
    }
    let output = Output::new(path, "toml")?;
    let plain = match data {
        None => BUILT_IN.to_owned(),
        Some(data) => of_data(&[data.to_owned()], path, model)?,
    };
    let text = format!("{}{}", head(path, &plain), annotate(&plain));
    output.write(text.as_bytes())?;
    let left = plain.lines().filter(|line| line.starts_with("#? ")).count();
    let assumed = plain.matches(" #! ").count();
    eprintln!(
        "{assumed} values are ASSUMED and {left} are left to FILL IN: see the comments in the file"
    );
    let answer = Answer::text(format!("{}\n", path.display())).outputs([&output]);
    Ok(answer.with("assumed", assumed).with("to_fill_in", left))
}

fn head(path: &Path, plain: &str) -> String {
    let run = format!("#   kerrlight fit {}\n", plain::word(path));
    let left = if plain.contains("#? ") {
        "# Settings marked FILL IN decide the result, and the data do not determine them. The fit names the first one\n# that is missing.\n"
    } else {
        ""
    };
    let assumed = if plain.contains(" #! ") {
        "# Settings marked ASSUMED decide the result, and the data do not determine them: replace them with your own.\n"
    } else {
        ""
    };
    format!(
        "# Settings of a fit. Run it with\n{run}{left}{assumed}# Lengths and times are in M (GM/c^2, GM/c^3) unless stated otherwise; see docs/reference/fit-file.md.\n"
    )
}

/// The plain settings of one image of several files, for annotation.
fn of_files(data: &[PathBuf], toml: &Path, model: Option<Model>) -> anyhow::Result<String> {
    let all = data.iter().map(|path| Seen::read(path)).collect::<anyhow::Result<Vec<Seen>>>()?;
    let first = all.first().context("no file of data")?;
    let is_image = match model {
        Some(model) => model == Model::Image,
        None => first.source.is_some_and(|source| !source.varies),
    };
    if !is_image {
        bail!("several files are fitted as one image that does not change: give --model image");
    }
    let paths = data.iter().map(|path| seen_from(toml, path).map(toml::Value::String));
    let paths = toml::Value::Array(paths.collect::<anyhow::Result<_>>()?).to_string();
    // Leakage is solved for unless the names of all files say that it was taken out.
    let raw = all.iter().map(|seen| &seen.file);
    let raw = raw.min_by_key(|name| name.to_ascii_lowercase().contains("dterm"));
    let observations: Vec<&Observation> = all.iter().map(|seen| &seen.observation).collect();
    let union = Seen {
        observation: together(&observations),
        file: raw.unwrap_or(&first.file).clone(),
        source: first.source,
        name: first.name.clone(),
    };
    let text = static_image::of_visibilities(&union, &paths)?;
    let read = all.iter().map(|seen| format!("{}{}\n", guess::READ, visibilities::read(seen)));
    // What its first line says of them all is told of each.
    let rest = text.split_once('\n').map_or(&*text, |(_, rest)| rest);
    Ok(read.collect::<String>() + rest)
}

/// Rows of all observations in one, for guesses alone: of total intensity, unless all are polarised and of one basis.
fn together(all: &[&Observation]) -> Observation {
    let is_alike = all.iter().all(|seen| seen.is_polarized() && seen.basis == all[0].basis);
    let part = |seen: &Observation| if is_alike { seen.clone() } else { seen.total_intensity() };
    let mut union = Observation { rows: Vec::new(), channels: Vec::new(), ..part(all[0]) };
    for seen in all.iter().map(|seen| part(seen)) {
        let place = |station: &Station| {
            let known = union.stations.iter().position(|other| other.name == station.name);
            known.unwrap_or_else(|| {
                union.stations.push(station.clone());
                union.stations.len() - 1
            }) as u16
        };
        let places: Vec<u16> = seen.stations.iter().map(place).collect();
        let days = seen.mjd.zip(union.mjd).map_or(0, |(day, first)| day - first);
        union.rows.extend(seen.rows.iter().map(|row| Row {
            time_h: row.time_h + 24.0 * f64::from(days),
            stations: row.stations.map(|k| places[usize::from(k)]),
            channel: 0,
            ..*row
        }));
    }
    // Titles name one day, or none.
    union.mjd = union.mjd.filter(|day| all.iter().all(|seen| seen.mjd == Some(*day)));
    union
}

/// The plain settings of a fit of this file, or of these of one image, for annotation.
fn of_data(data: &[PathBuf], toml: &Path, model: Option<Model>) -> anyhow::Result<String> {
    let [data] = data else { return of_files(data, toml, model) };
    let path = || anyhow::Ok(toml::Value::String(seen_from(toml, data)?).to_string());
    if model == Some(Model::Image) {
        let seen = Seen::read(data)?;
        return of_observation(&seen, &path()?, model);
    }
    let path = path()?;
    if data.is_dir() || matches!(paths::ending(data).as_str(), "npz" | "npy" | "exr") {
        return of_movie(&read_movie(data)?, &path);
    }
    let first = match Seen::read(data) {
        Ok(seen) => return of_observation(&seen, &path, model),
        Err(first) => first,
    };
    // A table may hold a light curve, and a FITS file or a table an image.
    if let Some(text) =
        crate::output::read_text(data).ok().filter(|text| files::is_light_curve(text))
    {
        let curve = files::parse_light_curve(&text).with_context(|| data.display().to_string())?;
        let name = data.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let source = sources::named_in(name).or_else(|| sources::named_above(&text));
        return light_curve::of_light_curve(&curve, &path, name, source);
    }
    read_movie(data).map_or(Err(first), |movie| of_movie(&movie, &path))
}

/// The data's path as the file that names it has to say it.
fn seen_from(toml: &Path, data: &Path) -> anyhow::Result<String> {
    let beside = toml.parent().is_none_or(|folder| folder == Path::new(""));
    let path: PathBuf = match beside {
        true => data.to_owned(),
        false => std::path::absolute(data).with_context(|| data.display().to_string())?,
    };
    let text = path.to_str().with_context(|| format!("{} is not UTF-8", path.display()))?;
    plain::check_name(text)?;
    Ok(text.to_owned())
}

/// Guesses settings for visibilities: a static image, if that is wanted, the source is known to stand still for a night, or
/// what it varies is no more than is known of it.
fn of_observation(seen: &Seen, path: &str, model: Option<Model>) -> anyhow::Result<String> {
    let image = || static_image::of_visibilities(seen, path);
    let volume = || visibilities::of_visibilities(seen, path);
    match (model, &seen.source) {
        (Some(Model::Image), _) => image(),
        (Some(Model::Volume), _) | (None, None) => volume(),
        (None, Some(source)) if !source.varies => image(),
        (None, Some(source)) => {
            let static_image = image().ok();
            let look = static_image.as_ref().and_then(|text| QuickLook::new(text, seen));
            let (Some(text), Some(look)) = (static_image, look) else {
                if source.image.is_some() {
                    return volume();
                }
                let said = "whether the data ask for motion was not tested: nothing is published of the image at this frequency; --model image fits one";
                return Ok(volume()?.replacen('\n', &format!("\n{}{said}\n", guess::READ), 1));
            };
            let text = if look.explains() { text } else { volume()? };
            let said = format!("\n{}{}\n", guess::READ, look.sentence());
            Ok(text.replacen('\n', &said, 1))
        }
    }
}

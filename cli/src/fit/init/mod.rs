//! `kerrlight fit --init`: a commented file to start from, for given data or for the built-in experiment.

mod annotate;
mod guess;
mod light_curve;
mod polarized;
mod quick_look;
mod sources;
mod static_image;

use super::{BUILT_IN, Work};
use crate::answer::Answer;
use crate::interferometry::image_files::OwnTimes;
use crate::interferometry::movie_files;
use crate::output::Output;
use crate::plain;
use annotate::annotate;
use anyhow::{Context, bail};
pub use guess::{Guess, guess};
use kerrlight_common::toml_file::ReadError;
use kerrlight_common::units::{MICROARCSECOND, gravitational_angle};
use kerrlight_imaging::settings::StaticImageFile;
use kerrlight_tomo::fit::settings::FitFile;
use kerrlight_tomo::fit::setup::{self, VisibilitySettings};
use kerrlight_vlbi::data_terms::ClosureTerm;
use kerrlight_vlbi::files;
use kerrlight_vlbi::gains::prior_table;
use kerrlight_vlbi::observation::Observation;
use kerrlight_vlbi::products::ClosureKind;
use kerrlight_vlbi::simulate::{Movie, StokesMovie};
use quick_look::QuickLook;
use sources::{SOURCES, Source};
use std::path::{Path, PathBuf};

/// An error in settings; of what is missing, with what to write.
pub fn explained(error: &ReadError) -> anyhow::Error {
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
    let run = format!("#   kerrlight fit {}\n", path.display());
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

/// The plain settings of one image of several files, for annotation: guessed from the first.
fn of_files(data: &[PathBuf], toml: &Path, model: Option<Model>) -> anyhow::Result<String> {
    let mut observations = Vec::new();
    for path in data {
        observations.push(crate::interferometry::read(path)?.1);
    }
    let first = observations.first().context("no file of data")?;
    let source = known(first);
    let is_image = match model {
        Some(model) => model == Model::Image,
        None => source.is_some_and(|source| !source.varies),
    };
    if !is_image {
        bail!("several files are fitted as one image that does not change: give --model image");
    }
    let name = &called(first, source);
    let file = |path: &PathBuf| {
        path.file_name().and_then(|name| name.to_str()).unwrap_or_default().to_owned()
    };
    let paths = data.iter().map(|path| seen_from(toml, path).map(toml::Value::String));
    let paths = toml::Value::Array(paths.collect::<anyhow::Result<_>>()?).to_string();
    let text = static_image::of_visibilities(first, source, name, &paths, &file(&data[0]))?;
    let others = observations.iter().zip(data).skip(1);
    let said: String = others
        .map(|(seen, path)| {
            let name = &called(seen, known(seen));
            format!("{}{}\n", guess::READ, read(seen, &file(path), name, known(seen).is_some()))
        })
        .collect();
    Ok(text.replacen('\n', &format!("\n{said}"), 1))
}

/// The plain settings of a fit of this file, or of these of one image, for annotation.
fn of_data(data: &[PathBuf], toml: &Path, model: Option<Model>) -> anyhow::Result<String> {
    let [data] = data else { return of_files(data, toml, model) };
    if model == Some(Model::Image) {
        let (_, observation) = crate::interferometry::read(data)?;
        return of_observation(&observation, data, toml, model);
    }
    let path = toml::Value::String(seen_from(toml, data)?).to_string();
    let extension = data.extension().and_then(|e| e.to_str()).unwrap_or_default();
    if data.is_dir() || matches!(extension.to_ascii_lowercase().as_str(), "npz" | "npy" | "exr") {
        return of_movie(&read_movie(data)?, &path);
    }
    let name = data.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let first = match crate::interferometry::read(data) {
        Ok((_, observation)) => return of_observation(&observation, data, toml, model),
        Err(first) => first,
    };
    // A table may hold a light curve, and a FITS file or a table an image.
    if let Some(text) =
        crate::output::read_text(data).ok().filter(|text| files::is_light_curve(text))
    {
        let curve = files::parse_light_curve(&text).with_context(|| data.display().to_string())?;
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

/// Images, their times and the width of their field in µas, as far as the file tells.
struct Images {
    movie: Movie,
    times: OwnTimes,
    field_uas: Option<f64>,
}

fn read_movie(path: &Path) -> anyhow::Result<Images> {
    let files = movie_files::files(path)?;
    let of = |(StokesMovie { i: movie, .. }, times): (StokesMovie, OwnTimes), known: bool| {
        let field = movie.grid.pixel_rad * movie.grid.width as f64 / MICROARCSECOND;
        Images { movie, times, field_uas: known.then_some(field) }
    };
    // First without a field: FITS and text images, which have one, refuse another.
    movie_files::read(&files, None).map(|read| of(read, true)).or_else(|first| {
        movie_files::read(&files, Some(1.0)).map(|read| of(read, false)).map_err(|_| first)
    })
}

fn known(observation: &Observation) -> Option<&'static Source> {
    let word: String = observation.source.to_ascii_uppercase().split_whitespace().collect();
    SOURCES.iter().find(|source| {
        let near = observation.position.is_some_and(|at| {
            let hours = (at.ra_hours - source.position.ra_hours).abs();
            hours < 0.01 && (at.dec_deg - source.position.dec_deg).abs() < 0.1
        });
        near || source.words.iter().any(|name| word.starts_with(name))
    })
}

/// The source's name in a line of text.
fn called(observation: &Observation, source: Option<&Source>) -> String {
    let name = source.map_or(observation.source.trim(), |source| source.name);
    plain::line(if name.is_empty() { "unnamed source" } else { name }).into_owned()
}

/// Guesses settings for visibilities: a static image, if that is wanted, the source is known to stand still for a night, or
/// what it varies is no more than is known of it.
fn of_observation(
    observation: &Observation,
    data: &Path,
    toml: &Path,
    model: Option<Model>,
) -> anyhow::Result<String> {
    let path = toml::Value::String(seen_from(toml, data)?).to_string();
    let file = data.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let source = known(observation);
    let name = &called(observation, source);
    let image = || static_image::of_visibilities(observation, source, name, &path, file);
    let volume = || of_visibilities(observation, &path, file);
    match (model, source) {
        (Some(Model::Image), _) => image(),
        (Some(Model::Volume), _) | (None, None) => volume(),
        (None, Some(source)) if !source.varies => image(),
        (None, Some(_)) => {
            let static_image = image().ok();
            let look =
                static_image.as_ref().and_then(|text| QuickLook::new(text, observation, file));
            let (Some(text), Some(look)) = (static_image, look) else { return volume() };
            let text = if look.explains() { text } else { volume()? };
            let said = format!("\n{}{}\n", guess::READ, look.sentence());
            Ok(text.replacen('\n', &said, 1))
        }
    }
}

fn of_visibilities(observation: &Observation, path: &str, file: &str) -> anyhow::Result<String> {
    let flux = short_baselines(observation)?;
    let source = known(observation);
    let name = &called(observation, source);
    let day = observation.mjd.map_or(String::new(), |mjd| format!(", MJD {mjd}"));
    let (mass, inclination, field) = match source {
        Some(of) => (
            format!(
                "mass_msun = {:?} #! {}\ndistance_kpc = {:?} #! {}",
                of.mass_msun, of.mass, of.distance_kpc, of.mass
            ),
            format!("inclination_deg = {:?} #! {}", of.inclination_deg, of.inclination),
            format!(
                "{:.0} microarcseconds",
                24.0 * gravitational_angle(of.mass_msun, of.distance_kpc)
            ),
        ),
        None => (
            format!(
                "#? mass_msun = 4.154e6 # no built-in value for {name}\n#? distance_kpc = 8.178 # the same"
            ),
            "#? inclination_deg = 60.0 # the data do not determine the inclination".to_owned(),
            "from the mass and distance".to_owned(),
        ),
    };
    let mut losses = "[[loss]]\ndata = \"amplitudes\"\nweight = 1.0".to_owned();
    if has_closures(observation, 300.0, source.is_some_and(|source| source.uv_min.is_some())) {
        losses += "\n[[loss]]\ndata = \"closure-phases\"\nweight = 1.0\nleast_snr = 3.0 #! weaker ones are not Gaussian";
    }
    // Pixels of the region, 8 M deep, with emission 0.02.
    let per_pixel = flux / (core::f64::consts::PI * (10.0f64 / 24.0 * 32.0).powi(2) * 8.0 * 0.02);
    let fields = [
        ("title", format!("{}{day}: measured visibilities", plain_words(name))),
        ("mass", mass),
        ("inclination", inclination),
        ("field", field),
        ("jy", digits(per_pixel)),
        ("flux", digits(flux)),
        ("losses", losses),
        ("uv_min", source.and_then(|source| source.uv_min).unwrap_or_default().to_owned()),
        ("gains", gains(observation)),
        ("read", read(observation, file, name, source.is_some()) + unfitted(observation)),
        ("path", path.to_owned()),
    ];
    complete(include_str!("visibilities.toml"), &fields)
}

/// Returns whether closure phases are left of the rows that the template's fit keeps.
fn has_closures(observation: &Observation, average_s: f64, long_only: bool) -> bool {
    // Averages and the shortest baseline of the template decide what still closes.
    let settings = VisibilitySettings { average_s, uv_min: long_only.then_some(1e8) };
    let Ok(mut kept) = setup::prepared(observation.clone(), &settings) else { return false };
    setup::frames_of(&mut kept);
    ClosureTerm::<f64>::new(&kept, ClosureKind::Phase, 3.0).is_ok()
}

/// Describes the assumed gains of the stations.
fn gains(observation: &Observation) -> String {
    let seen = |k: usize| observation.rows.iter().any(|r| r.stations.contains(&(k as u16)));
    let names = observation.stations.iter().enumerate().filter(|(k, _)| seen(*k));
    let known = |name: &str| prior_table("EHT2017", name).is_some();
    match names.map(|(_, station)| &station.name).all(|name| known(name)) {
        true => "table = \"EHT2017\" #! 10 % of the amplitude, 60 % at the LMT, which lost light by pointing".to_owned(),
        false => "amplitude = 0.1 #! stations are calibrated to 10 % of their amplitudes".to_owned(),
    }
}

/// Describes the file, in a line.
fn read(observation: &Observation, file: &str, name: &str, is_known: bool) -> String {
    let rows: Vec<f64> = observation.stokes_i().map(|(row, _)| row.time_h).collect();
    let [first, last] = rows
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], time| [a.min(*time), b.max(*time)]);
    let source =
        if is_known { format!("{name}, recognised by position or name") } else { name.to_owned() };
    let day = observation.mjd.map_or(String::new(), |mjd| format!(", MJD {mjd}"));
    let frequency =
        observation.frequency_hz.map_or(String::new(), |hz| format!(" at {:.1} GHz", hz * 1e-9));
    format!(
        "{file}: {source}{day}, {first:.2} h to {last:.2} h UTC, {} stations, {} visibilities of Stokes I{frequency}",
        observation.stations.len(),
        rows.len()
    )
}

/// Names the data that a volume leaves out.
fn unfitted(observation: &Observation) -> &'static str {
    match observation.is_polarized() {
        true => "; its polarisation is not fitted without [polarization]",
        false => "",
    }
}

/// Median amplitude of the shortest tenth of the baselines, Jy.
fn short_baselines(observation: &Observation) -> anyhow::Result<f64> {
    let mut all: Vec<[f64; 2]> = observation
        .rows
        .iter()
        .filter_map(|row| {
            let i = row.stokes_i(observation.basis)?;
            Some([row.uv[0].hypot(row.uv[1]), i.visibility.norm()])
        })
        .filter(|pair| pair.iter().all(|x| x.is_finite()))
        .collect();
    all.sort_by(|a, b| a[0].total_cmp(&b[0]));
    // The shortest resolve least; the median of a tenth does not hang on a single datum.
    all.truncate(all.len().div_ceil(10));
    all.sort_by(|a, b| a[1].total_cmp(&b[1]));
    match all.get(all.len() / 2) {
        Some([_, flux]) if *flux > 0.0 => Ok(*flux),
        _ => bail!("there are no nonzero visibilities of total intensity"),
    }
}

fn of_movie(images: &Images, path: &str) -> anyhow::Result<String> {
    let Images { movie, times, field_uas } = images;
    let (grid, frames) = (movie.grid, movie.frames());
    if grid.width != grid.height {
        bail!("images of {} x {} pixels: a fit needs square images", grid.width, grid.height);
    }
    let flux =
        movie.pixels.chunks(grid.pixels()).map(|image| image.iter().sum()).fold(0.0, f64::max);
    let peak = movie.pixels.iter().copied().fold(0.0, f64::max);
    if flux <= 0.0 {
        bail!("all pixels of the images are zero");
    }
    let jy = flux / (grid.pixels() as f64 * 4.0 * 0.02);
    let span = field_uas
        .map_or(String::new(), |field| format!("; on the sky it is {field:.1} microarcseconds"));
    let hours = match times {
        OwnTimes::Unknown => String::new(),
        OwnTimes::Utc(hours) | OwnTimes::Since(hours) => match hours[..] {
            [first, .., last] => format!("; they span {:.4} hours", last - first),
            _ => String::new(),
        },
    };
    let fields = [
        ("title", "Images".to_owned()),
        ("pixels", grid.width.to_string()),
        ("frames", frames.to_string()),
        ("jy", digits(jy)),
        ("upper", digits(10.0 * (peak / jy).max(1.0))),
        ("flux", digits(flux)),
        ("peak", digits(peak)),
        ("span", span),
        ("hours", hours),
        ("path", path.to_owned()),
    ];
    complete(include_str!("movie.toml"), &fields)
}

/// A number with three digits, as TOML has it.
fn digits(value: f64) -> String {
    let rounded: f64 = format!("{value:.2e}").parse().unwrap_or(value);
    format!("{rounded:?}")
}

/// A name without what would end a string.
fn plain_words(name: &str) -> String {
    name.chars().filter(|c| !c.is_control() && !matches!(c, '"' | '\\')).collect()
}

/// The template with its fields; what comes out is a fit's file once all is filled in.
fn complete(template: &str, fields: &[(&str, String)]) -> anyhow::Result<String> {
    let mut text = String::with_capacity(2 * template.len());
    let mut rest = template;
    // Once from front to back: what a field says, the name of a file perhaps, is no field itself.
    while let Some((before, after)) = rest.split_once('{') {
        let name_of = |(name, _): &&(&str, String)| {
            after.strip_prefix(*name).is_some_and(|after| after.starts_with('}'))
        };
        text.push_str(before);
        match fields.iter().find(name_of) {
            Some((name, value)) => {
                text.push_str(value);
                rest = &after[name.len() + 1..];
            }
            None => {
                text.push('{');
                rest = after;
            }
        }
    }
    text.push_str(rest);
    // With everything filled in: a template that is no fit is found now, not by the user.
    Work::read(&text.replace("#? ", "")).context("the starter file")?;
    Ok(text)
}

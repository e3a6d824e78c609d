//! `kerrlight inspect`: what a file holds.

mod arrays;
mod run_folder;

use crate::interferometry::plots::{self, PlotFile};
use crate::output;
use anyhow::{Context, bail};
use clap::Args;
use kerrlight_tomo::image::exr::{self, Attributes, ChannelSurvey, Survey};
use kerrlight_tomo::interferometry::files::{self, Format};
use kerrlight_tomo::interferometry::observation::{Basis, Observation};
use kerrlight_tomo::render::CHANNELS;
use std::collections::BTreeSet;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

/// Arguments of `kerrlight inspect`.
#[derive(Debug, Args)]
pub struct Inspect {
    /// A picture (EXR), arrays (NPZ, NPY: movies, volumes, tables), visibilities (UVFITS, eht-imaging's
    /// text, tables of the EHT or of kerrlight), or the folder of a fit
    file: PathBuf,
    /// Of visibilities: where to draw amplitudes against baselines
    #[arg(long, value_name = "FILE.png|.svg")]
    plot: Option<PathBuf>,
}

impl Inspect {
    /// Prints what the file holds.
    pub fn run(&self) -> anyhow::Result<()> {
        let name = || self.file.display().to_string();
        let plot = self.plot.as_deref().map(PlotFile::new).transpose()?;
        let refuse_plot = |what: &str| match &self.plot {
            Some(_) => bail!("--plot is for visibilities, {} is {what}", name()),
            None => Ok(()),
        };
        if self.file.is_dir() {
            refuse_plot("a folder")?;
            return output::print(&run_folder::describe(&self.file)?);
        }
        let start = first_bytes(&self.file)?;
        if start.starts_with(&EXR_MAGIC) {
            refuse_plot("a picture")?;
            return picture(&self.file);
        }
        if arrays::begins(&start) {
            refuse_plot("an archive of arrays")?;
            return output::print(&arrays::describe(&self.file, &start).with_context(name)?);
        }
        if self.file.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr")) {
            bail!("{}: not an EXR file (its first bytes are not an EXR's)", name());
        }
        let (format, observation) = files::decode(&output::read(&self.file)?).with_context(name)?;
        output::print(&describe(&name(), format, &observation))?;
        if let Some(plot) = plot {
            plot.spares(&self.file)?;
            plot.write(plots::amplitudes(&observation, &observation.source))?;
        }
        Ok(())
    }
}

/// How an EXR begins.
const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// The first bytes of a file, which tell what it is.
fn first_bytes(path: &Path) -> anyhow::Result<Vec<u8>> {
    let mut start = Vec::new();
    let mut file = output::open(path)?.take(8);
    file.read_to_end(&mut start).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(start)
}

/// Prints what a picture holds.
fn picture(path: &Path) -> anyhow::Result<()> {
    let name = path.display();
    let file = BufReader::new(output::open(path)?);
    let survey = exr::survey(file).with_context(|| format!("{name}: damaged or unusual EXR"))?;
    let mut text = format!("{name}: EXR, {} x {} pixels\n\n", survey.width, survey.height);
    text += &channel_table(&survey);
    for (name, value) in &survey.attributes {
        text += &format!("\n{name}:{}\n", indented(value));
    }
    if survey.attributes.is_empty() {
        text += "\nno settings: not rendered by kerrlight, or stripped by another program\n";
    }
    output::print(&text)
}

/// What there is to know about visibilities.
fn describe(name: &str, format: Format, observation: &Observation) -> String {
    let rows = &observation.rows;
    let or_unknown = |value: Option<String>| value.unwrap_or_else(|| "not told".to_owned());
    let position = observation.position;
    let place = position.map(|p| format!("RA {} h, Dec {} deg", p.ra_hours, p.dec_deg));
    let ghz = |hz: Option<f64>| or_unknown(hz.map(|hz| format!("{} GHz", hz / 1e9)));
    let times = || rows.iter().map(|row| row.time_h);
    let distinct: BTreeSet<u64> = times().map(f64::to_bits).collect();
    let baselines: BTreeSet<[u16; 2]> = rows
        .iter()
        .map(|row| {
            if row.stations[0] < row.stations[1] {
                row.stations
            } else {
                row.swapped(observation.basis).stations
            }
        })
        .collect();
    let mut text = format!("{name}: {format}\n\n");
    let mut line = |key: &str, value: String| text += &format!("{key:<12}{value}\n");
    line("source", format!("{}, {}", observation.source, or_unknown(place)));
    line("MJD", or_unknown(observation.mjd.map(|mjd| mjd.to_string())));
    line(
        "UTC",
        format!(
            "{:.6} to {:.6} h, {} times",
            times().fold(f64::INFINITY, f64::min),
            times().fold(f64::NEG_INFINITY, f64::max),
            distinct.len()
        ),
    );
    line("frequency", ghz(observation.frequency_hz));
    line("bandwidth", ghz(observation.bandwidth_hz));
    if !observation.channels.is_empty() {
        let all = observation.channels.iter().map(|c| (c.frequency_hz / 1e9).to_string());
        let shown: Vec<String> = all.take(16).collect();
        let rest = if observation.channels.len() > 16 { ", ..." } else { "" };
        let count = observation.channels.len();
        line("channels", format!("{count}: {}{rest} GHz", shown.join(", ")));
    }
    line("baselines", format!("{}, {} rows", baselines.len(), rows.len()));
    line("products", products(observation));
    text + &station_table(observation) + &history(observation)
}

/// How many of each product, and how large Stokes I is.
fn products(observation: &Observation) -> String {
    let names = match observation.basis {
        Basis::Circular => ["RR", "LL", "RL", "LR"],
        Basis::Stokes => ["I", "Q", "U", "V"],
    };
    let count = |k: usize| observation.rows.iter().filter(|row| row.product(k).is_some()).count();
    let counts: Vec<String> = (0..4).map(|k| format!("{} {}", names[k], count(k))).collect();
    let amplitudes = || observation.stokes_i().map(|(_, i)| i.visibility.norm());
    let least = amplitudes().fold(f64::INFINITY, f64::min);
    let most = amplitudes().fold(f64::NEG_INFINITY, f64::max);
    format!("{}; |I| {least:.4e} to {most:.4e} Jy", counts.join(", "))
}

fn station_table(observation: &Observation) -> String {
    let mut table = format!(
        "\n{:<12}{:>16}{:>16}{:>16}{:>10}{:>10}{:>8}\n",
        "station", "x (m)", "y (m)", "z (m)", "SEFD R", "SEFD L", "rows"
    );
    for (k, station) in observation.stations.iter().enumerate() {
        let of_station = |row: &&_| row_has(row, k);
        let rows = observation.rows.iter().filter(of_station).count();
        let place = match station.position {
            Some([x, y, z]) => format!("{x:>16.4}{y:>16.4}{z:>16.4}"),
            None => format!("{:>48}", "not told"),
        };
        let [r, l] = station.sefd;
        table += &format!("{:<12}{place}{r:>10}{l:>10}{rows:>8}\n", station.name);
    }
    table
}

fn row_has(row: &kerrlight_tomo::interferometry::observation::Row, station: usize) -> bool {
    row.stations.iter().any(|k| usize::from(*k) == station)
}

fn history(observation: &Observation) -> String {
    let lines = observation.history.iter().map(|line| format!("\n{line}"));
    let text: String = lines.collect();
    if text.is_empty() { text } else { text + "\n" }
}

/// A short value on the same line, a long one below, indented.
fn indented(value: &str) -> String {
    if !value.contains('\n') {
        return format!(" {value}");
    }
    value.trim_end().lines().map(|line| format!("\n    {line}")).collect()
}

fn channel_table(survey: &Survey) -> String {
    let mut table = format!(
        "{:<12}{:>15}{:>15}{:>15}{:>12}  unit\n",
        "channel", "least", "most", "mean", "not finite"
    );
    for channel in &survey.channels {
        let ChannelSurvey { name, least, most, mean, not_finite } = channel;
        table += &format!("{name:<12}{least:>15.6e}{most:>15.6e}{mean:>15.6e}{not_finite:>12}");
        table += &format!("  {}\n", unit(name, &survey.attributes));
    }
    table
}

/// The unit of a channel, where kerrlight wrote it.
fn unit<'a>(name: &str, attributes: &'a Attributes) -> &'a str {
    let kind = CHANNELS.iter().find(|kind| kind.name == name);
    match kind.map(|kind| kind.unit) {
        Some(unit) if !attributes.is_empty() => attributes.get(unit).map_or(unit, String::as_str),
        _ => "",
    }
}

//! `kerrlight inspect`: what a file holds.

mod arrays;
mod run_folder;
mod visibilities;

use crate::answer::Answer;
use crate::interferometry::plots::{self, PlotFile};
use crate::{output, paths};
use anyhow::{Context, bail};
use clap::Args;
use kerrlight_render::image::exr::{self, Attributes, ChannelSurvey, Survey};
use kerrlight_render::picture::CHANNELS;
use kerrlight_vlbi::files;
use serde_json::{Value, json};
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

/// Arguments of `kerrlight inspect`.
#[derive(Debug, Args)]
pub struct Inspect {
    /// A picture (EXR), arrays (NPZ, NPY: movies, volumes, tables), visibilities (UVFITS, eht-imaging's
    /// text, tables of the EHT or of kerrlight), or the folder of a fit
    file: PathBuf,
    /// Plot of the amplitudes of visibilities against baselines
    #[arg(long, value_name = "FILE.png|.svg")]
    plot: Option<PathBuf>,
}

impl Inspect {
    /// Prints what the file holds.
    pub fn run(&self) -> anyhow::Result<Answer> {
        let name = || self.file.display().to_string();
        let plot = self.plot.as_deref().map(PlotFile::new).transpose()?;
        let refuse_plot = |what: &str| match &self.plot {
            Some(_) => bail!("--plot is for visibilities, {} is {what}", name()),
            None => Ok(()),
        };
        if self.file.is_dir() {
            refuse_plot("a folder")?;
            return run_folder::describe(&self.file);
        }
        let start = first_bytes(&self.file)?;
        if start.starts_with(&EXR_MAGIC) {
            refuse_plot("a picture")?;
            return picture(&self.file);
        }
        if arrays::begins(&start) {
            refuse_plot("an archive of arrays")?;
            return arrays::describe(&self.file, &start).with_context(name);
        }
        if paths::ending(&self.file) == "exr" {
            bail!("{}: not an EXR file (its first bytes are not an EXR's)", name());
        }
        let (format, observation) = files::decode(&output::read(&self.file)?).with_context(name)?;
        let answer = visibilities::describe(&name(), format, &observation);
        let Some(plot) = plot else { return Ok(answer) };
        plot.output.must_differ_from(&self.file)?;
        plot.write(plots::amplitudes(&observation, &observation.source))?;
        Ok(answer.outputs([&plot.output]))
    }
}

/// First bytes of an EXR file.
const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// The first bytes of a file, which tell what it is.
fn first_bytes(path: &Path) -> anyhow::Result<Vec<u8>> {
    let mut start = Vec::new();
    let mut file = output::open(path)?.take(8);
    file.read_to_end(&mut start).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(start)
}

/// Describes a picture.
fn picture(path: &Path) -> anyhow::Result<Answer> {
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
    let channel = |channel: &ChannelSurvey| {
        json!({
            "name": channel.name,
            "least": channel.least,
            "most": channel.most,
            "mean": channel.mean,
            "not_finite": channel.not_finite,
            "unit": unit(&channel.name, &survey.attributes),
        })
    };
    let channels: Vec<Value> = survey.channels.iter().map(channel).collect();
    let answer = Answer::text(text).with("file", name.to_string()).with("format", "EXR");
    let answer = answer.with("width", survey.width).with("height", survey.height);
    Ok(answer.with("channels", channels).with("attributes", json!(survey.attributes)))
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

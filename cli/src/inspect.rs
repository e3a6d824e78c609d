//! `kerrlight inspect`: what a file holds.

use crate::output;
use anyhow::{Context, bail};
use clap::Args;
use kerrlight_tomo::image::{Picture, exr};
use std::path::PathBuf;

/// Arguments of `kerrlight inspect`.
#[derive(Debug, Args)]
pub struct Inspect {
    /// An EXR file
    file: PathBuf,
}

impl Inspect {
    /// Prints what the file holds.
    pub fn run(&self) -> anyhow::Result<()> {
        let name = || self.file.display().to_string();
        let bytes = output::read(&self.file)?;
        if !bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
            bail!("{}: not an EXR file (its first bytes are not an EXR's)", name());
        }
        let (picture, attributes) =
            exr::decode(&bytes).with_context(|| format!("{}: damaged or unusual EXR", name()))?;
        let mut text =
            format!("{}: EXR, {} x {} pixels\n\n", name(), picture.width, picture.height);
        text += &channel_table(&picture);
        for (name, value) in &attributes {
            text += &format!("\n{name}:{}\n", indented(value));
        }
        if attributes.is_empty() {
            text += "\nno settings: not rendered by kerrlight, or stripped by another program\n";
        }
        output::print(&text)
    }
}

/// A short value on the same line, a long one below, indented.
fn indented(value: &str) -> String {
    if !value.contains('\n') {
        return format!(" {value}");
    }
    value.trim_end().lines().map(|line| format!("\n    {line}")).collect()
}

fn channel_table(picture: &Picture) -> String {
    let mut table = format!(
        "{:<12}{:>15}{:>15}{:>15}{:>12}\n",
        "channel", "least", "most", "mean", "not finite"
    );
    for channel in &picture.channels {
        let finite = || channel.values.iter().filter(|v| v.is_finite());
        let (least, most) = finite()
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
        let count = finite().count();
        let mean = finite().map(|v| f64::from(*v)).sum::<f64>() / count.max(1) as f64;
        let bad = channel.values.len() - count;
        let name = &channel.name;
        table += &format!("{name:<12}{least:>15.6e}{most:>15.6e}{mean:>15.6e}{bad:>12}\n");
    }
    table
}

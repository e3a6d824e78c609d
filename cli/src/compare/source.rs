//! Experiments that the program carries, and those of files.

use crate::output;
use crate::paths;
use anyhow::{Context, anyhow, bail};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use toml::Table;

/// Folder of an experiment, and of the fits that it names; none if the program carries them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Source(Option<PathBuf>);

/// Experiments and fits that the program carries, by their paths in the repository.
macro_rules! carried {
    ($($path:literal),* $(,)?) => {
        [$(($path, include_str!(concat!("../../../", $path)))),*]
    };
}

const CARRIED: &[(&str, &str)] = &carried![
    "experiments/representations.toml",
    "experiments/tuning.toml",
    "experiments/sparse-representations.toml",
    "experiments/sparsity.toml",
    "experiments/axis.toml",
    "experiments/axis-minimum.toml",
    "experiments/velocity-mismatch.toml",
    "experiments/coverage.toml",
    "experiments/effects.toml",
    "experiments/cost.toml",
    "experiments/spin-mismatch.toml",
    "experiments/geometry.toml",
    "experiments/calibration.toml",
    "experiments/coverage-of-volumes.toml",
    "experiments/soft-flow.toml",
    "experiments/orbital-polarimetry.toml",
    "experiments/m87-2017.toml",
    "experiments/sgra-2017.toml",
    "experiments/sgra-2017-motion.toml",
    "experiments/sgra-2017-polarimetry.toml",
    "experiments/sgra-2017-polarization.toml",
    "experiments/fits/first_pattern.toml",
    "experiments/fits/second_pattern.toml",
    "experiments/fits/digits.toml",
    "experiments/fits/injections.toml",
    "scenes/fits/scene_1.toml",
    "scenes/fits/scene_4.toml",
    "scenes/fits/scene_8.toml",
    "scenes/fits/orbital_polarimetry.toml",
    "scenes/fits/m87_image.toml",
    "scenes/fits/sgra_image.toml",
    "scenes/fits/sgra_polarized_image.toml",
    "scenes/fits/sgra_motion.toml",
    "scenes/fits/sgra_polarimetry.toml",
    "cli/src/fit/built_in.toml",
];

/// Names and titles of the experiments that the program carries.
pub fn built_in() -> impl Iterator<Item = (&'static str, String)> {
    CARRIED.iter().filter_map(|(path, text)| {
        let name = path.strip_prefix("experiments/")?.strip_suffix(".toml")?;
        let title = text.parse::<Table>().ok()?.get("title")?.as_str()?.to_owned();
        (!name.contains('/')).then_some((name, title))
    })
}

impl Source {
    /// The text of an experiment: one that the program carries, or a file.
    pub fn find(name: &Path) -> anyhow::Result<(Self, String)> {
        let path = format!("experiments/{}.toml", name.display());
        if let Some((_, text)) = CARRIED.iter().find(|(known, _)| *known == path) {
            return Ok((Self::default(), (*text).to_owned()));
        }
        if !name.exists() && name.extension().is_none() {
            let all: Vec<&str> = built_in().map(|(name, _)| name).collect();
            bail!(
                "there is no experiment {}: give a file, or one of {}",
                name.display(),
                all.join(", ")
            );
        }
        let folder = std::path::absolute(paths::folder_of(name))
            .with_context(|| name.display().to_string())?;
        Ok((Self(Some(folder)), output::read_text(name)?))
    }

    /// Settings of the experiment's own file, with paths in them from anywhere.
    pub fn anchored(&self, settings: &Table) -> Table {
        let mut settings = settings.clone();
        if let Some(folder) = &self.0 {
            paths::anchor(&mut settings, folder);
        }
        settings
    }

    /// A fit's settings, with paths in them from anywhere.
    pub fn fit(&self, path: &Path) -> anyhow::Result<Table> {
        let text = self.fit_text(path)?;
        let mut table: Table = text.parse().with_context(|| path.display().to_string())?;
        if let Some(folder) = &self.0 {
            paths::anchor(&mut table, folder.join(path).parent().unwrap_or(folder));
        }
        Ok(table)
    }

    /// A fit's settings as they stand in their file.
    pub fn fit_text(&self, path: &Path) -> anyhow::Result<Cow<'static, str>> {
        if let Some(folder) = &self.0 {
            return Ok(output::read_text(&folder.join(path))?.into());
        }
        let wanted = path.to_string_lossy();
        // Paths in a carried experiment start from its place in the repository, `experiments/`.
        let wanted = match wanted.strip_prefix("../") {
            Some(path) => path.to_owned(),
            None => format!("experiments/{wanted}"),
        };
        let known = CARRIED.iter().find(|(path, _)| *path == wanted);
        let (_, text) = known.ok_or_else(|| anyhow!("the program carries no {wanted}"))?;
        Ok((*text).into())
    }
}

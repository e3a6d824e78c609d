//! What a folder of results was begun with: whoever joins runs the same cases, from any current folder.

use super::cases::Choice;
use super::source::Source;
use crate::checksum::{is_whole, sealed};
use crate::output::{self, Output};
use crate::paths;
use anyhow::{Context, bail};
use kerrlight_tomo::representation::Registry;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Its name in the folder.
pub const FILE: &str = "plan.json";
/// The experiment's own text beside it.
pub const EXPERIMENT: &str = "experiment.toml";

/// Which cases of which experiment are run, and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Version of the program.
    version: String,
    /// Where paths in the experiment start from; none for one that the program carries.
    base: Option<PathBuf>,
    /// As on the command line.
    seeds: Option<u64>,
    only: Vec<String>,
    quick: bool,
    /// Assignments, whose paths start from the root.
    set: Vec<String>,
}

impl Plan {
    /// Of a command line.
    pub fn new(source: &Source, choice: &Choice) -> anyhow::Result<Self> {
        let base = match source {
            Source::BuiltIn => None,
            Source::Folder(folder) => Some(folder.clone()),
        };
        let set = choice.set.iter().map(|set| paths::from_here(set, None));
        Ok(Plan {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            base,
            seeds: choice.seeds,
            only: choice.only.clone(),
            quick: choice.quick,
            set: set.collect::<anyhow::Result<_>>()?,
        })
    }

    /// Of a folder, with the text of the experiment; nothing if no comparison was begun there.
    pub fn load(folder: &Path) -> anyhow::Result<Option<(Self, String)>> {
        let path = folder.join(FILE);
        if !path.is_file() {
            return Ok(None);
        }
        let text = output::read_text(&path)?;
        if !is_whole(&text) {
            bail!("{} is damaged: begin anew in another folder", path.display());
        }
        let plan = serde_json::from_str(&text).with_context(|| path.display().to_string())?;
        Ok(Some((plan, output::read_text(&folder.join(EXPERIMENT))?)))
    }

    /// Writes it into a folder, with the text of the experiment.
    pub fn write(&self, folder: &Path, experiment: &str) -> anyhow::Result<()> {
        Output::new(&folder.join(EXPERIMENT), "toml")?.write(experiment.as_bytes())?;
        let text = sealed(serde_json::to_value(self)?);
        Output::new(&folder.join(FILE), "")?.write(text.as_bytes())
    }

    /// Where its experiment's files are.
    pub fn source(&self) -> Source {
        self.base.clone().map_or(Source::BuiltIn, Source::Folder)
    }

    /// Which cases are run.
    pub fn choice(&self, registry: &Registry) -> Choice {
        Choice {
            seeds: self.seeds,
            only: self.only.clone(),
            quick: self.quick,
            set: self.set.clone(),
            registry: registry.clone(),
        }
    }

    /// Refuses to work on the cases of another plan, or of another version.
    pub fn joins(&self, other: &Self, folder: &Path) -> anyhow::Result<()> {
        let shown = folder.display();
        if self.version != other.version {
            bail!(
                "{shown} was begun by kerrlight {}, and this is {}: join it with that, or give another folder with -o",
                other.version,
                self.version
            );
        }
        if self != other {
            bail!(
                "{shown} has other cases: join it with `kerrlight compare {shown} --share`, or give another folder with -o"
            );
        }
        Ok(())
    }
}

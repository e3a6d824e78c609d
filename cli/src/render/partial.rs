//! The journal of a picture under way: beside the EXR, until that is whole.

use crate::lock;
use crate::output::Output;
use anyhow::{Context, bail};
use kerrlight_render::picture::{Found, Journal, Raster};
use std::fs::File;
use std::path::PathBuf;

/// A journal with its file, which no other process may use.
pub struct Partial {
    /// None where the picture goes to standard output, whose journal is a temporary file.
    path: Option<PathBuf>,
    pub journal: Journal<File>,
}

impl Partial {
    /// Goes on with what an earlier run of the same picture has left, or starts anew.
    /// `identity` is all that decides the picture.
    pub fn open(output: &Output, raster: &Raster, identity: &str) -> anyhow::Result<Self> {
        let Some(path) = output.partial() else {
            let file = tempfile::tempfile().context("cannot make a temporary file")?;
            let (journal, _) = Journal::open(file, identity, raster.bands())?;
            return Ok(Partial { path: None, journal });
        };
        let shown = path.display();
        let Some(file) = lock::of_file(&path)? else {
            bail!("{shown} is in use: another kerrlight renders {}", output.shown().display())
        };
        let (journal, found) =
            Journal::open(file, identity, raster.bands()).with_context(|| {
                format!("{shown} (the state of an interrupted run); remove it or write elsewhere")
            })?;
        match found {
            Found::Bands(0) | Found::Nothing => {}
            Found::Bands(there) => {
                let all = raster.bands();
                eprintln!("resuming from {shown}: {there} of {all} bands are done");
            }
            Found::Other => {
                eprintln!("starting over: {shown} belongs to another picture or version")
            }
        }
        Ok(Partial { path: Some(path), journal })
    }

    /// Returns its path in messages.
    pub fn shown(&self) -> String {
        self.path.as_ref().map_or("a temporary file".to_owned(), |path| path.display().to_string())
    }

    /// Describes what is left of an interrupted run, and how to resume it.
    pub fn kept(&self) -> String {
        match &self.path {
            Some(path) => format!(
                "finished bands are kept in {}: run the same command again to resume",
                path.display()
            ),
            None => "nothing is kept".to_owned(),
        }
    }

    /// Removes it: the picture is whole, or will never be.
    pub fn remove(self) {
        // What is left behind does no harm.
        let _ = self.path.map(std::fs::remove_file);
    }
}

//! `kerrlight view`: a page on which one flies around a black hole.

use crate::answer::Answer;
use crate::output::Output;
use anyhow::Context;
use clap::Args;
use kerrlight_geodesic::wgsl;
use std::path::PathBuf;

/// Arguments of `kerrlight view`.
#[derive(Debug, Args)]
pub struct View {
    /// Folder for the page index.html, made if it does not exist; a browser with WebGPU shows it
    #[arg(long, value_name = "DIR")]
    web: PathBuf,
}

const PAGE: &str = include_str!("page.html");

const SHADER: &str = include_str!("view.wgsl");

impl View {
    /// Writes the page.
    pub fn run(&self) -> anyhow::Result<Answer> {
        let shown = self.web.display();
        std::fs::create_dir_all(&self.web)
            .with_context(|| format!("cannot make the folder {shown}"))?;
        let path = self.web.join("index.html");
        let page = page();
        Output::new(&path, "html")?.write(page.as_bytes())?;
        let worth =
            format!("a page of {} KB, with nothing else to load", page.len().div_ceil(1000));
        let look = format!("{}: open it in a browser with WebGPU", path.display());
        Ok(Answer::lines(&worth, &look).files([path.as_path()]))
    }
}

/// The page with the tracer's shaders in it.
fn page() -> String {
    PAGE.replace("/*SHADER*/", &format!("{}\n{SHADER}", wgsl::library()))
}

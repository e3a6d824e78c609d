//! `kerrlight view`: a scene, or what a fit has recovered, in a page on which one flies around it.

mod given;
mod matter;
mod page;
mod server;
mod sky;
mod still;
mod subject;

use crate::answer::Answer;
use crate::assets::Reach;
use crate::output::Output;
use anyhow::Context;
use clap::Args;
use page::Page;
use std::path::{Path, PathBuf};
use subject::Subject;

/// Arguments of `kerrlight view`.
#[derive(Debug, Args)]
pub struct View {
    /// Scene file (TOML), an EXR that kerrlight rendered, or the folder of a fit; without it a built-in scene: Sgr A*
    /// with a flare and a disc
    scene: Option<PathBuf>,
    /// Write the page into this folder, which is made if it does not exist [default: serve it to a browser on this
    /// computer until Ctrl-C]
    #[arg(long, value_name = "DIR")]
    web: Option<PathBuf>,
    /// Change a value of the scene, e.g. hole.spin=0.5 or sky.checker={field_deg=15,brightness=0.1}
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    overrides: Vec<String>,
    #[command(flatten)]
    reach: Reach,
    /// Port of this computer at which the page is served [default: one that is free]
    #[arg(long, value_name = "PORT", conflicts_with = "web")]
    port: Option<u16>,
    /// Do not open a browser
    #[arg(long, conflicts_with = "web")]
    no_browser: bool,
}

impl View {
    /// Writes the page, or serves it.
    pub fn run(&self) -> anyhow::Result<Answer> {
        let subject = Subject::open(self.scene.as_deref(), &self.overrides, self.reach)?;
        let page = Page::of(&subject)?;
        match &self.web {
            Some(folder) => write(&page, folder),
            None => server::serve(&page, self.port, !self.no_browser).map(|()| Answer::default()),
        }
    }
}

/// Writes the files of the page into a folder.
fn write(page: &Page, folder: &Path) -> anyhow::Result<Answer> {
    let shown = folder.display();
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {shown}"))?;
    let mut paths = Vec::new();
    // The page last: whoever finds it finds what it loads.
    for (name, content) in page.files().into_iter().rev() {
        let path = folder.join(name);
        Output::new(&path, "")?.write(content.as_bytes())?;
        paths.insert(0, path);
    }
    let bytes: usize = page.files().iter().map(|(_, content)| content.len()).sum();
    let worth = format!("a page of {} KB, with nothing else to load", bytes.div_ceil(1000));
    let look = format!("{}: open it in a browser with WebGPU", paths[0].display());
    Ok(Answer::lines(&worth, &look).files(paths.iter().map(PathBuf::as_path)))
}

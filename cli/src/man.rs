//! `kerrlight man`: manual pages.

use crate::Arguments;
use crate::answer::Answer;
use crate::output::Output;
use anyhow::Context;
use clap::{Args, Command, CommandFactory};
use clap_mangen::Man as Page;
use std::path::{Path, PathBuf};

/// Arguments of `kerrlight man`.
#[derive(Debug, Args)]
pub struct Man {
    /// Folder for the pages, made if it does not exist, e.g. ~/.local/share/man/man1
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

impl Man {
    /// Writes kerrlight.1 and a page for each verb.
    pub fn run(&self) -> anyhow::Result<Answer> {
        let shown = self.folder.display();
        std::fs::create_dir_all(&self.folder)
            .with_context(|| format!("cannot make the folder {shown}"))?;
        let mut command = Arguments::command().disable_help_subcommand(true);
        command.build();
        let mut paths = vec![page(&self.folder, &command)?];
        for verb in command.get_subcommands() {
            paths.push(page(&self.folder, verb)?);
        }
        let worth = format!("{} manual pages", paths.len());
        let first = format!("{}: read them with `man {}`", shown, paths[0].display());
        Ok(Answer::lines(&worth, &first).files(paths.iter().map(PathBuf::as_path)))
    }
}

fn page(folder: &Path, command: &Command) -> anyhow::Result<PathBuf> {
    let page = Page::new(command.clone());
    let path = folder.join(page.get_filename());
    let mut bytes = Vec::new();
    page.render(&mut bytes)?;
    Output::new(&path, "")?.write(&bytes)?;
    Ok(path)
}

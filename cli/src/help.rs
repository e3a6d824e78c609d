//! The command line as a whole: help with the verbs in groups, completions, manual pages.

use crate::Arguments;
use crate::answer::Answer;
use anyhow::Context;
use clap::{Args, Command, CommandFactory};
use clap_complete::Shell;
use clap_mangen::Man;
use std::path::{Path, PathBuf};

/// Verbs by what they are about, in the order of the help page.
const GROUPS: [(&str, &[&str]); 5] = [
    ("Pictures", &["render", "movie"]),
    ("Rays", &["trace", "critical-curve", "accuracy"]),
    ("Data", &["observe", "uv", "convert"]),
    ("Fits", &["fit", "compare"]),
    ("Other", &["inspect", "completions", "man"]),
];

/// The command line, whose help page shows the verbs in groups.
pub fn command() -> Command {
    let command = Arguments::command();
    let verbs = grouped(&command);
    command.help_template(format!(
        "{{about}}\n\n{{usage-heading}} kerrlight [OPTIONS] VERB ...\n       kerrlight VERB --help\n\n{verbs}\nOptions:\n{{options}}{{after-help}}"
    ))
}

/// The verbs with what they do, a heading a group.
fn grouped(command: &Command) -> String {
    let line = |name: &&str| {
        let about = command.find_subcommand(name).and_then(Command::get_about);
        format!("  {name:<16}{}\n", about.map(ToString::to_string).unwrap_or_default())
    };
    let group = |(heading, verbs): &(&str, &[&str])| {
        format!("{heading}:\n{}", verbs.iter().map(line).collect::<String>())
    };
    GROUPS.iter().map(group).collect()
}

/// Arguments of `kerrlight completions`.
#[derive(Debug, Args)]
pub struct Completions {
    /// The shell that reads the script
    shell: Shell,
}

impl Completions {
    /// The script.
    pub fn run(&self) -> anyhow::Result<Answer> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Arguments::command(), "kerrlight", &mut script);
        let script = String::from_utf8(script)?;
        Ok(Answer::text(script.as_str())
            .with("shell", self.shell.to_string())
            .with("script", script))
    }
}

/// Arguments of `kerrlight man`.
#[derive(Debug, Args)]
pub struct ManPages {
    /// Folder for the pages, made if it does not exist, e.g. ~/.local/share/man/man1
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

impl ManPages {
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
    let page = Man::new(command.clone());
    let path = folder.join(page.get_filename());
    let mut bytes = Vec::new();
    page.render(&mut bytes)?;
    crate::output::Output::new(&path, "")?.write(&bytes)?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_every_verb_is_in_one_group() {
        let command = Arguments::command();
        for verb in command.get_subcommands().map(Command::get_name) {
            let count = GROUPS.iter().flat_map(|(_, verbs)| *verbs).filter(|v| **v == verb).count();
            assert_eq!(count, 1, "{verb}");
        }
        assert!(!grouped(&command).contains("  \n"));
    }
}

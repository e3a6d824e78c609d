//! `kerrlight fit --data FILE`: settings that are guessed from a file of data, with every guess told in a sentence.

use super::annotate::annotate;
use super::{Model, of_data};
use crate::keys;
use anyhow::bail;
use std::path::{Path, PathBuf};

/// Settings for a file of data.
pub struct Guess {
    /// Text of a commented fit file.
    pub text: String,
    /// Facts in the file, a sentence each.
    read: Vec<String>,
    /// Assumptions that neither the file nor a published value supports, with their reasons.
    assumed: Vec<String>,
    /// Keys that have to be given.
    missing: Vec<Missing>,
}

/// A setting without which there is no fit.
struct Missing {
    /// Dotted path.
    key: String,
    /// A value as it might be.
    example: String,
    why: String,
}

/// The settings for data of a file, or of several of one image.
///
/// # Errors
/// If the file holds no visibilities, images or light curve.
pub fn guess(data: &[PathBuf], model: Option<Model>) -> anyhow::Result<Guess> {
    // Absolute: guessed settings have no folder of their own, and runs are resumed from anywhere.
    let data: Vec<PathBuf> =
        data.iter().map(std::path::absolute).collect::<std::io::Result<_>>()?;
    Ok(Guess::of(&of_data(&data, Path::new(""), model)?))
}

/// Begin of lines that say what was read.
pub const READ: &str = "# Read: ";

impl Guess {
    /// The guesses in plain settings.
    fn of(plain: &str) -> Self {
        let mut guess = Guess {
            text: annotate(plain),
            read: Vec::new(),
            assumed: Vec::new(),
            missing: Vec::new(),
        };
        let mut table = "";
        for line in plain.lines() {
            if let Some(said) = line.strip_prefix(READ) {
                guess.read.push(said.to_owned());
            } else if line.starts_with('[') {
                table = line.trim_matches(['[', ']']);
            } else {
                guess.line(line, table);
            }
        }
        guess
    }

    fn line(&mut self, line: &str, table: &str) {
        let path =
            |key: &str| if table.is_empty() { key.to_owned() } else { format!("{table}.{key}") };
        if let Some((setting, why)) = line.split_once(" #! ") {
            self.assumed.push(format!("{}: {why}", path(setting)));
        } else if let Some(open) = line.strip_prefix("#? ")
            && let Some((setting, why)) = open.split_once(" # ")
            && let Some((key, example)) = setting.split_once(" = ")
        {
            let (key, example, why) = (path(key), example.to_owned(), why.to_owned());
            self.missing.push(Missing { key, example, why });
        }
    }

    /// Refuses settings in which something is left open that nothing can be guessed of.
    ///
    /// # Errors
    /// Names all of it, with what to write.
    pub fn check(&self, settings: &str, data: &[PathBuf]) -> anyhow::Result<()> {
        let table: toml::Table = settings.parse()?;
        let is_open = |missing: &&Missing| keys::at(&table, &missing.key).is_none();
        let open: Vec<&Missing> = self.missing.iter().filter(is_open).collect();
        if open.is_empty() {
            return Ok(());
        }
        let line =
            |m: &&Missing| format!("\n  {} ({}): --set '{}={}'", m.key, m.why, m.key, m.example);
        let lines: String = open.iter().map(line).collect();
        let names: Vec<String> = data.iter().map(|path| path.display().to_string()).collect();
        let image = match keys::at(&table, "data.visibilities").is_some() {
            true => {
                "\nor, for a source that does not change while it is observed, --model image: it needs none of these"
            }
            false => "",
        };
        bail!("{} does not say what decides the result; give{lines}{image}", names.join(", "))
    }

    /// Describes what was read and what was assumed, in lines.
    pub fn sentences(&self, settings: &str) -> String {
        let table: toml::Table = settings.parse().unwrap_or_default();
        let mut text = String::new();
        self.read.iter().for_each(|said| text += &format!("read: {said}\n"));
        for assumed in &self.assumed {
            // What --set has changed is no guess any more.
            let (setting, _) = assumed.split_once(": ").unwrap_or((assumed, ""));
            let (key, value) = setting.split_once(" = ").unwrap_or((setting, ""));
            if is_still(&table, key, value) {
                text += &format!("assumed: {assumed}\n");
            }
        }
        text
    }
}

fn is_still(table: &toml::Table, key: &str, value: &str) -> bool {
    let guessed: Option<toml::Table> = format!("value = {value}").parse().ok();
    let guessed = guessed.and_then(|table| table.get("value").cloned());
    guessed.is_none() || keys::at(table, key) == guessed.as_ref()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_what_is_open_is_demanded_and_what_is_changed_is_no_guess() {
        let plain = "[hole]\nspin = 0.5 #! the data do not tell the spin\n#? mass_msun = 4e6 # no value for it\n";
        let guess = Guess::of(plain);
        let path = [PathBuf::from("a.uvfits")];
        let error = guess.check("[hole]\nspin = 0.5", &path).unwrap_err().to_string();
        assert!(
            error.contains("hole.mass_msun (no value for it): --set 'hole.mass_msun=4e6'"),
            "{error}"
        );
        guess.check("[hole]\nspin = 0.5\nmass_msun = 6e9", &path).unwrap();
        let said = guess.sentences("[hole]\nspin = 0.5");
        assert_eq!(said, "assumed: hole.spin = 0.5: the data do not tell the spin\n");
        assert_eq!(guess.sentences("[hole]\nspin = 0.9"), "");
    }
}

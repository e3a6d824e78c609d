//! Settings that were changed after they were read from a file: by `--set`, or by an experiment.

use anyhow::Context;
use kerrlight_tomo::Error;

/// Settings of a file, and what they were changed to.
#[derive(Debug, Clone, Copy)]
pub struct Changed<'a> {
    /// The file, as messages name it.
    pub name: &'a str,
    /// Its text.
    pub own: &'a str,
    /// The changed text.
    pub text: &'a str,
    /// The changes, as messages name them.
    pub by: &'a str,
}

impl Changed<'_> {
    /// Reads the changed text. What is wrong with the file itself is told with the file's line, anything else without a
    /// line: nobody has seen the changed text.
    pub fn read<T>(
        &self,
        read: impl Fn(&str) -> Result<T, Error>,
        told: impl Fn(Error) -> anyhow::Error,
    ) -> anyhow::Result<T> {
        // A line number would make the same error differ, since the changed text is laid out anew.
        let bare = |text: &str| read(text).map_err(Error::without_line);
        let error = match bare(self.text) {
            Ok(found) => return Ok(found),
            Err(error) => error,
        };
        let is_own = bare(self.own).err().is_some_and(|own| own.to_string() == error.to_string());
        match read(self.own) {
            Err(own) if is_own => Err(told(own)).context(self.name.to_owned()),
            _ => Err(told(error)).with_context(|| format!("{} with {}", self.name, self.by)),
        }
    }
}

/// Assignments as they are given.
pub fn assignments(set: &[String]) -> String {
    set.iter().map(|set| format!("--set {set}")).collect::<Vec<_>>().join(" ")
}

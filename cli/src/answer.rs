//! Answers of verbs: text for a person, or one JSON object for a script.

use crate::columns::{self, Column};
use crate::output::{self, Output};
use crate::plain;
use serde_json::{Map, Value};
use std::path::Path;

/// The result of a verb. Progress and messages are not part of it: they go to standard error.
#[derive(Default)]
pub struct Answer {
    text: Body,
    json: Map<String, Value>,
    failure: Option<anyhow::Error>,
}

/// Text for a person.
enum Body {
    Text(String),
    /// Lines of so many entries that they are made one by one, and printed at once; for a script a list called `name`.
    Lines {
        name: &'static str,
        entries: Box<dyn Iterator<Item = (String, Value)> + Send>,
    },
    /// A table of so many rows: CSV for a person, an object of columns called `name` for a script.
    Table {
        name: &'static str,
        groups: Vec<Vec<Column>>,
        rows: usize,
    },
}

impl Default for Body {
    fn default() -> Self {
        Body::Text(String::new())
    }
}

/// The form in which a result is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Text on standard output.
    Text,
    /// One JSON object on standard output.
    Json,
    /// Text on standard error: standard output carries a file.
    Aside,
}

impl Answer {
    /// Text, with its line ends.
    pub fn text(text: impl Into<String>) -> Self {
        Answer { text: Body::Text(text.into()), ..Self::default() }
    }

    /// Lines with their line ends that are printed as they are made, each with its entry of a list in the JSON object.
    pub fn lines_of(
        name: &'static str,
        entries: impl Iterator<Item = (String, Value)> + Send + 'static,
    ) -> Self {
        let entries = Box::new(entries);
        Answer { text: Body::Lines { name, entries }, ..Self::default() }
    }

    /// The last two lines of a command: a figure of merit, and where to look.
    pub fn lines(worth: &str, look_at: &str) -> Self {
        Self::text(format!("{worth}\n{look_at}\n"))
    }

    /// Files that were written, a line each, without standard output.
    pub fn written<'a>(outputs: impl IntoIterator<Item = &'a Output>) -> Self {
        let files = written(outputs);
        let text: String = files.iter().map(|file| format!("{}\n", file.display())).collect();
        Self::text(text).files(files)
    }

    /// A table that goes to standard output itself.
    pub fn table(name: &'static str, groups: Vec<Vec<Column>>, rows: usize) -> Self {
        Answer { text: Body::Table { name, groups, rows }, ..Self::default() }
    }

    /// Adds an entry to the JSON object. A number that is not finite becomes null.
    #[must_use]
    pub fn with(mut self, key: &str, value: impl Into<Value>) -> Self {
        self.json.insert(key.to_owned(), value.into());
        self
    }

    /// Adds all entries of an object.
    #[must_use]
    pub fn with_all(mut self, object: Value) -> Self {
        if let Value::Object(mut entries) = object {
            self.json.append(&mut entries);
        }
        self
    }

    /// Adds the files that were written, as `files`.
    #[must_use]
    pub fn files<'a>(self, paths: impl IntoIterator<Item = &'a Path>) -> Self {
        let files: Vec<String> = paths.into_iter().map(|path| path.display().to_string()).collect();
        self.with("files", files)
    }

    /// The same for outputs, of which standard output is no file.
    #[must_use]
    pub fn outputs<'a>(self, outputs: impl IntoIterator<Item = &'a Output>) -> Self {
        self.files(written(outputs))
    }

    /// Adds an error: the result is printed, and the program fails nevertheless.
    #[must_use]
    pub fn failing(mut self, error: impl Into<anyhow::Error>) -> Self {
        self.failure = Some(error.into());
        self
    }

    /// Adds another result: its text below, its object as an entry.
    #[must_use]
    pub fn and(mut self, name: &str, other: Self) -> Self {
        if let (Body::Text(text), Body::Text(more)) = (&mut self.text, &other.text) {
            text.push_str(more);
        }
        self.json.insert(name.to_owned(), Value::Object(other.json));
        self
    }

    /// Prints the result.
    ///
    /// # Errors
    /// The failure it carries, or what standard output refuses.
    pub fn print(mut self, form: Form) -> anyhow::Result<()> {
        let failure = self.failure.take();
        match form {
            Form::Json => output::print(&format!("{:#}\n", self.into_json()))?,
            Form::Text => self.each_text(|text| output::print(&plain::lines(text)))?,
            Form::Aside => self.each_text(|text| {
                eprint!("{text}");
                Ok(())
            })?,
        }
        failure.map_or(Ok(()), Err)
    }

    /// The text and the object.
    ///
    /// # Errors
    /// The failure it carries.
    pub fn told(mut self) -> anyhow::Result<(String, Value)> {
        if let Some(error) = self.failure.take() {
            return Err(error);
        }
        let text = match &mut self.text {
            Body::Text(text) => std::mem::take(text),
            _ => String::new(),
        };
        Ok((text, self.into_json()))
    }

    /// Hands out the text, in parts where it is long.
    fn each_text(self, mut out: impl FnMut(&str) -> anyhow::Result<()>) -> anyhow::Result<()> {
        match self.text {
            Body::Text(text) => out(&text),
            Body::Table { groups, rows, .. } => {
                out(std::str::from_utf8(&columns::csv(&groups, rows)?)?)
            }
            Body::Lines { mut entries, .. } => entries.try_for_each(|(line, _)| out(&line)),
        }
    }

    fn into_json(mut self) -> Value {
        match self.text {
            Body::Text(_) => {}
            Body::Table { name, groups, .. } => {
                self.json.insert(name.to_owned(), columns::json(&groups));
            }
            Body::Lines { name, entries } => {
                let entries: Vec<Value> = entries.map(|(_, entry)| entry).collect();
                self.json.insert(name.to_owned(), entries.into());
            }
        }
        Value::Object(self.json)
    }
}

/// Those of the outputs that are files.
pub fn written<'a>(outputs: impl IntoIterator<Item = &'a Output>) -> Vec<&'a Path> {
    outputs.into_iter().filter(|output| !output.is_pipe()).map(Output::shown).collect()
}

/// Paths in one line.
pub fn listed<'a>(paths: impl IntoIterator<Item = &'a Path>) -> String {
    let all: Vec<String> = paths.into_iter().map(|path| path.display().to_string()).collect();
    all.join(", ")
}

//! One HTML page that says what a fit found: sentences, tables, pictures, plots and the emission in
//! three dimensions. Nothing in it is loaded from anywhere else.

mod escape;
mod html;
mod paged;
mod pictures;
mod plot;
mod sky;
#[cfg(test)]
mod tests;
mod triangle;
mod view;

pub use escape::escape;
pub use html::fill;
pub use pictures::{
    Figure, Strip, encode, enlarged, frames, images, projections, residuals, slices, still,
};
pub use plot::{Axis, LinePlot, Marks, Series};
pub use sky::{SkyPanel, sky};
pub use triangle::{Variable, triangle};
pub use view::{Motion, View3d, rates, thinned};

use crate::output::Output;

/// Content of the page; empty lists are left out.
#[derive(Debug, Default)]
pub struct Report {
    /// Title of the run, in a few words.
    pub title: String,
    /// Notice before all else.
    pub notice: Option<Notice>,
    /// Sentences: what was asked, what was measured, what it means.
    pub summary: Vec<String>,
    /// Paragraphs under headings.
    pub parts: Vec<Part>,
    /// Measured results.
    pub results: Vec<Outcome>,
    /// Further tables.
    pub tables: Vec<Table>,
    /// Emission in 3D.
    pub view: Option<View3d>,
    /// Pictures.
    pub figures: Vec<Figure>,
    /// Pictures that are drawings.
    pub drawings: Vec<Drawing>,
    /// Curves and points with axes.
    pub plots: Vec<LinePlot>,
    /// Tables for whoever wants to know everything.
    pub details: Vec<Table>,
    /// The settings of the run.
    pub settings: Vec<Setting>,
}

/// A drawing of the page.
#[derive(Debug)]
pub struct Drawing {
    /// Its SVG.
    pub svg: String,
    /// Caption.
    pub caption: String,
    /// Description for somebody who does not see it.
    pub alt: String,
}

/// Notice before all else.
#[derive(Debug)]
pub struct Notice {
    /// Tone.
    pub tone: Tone,
    /// One sentence.
    pub headline: String,
    /// Paragraphs below it.
    pub text: Vec<String>,
}

/// Tone of a notice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tone {
    /// All is well.
    Good,
    /// Something to know.
    Plain,
    /// Warning: the rest of the page is not to be trusted.
    Bad,
}

/// Paragraphs under a heading.
#[derive(Debug)]
pub struct Part {
    /// The heading.
    pub heading: &'static str,
    /// Text under it.
    pub text: Vec<String>,
}

/// A table.
#[derive(Debug)]
pub struct Table {
    /// Its title.
    pub title: String,
    /// Caption, for somebody who does not know what is in it.
    pub caption: String,
    /// Names of the columns.
    pub head: Vec<String>,
    /// Its lines, as long as the head.
    pub rows: Vec<Vec<String>>,
    /// Links of the first cells of the rows; fewer where later ones have none.
    pub links: Vec<String>,
}

/// A line of the table of settings.
#[derive(Debug)]
pub struct Setting {
    /// Name on the command line or in the file.
    pub key: String,
    /// Its value.
    pub value: String,
    /// Meaning, with its unit.
    pub meaning: String,
}

/// A line of the table of results.
#[derive(Debug)]
pub struct Outcome {
    /// The quantity.
    pub name: &'static str,
    /// Its value, with as many digits as are known.
    pub value: String,
    /// Its unit, or nothing.
    pub unit: &'static str,
    /// Meaning, for somebody who does not know the name.
    pub meaning: &'static str,
}

impl Table {
    /// One without links.
    pub fn new(
        title: impl Into<String>,
        caption: impl Into<String>,
        head: impl IntoIterator<Item = impl Into<String>>,
        rows: Vec<Vec<String>>,
    ) -> Self {
        let head = head.into_iter().map(Into::into).collect();
        Table { title: title.into(), caption: caption.into(), head, rows, links: Vec::new() }
    }
}

impl Report {
    /// The page.
    ///
    /// # Errors
    /// If a number of a plot or of the view is out of its range.
    pub fn html(&self) -> anyhow::Result<String> {
        html::page(self)
    }

    /// Writes the page, whole or not at all.
    ///
    /// # Errors
    /// As for [`Self::html`], or if it cannot be written.
    pub fn write(&self, output: &Output) -> anyhow::Result<()> {
        output.write(self.html()?.as_bytes())
    }
}

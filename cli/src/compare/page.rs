//! Results of a comparison: tables, pictures and one page of them.

use super::recipe::Choice;
use super::runner::Runner;
use super::summary::Summary;
use super::{figures, quick, ran, tables, verdicts};
use crate::output::Output;
use crate::plain;
use crate::report::{Figure, Part, Report, Table};
use std::path::{Path, PathBuf};

/// Most failures that the head of the page tells.
const TOLD: usize = 20;

/// Returns the files of the results, beside the pictures.
pub fn files(folder: &Path) -> Vec<PathBuf> {
    ["report.html", "results.json", "results.csv", "tables.md"]
        .map(|name| folder.join(name))
        .to_vec()
}

/// All that a page is made of.
pub struct Page<'a> {
    /// Choice of cases that were run.
    pub choice: &'a Choice,
    /// Summary of the results.
    pub summary: &'a Summary<'a>,
}

impl Page<'_> {
    /// Writes the results, tables.md, pictures and report.html, which says what is left out; the text of the tables.
    pub fn write(
        &self,
        runner: &Runner<'_>,
        folder: &Path,
        mut left_out: Vec<String>,
    ) -> anyhow::Result<String> {
        let Page { choice, summary } = self;
        let file = |name: &str| Output::new(&folder.join(name), "");
        file("results.csv")?.write(&summary.csv()?)?;
        let shown = self.tables();
        let text: String = shown.iter().map(tables::markdown).collect();
        let text = [self.heading(), text].concat();
        file("tables.md")?.write(text.as_bytes())?;
        let drawn = figures::Figures { summary, runner }.draw()?;
        left_out.extend(drawn.missing);
        let mut figures: Vec<Figure> = Vec::new();
        for (name, figure) in drawn.figures {
            file(&format!("{name}.png"))?.write(&figure.png)?;
            figures.push(figure);
        }
        let report = Report {
            title: summary.experiment.title.clone(),
            notice: choice.quick.then(quick::notice),
            summary: self.sentences(),
            parts: self.parts(left_out),
            tables: shown,
            details: vec![
                tables::all(summary, !choice.quick),
                tables::levels_told(summary.experiment),
            ],
            figures,
            plots: drawn.plots,
            ..Report::default()
        };
        report.write(&file("report.html")?)?;
        Ok(text)
    }

    /// Returns the tables: what ran, and what the experiment asks for.
    fn tables(&self) -> Vec<Table> {
        let summary = self.summary;
        let asked = summary.experiment.table.iter().map(|asked| tables::table(summary, asked));
        std::iter::once(ran::table(summary)).chain(asked).collect()
    }

    /// Returns the heading of tables.md and of the terminal, of a quick look.
    fn heading(&self) -> String {
        if !self.choice.quick {
            return String::new();
        }
        let notice = quick::notice();
        format!(
            "# {}\n\n{}\n\n",
            plain::line(&self.summary.experiment.title),
            notice.text.join("\n\n")
        )
    }

    /// Returns the parts of the page: results, how to read them, how they were measured.
    fn parts(&self, left_out: Vec<String>) -> Vec<Part> {
        let Page { choice, summary } = self;
        let experiment = summary.experiment;
        let orders = experiment.table.iter().map(|asked| verdicts::of_table(summary, asked));
        // The first table of qualities is the one that the experiment is about.
        let orders = orders.into_iter().find(|all| !all.is_empty()).unwrap_or_default();
        let out = match choice.quick {
            true => Vec::new(),
            false => orders.into_iter().chain(verdicts::of_all(summary)).collect(),
        };
        vec![
            Part { heading: "What came out", text: out },
            Part { heading: "Not shown", text: left_out },
            Part { heading: "How to read it", text: experiment.reading.clone() },
            Part { heading: "How it was measured", text: self.setup() },
        ]
    }

    /// The experiment's own text, which knows nothing of the command line.
    fn setup(&self) -> Vec<String> {
        let Page { choice, summary: Summary { experiment, .. } } = self;
        let changed = !choice.set.is_empty() || choice.seeds.is_some() || !choice.only.is_empty();
        if experiment.setup.is_empty() || !changed {
            return experiment.setup.clone();
        }
        let set = choice.set.iter().map(|set| format!("--set {set}"));
        let seeds = choice.seeds.iter().map(|seeds| format!("--seeds {seeds}"));
        let only = choice.only.iter().map(|only| format!("--only {only}"));
        let all: Vec<String> = set.chain(seeds).chain(only).collect();
        let caution = format!(
            "This is how the experiment is meant; this run has changed it: {}. The table \"What ran\" has what was used.",
            all.join(", ")
        );
        std::iter::once(caution).chain(experiment.setup.iter().cloned()).collect()
    }

    /// Describes the question, and what was run.
    fn sentences(&self) -> Vec<String> {
        let summary = self.summary;
        let mut lines = vec![format!("What was asked: {}", summary.experiment.question)];
        let (all, done, open) = (summary.all.len(), summary.done().count(), summary.open());
        let failed = summary.failed().count();
        let seconds: f64 = summary.done().filter_map(|(_, results)| results.get("seconds")).sum();
        lines.push(format!(
            "What was run: {all} fits, of which {done} ended well, {failed} failed and {open} were not run to their end; \
             {:.1} minutes of fitting in all. {}",
            seconds / 60.0,
            summary.seeds_told()
        ));
        for (case, why) in summary.failed().take(TOLD) {
            lines.push(format!("Failed: {}: {why}", case.name()));
        }
        if failed > TOLD {
            lines.push(format!("{} more failed; the table of all cases has them.", failed - TOLD));
        }
        lines
    }
}

//! Tables of means over seeds.

use super::cases::{Case, Status};
use super::experiment::{Companion, Experiment, Level, TableAsked};
use super::labels::{called, described, number, pairs, product};
use super::results::Results;
use super::summary::{Spread, Summary};
use crate::plain;
use crate::report::Table;
use toml::Value;

/// Cell of a table at some levels.
pub struct Cell {
    /// Spread over seeds.
    pub spread: Spread,
    /// The best level, where a table asks for it.
    best: Option<String>,
}

impl Cell {
    /// Nothing where no case has been run.
    pub fn of(summary: &Summary, asked: &TableAsked, at: &[(&str, &str)]) -> Option<Self> {
        let Some(factor) = &asked.best_of else {
            return Some(Self { spread: summary.spread(&asked.value, at)?, best: None });
        };
        let cell = |level: &Level| {
            let here = [at, &[(factor.as_str(), level.name.as_str())]].concat();
            let best = Some(level.name.clone());
            Some(Self { spread: summary.spread(&asked.value, &here)?, best })
        };
        let all = summary.experiment.levels(factor).iter().filter_map(cell);
        // `best_of` is allowed only for results of which more is better.
        all.max_by(|a, b| a.spread.mean.total_cmp(&b.spread.mean))
    }

    /// Returns its text in a table.
    pub fn text(&self, digits: usize, seeds: u64) -> String {
        let best = self.best.as_ref().map(|level| format!(" ({level})"));
        // Of cases that failed, or found nothing to measure, there is no value.
        let count = self.spread.count as u64;
        let few = (count < seeds).then(|| format!(" (of {count})"));
        [self.spread.text(digits), few.unwrap_or_default(), best.unwrap_or_default()].concat()
    }
}

/// One table; a note in its place if it would be empty.
pub fn table(summary: &Summary, asked: &TableAsked) -> Table {
    let (unit, digits) = described(&asked.value);
    let [rows, columns] = [&asked.rows, &asked.columns].map(|of| summary.combinations(of));
    let fixed = pairs(&asked.r#where);
    let cell = |row: &[(&str, &str)], column: &[(&str, &str)]| {
        Cell::of(summary, asked, &[row, column, &fixed].concat())
    };
    let text =
        |cell: Option<Cell>| cell.map_or(NONE.to_owned(), |cell| cell.text(digits, summary.seeds));
    let mut lines = Vec::new();
    for row in &rows {
        let cells: Vec<Option<Cell>> = columns.iter().map(|column| cell(row, column)).collect();
        if cells.iter().any(Option::is_some) {
            let name = if row.is_empty() { "all".to_owned() } else { called(row) };
            lines.push([vec![name], cells.into_iter().map(text).collect()].concat());
        }
    }
    let title = format!("{}: {unit}", asked.title);
    if lines.is_empty() {
        let caption =
            format!("Nothing to show: no case that was run to its end has this value ({unit}).");
        return Table::new(title, caption, [""; 0], lines);
    }
    lines.extend(asked.beside.iter().map(|row| beside(summary, asked, row, &columns, digits)));
    let gaps = lines.iter().flatten().any(|cell| cell == NONE);
    let head = asked.rows.join(", ");
    let names = columns.iter().map(|column| match column.as_slice() {
        [] => unit.clone(),
        levels => called(levels),
    });
    let spread = match summary.seeds {
        1 => "One seed.".to_owned(),
        seeds => format!("Mean ± standard deviation over {seeds} seeds."),
    };
    let is_few = lines.iter().flatten().any(|cell| cell.contains(" (of "));
    let few = if is_few { " (of n): over fewer seeds, those that have a value." } else { "" };
    let gaps = if gaps { " –: not part of the experiment, or missing." } else { "" };
    let best =
        asked.best_of.as_ref().map(|name| format!(" In brackets: the best level of {name}."));
    let best = best.unwrap_or_default();
    let caption = format!("{} {spread}{few}{best}{gaps}", asked.caption);
    Table::new(title, caption.trim_start(), std::iter::once(head).chain(names), lines)
}

/// Text where there is no number.
const NONE: &str = "–";

/// A row of numbers from elsewhere, of the columns that are shown.
fn beside(
    summary: &Summary,
    asked: &TableAsked,
    row: &Companion,
    columns: &[Vec<(&str, &str)>],
    digits: usize,
) -> Vec<String> {
    // Values count over all levels, some of which may not be shown.
    let every = product(summary.experiment.levels_of(&asked.columns));
    let value = |column: &Vec<(&str, &str)>| {
        let at = every.iter().position(|other| other == column);
        at.and_then(|k| row.values.get(k)).copied().filter(|x| x.is_finite())
    };
    let cell = |column| value(column).map_or(NONE.to_owned(), |x| number(x, digits));
    std::iter::once(row.name.clone()).chain(columns.iter().map(cell)).collect()
}

/// Describes what the levels of each factor change.
pub fn levels_told(experiment: &Experiment) -> Table {
    let mut rows = Vec::new();
    for factor in &experiment.factor {
        for level in &factor.levels {
            let mut changes = Vec::new();
            if let Some(fit) = &level.fit {
                changes.push(format!("the fit {}", fit.display()));
            }
            flatten("", &Value::Table(level.set.clone()), &mut changes);
            changes.extend(level.remove.iter().map(|key| format!("no {key}")));
            let changes =
                if changes.is_empty() { "nothing".to_owned() } else { changes.join("; ") };
            rows.push(vec![format!("{}: {}", factor.name, level.name), changes]);
        }
    }
    Table::new(
        "What the cases differ in",
        "Settings that each level changes; all others are those of its fit.",
        ["level", "settings"],
        rows,
    )
}

/// Keys with dots and their values.
fn flatten(before: &str, value: &Value, into: &mut Vec<String>) {
    match value {
        Value::Table(table) if !table.is_empty() => {
            for (key, value) in table {
                let dot = if before.is_empty() { "" } else { "." };
                flatten(&format!("{before}{dot}{key}"), value, into);
            }
        }
        Value::Table(_) => into.push(before.to_owned()),
        value => into.push(format!("{before} = {value}")),
    }
}

/// All cases, those that failed and those still to be run included: nothing is left out.
pub fn all(summary: &Summary, with_verdicts: bool) -> Table {
    let shown =
        ["psnr_db", "nrmse", "correlation", "axis_dot_truth", "chi2", "seconds", "peak_memory_mib"];
    let mut head = vec!["case".to_owned()];
    head.extend(shown.iter().map(|key| described(key).0));
    if with_verdicts {
        head.push("data explained?".to_owned());
    }
    let columns = head.len();
    let row = |(case, status): &(&Case, Status<Results>)| {
        let mut row = vec![case.name()];
        match status {
            Status::Done(results) => {
                let cell = |key: &&str| match results.get(key) {
                    Some(x) => number(x, described(key).1),
                    None => NONE.to_owned(),
                };
                row.extend(shown.iter().map(cell));
                if with_verdicts {
                    row.push(results.verdict.to_owned());
                }
            }
            Status::Failed(why) => row.push(format!("failed: {why}")),
            Status::Open => row.push("not run".to_owned()),
        }
        row.resize(columns, String::new());
        row
    };
    Table {
        title: "All cases".to_owned(),
        caption: "Every seed of every case; the first column leads to its own page, while this page lies in its folder. \
                  χ² is the mean square of the residuals in units of the errors that the loss assumes, also where \
                  data are noise-free."
            .to_owned(),
        head,
        rows: summary.all.iter().map(row).collect(),
        links: summary.all.iter().map(|(case, _)| format!("cases/{}/report.html", case.slug())).collect(),
    }
}

/// The table in Markdown. Names of levels and titles are the experiment's: none of them ends a line or a cell.
pub fn markdown(table: &Table) -> String {
    let cell = |text: &String| plain::line(text).replace('|', "\\|");
    let line = |cells: &[String]| {
        format!("| {} |\n", cells.iter().map(cell).collect::<Vec<_>>().join(" | "))
    };
    let (title, caption) = (plain::line(&table.title), plain::lines(&table.caption));
    if table.rows.is_empty() {
        return format!("### {title}\n\n{caption}\n\n");
    }
    let rule = format!("|{}\n", "---|".repeat(table.head.len()));
    let rows: String = table.rows.iter().map(|row| line(row)).collect();
    format!("### {title}\n\n{}{rule}{rows}\n{caption}\n", line(&table.head))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compare::cases::expand;
    use crate::compare::recipe::Choice;
    use crate::compare::source::Source;
    use crate::compare::verdicts;

    const TEXT: &str = r#"
        title = "t"
        question = "q"
        seeds = 1
        fit = "../scenes/fits/scene_1.toml"
        [[factor]]
        name = "what"
        key = "representation.kind"
        values = ["bhnerf", "grid"]
        [[factor]]
        name = "rate"
        key = "representation.network.rate"
        values = [1e-3, 2e-3]
        [[table]]
        title = "Best"
        caption = "Of two."
        value = "psnr_db"
        rows = ["what"]
        best_of = "rate"
    "#;

    #[test]
    fn exact_cells_have_their_best_level() {
        let experiment = Experiment::parse(TEXT).unwrap();
        let cases = expand(&experiment, &Source::default(), &Choice::default()).unwrap();
        let results = [30.0, 20.0, 21.0, 25.0]
            .map(|x| Status::Done(Results::of(&serde_json::json!({"psnr_db": x}))));
        let summary = Summary::new(&experiment, cases.iter().zip(results).collect());
        let table = table(&summary, &experiment.table[0]);
        assert_eq!(table.rows, [["bhnerf", "30.00 (0.001)"], ["grid", "25.00 (0.002)"]]);
        assert_eq!(table.caption, "Of two. One seed. In brackets: the best level of rate.");
        let said = verdicts::of_table(&summary, &experiment.table[0]);
        assert_eq!(said, ["Best, by PSNR (dB): bhnerf (30.00 (0.001)) > grid (25.00 (0.002))."]);
        let odd =
            Table { title: "a\n# b".to_owned(), rows: vec![vec!["|\u{1b}".to_owned()]], ..table };
        let text = markdown(&odd);
        assert!(text.starts_with("### a\\n# b\n") && text.contains("| \\|\\u{1b} |\n"), "{text}");
        // What no case has leaves a note.
        let none = cases
            .iter()
            .map(|case| (case, Status::Done(Results::of(&serde_json::json!({})))))
            .collect();
        let empty = super::table(&Summary::new(&experiment, none), &experiment.table[0]);
        assert!(empty.rows.is_empty() && empty.caption.contains("no case that was run to its end"));
        assert!(markdown(&empty).contains(&empty.caption), "{}", markdown(&empty));
        for (old, new, message) in [
            ("\"psnr_db\"", "\"seconds\"", "best_of is for psnr_db"),
            ("best_of = \"rate\"", "best_of = \"rates\"", "there is no factor \"rates\""),
        ] {
            let error = format!("{:#}", Experiment::parse(&TEXT.replace(old, new)).err().unwrap());
            assert!(error.contains(message), "{error}");
        }
    }
}

//! Tables of means over seeds, and what they say in a sentence.

use super::experiment::{Experiment, TableAsked};
use super::summary::{Spread, Summary, called, combinations, described, pairs};
use crate::report::Table;

/// Levels of factors, without those that no case is at.
pub fn levels(
    experiment: &Experiment,
    summary: &Summary,
    factors: &[String],
) -> Vec<(String, Vec<String>)> {
    let of = |factor: &String| {
        let all = experiment.levels(factor).into_iter().map(|level| level.name);
        let is_there = |level: &String| {
            summary.all.iter().any(|(case, _)| case.level(factor) == Some(level.as_str()))
        };
        (factor.clone(), all.filter(is_there).collect())
    };
    factors.iter().map(of).collect()
}

/// One table; nothing if it would be empty.
pub fn table(experiment: &Experiment, summary: &Summary, asked: &TableAsked) -> Option<Table> {
    let (unit, digits) = described(&asked.value);
    let rows = levels(experiment, summary, &asked.rows);
    let columns = levels(experiment, summary, &asked.columns);
    let (rows, columns) = (combinations(&rows), combinations(&columns));
    let fixed = pairs(&asked.r#where);
    let cell = |row: &[(&str, &str)], column: &[(&str, &str)]| {
        summary.spread(&asked.value, &[row, column, &fixed].concat())
    };
    let text = |spread: Option<Spread>| spread.map_or("–".to_owned(), |s| s.text(digits));
    let mut lines = Vec::new();
    for row in &rows {
        let cells: Vec<Option<Spread>> = columns.iter().map(|column| cell(row, column)).collect();
        if cells.iter().any(Option::is_some) {
            let name = if row.is_empty() { "all".to_owned() } else { called(row) };
            lines.push([vec![name], cells.into_iter().map(text).collect()].concat());
        }
    }
    if lines.is_empty() {
        return None;
    }
    let head = asked.rows.join(", ");
    let names = columns.iter().map(|column| match column.as_slice() {
        [] => unit.clone(),
        levels => called(levels),
    });
    let seeds = summary.all.iter().map(|(case, _)| case.seed).max().unwrap_or(1);
    let spread = match seeds {
        1 => "One seed.".to_owned(),
        seeds => format!("Mean ± standard deviation over {seeds} seeds."),
    };
    Some(Table {
        title: format!("{}: {unit}", asked.title),
        caption: format!("{} {spread}", asked.caption),
        head: std::iter::once(head).chain(names).collect(),
        rows: lines,
    })
}

/// All cases, those that failed and those still to be run included: nothing is left out.
pub fn all(summary: &Summary) -> Table {
    let shown =
        ["psnr_db", "nrmse", "correlation", "axis_dot_truth", "chi2", "seconds", "peak_memory_mib"];
    let mut head = vec!["case".to_owned()];
    head.extend(shown.iter().map(|key| described(key).0));
    let row = |(case, status): &(&super::cases::Case, super::runner::Status)| {
        let mut row = vec![case.name()];
        match status {
            super::runner::Status::Done(results) => {
                let cell = |key: &&str| match super::summary::result(results, key) {
                    Some(x) => format!("{x:.*}", described(key).1),
                    None => "–".to_owned(),
                };
                row.extend(shown.iter().map(cell));
            }
            super::runner::Status::Failed(why) => row.push(format!("failed: {why}")),
            super::runner::Status::Open => row.push("not run".to_owned()),
        }
        row.resize(shown.len() + 1, String::new());
        row
    };
    Table {
        title: "All cases".to_owned(),
        caption: "Every seed of every case; each has a page of its own in its folder under cases/."
            .to_owned(),
        head,
        rows: summary.all.iter().map(row).collect(),
    }
}

/// The order of the rows in each column of a table of qualities, in words.
pub fn verdict(experiment: &Experiment, summary: &Summary, asked: &TableAsked) -> Vec<String> {
    let larger_is_better = ["psnr_db", "psnr_inside_db", "correlation", "axis_dot_truth"];
    if !larger_is_better.contains(&asked.value.as_str()) {
        return Vec::new();
    }
    let (unit, digits) = described(&asked.value);
    let rows = levels(experiment, summary, &asked.rows);
    let columns = levels(experiment, summary, &asked.columns);
    let fixed = pairs(&asked.r#where);
    let mut sentences = Vec::new();
    for column in combinations(&columns) {
        let mut ranked: Vec<(String, Spread)> = combinations(&rows)
            .into_iter()
            .filter_map(|row| {
                let at = [row.as_slice(), &column, &fixed].concat();
                Some((called(&row), summary.spread(&asked.value, &at)?))
            })
            .collect();
        if ranked.len() < 2 {
            continue;
        }
        ranked.sort_by(|a, b| b.1.mean.total_cmp(&a.1.mean));
        let order: Vec<String> =
            ranked.iter().map(|(name, s)| format!("{name} ({})", s.text(digits))).collect();
        let what = if column.is_empty() { String::new() } else { format!(", {}", called(&column)) };
        sentences.push(format!("{}{what}, by {unit}: {}.", asked.title, order.join(" > ")));
    }
    sentences
}

/// The table in Markdown.
pub fn markdown(table: &Table) -> String {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    let rule = format!("|{}\n", "---|".repeat(table.head.len()));
    let rows: String = table.rows.iter().map(|row| line(row)).collect();
    format!("### {}\n\n{}{rule}{rows}\n{}\n", table.title, line(&table.head), table.caption)
}

//! Sentences on tables of qualities.

use super::experiment::{QUALITIES, TableAsked};
use super::labels::{called, described, pairs};
use super::summary::Summary;
use super::tables::Cell;

/// Rows of a table in an order that some of its columns share.
struct Order {
    /// The best first.
    rows: Vec<String>,
    columns: Vec<String>,
    /// Column by column, as the rows.
    values: Vec<Vec<String>>,
}

/// Most rows of a sentence.
const TOLD: usize = 20;

impl Order {
    fn sentence(&self, title: &str, unit: &str) -> String {
        let of = |k: usize| {
            let row: Vec<&str> = self.values.iter().map(|column| column[k].as_str()).collect();
            row.join(" / ")
        };
        let told = self.rows.iter().take(TOLD).enumerate();
        let mut rows: Vec<String> = told.map(|(k, name)| format!("{name} ({})", of(k))).collect();
        if self.rows.len() > TOLD {
            rows.push(format!("{} more, which the table has", self.rows.len() - TOLD));
        }
        let columns = self.columns.join(" / ");
        let what = if columns.is_empty() { columns } else { format!(", {columns}") };
        format!("{title}{what}, by {unit}: {}.", rows.join(" > "))
    }
}

/// Describes how many cases explain their data.
pub fn of_all(summary: &Summary) -> Option<String> {
    let words: Vec<&str> = summary.done().map(|(_, results)| results.verdict).collect();
    let count = |word: &str| words.iter().filter(|other| **other == word).count();
    let kinds = ["yes", "yes, without noise", "fits noise", "no", "not judged"];
    let told: Vec<String> = kinds
        .iter()
        .filter(|word| count(word) > 0)
        .map(|word| format!("{word}: {}", count(word)))
        .collect();
    (!told.is_empty()).then(|| {
        format!(
            "Do the fits explain their data? {}. The table of all cases says which, the page of each case why.",
            told.join("; ")
        )
    })
}

/// The order of the rows of a table of qualities: a sentence for columns of the same order.
pub fn of_table(summary: &Summary, asked: &TableAsked) -> Vec<String> {
    if !QUALITIES.contains(&asked.value.as_str()) {
        return Vec::new();
    }
    let (unit, digits) = described(&asked.value);
    let fixed = pairs(&asked.r#where);
    let mut orders: Vec<Order> = Vec::new();
    for column in summary.combinations(&asked.columns) {
        let mut ranked: Vec<_> = summary
            .combinations(&asked.rows)
            .into_iter()
            .filter_map(|row| {
                let at = [row.as_slice(), &column, &fixed].concat();
                Some((called(&row), Cell::of(summary, asked, &at)?))
            })
            .collect();
        if ranked.len() < 2 {
            continue;
        }
        ranked.sort_by(|a, b| b.1.spread.mean.total_cmp(&a.1.spread.mean));
        let (rows, values): (Vec<_>, Vec<_>) =
            ranked.into_iter().map(|(name, cell)| (name, cell.text(digits, summary.seeds))).unzip();
        match orders.iter_mut().find(|order| order.rows == rows) {
            Some(order) => {
                order.columns.push(called(&column));
                order.values.push(values);
            }
            None => {
                orders.push(Order { rows, columns: vec![called(&column)], values: vec![values] })
            }
        }
    }
    orders.iter().map(|order| order.sentence(&asked.title, &unit)).collect()
}

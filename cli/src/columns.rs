//! Tables of named columns, as CSV or npz.

use anyhow::Context;
use kerrlight_common::numpy::write_array;
use npyz::WriterBuilder;
use serde_json::json;
use std::fmt::Write;
use std::io::{Cursor, Write as _};

/// A named column of a table.
#[derive(Debug, Clone)]
pub enum Column {
    /// One number a row; NaN where there is none.
    Numbers(String, Vec<f64>),
    /// One count a row.
    Counts(String, Vec<u64>),
    /// One word a row.
    Words(String, Vec<String>),
    /// Several numbers a row, all of them named `name_k` from `first` on; NaN where there is
    /// none.
    Blocks(String, Vec<Vec<f64>>),
}

impl Column {
    /// Its name, without the numbers of a block.
    pub fn name(&self) -> &str {
        match self {
            Column::Numbers(name, _)
            | Column::Counts(name, _)
            | Column::Words(name, _)
            | Column::Blocks(name, _) => name,
        }
    }

    /// Columns of the table that it takes.
    fn width(&self) -> usize {
        match self {
            Column::Blocks(_, rows) => rows.first().map_or(0, Vec::len),
            _ => 1,
        }
    }

    /// Heading of its k-th column.
    fn heading(&self, k: usize) -> String {
        match self {
            Column::Blocks(name, _) => format!("{name}_{}", k + 1),
            _ => self.name().to_owned(),
        }
    }

    /// The cell of a row in its k-th column.
    fn write_cell(&self, row: usize, k: usize, to: &mut String) {
        to.clear();
        match self {
            Column::Numbers(_, values) => write_digits(values[row], to),
            Column::Blocks(_, rows) => write_digits(rows[row][k], to),
            // Writing to a string cannot fail.
            Column::Counts(_, counts) => _ = write!(to, "{}", counts[row]),
            Column::Words(_, words) => to.push_str(&words[row]),
        }
    }
}

/// 17 significant digits: every double has its own. Nothing where there is none.
fn write_digits(x: f64, to: &mut String) {
    if !x.is_nan() {
        // Writing to a string cannot fail.
        _ = write!(to, "{x:.16e}");
    }
}

/// The bytes of a CSV table of `rows` rows. Blocks of the same group are interleaved:
/// a_1, b_1, a_2, b_2, …
pub fn csv(groups: &[Vec<Column>], rows: usize) -> anyhow::Result<Vec<u8>> {
    let mut order = Vec::new();
    for group in groups {
        let most = group.iter().map(Column::width).max().unwrap_or(0);
        for k in 0..most {
            order
                .extend(group.iter().filter(|column| k < column.width()).map(|column| (column, k)));
        }
    }
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(order.iter().map(|(column, k)| column.heading(*k)))?;
    let mut cell = String::new();
    for row in 0..rows {
        for (column, k) in &order {
            column.write_cell(row, *k, &mut cell);
            writer.write_field(&cell)?;
        }
        writer.write_record(None::<&[u8]>)?;
    }
    writer.into_inner().map_err(|e| e.into_error().into())
}

/// The bytes of an npz archive: an array a column; words become fixed-width byte strings.
pub fn npz(groups: &[Vec<Column>]) -> anyhow::Result<Vec<u8>> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options =
        zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for column in groups.iter().flatten() {
        let bytes = match column {
            Column::Numbers(_, values) => {
                write_array(&[values.len() as u64], values.iter().copied())
            }
            Column::Counts(_, counts) => {
                write_array(&[counts.len() as u64], counts.iter().copied())
            }
            Column::Blocks(_, rows) => {
                let shape = [rows.len(), column.width()].map(|n| n as u64);
                write_array(&shape, rows.iter().flatten().copied())
            }
            Column::Words(_, words) => npy_words(words)?,
        };
        archive.start_file(npyz::npz::file_name_from_array_name(column.name()), options)?;
        archive.write_all(&bytes)?;
    }
    Ok(archive.finish()?.into_inner())
}

/// An object of columns: an array a column, of arrays where a row has several numbers. What is not finite is null.
pub fn json(groups: &[Vec<Column>]) -> serde_json::Value {
    let columns = groups.iter().flatten().map(|column| {
        let values = match column {
            Column::Numbers(_, values) => json!(values),
            Column::Counts(_, counts) => json!(counts),
            Column::Words(_, words) => json!(words),
            Column::Blocks(_, rows) => json!(rows),
        };
        (column.name().to_owned(), values)
    });
    serde_json::Value::Object(columns.collect())
}

fn npy_words(words: &[String]) -> anyhow::Result<Vec<u8>> {
    let width = words.iter().map(String::len).max().unwrap_or(0).max(1);
    let dtype = npyz::DType::Plain(format!("|S{width}").parse().context("a type string")?);
    let mut bytes = Vec::new();
    let mut writer = npyz::WriteOptions::<Vec<u8>>::new()
        .dtype(dtype)
        .shape(&[words.len() as u64])
        .writer(&mut bytes)
        .begin_nd()?;
    for word in words {
        writer.push(&word.clone().into_bytes())?;
    }
    writer.finish()?;
    Ok(bytes)
}

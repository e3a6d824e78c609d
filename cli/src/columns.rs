//! Tables of named columns, as CSV or npz.

use anyhow::Context;
use npyz::WriterBuilder;
use serde_json::json;
use std::io::{Cursor, Write};

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

/// 17 significant digits: every double has its own. Nothing where there is none.
fn digits(x: f64) -> String {
    if x.is_nan() { String::new() } else { format!("{x:.16e}") }
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

    fn names(&self) -> Vec<String> {
        match self {
            Column::Numbers(name, _) | Column::Counts(name, _) | Column::Words(name, _) => {
                vec![name.clone()]
            }
            Column::Blocks(name, rows) => {
                let width = rows.first().map_or(0, Vec::len);
                (1..=width).map(|k| format!("{name}_{k}")).collect()
            }
        }
    }

    fn cells(&self, row: usize) -> Vec<String> {
        match self {
            Column::Numbers(_, values) => vec![digits(values[row])],
            Column::Counts(_, counts) => vec![counts[row].to_string()],
            Column::Words(_, words) => vec![words[row].clone()],
            Column::Blocks(_, rows) => rows[row].iter().map(|x| digits(*x)).collect(),
        }
    }
}

/// The bytes of a CSV table of `rows` rows. Blocks of the same prefix are interleaved:
/// a_1, b_1, a_2, b_2, …
pub fn csv(groups: &[Vec<Column>], rows: usize) -> anyhow::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let interleave = |cells: Vec<Vec<String>>| -> Vec<String> {
        let most = cells.iter().map(Vec::len).max().unwrap_or(0);
        (0..most).flat_map(|k| cells.iter().filter_map(move |c| c.get(k).cloned())).collect()
    };
    let header = groups.iter().flat_map(|g| interleave(g.iter().map(Column::names).collect()));
    writer.write_record(header)?;
    for row in 0..rows {
        let cells =
            groups.iter().flat_map(|g| interleave(g.iter().map(|c| c.cells(row)).collect()));
        writer.write_record(cells)?;
    }
    writer.into_inner().map_err(|e| e.into_error().into())
}

/// The bytes of an npz archive: an array a column; words become fixed-width byte strings.
pub fn npz(groups: &[Vec<Column>]) -> anyhow::Result<Vec<u8>> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options =
        zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for column in groups.iter().flatten() {
        let (name, bytes) = match column {
            Column::Numbers(name, values) => (name, npy(&[values.len()], values.iter().copied())?),
            Column::Blocks(name, rows) => {
                let width = rows.first().map_or(0, Vec::len);
                (name, npy(&[rows.len(), width], rows.iter().flatten().copied())?)
            }
            Column::Counts(name, counts) => (name, npy(&[counts.len()], counts.iter().copied())?),
            Column::Words(name, words) => (name, npy_words(words)?),
        };
        archive.start_file(npyz::npz::file_name_from_array_name(name), options)?;
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

fn npy<T: npyz::AutoSerialize>(
    shape: &[usize],
    values: impl Iterator<Item = T>,
) -> anyhow::Result<Vec<u8>> {
    let shape: Vec<u64> = shape.iter().map(|n| *n as u64).collect();
    let mut bytes = Vec::new();
    let mut writer =
        npyz::WriteOptions::new().default_dtype().shape(&shape).writer(&mut bytes).begin_nd()?;
    writer.extend(values)?;
    writer.finish()?;
    Ok(bytes)
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

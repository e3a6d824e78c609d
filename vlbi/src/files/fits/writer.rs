//! Writing headers and binary tables.

use super::{BLOCK, CARD};
use core::fmt::Display;

/// Lines of a header to be written.
#[derive(Debug, Default)]
pub struct Cards {
    bytes: Vec<u8>,
}

impl Cards {
    fn push(&mut self, card: &str) {
        // FITS headers have printable ASCII alone.
        let card: String = card
            .chars()
            .map(|c| if (' '..='~').contains(&c) { c } else { '?' })
            .take(CARD)
            .collect();
        self.bytes.extend(format!("{card:<CARD$}").into_bytes());
    }

    /// A number or logical value.
    pub fn value(&mut self, keyword: &str, value: impl Display) -> &mut Self {
        self.push(&format!("{keyword:<8}= {value:>20}"));
        self
    }

    /// A number with a decimal point, to all its digits.
    pub fn number(&mut self, keyword: &str, value: f64) -> &mut Self {
        // `1E5` without a point would be taken for damage by strict readers.
        let text = format!("{value:?}").replace('e', "E");
        let text = match text.split_once('E') {
            Some((digits, power)) if !digits.contains('.') => format!("{digits}.0E{power}"),
            _ => text,
        };
        self.value(keyword, text)
    }

    /// Text.
    pub fn text(&mut self, keyword: &str, text: &str) -> &mut Self {
        let text: String = text.chars().take(60).collect();
        self.push(&format!("{keyword:<8}= '{:<8}'", text.replace('\'', "''")));
        self
    }

    /// Lines of free text.
    pub fn history(&mut self, text: &str) -> &mut Self {
        let characters: Vec<char> = text.chars().collect();
        for part in characters.chunks(CARD - 9) {
            self.push(&format!("HISTORY  {}", part.iter().collect::<String>()));
        }
        self
    }

    /// The header in full blocks.
    pub fn finish(mut self) -> Vec<u8> {
        self.push("END");
        padded(self.bytes, b' ')
    }
}

/// Bytes filled up to full blocks.
pub fn padded(mut bytes: Vec<u8>, with: u8) -> Vec<u8> {
    bytes.resize(bytes.len().next_multiple_of(BLOCK), with);
    bytes
}

/// A column of a table to be written: as many values a row as fit.
pub enum ColumnData {
    /// Text of a fixed width.
    Text(usize, Vec<String>),
    /// 32-bit integers, so many a row.
    Integers(usize, Vec<i32>),
    /// Bits, up to eight a row, the first of which is the highest.
    #[cfg(test)]
    Bits(usize, Vec<u8>),
    /// Single precision, so many a row.
    Singles(usize, Vec<f32>),
    /// Double precision, so many a row.
    Doubles(usize, Vec<f64>),
}

impl ColumnData {
    fn form(&self) -> String {
        match self {
            ColumnData::Text(width, _) => format!("{width}A"),
            ColumnData::Integers(repeat, _) => format!("{repeat}J"),
            #[cfg(test)]
            ColumnData::Bits(repeat, _) => format!("{repeat}X"),
            ColumnData::Singles(repeat, _) => format!("{repeat}E"),
            ColumnData::Doubles(repeat, _) => format!("{repeat}D"),
        }
    }

    fn cell(&self, row: usize) -> Vec<u8> {
        let range = |repeat: usize| row * repeat..(row + 1) * repeat;
        match self {
            ColumnData::Text(width, texts) => {
                let mut cell: Vec<u8> = texts[row].bytes().take(*width).collect();
                cell.resize(*width, b' ');
                cell
            }
            ColumnData::Integers(n, v) => {
                v[range(*n)].iter().flat_map(|x| x.to_be_bytes()).collect()
            }
            #[cfg(test)]
            ColumnData::Bits(_, v) => vec![v[row]],
            ColumnData::Singles(n, v) => {
                v[range(*n)].iter().flat_map(|x| x.to_be_bytes()).collect()
            }
            ColumnData::Doubles(n, v) => {
                v[range(*n)].iter().flat_map(|x| x.to_be_bytes()).collect()
            }
        }
    }
}

/// A binary table with named columns (name, unit, data) and further header lines.
pub fn binary_table(
    name: &str,
    rows: usize,
    columns: &[(&str, &str, ColumnData)],
    more: impl FnOnce(&mut Cards),
) -> Vec<u8> {
    let mut data = Vec::new();
    for row in 0..rows {
        columns.iter().for_each(|(_, _, column)| data.extend(column.cell(row)));
    }
    let width = data.len() / rows.max(1);
    let mut cards = Cards::default();
    cards.text("XTENSION", "BINTABLE").value("BITPIX", 8).value("NAXIS", 2);
    cards.value("NAXIS1", width).value("NAXIS2", rows).value("PCOUNT", 0).value("GCOUNT", 1);
    cards.value("TFIELDS", columns.len());
    for (k, (name, unit, column)) in (1..).zip(columns) {
        cards.text(&format!("TTYPE{k}"), name).text(&format!("TFORM{k}"), &column.form());
        if !unit.is_empty() {
            cards.text(&format!("TUNIT{k}"), unit);
        }
    }
    cards.text("EXTNAME", name).value("EXTVER", 1);
    more(&mut cards);
    let mut bytes = cards.finish();
    bytes.extend(padded(data, 0));
    bytes
}

//! FITS binary tables.

use super::super::FileError;
use super::{Header, Unit, stored};

/// A column: where its cells are, and how many values of what kind they hold.
#[derive(Debug, Clone)]
struct Column {
    name: String,
    offset: usize,
    repeat: usize,
    code: char,
    /// TSCAL and TZERO.
    scale: [f64; 2],
}

/// A binary table.
#[derive(Debug)]
pub struct Table<'a> {
    columns: Vec<Column>,
    row_size: usize,
    rows: usize,
    data: &'a [u8],
}

/// Bytes of a value of a column's kind; bits of `X` are counted apart.
fn size_of(code: char) -> Option<usize> {
    Some(match code {
        'L' | 'B' | 'A' => 1,
        'I' => 2,
        'J' | 'E' => 4,
        'K' | 'D' | 'C' | 'P' => 8,
        'M' | 'Q' => 16,
        _ => return None,
    })
}

impl<'a> Table<'a> {
    /// The table of a unit.
    pub fn new(unit: &Unit<'a>) -> Result<Self, FileError> {
        let header = &unit.header;
        if header.integer("BITPIX")? != Some(8) {
            return Err(header.error("BITPIX", "8 in a table"));
        }
        let row_size = header.count("NAXIS1", 0, usize::MAX)?;
        let rows = header.count("NAXIS2", 0, usize::MAX)?;
        let size = row_size.checked_mul(rows).filter(|size| *size <= unit.data.len());
        let size = size.ok_or_else(|| header.error("NAXIS2", "more rows than data"))?;
        let columns = columns(header, row_size)?;
        Ok(Table { columns, row_size, rows, data: &unit.data[..size] })
    }

    /// Returns the number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    fn column(&self, name: &str) -> Option<&Column> {
        self.columns.iter().find(|column| column.name == name)
    }

    /// Text of a column of characters, without what follows a NUL or trailing blanks. Control characters, which the
    /// standard does not allow, are blanks.
    pub fn text(&self, row: usize, name: &str) -> Option<String> {
        let column = self.column(name).filter(|column| column.code == 'A')?;
        let start = row * self.row_size + column.offset;
        let cell = self.data.get(start..start + column.repeat)?;
        let cell = cell.split(|byte| *byte == 0).next()?;
        Some(String::from_utf8_lossy(cell).replace(char::is_control, " ").trim().to_owned())
    }

    /// Value `index` of a cell as a number; a bit is 0 or 1.
    pub fn number(&self, row: usize, name: &str, index: usize) -> Option<f64> {
        let column = self.column(name).filter(|column| index < column.repeat)?;
        if column.code == 'X' {
            let byte = self.data.get(row * self.row_size + column.offset + index / 8)?;
            return Some((byte >> (7 - index % 8) & 1).into());
        }
        let size = size_of(column.code)?;
        let start = row * self.row_size + column.offset + index * size;
        let cell = self.data.get(start..start + size)?;
        let value: f64 = match (column.code, cell) {
            ('B', &[a]) => a.into(),
            ('K', cell) => i64::from_be_bytes(cell.try_into().ok()?) as f64,
            ('I' | 'J', cell) => stored(false, cell),
            ('E' | 'D', cell) => stored(true, cell),
            _ => return None,
        };
        let [scale, zero] = column.scale;
        Some(value * scale + zero)
    }
}

/// Units that are multiples of those in which tables are read: metres, Hz, degrees.
const MULTIPLES: [&str; 8] = ["KM", "CM", "MM", "KHZ", "MHZ", "GHZ", "RADIANS", "RAD"];

fn columns(header: &Header<'_>, row_size: usize) -> Result<Vec<Column>, FileError> {
    let count = header.count("TFIELDS", 0, 999)?;
    let mut offset = 0usize;
    let mut columns = Vec::with_capacity(count);
    for k in 1..=count {
        let keyword = format!("TFORM{k}");
        let bad = || header.error(&keyword, "a FITS format that fits into the row");
        let form = header.text(&keyword).ok_or_else(bad)?;
        let digits = form.len() - form.trim_start_matches(|c: char| c.is_ascii_digit()).len();
        let repeat: usize =
            if digits == 0 { 1 } else { form[..digits].parse().map_err(|_| bad())? };
        let code = form[digits..].chars().next().ok_or_else(bad)?;
        let size = match code {
            'X' => Some(repeat.div_ceil(8)),
            code => size_of(code).and_then(|size| size.checked_mul(repeat)),
        };
        let end = size.and_then(|size| offset.checked_add(size)).filter(|end| *end <= row_size);
        let name = header.text(&format!("TTYPE{k}")).unwrap_or_default();
        let unit = format!("TUNIT{k}");
        if MULTIPLES.contains(&&*header.text(&unit).unwrap_or_default().to_ascii_uppercase()) {
            return Err(header.error(&unit, "METERS, HZ, DEGREES and other units of AIPS"));
        }
        let number = |name: &str, default| header.number_or(&format!("{name}{k}"), default);
        let scale = [number("TSCAL", 1.0)?, number("TZERO", 0.0)?];
        columns.push(Column { name, offset, repeat, code, scale });
        offset = end.ok_or_else(bad)?;
    }
    Ok(columns)
}

//! Parameters that tell groups of several sources, receivers' setups and the like apart. A file that is read has one of each.

use super::super::FileError;
use super::super::fits::{Header, Table, Unit};
use super::layout::{Layout, Parameter, SELECTORS};
use crate::earth::SourcePosition;
use crate::source::Source;
use std::collections::BTreeSet;

/// Largest number of values that are listed.
const SHOWN: usize = 16;

/// The one value that groups with data have of a parameter; none where there is no such parameter.
///
/// # Errors
/// If there are several.
pub fn only(unit: &Unit<'_>, layout: &Layout, name: &str) -> Result<Option<i64>, FileError> {
    let Some(parameter) = layout.selector(name) else { return Ok(None) };
    let values = values(unit, layout, parameter);
    if values.len() > 1 {
        let what = SELECTORS.iter().find(|(known, _)| *known == name).map_or("", |(_, what)| what);
        let shown: Vec<String> = values.iter().take(SHOWN).map(i64::to_string).collect();
        return Err(FileError::byte(
            unit.offset,
            format!(
                "{} {what} in one file, {name} = {}: write the one that is meant to a file of its own",
                values.len(),
                shown.join(", ")
            ),
        ));
    }
    Ok(values.first().copied())
}

/// All values of groups that hold a datum.
fn values(unit: &Unit<'_>, layout: &Layout, parameter: Parameter) -> BTreeSet<i64> {
    let groups = unit.data.chunks_exact(layout.group_size * layout.number_size);
    let with_data = groups.filter(|group| layout.has_datum(group));
    with_data.map(|group| layout.parameter(group, parameter) as i64).collect()
}

/// The source that groups with data have, as the `AIPS SU` table tells it; none where groups or tables do not tell.
///
/// # Errors
/// If there are several, each with its name, or coordinates are not of J2000.
pub fn source(units: &[Unit<'_>], layout: &Layout) -> Result<Option<Source>, FileError> {
    let unit = units.iter().find(|unit| unit.is_named("AIPS SU"));
    let table = unit.map(Table::new).transpose()?;
    let row_of = |number: i64| {
        let table = table.as_ref()?;
        let row = (0..table.rows()).find(|row| {
            ["ID. NO.", "ID_NO."].iter().any(|id| table.number(*row, id, 0) == Some(number as f64))
        });
        row.map(|row| (table, row))
    };
    let name = |number: i64| {
        let (table, row) = row_of(number)?;
        table.text(row, "SOURCE")
    };
    let number = only(&units[0], layout, "SOURCE").map_err(|error| {
        let parameter = layout.selector("SOURCE").into_iter();
        let there = parameter.flat_map(|parameter| values(&units[0], layout, parameter));
        let named = |k: i64| Some(format!("{k} is {}", name(k)?));
        let names: Vec<String> = there.take(SHOWN).filter_map(named).collect();
        match error {
            FileError::Byte { offset, message } if !names.is_empty() => {
                FileError::byte(offset, format!("{message} ({})", names.join(", ")))
            }
            error => error,
        }
    })?;
    let (Some(number), Some(unit)) = (number, unit) else { return Ok(None) };
    let Some((table, row)) = row_of(number) else { return Ok(None) };
    let fail = |message: String| {
        FileError::byte(unit.offset, format!("AIPS SU table, row {}: {message}", row + 1))
    };
    let equinox = table.number(row, "EPOCH", 0).unwrap_or(2000.0);
    if equinox != 2000.0 {
        return Err(fail(format!("EPOCH = {equinox} is not allowed: 2000")));
    }
    let shift = table.number(row, "FREQOFF", 0).unwrap_or(0.0);
    if shift != 0.0 {
        return Err(fail(format!("FREQOFF = {shift} Hz is not allowed: 0")));
    }
    let place = table.number(row, "RAEPO", 0).zip(table.number(row, "DECEPO", 0));
    let (ra, dec) = place.ok_or_else(|| fail("no RAEPO or DECEPO".to_owned()))?;
    let position = SourcePosition::new(ra.rem_euclid(360.0) / 15.0, dec);
    let position = position.map_err(|error| fail(error.to_string()))?;
    Ok(Some(Source { name: name(number).unwrap_or_default(), position }))
}

/// Refuses a header whose coordinates or times are others than those that are read.
pub fn check_header(header: &Header<'_>) -> Result<(), FileError> {
    if let Some(unit) = header.text("BUNIT").filter(|unit| !unit.is_empty())
        && !unit.eq_ignore_ascii_case("JY")
    {
        return Err(header.error("BUNIT", "JY"));
    }
    header.check_equinox()?;
    for k in 2..=9 {
        let name = header.text(&format!("CTYPE{k}")).unwrap_or_default();
        let keyword = format!("CROTA{k}");
        let is_place = name.starts_with("RA") || name.starts_with("DEC");
        if is_place && header.number_or(&keyword, 0.0)? != 0.0 {
            return Err(header.error(&keyword, "0: (u, v) are of north and east"));
        }
    }
    Ok(())
}

/// Names tables of calibration, which are not applied.
pub fn calibration(units: &[Unit<'_>]) -> Option<String> {
    const TABLES: [&str; 7] =
        ["AIPS SN", "AIPS CL", "AIPS BP", "AIPS BL", "AIPS PD", "AIPS TY", "AIPS GC"];
    let names = units.iter().filter_map(|unit| unit.header.text("EXTNAME"));
    let found: BTreeSet<String> = names.filter(|name| TABLES.contains(&name.as_str())).collect();
    let found: Vec<String> = found.into_iter().collect();
    (!found.is_empty()).then(|| format!("{}: calibration that is not applied", found.join(", ")))
}

/// Hours that the times of a file are ahead of UTC.
///
/// # Errors
/// If a header names a time system other than UTC and TAI, or another one than the antenna table before.
pub fn ahead_h(units: &[Unit<'_>], mjd: i32) -> Result<f64, FileError> {
    let (mut ahead, mut of_tables) = (0.0, None);
    for unit in units {
        let name = unit.header.text("EXTNAME").unwrap_or_default();
        if !(name.is_empty() || name == "AIPS AN") {
            continue;
        }
        for keyword in ["TIMESYS", "TIMSYS"] {
            let system = unit.header.text(keyword).unwrap_or_default();
            let is_utc = match system.to_ascii_uppercase().as_str() {
                "" | "UTC" => true,
                "TAI" | "IAT" => {
                    let seconds = crate::earth::tai_minus_utc(mjd);
                    ahead = seconds.map_err(|error| unit.header.error(keyword, error))? / 3600.0;
                    false
                }
                _ => return Err(unit.header.error(keyword, "UTC, TAI or IAT")),
            };
            let is_of_table = keyword == "TIMSYS" && name == "AIPS AN" && !system.is_empty();
            if is_of_table && *of_tables.get_or_insert(is_utc) != is_utc {
                return Err(unit.header.error(keyword, "that of the AIPS AN table before"));
            }
        }
    }
    Ok(ahead)
}

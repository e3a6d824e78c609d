//! Tables of leakage: a station a line, columns told by a line of names.

use super::{FileError, between, number};
use crate::Complex64;
use crate::Error;
use crate::polarimetry::{LeakageTable, StationLeakage};
use core::fmt::Write;

/// The line of names.
const HEADING: &str = "station,d_r_re,d_r_im,d_r_error,d_l_re,d_l_im,d_l_error";

/// A table as CSV: real and imaginary parts of d_R and d_L, and the standard deviation of each part, empty where it is not
/// known. Numbers have as many digits as they need.
pub fn to_csv(table: &LeakageTable) -> String {
    let mut text = HEADING.to_owned() + "\n";
    let known = |x: f64| if x.is_finite() { format!("{x}") } else { String::new() };
    for StationLeakage { station, terms: [r, l], errors: [of_r, of_l] } in &table.stations {
        let (of_r, of_l) = (known(*of_r), known(*of_l));
        // Writing to a string does not fail.
        let _ = writeln!(text, "{station},{},{},{of_r},{},{},{of_l}", r.re, r.im, l.re, l.im);
    }
    text
}

/// Reads such a table; lines that start with `#` are left out.
///
/// # Errors
/// If the first line is not that of the names, or a line has other columns or no number where one belongs: with line,
/// column and value.
pub fn parse(text: &str) -> Result<LeakageTable, Error> {
    let lines = text.lines().enumerate().filter(|(_, line)| !line.starts_with('#'));
    let mut lines = lines.filter(|(_, line)| !line.trim().is_empty());
    match lines.next() {
        Some((_, line)) if line.trim() == HEADING => {}
        Some((k, line)) => {
            let message = format!("`{}` is not allowed: {HEADING}", line.trim());
            return Err(FileError::line(k + 1, message).into());
        }
        None => return Err(FileError::whole("no leakage").into()),
    }
    let row =
        |(k, line): (usize, &str)| station(line).map_err(|message| FileError::line(k + 1, message));
    let stations: Vec<StationLeakage> = lines.map(row).collect::<Result<_, _>>()?;
    let is_twice = |k: &usize| stations[..*k].iter().any(|s| s.station == stations[*k].station);
    if let Some(k) = (1..stations.len()).find(is_twice) {
        return Err(FileError::whole(format!("{} is listed twice", stations[k].station)).into());
    }
    Ok(LeakageTable { stations })
}

fn station(line: &str) -> Result<StationLeakage, String> {
    let cells = between(',', line);
    let [name, r_re, r_im, r_error, l_re, l_im, l_error] = cells[..] else {
        return Err(format!("{} columns: 7 are needed ({HEADING})", cells.len()));
    };
    let error = |cell: &str, column: &str| match cell {
        "" => Ok(f64::NAN),
        cell => number(cell, column),
    };
    let terms = [
        Complex64::new(number(r_re, "column d_r_re:")?, number(r_im, "column d_r_im:")?),
        Complex64::new(number(l_re, "column d_l_re:")?, number(l_im, "column d_l_im:")?),
    ];
    // Feeds that see more of the other hand than of their own are exchanged, or of no use.
    if let Some(d) = terms.iter().find(|d| d.norm() >= 1.0) {
        return Err(format!("|d| = {} of {name} is not allowed: below 1", d.norm()));
    }
    Ok(StationLeakage {
        station: name.to_owned(),
        terms,
        errors: [error(r_error, "column d_r_error:")?, error(l_error, "column d_l_error:")?],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_tables_come_back_and_bad_lines_are_named() {
        let one = |station: &str, size: f64| StationLeakage {
            station: station.to_owned(),
            terms: [Complex64::new(size / 3.0, -size), Complex64::new(0.0, 1e-17 * size)],
            errors: [0.1 * size, 0.2],
        };
        let table = LeakageTable { stations: vec![one("AA", 0.05), one("LM", -0.1)] };
        let text = to_csv(&table);
        assert_eq!(parse(&format!("# of a fit\n{text}")).unwrap(), table);
        let refused = |text: &str| parse(text).unwrap_err().to_string();
        assert!(refused("station,d\n").starts_with("line 1: `station,d`"));
        assert!(refused(&format!("{text}AA,1,2\n")).contains("line 4: 3 columns"));
        assert!(refused(&format!("{text}AA,.1,.2,3,.4,.5,6\n")).contains("AA is listed twice"));
        let bad = refused(&text.replace(",0.1,", ",x,"));
        assert!(bad.contains("line 3: column d_r_im: `x` is not a number"), "{bad}");
        assert!(refused(&text.replacen("-0.05", "-2", 1)).contains("line 2: |d| = 2.0"));
        assert!(refused(&text.replacen("-0.05", "much", 1)).contains("line 2: column d_r_im:"));
    }
}

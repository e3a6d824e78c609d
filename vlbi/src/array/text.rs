//! The text format of eht-imaging's arrays: a line a station, columns separated by blanks,
//! `name x y z SEFD` or `name x y z SEFD_R SEFD_L fr_par fr_el fr_off D_R(re im) D_L(re im)`.

use super::{Array, ArrayError, FeedRotation, MOST_STATIONS, Station, check_position};
use crate::Complex64;
use crate::Error;

/// Reads an array. Lines that start with `#`, and a first line that starts with `site`, are
/// headings.
///
/// # Errors
/// If a line has another number of columns, no number where one belongs, or the array is none.
pub fn parse(text: &str) -> Result<Array, Error> {
    let mut stations = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let line_of = |message: String| ArrayError::Line { line: index + 1, message };
        let line = line.split('#').next().unwrap_or_default();
        // More than a station has: enough to refuse a line, however long it is.
        let cells: Vec<&str> = line.split_whitespace().take(15).collect();
        let heading = cells.first().is_none_or(|name| name.eq_ignore_ascii_case("site"));
        if heading {
            continue;
        }
        stations.push(station(&cells).map_err(line_of)?);
        if stations.len() > MOST_STATIONS {
            return Err(ArrayError::TooMany(stations.len()).into());
        }
    }
    Array::new(stations)
}

/// A station of 5 or 13 cells.
pub(crate) fn station(cells: &[&str]) -> Result<Station, String> {
    let count = cells.len();
    if count != 5 && count != 13 {
        return Err(format!(
            "{count} columns: a station has 5 (name, x, y, z, SEFD) or 13 (name, x, y, z, \
             SEFD_R, SEFD_L, three of feed rotation, four of leakage)"
        ));
    }
    let mut values = [0.0; 12];
    for (value, cell) in values.iter_mut().zip(&cells[1..]) {
        *value =
            cell.parse().ok().filter(|x: &f64| x.is_finite()).ok_or_else(|| {
                format!("`{cell}` of station {} is not a finite number", cells[0])
            })?;
    }
    let [x, y, z, sefd_r, sefd_l, parallactic, elevation, offset_deg, rr, ri, lr, li] = values;
    check_position(cells[0], [x, y, z]).map_err(|error| error.to_string())?;
    let sefd = [sefd_r, if count == 5 { sefd_r } else { sefd_l }];
    if let Some(bad) = sefd.iter().find(|sefd| **sefd < 0.0) {
        return Err(format!("SEFD = {bad} Jy of station {} must not be negative", cells[0]));
    }
    Ok(Station {
        name: cells[0].to_owned(),
        // The centre of the Earth is what a file has of a station whose position nobody told.
        position: Some([x, y, z]).filter(|place| *place != [0.0; 3]),
        sefd,
        elevation_deg: None,
        feed_rotation: FeedRotation::told([parallactic, elevation, offset_deg]),
        leakage: [Complex64::new(rr, ri), Complex64::new(lr, li)],
    })
}

/// The 13 columns of a station. Numbers have as many digits as they need; one without position
/// stands at the centre of the Earth.
pub(crate) fn columns(station: &Station) -> String {
    let [x, y, z] = station.position.unwrap_or_default();
    let [r, l] = station.sefd;
    let [parallactic, elevation, offset_deg] = FeedRotation::numbers(station.feed_rotation);
    let [dr, dl] = station.leakage;
    format!(
        "{:<8} {x:15} {y:15} {z:15} {r:8} {l:8} {parallactic:5} {elevation:5} {offset_deg:5} \
         {:8} {:8} {:8} {:8}",
        station.name, dr.re, dr.im, dl.re, dl.im
    )
}

/// The heading above [`columns`].
pub(crate) const HEADING: &str = "Site      X(m)             Y(m)             \
Z(m)           SEFDR      SEFDL     FR_PAR   FR_EL   FR_OFF  DR_RE    DR_IM    DL_RE    DL_IM";

#[cfg(test)]
mod tests {
    use super::super::built_in;
    use super::*;

    /// The array in 13 columns.
    fn to_text(array: &Array) -> String {
        let lines: Vec<String> = array.stations.iter().map(columns).collect();
        format!("#{HEADING}\n{}\n", lines.join("\n"))
    }

    #[test]
    fn exact_round_trip() {
        let mut array = built_in("EHT2017").unwrap();
        array.stations[2].sefd = [5600.0, 5800.25];
        array.stations[2].leakage[1] = Complex64::new(0.01, -0.0625);
        array.stations[3].feed_rotation = FeedRotation::told([0.0, 0.0, 45.0]);
        assert_eq!(parse(&to_text(&array)).unwrap(), array);
    }

    #[test]
    fn exact_five_columns_have_equal_feeds() {
        let text = "site x y z sefd\nA 1 2 3 70 # a comment\n\nB 4 5 6 90\n";
        let array = parse(text).unwrap();
        assert_eq!(array.stations[1], Station::new("B", [4.0, 5.0, 6.0], 90.0));
    }

    #[test]
    fn exact_errors_name_the_line() {
        let fail = |text: &str| parse(text).unwrap_err().to_string();
        assert!(fail("A 1 2 3 70\nB 1 x 3 70\n").starts_with("line 2: `x` of station B"));
        assert!(fail("A 1 2 3 70\nB 1 2 3\n").starts_with("line 2: 4 columns"));
        assert!(fail("A 1 2 3 70\nB 1 2 3 -7\n").contains("SEFD = -7"));
        assert!(fail("A 1 2 3 70\nA 1 2 4 70\n").contains("A is listed twice"));
        assert!(fail("A 1 2 3 70\n").contains("at least 2"));
        assert!(fail("A 1 2 inf 70\nB 1 2 3 4\n").contains("line 1"));
        assert!(fail("A 1 2 -1e10 70\nB 1 2 3 4\n").starts_with("line 1: station A: -1e10 m"));
        // Kilometres: SPT is 6359.6 km from the centre.
        let spt = fail("SPT 0 0 -6359.6097 9\nB 1 2 3 4\n");
        assert!(spt.starts_with("line 1: station SPT: 6360 m from the centre"), "{spt}");
    }
}

//! The `AIPS AN` tables: stations and their numbers, a table a subarray.

use super::super::fits::{Table, Unit};
use super::super::{FileError, Names};
use super::mounts::{self, Mount};
use crate::array::{Station, check_position};
use crate::polarimetry::published_rotation;
use kerrlight_geodesic::vector::distance;
use std::collections::HashMap;

/// Places of one station in two subarrays are no farther apart, m.
const SAME_PLACE_M: f64 = 1000.0;

/// Stations of all subarrays; those of the same name count once.
pub struct AntennaTables {
    pub stations: Vec<Station>,
    /// (subarray, antenna number) → station.
    numbers: HashMap<(i64, i64), u16>,
    /// Frequency in Hz that (u, v) refer to, if told.
    pub frequency_hz: Option<f64>,
    /// Lines about mounts that are not known.
    pub remarks: Vec<String>,
}

impl AntennaTables {
    /// Reads the tables among the units of a file.
    pub fn read(units: &[Unit<'_>]) -> Result<Self, FileError> {
        let mut names = Names::new(Vec::new());
        let mut numbers = HashMap::new();
        let mut frequency_hz = None;
        let mut remarks = Vec::new();
        for unit in units.iter().filter(|unit| unit.is_named("AIPS AN")) {
            let subarray = unit.header.integer("EXTVER")?.unwrap_or(1);
            let table = Table::new(unit)?;
            let fail = |row: usize, message: &str| {
                FileError::byte(unit.offset, format!("AIPS AN table, row {}: {message}", row + 1))
            };
            for row in 0..table.rows() {
                let number = table.number(row, "NOSTA", 0);
                let number = number.ok_or_else(|| fail(row, "no antenna number (NOSTA)"))?;
                let station = station(unit, &table, row)?
                    .ok_or_else(|| fail(row, "no name (ANNAME) or no finite position (STABXYZ)"))?;
                check_position(&station.name, station.position.unwrap_or_default())
                    .map_err(|error| fail(row, &error.to_string()))?;
                remarks.extend(unknown_mount(&table, row, &station.name));
                // Another subarray may list it again, at the same place; within one a name is of one antenna.
                let twice = names.known(&station.name).filter(|k| {
                    let places = [&names.stations[usize::from(*k)], &station].map(|s| s.position);
                    let is_here = numbers.iter().any(|((of, _), at)| *of == subarray && at == k);
                    is_here || matches!(places, [Some(a), Some(b)] if distance(a, b) > SAME_PLACE_M)
                });
                if twice.is_some() {
                    return Err(fail(
                        row,
                        &format!("{} is the name of two antennas", station.name),
                    ));
                }
                let k = names.number(&station.name).map_err(|message| fail(row, &message))?;
                names.stations[usize::from(k)] = station;
                if numbers.insert((subarray, number as i64), k).is_some() {
                    return Err(fail(row, "this antenna number is taken"));
                }
            }
            let own = unit.header.number("FREQ")?.filter(|f| *f > 0.0);
            match (frequency_hz, own) {
                (Some(known), Some(own)) if known != own => {
                    let allowed = format!("{known} as in the AIPS AN table before");
                    return Err(unit.header.error("FREQ", allowed));
                }
                _ => frequency_hz = frequency_hz.or(own),
            }
        }
        if names.stations.is_empty() {
            return Err(FileError::whole("no station: the AIPS AN table is missing or empty"));
        }
        Ok(AntennaTables { stations: names.stations, numbers, frequency_hz, remarks })
    }

    /// The station of an antenna.
    pub fn station(&self, subarray: i64, number: i64) -> Option<u16> {
        self.numbers.get(&(subarray, number)).copied()
    }
}

/// A remark about a mount whose feeds turn in a way that its code does not tell.
fn unknown_mount(table: &Table<'_>, row: usize, name: &str) -> Option<String> {
    let code = table.number(row, "MNTSTA", 0).unwrap_or(0.0) as i32;
    let told = published_rotation(name).map_or("with the parallactic angle", |_| "as published");
    let remark = || {
        format!("station {name}: MNTSTA {code} is not known; its feeds are taken to turn {told}")
    };
    (!mounts::is_known(code)).then(remark)
}

/// The station of a row. Positions are relative to the array's centre, y to the east unless the table says that its
/// coordinates are left-handed. Where the centre is not that of the Earth, as it is for VLBI, x lies in its meridian (AIPS memo 117;
/// pyuvdata reads it so).
fn station(unit: &Unit<'_>, table: &Table<'_>, row: usize) -> Result<Option<Station>, FileError> {
    let name = table.text(row, "ANNAME").filter(|name| !name.is_empty());
    // Names have nothing that separates columns, or begins comments, in texts.
    let separates = |c: char| c.is_whitespace() || matches!(c, ',' | '#' | '"');
    let words = |name: String| {
        name.split(separates).filter(|word| !word.is_empty()).collect::<Vec<_>>().join("_")
    };
    let name = name.map(words).filter(|name| !name.is_empty());
    let axis = |keyword| unit.header.number_or(keyword, 0.0);
    let centre = [axis("ARRAYX")?, axis("ARRAYY")?, axis("ARRAYZ")?];
    let [x, y, z] = [0, 1, 2].map(|k| table.number(row, "STABXYZ", k).unwrap_or(f64::NAN));
    let y = if unit.header.text("XYZHAND").as_deref() == Some("LEFT") { -y } else { y };
    let (sin, cos) = f64::atan2(centre[1], centre[0]).sin_cos();
    let position = [centre[0] + x * cos - y * sin, centre[1] + x * sin + y * cos, centre[2] + z];
    let Some(name) = name.filter(|_| position.iter().all(|x| x.is_finite())) else {
        return Ok(None);
    };
    let sefd =
        |column| table.number(row, column, 0).filter(|sefd| *sefd >= 0.0 && sefd.is_finite());
    let right = sefd("SEFD").unwrap_or(0.0);
    let mut station = Station::new(&name, position, right);
    // The centre of the Earth is what tables have of a station whose position nobody told.
    station.position = station.position.filter(|place| *place != [0.0; 3]);
    station.sefd[1] = sefd("SEFDL").unwrap_or(right);
    let code = table.number(row, "MNTSTA", 0).unwrap_or(0.0) as i32;
    let offset_deg = table.number(row, "POLAA", 0).filter(|angle| angle.is_finite()).unwrap_or(0.0);
    station.feed_rotation = mounts::rotation(&name, Mount { code, offset_deg });
    Ok(Some(station))
}

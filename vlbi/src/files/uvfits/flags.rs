//! Flags of the `AIPS FG` table (AIPS memo 117, table 20): which data are none.

use super::super::FileError;
use super::super::fits::{Table, Unit};
use super::layout::Place;

/// Properties of a group that a flag is compared with.
#[derive(Debug, Clone, Copy)]
pub struct Group {
    /// Parameters SOURCE and FREQSEL, where there are any.
    pub selected: [Option<i64>; 2],
    pub subarray: i64,
    pub antennas: [i64; 2],
    /// MJD in the file's own time.
    pub mjd: f64,
}

/// A row of the table; where it names nothing, all.
#[derive(Debug)]
pub struct Flag {
    selected: [Option<i64>; 2],
    /// True if all flags name the same one, which is that of groups that name none.
    is_only: [bool; 2],
    subarray: Option<i64>,
    antennas: [Option<i64>; 2],
    mjd: [f64; 2],
    /// First and last, counted from 0.
    bands: [usize; 2],
    channels: [usize; 2],
    /// Products, by their place on the axis STOKES.
    products: [bool; 4],
}

impl Flag {
    /// Returns whether it is about some data of a group.
    pub fn is_about(&self, group: &Group) -> bool {
        let is = |wanted: Option<i64>, found: Option<i64>| wanted.is_none() || wanted == found;
        let is_selected = |k: usize| {
            let found = group.selected[k];
            is(self.selected[k], found) || (found.is_none() && self.is_only[k])
        };
        let [first, second] = self.antennas;
        let has = |antenna: Option<i64>| antenna.is_none_or(|a| group.antennas.contains(&a));
        // A baseline of a station with itself is no pair of others that hold it.
        let is_pair = first.is_none() || first != second || group.antennas[0] == group.antennas[1];
        (0..2).all(is_selected)
            && is(self.subarray, Some(group.subarray))
            && (has(first) && has(second) && is_pair)
            && (self.mjd[0]..=self.mjd[1]).contains(&group.mjd)
    }

    /// Returns whether it is about a product of a channel of such a group.
    pub fn covers(&self, place: &Place, product: usize) -> bool {
        let within = |[first, last]: [usize; 2], at: usize| (first..=last).contains(&at);
        within(self.bands, place.band)
            && within(self.channels, place.channel)
            && self.products.get(product) == Some(&true)
    }
}

/// The flags of the table of the highest version, which AIPS applies unless told otherwise.
///
/// # Errors
/// If the table is damaged, or no date tells from when its times count.
pub fn read(units: &[Unit<'_>]) -> Result<Vec<Flag>, FileError> {
    let named = |unit: &&Unit<'_>| unit.is_named("AIPS FG");
    let version = |unit: &&Unit<'_>| unit.header.integer("EXTVER").ok().flatten();
    let Some(unit) = units.iter().filter(named).max_by_key(version) else { return Ok(Vec::new()) };
    let table = Table::new(unit)?;
    if table.rows() == 0 {
        return Ok(Vec::new());
    }
    let day = reference_day(units).ok_or_else(|| {
        units[0].header.error("DATE-OBS", "a date: times of flags (AIPS FG) count from it")
    })?;
    let mut flags: Vec<Flag> = (0..table.rows()).map(|row| flag(&table, row, day)).collect();
    let only = [0, 1].map(|k| {
        let mut named = flags.iter().filter_map(|flag| flag.selected[k]);
        let first = named.next();
        named.all(|other| Some(other) == first)
    });
    flags.iter_mut().for_each(|flag| flag.is_only = only);
    Ok(flags)
}

fn flag(table: &Table<'_>, row: usize, day: f64) -> Flag {
    let number = |name: &str, k: usize| table.number(row, name, k);
    let one_of = |name: &str, k: usize| number(name, k).map(|x| x as i64).filter(|x| *x > 0);
    let range = |name: &str| {
        let [first, last] = [0, 1].map(|k| one_of(name, k).map(|x| x as usize - 1));
        [first.unwrap_or(0), last.unwrap_or(usize::MAX)]
    };
    let ends = [f64::NEG_INFINITY, f64::INFINITY];
    let time = |k: usize| number("TIME RANGE", k).map_or(ends[k], |days| day + days);
    Flag {
        selected: [one_of("SOURCE", 0), one_of("FREQ ID", 0)],
        is_only: [false; 2],
        subarray: one_of("SUBARRAY", 0),
        antennas: [0, 1].map(|k| one_of("ANTS", k)),
        mjd: [time(0), time(1)],
        bands: range("IFS"),
        channels: range("CHANS"),
        products: [0, 1, 2, 3].map(|k| number("PFLAGS", k) != Some(0.0)),
    }
}

/// MJD of the day from which times of tables count: DATE-OBS of the data, or RDATE of the antennas.
fn reference_day(units: &[Unit<'_>]) -> Option<f64> {
    let of_data = units[0].header.text("DATE-OBS").and_then(|text| mjd(&text));
    let of_antennas = || units.iter().find_map(|unit| mjd(&unit.header.text("RDATE")?));
    of_data.or_else(of_antennas)
}

/// MJD of `YYYY-MM-DD`, or of `DD/MM/YY` in the 20th century.
fn mjd(date: &str) -> Option<f64> {
    let numbers = |text: &str, mark: char| {
        text.split(mark).map(|part| part.trim().parse().ok()).collect::<Option<Vec<i32>>>()
    };
    let day = date.split('T').next()?;
    let [year, month, day] = match numbers(day, '-').as_deref() {
        Some([year, month, day]) => [*year, *month, *day],
        _ => match numbers(day, '/').as_deref() {
            Some([day, month, year]) => [1900 + year, *month, *day],
            _ => return None,
        },
    };
    sofars::cal::cal2jd(year, month, day).ok().map(|(_, mjd)| mjd)
}

//! The `AIPS AN` table to be written (AIPS memo 117, section 4.1).

use super::super::fits::{Cards, ColumnData, binary_table};
use super::mounts::{self, Mount};
use crate::Error;
use crate::array::Station;
use crate::earth::{MJD_ZERO, tai_minus_utc, ut1_minus_utc};
use crate::observation::Channel;

/// The table of stations with geocentric positions, of an observation on a day.
///
/// # Errors
/// If feeds turn in a way that no code of a mount stands for.
pub fn table(
    stations: &[Station],
    mjd: i32,
    channels: &[Channel],
    frequency_hz: f64,
) -> Result<Vec<u8>, Error> {
    let mounts = stations.iter().map(mounts::of).collect::<Result<Vec<_>, _>>()?;
    let columns = columns(stations, &mounts);
    Ok(binary_table("AIPS AN", stations.len(), &columns, |cards| {
        header(cards, mjd, frequency_hz);
        cards.value("NO_IF", channels.len());
        // As many constants of leakage as the columns have: none. They have no type then.
        cards.value("NOPCAL", 0).text("POLTYPE", "").value("FREQID", 1);
    }))
}

/// A calendar date, as FITS has it; empty outside of the calendar.
pub fn calendar_date(mjd: i32) -> String {
    match sofars::cal::jd2cal(MJD_ZERO, mjd.into()) {
        Ok((year, month, day, _)) => format!("{year:04}-{month:02}-{day:02}"),
        Err(_) => String::new(),
    }
}

fn columns(
    stations: &[Station],
    mounts: &[Mount],
) -> [(&'static str, &'static str, ColumnData); 14] {
    let count = stations.len();
    let same = |letter: &str| ColumnData::Text(1, vec![letter.to_owned(); count]);
    let angle = |of: f64| {
        ColumnData::Singles(1, mounts.iter().map(|m| (m.offset_deg + of) as f32).collect())
    };
    let none = || ColumnData::Singles(0, Vec::new());
    let names: Vec<String> = stations.iter().map(|station| station.name.clone()).collect();
    // AIPS has 8 characters; longer names keep all of theirs.
    let width = names.iter().map(String::len).max().unwrap_or(0).max(8);
    let positions = stations.iter().flat_map(|s| s.position.unwrap_or_default()).collect();
    let sefd =
        |feed: usize| ColumnData::Doubles(1, stations.iter().map(|s| s.sefd[feed]).collect());
    [
        ("ANNAME", "", ColumnData::Text(width, names)),
        ("STABXYZ", "METERS", ColumnData::Doubles(3, positions)),
        ("ORBPARM", "", ColumnData::Doubles(0, Vec::new())),
        ("NOSTA", "", ColumnData::Integers(1, (1..).take(count).collect())),
        ("MNTSTA", "", ColumnData::Integers(1, mounts.iter().map(|mount| mount.code).collect())),
        ("STAXOF", "METERS", ColumnData::Singles(1, vec![0.0; count])),
        ("POLTYA", "", same("R")),
        ("POLAA", "DEGREES", angle(0.0)),
        ("POLCALA", "", none()),
        ("POLTYB", "", same("L")),
        ("POLAB", "DEGREES", angle(90.0)),
        ("POLCALB", "", none()),
        ("SEFD", "", sefd(0)),
        ("SEFDL", "", sefd(1)),
    ]
}

fn header(cards: &mut Cards, mjd: i32, frequency_hz: f64) {
    let day = f64::from(mjd);
    let ut1_utc = ut1_minus_utc(day).unwrap_or(0.0);
    // Terrestrial time would change the sidereal time by less than the format keeps.
    let (ut1, tt) = (day + ut1_utc / 86400.0, day + 69.0 / 86400.0);
    let sidereal = sofars::erst::gst06a(MJD_ZERO, ut1, MJD_ZERO, tt);
    cards.number("ARRAYX", 0.0).number("ARRAYY", 0.0).number("ARRAYZ", 0.0);
    cards.text("RDATE", &calendar_date(mjd)).number("GSTIA0", sidereal.to_degrees());
    cards.number("DEGPDY", 360.985_644_97).number("UT1UTC", ut1_utc).number("DATUTC", 0.0);
    if let Ok(seconds) = tai_minus_utc(mjd) {
        cards.number("IATUTC", seconds);
    }
    // The memo has both names. Difmap and CASA know the second one, and take times for TAI without it.
    cards.text("TIMESYS", "UTC").text("TIMSYS", "UTC").number("FREQ", frequency_hz);
    cards.number("POLARX", 0.0).number("POLARY", 0.0).text("ARRNAM", "VLBA");
    cards.text("XYZHAND", "RIGHT").text("FRAME", "ITRF").value("NUMORB", 0);
}

#[cfg(test)]
mod tests {
    use super::super::super::fits::{self, Table};
    use super::super::tests::observed;
    use super::super::write;
    use crate::earth::Frame;

    /// The bytes of a file, one scan at 10 h of MJD 57850.
    fn file(frame: Frame) -> Vec<u8> {
        write(&observed(frame, [10.0, 11.0], 1)).unwrap()
    }

    /// The file has what pyuvdata 3.2 complains of, what Difmap's reader asks for, and what was found wrong in other writers
    /// for it: no frame, times without TIMSYS (taken for TAI), an equinox that is no number, repeat counts that are not the
    /// numbers that the header states, mounts of 0 everywhere.
    #[test]
    fn code_readers_find_what_they_ask_for() {
        let bytes = file(Frame::Catalogue);
        let units = fits::units(&bytes).unwrap();
        let primary = &units[0].header;
        assert_eq!(primary.number("EQUINOX").unwrap(), Some(2000.0));
        assert_eq!(primary.number("EPOCH").unwrap(), Some(2000.0));
        let antennas = units.iter().find(|unit| unit.is_named("AIPS AN")).unwrap();
        let text = |key: &str| antennas.header.text(key);
        assert_eq!(text("FRAME").as_deref(), Some("ITRF"));
        assert_eq!(
            (text("TIMSYS").as_deref(), text("TIMESYS").as_deref()),
            (Some("UTC"), Some("UTC"))
        );
        assert_eq!(antennas.header.number("IATUTC").unwrap(), Some(37.0));
        assert_eq!(antennas.header.number("DATUTC").unwrap(), Some(0.0));
        assert_eq!(antennas.header.integer("NOPCAL").unwrap(), Some(0));
        assert_eq!(antennas.header.integer("NUMORB").unwrap(), Some(0));
        assert_eq!(text("POLTYPE").as_deref(), Some(""));
        for (column, form) in [("ORBPARM", "0D"), ("POLCALA", "0E"), ("POLCALB", "0E")] {
            let number = (1..=14).find(|k| text(&format!("TTYPE{k}")).as_deref() == Some(column));
            assert_eq!(
                text(&format!("TFORM{}", number.unwrap())).as_deref(),
                Some(form),
                "{column}"
            );
        }
        let table = Table::new(antennas).unwrap();
        let mounts: Vec<_> = (0..8).map(|row| table.number(row, "MNTSTA", 0).unwrap()).collect();
        // PV, SMT, SMA, LMT, ALMA, SPT, APEX, JCMT.
        assert_eq!(mounts, [5.0, 4.0, 5.0, 5.0, 0.0, 0.0, 4.0, 0.0]);
        let angles = |row| ["POLAA", "POLAB"].map(|name| table.number(row, name, 0).unwrap());
        assert_eq!((angles(2), angles(4)), ([45.0, 135.0], [-45.0, 45.0]));
    }

    /// (u, v, w) in metres that pyuvdata 3.2.8 makes of the stations and the time of a file
    /// (`set_uvws_from_antenna_positions`, its sign turned: it counts baselines from the second station). Its position
    /// angle of the sky is that of points half a degree apart, 1e-5 off here; it has polar motion, 0.4″.
    #[test]
    fn code_pyuvdata_baselines() {
        let bytes = file(Frame::OfDate);
        let units = fits::units(&bytes).unwrap();
        let header = &units[0].header;
        let layout = super::super::layout::Layout::new(header).unwrap();
        let size = layout.group_size * layout.number_size;
        let number = |group: &[u8], k: usize| {
            f64::from(f32::from_be_bytes(group[4 * k..][..4].try_into().unwrap()))
        };
        let group = units[0]
            .data
            .chunks_exact(size)
            .find(|group| number(group, 3) == 2.0 * 256.0 + 6.0)
            .unwrap();
        for (k, expected) in EXPECTED.into_iter().enumerate() {
            let scale = header.number(&format!("PSCAL{}", k + 1)).unwrap().unwrap();
            let metres = number(group, k) * scale * kerrlight_common::units::SPEED_OF_LIGHT;
            assert!((metres - expected).abs() < 1.2e-5 * 1.12e7, "{k}: {metres} {expected}");
        }
    }

    /// SMT and SPT.
    const EXPECTED: [f64; 3] = [-2_724_332.688_075, 10_805_864.180_600, -705_336.382_104];
}

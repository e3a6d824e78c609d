//! Frequencies of spectral channels: of the `FREQ` axis, and of the `AIPS FQ` table where there are
//! several IFs (AIPS memo 117, section 4.4).

use super::super::FileError;
use super::super::fits::{ColumnData, Table, Unit, binary_table};
use super::layout::Layout;
use super::selectors;
use crate::observation::Channel;

/// Frequencies of the channels of a layout, in its order, and whether IFs are without any of their
/// own.
pub fn channels(
    units: &[Unit<'_>],
    layout: &Layout,
    reference_hz: f64,
) -> Result<(Vec<Channel>, bool), FileError> {
    let places = &layout.channels;
    let header = &units[0].header;
    if places.len() > usize::from(u16::MAX) {
        return Err(header.error("NAXIS4", format!("{} channels are too many", places.len())));
    }
    let unit = units.iter().find(|unit| unit.is_named("AIPS FQ"));
    let table = unit.map(Table::new).transpose()?;
    let setup = selectors::only(&units[0], layout, "FREQSEL")?;
    let row = table.as_ref().and_then(|table| setup_row(table, setup));
    let bands = places.iter().map(|place| place.band + 1).max().unwrap_or(1);
    let cell = |name: &str, band: usize| table.as_ref().and_then(|t| t.number(row?, name, band));
    // One channel of one setup may lack an offset: it is at the reference frequency.
    if let (Some(table), Some(unit)) = (&table, unit)
        && (places.len() > 1 || table.rows() > 1)
        && (row.is_none() || (0..bands).any(|band| cell("IF FREQ", band).is_none()))
    {
        let message = format!(
            "AIPS FQ table: a row with IF FREQ of {bands} IFs for the data's FREQSEL is expected, {} rows found",
            table.rows()
        );
        return Err(FileError::byte(unit.offset, message));
    }
    let channel = |place: &super::layout::Place| {
        let width = cell("CH WIDTH", place.band).filter(|width| *width != 0.0);
        // Of a lower sideband frequencies fall.
        let lower = cell("SIDEBAND", place.band).is_some_and(|sideband| sideband < 0.0);
        let step = match width {
            Some(width) if lower => -width.abs(),
            Some(width) => width,
            None => layout.channel_width_hz,
        };
        let offset = (place.channel as f64 + 1.0 - layout.reference_channel) * step;
        let band = cell("IF FREQ", place.band).unwrap_or(0.0);
        Channel { frequency_hz: reference_hz + band + offset, bandwidth_hz: step.abs() }
    };
    let channels: Vec<Channel> = places.iter().map(channel).collect();
    match channels.iter().find(|c| !(1e6..=1e15).contains(&c.frequency_hz)) {
        Some(channel) => {
            let message = format!("a channel of {} Hz: not in [1e6, 1e15]", channel.frequency_hz);
            Err(header.error("CRVAL4", message))
        }
        None => Ok((channels, bands > 1 && table.is_none())),
    }
}

/// The row of the setup that the data have, or the only one.
fn setup_row(table: &Table<'_>, setup: Option<i64>) -> Option<usize> {
    let is_setup = |row: &usize| table.number(*row, "FRQSEL", 0) == setup.map(|k| k as f64);
    (0..table.rows()).find(is_setup).or((table.rows() == 1).then_some(0))
}

/// The `AIPS FQ` table of channels, each an IF of its own.
pub fn table(channels: &[Channel], reference_hz: f64) -> Vec<u8> {
    let n = channels.len();
    let widths = || channels.iter().map(|c| c.bandwidth_hz as f32).collect();
    let offsets = channels.iter().map(|c| c.frequency_hz - reference_hz).collect();
    let columns = [
        ("FRQSEL", "", ColumnData::Integers(1, vec![1])),
        ("IF FREQ", "HZ", ColumnData::Doubles(n, offsets)),
        ("CH WIDTH", "HZ", ColumnData::Singles(n, widths())),
        ("TOTAL BANDWIDTH", "HZ", ColumnData::Singles(n, widths())),
        ("SIDEBAND", "", ColumnData::Integers(n, vec![1; n])),
    ];
    binary_table("AIPS FQ", 1, &columns, |cards| {
        cards.value("NO_IF", n);
    })
}

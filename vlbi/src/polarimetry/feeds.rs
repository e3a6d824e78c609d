//! Rotation of feeds on the sky: φ = f_par·ψ + f_el·el + offset, with the parallactic angle ψ and the elevation.

use crate::Complex64;
use crate::Error;
use crate::array::{FeedRotation, Station};
use crate::earth::{Frame, View};
use crate::observation::{MissingMetadata, Observation};

/// Stations of 2017: EHT Collaboration 2021, ApJL 910, L12, table 1.
const FEEDS: &str = include_str!("feeds.csv");

/// Returns the rotation of the feeds of a station: what its file says; where that is nothing, as published for the
/// stations of 2017, or with the parallactic angle.
pub fn feed_rotation(station: &Station) -> FeedRotation {
    let with_sky = FeedRotation { parallactic: 1.0, ..FeedRotation::default() };
    station.feed_rotation.or_else(|| published_rotation(&station.name)).unwrap_or(with_sky)
}

/// Returns the rotation of the feeds of a station of 2017, as published; `None` of other names.
pub fn published_rotation(name: &str) -> Option<FeedRotation> {
    let lines = FEEDS.lines().filter(|line| !line.starts_with('#'));
    lines.filter_map(|line| known(line, name)).next()
}

/// The rotation that a line of the table gives for a name.
fn known(line: &str, name: &str) -> Option<FeedRotation> {
    let mut cells = line.split(',');
    let is_named = cells.next()?.split(' ').any(|known| known.eq_ignore_ascii_case(name));
    let mut number = || cells.next().and_then(|cell| cell.parse::<f64>().ok());
    let (parallactic, elevation, offset_deg) = (number()?, number()?, number()?);
    is_named.then_some(FeedRotation { parallactic, elevation, offset_deg })
}

/// e^{2iφ} of the feeds of both stations of each row, in the order of the rows.
///
/// # Errors
/// If the observation does not hold where the source and its stations are, or the day, or UT1 is not known then.
pub fn turns(observation: &Observation) -> Result<Vec<[Complex64; 2]>, Error> {
    let source = observation.position.ok_or(MissingMetadata("the position of the source"))?;
    let mjd = observation.mjd.ok_or(MissingMetadata("the day of the observation"))?;
    let positions: Vec<Option<[f64; 3]>> =
        observation.stations.iter().map(|station| station.position).collect();
    let rotations: Vec<FeedRotation> = observation.stations.iter().map(feed_rotation).collect();
    let mut all = Vec::with_capacity(observation.rows.len());
    let mut view_at = View::of_day(source, mjd, Frame::Catalogue);
    for row in &observation.rows {
        let view = view_at(row.time_h)?;
        let turn = |k: u16| {
            let position =
                positions[usize::from(k)].ok_or(MissingMetadata("positions of stations"))?;
            Ok::<_, Error>(turn(&view, position, rotations[usize::from(k)]))
        };
        all.push([turn(row.stations[0])?, turn(row.stations[1])?]);
    }
    Ok(all)
}

/// e^{2iφ} of a feed.
fn turn(view: &View, position: [f64; 3], rotation: FeedRotation) -> Complex64 {
    let FeedRotation { parallactic, elevation, offset_deg } = rotation;
    let degrees = parallactic * view.parallactic_deg(position)
        + elevation * view.elevation_deg(position)
        + offset_deg;
    Complex64::cis(2.0 * degrees.to_radians())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::array::built_in;

    #[test]
    fn exact_feeds_of_the_table_of_files_and_of_others() {
        let of = |name: &str| feed_rotation(&Station::named(name));
        let is = |parallactic, elevation, offset_deg| FeedRotation {
            parallactic,
            elevation,
            offset_deg,
        };
        assert_eq!(of("ALMA"), is(1.0, 0.0, -45.0));
        assert_eq!((of("AA"), of("lm")), (of("ALMA"), is(1.0, -1.0, 0.0)));
        assert_eq!(of("BAJA"), is(1.0, 0.0, 0.0));
        let mut own = Station::named("ALMA");
        own.feed_rotation = FeedRotation::told([0.0, 0.5, 0.0]);
        assert_eq!(feed_rotation(&own), is(0.0, 0.5, 0.0));
        // A feed that does not turn is another thing than one of which nothing is known.
        own.feed_rotation = Some(FeedRotation::default());
        assert_eq!(feed_rotation(&own), is(0.0, 0.0, 0.0));
        for station in built_in("EHT2017").unwrap().stations {
            let listed = FEEDS.lines().any(|line| known(line, &station.name).is_some());
            assert!(listed, "{}", station.name);
        }
    }
}

//! Rotation of feeds on the sky: φ = f_par·ψ + f_el·el + offset, with the parallactic angle ψ and the elevation.

use crate::Complex64;
use crate::Error;
use crate::array::{FeedRotation, Station};
use crate::earth::{Frame, Ut1, View};
use crate::observation::{Basis, MissingMetadata, Observation};

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

/// What eht-imaging says of products that turn with the feeds.
const TURNING: &str = "FRCAL: 0";

/// Returns whether the history says that products turn with the feeds.
pub fn is_turning(observation: &Observation) -> bool {
    observation.history.iter().any(|line| line == TURNING)
}

/// Takes the rotation of feeds out of products of circular feeds that the history says have it (`FRCAL: 0`), and says so there:
/// of RR the factor is e^{i(φ₁ − φ₂)}, of RL e^{i(φ₁ + φ₂)} (Smirnov 2011, A&A 527, A106). Only then is their mean Stokes I.
/// Returns whether it was there.
///
/// # Errors
/// If the rotation is there and [`turns`] fails.
pub fn derotate(observation: &mut Observation) -> Result<bool, Error> {
    if observation.basis != Basis::Circular || !is_turning(observation) {
        return Ok(false);
    }
    let angles = angles(observation)?;
    for (row, [a, b]) in observation.rows.iter_mut().zip(angles) {
        let by = [a - b, b - a, a + b, -(a + b)].map(Complex64::cis);
        row.products.iter_mut().zip(by).for_each(|(product, by)| *product *= by);
    }
    observation.history.retain(|line| line != TURNING);
    observation.history.push("rotation of feeds taken out".to_owned());
    Ok(true)
}

/// e^{2iφ} of the feeds of both stations of each row, in the order of the rows.
///
/// # Errors
/// If the observation does not hold where the source and its stations are, or the day.
pub fn turns(observation: &Observation) -> Result<Vec<[Complex64; 2]>, Error> {
    let turn = |angle: f64| Complex64::cis(2.0 * angle);
    Ok(angles(observation)?.into_iter().map(|pair| pair.map(turn)).collect())
}

/// φ of both stations of each row, radians.
fn angles(observation: &Observation) -> Result<Vec<[f64; 2]>, Error> {
    let source = observation.position.ok_or(MissingMetadata("the position of the source"))?;
    let mjd = observation.mjd.ok_or(MissingMetadata("the day of the observation"))?;
    let positions: Vec<Option<[f64; 3]>> =
        observation.stations.iter().map(|station| station.position).collect();
    let rotations: Vec<FeedRotation> = observation.stations.iter().map(feed_rotation).collect();
    let mut all = Vec::with_capacity(observation.rows.len());
    // Where UT1 is not known, angles are off by less than 15″: nothing beside errors of leakage.
    let ut1 = match Ut1::Table.seconds(f64::from(mjd)) {
        Ok(_) => Ut1::Table,
        Err(_) => Ut1::Given(0.0),
    };
    let mut view_at = View::of_day(source, mjd, ut1, Frame::Catalogue);
    for row in &observation.rows {
        let view = view_at(row.time_h)?;
        let turn = |k: u16| {
            let position =
                positions[usize::from(k)].ok_or(MissingMetadata("positions of stations"))?;
            Ok::<_, Error>(angle(&view, position, rotations[usize::from(k)]))
        };
        all.push([turn(row.stations[0])?, turn(row.stations[1])?]);
    }
    Ok(all)
}

/// φ of a feed, radians.
fn angle(view: &View, position: [f64; 3], rotation: FeedRotation) -> f64 {
    let FeedRotation { parallactic, elevation, offset_deg } = rotation;
    let degrees = parallactic * view.parallactic_deg(position)
        + elevation * view.elevation_deg(position)
        + offset_deg;
    degrees.to_radians()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::array::built_in;
    use crate::earth::SourcePosition;
    use crate::schedule::observe;
    use crate::schedule::tests::{SCHEDULE, SETUP};

    /// A feed turned by φ sees R e^{−iφ} and L e^{iφ}: of an unpolarised point of 1 Jy, RR of a baseline is e^{−i(φ₁ − φ₂)}. Taken
    /// out, all products are what the source makes them.
    #[test]
    fn exact_products_that_turn_are_turned_back() {
        let array = built_in("EHT2017").unwrap();
        let mut raw = observe(&array, SourcePosition::SGR_A, &SCHEDULE, &SETUP).unwrap();
        let one = Complex64::new(1.0, 0.0);
        let turned = |turn: Complex64| turn.sqrt();
        let turns = turns(&raw).unwrap();
        for (row, [a, b]) in raw.rows.iter_mut().zip(&turns) {
            // Up to a sign, which RR and LL share.
            let (r, l) = ([turned(*a).conj(), turned(*b).conj()], [turned(*a), turned(*b)]);
            row.products =
                [r[0] * r[1].conj(), l[0] * l[1].conj(), r[0] * l[1].conj(), l[0] * r[1].conj()];
        }
        raw.basis = Basis::Circular;
        raw.history = vec![TURNING.to_owned()];
        assert!(turns.iter().any(|[a, b]| (a * b.conj() - one).norm() > 1.0));
        assert!(derotate(&mut raw).unwrap() && !derotate(&mut raw).unwrap());
        for row in &raw.rows {
            let sign = row.products[0].re.signum();
            assert!(row.products[..2].iter().all(|v| (v - sign * one).norm() < 1e-9), "{row:?}");
            assert!(row.products[2..].iter().all(|v| (v - sign * one).norm() < 1e-9), "{row:?}");
        }
    }

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

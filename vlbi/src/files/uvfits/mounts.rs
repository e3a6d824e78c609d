//! Rotation of feeds, from codes of mounts (`MNTSTA`) and the angle of a feed (`POLAA`).

use super::super::FileError;
use crate::array::{FeedRotation, Station};
use crate::polarimetry::{feed_rotation, published_rotation};

/// Codes of AIPS memo 117, with the factors on parallactic angle and elevation: alt-azimuth, equatorial, and the
/// Nasmyth foci to the right and to the left.
const CODES: [(i32, [f64; 2]); 4] =
    [(0, [1.0, 0.0]), (1, [0.0, 0.0]), (4, [1.0, 1.0]), (5, [1.0, -1.0])];

/// Mount and feeds of a station, from the antenna table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mount {
    /// `MNTSTA`.
    pub code: i32,
    /// `POLAA`: the angle of the first feed.
    pub offset_deg: f64,
}

/// The mount of a station, from what is known of the rotation of its feeds.
///
/// # Errors
/// If no code has these factors.
pub fn of(station: &Station) -> Result<Mount, FileError> {
    let FeedRotation { parallactic, elevation, offset_deg } = feed_rotation(station);
    let code = CODES.iter().find(|(_, factors)| *factors == [parallactic, elevation]);
    let mount = code.map(|(code, _)| {
        // What would be read as nothing told is told as a full turn, which is none.
        let mount = Mount { code: *code, offset_deg };
        let read = Station { feed_rotation: rotation(&station.name, mount), ..station.clone() };
        let is_read = feed_rotation(&read) == feed_rotation(station);
        Mount { offset_deg: if is_read { offset_deg } else { offset_deg + 360.0 }, ..mount }
    });
    mount.ok_or_else(|| {
        FileError::whole(format!(
            "station {}: feeds that turn with {parallactic} times the parallactic angle and {elevation} times the \
             elevation: UVFITS has codes for 1 and 0, 0 and 0, 1 and 1, 1 and -1",
            station.name
        ))
    })
}

/// Returns the rotation of the feeds of a station with this mount; `None` where the file says nothing that is not
/// known from the name: published files have angles of 0, and many have mounts of 0, whatever the station is.
pub fn rotation(name: &str, mount: Mount) -> Option<FeedRotation> {
    let Mount { code, offset_deg } = mount;
    let (_, [parallactic, elevation]) = CODES.into_iter().find(|(known, _)| *known == code)?;
    let told = FeedRotation { parallactic, elevation, offset_deg };
    if told == (FeedRotation { parallactic: 1.0, ..FeedRotation::default() }) {
        return None;
    }
    let published = published_rotation(name);
    let without_angle = published.map(|known| FeedRotation { offset_deg: 0.0, ..known });
    (Some(told) != published && Some(told) != without_angle).then_some(told)
}

/// Returns whether a code stands for a mount whose feeds turn in a way that is known.
pub fn is_known(code: i32) -> bool {
    CODES.iter().any(|(known, _)| *known == code)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::array::built_in;

    /// The codes of the EHT's polarised files of 2017 (release 2024-D02-01): SMA, LMT and PV to the left, SMT and
    /// APEX to the right.
    #[test]
    fn paper_mounts_of_2017() {
        let stations = built_in("EHT2017").unwrap().stations;
        let code = |name: &str| of(stations.iter().find(|s| s.name == name).unwrap()).unwrap();
        for (name, expected, offset_deg) in [
            ("ALMA", 0, -45.0),
            ("JCMT", 0, 0.0),
            ("SPT", 0, 0.0),
            ("APEX", 4, 0.0),
            ("SMT", 4, 0.0),
            ("LMT", 5, 0.0),
            ("PV", 5, 0.0),
            ("SMA", 5, 45.0),
        ] {
            assert_eq!(code(name), Mount { code: expected, offset_deg }, "{name}");
        }
    }

    #[test]
    fn exact_what_a_file_says_and_what_it_does_not() {
        let read = |name: &str, code, offset_deg| {
            let rotation = rotation(name, Mount { code, offset_deg });
            feed_rotation(&Station { feed_rotation: rotation, ..Station::named(name) })
        };
        let is = |numbers| FeedRotation::told(numbers).unwrap();
        assert_eq!(read("SM", 5, 0.0), is([1.0, -1.0, 45.0]));
        assert_eq!(read("SM", 0, 0.0), is([1.0, -1.0, 45.0]));
        assert_eq!(read("SM", 5, 10.0), is([1.0, -1.0, 10.0]));
        assert_eq!(read("SM", 4, 0.0), is([1.0, 1.0, 0.0]));
        assert_eq!(read("XX", 4, 7.5), is([1.0, 1.0, 7.5]));
        assert_eq!(read("XX", 0, 0.0), is([1.0, 0.0, 0.0]));
        assert_eq!(read("XX", 1, 0.0), FeedRotation::default());
        assert!(rotation("XX", Mount { code: 3, offset_deg: 0.0 }).is_none() && !is_known(3));
        for station in built_in("EHT2017").unwrap().stations {
            assert_eq!(rotation(&station.name, of(&station).unwrap()), None, "{}", station.name);
        }
    }

    /// Feeds that stations of published names do not have come back, up to a full turn.
    #[test]
    fn exact_other_feeds_of_known_names_come_back() {
        for (name, told) in
            [("ALMA", [1.0, 0.0, 0.0]), ("SMA", [1.0, -1.0, 0.0]), ("PV", [1.0, 0.0, 0.0])]
        {
            let station =
                Station { feed_rotation: FeedRotation::told(told), ..Station::named(name) };
            let read = rotation(name, of(&station).unwrap()).unwrap();
            assert_eq!([read.parallactic, read.elevation, read.offset_deg % 360.0], told, "{name}");
        }
    }

    #[test]
    fn exact_factors_without_a_code_are_named() {
        let feed_rotation = FeedRotation::told([0.5, 1.0, 0.0]);
        let fail = of(&Station { feed_rotation, ..Station::named("XX") }).unwrap_err().to_string();
        assert!(fail.contains("station XX") && fail.contains("0.5 times"), "{fail}");
    }
}

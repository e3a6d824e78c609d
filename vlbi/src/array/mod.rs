//! Stations and arrays of them.

mod built_in;
mod text;

pub use built_in::{BUILT_IN, built_in};
pub use text::parse;
pub(super) use text::{HEADING, columns, station};

use super::Complex64;
use crate::Error;

/// Reason why there is no array, or why it is not fit for use.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ArrayError {
    /// A line of a text that is no station.
    #[error("line {line}: {message}")]
    Line {
        /// Counted from 1.
        line: usize,
        /// Reason for the refusal.
        message: String,
    },
    /// Fewer than two stations.
    #[error("{0} stations: an array needs at least 2")]
    TooFew(usize),
    /// More stations than a file can number.
    #[error("{0} stations: at most {MOST_STATIONS} are supported")]
    TooMany(usize),
    /// The same name twice.
    #[error("station {0} is listed twice")]
    Twice(String),
    /// A station that cannot observe.
    #[error("station {name}: {message}")]
    Unfit {
        /// Its name.
        name: String,
        /// Reason for the refusal.
        message: String,
    },
}

/// AIPS numbers the antennas of a baseline in 8 bits, 11 in its long form.
pub const MOST_STATIONS: usize = 2047;

/// Rotation of a feed on the sky: φ = parallactic·χ + elevation·el + offset.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FeedRotation {
    /// Factor on the parallactic angle.
    pub parallactic: f64,
    /// Factor on the elevation.
    pub elevation: f64,
    /// Constant part in degrees.
    pub offset_deg: f64,
}

impl FeedRotation {
    /// Takes its three numbers; `None` for three zeros, with which files and tables say that they do not know.
    pub fn told([parallactic, elevation, offset_deg]: [f64; 3]) -> Option<Self> {
        let rotation = Self { parallactic, elevation, offset_deg };
        (rotation != Self::default()).then_some(rotation)
    }

    /// Its three numbers; zeros where it is not known, hence a full turn of feeds that never turn.
    pub fn numbers(rotation: Option<Self>) -> [f64; 3] {
        match rotation {
            None => [0.0; 3],
            Some(still) if still == Self::default() => [0.0, 0.0, 360.0],
            Some(Self { parallactic, elevation, offset_deg }) => {
                [parallactic, elevation, offset_deg]
            }
        }
    }
}

/// A telescope.
#[derive(Debug, Clone, PartialEq)]
pub struct Station {
    /// Short name, without blanks.
    pub name: String,
    /// Geocentric ITRF position x, y, z in metres; `None` in files that do not hold it.
    pub position: Option<[f64; 3]>,
    /// System equivalent flux densities of the R and L feeds in Jy; 0 where a file holds none.
    pub sefd: [f64; 2],
    /// Least and greatest elevation in degrees at which it observes, where it has limits of its
    /// own.
    pub elevation_deg: Option<[f64; 2]>,
    /// Rotation of its feed in its file ([`feed_rotation`](super::polarimetry::feed_rotation) knows more).
    pub feed_rotation: Option<FeedRotation>,
    /// Leakage terms of the R and L feeds; carried along for files; simulations draw their own.
    pub leakage: [Complex64; 2],
}

impl Station {
    /// A station with equal feeds at `position` (ITRF metres) and an SEFD in Jy.
    pub fn new(name: &str, position: [f64; 3], sefd: f64) -> Self {
        let position = Some(position);
        Station { position, sefd: [sefd, sefd], ..Station::named(name) }
    }

    /// A station of which nothing but the name is known.
    pub fn named(name: &str) -> Self {
        Station {
            name: name.to_owned(),
            position: None,
            sefd: [0.0; 2],
            elevation_deg: None,
            feed_rotation: None,
            leakage: [Complex64::new(0.0, 0.0); 2],
        }
    }
}

/// Telescopes that observe together. Their order is that of baselines.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// The stations, names distinct.
    pub stations: Vec<Station>,
}

impl Array {
    /// An array of two or more stations with distinct names.
    ///
    /// # Errors
    /// If there are fewer, or too many, or names occur twice.
    pub fn new(stations: Vec<Station>) -> Result<Self, Error> {
        if stations.len() < 2 {
            return Err(ArrayError::TooFew(stations.len()).into());
        }
        if stations.len() > MOST_STATIONS {
            return Err(ArrayError::TooMany(stations.len()).into());
        }
        let mut names: Vec<&str> = stations.iter().map(|s| s.name.as_str()).collect();
        names.sort_unstable();
        match names.windows(2).find(|pair| pair[0] == pair[1]) {
            Some(pair) => Err(ArrayError::Twice(pair[0].to_owned()).into()),
            None => Ok(Array { stations }),
        }
    }

    /// Geocentric positions in metres.
    ///
    /// # Errors
    /// If a station has none, or stands at the centre of the Earth: orbits of spacecraft are not supported.
    pub fn positions(&self) -> Result<Vec<[f64; 3]>, Error> {
        Ok(self.stations.iter().map(position).collect::<Result<_, _>>()?)
    }
}

/// Coordinates of a station on the Earth or near it, metres.
const FARTHEST: f64 = 1e9;

/// The radius of the Earth, polar and equatorial with mountains, in kilometres.
const EARTH_KM: core::ops::Range<f64> = 6350.0..6390.0;

/// Refuses a position that cannot be one in metres.
///
/// # Errors
/// If a coordinate is beyond 1e9 m, or the distance from the Earth's centre is the radius of the Earth in kilometres.
pub fn check_position(name: &str, position: [f64; 3]) -> Result<(), ArrayError> {
    let unfit = |message: String| Err(ArrayError::Unfit { name: name.to_owned(), message });
    if let Some(far) = position.iter().find(|x| !(-FARTHEST..=FARTHEST).contains(*x)) {
        return unfit(format!("{far:e} m is not allowed: [-{FARTHEST:e}, {FARTHEST:e}]"));
    }
    let radius = kerrlight_geodesic::vector::norm(position);
    if EARTH_KM.contains(&radius) {
        return unfit(format!(
            "{radius:.0} m from the centre of the Earth: kilometres? metres are expected"
        ));
    }
    Ok(())
}

fn position(station: &Station) -> Result<[f64; 3], ArrayError> {
    let unfit = |message: &str| {
        Err(ArrayError::Unfit { name: station.name.clone(), message: message.to_owned() })
    };
    match station.position {
        None => unfit("its position is not known"),
        Some([0.0, 0.0, 0.0]) => {
            unfit("position 0 0 0 marks a spacecraft: orbits are not supported")
        }
        Some(position) => Ok(position),
    }
}

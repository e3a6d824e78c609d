//! A source, and the baselines that it sees.

use super::{Moment, Ut1};
use crate::Error;
use core::f64::consts::PI;
use kerrlight_common::units::SPEED_OF_LIGHT;
use kerrlight_geodesic::vector::dot;

/// Position of a source: catalogue coordinates (ICRS, J2000).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SourcePosition {
    /// Right ascension in hours, in \[0, 24).
    pub ra_hours: f64,
    /// Declination in degrees, in \[−90, 90\].
    pub dec_deg: f64,
}

impl SourcePosition {
    /// Sagittarius A*, as eht-imaging's scripts for the EHT have it.
    pub const SGR_A: Self =
        SourcePosition { ra_hours: 17.761_121_055_553_343, dec_deg: -29.007_843_055_56 };
    /// Messier 87*: 12h30m49.42338s +12°23′28.0439″ (ICRF).
    pub const M87: Self =
        SourcePosition { ra_hours: 12.513_728_716_666_667, dec_deg: 12.391_123_305_555_556 };

    /// A position: right ascension in hours, declination in degrees.
    ///
    /// # Errors
    /// If it is not.
    pub fn new(ra_hours: f64, dec_deg: f64) -> Result<Self, Error> {
        if !(0.0..24.0).contains(&ra_hours) {
            let allowed = "hours in [0, 24)";
            return Err(Error::out_of_range("right ascension", ra_hours, allowed));
        }
        if !(-90.0..=90.0).contains(&dec_deg) {
            let allowed = "degrees in [-90, 90]";
            return Err(Error::out_of_range("declination", dec_deg, allowed));
        }
        Ok(SourcePosition { ra_hours, dec_deg })
    }
}

/// Earth-orientation model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Frame {
    /// Catalogue coordinates as if they were of date, and mean sidereal time, as eht-imaging has it.
    #[default]
    Catalogue,
    /// Precession and nutation to date (IAU 2006/2000A) and the annual aberration, u and v along east
    /// and north of the ICRS; without polar motion (below 0.5″) and without the aberration's change of scale
    /// (1 − v·s/c, up to 1e-4 of u and v).
    OfDate,
}

/// The Earth at one instant, seen from a source.
#[derive(Debug, Clone, Copy)]
pub struct View {
    east: [f64; 3],
    north: [f64; 3],
    towards: [f64; 3],
}

type Matrix = [[f64; 3]; 3];

impl View {
    /// The view at a moment.
    ///
    /// # Errors
    /// If the day is out of range or its UT1 − UTC not known.
    pub fn new(
        source: SourcePosition,
        moment: Moment,
        ut1: Ut1,
        frame: Frame,
    ) -> Result<Self, Error> {
        match frame {
            Frame::Catalogue => Ok(Self::at_gmst(source, super::gmst_hours(moment, ut1)?)),
            Frame::OfDate => {
                let [ut1, tt] = moment.ut1_tt(ut1)?;
                let matrix = sofars::pnp::c2t06a(tt.0, tt.1, ut1.0, ut1.1, 0.0, 0.0);
                // Aberration before the turn to the Earth: the velocity has the axes of the ICRS.
                let sky = Self::sky(source, source.ra_hours * PI / 12.0);
                Ok(sky.seen_at(earth_velocity(tt)).turned(&matrix))
            }
        }
    }

    /// Makes views at hours of UTC of a day: those that follow each other at one time are made once.
    pub(crate) fn of_day(
        source: SourcePosition,
        mjd: i32,
        ut1: Ut1,
        frame: Frame,
    ) -> impl FnMut(f64) -> Result<Self, Error> {
        let mut last: Option<(f64, Self)> = None;
        move |hours_utc| match last {
            Some((hours, view)) if hours == hours_utc => Ok(view),
            _ => {
                let view = Self::new(source, Moment { mjd, hours_utc }, ut1, frame)?;
                last = Some((hours_utc, view));
                Ok(view)
            }
        }
    }

    /// The view at a Greenwich sidereal time in hours, of a source with coordinates of date.
    pub fn at_gmst(source: SourcePosition, gmst_hours: f64) -> Self {
        // The source's longitude east of Greenwich.
        Self::sky(source, (source.ra_hours - gmst_hours) * PI / 12.0)
    }

    /// Directions in a frame in which the source has the longitude `angle`.
    fn sky(source: SourcePosition, angle: f64) -> Self {
        let (sin_a, cos_a) = angle.sin_cos();
        let (sin_d, cos_d) = (source.dec_deg * PI / 180.0).sin_cos();
        View {
            east: [-sin_a, cos_a, 0.0],
            north: [-sin_d * cos_a, -sin_d * sin_a, cos_d],
            towards: [cos_d * cos_a, cos_d * sin_a, sin_d],
        }
    }

    /// Returns the view of an observer who moves with this velocity (c = 1, its square neglected): the three
    /// directions turned together, along the great circle towards the motion.
    fn seen_at(self, velocity: [f64; 3]) -> Self {
        let part = |axis| dot(axis, velocity);
        let [east, north] = [part(self.east), part(self.north)];
        let sum = |a: [f64; 3], by: f64, b: [f64; 3]| core::array::from_fn(|k| a[k] + by * b[k]);
        View {
            east: sum(self.east, -east, self.towards),
            north: sum(self.north, -north, self.towards),
            towards: sum(sum(self.towards, east, self.east), north, self.north),
        }
    }

    fn turned(self, matrix: &Matrix) -> Self {
        let turn = |vector: [f64; 3]| core::array::from_fn(|k| dot(matrix[k], vector));
        View { east: turn(self.east), north: turn(self.north), towards: turn(self.towards) }
    }

    /// (u, v) in wavelengths of a pair of positions (metres), first minus second.
    pub fn uv(&self, first: [f64; 3], second: [f64; 3], wavelength: f64) -> [f64; 2] {
        let [u, v, _] = self.uvw(first, second, wavelength);
        [u, v]
    }

    /// The same and w, which is positive where the first station is nearer to the source.
    pub fn uvw(&self, first: [f64; 3], second: [f64; 3], wavelength: f64) -> [f64; 3] {
        let baseline = core::array::from_fn(|k| (first[k] - second[k]) / wavelength);
        [self.east, self.north, self.towards].map(|axis| dot(baseline, axis))
    }

    /// Elevation of the source in degrees above the plane normal to the geocentric position.
    pub fn elevation_deg(&self, position: [f64; 3]) -> f64 {
        let sine = dot(position, self.towards) / dot(position, position).sqrt();
        sine.clamp(-1.0, 1.0).asin() * 180.0 / PI
    }

    /// Parallactic angle of the source in degrees: from north to the zenith, towards east, with the zenith along the
    /// geocentric position. It is positive where the source is west of the meridian of a place north of it.
    pub fn parallactic_deg(&self, position: [f64; 3]) -> f64 {
        dot(position, self.east).atan2(dot(position, self.north)) * 180.0 / PI
    }
}

/// Velocity of the Earth in the barycentric frame over that of light, at a two-part date of TT; 0 after
/// 2100, where the IAU's series end.
fn earth_velocity(tt: (f64, f64)) -> [f64; 3] {
    /// Light takes so many days to 1 au (IAU 2012, B2).
    const DAYS_PER_AU: f64 = 149_597_870_700.0 / SPEED_OF_LIGHT / 86400.0;
    let velocity =
        sofars::eph::epv00(tt.0, tt.1).map_or([0.0; 3], |(_, barycentric)| barycentric[1]);
    velocity.map(|au_per_day| au_per_day * DAYS_PER_AU)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// tan ψ = cos φ sin H/(sin φ cos δ − cos φ sin δ cos H), of a place at longitude 0 and latitude φ.
    #[test]
    fn exact_parallactic_angle_of_an_hour_angle() {
        let source = SourcePosition::new(3.0, 12.4).unwrap();
        let (latitude, dec) = (28f64.to_radians(), 12.4f64.to_radians());
        for hour_angle in [-5.0f64, -1.0, 0.5, 4.0] {
            // At longitude 0 the local sidereal time is that of Greenwich.
            let view = View::at_gmst(source, 3.0 + hour_angle);
            let (sin, cos) = (hour_angle * PI / 12.0).sin_cos();
            let north = latitude.sin() * dec.cos() - latitude.cos() * dec.sin() * cos;
            let expected = (latitude.cos() * sin).atan2(north).to_degrees();
            let found = view.parallactic_deg([latitude.cos(), 0.0, latitude.sin()]);
            assert!((found - expected).abs() < 1e-10, "{hour_angle} h: {found} {expected}");
            assert!(found * hour_angle > 0.0);
        }
    }

    const FREQUENCY: f64 = 226_191_789_062.5;

    fn position(name: &str) -> [f64; 3] {
        let array = crate::array::built_in("EHT2017").unwrap();
        array.stations.iter().find(|s| s.name == name).unwrap().position.unwrap()
    }

    /// eht-imaging 1.3.2, EHT2017, Sgr A*, 4 h UTC of MJD 57850.
    #[test]
    fn code_ehtim_baselines() {
        let moment = Moment { mjd: 57850, hours_utc: 4.0 };
        let view = View::new(SourcePosition::SGR_A, moment, Ut1::Table, Frame::Catalogue).unwrap();
        let wavelength = SPEED_OF_LIGHT / FREQUENCY;
        for (first, second, u, v) in [
            ("ALMA", "APEX", 8.420_521_01e5, -1.483_092_59e6),
            ("ALMA", "PV", -3.403_783_81e9, -5.542_729_57e9),
        ] {
            let [found_u, found_v] = view.uv(position(first), position(second), wavelength);
            assert!((found_u - u).abs() < 1e-8 * u.hypot(v), "{first}-{second}: {found_u}");
            assert!((found_v - v).abs() < 1e-8 * u.hypot(v), "{first}-{second}: {found_v}");
        }
    }

    /// A source at the zenith of a station has its elevation of 90°, and 0 a quarter turn on.
    #[test]
    fn exact_zenith_and_horizon() {
        let source = SourcePosition::new(3.0, 0.0).unwrap();
        let station = [6.4e6, 0.0, 0.0];
        assert!((View::at_gmst(source, 3.0).elevation_deg(station) - 90.0).abs() < 1e-6);
        assert!(View::at_gmst(source, 9.0).elevation_deg(station).abs() < 1e-6);
        // East of Greenwich the source has set earlier: a station there sees it lower at 6 h.
        let [u, v] = View::at_gmst(source, 3.0).uv([0.0, 1.0, 1.0], [0.0; 3], 1.0);
        assert!((u - 1.0).abs() < 1e-12 && (v - 1.0).abs() < 1e-12);
    }

    /// 17 years of precession turn Sgr A*'s baselines by a few thousandths.
    #[test]
    fn code_erfa_precession_is_small_and_not_zero() {
        let moment = Moment { mjd: 57850, hours_utc: 10.0 };
        let view = |frame| View::new(SourcePosition::SGR_A, moment, Ut1::Table, frame).unwrap();
        let uvw = |frame| view(frame).uvw(position("ALMA"), position("PV"), 1.3e-3);
        let (a, b) = (uvw(Frame::Catalogue), uvw(Frame::OfDate));
        let change = (a[0] - b[0]).hypot(a[1] - b[1]) / a[0].hypot(a[1]);
        assert!((1e-4..6e-3).contains(&change), "{change}");
        // pyerfa 2.0: c2t06a with the same UT1 − UTC, applied to what `ab` makes of ICRS east, north and the source
        // at the velocity of `epv00`. The square of that velocity is 1e-8.
        let expected = [-2_910_753_346.000_347, -2_554_756_235.437_571, 5_386_292_970.629_505];
        for (found, expected) in b.iter().zip(expected) {
            assert!((found - expected).abs() < 70.0, "{found} {expected}");
        }
    }

    #[test]
    fn exact_positions_out_of_range() {
        assert!(SourcePosition::new(24.0, 0.0).is_err());
        assert!(SourcePosition::new(1.0, -90.1).is_err());
        assert!(SourcePosition::new(f64::NAN, 0.0).is_err());
    }
}

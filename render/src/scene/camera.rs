//! A camera at a finite radius, at rest or on a path through keyframes.

use super::Scene;
use super::invalid::{Invalid, number};
use crate::Error;
use kerrlight_geodesic::{Camera, Inclination, Kerr, Motion};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A table of a camera's place, direction and lens, with more fields before them: unknown keys
/// are refused, which serde's `flatten` cannot.
macro_rules! pose_table {
    ($(#[$doc:meta])* $name:ident { $($more:tt)* }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        pub struct $name {
            $($more)*
            /// Boyer–Lindquist radius, M, outside the horizon.
            #[schemars(range(min = 1.0, max = 1e6), extend("unit" = "M"))]
            pub radius: Option<f64>,
            /// Polar angle, degrees.
            #[schemars(range(min = 0.0, max = 180.0), extend("unit" = "degrees"))]
            pub theta_deg: Option<f64>,
            /// Azimuth, degrees; 720 is a second turn.
            #[schemars(range(min = -1e6, max = 1e6), extend("unit" = "degrees"))]
            pub phi_deg: Option<f64>,
            /// Width of the field of a pinhole lens, degrees.
            #[schemars(range(min = 1e-6, max = 170.0), extend("unit" = "degrees"))]
            pub field_of_view_deg: Option<f64>,
            /// Turn to the right, away from the hole, degrees.
            #[schemars(range(min = -1e6, max = 1e6), extend("unit" = "degrees"))]
            pub yaw_deg: Option<f64>,
            /// Then upwards, degrees.
            #[schemars(range(min = -1e6, max = 1e6), extend("unit" = "degrees"))]
            pub pitch_deg: Option<f64>,
            /// Then clockwise about the line of sight, degrees.
            #[schemars(range(min = -1e6, max = 1e6), extend("unit" = "degrees"))]
            pub roll_deg: Option<f64>,
        }

        impl $name {
            fn given(&self) -> [Option<f64>; 7] {
                [
                    self.radius,
                    self.theta_deg,
                    self.phi_deg,
                    self.field_of_view_deg,
                    self.yaw_deg,
                    self.pitch_deg,
                    self.roll_deg,
                ]
            }
        }
    };
}

pose_table! {
    /// A camera: how it moves, and what of its pose does not change from key to key.
    CameraConfig {
        /// Motion of the camera's frame, for aberration and Doppler shift.
        pub motion: CameraMotion,
        /// Keyframes in order of time.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        pub key: Vec<CameraKey>,
    }
}

pose_table! {
    /// A keyframe. A quantity that some keys leave out passes smoothly through those that give it.
    CameraKey {
        /// Coordinate time, M.
        #[schemars(range(min = -1e9, max = 1e9), extend("unit" = "M"))]
        pub time: f64,
    }
}

/// The motion of the camera's frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum CameraMotion {
    /// Rest with respect to infinity.
    Static,
    /// No angular momentum.
    Zamo,
    /// Circular geodesic of its radius.
    Keplerian,
    /// Falling from rest at infinity.
    FreeFall,
    /// Motion along the keyframes.
    Path,
}

/// The quantities of a pose, in the order of [`Pose`].
const NAMES: [&str; 7] =
    ["radius", "theta_deg", "phi_deg", "field_of_view_deg", "yaw_deg", "pitch_deg", "roll_deg"];

/// A camera's place, direction and lens at one time, and their rates: values in the order
/// radius (M), θ, φ, field of view, yaw, pitch, roll (degrees).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// The values.
    pub values: [f64; 7],
    /// Their rates per M.
    pub rates: [f64; 7],
}

impl Pose {
    /// Width of the field on the picture plane at distance 1.
    pub fn plane_width(&self) -> f64 {
        2.0 * (0.5 * self.values[3].to_radians()).tan()
    }
}

impl CameraConfig {
    /// The pose at `time` (M): each quantity runs through the keys that give it, and stays
    /// what it is before the first and after the last of them. NaN where nothing gives it.
    pub fn pose(&self, time: f64) -> Pose {
        let fixed = self.given();
        let mut pose = Pose { values: [0.0; 7], rates: [0.0; 7] };
        for (k, given) in fixed.into_iter().enumerate() {
            let knots: Vec<[f64; 2]> =
                self.key.iter().filter_map(|key| Some([key.time, key.given()[k]?])).collect();
            // The camera looks at the hole unless it is turned away.
            let otherwise = given.unwrap_or(if k < 4 { f64::NAN } else { 0.0 });
            [pose.values[k], pose.rates[k]] = monotone_cubic(&knots, time, otherwise);
        }
        pose
    }

    /// The camera at `time` (M).
    ///
    /// # Errors
    /// If nothing can be there or move like that.
    pub fn camera(&self, hole: &Kerr, time: f64) -> Result<Camera, Error> {
        let Pose { values, rates } = self.pose(time);
        let [radius, theta, phi, _, yaw, pitch, roll] = values;
        let place = Inclination::from_degrees(theta)?;
        let named = |motion| Camera::new(hole, place, radius, motion);
        let camera = match self.motion {
            CameraMotion::Static => named(Motion::Static),
            CameraMotion::Zamo => named(Motion::Zamo),
            CameraMotion::Keplerian => named(Motion::Keplerian),
            CameraMotion::FreeFall => named(Motion::FreeFall),
            CameraMotion::Path => {
                let rates = [rates[0], rates[1].to_radians(), rates[2].to_radians()];
                Camera::moving(hole, place, radius, rates)
            }
        }?;
        let [yaw, pitch, roll] = [yaw, pitch, roll].map(f64::to_radians);
        Ok(camera.with_azimuth(phi.to_radians()).with_pointing(yaw, pitch, roll))
    }

    /// First and last time of the keys, M.
    pub fn span(&self) -> Option<[f64; 2]> {
        Some([self.key.first()?.time, self.key.last()?.time])
    }
}

/// Value and slope at `x` of the cubic through `knots` (x, y) that is monotone between them
/// (Steffen 1990, A&A 239, 443): a camera's radius never undershoots that of its keys, and
/// velocities are continuous. Constant outside the knots; `otherwise` without any.
fn monotone_cubic(knots: &[[f64; 2]], x: f64, otherwise: f64) -> [f64; 2] {
    let (Some(first), Some(last)) = (knots.first(), knots.last()) else { return [otherwise, 0.0] };
    if x < first[0] || knots.len() == 1 {
        return [first[1], 0.0];
    }
    if x > last[0] {
        return [last[1], 0.0];
    }
    // The last knot belongs to the piece before it.
    let k = knots.partition_point(|knot| knot[0] <= x).clamp(1, knots.len() - 1) - 1;
    let [x0, y0] = knots[k];
    let width = knots[k + 1][0] - x0;
    let secant = (knots[k + 1][1] - y0) / width;
    let (m0, m1) = (steffen_slope(knots, k), steffen_slope(knots, k + 1));
    let t = x - x0;
    let cubic = (m0 + m1 - 2.0 * secant) / (width * width);
    let square = (3.0 * secant - 2.0 * m0 - m1) / width;
    [y0 + t * (m0 + t * (square + t * cubic)), m0 + t * (2.0 * square + 3.0 * t * cubic)]
}

/// The slope at knot `k`: that of the parabola through it and its neighbours, as far as it is
/// monotone (Steffen 1990, eqs. 11, 24, 26).
fn steffen_slope(knots: &[[f64; 2]], k: usize) -> f64 {
    let secant = |j: usize| (knots[j + 1][1] - knots[j][1]) / (knots[j + 1][0] - knots[j][0]);
    let width = |j: usize| knots[j + 1][0] - knots[j][0];
    let last = knots.len() - 1;
    if last == 1 {
        return secant(0);
    }
    if k > 0 && k < last {
        let sign = |x: f64| f64::from(i8::from(x > 0.0) - i8::from(x < 0.0));
        let (s0, s1, h0, h1) = (secant(k - 1), secant(k), width(k - 1), width(k));
        let parabola = (s0 * h1 + s1 * h0) / (h0 + h1);
        let least = s0.abs().min(s1.abs()).min(0.5 * parabola.abs());
        return (sign(s0) + sign(s1)) * least;
    }
    let (near, next) = if k == 0 { (0, 1) } else { (last - 1, last - 2) };
    let (s, h, h_next) = (secant(near), width(near), width(next));
    let share = h / (h + h_next);
    let parabola = s * (1.0 + share) - secant(next) * share;
    if parabola * s <= 0.0 {
        0.0
    } else if parabola.abs() > 2.0 * s.abs() {
        2.0 * s
    } else {
        parabola
    }
}

/// Checks a scene that has a camera.
pub(super) fn check(scene: &Scene) -> Result<(), Invalid> {
    let Some(camera) = &scene.camera else { return Ok(()) };
    check_rivals(scene)?;
    check_keys(camera)?;
    let Ok(hole) = Kerr::new(scene.hole.spin) else { return Ok(()) };
    let time = scene.observer.time;
    if let Some([from, to]) = camera.span() {
        let allowed = format!("a time of the camera's keys, in [{from}, {to}]");
        number("observer.time", time, (from..=to).contains(&time), &allowed)?;
    }
    for time in moments(camera, time) {
        camera.camera(&hole, time).map_err(|error| impossible(camera, time, &error))?;
    }
    Ok(())
}

/// Refuses keys whose place a camera takes.
fn check_rivals(scene: &Scene) -> Result<(), Invalid> {
    let (observer, screen) = (&scene.observer, &scene.screen);
    let rivals = [
        ("observer.inclination_deg", Some(observer.inclination_deg).filter(|x| !x.is_nan())),
        ("observer.azimuth_deg", Some(observer.azimuth_deg).filter(|x| *x != 0.0)),
        ("observer.radius", Some(observer.radius).filter(|x| x.is_finite())),
        ("screen.field_of_view_m", screen.field_of_view_m),
        ("screen.field_of_view_uas", screen.field_of_view_uas),
        ("screen.total_flux_jy", screen.total_flux_jy),
    ];
    for (key, value) in rivals {
        let allowed = "not allowed with a `[camera]`, which has its own position and lens";
        number(key, value.unwrap_or(0.0), value.is_none(), allowed)?;
    }
    Ok(())
}

/// Keys in order, no quantity given twice, none that is needed missing.
fn check_keys(camera: &CameraConfig) -> Result<(), Invalid> {
    for (k, pair) in camera.key.windows(2).enumerate() {
        let allowed = format!("a time after that of the key before it, {}", pair[0].time);
        let ok = pair[1].time > pair[0].time;
        number(format!("camera.key.{}.time", k + 1), pair[1].time, ok, &allowed)?;
    }
    if camera.motion == CameraMotion::Path && camera.key.len() < 2 {
        let why = "motion = \"path\" needs at least two `[[camera.key]]`";
        return Err(Invalid::missing("camera.key", why));
    }
    for (j, name) in NAMES.iter().enumerate() {
        let keyed = camera.key.iter().any(|key| key.given()[j].is_some());
        match camera.given()[j] {
            Some(value) if keyed => {
                let allowed = "not allowed where keys give it as well";
                return Err(Invalid::new(format!("camera.{name}"), value, allowed));
            }
            None if !keyed && j < 4 => {
                let why = "give it in `[camera]` or in its keys";
                return Err(Invalid::missing(format!("camera.{name}"), why));
            }
            _ => {}
        }
    }
    Ok(())
}

/// Times at which the camera must be possible: the scene's own, and many along its path.
fn moments(camera: &CameraConfig, time: f64) -> impl Iterator<Item = f64> {
    const A_PIECE: usize = 32;
    let pieces = camera.key.windows(2).flat_map(|pair| {
        let step = (pair[1].time - pair[0].time) / A_PIECE as f64;
        (0..=A_PIECE).map(move |k| pair[0].time + step * k as f64)
    });
    pieces.chain([time])
}

fn impossible(camera: &CameraConfig, time: f64, error: &Error) -> Invalid {
    let key = if camera.key.is_empty() { "camera.radius" } else { "camera.key" };
    let (field, value) = (error.field().unwrap_or_default(), error.value().unwrap_or_default());
    let allowed = format!("{} (at time {time})", error.allowed().unwrap_or_default());
    Invalid::new(key, format!("{field} {value}"), allowed)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera of each name is one of that motion, and of no other.
    #[test]
    fn exact_motions_are_those_of_their_names() {
        let hole = Kerr::new(0.8).unwrap();
        let place = Inclination::from_degrees(70.0).unwrap();
        let named = [
            ("static", Motion::Static),
            ("zamo", Motion::Zamo),
            ("keplerian", Motion::Keplerian),
            ("free-fall", Motion::FreeFall),
        ];
        for (name, _) in named {
            let pose = "radius = 12.0\ntheta_deg = 70.0\nfield_of_view_deg = 40.0";
            let config: CameraConfig =
                toml::from_str(&format!("motion = \"{name}\"\n{pose}")).unwrap();
            let found = config.camera(&hole, 0.0).unwrap();
            for (other, motion) in named {
                let camera = Camera::new(&hole, place, 12.0, motion).unwrap();
                // Of light from one side, which each motion shifts otherwise.
                let shifts = [&found, &camera].map(|camera| camera.blueshift([0.6, 0.64, 0.48]));
                let is_same = (shifts[0] / shifts[1] - 1.0).abs() < 1e-12;
                assert_eq!(is_same, name == other, "{name} as {other}: {shifts:?}");
            }
        }
    }

    /// Steffen's conditions: through the knots, monotone, straight where they are on a line.
    #[test]
    fn exact_monotone_cubic() {
        let knots = [[0.0, 10.0], [1.0, 4.0], [4.0, 3.9], [5.0, 3.9], [7.0, 8.0]];
        for [x, y] in knots {
            assert!((monotone_cubic(&knots, x, 0.0)[0] - y).abs() < 1e-13);
        }
        for k in 0..700 {
            let x = 0.01 * f64::from(k);
            let [y, slope] = monotone_cubic(&knots, x, 0.0);
            assert!((3.9 - 1e-12..=10.0).contains(&y), "{x}: {y}");
            let h = 1e-6;
            let between = |x| monotone_cubic(&knots, x, 0.0)[0];
            let difference = (between(x + h) - between(x + 2.0 * h)) / -h;
            assert!((difference - slope).abs() < 1e-3, "{x}: {slope} {difference}");
        }
        let line = [[0.0, 0.0], [1.0, 2.0], [5.0, 10.0]];
        for x in [0.0, 0.3, 0.999, 2.5, 5.0] {
            let [y, slope] = monotone_cubic(&line, x, 0.0);
            assert!((y - 2.0 * x).abs() < 1e-13 && (slope - 2.0).abs() < 1e-13);
        }
        assert_eq!(monotone_cubic(&line, 6.0, 0.0), [10.0, 0.0]);
        assert_eq!(monotone_cubic(&[], 6.0, 3.0), [3.0, 0.0]);
    }
}

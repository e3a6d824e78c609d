//! Gaussian hot spots on Keplerian orbits about any axis.
//!
//! Positions are r n in Boyer–Lindquist coordinates taken as Cartesian, as in BH-NeRF
//! (Levis et al. 2022). About an axis ξ matter turns with Ω(r) = 1/(r^{3/2} + a ξ_z): the
//! geodesic rate for ξ = ±z, the paper's for a = 0, and in between a model.

use crate::scene::Spot;
use kerrlight_geodesic::Kerr;
use kerrlight_geodesic::vector::{cross, distance, norm, rotate};

/// Radius at which a spot's light is cut off, in units of its σ: exp(−6²/2) = 1.5e-8.
pub const CUT_OFF: f64 = 6.0;

/// A spot around one hole, ready to be evaluated.
#[derive(Debug, Clone)]
pub struct SpotModel {
    axis: [f64; 3],
    /// Centre at time 0.
    start: [f64; 3],
    orbit: f64,
    /// a ξ_z.
    drag: f64,
    sigma: f64,
    peak: f64,
    sheared_since: Option<f64>,
    /// Linear colour in R, G and B, dimensionless.
    pub color: [f32; 3],
}

impl SpotModel {
    /// A spot of a scene.
    pub fn new(spot: &Spot, hole: &Kerr) -> Self {
        let norm = norm(spot.axis);
        let axis = spot.axis.map(|x| x / norm);
        let (sin, cos) = spot.phase_deg.to_radians().sin_cos();
        let start = tip(axis, [cos * spot.radius, sin * spot.radius, 0.0]);
        SpotModel {
            axis,
            start,
            orbit: spot.radius,
            drag: hole.spin() * axis[2],
            sigma: spot.sigma,
            peak: spot.peak_emissivity,
            sheared_since: spot.sheared_since,
            color: spot.color,
        }
    }

    /// 2σ over the radius of the orbit: samples of a Gaussian so far apart have its integral to 1.4 %.
    pub fn relative_size(&self) -> f64 {
        2.0 * self.sigma / self.orbit
    }

    /// Angular velocity of the orbit at radius r.
    fn rate(&self, r: f64) -> f64 {
        1.0 / (r * r.sqrt() + self.drag)
    }

    /// Angular velocity vector of the spot's matter at radius r.
    pub fn angular_velocity(&self, r: f64) -> [f64; 3] {
        self.axis.map(|x| x * self.matter_rate(r))
    }

    /// Angular velocity of the spot's matter at radius r.
    fn matter_rate(&self, r: f64) -> f64 {
        // A rigid spot turns as a whole, at the rate of its centre.
        self.rate(if self.sheared_since.is_some() { r } else { self.orbit })
    }

    /// Returns the centre at `time`, both in M.
    pub fn center(&self, time: f64) -> [f64; 3] {
        rotate(self.axis, self.rate(self.orbit) * time, self.start)
    }

    /// The angle by which matter with an angular velocity has turned at `time` since the spot had
    /// its shape at its starting point.
    fn turned(&self, rate: f64, time: f64) -> f64 {
        match self.sheared_since {
            None => rate * time,
            Some(since) => rate * (time - since) + self.rate(self.orbit) * since,
        }
    }

    /// The point `x` at `time` carried along with the matter to where the spot is a round
    /// Gaussian about its starting point.
    pub fn comoving(&self, x: [f64; 3], time: f64) -> Comoving {
        let angle = self.turned(self.matter_rate(norm(x)), time);
        Comoving { position: rotate(self.axis, -angle, x), angle }
    }

    /// A bound of the length in M of a short piece of path in comoving coordinates: its chord
    /// and what differential rotation adds.
    pub fn comoving_length(&self, ends: [[f64; 3]; 2], carried: [&Comoving; 2]) -> f64 {
        let reach = ends.map(norm);
        let wound = (carried[0].angle - carried[1].angle).abs();
        distance(ends[0], ends[1]) + reach[0].max(reach[1]) * wound
    }

    /// Returns the length (M) that differential rotation adds to a piece of path in comoving coordinates. The
    /// angles by which time and by which radius make matter turn do not cancel.
    pub fn sheared_length(&self, [a, b]: [MatterPoint; 2]) -> f64 {
        let by_time = (a.rate * (a.time - b.time)).abs();
        let by_radius =
            self.sheared_since.map_or(0.0, |since| (a.rate - b.rate) * (b.time - since));
        a.radius.max(b.radius) * (by_time + by_radius.abs())
    }

    /// Matter at radius r and at `time`, both in M.
    pub fn matter_at(&self, radius: f64, time: f64) -> MatterPoint {
        MatterPoint { radius, time, rate: self.matter_rate(radius) }
    }

    /// The point `x` (M) carried along with its matter, as in [`comoving`](Self::comoving).
    pub fn carried(&self, x: [f64; 3], at: &MatterPoint) -> [f64; 3] {
        rotate(self.axis, -self.turned(at.rate, at.time), x)
    }

    /// Distance in M of a point carried along with the matter from the spot's centre.
    pub fn offset(&self, carried: [f64; 3]) -> f64 {
        distance(carried, self.start)
    }

    /// A lower bound of that distance at a radius and a height z, all in M.
    pub fn least_offset(&self, radius: f64, z: f64) -> f64 {
        // About z matter keeps its height, and the centre is in the plane.
        let above = if self.axis[0] == 0.0 && self.axis[1] == 0.0 { z.abs() } else { 0.0 };
        (radius - self.orbit).abs().max(above)
    }

    /// Returns the largest ratio of the length of a piece of a ray within the spot's shell in the coordinates r n
    /// to that in the affine parameter. (|dx/dσ|² = 1 + B w³ + … of `transport::chord`, where B w² ≤ 2/(1 − 2w)
    /// next to the turning point, and frame dragging.)
    pub fn stretch(&self) -> f64 {
        let w = 1.0 / self.shell()[0];
        if w < 0.25 { 1.2 * (1.0 + 2.0 * w / (1.0 - 2.0 * w)).sqrt() } else { f64::INFINITY }
    }

    /// Distance in M from its centre at which its light is cut off.
    pub fn reach(&self) -> f64 {
        CUT_OFF * self.sigma
    }

    /// Emissivity in scene units per M, in the gas frame, at a point carried along with the matter, at `time` (M).
    pub fn emissivity(&self, carried: &Comoving, time: f64) -> f64 {
        if self.sheared_since.is_some_and(|since| time < since) {
            return 0.0;
        }
        let offset = distance(carried.position, self.start);
        let square = (offset / self.sigma).powi(2);
        if square > CUT_OFF * CUT_OFF { 0.0 } else { self.peak * (-0.5 * square).exp() }
    }

    /// Angles by which matter has turned at the times from..to and at the radii of a shell: the
    /// least and the largest. (At every radius the angle is linear in time, at every time it is
    /// monotonic in radius: extremes are at the corners.)
    pub(super) fn turned_between(
        &self,
        [inner, outer]: [f64; 2],
        [from, to]: [f64; 2],
    ) -> [f64; 2] {
        if self.sheared_since.is_none() {
            let rate = self.rate(self.orbit);
            let (a, b) = (rate * from, rate * to);
            return [a.min(b), a.max(b)];
        }
        let corners = [(inner, from), (inner, to), (outer, from), (outer, to)];
        let angles = corners.map(|(r, time)| self.turned(self.rate(r), time));
        if angles.iter().any(|angle| !angle.is_finite()) {
            return [f64::NEG_INFINITY, f64::INFINITY];
        }
        let most = angles.into_iter().fold(f64::NEG_INFINITY, f64::max);
        [angles.into_iter().fold(f64::INFINITY, f64::min), most]
    }

    /// Coordinate speed of the centre, in units of c.
    pub fn speed(&self) -> f64 {
        self.orbit * self.rate(self.orbit).abs()
    }

    /// Returns the time since when it is sheared.
    pub(crate) fn sheared_since(&self) -> Option<f64> {
        self.sheared_since
    }

    /// Centre before it has turned, axis and radius of the orbit.
    pub(super) fn orbit(&self) -> ([f64; 3], [f64; 3], f64) {
        (self.start, self.axis, self.orbit)
    }

    /// Returns whether a piece of path with these ends and this length, all in comoving coordinates, misses the
    /// spot.
    pub fn is_missed(&self, carried: [&Comoving; 2], length: f64) -> bool {
        let [a, b] = carried.map(|c| c.position);
        let middle = core::array::from_fn(|k| 0.5 * (a[k] + b[k]));
        // No point is farther from the middle of the ends than half the length; the length is that of chords.
        distance(middle, self.start) > CUT_OFF * self.sigma + 0.6 * length
    }

    /// The shell of radii (M) outside of which it does not shine.
    pub fn shell(&self) -> [f64; 2] {
        let reach = CUT_OFF * self.sigma;
        [(self.orbit - reach).max(0.0), self.orbit + reach]
    }

    /// Standard deviation σ of its Gaussian, M.
    pub fn sigma(&self) -> f64 {
        self.sigma
    }
}

/// A point carried along with a spot's matter.
#[derive(Debug, Clone, Copy)]
pub struct Comoving {
    position: [f64; 3],
    /// The angle by which it was carried.
    angle: f64,
}

/// Matter at a radius and a time.
#[derive(Debug, Clone, Copy)]
pub struct MatterPoint {
    /// Radius, M.
    pub radius: f64,
    /// Time, M.
    pub time: f64,
    /// Angular velocity of a spot's matter there.
    rate: f64,
}

/// `x` under the shortest rotation that takes z to the unit vector `axis`; for −z the half
/// turn about x.
fn tip(axis: [f64; 3], x: [f64; 3]) -> [f64; 3] {
    let normal = cross([0.0, 0.0, 1.0], axis);
    let sin = norm(normal);
    if sin == 0.0 {
        return if axis[2] > 0.0 { x } else { [x[0], -x[1], -x[2]] };
    }
    rotate(normal.map(|c| c / sin), sin.atan2(axis[2]), x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_geodesic::vector::{difference, dot};

    fn spot(axis: [f64; 3], sheared_since: Option<f64>) -> SpotModel {
        let config = Spot {
            radius: 6.0,
            phase_deg: 30.0,
            axis,
            sigma: 0.5,
            peak_emissivity: 2.0,
            sheared_since,
            color: [1.0; 3],
        };
        SpotModel::new(&config, &Kerr::new(0.5).unwrap())
    }

    #[test]
    fn exact_orbit() {
        let s = spot([0.0, 0.0, 2.0], None);
        let rate = 1.0 / (6f64.powf(1.5) + 0.5);
        for time in [0.0, 10.0, -300.0] {
            let angle = 30f64.to_radians() + rate * time;
            let expected = [6.0 * angle.cos(), 6.0 * angle.sin(), 0.0];
            let offset = difference(s.center(time), expected);
            assert!(dot(offset, offset) < 1e-24);
            assert!((s.emissivity(&s.comoving(expected, time), time) - 2.0).abs() < 1e-12);
        }
        // About −z: the other way round, faster, as retrograde orbits are.
        assert!(
            (spot([0.0, 0.0, -1.0], None).rate(6.0) - 1.0 / (6f64.powf(1.5) - 0.5)).abs() < 1e-15
        );
    }

    #[test]
    fn exact_orbits_stay_in_their_plane() {
        let s = spot([1.0, -2.0, 0.5], None);
        for time in [0.0, 33.0, 200.0] {
            let c = s.center(time);
            assert!(dot(c, s.axis).abs() < 1e-12);
            assert!((norm(c) - 6.0).abs() < 1e-12);
        }
    }

    /// Shear moves light along its circle of constant radius: at the orbit's own radius
    /// nothing changes.
    #[test]
    fn exact_shear_leaves_the_orbit_alone() {
        let (rigid, sheared) = (spot([0.0, 0.0, 1.0], None), spot([0.0, 0.0, 1.0], Some(-50.0)));
        let time = 20.0;
        let on_orbit = rotate([0.0, 0.0, 1.0], 0.05, rigid.center(time));
        let at = |s: &SpotModel, x, time| s.emissivity(&s.comoving(x, time), time);
        assert!((at(&rigid, on_orbit, time) - at(&sheared, on_orbit, time)).abs() < 1e-12);
        assert_eq!(at(&sheared, sheared.center(-60.0), -60.0), 0.0);
        let inside = rigid.center(time).map(|x| x * 0.92);
        assert!(at(&sheared, inside, time) < 0.9 * at(&rigid, inside, time));
    }

    #[test]
    fn exact_nothing_shines_where_a_piece_is_missed() {
        for s in [spot([0.3, 0.2, 1.0], None), spot([0.3, 0.2, 1.0], Some(-80.0))] {
            assert_eq!(s.shell(), [3.0, 9.0]);
            for k in 0..400 {
                let x = f64::from(k);
                let a = [9.0 * (0.7 * x).cos(), 8.0 * (1.3 * x).sin(), 3.0 * (0.37 * x).sin()];
                let b = [a[0] + 0.3 * x.sin(), a[1] + 0.3 * (2.0 * x).cos(), a[2] - 0.2];
                let ends = [s.comoving(a, 3.0), s.comoving(b, 3.5)];
                let carried = [&ends[0], &ends[1]];
                if s.is_missed(carried, s.comoving_length([a, b], carried)) {
                    for step in 0..=20 {
                        let t = f64::from(step) / 20.0;
                        let p = core::array::from_fn(|k| a[k] + t * (b[k] - a[k]));
                        let time = 3.0 + 0.5 * t;
                        assert_eq!(s.emissivity(&s.comoving(p, time), time), 0.0);
                    }
                }
            }
        }
    }
}

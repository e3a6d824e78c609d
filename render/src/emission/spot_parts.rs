//! Parts of a hot spot's orbit from which it can shine at all, with boxes around them.
//!
//! A part holds the points that matter of some radii reaches after having turned by some angles.
//! A rigid spot is one shell of radii; of a sheared one every radius turns by its own angle, so it
//! is cut into several.

use super::spot::{CUT_OFF, SpotModel};
use core::f64::consts::{PI, TAU};
use kerrlight_geodesic::vector::{cross, difference, dot};

/// A part of the places that a spot can shine from.
#[derive(Debug, Clone, Copy)]
pub struct SpotPart {
    /// Number of the spot.
    pub spot: u32,
    /// Radii.
    radii: [f64; 2],
    /// Angles by which matter has turned since its start, within one turn of the first.
    angles: [f64; 2],
}

/// Sheared spots are cut into shells until matter of one is spread over less than this angle.
const SPREAD: f64 = 0.7;

/// Most shells of a sheared spot.
const MOST_SHELLS: f64 = 24.0;

/// Rounding of angles.
const ROUNDING: f64 = 1e-9;

impl SpotModel {
    /// Cuts spot number `number` into parts outside the horizon: where it is between two times, or
    /// without them its whole orbit. A turn is cut into at most `most` parts; shells are as thin as
    /// they have to be around `time`.
    pub fn parts(
        &self,
        number: u32,
        horizon: f64,
        when: Option<[f64; 2]>,
        time: f64,
        most: f64,
        parts: &mut Vec<SpotPart>,
    ) {
        let [low, high] = self.shell();
        let low = low.max(horizon);
        let since = self.sheared_since().unwrap_or(f64::NEG_INFINITY);
        if low >= high || when.is_some_and(|[_, to]| to < since) {
            return;
        }
        // Shear grows with time: shells that are thin enough at the end are so before.
        let around = when.map_or(time, |[_, to]| to);
        let [least, largest] = self.turned_between([low, high], [around, around]);
        let shells = ((largest - least) / SPREAD).ceil().clamp(1.0, MOST_SHELLS);
        let width = (high - low) / shells;
        for k in 0..shells as u32 {
            let inner = low + width * f64::from(k);
            let radii = [inner, inner + width];
            let turned = when.map(|[from, to]| self.turned_between(radii, [from.max(since), to]));
            self.cut(number, radii, turned, most, parts);
        }
    }

    /// Cuts one shell into arcs that are about as long as they are thick.
    fn cut(
        &self,
        spot: u32,
        radii: [f64; 2],
        turned: Option<[f64; 2]>,
        most: f64,
        parts: &mut Vec<SpotPart>,
    ) {
        let thick = self.thickness(radii);
        // Arcs of 2 `thick`, as far across as along.
        let step = TAU / (PI * self.middle(radii) / thick).ceil().clamp(4.0, most.max(4.0));
        // The whole turn where the angles are wound up over more than it, or not known.
        let [from, to] = turned.filter(|[a, b]| b - a < TAU).unwrap_or([0.0, TAU]);
        let count = ((to - from) / step).ceil().max(1.0);
        let width = (to - from) / count;
        for k in 0..count as u32 {
            let start = from + width * f64::from(k);
            parts.push(SpotPart { spot, radii, angles: [start, start + width] });
        }
    }

    /// The radius of the circle along which a shell's matter is taken to lie.
    fn middle(&self, [inner, outer]: [f64; 2]) -> f64 {
        let (_, _, orbit) = self.orbit();
        // A rigid spot is a ball about its centre.
        if self.sheared_since().is_none() { orbit } else { 0.5 * (inner + outer) }
    }

    /// Largest distance of the spot's matter at some radii from the point at radius m below (or
    /// above) its centre, before it has turned. With R the orbit, ρ the cut-off, γ the angle from
    /// the centre: R² + r² − 2rR cos γ ≤ ρ², so that
    /// r² + m² − 2rm cos γ ≤ r²(1 − m/R) + m² − mR + mρ²/R, monotonic in r.
    fn thickness(&self, radii: [f64; 2]) -> f64 {
        let (_, _, orbit) = self.orbit();
        let (reach, m) = (CUT_OFF * self.sigma(), self.middle(radii));
        let square = |r: f64| r * r * (1.0 - m / orbit) + m * (m - orbit + reach * reach / orbit);
        radii.map(square).into_iter().fold(0.0, f64::max).sqrt()
    }

    /// The box around a part, M.
    pub fn bounds(&self, part: &SpotPart) -> [[f64; 3]; 2] {
        let (start, axis, orbit) = self.orbit();
        let scale = self.middle(part.radii) / orbit;
        let swirl = cross(axis, start);
        let reach = self.thickness(part.radii) * (1.0 + ROUNDING) + ROUNDING * orbit;
        let extremes: [[f64; 2]; 3] =
            core::array::from_fn(|k| arc_extremes(scale * start[k], scale * swirl[k], part.angles));
        [extremes.map(|[low, _]| low - reach), extremes.map(|[_, high]| high + reach)]
    }

    /// Returns whether the spot can shine from a part of it at some moment between two times.
    pub fn shines_from(&self, part: &SpotPart, [from, to]: [f64; 2]) -> bool {
        let since = self.sheared_since().unwrap_or(f64::NEG_INFINITY);
        if to < since {
            return false;
        }
        let [a, b] = self.turned_between(part.radii, [from.max(since), to]);
        let [c, d] = part.angles;
        // Angles of many turns have lost digits of the last one.
        let rounding = ROUNDING + 4.0 * f64::EPSILON * a.abs().max(b.abs());
        // Two arcs meet where one of them begins within the other.
        let (wide, own) = (b - a + rounding, d - c + rounding);
        // Not finite where rates are not: then it may.
        wide.is_nan()
            || wide >= TAU
            || (c - a).rem_euclid(TAU) <= wide
            || (a - c).rem_euclid(TAU) <= own
    }

    /// Returns whether it can come within `epsilon` of a chord between two times: a rigid spot's
    /// ball and the way that its centre makes. (Of a sheared one its parts say all.)
    pub fn comes_near(&self, [a, b]: [[f64; 3]; 2], epsilon: f64, [from, to]: [f64; 2]) -> bool {
        if self.sheared_since().is_some() {
            return true;
        }
        // From its place in the middle of the time the centre moves by no more than this.
        let way = 0.5 * self.speed() * (to - from);
        let center = self.center(0.5 * (from + to));
        let (along, offset) = (difference(b, a), difference(center, a));
        let part = (dot(offset, along) / dot(along, along)).clamp(0.0, 1.0);
        // A chord without length makes 0/0.
        let part = if part.is_nan() { 0.0 } else { part };
        let miss: [f64; 3] = core::array::from_fn(|k| offset[k] - part * along[k]);
        let reach = CUT_OFF * self.sigma() + way + epsilon;
        dot(miss, miss) <= reach * reach * (1.0 + ROUNDING)
    }
}

/// Least and largest value of p cos θ + q sin θ between two angles at most a turn apart.
fn arc_extremes(p: f64, q: f64, [from, to]: [f64; 2]) -> [f64; 2] {
    let at = |angle: f64| p * angle.cos() + q * angle.sin();
    let (peak, size) = (q.atan2(p), p.hypot(q));
    let passes = |angle: f64| (angle - from).rem_euclid(TAU) <= to - from;
    let (a, b) = (at(from), at(to));
    let high = if passes(peak) { size } else { a.max(b) };
    let low = if passes(peak + PI) { -size } else { a.min(b) };
    [low, high]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Spot;
    use kerrlight_geodesic::Kerr;
    use kerrlight_geodesic::vector::rotate;

    fn spot(axis: [f64; 3], sigma: f64, sheared_since: Option<f64>) -> SpotModel {
        let config = Spot {
            radius: 7.0,
            phase_deg: 40.0,
            axis,
            sigma,
            peak_emissivity: 1.0,
            sheared_since,
            color: [1.0; 3],
        };
        SpotModel::new(&config, &Kerr::new(0.9).unwrap())
    }

    /// Wherever a spot shines there is a part of it that says so and whose box holds the point.
    #[test]
    fn exact_parts_cover_the_spot() {
        let horizon = Kerr::new(0.9).unwrap().horizon();
        let mut lit = 0;
        for axis in [[0.0, 0.0, 1.0], [0.5, -0.3, 0.2], [0.0, 0.0, -1.0]] {
            for sigma in [0.05, 0.4, 1.3] {
                for since in [None, Some(-30.0), Some(-900.0)] {
                    let spot = spot(axis, sigma, since);
                    for time in [-500.0, -3.0, 11.0, 100.0] {
                        let [mut now, mut soon, mut ever] = [(); 3].map(|()| Vec::new());
                        spot.parts(0, horizon, Some([time; 2]), time, 64.0, &mut now);
                        spot.parts(
                            0,
                            horizon,
                            Some([time - 2.0, time + 1.0]),
                            time,
                            64.0,
                            &mut soon,
                        );
                        spot.parts(0, horizon, None, 20.0, 64.0, &mut ever);
                        for k in 0..300 {
                            let x = f64::from(k);
                            let (start, _, orbit) = spot.orbit();
                            let off = [x.sin(), (1.7 * x).cos(), (2.3 * x).sin()]
                                .map(|c| 2.9 * sigma * c);
                            let rest: [f64; 3] = core::array::from_fn(|k| start[k] + off[k]);
                            let r = dot(rest, rest).sqrt();
                            let [angle, _] = spot.turned_between([r, r], [time, time]);
                            let point = rotate(spot.orbit().1, angle, rest);
                            let shines = spot.emissivity(&spot.comoving(point, time), time) > 0.0;
                            if !shines || r < horizon {
                                continue;
                            }
                            lit += 1;
                            for parts in [&now, &soon, &ever] {
                                let holds = |part: &&SpotPart| {
                                    let [low, high] = spot.bounds(part);
                                    let inside =
                                        (0..3).all(|k| (low[k]..=high[k]).contains(&point[k]));
                                    inside && spot.shines_from(part, [time, time])
                                };
                                assert!(
                                    parts.iter().any(|p| holds(&p)),
                                    "{axis:?} {sigma} {since:?} {time} {orbit}"
                                );
                            }
                        }
                    }
                }
            }
        }
        assert!(lit > 10_000, "{lit}");
    }

    /// Boxes are no larger than they have to be: a spot at one time is one ball.
    #[test]
    fn exact_rigid_spot_is_its_ball() {
        let spot = spot([0.1, 0.2, 1.0], 0.3, None);
        let mut parts = Vec::new();
        spot.parts(3, 1.5, Some([25.0; 2]), 0.0, 64.0, &mut parts);
        assert_eq!(parts.len(), 1);
        let ([low, high], center) = (spot.bounds(&parts[0]), spot.center(25.0));
        for k in 0..3 {
            assert!(
                (high[k] - center[k] - 1.8).abs() < 1e-6 && (center[k] - low[k] - 1.8).abs() < 1e-6
            );
        }
    }
}

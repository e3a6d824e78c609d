//! A function on a square that is nearly a plane, and the strata between its level lines.

/// A plane over the unit square about the origin.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    middle: f64,
    slope: [f64; 2],
    /// Distance of the function from it.
    bend: f64,
}

/// Strata with less than this share of the square are joined with the next one.
const LEAST: f64 = 5e-4;

/// More strata than this are of no use: the square is too large for its picture.
const MOST: f64 = 400.0;

impl Plane {
    /// Interpolates the values at the centre and at the corners, from the lower left to the upper right.
    pub fn through(middle: f64, [a, b, c, d]: [f64; 4]) -> Self {
        let slope = [0.5 * ((b - a) + (d - c)), 0.5 * ((c - a) + (d - b))];
        let mean = 0.25 * (a + b + c + d);
        let bend = (mean - middle).abs().max(0.25 * (a - b - c + d).abs());
        // `max` drops a NaN: the last term brings it back for `is_finite`.
        Plane { middle, slope, bend: bend + 0.0 * mean }
    }

    pub fn is_finite(&self) -> bool {
        self.bend.is_finite() && self.middle.is_finite()
    }

    /// Half of the range of its values.
    pub fn reach(&self) -> f64 {
        0.5 * (self.slope[0].abs() + self.slope[1].abs())
    }

    /// Returns whether the function is no plane, even if it may be `slack` times as far from one as usual.
    pub fn is_bent(&self, slack: f64) -> bool {
        self.bend > 0.1 * slack * self.reach()
    }

    /// Returns whether the function may vanish on the square.
    pub fn is_near(&self, corners: [f64; 4]) -> bool {
        let other = corners.iter().any(|value| (*value > 0.0) != (self.middle > 0.0));
        other || self.middle.abs() < self.reach() + self.bend
    }

    /// Places with their shares of the square, between level lines that are equidistant (by `spacing`
    /// at most) in asinh(value/core).
    pub fn strata(&self, core: f64, spacing: f64) -> Vec<([f64; 2], f64)> {
        let reach = self.reach();
        let ends = [self.middle - reach, self.middle + reach];
        let [low, high] = ends.map(|value| (value / core).asinh());
        let count = ((high - low) / spacing).ceil();
        if count.is_nan() || count <= 1.0 {
            return vec![([0.0; 2], 1.0)];
        }
        let count = count.min(MOST);
        let level = |k: f64| core * (low + (high - low) * (k / count)).sinh();
        let mut strata: Vec<([f64; 2], f64)> = Vec::with_capacity(count as usize);
        let (mut from, mut below) = (ends[0], 0.0);
        for k in 1..=count as u32 {
            let last = f64::from(k) >= count;
            let to = if last { ends[1] } else { level(f64::from(k)) };
            let up_to = if last { 1.0 } else { self.below(to) };
            let share = up_to - below;
            if share < LEAST {
                match strata.last_mut() {
                    // The last one has no next.
                    Some(before) if last => before.1 += share,
                    _ => {}
                }
                continue;
            }
            strata.push((self.on_level(0.5 * (from + to)), share));
            (from, below) = (to, up_to);
        }
        strata
    }

    /// Share of the square in which its value is below `value`.
    fn below(&self, value: f64) -> f64 {
        let [p, q] = self.slope.map(f64::abs);
        let (wide, narrow) = (p.max(q), p.min(q));
        let up = (value - self.middle + 0.5 * (p + q)).clamp(0.0, p + q);
        if up < narrow {
            0.5 * up * up / (wide * narrow)
        } else if up <= wide {
            (up - 0.5 * narrow) / wide
        } else {
            let left = p + q - up;
            1.0 - if left > 0.0 { 0.5 * left * left / (wide * narrow) } else { 0.0 }
        }
    }

    /// The middle of the line on which it has a value, inside the square.
    fn on_level(&self, value: f64) -> [f64; 2] {
        let rest = value - self.middle;
        let steep = usize::from(self.slope[1].abs() > self.slope[0].abs());
        let (wide, narrow) = (self.slope[steep], self.slope[1 - steep]);
        let mut ends = [-0.5, 0.5];
        if narrow != 0.0 {
            let crossed = [(rest - 0.5 * wide) / narrow, (rest + 0.5 * wide) / narrow];
            let [low, high] = [crossed[0].min(crossed[1]), crossed[0].max(crossed[1])];
            ends = [low, high].map(|end| end.clamp(-0.5, 0.5));
        }
        let along = 0.5 * (ends[0] + ends[1]);
        let mut place = [along; 2];
        place[steep] = ((rest - narrow * along) / wide).clamp(-0.5, 0.5);
        place
    }

    /// The step from a place to where the function, whose value there is `height`, is what the plane says.
    pub fn step(&self, place: [f64; 2], height: f64) -> [f64; 2] {
        let [p, q] = self.slope;
        let off = self.middle + p * place[0] + q * place[1] - height;
        let scale = off / (p * p + q * q);
        if !scale.is_finite() {
            return [0.0; 2];
        }
        [p, q].map(|slope| (slope * scale).clamp(-0.25, 0.25))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(middle: f64, slope: [f64; 2]) -> Plane {
        Plane { middle, slope, bend: 0.0 }
    }

    /// Shares add up to the square, and a linear function has its mean, to second order in the width of strata.
    #[test]
    fn exact_strata_of_a_square() {
        for slope in [[1.0, 0.0], [0.0, -2.0], [0.7, 0.7], [-3.0, 0.2], [1e-9, 1.0]] {
            for middle in [0.0, 0.1, -0.4, 3.0] {
                let plane = plane(middle, slope);
                let strata = plane.strata(0.01 * plane.reach(), 0.1);
                let sum: f64 = strata.iter().map(|(_, share)| share).sum();
                assert!((sum - 1.0).abs() < 1e-12, "{slope:?} {middle}: {sum}");
                let widest = strata.iter().map(|(_, share)| *share).fold(0.0, f64::max);
                for c in 0..2 {
                    let mean: f64 = strata.iter().map(|(place, share)| place[c] * share).sum();
                    assert!(mean.abs() < widest * widest, "{slope:?} {middle}: {mean}");
                    assert!(strata.iter().all(|(place, _)| place[c].abs() <= 0.5));
                }
            }
        }
    }

    /// The share below a level is the area of a triangle in the corner and of half a square.
    #[test]
    fn exact_shares() {
        let diagonal = plane(0.0, [1.0, 1.0]);
        assert!((diagonal.below(-0.5) - 0.125).abs() < 1e-15);
        assert!((diagonal.below(0.0) - 0.5).abs() < 1e-15);
        assert!((diagonal.below(0.5) - 0.875).abs() < 1e-15);
        assert!((plane(2.0, [0.0, -4.0]).below(3.0) - 0.75).abs() < 1e-15);
    }
}

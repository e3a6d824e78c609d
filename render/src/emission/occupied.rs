//! Bricks of a volume on the nodes of a box that shine, in coordinates in which matter on circles about an axis
//! stays where it is but for its azimuth: those that a ray may meet.

use super::medium::PathSegment;
use crate::volume::Volume;
use core::f64::consts::{PI, TAU};
use core::ops::Range;
use kerrlight_geodesic::vector::{cross, dot, norm};

/// Bricks of radius, height along an axis, and azimuth about it, in the frame that turns with the
/// matter. How many of them shine in a range of each is known from sums over all bricks below.
#[derive(Debug, Clone)]
pub(super) struct Occupied {
    axis: [f64; 3],
    /// Two directions normal to the axis, right-handed with it.
    across: [[f64; 3]; 2],
    /// Least and largest radius of what shines.
    pub radii: [f64; 2],
    /// Bricks along the radius, the height and the azimuth.
    count: [usize; 3],
    low: [f64; 3],
    per_unit: [f64; 3],
    /// Bricks that shine below each corner.
    sums: Vec<u32>,
}

/// Bricks, at most.
const MOST_BRICKS: f64 = 2e6;

/// A range of radius, height and azimuth; of one as long as a whole turn, all of it.
type Extent = [[f64; 2]; 3];

impl Occupied {
    /// The bricks of a volume that turns about `axis` (a unit vector).
    pub fn new(volume: &Volume, axis: [f64; 3]) -> Self {
        // The axis cannot be parallel to the direction in which it has its least component.
        let least = (0..3).min_by(|i, j| axis[*i].abs().total_cmp(&axis[*j].abs())).unwrap_or(0);
        let other = core::array::from_fn(|k| f64::from(u8::from(k == least)));
        let first = unit(cross(axis, other));
        let across = [first, cross(axis, first)];
        let cells: Vec<_> = volume.occupied().map(|cell| extent(cell, axis, across)).collect();
        let mut occupied = Occupied {
            axis,
            across,
            radii: [f64::INFINITY, 0.0],
            count: [0; 3],
            low: [0.0; 3],
            per_unit: [0.0; 3],
            sums: Vec::new(),
        };
        if !cells.is_empty() {
            occupied.lay(&cells, volume.finest());
            occupied.mark(&cells);
        }
        occupied
    }

    /// Chooses bricks about as large as the finest cell for what holds all of `cells`.
    fn lay(&mut self, cells: &[Extent], finest: f64) {
        let bound = |c: usize| {
            let ends = cells.iter().map(|cell| cell[c]);
            ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], [low, high]| {
                [l.min(low), h.max(high)]
            })
        };
        let [radii, heights] = [bound(0), bound(1)];
        self.radii = radii;
        let ranges = [radii, heights, [-PI, PI]];
        let lengths = [radii[1] - radii[0], heights[1] - heights[0], TAU * radii[1]];
        let bricks: f64 = lengths.iter().map(|length| length / finest + 1.0).product();
        let width = finest * (bricks / MOST_BRICKS).cbrt().max(1.0);
        for c in 0..3 {
            self.count[c] = (lengths[c] / width).ceil().max(1.0) as usize;
            self.low[c] = ranges[c][0];
            self.per_unit[c] = self.count[c] as f64 / (ranges[c][1] - ranges[c][0]);
        }
    }

    /// Marks the bricks that cells reach, and sums them up.
    fn mark(&mut self, cells: &[Extent]) {
        let [nr, nh, np] = self.count;
        let corner = |i: usize, j: usize, k: usize| (i * (nh + 1) + j) * (np + 1) + k;
        // A layer of zeros below each axis, so that differences of sums need no special case.
        let mut sums = vec![0u32; (nr + 1) * (nh + 1) * (np + 1)];
        for cell in cells {
            let Some([radii, heights]) = self.flat(cell) else { continue };
            for (i, j) in radii.flat_map(|i| heights.clone().map(move |j| (i, j))) {
                for around in self.around(cell[2]) {
                    sums[corner(i + 1, j + 1, 1)..][around].fill(1);
                }
            }
        }
        for (i, j) in (1..=nr).flat_map(|i| (1..=nh).map(move |j| (i, j))) {
            let mut row = 0;
            for k in 1..=np {
                row += sums[corner(i, j, k)];
                // A running sum along the azimuth, inclusion and exclusion across the other two.
                let before = sums[corner(i - 1, j, k)] + sums[corner(i, j - 1, k)];
                sums[corner(i, j, k)] = row + before - sums[corner(i - 1, j - 1, k)];
            }
        }
        self.sums = sums;
    }

    /// Numbers of the bricks between two places, if any.
    fn bricks(&self, c: usize, [from, to]: [f64; 2]) -> Option<Range<usize>> {
        let place = |x: f64| (x - self.low[c]) * self.per_unit[c];
        let (first, last) = (place(from), place(to));
        let some = last >= 0.0 && first <= self.count[c] as f64;
        // Casts saturate.
        some.then(|| {
            (first as usize).min(self.count[c] - 1)..(last as usize + 1).min(self.count[c])
        })
    }

    fn flat(&self, extent: &Extent) -> Option<[Range<usize>; 2]> {
        Some([self.bricks(0, extent[0])?, self.bricks(1, extent[1])?])
    }

    /// Numbers of the bricks in a range of azimuths, in one piece or in two.
    fn around(&self, [from, to]: [f64; 2]) -> [Range<usize>; 2] {
        let count = self.count[2];
        let wide = to - from;
        if wide >= TAU || wide.is_nan() {
            return [0..count, 0..0];
        }
        let turns = TAU * ((from + PI) / TAU).floor();
        let [first, last] = [from - turns, to - turns].map(|x| (x + PI) * self.per_unit[2]);
        let (first, last) = ((first as usize).min(count - 1), last as usize + 1);
        match last.checked_sub(count) {
            Some(more) if more >= first => [0..count, 0..0],
            Some(more) => [first..count, 0..more],
            None => [first..last, 0..0],
        }
    }

    /// Returns whether a brick shines in a range of radius, height and azimuth.
    fn shines(&self, extent: &Extent) -> bool {
        let Some([radii, heights]) = self.flat(extent) else { return false };
        let [_, nh, np] = self.count;
        let below = |i: usize, j: usize, k: usize| self.sums[(i * (nh + 1) + j) * (np + 1) + k];
        let slab = |i: usize, around: &Range<usize>| {
            let sheet = |j: usize| below(i, j, around.end) - below(i, j, around.start);
            sheet(heights.end) - sheet(heights.start)
        };
        let some = |around: &Range<usize>| slab(radii.end, around) > slab(radii.start, around);
        self.around(extent[2]).iter().any(some)
    }

    /// Returns whether there may be light along a segment of a ray: `turned(radii)` is the range of angles by which
    /// matter between two radii has turned by the time.
    pub fn may_shine(
        &self,
        segment: &PathSegment,
        turned: impl Fn([f64; 2]) -> Option<[f64; 2]>,
    ) -> bool {
        if self.sums.is_empty()
            || segment.radii[1] < self.radii[0]
            || segment.radii[0] > self.radii[1]
        {
            return false;
        }
        let heights = self.heights(segment);
        let azimuths = match (self.azimuths(segment), turned(segment.radii)) {
            (Some([low, high]), Some([least, most])) => [low - most, high - least],
            _ => [-PI, PI],
        };
        self.shines(&[segment.radii, heights, azimuths])
    }

    /// Returns whether there may be light along a segment of a ray whose matter has come from other radii, the least
    /// and the largest of which these are.
    pub fn may_shine_from(&self, segment: &PathSegment, labels: [f64; 2]) -> bool {
        let missed = labels[1] < self.radii[0] || labels[0] > self.radii[1];
        if self.sums.is_empty() || missed {
            return false;
        }
        let stretch = [labels[0] / segment.radii[1], labels[1] / segment.radii[0]];
        let [low, high] = self.heights(segment).map(|height| stretch.map(|by| by * height));
        let heights = [low[0].min(low[1]) - ROUNDING, high[0].max(high[1]) + ROUNDING];
        self.shines(&[labels, heights, [-PI, PI]])
    }

    /// Least and largest height above the plane normal to the axis along a segment, M.
    fn heights(&self, segment: &PathSegment) -> [f64; 2] {
        let heights = segment.positions.map(|x| dot(self.axis, x));
        let farthest = segment.radii[1];
        [
            (heights[0].min(heights[1]) - segment.off).max(-farthest),
            (heights[0].max(heights[1]) + segment.off).min(farthest),
        ]
    }

    /// Azimuths about the axis along a segment; `None` if it may meet the axis.
    fn azimuths(&self, segment: &PathSegment) -> Option<[f64; 2]> {
        let [a, b] = segment.positions.map(|x| self.across.map(|e| dot(e, x)));
        // The nearest approach of the chord to the axis, seen along the axis.
        let along = [b[0] - a[0], b[1] - a[1]];
        let square = along[0] * along[0] + along[1] * along[1];
        let part = -(a[0] * along[0] + a[1] * along[1]) / square.max(f64::MIN_POSITIVE);
        let part = part.clamp(0.0, 1.0);
        let nearest = (a[0] + part * along[0]).hypot(a[1] + part * along[1]);
        // A point that far beside the chord is turned by asin(off/nearest) at most.
        let wide = segment.off / nearest;
        if wide >= 1.0 || wide.is_nan() {
            return None;
        }
        let turn = (a[0] * b[1] - a[1] * b[0]).atan2(a[0] * b[0] + a[1] * b[1]);
        let (start, wide) = (a[1].atan2(a[0]), wide.asin() + ROUNDING);
        Some([start + turn.min(0.0) - wide, start + turn.max(0.0) + wide])
    }
}

/// Largest effect of rounding on an angle, and, times its distance, on a length.
const ROUNDING: f64 = 1e-9;

fn unit(x: [f64; 3]) -> [f64; 3] {
    let norm = norm(x);
    x.map(|c| c / norm)
}

/// Radii, heights and azimuths of a box.
fn extent([low, high]: [[f64; 3]; 2], axis: [f64; 3], across: [[f64; 3]; 2]) -> Extent {
    let nearest: [f64; 3] = core::array::from_fn(|k| 0f64.clamp(low[k], high[k]));
    let farthest: [f64; 3] = core::array::from_fn(|k| low[k].abs().max(high[k].abs()));
    let heights = [0, 1].map(|end| -> f64 {
        let side = |k: usize| if (axis[k] > 0.0) == (end == 1) { high[k] } else { low[k] };
        (0..3).map(|k| axis[k] * side(k)).sum()
    });
    // A little more, for the rounding of rotations.
    let more = ROUNDING * norm(farthest);
    let wider = |[low, high]: [f64; 2], more: f64| [low - more, high + more];
    let radii = wider([norm(nearest), norm(farthest)], more);
    [radii, wider(heights, more), wider(angles([low, high], across), ROUNDING)]
}

/// Azimuths of a box: those of its corners, unless it comes near the axis.
fn angles([low, high]: [[f64; 3]; 2], across: [[f64; 3]; 2]) -> [f64; 2] {
    let flat = |x: [f64; 3]| across.map(|e| dot(e, x));
    let center = flat(core::array::from_fn(|k| 0.5 * (low[k] + high[k])));
    let half: [f64; 3] = core::array::from_fn(|k| 0.5 * (high[k] - low[k]));
    // From an axis outside of the ball around the box all corners are within a quarter turn.
    if center[0].hypot(center[1]) <= 1.001 * norm(half) {
        return [-PI, PI];
    }
    let middle = center[1].atan2(center[0]);
    let turn = |corner: usize| {
        let x = core::array::from_fn(|k| if corner >> k & 1 == 1 { high[k] } else { low[k] });
        let [p, q] = flat(x);
        (center[0] * q - center[1] * p).atan2(center[0] * p + center[1] * q)
    };
    let turns = || (0..8).map(turn);
    [middle + turns().fold(0.0, f64::min), middle + turns().fold(0.0, f64::max)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_geodesic::vector::rotate;

    fn ball(nodes: [usize; 3]) -> Volume {
        let (low, high) = ([-4.0, -5.0, -3.0], [6.0, 5.0, 3.0]);
        let empty = Volume::new(nodes, low, high, vec![0.0; nodes.iter().product()]).unwrap();
        let value = |k: usize| {
            let [x, y, z] = empty.position(k);
            if (x - 4.0).hypot(y).hypot(z - 1.0) < 1.2 { 1.0 } else { 0.0 }
        };
        let values = (0..nodes.iter().product()).map(value).collect();
        Volume::new(nodes, low, high, values).unwrap()
    }

    /// Wherever the turned volume shines on a segment the bricks say so, for stretches of all
    /// lengths, also where the ray may be off its chord; and they say no to most short ones.
    #[test]
    fn exact_nothing_shines_outside_the_bricks() {
        let volume = ball([17, 18, 19]);
        for axis in [[0.0, 0.0, 1.0], [0.48, -0.6, 0.64], [0.0, -1.0, 0.0]] {
            let occupied = Occupied::new(&volume, axis);
            let (mut held, mut lit, mut all) = (0, 0, 0);
            for k in 0..60_000 {
                let part = |f: f64| (f64::from(k) * f).fract();
                let around = |f: [f64; 3], size: f64| f.map(|f| size * (part(f) - 0.5));
                let x = around([0.819_172_5, 0.671_043_6, 0.549_700_5], 14.0);
                let long = [0.1, 0.5, 4.0][k as usize % 3];
                let step = around([0.324_717_9, 0.754_877_6, 0.569_840_2], long);
                let y: [f64; 3] = core::array::from_fn(|c| x[c] + step[c]);
                let off = 0.05 * long;
                // A point that far from the chord.
                let middle: [f64; 3] = core::array::from_fn(|c| {
                    x[c] + part(0.437_016) * step[c] + 0.57 * off * (2.0 * part(0.191_487) - 1.0)
                });
                let radii = [norm(x), norm(middle), norm(y)];
                let least = radii.into_iter().fold(f64::INFINITY, f64::min);
                let most = radii.into_iter().fold(0.0, f64::max);
                let angle = 0.1 * f64::from(k);
                let segment =
                    PathSegment { positions: [x, y], radii: [least, most], delays: [0.0; 2], off };
                let holds = occupied.may_shine(&segment, |_| Some([angle, angle + 0.02]));
                if long < 0.2 {
                    (held, all) = (held + i32::from(holds), all + 1);
                }
                if volume.at(rotate(axis, -angle - 0.01, middle)) > 0.0 {
                    lit += 1;
                    assert!(holds, "{x:?} about {axis:?}");
                }
            }
            assert!(lit > 50 && held < all / 20, "{lit} {held} {all}");
        }
    }

    /// Bricks are never more than allowed, and an empty volume has none.
    #[test]
    fn exact_number_of_bricks() {
        let occupied = Occupied::new(&ball([60, 60, 60]), [0.0, 0.0, 1.0]);
        assert!(occupied.count.iter().product::<usize>() > 1000);
        assert!((occupied.count.iter().product::<usize>() as f64) < 1.2 * MOST_BRICKS);
        let empty = Volume::new([2; 3], [0.0; 3], [1.0; 3], vec![0.0; 8]).unwrap();
        let empty = Occupied::new(&empty, [0.0, 0.0, 1.0]);
        let segment =
            PathSegment { positions: [[0.5; 3]; 2], radii: [0.8, 0.9], delays: [0.0; 2], off: 0.0 };
        assert!(!empty.may_shine(&segment, |_| None));
    }
}

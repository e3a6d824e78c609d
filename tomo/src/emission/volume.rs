//! Emission on the nodes of a box, carried along by matter on circles about an axis
//! (Levis et al. 2022): e(t, x) = e₀(R(ξ, −Ω(|x|)(t − t₀)) x), in positions r n.

use super::spot::rotate;
use crate::dynamics::{AngularVelocity, Axis, Injection};
use crate::scene::{Rotation, VolumeSource};
use crate::transport::{Emission, Grain, Medium, Moment, Needs, Part};
use crate::volume::{Volume, VolumeFile};
use kerrlight_geodesic::bundle::RayNodes;
use kerrlight_geodesic::flow::{cross, dot, rotating_redshift_at};
use kerrlight_geodesic::{Kerr, OutOfRange};

/// A volume around one hole, ready to be evaluated.
#[derive(Debug, Clone)]
pub struct VolumeModel {
    hole: Kerr,
    volume: Volume,
    factor: f64,
    largest: f64,
    axis: [f64; 3],
    /// `None`: it stands still.
    rotation: Option<AngularVelocity>,
    reference: f64,
    injection: Option<Injection>,
    /// Spectral index, if redshift is simulated.
    redshift: Option<f64>,
    slow_light: bool,
    occupied: Occupied,
    color: [f32; 3],
}

impl VolumeModel {
    /// The volume of a scene around `hole`; `redshift` is the spectral index, if it is simulated.
    ///
    /// # Errors
    /// If a value is negative or there is no axis to turn about.
    pub fn new(
        source: &VolumeSource,
        file: &VolumeFile,
        hole: &Kerr,
        (redshift, slow_light): (Option<f64>, bool),
    ) -> Result<Self, OutOfRange> {
        let range = |field, value, allowed| OutOfRange { field, value, allowed };
        let axis = match (source.axis.or(file.axis), &source.rotation) {
            (Some(axis), _) => axis,
            (None, Rotation::None) => [0.0, 0.0, 1.0],
            _ => return Err(range("volume axis", f64::NAN, "given by the scene or by the file")),
        };
        let not_zero = "finite numbers, not all 0";
        let axis = Axis::new(axis).map_err(|error| range("volume axis", error.0[0], not_zero))?;
        let [least, largest] = file.volume.values().iter().fold([0.0f64; 2], |[l, h], value| {
            [l.min(f64::from(*value)), h.max(f64::from(*value))]
        });
        if least < 0.0 {
            return Err(range("least value of the volume", least, "0 or more"));
        }
        Ok(VolumeModel {
            hole: *hole,
            volume: file.volume.clone(),
            factor: source.factor,
            largest: source.factor * largest,
            axis: axis.vector(),
            rotation: source
                .rotation
                .about(hole, axis)
                .map(AngularVelocity::checked)
                .transpose()?,
            reference: source.reference_time.unwrap_or(0.0),
            injection: source.injection_time.map(|time| Injection { time }),
            redshift,
            slow_light,
            occupied: Occupied::new(&file.volume, axis.vector()),
            color: source.color,
        })
    }

    /// Angular velocity vector of the matter at radius r.
    fn angular_velocity(&self, r: f64) -> [f64; 3] {
        let rate = self.rotation.as_ref().map_or(0.0, |rotation| rotation.rate(r));
        self.axis.map(|x| x * rate)
    }

    /// Emissivity in the frame of the matter at x, r from the centre, at a time of emission.
    fn emissivity(&self, x: [f64; 3], r: f64, time: f64) -> f64 {
        if self.injection.is_some_and(|injection| !injection.shines(time)) {
            return 0.0;
        }
        let origin = match &self.rotation {
            Some(rotation) => rotate(self.axis, -rotation.rate(r) * (time - self.reference), x),
            None => x,
        };
        self.factor * self.volume.at(origin)
    }

    /// g² j and g at node number `k`; `None` where nothing shines.
    fn node(
        &self,
        nodes: &RayNodes<'_>,
        k: usize,
        lambda: f64,
        moment: Moment,
    ) -> Option<[f64; 2]> {
        let (r, u) = (nodes.radius[k], nodes.cos_theta[k]);
        if !self.occupied.reaches(r) {
            return None;
        }
        let n = direction(u, nodes.azimuth[k]);
        let x = n.map(|c| r * c);
        if !self.occupied.holds(r, dot(self.axis, x)) {
            return None;
        }
        // No delays are asked for where nothing changes.
        let delay = nodes.delay.get(k).filter(|_| moment.slow_light).copied().unwrap_or(0.0);
        let time = moment.observed - delay;
        let emissivity = self.emissivity(x, r, time);
        if emissivity <= 0.0 {
            return None;
        }
        let Some(index) = self.redshift else { return Some([emissivity, 1.0]) };
        let polar = nodes.polar_velocity.get(k).copied().unwrap_or(0.0);
        let omega = self.angular_velocity(r);
        let g = rotating_redshift_at(&self.hole, (r, n), (lambda, polar), omega)?;
        Some([emissivity * g.powf(2.0 + index), g])
    }
}

/// n at cos θ and an azimuth.
fn direction(u: f64, azimuth: f64) -> [f64; 3] {
    let sin = ((1.0 - u) * (1.0 + u)).max(0.0).sqrt();
    let (y, x) = azimuth.sin_cos();
    [sin * x, sin * y, u]
}

impl Medium for VolumeModel {
    fn part(&self) -> Part {
        Part::Volumes
    }

    fn sphere(&self) -> f64 {
        // Somewhere outside of the horizon even where all is inside.
        self.occupied.radii[1].max(1.01 * self.hole.horizon())
    }

    fn grain(&self) -> Option<Grain> {
        Some(Grain { size: self.volume.finest(), inner: self.occupied.radii[0] })
    }

    fn needs(&self) -> Needs {
        let tilted = self.axis[0] != 0.0 || self.axis[1] != 0.0;
        let velocity = self.redshift.is_some() && tilted && self.rotation.is_some();
        Needs { azimuth: true, time: self.slow_light && self.changes(), velocity }
    }

    fn color(&self) -> [f32; 3] {
        self.color
    }

    fn scale(&self) -> f64 {
        self.largest * self.occupied.radii[1]
    }

    fn four_velocity(&self, r: f64, u: f64, azimuth: f64) -> Option<[f64; 4]> {
        let n = direction(u, azimuth);
        let v = cross(self.angular_velocity(r), n);
        let sin2 = (n[0] * n[0] + n[1] * n[1]).max(1e-300);
        let rates = [-v[2] / sin2.sqrt(), (n[0] * v[1] - n[1] * v[0]) / sin2];
        let norm = kerrlight_geodesic::flow::rotation_norm(&self.hole, r, n, v);
        let time = 1.0 / norm.sqrt();
        (norm > 0.0).then_some([time, 0.0, time * rates[0], time * rates[1]])
    }

    fn changes(&self) -> bool {
        self.rotation.is_some() || self.injection.is_some()
    }

    fn absorbs(&self) -> bool {
        false
    }

    fn fill(&self, nodes: &RayNodes<'_>, lambda: f64, moment: Moment, out: &mut Emission) {
        for k in 0..nodes.radius.len() {
            let [gain, g] = self.node(nodes, k, lambda, moment).unwrap_or([0.0; 2]);
            out.emissivity.push(gain);
            out.redshift.push(g);
        }
    }
}

/// Where a volume shines in terms of what rotation about its axis leaves alone: the radius and
/// the height along the axis. Both are cut into bins as wide as the finest cell or wider.
#[derive(Debug, Clone)]
struct Occupied {
    radii: [f64; 2],
    /// Bins of the radius and of the height.
    count: [usize; 2],
    low: [f64; 2],
    per_length: f64,
    bins: Vec<bool>,
}

/// Bins along the radius or along the height, at most.
const MOST_BINS: f64 = 2048.0;

impl Occupied {
    fn new(volume: &Volume, axis: [f64; 3]) -> Self {
        let cells: Vec<_> = volume.occupied().map(|cell| Self::extent(cell, axis)).collect();
        let bound = |c: usize, low: bool| {
            let ends = cells.iter().map(|cell| cell[c][usize::from(!low)]);
            if low {
                ends.fold(f64::INFINITY, f64::min)
            } else {
                ends.fold(f64::NEG_INFINITY, f64::max)
            }
        };
        let ranges = [0, 1].map(|c| [bound(c, true), bound(c, false)]);
        if cells.is_empty() {
            let (radii, low) = ([f64::INFINITY, 0.0], [0.0; 2]);
            return Occupied { radii, count: [0; 2], low, per_length: 0.0, bins: Vec::new() };
        }
        let longest = ranges.iter().map(|[low, high]| high - low).fold(0.0, f64::max);
        let width = volume.finest().max(longest / MOST_BINS);
        let count = ranges.map(|[low, high]| ((high - low) / width) as usize + 1);
        let low = ranges.map(|[low, _]| low);
        let bins = vec![false; count[0] * count[1]];
        let mut occupied = Occupied { radii: ranges[0], count, low, per_length: 1.0 / width, bins };
        for cell in &cells {
            occupied.mark(cell);
        }
        occupied
    }

    /// Radii and heights of a box.
    fn extent([low, high]: [[f64; 3]; 2], axis: [f64; 3]) -> [[f64; 2]; 2] {
        let norm = |x: [f64; 3]| dot(x, x).sqrt();
        let nearest = core::array::from_fn(|k| 0f64.clamp(low[k], high[k]));
        let farthest = core::array::from_fn(|k: usize| low[k].abs().max(high[k].abs()));
        let heights = [0, 1].map(|end| -> f64 {
            let side = |k: usize| if (axis[k] > 0.0) == (end == 1) { high[k] } else { low[k] };
            (0..3).map(|k| axis[k] * side(k)).sum()
        });
        // A little more, for the rounding of rotations.
        let more = 1e-9 * norm(farthest);
        let wider = |[low, high]: [f64; 2]| [low - more, high + more];
        [wider([norm(nearest), norm(farthest)]), wider(heights)]
    }

    fn bin(&self, c: usize, x: f64) -> Option<usize> {
        let place = (x - self.low[c]) * self.per_length;
        (place >= 0.0 && place < self.count[c] as f64).then_some(place as usize)
    }

    fn mark(&mut self, cell: &[[f64; 2]; 2]) {
        let range = |c: usize| {
            let [first, last] = cell[c].map(|x| self.bin(c, x).unwrap_or(self.count[c] - 1));
            first..last + 1
        };
        let heights = range(1);
        for r in range(0) {
            self.bins[r * self.count[1]..][heights.clone()].fill(true);
        }
    }

    fn reaches(&self, r: f64) -> bool {
        (self.radii[0]..=self.radii[1]).contains(&r)
    }

    fn holds(&self, r: f64, height: f64) -> bool {
        match (self.bin(0, r), self.bin(1, height)) {
            (Some(r), Some(height)) => self.bins[r * self.count[1] + height],
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Wherever the rotated volume shines the bins say so, and they say no in most of its box.
    #[test]
    fn exact_nothing_shines_outside_the_bins() {
        let nodes = [17, 18, 19];
        let (low, high) = ([-4.0, -5.0, -3.0], [6.0, 5.0, 3.0]);
        let empty = Volume::new(nodes, low, high, vec![0.0; 17 * 18 * 19]).unwrap();
        let value = |k: usize| {
            let [x, y, z] = empty.position(k);
            if (x - 4.0).hypot(y).hypot(z - 1.0) < 1.2 { 1.0 } else { 0.0 }
        };
        let values = (0..17 * 18 * 19).map(value).collect();
        let volume = Volume::new(nodes, low, high, values).unwrap();
        for axis in [[0.0, 0.0, 1.0], [0.48, -0.6, 0.64], [0.0, -1.0, 0.0]] {
            let occupied = Occupied::new(&volume, axis);
            let (mut held, mut lit, mut all) = (0, 0, 0);
            for k in 0..40_000 {
                let part = |f: f64| (f64::from(k) * f).fract();
                let x = [
                    14.0 * part(0.819_172_5) - 7.0,
                    14.0 * part(0.671_043_6) - 7.0,
                    14.0 * part(0.549_700_5) - 7.0,
                ];
                let r = dot(x, x).sqrt();
                let turned = rotate(axis, 0.1 * f64::from(k), x);
                let holds = occupied.reaches(r) && occupied.holds(r, dot(axis, x));
                (held, all) = (held + i32::from(holds), all + 1);
                if volume.at(turned) > 0.0 {
                    lit += 1;
                    assert!(holds, "{x:?} about {axis:?}");
                }
            }
            assert!(lit > 50 && held < all / 5, "{lit} {held} {all}");
        }
    }
}

//! Emission on the nodes of a box: what a fit recovers, and what a scene may show.

mod ensemble;
mod file;
pub mod metrics;
mod over_time;
mod panels;
#[cfg(test)]
mod paper;
pub mod projection;
pub mod ranks;
pub mod slices;
pub mod vti;

use crate::Error;
use crate::dynamics::Axis;
pub use ensemble::{Coverage, Ensemble, Feature};
pub use file::VolumeArrays;
use kerrlight_geodesic::vector::{norm, rotate};
pub use over_time::OverTime;
pub use panels::Shown;

/// Numbers on a regular grid of nodes, linear in between along each axis and zero outside.
///
/// Fits return the recovered emission as a volume, scenes show one, [`metrics`] compares two of them,
/// [`slices`] and [`projection`] draw them, [`vti`] writes them for ParaView. Values are emission
/// per unit of affine parameter at single precision, 4 bytes a node; z varies fastest.
///
/// ```
/// use kerrlight_render::volume::{Volume, metrics};
///
/// // e = x + 2 on 3 × 3 × 3 nodes from −1 M to 1 M.
/// let values: Vec<f32> = (0..27).map(|k| (k / 9) as f32 + 1.0).collect();
/// let volume = Volume::new([3; 3], [-1.0; 3], [1.0; 3], values.clone())?;
/// assert_eq!(volume.at([0.25, 0.5, -0.5]), 2.25);
/// assert_eq!(volume.at([1.5, 0.0, 0.0]), 0.0);
///
/// // An estimate that is 0.3 too high everywhere, where the truth's maximum is 3: 20 dB.
/// let high = values.iter().map(|value| value + 0.3).collect();
/// let estimate = Volume::new([3; 3], [-1.0; 3], [1.0; 3], high)?;
/// let worth = metrics::compare(&estimate, &volume, None)?;
/// assert!((worth.psnr_db.unwrap() - 20.0).abs() < 1e-5);
/// # Ok::<(), kerrlight_render::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Volume {
    nodes: [usize; 3],
    low: [f64; 3],
    high: [f64; 3],
    values: Vec<f32>,
}

/// A volume as a file has it.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeFile {
    /// Its numbers.
    pub volume: Volume,
    /// The axis about which it turns, if the file tells.
    pub axis: Option<[f64; 3]>,
}

/// Reason why there is no such volume.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VolumeError {
    /// There are not as many values as nodes.
    #[error("{found} values are not allowed: {wanted} are needed, one per node")]
    Length {
        /// Number of values.
        found: usize,
        /// Number of nodes.
        wanted: usize,
    },
    /// A value that is not a finite number.
    #[error("value = {value} of node ({}, {}, {}) is not allowed: finite", node[0], node[1], node[2])]
    Value {
        /// Index of the node, counted from 0 along x, y and z.
        node: [usize; 3],
        /// Its value.
        value: f32,
    },
}

impl Volume {
    /// `values` on `nodes` along x, y and z, z fastest, from `low` to `high` in M, both included.
    ///
    /// # Errors
    /// If a number is out of its range, a value is not finite, or there are too few or too many.
    pub fn new(
        nodes: [usize; 3],
        low: [f64; 3],
        high: [f64; 3],
        values: Vec<f32>,
    ) -> Result<Self, Error> {
        let range = |field, value, allowed| Err(Error::out_of_range(field, value, allowed));
        for axis in 0..3 {
            if !(2..=2048).contains(&nodes[axis]) {
                range("nodes", nodes[axis] as f64, "2 to 2048 along each axis")?;
            }
            if !low[axis].is_finite() {
                range("low", low[axis], "a finite number")?;
            }
            if !(high[axis].is_finite() && high[axis] > low[axis]) {
                range("high", high[axis], "above low")?;
            }
        }
        let volume = Self { nodes, low, high, values };
        let (found, wanted) = (volume.values.len(), nodes.iter().product());
        if found != wanted {
            return Err(VolumeError::Length { found, wanted }.into());
        }
        match volume.values.iter().position(|value| !value.is_finite()) {
            Some(k) => {
                Err(VolumeError::Value { node: volume.indices(k), value: volume.values[k] }.into())
            }
            None => Ok(volume),
        }
    }

    /// Nodes along x, y and z.
    pub fn nodes(&self) -> [usize; 3] {
        self.nodes
    }

    /// Coordinates of the first node, M.
    pub fn low(&self) -> [f64; 3] {
        self.low
    }

    /// Coordinates of the last node, M.
    pub fn high(&self) -> [f64; 3] {
        self.high
    }

    /// Values of the nodes, z fastest, then y, then x.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Edges of a cell along x, y and z, M.
    pub fn spacing(&self) -> [f64; 3] {
        core::array::from_fn(|k| (self.high[k] - self.low[k]) / (self.nodes[k] - 1) as f64)
    }

    /// The shortest edge of a cell, M.
    pub fn finest(&self) -> f64 {
        self.spacing().into_iter().fold(f64::INFINITY, f64::min)
    }

    /// The lowest and the highest corner of every cell that is not 0 all over.
    pub fn occupied(&self) -> impl Iterator<Item = [[f64; 3]; 2]> + '_ {
        let [nx, ny, nz] = self.nodes;
        let steps = [0, 1, nz, nz + 1, ny * nz, ny * nz + 1, ny * nz + nz, ny * nz + nz + 1];
        (0..self.values.len()).filter_map(move |k| {
            let [i, j, l] = self.indices(k);
            let inside = i + 1 < nx && j + 1 < ny && l + 1 < nz;
            let lit = || steps.iter().any(|step| self.values[k + step] != 0.0);
            let far = k + steps[7];
            (inside && lit()).then(|| [self.position(k), self.position(far)])
        })
    }

    fn indices(&self, k: usize) -> [usize; 3] {
        let [_, ny, nz] = self.nodes;
        [k / (ny * nz), k / nz % ny, k % nz]
    }

    /// Values of the nodes, x fastest, then y, then z: the order of VTK and of textures.
    pub fn x_fastest(&self) -> impl Iterator<Item = f32> + '_ {
        let [nx, ny, nz] = self.nodes;
        let index = move |k: usize| (k % nx * ny + k / nx % ny) * nz + k / (nx * ny);
        (0..self.values.len()).map(move |k| self.values[index(k)])
    }

    /// Returns the place of node number k, M.
    pub fn position(&self, k: usize) -> [f64; 3] {
        let indices = self.indices(k);
        core::array::from_fn(|axis| {
            let part = indices[axis] as f64 / (self.nodes[axis] - 1) as f64;
            self.low[axis] + (self.high[axis] - self.low[axis]) * part
        })
    }

    /// The value at a point, linear between nodes; 0 outside, and where the point is not finite.
    pub fn at(&self, point: [f64; 3]) -> f64 {
        let (mut cell, mut part) = ([0; 3], [0.0; 3]);
        for axis in 0..3 {
            let last = (self.nodes[axis] - 1) as f64;
            let extent = self.high[axis] - self.low[axis];
            let place = (point[axis] - self.low[axis]) / extent * last;
            if !(0.0..=last).contains(&place) {
                return 0.0;
            }
            // The last node belongs to the cell before it.
            let first = place.floor().min(last - 1.0);
            (cell[axis], part[axis]) = (first as usize, place - first);
        }
        let corner = |k: usize| -> f64 {
            let bit = |axis: usize| k >> axis & 1;
            let weight = |axis: usize| if bit(axis) == 1 { part[axis] } else { 1.0 - part[axis] };
            let [i, j, l] = [0, 1, 2].map(|axis| cell[axis] + bit(axis));
            let value = self.values[(i * self.nodes[1] + j) * self.nodes[2] + l];
            f64::from(value) * weight(0) * weight(1) * weight(2)
        };
        (0..8).map(corner).sum()
    }

    /// The same nodes after matter at radius r (M) has turned about `axis` by `angle(r)` (radians, right-handed):
    /// e(R(axis, −angle(|x|)) x), Levis et al. 2022, eq. 5. Nothing where the angle is not finite.
    pub fn carried(&self, axis: Axis, angle: impl Fn(f64) -> f64) -> Self {
        let value = |k: usize| {
            let x = self.position(k);
            self.at(rotate(axis.vector(), -angle(norm(x)), x)) as f32
        };
        Self { values: (0..self.values.len()).map(value).collect(), ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane() -> Volume {
        let empty =
            Volume::new([3, 4, 5], [-1.0, 0.0, 2.0], [1.0, 3.0, 4.0], vec![0.0; 60]).unwrap();
        let value = |k| {
            let [x, y, z] = empty.position(k);
            (2.0 * x - y + 0.5 * z) as f32
        };
        let values = (0..60).map(value).collect();
        Volume::new(empty.nodes, empty.low, empty.high, values).unwrap()
    }

    #[test]
    fn exact_linear_functions_are_kept_and_outside_is_empty() {
        let volume = plane();
        for point in [[0.3, 1.7, 3.1], [-1.0, 0.0, 2.0], [1.0, 3.0, 4.0], [1.0, 0.2, 4.0]] {
            let [x, y, z] = point;
            assert!((volume.at(point) - (2.0 * x - y + 0.5 * z)).abs() < 1e-6, "{point:?}");
        }
        for point in [[1.01, 1.0, 3.0], [0.0, -0.1, 3.0], [0.0, 1.0, f64::NAN]] {
            assert_eq!(volume.at(point), 0.0);
        }
    }

    #[test]
    fn wrong_shapes_and_values_are_named() {
        let new = |nodes, values: Vec<f32>| {
            Volume::new(nodes, [0.0; 3], [1.0; 3], values).unwrap_err().to_string()
        };
        assert_eq!(
            new([2, 2, 2], vec![0.0; 7]),
            "7 values are not allowed: 8 are needed, one per node"
        );
        assert_eq!(new([1, 2, 2], vec![]), "nodes = 1 is not allowed: 2 to 2048 along each axis");
        let mut values = vec![0.0; 8];
        values[6] = f32::NAN;
        let text = new([2, 2, 2], values);
        assert_eq!(text, "value = NaN of node (1, 1, 0) is not allowed: finite");
    }

    /// Matter outside 1.25 M turns from x to y, matter inside stays.
    #[test]
    fn exact_a_quarter_turn_takes_x_to_y() {
        let mut values = vec![0.0; 729];
        let node = |x: usize, y: usize| (x * 9 + y) * 9 + 4;
        (values[node(7, 4)], values[node(6, 4)]) = (3.0, 5.0);
        let volume = Volume::new([9; 3], [-2.0; 3], [2.0; 3], values).unwrap();
        let quarter = |r: f64| if r > 1.25 { core::f64::consts::FRAC_PI_2 } else { 0.0 };
        let turned = volume.carried(Axis::new([0.0, 0.0, 2.0]).unwrap(), quarter);
        for (k, value) in turned.values().iter().enumerate() {
            let expected = if k == node(4, 7) {
                3.0
            } else if k == node(6, 4) {
                5.0
            } else {
                0.0
            };
            assert!((value - expected).abs() < 1e-6, "{k}: {value}");
        }
        let nowhere = volume.carried(Axis::new([1.0, 0.0, 0.0]).unwrap(), |_| f64::INFINITY);
        assert!(nowhere.values().iter().all(|value| *value == 0.0));
    }
}

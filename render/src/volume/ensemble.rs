//! Volumes that data leave possible: their mean, how far they are apart, and where their bright features lie.

use super::Volume;
use super::metrics::same_nodes;
use crate::Error;
use core::f64::consts::TAU;

/// Mean and standard deviation of several volumes on the same nodes.
#[derive(Clone, Debug, PartialEq)]
pub struct Ensemble {
    /// Mean of each node.
    pub mean: Volume,
    /// Standard deviation of each node, with n − 1 in the denominator.
    pub deviation: Volume,
}

/// A bright feature: a peak of the mean and what is around it, as each volume has it.
#[derive(Clone, Debug, PartialEq)]
pub struct Feature {
    /// Distance of the centroid from the hole: mean over the volumes and standard deviation, M.
    pub radius: [f64; 2],
    /// Azimuth of the centroid, −π to π, and its standard deviation, radians.
    pub azimuth: [f64; 2],
    /// z of the centroid and its standard deviation, M.
    pub height: [f64; 2],
    /// Sum of the emission times the volume of a cell, and its standard deviation, M³.
    pub light: [f64; 2],
    /// The mean at its peak.
    pub peak: f64,
    /// Its nodes.
    pub nodes: Vec<usize>,
}

impl Feature {
    /// Distance from the hole of the centroid that a volume has at the feature's nodes, M.
    pub fn radius_in(&self, volume: &Volume) -> f64 {
        let [x, y, z, _] = centroid(volume, &self.nodes);
        (x * x + y * y + z * z).sqrt()
    }
}

/// Share of truths that lie within standard deviations of the mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coverage {
    /// Nodes that were looked at.
    pub nodes: usize,
    /// Part of them within one standard deviation.
    pub one: f64,
    /// Part of them within 1.96.
    pub two: f64,
}

/// Peaks fainter than this part of the brightest are no features.
const FAINT: f64 = 0.25;
/// A feature reaches to this part of its peak.
const EDGE: f64 = 0.3;

impl Ensemble {
    /// Takes two volumes or more.
    ///
    /// # Errors
    /// If their nodes differ, or there are fewer.
    pub fn of(volumes: &[Volume]) -> Result<Self, Error> {
        let [first, _, ..] = volumes else {
            return Err(Error::out_of_range("volumes", volumes.len() as f64, "2 or more"));
        };
        volumes.iter().try_for_each(|volume| same_nodes(first, volume))?;
        let n = volumes.len() as f64;
        let count = first.values().len();
        let (mut mean, mut deviation) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for k in 0..count {
            let each = || volumes.iter().map(|volume| f64::from(volume.values()[k]));
            let middle = each().sum::<f64>() / n;
            let squares: f64 = each().map(|x| (x - middle).powi(2)).sum();
            mean.push(middle as f32);
            deviation.push((squares / (n - 1.0)).sqrt() as f32);
        }
        let volume = |values| Volume::new(first.nodes(), first.low(), first.high(), values);
        Ok(Self { mean: volume(mean)?, deviation: volume(deviation)? })
    }

    /// Mean over standard deviation of each node; 0 where neither is.
    ///
    /// # Errors
    /// If a ratio is not finite.
    pub fn signal_to_noise(&self) -> Result<Volume, Error> {
        let ratio = |(mean, deviation): (&f32, &f32)| {
            // Where all volumes agree the ratio would be infinite: it ends at 1e6.
            if *mean == 0.0 { 0.0 } else { mean / deviation.max(1e-6 * mean.abs()) }
        };
        let values = self.mean.values().iter().zip(self.deviation.values()).map(ratio).collect();
        Volume::new(self.mean.nodes(), self.mean.low(), self.mean.high(), values)
    }

    /// Returns the share of truths within the intervals, at the nodes that are wanted.
    ///
    /// # Errors
    /// If its nodes are others.
    pub fn coverage(
        &self,
        truth: &Volume,
        mut wanted: impl FnMut([f64; 3], f32) -> bool,
    ) -> Result<Coverage, Error> {
        same_nodes(&self.mean, truth)?;
        let (mut nodes, mut one, mut two) = (0, 0, 0);
        for (k, real) in truth.values().iter().enumerate() {
            if wanted(truth.position(k), *real) {
                let apart = f64::from((real - self.mean.values()[k]).abs());
                let sigma = f64::from(self.deviation.values()[k]);
                nodes += 1;
                one += usize::from(apart <= sigma);
                two += usize::from(apart <= 1.96 * sigma);
            }
        }
        let part = |count: usize| count as f64 / nodes.max(1) as f64;
        Ok(Coverage { nodes, one: part(one), two: part(two) })
    }

    /// The bright features of the mean, the brightest first, and where these volumes have them.
    pub fn features(&self, volumes: &[Volume]) -> Vec<Feature> {
        let brightest = self.mean.values().iter().fold(0.0f32, |most, x| most.max(*x));
        let mut labels = vec![0; self.mean.values().len()];
        let mut order: Vec<usize> = (0..labels.len()).collect();
        order.sort_by(|a, b| self.mean.values()[*b].total_cmp(&self.mean.values()[*a]));
        let (mut found, mut label) = (Vec::new(), 0);
        for node in order {
            let peak = self.mean.values()[node];
            if peak <= 0.0 || f64::from(peak) < FAINT * f64::from(brightest) {
                break;
            }
            if labels[node] > 0 {
                continue;
            }
            label += 1;
            let around = self.around(node, label, &mut labels);
            // What adjoins a brighter feature is its slope.
            if let Some(around) = around {
                found.push(feature(volumes, &around, f64::from(peak)));
            }
        }
        found
    }

    /// The nodes joined to a peak and brighter than a part of it, which are marked; none if they join others.
    fn around(&self, peak: usize, label: u32, labels: &mut [u32]) -> Option<Vec<usize>> {
        let least = (EDGE * f64::from(self.mean.values()[peak])) as f32;
        let [nx, ny, nz] = self.mean.nodes();
        let (mut all, mut next, mut joined) = (vec![peak], 0, false);
        labels[peak] = label;
        while let Some(node) = all.get(next).copied() {
            next += 1;
            let at = self.mean.indices(node);
            for (axis, (stride, count)) in
                [(ny * nz, nx), (nz, ny), (1, nz)].into_iter().enumerate()
            {
                let before = (at[axis] > 0).then(|| node - stride);
                let after = (at[axis] + 1 < count).then(|| node + stride);
                for neighbour in before.into_iter().chain(after) {
                    if self.mean.values()[neighbour] < least {
                        continue;
                    }
                    if labels[neighbour] == 0 {
                        labels[neighbour] = label;
                        all.push(neighbour);
                    }
                    joined |= labels[neighbour] != label;
                }
            }
        }
        (!joined).then_some(all)
    }
}

/// Nodes at the corners of a cell.
const CELL: usize = 8;

fn feature(volumes: &[Volume], nodes: &[usize], peak: f64) -> Feature {
    let places: Vec<[f64; 4]> = volumes.iter().map(|volume| centroid(volume, nodes)).collect();
    let middle = |c: usize| places.iter().map(|p| p[c]).sum::<f64>() / places.len() as f64;
    let ahead = middle(1).atan2(middle(0));
    let of = |value: &dyn Fn(&[f64; 4]) -> f64| -> [f64; 2] {
        let values: Vec<f64> = places.iter().map(value).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let squares: f64 = values.iter().map(|x| (x - mean).powi(2)).sum();
        [mean, (squares / (values.len() as f64 - 1.0)).sqrt()]
    };
    // Angles from that of the mean centroid: their mean is not torn apart at ±π.
    let turned = |p: &[f64; 4]| (p[1].atan2(p[0]) - ahead + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0;
    let [turn, spread] = of(&turned);
    // Centroids of fewer nodes than those of a cell do not move as far as the light does: it may be anywhere between.
    let between = match nodes.len() {
        0..CELL => volumes.iter().flat_map(Volume::spacing).fold(0.0, f64::max) / 12f64.sqrt(),
        _ => 0.0,
    };
    let wide = |[mean, deviation]: [f64; 2], unit: f64| [mean, deviation.hypot(between / unit)];
    let away = middle(0).hypot(middle(1)).max(between);
    Feature {
        radius: wide(of(&|p| (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt()), 1.0),
        azimuth: wide([ahead + turn, spread], away.max(f64::MIN_POSITIVE)),
        height: wide(of(&|p| p[2]), 1.0),
        light: of(&|p| p[3]),
        peak,
        nodes: nodes.to_vec(),
    }
}

/// Σ e x/Σ e over some nodes, and Σ e times the volume of a cell.
fn centroid(volume: &Volume, nodes: &[usize]) -> [f64; 4] {
    let mut sums = [0.0; 4];
    for node in nodes {
        let ([x, y, z], e) = (volume.position(*node), f64::from(volume.values()[*node]));
        for (sum, term) in sums.iter_mut().zip([x, y, z, 1.0]) {
            *sum += e * term;
        }
    }
    let cell: f64 = volume.spacing().iter().product();
    let [x, y, z, all] = sums;
    if all > 0.0 { [x / all, y / all, z / all, all * cell] } else { [0.0; 4] }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume(value: impl Fn([f64; 3]) -> f64) -> Volume {
        let at = |k: usize| -8.0 + k as f64;
        let nodes = (0..17usize.pow(3)).map(|k| [at(k / 289), at(k / 17 % 17), at(k % 17)]);
        Volume::new([17; 3], [-8.0; 3], [8.0; 3], nodes.map(|x| value(x) as f32).collect()).unwrap()
    }

    fn spot([x, y, z]: [f64; 3], [a, b, c]: [f64; 3]) -> f64 {
        (-0.5 * ((x - a).powi(2) + (y - b).powi(2) + (z - c).powi(2)) / 1.44).exp()
    }

    #[test]
    fn exact_mean_and_deviation_of_two() {
        let (a, b) = (volume(|x| x[0].abs()), volume(|x| x[0].abs() + 2.0));
        let all = Ensemble::of(&[a.clone(), b]).unwrap();
        assert!((f64::from(all.mean.values()[0]) - 9.0).abs() < 1e-6);
        assert!((f64::from(all.deviation.values()[0]) - 2f64.sqrt()).abs() < 1e-6);
        // 1 away from both means: within one deviation of 1.41 everywhere.
        let coverage = all.coverage(&a, |_, _| true).unwrap();
        assert_eq!((coverage.nodes, coverage.one, coverage.two), (4913, 1.0, 1.0));
        let off = volume(|x| x[0].abs() + 3.5);
        let coverage = all.coverage(&off, |x, _| x[2] > 0.0).unwrap();
        assert_eq!((coverage.nodes, coverage.one, coverage.two), (2312, 0.0, 1.0));
        assert!(Ensemble::of(&[a]).is_err());
    }

    /// Two spots that are shifted along their radii from volume to volume.
    #[test]
    fn exact_features_have_their_places_and_spreads() {
        let shifts = [-0.3, 0.0, 0.3];
        let of =
            |s: &f64| volume(|x| spot(x, [4.0 + s, 0.0, 1.0]) + 0.6 * spot(x, [-3.0, -4.0, 0.0]));
        let volumes: Vec<Volume> = shifts.iter().map(of).collect();
        let features = Ensemble::of(&volumes).unwrap().features(&volumes);
        let [first, second] = &features[..] else { panic!("{features:?}") };
        assert!((first.radius[0] - 17f64.sqrt()).abs() < 0.1, "{first:?}");
        assert!(first.radius[1] > 0.1 && first.radius[1] < 0.35, "{first:?}");
        assert!(first.azimuth[0].abs() < 0.02 && (first.height[0] - 1.0).abs() < 0.05);
        assert!((second.radius[0] - 5.0).abs() < 0.1 && second.radius[1] < 1e-6, "{second:?}");
        let [a, b] = [&volumes[0], &volumes[2]].map(|volume| first.radius_in(volume));
        assert!((b - a - 2.0 * first.radius[1]).abs() < 1e-3, "{a} {b}");
        assert!((second.azimuth[0] - (-4f64).atan2(-3.0)).abs() < 0.02);
        assert!(first.peak > second.peak);
    }

    /// A node that shines alone stands for light up to half a spacing away.
    #[test]
    fn exact_a_feature_of_one_node_is_as_sure_as_the_grid() {
        let one = volume(|x| if x == [4.0, 3.0, 0.0] { 1.0 } else { 0.0 });
        let volumes = [one.clone(), one];
        let features = Ensemble::of(&volumes).unwrap().features(&volumes);
        let [only] = &features[..] else { panic!("{features:?}") };
        let sigma = 1.0 / 12f64.sqrt();
        assert!((only.radius[0] - 5.0).abs() < 1e-6 && (only.radius[1] - sigma).abs() < 1e-9);
        assert!((only.azimuth[1] - sigma / 5.0).abs() < 1e-9, "{only:?}");
    }
}

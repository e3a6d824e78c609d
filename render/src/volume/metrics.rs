//! Distance of an estimate from the truth.
//!
//! An empty estimate of a few small spots already has a large signal-to-noise ratio, because most nodes
//! are dark: beside it stand the same inside a mask, the relative error and the correlation.

use super::Volume;
use crate::Error;

/// Region in which an estimate is compared: r_min ≤ r ≤ r_max and |z| ≤ z_width, in M.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mask {
    /// Least radius.
    pub r_min: f64,
    /// Largest radius.
    pub r_max: f64,
    /// Largest |z|; may be infinite.
    pub z_width: f64,
}

impl Mask {
    /// Returns whether a point in M is inside, edges included.
    pub fn contains(&self, [x, y, z]: [f64; 3]) -> bool {
        let r = (x * x + y * y + z * z).sqrt();
        (self.r_min..=self.r_max).contains(&r) && z.abs() <= self.z_width
    }
}

/// Two volumes do not have the same nodes.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "{field} = {first:?} and {second:?} differ: volumes can be compared only on the same nodes"
)]
pub struct Mismatch {
    /// Property that differs: `nodes`, `low` or `high`.
    pub field: &'static str,
    /// Value of the first volume: a count of nodes, or M.
    pub first: [f64; 3],
    /// Value of the other one, in the same unit.
    pub second: [f64; 3],
}

/// Returns whether two volumes have the same nodes.
///
/// # Errors
/// Names what differs.
pub fn same_nodes(a: &Volume, b: &Volume) -> Result<(), Error> {
    let counts = |volume: &Volume| volume.nodes().map(|n| n as f64);
    let properties =
        [("nodes", counts(a), counts(b)), ("low", a.low(), b.low()), ("high", a.high(), b.high())];
    match properties.into_iter().find(|(_, first, second)| first != second) {
        Some((field, first, second)) => Err(Mismatch { field, first, second }.into()),
        None => Ok(()),
    }
}

/// Quality of an estimate. A number is `None` where it is not defined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// 10 log10(max(t)²/⟨(e − t)²⟩) in dB, over the nodes that are compared, max(t) being the truth's
    /// largest value on all nodes; infinite for a perfect estimate. Without a positive truth: none.
    pub psnr_db: Option<f64>,
    /// ‖e − t‖/‖t‖, dimensionless: 0 for a perfect estimate, 1 for an empty one. Without a truth that is not zero: none.
    pub nrmse: Option<f64>,
    /// Normalised cross-correlation ⟨(e − ⟨e⟩)(t − ⟨t⟩)⟩/(σ_e σ_t), −1 to 1, blind to the estimate's
    /// scale and offset (ρ_NX of Event Horizon Telescope Collaboration 2019, ApJL 875, L4). None if either is
    /// constant.
    pub correlation: Option<f64>,
    /// Number of nodes that were compared.
    pub nodes: usize,
}

/// Compares an estimate with the truth on all nodes, or on those in a mask.
///
/// # Errors
/// If the nodes are not the same.
pub fn compare(
    estimate: &Volume,
    truth: &Volume,
    mask: Option<&Mask>,
) -> Result<Comparison, Error> {
    same_nodes(estimate, truth)?;
    let inside = |k: &usize| mask.is_none_or(|mask| mask.contains(truth.position(*k)));
    let pair = |k: usize| [estimate.values()[k], truth.values()[k]].map(f64::from);
    let pairs = || (0..truth.values().len()).filter(inside).map(pair);
    let peak = f64::from(truth.values().iter().copied().fold(0.0, f32::max));
    Ok(Comparison::of(pairs, peak))
}

impl Comparison {
    /// Means first and then what is left of them: no digits are lost to an offset.
    fn of<I: Iterator<Item = [f64; 2]>>(pairs: impl Fn() -> I, peak: f64) -> Self {
        let nodes = pairs().count();
        let mean = |f: &dyn Fn([f64; 2]) -> f64| pairs().map(f).sum::<f64>() / nodes as f64;
        let error = mean(&|[e, t]| (e - t) * (e - t));
        let power = mean(&|[_, t]| t * t);
        let [e_mean, t_mean] = [mean(&|[e, _]| e), mean(&|[_, t]| t)];
        let covariance = mean(&|[e, t]| (e - e_mean) * (t - t_mean));
        let spread = mean(&|[e, _]| (e - e_mean).powi(2)) * mean(&|[_, t]| (t - t_mean).powi(2));
        let defined = |there: bool, value: f64| (nodes > 0 && there).then_some(value);
        Self {
            psnr_db: defined(peak > 0.0, 10.0 * (peak * peak / error).log10()),
            nrmse: defined(power > 0.0, (error / power).sqrt()),
            correlation: defined(spread > 0.0, covariance / spread.sqrt()),
            nodes,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::paper;
    use super::*;

    fn volume(values: &[f32]) -> Volume {
        Volume::new([2, 2, 2], [-1.0; 3], [1.0; 3], values.to_vec()).unwrap()
    }

    const TRUTH: [f32; 8] = [0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0];

    #[test]
    fn exact_one_bright_node_of_eight() {
        let truth = volume(&TRUTH);
        // ⟨(e − t)²⟩ = (4 − 1)²/8, ‖t‖ = 4.
        let mut faint = TRUTH;
        faint[2] = 1.0;
        let found = compare(&volume(&faint), &truth, None).unwrap();
        assert!((found.psnr_db.unwrap() - 10.0 * (16.0f64 / 1.125).log10()).abs() < 1e-12);
        assert!((found.nrmse.unwrap() - 0.75).abs() < 1e-12);
        assert!((found.correlation.unwrap() - 1.0).abs() < 1e-12);
        // The bright node elsewhere: covariance (2 · (7/2)(−1/2) + 6/4)/8 = −1/4, σ² = 7/4.
        let mut moved = [0.0; 8];
        moved[5] = 4.0;
        let found = compare(&volume(&moved), &truth, None).unwrap();
        assert!((found.nrmse.unwrap() - 2f64.sqrt()).abs() < 1e-12);
        assert!((found.correlation.unwrap() + 1.0 / 7.0).abs() < 1e-12);
    }

    #[test]
    fn exact_what_is_not_defined() {
        let (truth, empty) = (volume(&TRUTH), volume(&[0.0; 8]));
        let found = compare(&empty, &truth, None).unwrap();
        assert_eq!((found.nrmse, found.correlation), (Some(1.0), None));
        assert!((found.psnr_db.unwrap() - 10.0 * 8f64.log10()).abs() < 1e-12);
        let found = compare(&truth, &empty, None).unwrap();
        assert_eq!((found.psnr_db, found.nrmse, found.correlation), (None, None, None));
        assert_eq!(compare(&truth, &truth, None).unwrap().psnr_db, Some(f64::INFINITY));
        // A mask that no node is in.
        let none = Mask { r_min: 0.0, r_max: 1.0, z_width: 1.0 };
        let found = compare(&truth, &truth, Some(&none)).unwrap();
        assert_eq!((found.nodes, found.psnr_db, found.correlation), (0, None, None));
    }

    /// On 5³ nodes of [−2, 2]³, 1 ≤ r ≤ 2 and |z| ≤ 1 leave 6 + 12 + 8 nodes next to the centre and the
    /// 4 at r = 2 in the plane z = 0.
    #[test]
    fn exact_nodes_of_a_mask() {
        let empty = Volume::new([5; 3], [-2.0; 3], [2.0; 3], vec![0.0; 125]).unwrap();
        let mask = Mask { r_min: 1.0, r_max: 2.0, z_width: 1.0 };
        let inside = |k: usize| if mask.contains(empty.position(k)) { 2.0 } else { 9.0 };
        let truth = Volume::new([5; 3], [-2.0; 3], [2.0; 3], (0..125).map(inside).collect());
        let found = compare(&empty, &truth.unwrap(), Some(&mask)).unwrap();
        assert_eq!(found.nodes, 30);
        assert!((found.psnr_db.unwrap() - 20.0 * 4.5f64.log10()).abs() < 1e-12);
        assert_eq!(found.nrmse, Some(1.0));
    }

    #[test]
    fn wrong_shapes_are_named() {
        let small = volume(&TRUTH);
        let large = Volume::new([2, 2, 3], [-1.0; 3], [1.0; 3], vec![0.0; 12]).unwrap();
        let text = compare(&small, &large, None).unwrap_err().to_string();
        assert!(text.starts_with("nodes = [2.0, 2.0, 2.0] and [2.0, 2.0, 3.0]"), "{text}");
    }

    /// The scenes of Levis et al. (2022), which their code made on 64³ nodes: sums, peaks, and what an
    /// empty estimate scores.
    #[test]
    fn paper_empty_volumes() {
        let published = [
            (paper::scene_1(64), 252.0411, 0.9509363, 34.25),
            (paper::scene_4(64), 1008.1644, 0.9783308, 28.48),
            (paper::scene_8(64), 2016.3155, 1.1479896, 26.09),
        ];
        for (truth, sum, peak, psnr) in published {
            let count = truth.values().len();
            let empty = Volume::new([64; 3], truth.low(), truth.high(), vec![0.0; count]).unwrap();
            let found = compare(&empty, &truth, None).unwrap().psnr_db.unwrap();
            assert!((found - psnr).abs() < 0.005, "{found} {psnr}");
            let total: f64 = truth.values().iter().map(|v| f64::from(*v)).sum();
            assert!((total / sum - 1.0).abs() < 1e-5, "{total} {sum}");
            let most = truth.values().iter().copied().fold(0.0, f32::max);
            assert!((f64::from(most) / peak - 1.0).abs() < 1e-5, "{most} {peak}");
        }
    }
}

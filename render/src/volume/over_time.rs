//! Distance of estimates at several times from the truth.

use super::Volume;
use super::metrics::same_nodes;
use crate::Error;

/// Sums over the nodes of volumes at several times, one after the other.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OverTime {
    peak: f64,
    error: f64,
    power: f64,
    nodes: usize,
}

impl OverTime {
    /// Adds an estimate with the truth at the same time.
    ///
    /// # Errors
    /// If the nodes are not the same.
    pub fn add(&mut self, estimate: &Volume, truth: &Volume) -> Result<(), Error> {
        same_nodes(estimate, truth)?;
        for (e, t) in estimate.values().iter().zip(truth.values()) {
            let [e, t] = [*e, *t].map(f64::from);
            self.peak = self.peak.max(t);
            self.error += (e - t) * (e - t);
            self.power += t * t;
        }
        self.nodes += truth.values().len();
        Ok(())
    }

    /// 10 log10(max(t)²/⟨(e − t)²⟩), dB: maximum and mean over all nodes and times. None without a positive truth.
    pub fn psnr_db(&self) -> Option<f64> {
        let ratio = self.peak * self.peak * self.nodes as f64 / self.error;
        (self.peak > 0.0).then(|| 10.0 * ratio.log10())
    }

    /// ‖e − t‖/‖t‖ over all nodes and times. None without a truth that is not zero.
    pub fn nrmse(&self) -> Option<f64> {
        (self.power > 0.0).then(|| (self.error / self.power).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_one_bright_node_of_sixteen() {
        let volume = |values: [f32; 8]| {
            Volume::new([2, 2, 2], [-1.0; 3], [1.0; 3], values.to_vec()).unwrap()
        };
        let mut truth = [0.0; 8];
        let mut all = OverTime::default();
        all.add(&volume(truth), &volume(truth)).unwrap();
        assert_eq!((all.psnr_db(), all.nrmse()), (None, None));
        truth[3] = 4.0;
        let mut faint = truth;
        faint[3] = 1.0;
        all.add(&volume(faint), &volume(truth)).unwrap();
        assert!((all.psnr_db().unwrap() - 10.0 * (16.0f64 * 16.0 / 9.0).log10()).abs() < 1e-12);
        assert!((all.nrmse().unwrap() - 0.75).abs() < 1e-12);
    }
}

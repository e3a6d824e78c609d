//! The data of a fit.

use super::Truth;
use super::curve::Curve;
use super::leakage::LeakageUnknown;
use crate::fit::BackgroundDatum;
use kerrlight_common::frames::Frames;
use kerrlight_vlbi::gains::{GainPriors, GainTable};
use kerrlight_vlbi::observation::Observation;
use kerrlight_vlbi::operator::{ImageGrid, Pulse};
use kerrlight_vlbi::polarimetry::LeakageTable;

/// The data of a fit, and what is known to be true.
#[derive(Clone, Default)]
pub struct FitData {
    /// Times of the frames, M.
    pub times: Vec<f64>,
    /// The file that each frame of a static image is of, counted from 0.
    pub files: Vec<usize>,
    /// The movie, where images are the data or are simulated.
    pub movie: Option<Frames<f64>>,
    /// Visibilities, with the frame of each row.
    pub visibilities: Option<(Observation, Vec<usize>)>,
    /// Length of the averages over time that visibilities are, s; 0 where each time is a frame.
    pub average_s: f64,
    /// True if errors of visibilities are those of a source that varies: common to many data, so that χ² may be small.
    pub has_intrinsic_variability: bool,
    /// The light curve of an unresolved source.
    pub curve: Option<Curve>,
    /// Grid of pixels on the sky, where that matters.
    pub sky: Option<ImageGrid>,
    /// Shape of those pixels in visibilities.
    pub pulse: Pulse,
    /// True emission of a simulation.
    pub truth: Option<Truth>,
    /// Priors of the stations' gains, where these are solved for.
    pub gains: Option<GainPriors>,
    /// The gains that were put on simulated data.
    pub true_gains: Option<GainTable>,
    /// Leakage of the stations' feeds, where it is solved for.
    pub leakage: Option<LeakageUnknown>,
    /// The leakage that was put on simulated data.
    pub true_leakage: Option<LeakageTable>,
}

impl FitData {
    /// A light curve before a background in the order of its data, which the emission does not explain.
    #[must_use]
    pub fn before(&self, background: Vec<BackgroundDatum>) -> Self {
        let mut copy = self.clone();
        if let Some(curve) = &mut copy.curve {
            curve.background = Some(background);
        }
        copy
    }

    /// The data alone.
    pub fn without_truth(&self) -> Self {
        Self { truth: None, true_gains: None, true_leakage: None, ..self.clone() }
    }
}

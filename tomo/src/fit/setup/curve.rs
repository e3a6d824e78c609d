//! A light curve as the terms of a loss.

use super::Result;
use crate::fit::{BackgroundDatum, FluxDatum, StokesCurveTerm};
use kerrlight_render::polarization::StokesParameter;

/// A light curve that a fit explains.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Stokes parameters of each frame.
    pub parameters: Vec<StokesParameter>,
    /// Hours of UTC of the frames.
    pub hours: Vec<f64>,
    /// Frame by frame, parameter by parameter: Jy and standard deviation.
    pub data: Vec<Option<FluxDatum>>,
    /// Frames that are fitted; the others judge the fit.
    pub fitted: Vec<bool>,
    /// Background of the emission that is fitted, in the order of the data; none where there is none.
    pub background: Option<Vec<BackgroundDatum>>,
}

impl Curve {
    /// χ² of the frames that are fitted.
    ///
    /// # Errors
    /// If a number is not finite, or a standard deviation not above 0.
    pub fn fitted(&self) -> Result<StokesCurveTerm> {
        self.term(true)
    }

    /// χ² of the other frames; none if there are none.
    ///
    /// # Errors
    /// As [`Self::fitted`].
    pub fn validation(&self) -> Result<Option<StokesCurveTerm>> {
        match self.fitted.contains(&false) {
            true => self.term(false).map(Some),
            false => Ok(None),
        }
    }

    fn term(&self, fitted: bool) -> Result<StokesCurveTerm> {
        let count = self.parameters.len();
        let of = |k: usize| {
            let [flux, sigma] = self.data[k].filter(|_| self.fitted[k / count] == fitted)?;
            let [background, deviation, _] = self.background_at(k);
            // The background is known up to its deviation, which counts like noise.
            Some([flux - background, sigma.hypot(deviation)])
        };
        let term = StokesCurveTerm::new(count, (0..self.data.len()).map(of).collect())?;
        // Errors of Q and U are one ellipse, whichever way position angles are counted.
        let correlation = |frame: usize| {
            let first = frame * count;
            let total = |k: usize| {
                let sigma = self.data[k].map_or(0.0, |[_, sigma]| sigma);
                sigma.hypot(self.background_at(k)[1])
            };
            self.background_at(first)[2] / (total(first) * total(first + 1))
        };
        Ok(if count == 2 { term.correlated(correlation) } else { term })
    }

    /// Returns the background of the emission that is fitted at a number of the data.
    pub fn background_at(&self, k: usize) -> BackgroundDatum {
        self.background.as_ref().map_or([0.0; 3], |background| background[k])
    }
}

//! Learning rates.

use crate::Error;

/// Linear decay of a learning rate: to + (from − to)(1 − step/steps), then `to`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearDecay {
    /// Learning rate of step 0, in units of the parameters.
    pub from: f64,
    /// Learning rate from step `steps` on, in the same unit.
    pub to: f64,
    /// Steps of the decay.
    pub steps: u64,
}

impl LinearDecay {
    /// Itself, if its numbers are in their ranges.
    ///
    /// # Errors
    /// Names the number that is not.
    pub fn checked(self) -> Result<Self, Error> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        Error::check("from", self.from, positive(self.from), "above 0")?;
        Error::check("to", self.to, self.to.is_finite() && self.to >= 0.0, "0 or above")?;
        Error::check("steps", self.steps as f64, self.steps > 0, "1 or more")?;
        Ok(self)
    }

    /// Learning rate of a step, counted from 0, in units of the parameters.
    pub fn rate(&self, step: u64) -> f64 {
        let left = 1.0 - step.min(self.steps) as f64 / self.steps.max(1) as f64;
        self.to + (self.from - self.to) * left
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rates of BH-NeRF (Levis et al. 2022).
    const BHNERF: LinearDecay = LinearDecay { from: 1e-4, to: 1e-6, steps: 5000 };

    #[test]
    fn exact_linear_decay() {
        let decay = BHNERF.checked().unwrap();
        for (step, rate) in [(0, 1e-4), (2500, 5.05e-5), (5000, 1e-6), (9000, 1e-6)] {
            assert!((decay.rate(step) - rate).abs() < 1e-19, "{step}");
        }
    }

    #[test]
    fn numbers_out_of_range_are_named() {
        let error = LinearDecay { from: f64::NAN, ..BHNERF }.checked().unwrap_err();
        assert_eq!(error.to_string(), "from = NaN is not allowed: above 0");
        let error = LinearDecay { steps: 0, ..BHNERF }.checked().unwrap_err();
        assert_eq!(error.to_string(), "steps = 0 is not allowed: 1 or more");
    }
}

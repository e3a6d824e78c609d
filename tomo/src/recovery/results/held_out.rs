//! Values of a weight that were compared by data that are held out, as held_out.json keeps them.

use crate::fit::settings::{HeldOutSettings, Weight};
use crate::fit::setup::{self, Held};
use crate::null::or_nan;
use serde::{Deserialize, Serialize};

/// Values of a weight with their losses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldOutResults {
    /// The setting.
    pub setting: Weight,
    /// The value with the least loss.
    pub chosen: Option<f64>,
    /// Parts of the frames, each of which was held out once.
    pub folds: usize,
    /// All values, in the order of the settings.
    pub values: Vec<HeldValue>,
}

/// A value with its losses, χ² per data point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldValue {
    /// The value.
    pub value: f64,
    /// Mean loss of the parts that were held out.
    #[serde(deserialize_with = "or_nan")]
    pub loss: f64,
    /// Loss of each.
    pub losses: Vec<Option<f64>>,
    /// Standard error of the difference from the best value.
    pub error: Option<f64>,
}

impl HeldOutResults {
    /// Sums up what a search has found.
    pub fn new(settings: &HeldOutSettings, held: &[Held]) -> Self {
        let best = setup::best_held(held);
        let one = |held: &Held| HeldValue {
            value: held.value,
            loss: held.mean(),
            losses: held.losses.iter().copied().map(Some).collect(),
            error: best.map(|best| held.error_beside(best)),
        };
        Self {
            setting: settings.setting,
            chosen: best.map(|best| best.value),
            folds: settings.folds,
            values: held.iter().map(one).collect(),
        }
    }

    /// Returns the loss of the value that was chosen.
    pub fn loss(&self) -> Option<f64> {
        let chosen = self.values.iter().find(|of| Some(of.value) == self.chosen)?;
        Some(chosen.loss).filter(|loss| loss.is_finite())
    }

    /// Tells what was chosen, and whether it lies at an end of the list.
    pub fn sentence(&self) -> Option<String> {
        let chosen = self.chosen?;
        let least = self.values.iter().map(|of| of.loss).fold(f64::INFINITY, f64::min);
        let end = setup::told_end(self.values.iter().map(|of| of.value), chosen);
        Some(format!(
            "{} = {chosen} was chosen from {} values: the frames that were held out have χ² {least:.3} per data \
             point with it{end}.",
            self.setting.name(),
            self.values.len()
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_the_best_value_is_told_with_its_place() {
        let settings =
            HeldOutSettings { setting: Weight::Smoothness, values: vec![0.1, 1.0, 10.0], folds: 2 };
        let results = |losses: [[f64; 2]; 3]| {
            let pairs = settings.values.iter().zip(losses);
            let held = pairs.map(|(value, of)| Held { value: *value, losses: of.to_vec() });
            HeldOutResults::new(&settings, &held.collect::<Vec<_>>())
        };
        let inside = results([[1.2, 1.4], [1.0, 1.1], [3.0, 3.0]]);
        assert_eq!(inside.chosen, Some(1.0));
        assert!((inside.loss().unwrap() - 1.05).abs() < 1e-12);
        let said = inside.sentence().unwrap();
        assert!(
            said.contains("linear.smoothness = 1 was chosen from 3") && !said.contains("beyond"),
            "{said}"
        );
        let at_end = results([[0.9, 1.0], [1.0, 1.1], [3.0, 3.0]]);
        assert!(at_end.sentence().unwrap().contains("beyond"));
    }
}

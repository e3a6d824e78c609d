//! Sizes of a network.

use super::super::Activation;
use crate::Error;

/// Shape of a fully connected ReLU network with positional encoding and one output.
#[derive(Clone, Debug, PartialEq)]
pub struct NetworkSettings {
    /// 3 for (x, y, z), 4 for (t, x, y, z).
    pub dimension: usize,
    /// True if (x, y, z) is the place that matter has at the reference time, rather than that of an event. Of space alone it
    /// always is.
    pub carried: bool,
    /// Positional encoding degree L: γ(x) = [x, sin 2ʲx, sin(2ʲx + π/2)], j = 0..L − 1.
    pub degree: usize,
    /// Units of a hidden layer.
    pub width: usize,
    /// Hidden layers.
    pub hidden_layers: usize,
    /// γ(x) is appended to the output of this hidden layer, counted from 1.
    pub skip_after: Option<usize>,
    /// Lengths are divided by it (M) before they are encoded.
    pub length_scale: f64,
    /// Times are divided by it before they are encoded.
    pub time_scale: f64,
    /// Unit of times where they enter without sine and cosine, if it is not `time_scale`: far from 0 these inputs drown the
    /// others.
    pub time_span: Option<f64>,
    /// The last function, of the output plus `shift`.
    pub activation: Activation,
    /// See `activation`.
    pub shift: f64,
}

impl NetworkSettings {
    /// The network of BH-NeRF (Levis et al. 2022): 4 × 128, L = 3, the encoded point appended after the
    /// third hidden layer, sigmoid(· − 10) of pulled-back (x, y, z) in M; 55,169 parameters.
    pub fn bhnerf() -> Self {
        Self {
            dimension: 3,
            carried: true,
            degree: 3,
            width: 128,
            hidden_layers: 4,
            skip_after: Some(3),
            length_scale: 1.0,
            time_scale: 1.0,
            time_span: None,
            activation: Activation::Sigmoid,
            shift: -10.0,
        }
    }

    /// The same of (t, x, y, z), without dynamics: 56,961 parameters.
    pub fn mlp4d() -> Self {
        Self { dimension: 4, carried: false, ..Self::bhnerf() }
    }

    /// The network of BH-NeRF with the time as one more input: emission that changes while matter carries it, in no less than
    /// about `shortest` M, and for as long as `longest`.
    pub fn changing([shortest, longest]: [f64; 2]) -> Self {
        // A quarter of the shortest period, 2π time_scale/2^(L − 1), is 0.8 times the shortest time.
        let (time_scale, time_span) = (2.0 * shortest, Some(0.25 * longest));
        Self { dimension: 4, time_scale, time_span, ..Self::bhnerf() }
    }

    /// Returns the factor of the time after its division by `time_scale`, where it enters without sine and cosine.
    pub(super) fn time_part(&self) -> f64 {
        self.time_span.map_or(1.0, |span| self.time_scale / span)
    }

    /// Numbers of an encoded point.
    pub fn encoded(&self) -> usize {
        self.dimension * (1 + 2 * self.degree)
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        let check = Error::check;
        let whole = |field, value: usize, low, high, allowed| {
            let ok = (low..=high).contains(&value);
            check(field, value as f64, ok, allowed)
        };
        whole("dimension", self.dimension, 3, 4, "3 (x, y, z) or 4 (t, x, y, z)")?;
        whole("degree", self.degree, 0, 16, "0 to 16")?;
        whole("width", self.width, 1, 4096, "1 to 4096")?;
        whole("hidden_layers", self.hidden_layers, 1, 64, "1 to 64")?;
        if let Some(layer) = self.skip_after {
            whole("skip_after", layer, 1, self.hidden_layers, "1 to hidden_layers")?;
        }
        let positive = |x: f64| x.is_finite() && x > 0.0;
        check("length_scale", self.length_scale, positive(self.length_scale), "above 0")?;
        check("time_scale", self.time_scale, positive(self.time_scale), "above 0")?;
        let span = self.time_span.unwrap_or(1.0);
        check("time_span", span, positive(span), "above 0")?;
        check("shift", self.shift, self.shift.is_finite(), "a finite number")
    }
}

//! Losses of steps that the device has not done yet.

use crate::fit::loss::objective::{Loss, Objective};

/// The loss of a step, as far as it is known before the device is done.
pub enum Pending {
    /// Made on the device: of images, if there are any, and the other terms.
    There(Option<Squares>, Vec<Share>),
    /// All of it.
    Known(Loss),
}

/// Loss of images: factor on the sum of squares, squares of pixels without a ray, and weight of the term.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Squares {
    pub scale: f64,
    pub dark: f64,
    pub weight: f64,
}

/// Share of a term: the factor of its χ² to be that of a datum, and its weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Share {
    scale: f64,
    weight: f64,
}

impl Share {
    /// Returns the shares of all terms but that of images, in a step of so many frames.
    pub fn all(objective: &Objective<f32>, frames: usize) -> Vec<Self> {
        let of = |other: &crate::fit::loss::objective::Weighted<_>| Self {
            scale: 1.0 / objective.data_of(&*other.term, frames),
            weight: other.weight,
        };
        objective.data.others.iter().map(of).collect()
    }

    /// Returns the factor of χ² in the loss.
    pub fn factor(&self) -> f32 {
        (self.weight * self.scale) as f32
    }
}

impl Pending {
    /// Returns the loss from what the device has recorded: a sum of squares, and the bits of the number of points; χ² of
    /// the other terms.
    pub fn ended(self, record: &[f32], others: &[f32]) -> Loss {
        let points = record[1].to_bits() as usize;
        let (image, shares) = match self {
            Self::Known(loss) => return Loss { points, ..loss },
            Self::There(image, shares) => (image, shares),
        };
        let mut loss = Loss { points, ..Loss::default() };
        let mut add = |term: f64, weight: f64| {
            loss.total += weight * term;
            loss.terms.push(term);
        };
        if let Some(Squares { scale, dark, weight }) = image {
            add(scale * (f64::from(record[0]) + dark), weight);
        }
        for (Share { scale, weight }, sum) in shares.iter().zip(others) {
            add(scale * f64::from(*sum), *weight);
        }
        loss
    }
}

//! A smooth representation with few parameters.

use super::*;

/// A field without kinks, so that differences converge: Σ a exp(−|x − c|²/8), four parameters and, where it has a
/// time, one for that a blob.
#[derive(Clone, Copy)]
pub(in crate::fit) struct Blobs {
    pub dimension: usize,
    pub carried: bool,
}

impl Blobs {
    /// Carried along unchanged.
    pub const STEADY: Self = Self { dimension: 3, carried: true };
    /// Carried along, and changing on the way.
    pub const CHANGING: Self = Self { dimension: 4, carried: true };
    /// A field of events.
    pub const EVENTS: Self = Self { dimension: 4, carried: false };
}

const BLOBS: usize = 3;

impl Blobs {
    /// Value and gradients with respect to the parameters of one blob and the coordinates.
    fn blob(&self, p: &[f64], x: &[f64]) -> (f64, [f64; 5], [f64; 4]) {
        let offset = |c: usize| x[c] - 3.0 * p[c + 1];
        let square: f64 = (0..self.dimension).map(|c| offset(c).powi(2)).sum();
        let (shape, mut of_p, mut of_x) = ((-square / 8.0).exp(), [0.0; 5], [0.0; 4]);
        of_p[0] = shape;
        for c in 0..self.dimension {
            of_x[c] = -p[0] * shape * offset(c) / 4.0;
            of_p[c + 1] = -3.0 * of_x[c];
        }
        (p[0] * shape, of_p, of_x)
    }

    fn at(at: &Coordinates<'_, f64>, k: usize) -> Vec<f64> {
        at.columns().iter().map(|column| column[k]).collect()
    }
}

impl Representation<f64> for Blobs {
    fn dimension(&self) -> usize {
        self.dimension
    }

    fn is_carried(&self) -> bool {
        self.carried
    }

    fn parameters(&self) -> usize {
        BLOBS * (self.dimension + 1)
    }

    fn initialise(&self, _seed: u64, parameters: &mut [f64]) {
        parameters.iter_mut().enumerate().for_each(|(k, x)| *x = 0.4 + (k as f64).cos());
    }

    fn eval(&self, p: &[f64], at: Coordinates<'_, f64>, values: &mut [f64], _: &mut Workspace) {
        for (k, value) in values.iter_mut().enumerate() {
            let (x, of) = (Self::at(&at, k), p.chunks(self.dimension + 1));
            *value = of.map(|p| self.blob(p, &x).0).sum();
        }
    }

    fn vjp(
        &self,
        p: &[f64],
        at: Coordinates<'_, f64>,
        cotangents: &[f64],
        gradient: Gradient<'_, f64>,
        _: &mut Workspace,
    ) {
        let Gradient { parameters, mut coordinates } = gradient;
        let size = self.dimension + 1;
        for (k, cotangent) in cotangents.iter().enumerate() {
            let x = Self::at(&at, k);
            for (p, slopes) in p.chunks(size).zip(parameters.chunks_mut(size)) {
                let (_, of_p, of_x) = self.blob(p, &x);
                slopes.iter_mut().zip(of_p).for_each(|(slope, d)| *slope += cotangent * d);
                if let Some(coordinates) = &mut coordinates {
                    let columns = coordinates.columns().iter_mut();
                    columns.zip(of_x).for_each(|(column, d)| column[k] += cotangent * d);
                }
            }
        }
    }
}

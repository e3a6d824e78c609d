//! Products of circular feeds, or Stokes parameters, of a model with I, Q and U; with leakage that is held, and gains that
//! are solved for beside every model.

use super::{DataTerm, GainTerm, Residual, VisibilityTerm, stokes};
use crate::Complex64;
use crate::Error;
use crate::gains::{GainPriors, ScanGains};
use crate::observation::{Basis, Observation};
use crate::operator::Float;
use crate::polarimetry::{
    LeakageDatum, MODELLED, NoFeeds, Product, Products, SharedLeakage, jones, response, turns,
};
use num_complex::Complex;

/// χ² = Σ |g₁ ḡ₂ (J₁ ρ J₂†)_pq − D_pq|²/σ² over the products of a scan, each with an error of its own: ρ are the coherencies
/// of a model without V, J the leakage of the stations; both hands of a feed have one gain, of which χ² is the minimum
/// ([`GainTerm`]). Visibilities of the model are I of all rows, then Q, then U.
pub struct PolarizedTerm {
    basis: Basis,
    rows: usize,
    all: Vec<Product>,
    stations: Vec<[u16; 2]>,
    turns: Vec<[Complex64; 2]>,
    values: Vec<(Complex64, f64)>,
    compared: Compared,
    leakage: Option<SharedLeakage>,
}

/// Products beside those of the model.
enum Compared {
    Calibrated(VisibilityTerm<f64>),
    Free(GainTerm),
}

impl Compared {
    fn term(&self) -> &dyn DataTerm<f64> {
        match self {
            Compared::Calibrated(term) => term,
            Compared::Free(term) => term,
        }
    }
}

/// Response of a product to 1 Jy of I, of Q and of U.
type Response = [Complex64; MODELLED];

impl PolarizedTerm {
    /// Takes the products of a scan; `gains` are priors of all stations of the observation, `leakage` has a pair for each.
    ///
    /// # Errors
    /// If there are no data, an error is not positive, or leakage is asked of Stokes parameters or of an observation that
    /// does not say how feeds turn.
    pub fn new(
        observation: &Observation,
        gains: Option<&GainPriors>,
        leakage: Option<&SharedLeakage>,
    ) -> Result<Self, Error> {
        if leakage.is_some() && observation.basis != Basis::Circular {
            return Err(NoFeeds.into());
        }
        let Products { rows, all, data } = Products::of(observation);
        let compared = match gains {
            None => Compared::Calibrated(VisibilityTerm::new(&data)?),
            Some(priors) => Compared::Free(GainTerm::visibilities(&data, priors)?),
        };
        let seen = Observation { rows, ..observation.clone() };
        let turns = match leakage {
            Some(_) => turns(&seen)?,
            None => vec![[Complex64::new(1.0, 0.0); 2]; seen.rows.len()],
        };
        let values = data.rows.iter().map(|row| (row.products[0], row.noise_sigma[0]));
        Ok(Self {
            basis: observation.basis,
            rows: seen.rows.len(),
            all,
            stations: seen.rows.iter().map(|row| row.stations).collect(),
            turns,
            values: values.collect(),
            compared,
            leakage: leakage.cloned(),
        })
    }

    /// (u, v) in wavelengths of the rows of an observation that have any product, in order.
    pub fn uv(observation: &Observation) -> Vec<[f64; 2]> {
        Products::of(observation).rows.iter().map(|row| row.uv).collect()
    }

    /// Returns the responses of each product to the model's parameters.
    fn responses(&self) -> Vec<Response> {
        let leakage = self.leakage.as_ref().map(SharedLeakage::get);
        let of_row = |row: usize| {
            let of = |k: usize| {
                let station = usize::from(self.stations[row][k]);
                let terms = leakage.as_ref().map_or([Complex64::default(); 2], |all| all[station]);
                jones(terms, self.turns[row][k])
            };
            response(self.basis, &of(0), &of(1))
        };
        let by_row: Vec<_> = (0..self.rows).map(of_row).collect();
        self.all.iter().map(|at| by_row[at.row][at.product]).collect()
    }

    fn products<T: Float>(&self, responses: &[Response], model: &[Complex<T>]) -> Vec<Complex64> {
        assert_eq!(model.len(), MODELLED * self.rows);
        let of = |(at, response): (&Product, &Response)| {
            stokes(model, at.row).iter().zip(response).map(|(v, factor)| v * factor).sum()
        };
        self.all.iter().zip(responses).map(of).collect()
    }

    /// Stations whose gains are solved for, the gains that explain the data best beside a model, and their standard
    /// deviations; none where stations are calibrated.
    pub fn gains<T: Float>(&self, model: &[Complex<T>]) -> Option<(&[u16], ScanGains, ScanGains)> {
        let Compared::Free(term) = &self.compared else { return None };
        let (gains, errors) = term.gains(&self.products(&self.responses(), model));
        Some((term.stations(), gains, errors))
    }

    /// The data beside a model as leakage sees them, with the gains that explain them best now.
    pub fn beside<T: Float>(&self, model: &[Complex<T>]) -> Vec<LeakageDatum> {
        let gains = self.gains(model);
        let gain = |pair: [u16; 2]| match &gains {
            None => Complex64::new(1.0, 0.0),
            Some((stations, gains, _)) => {
                // Stations of the term are in order: that is a station's number among them.
                gains.on(pair.map(|k| stations.partition_point(|s| *s < k)))
            }
        };
        let one = |(at, (value, sigma)): (&Product, &(Complex64, f64))| LeakageDatum {
            stations: self.stations[at.row].map(usize::from),
            turns: self.turns[at.row],
            product: at.product,
            value: *value,
            weight: sigma.powi(-2),
            gain: gain(self.stations[at.row]),
            model: stokes(model, at.row),
        };
        self.all.iter().zip(&self.values).map(one).collect()
    }
}

impl<T: Float> DataTerm<T> for PolarizedTerm {
    fn visibilities(&self) -> usize {
        MODELLED * self.rows
    }

    fn degrees_of_freedom(&self) -> usize {
        self.compared.term().degrees_of_freedom()
    }

    fn value_and_gradient(
        &self,
        model: &[Complex<T>],
        weight: T,
        gradient: &mut [Complex<T>],
    ) -> f64 {
        assert_eq!(gradient.len(), model.len());
        let responses = self.responses();
        let products = self.products(&responses, model);
        let mut slopes = vec![Complex64::default(); products.len()];
        let value = self.compared.term().value_and_gradient(&products, 1.0, &mut slopes);
        for ((at, response), slope) in self.all.iter().zip(&responses).zip(slopes) {
            for (k, factor) in response.iter().enumerate() {
                let part = factor.conj() * slope * weight.double();
                gradient[k * self.rows + at.row] += Complex::new(T::of(part.re), T::of(part.im));
            }
        }
        value
    }

    fn residuals(&self, model: &[Complex<T>]) -> Vec<Residual> {
        self.compared.term().residuals(&self.products(&self.responses(), model))
    }
}

#[cfg(test)]
pub(super) mod tests;

//! The products of an observation one by one.

use crate::observation::{Basis, Observation, Row};

/// A product of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Product {
    /// The row among those that have any product.
    pub row: usize,
    /// Index of the product among the four of the [`Basis`].
    pub product: usize,
}

/// All products that were measured and that I, Q and U give: RR, LL, RL and LR, or I, Q and U.
#[derive(Debug, Clone, PartialEq)]
pub struct Products {
    /// Rows that have any, in the order of the observation.
    pub rows: Vec<Row>,
    /// The products, row by row.
    pub all: Vec<Product>,
    /// The same as visibilities of their own: a row each, as if it were Stokes I.
    pub data: Observation,
}

impl Products {
    /// Takes an observation; products that were not measured are left out, and Stokes V is.
    pub fn of(observation: &Observation) -> Self {
        let known = match observation.basis {
            Basis::Circular => 0..4,
            Basis::Stokes => 0..super::MODELLED,
        };
        let (mut rows, mut all, mut data) = (Vec::new(), Vec::new(), Vec::new());
        for row in &observation.rows {
            let products = known.clone().filter_map(|k| Some((k, row.measured(k)?)));
            let before = all.len();
            for (product, datum) in products {
                all.push(Product { row: rows.len(), product });
                data.push(Row {
                    integration_s: row.integration_s,
                    channel: row.channel,
                    ..Row::total_intensity(row.time_h, row.stations, row.uv, datum)
                });
            }
            if all.len() > before {
                rows.push(*row);
            }
        }
        let data = Observation { basis: Basis::Stokes, rows: data, ..observation.clone() };
        Self { rows, all, data }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Complex64;
    use crate::observation::Measured;

    #[test]
    fn exact_products_that_were_measured() {
        let mut observation = Observation::empty(Basis::Circular);
        let datum = Measured { visibility: Complex64::new(1.0, 2.0), noise_sigma: 0.1 };
        let parallel = Row::total_intensity(1.0, [0, 1], [5.0, 6.0], datum);
        let mut crossed = Row { stations: [0, 2], ..parallel };
        crossed.products = [3.0, 4.0, 5.0, 0.0].map(Complex64::from);
        crossed.noise_sigma = [f64::NAN, 0.2, 0.3, 0.0];
        let nothing = Row { noise_sigma: [f64::NAN; 4], stations: [1, 2], ..parallel };
        observation.rows = vec![parallel, nothing, crossed];
        let found = Products::of(&observation);
        let rows: Vec<_> = found.rows.iter().map(|row| row.stations).collect();
        assert_eq!(rows, [[0, 1], [0, 2]]);
        let places: Vec<_> = found.all.iter().map(|p| (p.row, p.product)).collect();
        assert_eq!(places, [(0, 0), (1, 1), (1, 2)]);
        let data: Vec<_> = found.data.stokes_i().map(|(row, i)| (row.stations, i)).collect();
        assert_eq!(data[2].0, [0, 2]);
        assert_eq!((data[2].1.visibility.re, data[2].1.noise_sigma), (5.0, 0.3));
    }
}

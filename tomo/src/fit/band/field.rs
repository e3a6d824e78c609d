//! The covariance that a random field in a band has in the data, and where its emission is.

use super::{Band, CurveRows};
use core::f64::consts::TAU;
use nalgebra::{DMatrix, DVector};

/// Bands whose envelope is as dark as this at all nodes are none.
const DARK: f64 = 0.02;
/// Parts of the field whose variance is below this part of the largest one are left out.
const FAINT: f64 = 1e-6;

/// A band as the data see it.
pub(super) struct BandCovariance {
    /// Data × data: the covariance of a field of unit variance.
    pub covariance: DMatrix<f64>,
    /// Response to a field of 1.
    pub uniform: DVector<f64>,
    /// Data × [moments](super::place): their covariance.
    pub moments: DMatrix<f64>,
    /// Moments × moments.
    pub own: DMatrix<f64>,
    /// Covariance of the data with all emission of the field, in any unit.
    pub total: DVector<f64>,
    /// Variance of all emission of the field, and all emission of a field of 1, in that unit.
    pub own_total: [f64; 2],
}

impl BandCovariance {
    /// The covariance of all data that the flare gives them, without noise.
    pub fn full(&self, band: &Band) -> DMatrix<f64> {
        let mean = &self.uniform * self.uniform.transpose() * (band.mean * band.mean);
        (&self.covariance + mean) * band.power
    }
}

impl CurveRows {
    /// Covariances of a band; none where it has no node.
    pub(super) fn seen(&self, band: &Band) -> Option<BandCovariance> {
        let across = Profile::new(&self.grid.rings(), [band.radius, band.width], band.length)?;
        let upright = Profile::new(&self.grid.layers(), [0.0, band.height], band.length)?;
        let round = self.round(band);
        let parts = self.parts(&across.parts, &upright.parts, &round);
        let [moments, own] = self.moments(&parts, [&across, &upright], round[1]);
        let (total, own_total) = self.total(&parts, [&across, &upright], round[0]);
        let uniform = self.uniform([&across, &upright]);
        let covariance = parts.transpose() * &parts;
        Some(BandCovariance { covariance, uniform, moments, own, total, own_total })
    }

    /// Standard deviations of the functions of the azimuth, those that count and the first harmonic: exp(−d²/2ℓ²) of
    /// the distance d between two points of the band's circle.
    fn round(&self, band: &Band) -> Vec<f64> {
        let (nodes, kappa) = (self.grid.azimuths, (band.radius / band.length).powi(2));
        // d² = 4ρ₀² sin²(φ/2) = 2ρ₀² (1 − cos φ).
        let near = |node: usize| (kappa * ((TAU * node as f64 / nodes as f64).cos() - 1.0)).exp();
        let share = |harmonic: usize| {
            let wave = |node: usize| (TAU * (harmonic * node % nodes) as f64 / nodes as f64).cos();
            (0..nodes).map(|node| near(node) * wave(node)).sum::<f64>() / nodes as f64
        };
        // Round a ring the covariance is circulant: its eigenvalues are Fourier coefficients.
        let shares = (0..=self.grid.waves() / 2).map(share);
        // Rounding leaves some of the smallest below 0.
        let all: Vec<f64> = shares.map(|share| share.max(0.0)).collect();
        let most = all.iter().copied().fold(0.0, f64::max);
        // Moments are made of the first harmonic: it stays, however faint.
        let count = all.iter().rposition(|share| *share > FAINT * most).unwrap_or(0).max(1);
        (0..=2 * count).map(|wave| all[wave.div_ceil(2)].sqrt()).collect()
    }

    /// Parts of the field × data, each part of unit variance: function of the azimuth by function, layer parts by ring parts.
    fn parts(&self, across: &DMatrix<f64>, upright: &DMatrix<f64>, round: &[f64]) -> DMatrix<f64> {
        let (data, layers, rings) = (self.data(), self.grid.layers, across.ncols());
        let waves = self.waves.columns(0, round.len() * data * layers);
        // `tr_mul` is a product of columns one by one, and slower than a transpose and a product.
        let of_rings = across.transpose() * waves;
        let (all, each) = (round.len() * rings * upright.ncols(), rings * upright.ncols());
        let mut parts = vec![0.0; all * data];
        // Matrices this small cost more to allocate than to multiply.
        for (place, of_layers) in of_rings.as_slice().chunks_exact(rings * layers).enumerate() {
            let (wave, datum) = (place / data, place % data);
            let start = datum * all + wave * each;
            for (column, part) in parts[start..start + each].chunks_exact_mut(rings).enumerate() {
                for (layer, of_layer) in of_layers.chunks_exact(rings).enumerate() {
                    let factor = upright[(layer, column)] * round[wave];
                    part.iter_mut().zip(of_layer).for_each(|(sum, x)| *sum += factor * x);
                }
            }
        }
        DMatrix::from_vec(all, data, parts)
    }

    /// Covariances of the moments with the data and with each other.
    fn moments(
        &self,
        parts: &DMatrix<f64>,
        [across, upright]: [&Profile; 2],
        first: f64,
    ) -> [DMatrix<f64>; 2] {
        let rings = DVector::from_vec(self.grid.rings());
        let up = upright.parts.row_sum().transpose() * first;
        let of_power = |power: i32| {
            // Factors that all four have in common cancel in azimuth and radius, and are left out.
            let ring = across.parts.tr_mul(&rings.map(|radius| radius.powi(power)));
            let both = &ring * up.transpose();
            DVector::from_column_slice(both.as_slice())
        };
        let (weights, each) = ([1, 2].map(of_power), across.parts.ncols() * up.len());
        let of = |k: usize| (&weights[k / 2], k % 2);
        let column = |k: usize| parts.rows((1 + of(k).1) * each, each).tr_mul(of(k).0);
        let moments = DMatrix::from_columns(&[0, 1, 2, 3].map(column));
        let own = |a: usize, b: usize| match of(a).1 == of(b).1 {
            true => of(a).0.dot(of(b).0),
            false => 0.0,
        };
        [moments, DMatrix::from_fn(4, 4, own)]
    }

    /// Returns the covariance of all emission with the data, its variance, and its value for a field of 1.
    fn total(
        &self,
        parts: &DMatrix<f64>,
        [across, upright]: [&Profile; 2],
        first: f64,
    ) -> (DVector<f64>, [f64; 2]) {
        let rings = DVector::from_vec(self.grid.rings());
        let ring = across.parts.tr_mul(&rings);
        let up = upright.parts.row_sum().transpose() * first;
        let weights = DVector::from_column_slice((&ring * up.transpose()).as_slice());
        let of_one = across.envelope.dot(&rings) * upright.envelope.sum();
        // Harmonics add up to nothing round a ring: only the first function has a sum.
        (parts.rows(0, weights.len()).tr_mul(&weights), [weights.norm_squared(), of_one])
    }

    /// Returns the response to a field of 1.
    fn uniform(&self, [across, upright]: [&Profile; 2]) -> DVector<f64> {
        let (data, layers) = (self.data(), self.grid.layers);
        let of_rings = self.waves.columns(0, data * layers).tr_mul(&across.envelope);
        let of = |datum: usize| of_rings.rows(datum * layers, layers).dot(&upright.envelope);
        DVector::from_fn(data, |datum, _| of(datum))
    }
}

/// A random field of one coordinate times an envelope.
struct Profile {
    /// exp(−½ ((x − middle)/width)²) at the nodes.
    envelope: DVector<f64>,
    /// Nodes × parts: the sum of their squares is the covariance.
    parts: DMatrix<f64>,
}

impl Profile {
    fn new(nodes: &[f64], [middle, width]: [f64; 2], length: f64) -> Option<Self> {
        let bell = |x: f64| (-0.5 * x * x).exp();
        let envelope =
            DVector::from_iterator(nodes.len(), nodes.iter().map(|x| bell((x - middle) / width)));
        if envelope.max() < DARK {
            return None;
        }
        let entry =
            |a: usize, b: usize| envelope[a] * envelope[b] * bell((nodes[a] - nodes[b]) / length);
        let covariance = DMatrix::from_fn(nodes.len(), nodes.len(), entry).symmetric_eigen();
        let most = covariance.eigenvalues.max();
        let kept: Vec<DVector<f64>> = (0..nodes.len())
            .filter(|k| covariance.eigenvalues[*k] > FAINT * most)
            .map(|k| covariance.eigenvectors.column(k) * covariance.eigenvalues[k].sqrt())
            .collect();
        Some(Self { envelope, parts: DMatrix::from_columns(&kept) })
    }
}

/// Some rows and columns of a matrix.
pub(super) fn part(matrix: &DMatrix<f64>, rows: &[usize], columns: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), columns.len(), |a, b| matrix[(rows[a], columns[b])])
}

/// Some entries of a vector.
pub(super) fn some(vector: &[f64], kept: &[usize]) -> DVector<f64> {
    DVector::from_iterator(kept.len(), kept.iter().map(|k| vector[*k]))
}

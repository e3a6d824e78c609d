//! Rows of a light curve in voxels, and the covariance that a random field in a band has in the data.

use super::Band;
use crate::fit::linear::Voxels;
use nalgebra::{DMatrix, DVector};

/// A light curve as a linear function of voxels, all numbers over the standard deviations of the data.
#[derive(Clone, Debug)]
pub struct CurveRows {
    /// The grid.
    pub voxels: Voxels,
    /// Datum by datum, voxel by voxel.
    pub rows: Vec<Vec<f64>>,
    /// Which of the data are used; the others judge.
    pub used: Vec<bool>,
}

/// Voxels that are as dark as this part of the envelope's middle are left out.
const DARK: f64 = 0.02;

/// A band as the data see it.
pub(super) struct Seen {
    /// Voxels in it.
    pub inside: Vec<usize>,
    /// The envelope there.
    pub envelope: Vec<f64>,
    /// Voxels × data: the field's correlation times the transpose of the rows.
    pub spread: DMatrix<f64>,
    /// Data × data: the covariance of a field of unit variance.
    pub covariance: DMatrix<f64>,
    /// What a field of 1 gives.
    pub uniform: DVector<f64>,
}

impl CurveRows {
    /// Rows, columns and covariance of a band; none where it has no voxel.
    pub(super) fn seen(&self, band: &Band) -> Option<Seen> {
        let places: Vec<[f64; 3]> =
            (0..self.voxels.count()).map(|k| self.voxels.position(k)).collect();
        let bright = |x: &[f64; 3]| {
            let [a, b] = [(x[0].hypot(x[1]) - band.radius) / band.width, x[2] / band.height];
            (-0.5 * (a * a + b * b)).exp()
        };
        let inside: Vec<usize> = (0..places.len()).filter(|k| bright(&places[*k]) > DARK).collect();
        if inside.is_empty() {
            return None;
        }
        let envelope: Vec<f64> = inside.iter().map(|k| bright(&places[*k])).collect();
        let entry = |row: usize, column: usize| self.rows[row][inside[column]] * envelope[column];
        let rows = DMatrix::from_fn(self.rows.len(), inside.len(), entry);
        let near = |a: usize, b: usize| {
            let (p, q) = (places[inside[a]], places[inside[b]]);
            let square: f64 = p.iter().zip(q).map(|(p, q)| (p - q) * (p - q)).sum();
            (-0.5 * square / (band.length * band.length)).exp()
        };
        let correlation = DMatrix::from_fn(inside.len(), inside.len(), near);
        let spread = correlation * rows.transpose();
        let covariance = &rows * &spread;
        let uniform = rows.column_sum();
        Some(Seen { inside, envelope, spread, covariance, uniform })
    }

    /// Numbers of the data that are used, or of the others.
    pub(super) fn numbers(&self, used: bool) -> Vec<usize> {
        (0..self.used.len()).filter(|k| self.used[*k] == used).collect()
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

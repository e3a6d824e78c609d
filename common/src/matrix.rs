//! Matrix products on slices.

use crate::simd::Float;

/// A matrix in a slice: shape and distances between neighbours down a column and along a row.
#[derive(Clone, Copy)]
pub struct Shape {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
    /// Distance from a row to the next in the slice.
    pub row_stride: usize,
    /// Distance from a column to the next in the slice.
    pub column_stride: usize,
}

impl Shape {
    /// Row after row.
    pub fn by_rows(rows: usize, columns: usize) -> Self {
        Shape { rows, columns, row_stride: columns, column_stride: 1 }
    }

    /// The same numbers with rows and columns exchanged.
    pub fn transposed(self) -> Self {
        Shape {
            rows: self.columns,
            columns: self.rows,
            row_stride: self.column_stride,
            column_stride: self.row_stride,
        }
    }

    fn fits(&self, length: usize) -> bool {
        self.rows == 0
            || self.columns == 0
            || (self.rows - 1) * self.row_stride + (self.columns - 1) * self.column_stride < length
    }
}

/// result = a·b, or result += a·b, on the calling thread; `result` is row after row.
pub fn multiply<T: Float>(a: &[T], of_a: Shape, b: &[T], of_b: Shape, result: &mut [T], add: bool) {
    let of_result = Shape::by_rows(of_a.rows, of_b.columns);
    assert!(of_a.columns == of_b.rows);
    assert!(of_a.fits(a.len()) && of_b.fits(b.len()) && of_result.fits(result.len()));
    let stride = |stride: usize| stride as isize;
    // SAFETY: the shapes have been checked to lie within their slices, `result` is not aliased,
    // and `T` is f32 or f64, which gemm implements.
    unsafe {
        // Distances of columns stand before those of rows, and the factor of what is there, if that
        // is read, before that of a·b.
        gemm::gemm(
            of_a.rows,
            of_b.columns,
            of_a.columns,
            result.as_mut_ptr(),
            stride(of_result.column_stride),
            stride(of_result.row_stride),
            add,
            a.as_ptr(),
            stride(of_a.column_stride),
            stride(of_a.row_stride),
            b.as_ptr(),
            stride(of_b.column_stride),
            stride(of_b.row_stride),
            T::one(),
            T::one(),
            false,
            false,
            false,
            gemm::Parallelism::None,
        );
    }
}

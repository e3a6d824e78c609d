//! Columns of coordinates, and of gradients with respect to them.

use core::ops::Range;

/// Coordinates of points, a column each: (x, y, z), or (t, x, y, z).
#[derive(Clone, Copy, Debug)]
pub struct Coordinates<'a, T> {
    columns: [&'a [T]; 4],
    dimension: usize,
}

impl<'a, T> Coordinates<'a, T> {
    /// Points in space.
    ///
    /// # Panics
    /// If the columns are of different length.
    pub fn xyz(x: &'a [T], y: &'a [T], z: &'a [T]) -> Self {
        assert!(x.len() == y.len() && y.len() == z.len());
        Self { columns: [x, y, z, &[]], dimension: 3 }
    }

    /// Points in time and space.
    ///
    /// # Panics
    /// If the columns are of different length.
    pub fn txyz(t: &'a [T], x: &'a [T], y: &'a [T], z: &'a [T]) -> Self {
        assert!(t.len() == x.len() && x.len() == y.len() && y.len() == z.len());
        Self { columns: [t, x, y, z], dimension: 4 }
    }

    /// Points in space, and in time where the dimension is 4.
    ///
    /// # Panics
    /// If the columns are of different length.
    pub fn of(dimension: usize, t: &'a [T], [x, y, z]: [&'a [T]; 3]) -> Self {
        if dimension == 4 { Self::txyz(t, x, y, z) } else { Self::xyz(x, y, z) }
    }

    /// The columns, as many as there are dimensions.
    pub fn columns(&self) -> &[&'a [T]] {
        &self.columns[..self.dimension]
    }

    /// 3 or 4.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.columns[0].len()
    }

    /// Returns whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Some of the points.
    ///
    /// # Panics
    /// If there are not that many.
    pub fn range(&self, range: Range<usize>) -> Self {
        let cut = |column: &'a [T]| if column.is_empty() { column } else { &column[range.clone()] };
        Self { columns: self.columns.map(cut), dimension: self.dimension }
    }
}

/// Gradients with respect to coordinates, a column each, in the order of [`Coordinates`].
#[derive(Debug)]
pub struct CoordinatesMut<'a, T> {
    columns: [&'a mut [T]; 4],
    dimension: usize,
}

impl<'a, T> CoordinatesMut<'a, T> {
    /// Takes points in space.
    ///
    /// # Panics
    /// If the columns are of different length.
    pub fn xyz(x: &'a mut [T], y: &'a mut [T], z: &'a mut [T]) -> Self {
        assert!(x.len() == y.len() && y.len() == z.len());
        Self { columns: [x, y, z, &mut []], dimension: 3 }
    }

    /// Takes points in time and space.
    ///
    /// # Panics
    /// If the columns are of different length.
    pub fn txyz(t: &'a mut [T], x: &'a mut [T], y: &'a mut [T], z: &'a mut [T]) -> Self {
        assert!(t.len() == x.len() && x.len() == y.len() && y.len() == z.len());
        Self { columns: [t, x, y, z], dimension: 4 }
    }

    /// Takes points in space, and in time where the dimension is 4.
    ///
    /// # Panics
    /// If the columns are of different length.
    pub fn of(dimension: usize, t: &'a mut [T], [x, y, z]: [&'a mut [T]; 3]) -> Self {
        if dimension == 4 { Self::txyz(t, x, y, z) } else { Self::xyz(x, y, z) }
    }

    /// The columns, as many as there are dimensions.
    pub fn columns(&mut self) -> &mut [&'a mut [T]] {
        &mut self.columns[..self.dimension]
    }

    /// 3 or 4.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.columns[0].len()
    }

    /// Returns whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The first `count` points and the rest.
    ///
    /// # Panics
    /// If there are not that many.
    pub fn split_at(self, count: usize) -> (Self, Self) {
        let dimension = self.dimension;
        let halves = self.columns.map(|column| column.split_at_mut(count.min(column.len())));
        let [(a, e), (b, f), (c, g), (d, h)] = halves;
        (Self { columns: [a, b, c, d], dimension }, Self { columns: [e, f, g, h], dimension })
    }
}

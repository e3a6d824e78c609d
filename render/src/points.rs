//! Columns of coordinates, and of gradients with respect to them.

use core::ops::{Deref, Range};

/// Columns of points: (x, y, z), or (t, x, y, z).
#[derive(Clone, Copy, Debug)]
pub struct Columns<C> {
    columns: [C; 4],
    dimension: usize,
}

/// Coordinates of points, a column each.
pub type Coordinates<'a, T> = Columns<&'a [T]>;

/// Gradients with respect to coordinates, a column each, in the order of [`Coordinates`].
pub type CoordinatesMut<'a, T> = Columns<&'a mut [T]>;

impl<T, C: Deref<Target = [T]> + Default> Columns<C> {
    /// Takes points in space.
    ///
    /// # Panics
    /// If the columns are of different length.
    pub fn xyz(x: C, y: C, z: C) -> Self {
        assert!(x.len() == y.len() && y.len() == z.len());
        Self { columns: [x, y, z, C::default()], dimension: 3 }
    }

    /// Takes points in time and space.
    ///
    /// # Panics
    /// If the columns are of different length.
    pub fn txyz(t: C, x: C, y: C, z: C) -> Self {
        assert!(t.len() == x.len() && x.len() == y.len() && y.len() == z.len());
        Self { columns: [t, x, y, z], dimension: 4 }
    }

    /// Takes points in space, and in time where the dimension is 4.
    ///
    /// # Panics
    /// If the columns are of different length.
    pub fn of(dimension: usize, t: C, [x, y, z]: [C; 3]) -> Self {
        if dimension == 4 { Self::txyz(t, x, y, z) } else { Self::xyz(x, y, z) }
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
}

impl<'a, T> Coordinates<'a, T> {
    /// The columns, as many as there are dimensions.
    pub fn columns(&self) -> &[&'a [T]] {
        &self.columns[..self.dimension]
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

impl<'a, T> CoordinatesMut<'a, T> {
    /// The columns, as many as there are dimensions.
    pub fn columns(&mut self) -> &mut [&'a mut [T]] {
        &mut self.columns[..self.dimension]
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

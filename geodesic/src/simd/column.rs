//! Columns of results that start on a cache line.

use crate::error::Error;
use core::ops::{Deref, DerefMut, Range};

/// Doubles per cache line.
const LINE: usize = 8;

/// Range of part number `k` of columns that hold one part after the other, by the ends of all parts; empty if there is no
/// such part.
#[inline]
pub(crate) fn span(ends: &[usize], k: usize) -> Range<usize> {
    let end = |k: usize| ends.get(k).or(ends.last()).copied().unwrap_or(0);
    k.checked_sub(1).map_or(0, end)..end(k)
}

/// Something that starts on a cache line, so that no register in it lies across two.
#[repr(align(64))]
pub(super) struct Aligned<T>(pub T);

/// A column of doubles. Its first one lies on a 64-byte boundary, so that registers of rays with
/// a multiple of four points are not written across two lines.
#[derive(Debug, Default)]
pub(super) struct Column {
    data: Vec<f64>,
    shift: usize,
    len: usize,
}

impl Column {
    /// Makes room for `len` numbers; what they are is unspecified.
    pub fn resize(&mut self, len: Option<usize>) -> Result<(), Error> {
        let few = "few enough for the memory, with all rays";
        let refused = |len| Error::out_of_range("points per ray", len, few);
        let len =
            len.and_then(|len| len.checked_add(LINE)).ok_or_else(|| refused(f64::INFINITY))?;
        if self.data.len() < len {
            self.data = Vec::new();
            let room = self.data.try_reserve_exact(len);
            room.map_err(|_| refused(len as f64))?;
            self.data.resize(len, 0.0);
            self.shift = (LINE - (self.data.as_ptr().addr() / size_of::<f64>()) % LINE) % LINE;
        }
        self.len = len - LINE;
        Ok(())
    }
}

impl Clone for Column {
    fn clone(&self) -> Self {
        Self { data: self.to_vec(), shift: 0, len: self.len }
    }
}

impl Deref for Column {
    type Target = [f64];

    #[inline]
    fn deref(&self) -> &[f64] {
        &self.data[self.shift..self.shift + self.len]
    }
}

impl DerefMut for Column {
    #[inline]
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.data[self.shift..self.shift + self.len]
    }
}

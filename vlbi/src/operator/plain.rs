//! Measurements of pixels themselves.

use super::{Float, Operator};

/// Every pixel of every frame.
#[derive(Debug, Clone, Copy)]
pub struct FullImage {
    /// Images of a movie.
    pub frames: usize,
    /// Pixels of an image.
    pub pixels: usize,
}

/// The total flux of every frame in Jy.
#[derive(Debug, Clone, Copy)]
pub struct LightCurve {
    /// Images of a movie.
    pub frames: usize,
    /// Pixels of an image.
    pub pixels: usize,
}

impl<T: Float> Operator<T> for FullImage {
    type Datum = T;

    fn frames(&self) -> usize {
        self.frames
    }

    fn pixels(&self) -> usize {
        self.pixels
    }

    fn data(&self) -> usize {
        self.frames * self.pixels
    }

    fn forward(&self, movie: &[T], data: &mut [T]) {
        data.copy_from_slice(movie);
    }

    fn adjoint(&self, data: &[T], movie: &mut [T]) {
        assert_eq!(data.len(), movie.len());
        movie.iter_mut().zip(data).for_each(|(pixel, datum)| *pixel += *datum);
    }
}

impl<T: Float> Operator<T> for LightCurve {
    type Datum = T;

    fn frames(&self) -> usize {
        self.frames
    }

    fn pixels(&self) -> usize {
        self.pixels
    }

    fn data(&self) -> usize {
        self.frames
    }

    fn forward(&self, movie: &[T], data: &mut [T]) {
        assert_eq!((movie.len(), data.len()), (self.frames * self.pixels, self.frames));
        for (flux, frame) in data.iter_mut().zip(movie.chunks_exact(self.pixels)) {
            *flux = frame.iter().copied().sum();
        }
    }

    fn adjoint(&self, data: &[T], movie: &mut [T]) {
        assert_eq!((movie.len(), data.len()), (self.frames * self.pixels, self.frames));
        for (flux, frame) in data.iter().zip(movie.chunks_exact_mut(self.pixels)) {
            frame.iter_mut().for_each(|pixel| *pixel += *flux);
        }
    }
}

//! Images that follow each other, in memory or in a file: a movie that is larger than memory is read image by image.

use crate::Error;
use crate::memory::{self, Scratch};
use crate::simd::Float;
use std::borrow::Cow;
use std::io::{Seek, SeekFrom};
use std::sync::{Arc, Mutex, PoisonError};

/// A file for images could not be written or read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("the scratch file of {count} images of {pixels} pixels cannot be {what}: {error}")]
pub struct ScratchError {
    count: usize,
    pixels: usize,
    what: &'static str,
    error: String,
}

/// Images of the same number of pixels. A copy shares them.
#[derive(Clone, Debug)]
pub struct Frames<T> {
    pixels: usize,
    count: usize,
    store: Store<T>,
}

#[derive(Clone)]
enum Store<T> {
    Memory(Arc<Vec<T>>),
    File(Arc<Mutex<Box<dyn Scratch>>>),
}

impl<T> core::fmt::Debug for Store<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(if matches!(self, Store::Memory(_)) { "memory" } else { "file" })
    }
}

impl<T: Float> Frames<T> {
    /// Takes pixels in memory, image after image.
    ///
    /// # Panics
    /// If they are not whole images.
    pub fn of(values: Vec<T>, pixels: usize) -> Self {
        let count = values.len().checked_div(pixels).unwrap_or(0);
        assert_eq!(count * pixels, values.len(), "whole images");
        Self { pixels, count, store: Store::Memory(Arc::new(values)) }
    }

    /// Takes images that `make` hands over one after the other, in memory where they are a small part of what may be
    /// taken ([`memory::part`]), otherwise in a file.
    ///
    /// # Errors
    /// Those of `make`; if there is no memory and no file for them.
    ///
    /// # Panics
    /// If `make` hands over another number of images, or of pixels.
    pub fn made<E: From<Error>>(
        count: usize,
        pixels: usize,
        make: impl FnOnce(&mut Sink<'_, T>) -> Result<(), E>,
    ) -> Result<Self, E> {
        // In floating point, so that no number of images can overflow.
        let bytes = count as f64 * pixels as f64 * size_of::<T>() as f64;
        let file = if bytes > memory::part(SHARE) { memory::scratch(bytes) } else { None };
        let failed = |error| failure(count, pixels, "written", &error);
        let Some(file) = file else {
            memory::afford(|| format!("{count} images of {pixels} pixels"), bytes)?;
            let mut values = Vec::with_capacity(count * pixels);
            make(&mut |image: &[T]| {
                values.extend_from_slice(image);
                Ok(())
            })?;
            assert_eq!(values.len(), count * pixels, "as many images as were announced");
            return Ok(Self::of(values, pixels));
        };
        let mut file = file.map_err(failed).map_err(Error::from)?;
        let (mut bytes, mut written) = (Vec::new(), 0);
        make(&mut |image: &[T]| {
            bytes.clear();
            image.iter().for_each(|x| put(*x, &mut bytes));
            written += image.len();
            Ok(file.write_all(&bytes).map_err(failed)?)
        })?;
        assert_eq!(written, count * pixels, "as many images as were announced");
        Ok(Self { pixels, count, store: Store::File(Arc::new(Mutex::new(file))) })
    }

    /// Returns the number of images.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Pixels of an image.
    pub fn pixels(&self) -> usize {
        self.pixels
    }

    /// An image.
    ///
    /// # Errors
    /// If it cannot be read.
    ///
    /// # Panics
    /// If there is no such image.
    pub fn image(&self, frame: usize) -> Result<Cow<'_, [T]>, Error> {
        let Store::Memory(values) = &self.store else {
            return Ok(self.read(frame * self.pixels, self.pixels)?.into());
        };
        Ok(values[frame * self.pixels..(frame + 1) * self.pixels].into())
    }

    /// A pixel of an image.
    ///
    /// # Errors
    /// If it cannot be read.
    ///
    /// # Panics
    /// If there is no such image.
    pub fn pixel(&self, frame: usize, pixel: usize) -> Result<T, Error> {
        let at = frame * self.pixels + pixel;
        match &self.store {
            Store::Memory(values) => Ok(values[at]),
            Store::File(_) => Ok(self.read(at, 1)?[0]),
        }
    }

    /// All images, one after the other.
    pub fn images(&self) -> impl Iterator<Item = Result<Cow<'_, [T]>, Error>> {
        (0..self.count).map(|frame| self.image(frame))
    }

    /// All pixels in memory.
    ///
    /// # Errors
    /// If they cannot be read.
    pub fn to_vec(&self) -> Result<Vec<T>, Error> {
        let mut all = Vec::with_capacity(self.count * self.pixels);
        for image in self.images() {
            all.extend_from_slice(&image?);
        }
        Ok(all)
    }

    /// Sum over the pixels of each image, in double precision.
    ///
    /// # Errors
    /// If they cannot be read.
    pub fn sums(&self) -> Result<Vec<f64>, Error> {
        self.images().map(|image| Ok(image?.iter().map(|x| x.double()).sum())).collect()
    }

    /// The largest pixel of all images, 0 at least.
    ///
    /// # Errors
    /// If they cannot be read.
    pub fn largest(&self) -> Result<T, Error> {
        let mut largest = T::zero();
        for image in self.images() {
            largest = image?.iter().fold(largest, |most, x| most.max(*x));
        }
        Ok(largest)
    }

    /// Images of other pixels, each made of one of these.
    ///
    /// # Errors
    /// If they cannot be read or kept.
    pub fn mapped<U: Float>(
        &self,
        pixels: usize,
        mut map: impl FnMut(&[T]) -> Vec<U>,
    ) -> Result<Frames<U>, Error> {
        Frames::made(self.count, pixels, |sink| {
            self.images().try_for_each(|image| sink(&map(&image?)))
        })
    }

    fn read(&self, from: usize, count: usize) -> Result<Vec<T>, ScratchError> {
        let Store::File(file) = &self.store else { return Ok(Vec::new()) };
        let size = size_of::<T>();
        let mut bytes = vec![0; count * size];
        // A reader that panicked has left nothing half done: every read seeks first.
        let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
        let place = SeekFrom::Start((from * size) as u64);
        let read = file.seek(place).and_then(|_| file.read_exact(&mut bytes));
        // Others may read while these bytes become numbers.
        drop(file);
        read.map_err(|error| failure(self.count, self.pixels, "read", &error))?;
        Ok(bytes.chunks_exact(size).map(get).collect())
    }
}

/// Share of the memory that a movie may take.
const SHARE: f64 = 1.0 / 8.0;

/// Takes an image.
pub type Sink<'a, T, E = Error> = dyn FnMut(&[T]) -> Result<(), E> + 'a;

fn failure(
    count: usize,
    pixels: usize,
    what: &'static str,
    error: &std::io::Error,
) -> ScratchError {
    ScratchError { count, pixels, what, error: error.to_string() }
}

/// The bytes of a number, of four or eight bytes.
fn put<T: Float>(x: T, bytes: &mut Vec<u8>) {
    // Exact: a number of four bytes is an f32.
    match size_of::<T>() {
        4 => bytes.extend_from_slice(&(x.double() as f32).to_le_bytes()),
        _ => bytes.extend_from_slice(&x.double().to_le_bytes()),
    }
}

fn get<T: Float>(bytes: &[u8]) -> T {
    T::of(match *bytes {
        [a, b, c, d] => f64::from(f32::from_le_bytes([a, b, c, d])),
        [a, b, c, d, e, f, g, h] => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
        _ => f64::NAN,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn in_file<T: Float>(values: &[T], pixels: usize) -> Frames<T> {
        let mut bytes = Vec::new();
        values.iter().for_each(|x| put(*x, &mut bytes));
        let file: Box<dyn Scratch> = Box::new(Cursor::new(bytes));
        let store = Store::File(Arc::new(Mutex::new(file)));
        Frames { pixels, count: values.len() / pixels, store }
    }

    fn assert_same<T: Float>(values: &[f64]) {
        let values: Vec<T> = values.iter().map(|x| T::of(*x)).collect();
        let (here, there) = (Frames::of(values.clone(), 3), in_file(&values, 3));
        assert_eq!((there.count(), there.pixels()), (2, 3));
        let bits = |all: Vec<T>| all.iter().map(|x| x.double().to_bits()).collect::<Vec<u64>>();
        assert_eq!(bits(here.to_vec().unwrap()), bits(there.to_vec().unwrap()));
        assert_eq!(bits(there.image(1).unwrap().into_owned()), bits(values[3..].to_vec()));
        for (k, value) in values.iter().enumerate() {
            let pixel = there.pixel(k / 3, k % 3).unwrap();
            assert_eq!(bits(vec![pixel]), bits(vec![*value]));
        }
        assert_eq!(here.sums().unwrap(), there.sums().unwrap());
        assert_eq!(here.largest().unwrap(), there.largest().unwrap());
    }

    #[test]
    fn exact_files_keep_every_bit() {
        let values = [0.1, -0.0, f64::MIN_POSITIVE, 1.0 / 3.0, -2.5e30, 7.0];
        assert_same::<f64>(&values);
        assert_same::<f32>(&values);
    }

    #[test]
    fn exact_files_that_end_too_early_are_errors() {
        let whole = in_file(&[1.0, 2.0, 3.0, 4.0], 2);
        let short = Frames { count: 3, ..whole };
        assert_eq!(*short.image(1).unwrap(), [3.0, 4.0]);
        let message = short.image(2).unwrap_err().to_string();
        assert!(message.starts_with("the scratch file of 3 images of 2 pixels cannot be read"));
        assert!(short.pixel(2, 1).is_err() && short.sums().is_err());
    }
}

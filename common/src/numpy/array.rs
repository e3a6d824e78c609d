//! NPY arrays.

use super::NumpyError;
use crate::Error;
use crate::memory;
use npyz::WriterBuilder;
use std::io::{Chain, Cursor, Read};

/// Brackets within brackets of a header: types of fields within fields. Its parser takes twice as long for each more.
const MOST_NESTED: usize = 8;

/// Bytes of a header, at most.
const LONGEST: u64 = 1 << 20;

/// The bytes of an array, of which the header was looked at.
pub type Headed<R> = Chain<Cursor<Vec<u8>>, R>;

/// Shape of an array of numbers of any type, and its numbers in C's order.
///
/// # Errors
/// If the bytes are no array of numbers, or fewer or more than its shape says.
pub fn read_array(bytes: &[u8]) -> Result<(Vec<u64>, Vec<f64>), Error> {
    let file = open(bytes)?;
    let in_fortran = file.order() == npyz::Order::Fortran;
    let shape = file.shape().to_vec();
    let count = shape.iter().try_fold(1u64, |product, n| product.checked_mul(*n));
    // At least a byte each, so that a header cannot ask for more memory than there is file.
    if count.is_none_or(|count| count == 0 || count > bytes.len() as u64) {
        let message = format!("shape {shape:?} does not go with {} bytes", bytes.len());
        return Err(NumpyError::content(message).into());
    }
    let values = 8.0 * count.unwrap_or_default() as f64;
    memory::afford(|| format!("the array of shape {shape:?}"), values)?;
    let values = numbers(file)?;
    let values = if in_fortran { in_c_order(&shape, &values) } else { values };
    Ok((shape, values))
}

/// An array, if its header is one that the parser reads in no time.
///
/// # Errors
/// If the bytes are no array, or the header is longer than a mebibyte or nested more than eight deep.
pub fn open<R: Read>(mut bytes: R) -> Result<npyz::NpyFile<Headed<R>>, NumpyError> {
    let not = |error| NumpyError::content(format!("not an npy file: {error}"));
    let mut header = Vec::new();
    // The length of the header is behind the name of the format and its version, in two bytes of the first and four of others.
    bytes.by_ref().take(12).read_to_end(&mut header).map_err(not)?;
    let rest = match *header.as_slice() {
        [_, _, _, _, _, _, 1, _, a, b, ..] => {
            u64::from(u16::from_le_bytes([a, b])).saturating_sub(2)
        }
        [_, _, _, _, _, _, _, _, a, b, c, d] => u64::from(u32::from_le_bytes([a, b, c, d])),
        _ => 0,
    };
    if header.starts_with(b"\x93NUMPY") && rest > LONGEST {
        let message = format!("a header of {rest} bytes is not read: at most {LONGEST}");
        return Err(NumpyError::content(message));
    }
    bytes.by_ref().take(rest.min(LONGEST)).read_to_end(&mut header).map_err(not)?;
    let depth = nested(&header[header.len().min(10)..]);
    if depth > MOST_NESTED {
        let message =
            format!("a header with brackets {depth} deep is not read: at most {MOST_NESTED}");
        return Err(NumpyError::content(message));
    }
    npyz::NpyFile::new(Cursor::new(header).chain(bytes)).map_err(not)
}

/// Returns how deep brackets of any kind are nested, outside of strings.
fn nested(text: &[u8]) -> usize {
    let (mut depth, mut most, mut string) = (0usize, 0, None);
    let mut bytes = text.iter();
    while let Some(byte) = bytes.next() {
        match (string, byte) {
            (None, b'\'' | b'"') => string = Some(byte),
            (Some(quote), _) if quote == byte => string = None,
            // What follows ends no string.
            (Some(_), b'\\') => drop(bytes.next()),
            (None, b'[' | b'(' | b'{') => depth += 1,
            (None, b']' | b')' | b'}') => depth = depth.saturating_sub(1),
            _ => {}
        }
        most = most.max(depth);
    }
    most
}

/// Values whose first index runs fastest, with the last running fastest.
fn in_c_order(shape: &[u64], values: &[f64]) -> Vec<f64> {
    let shape: Vec<usize> = shape.iter().map(|n| *n as usize).collect();
    let mut index = vec![0; shape.len()];
    let mut ordered = Vec::with_capacity(values.len());
    for _ in 0..values.len() {
        // In the file the first index runs fastest: strides grow from the front.
        let at = index.iter().zip(&shape).rev().fold(0, |at, (k, n)| at * n + k);
        ordered.push(values[at]);
        for (k, n) in index.iter_mut().zip(&shape).rev() {
            *k += 1;
            if *k < *n {
                break;
            }
            *k = 0;
        }
    }
    ordered
}

/// The values of an array of any number type that does not depend on the machine.
fn numbers(file: npyz::NpyFile<impl Read>) -> Result<Vec<f64>, NumpyError> {
    let mut all = Vec::with_capacity(file.len() as usize);
    each_number(file, &mut |x| {
        all.push(x);
        Ok(())
    })
    .map_err(|error: Error| NumpyError::content(error.to_string()))?;
    Ok(all)
}

/// An array that is read number by number.
pub struct Stream<R: Read>(npyz::NpyFile<Headed<R>>);

impl<R: Read> Stream<R> {
    /// The array that these bytes are the beginning of.
    ///
    /// # Errors
    /// If they are none, or its last index does not run fastest.
    pub fn new(bytes: R) -> Result<Self, Error> {
        let file = open(bytes)?;
        if file.order() == npyz::Order::Fortran && file.shape().len() > 1 {
            let message = "is in Fortran's order: C's order is expected of arrays that are larger than memory";
            return Err(NumpyError::content(message).into());
        }
        Ok(Self(file))
    }

    /// Numbers along each axis.
    pub fn shape(&self) -> &[u64] {
        self.0.shape()
    }

    /// Hands over all numbers, `length` at a time.
    ///
    /// # Errors
    /// Those of `take`; if there are fewer or more numbers than the shape says.
    pub fn chunks<E: From<Error>>(
        self,
        length: usize,
        mut take: impl FnMut(&[f64]) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut some = Vec::with_capacity(length);
        each_number(self.0, &mut |x| {
            some.push(x);
            if some.len() < length {
                return Ok(());
            }
            let taken = take(&some);
            some.clear();
            taken
        })
    }
}

/// Hands over the values of an array of any number type that does not depend on the machine.
fn each_number<R: Read, E: From<Error>>(
    file: npyz::NpyFile<R>,
    take: &mut dyn FnMut(f64) -> Result<(), E>,
) -> Result<(), E> {
    use npyz::TypeChar::{Float, Int, Uint};
    fn of<R: Read, T: npyz::Deserialize, E: From<Error>>(
        file: npyz::NpyFile<R>,
        value: impl Fn(T) -> f64,
        take: &mut dyn FnMut(f64) -> Result<(), E>,
    ) -> Result<(), E> {
        let damaged = |message: String| Error::from(NumpyError::content(message));
        let header = file.header().clone();
        let shape = header.shape().to_vec();
        // Lent to the array, so that what lies behind it can be read.
        let mut rest = file.into_inner();
        let file = npyz::NpyFile::with_header(header, &mut rest);
        for x in file.data::<T>().map_err(|error| damaged(error.to_string()))? {
            take(value(x.map_err(|error| damaged(error.to_string()))?))?;
        }
        // Finds bytes that the shape does not count, and has an archive compare its checksum.
        match rest.read(&mut [0]) {
            Ok(0) => Ok(()),
            Ok(_) => {
                Err(damaged(format!("there are more bytes than the shape {shape:?} has")).into())
            }
            Err(error) => Err(damaged(error.to_string()).into()),
        }
    }
    let kind = match file.dtype() {
        npyz::DType::Plain(plain) => Some((plain.type_char(), plain.size_field())),
        _ => None,
    };
    match kind {
        Some((Float, 4)) => of::<R, f32, E>(file, f64::from, take),
        Some((Float, 8)) => of::<R, f64, E>(file, |x| x, take),
        Some((Int, 1)) => of::<R, i8, E>(file, f64::from, take),
        Some((Int, 2)) => of::<R, i16, E>(file, f64::from, take),
        Some((Int, 4)) => of::<R, i32, E>(file, f64::from, take),
        Some((Int, 8)) => of::<R, i64, E>(file, |n| n as f64, take),
        Some((Uint, 1)) => of::<R, u8, E>(file, f64::from, take),
        Some((Uint, 2)) => of::<R, u16, E>(file, f64::from, take),
        Some((Uint, 4)) => of::<R, u32, E>(file, f64::from, take),
        Some((Uint, 8)) => of::<R, u64, E>(file, |n| n as f64, take),
        _ => {
            let kind = file.dtype().descr();
            let wanted = "whole numbers, float32 or float64 are expected";
            Err(Error::from(NumpyError::content(format!("values of type {kind}: {wanted}"))).into())
        }
    }
}

/// The bytes of an array in C's order.
///
/// # Panics
/// If there are not as many values as the shape says.
pub fn write_array<T: npyz::AutoSerialize>(
    shape: &[u64],
    values: impl IntoIterator<Item = T>,
) -> Vec<u8> {
    let mut bytes = Vec::new();
    let options = npyz::WriteOptions::new().default_dtype().shape(shape);
    let mut writer = options.writer(&mut bytes).begin_nd().expect("memory");
    writer.extend(values).expect("memory");
    writer.finish().expect("as many values as the shape says");
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A header of 200 brackets would take the parser longer than anybody waits.
    #[test]
    fn exact_nested_headers_are_errors() {
        for each in ["[", "(1,", "{1:", "(')',", r"('\'',"] {
            let text = format!("{{'descr': {}", each.repeat(200));
            let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
            bytes.extend((text.len() as u16).to_le_bytes());
            bytes.extend(text.as_bytes());
            let error = read_array(&bytes).unwrap_err().to_string();
            assert!(error.contains("brackets 201 deep"), "{error}");
            assert!(Stream::new(bytes.as_slice()).is_err());
        }
        // A length of 4 GiB asks for no memory.
        let long = b"\x93NUMPY\x02\x00\xff\xff\xff\xff{}";
        let error = read_array(long).unwrap_err().to_string();
        assert!(error.contains("a header of 4294967295 bytes"), "{error}");
        let error = read_array(b"1.0, 2.0, 3.0, 4.0").unwrap_err().to_string();
        assert!(error.contains("not an npy file"), "{error}");
    }

    /// Two arrays in one file: the second is not left out silently.
    #[test]
    fn exact_bytes_behind_an_array_are_errors() {
        let mut bytes = write_array(&[2, 2], [1.0; 4]);
        assert!(read_array(&bytes).is_ok());
        bytes.extend(write_array(&[2, 2], [2.0; 4]));
        let error = read_array(&bytes).unwrap_err().to_string();
        assert!(error.contains("more bytes than the shape [2, 2]"), "{error}");
        let stream = Stream::new(bytes.as_slice()).unwrap();
        assert!(stream.chunks::<Error>(4, |_| Ok(())).is_err());
    }

    /// An array and its transpose in the other order are the same bytes of numbers.
    #[test]
    fn exact_fortran_order() {
        let write = |order, values: &[f64]| {
            use npyz::WriterBuilder;
            let mut bytes = Vec::new();
            let options = npyz::WriteOptions::new().default_dtype().order(order);
            let mut writer = options.shape(&[2, 3, 4]).writer(&mut bytes).begin_nd().unwrap();
            writer.extend(values.iter().copied()).unwrap();
            writer.finish().unwrap();
            bytes
        };
        let value = |i: usize, j: usize, k: usize| (100 * i + 10 * j + k) as f64;
        let in_c: Vec<f64> = (0..24).map(|n| value(n / 12, n / 4 % 3, n % 4)).collect();
        let in_fortran: Vec<f64> = (0..24).map(|n| value(n % 2, n / 2 % 3, n / 6)).collect();
        let c = read_array(&write(npyz::Order::C, &in_c)).unwrap();
        let fortran = read_array(&write(npyz::Order::Fortran, &in_fortran)).unwrap();
        assert_eq!(c, (vec![2, 3, 4], in_c));
        assert_eq!(fortran, c);
    }
}

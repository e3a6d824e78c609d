//! Numbers as the bytes of buffers.

/// The bytes of numbers.
pub fn floats(numbers: &[f32]) -> Vec<u8> {
    flat(numbers, f32::to_le_bytes)
}

/// The bytes of whole numbers.
pub fn words(numbers: &[u32]) -> Vec<u8> {
    flat(numbers, u32::to_le_bytes)
}

/// Written so that it is a copy of memory where that has the order of bytes that devices have.
fn flat<N: Copy>(numbers: &[N], bytes_of: fn(N) -> [u8; 4]) -> Vec<u8> {
    let mut bytes = vec![0; 4 * numbers.len()];
    for (bytes, number) in bytes.as_chunks_mut().0.iter_mut().zip(numbers) {
        *bytes = bytes_of(*number);
    }
    bytes
}

/// The numbers of bytes.
pub fn read(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect()
}

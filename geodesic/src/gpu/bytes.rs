//! Numbers in what kernels write.

/// Word number `at`.
pub(super) fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(core::array::from_fn(|k| bytes[4 * at + k]))
}

/// The same as a float.
pub(super) fn single(bytes: &[u8], at: usize) -> f32 {
    f32::from_bits(word(bytes, at))
}

/// The same, widened.
pub(super) fn float(bytes: &[u8], at: usize) -> f64 {
    f64::from(single(bytes, at))
}

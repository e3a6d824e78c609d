//! A test that every device passes before it is used.

use super::bytes::float;
use super::compute::Compute;
use super::error::GpuError;
use super::kernel;
use crate::wgsl::{self, POINT_BYTES};

const SELF_TEST: &str = include_str!("self_test.wgsl");

/// Sums and products of two floats on the device, against exact ones.
pub(super) fn test_sums(device: &Compute) -> Result<(), GpuError> {
    let source = [wgsl::TWO_FLOATS, SELF_TEST].join("\n");
    let pairs: Vec<[f32; 2]> = (1..=256u32).map(|k| pair(k.wrapping_mul(2_654_435_761))).collect();
    let points: Vec<u8> = pairs.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    let kernels = kernel::compiled(device, &source, &["kerr_self_test"])?;
    let (uniform, count) = ([0; POINT_BYTES], pairs.len() as u32);
    let room = [16 * u64::from(count)];
    let outputs = kernel::run(device, &kernels, count, &uniform, &[&points], &room)?;
    let exact = pairs.iter().zip(outputs[0].chunks_exact(16)).all(|([a, b], bytes)| {
        let (a, b) = (f64::from(*a), f64::from(*b));
        let [sum, product] = [0, 2].map(|k| float(bytes, k) + float(bytes, k + 1));
        sum == a + b && product == a * b
    });
    if exact { Ok(()) } else { Err(GpuError::Inexact(device.name().to_owned())) }
}

/// Two floats with all their digits, of magnitudes up to 2⁸ apart.
fn pair(bits: u32) -> [f32; 2] {
    let digits = |x: u32| 1.0 + (x & 0x7f_ffff) as f32 / 8_388_608.0;
    let sign = if bits & 1 == 0 { 1.0 } else { -1.0 };
    [digits(bits), sign * digits(bits.rotate_left(13)) / f32::from(1u16 << (bits >> 29))]
}

//! Seeds of what is drawn many times.

/// The purpose of draws of a posterior; 0, 1 and 3 are those of steps.
pub const OF_POSTERIOR: u64 = 2;

/// The seed of a draw by its number, a step say, for one of four purposes.
pub fn mixed_seed(seed: u64, number: u64, purpose: u64) -> u64 {
    // SplitMix64's finaliser (Steele, Lea & Flood 2014): seeds and numbers in a row give unrelated
    // streams. Two bits tell four purposes apart.
    let mut x = seed ^ number.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ purpose << 62;
    x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    x ^ (x >> 31)
}

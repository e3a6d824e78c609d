//! Rays in blocks, on all cores where there are threads.

use crate::error::{Error, check};
use crate::interrupt;

/// Rays that one task works on step by step.
pub(crate) const BLOCK: usize = 64;

/// `work` on blocks of `size` rays, in their order.
pub(crate) fn in_blocks<T: Send>(
    size: usize,
    alpha: &[f64],
    beta: &[f64],
    work: impl Fn(&[f64], &[f64]) -> T + Sync + Send,
) -> Vec<T> {
    let work = |alpha: &[f64], beta: &[f64]| {
        interrupt::check();
        work(alpha, beta)
    };
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        // A single block stays on the calling thread: waking others costs more than it.
        if (1..=size).contains(&alpha.len()) {
            return vec![work(alpha, beta)];
        }
        let blocks = alpha.par_chunks(size).zip(beta.par_chunks(size));
        blocks.map(|(alpha, beta)| work(alpha, beta)).collect()
    }
    #[cfg(not(feature = "rayon"))]
    {
        let blocks = alpha.chunks(size).zip(beta.chunks(size));
        blocks.map(|(alpha, beta)| work(alpha, beta)).collect()
    }
}

/// Checks that there is a β for every α.
pub(crate) fn check_columns(alpha: &[f64], beta: &[f64]) -> Result<(), Error> {
    let same = alpha.len() == beta.len();
    check("number of beta", beta.len() as f64, same, "as many as of alpha")?;
    Ok(())
}

//! Rays in blocks, on all cores where there are threads.

/// Rays that one task works on.
const BLOCK: usize = 64;

/// `work` on blocks of rays, in their order.
pub(crate) fn in_blocks<T: Send>(
    alpha: &[f64],
    beta: &[f64],
    work: impl Fn(&[f64], &[f64]) -> T + Sync + Send,
) -> Vec<T> {
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        let blocks = alpha.par_chunks(BLOCK).zip(beta.par_chunks(BLOCK));
        blocks.map(|(alpha, beta)| work(alpha, beta)).collect()
    }
    #[cfg(not(feature = "rayon"))]
    {
        let blocks = alpha.chunks(BLOCK).zip(beta.chunks(BLOCK));
        blocks.map(|(alpha, beta)| work(alpha, beta)).collect()
    }
}

//! Choosing, among many closure quantities, a largest set of independent ones.

/// Keeps those of `candidates` (sets of baselines, best first) that are independent of the ones
/// kept before, over the field of two elements.
///
/// Closure quantities are sums of ±1 times a property of each baseline. Independence modulo 2
/// implies independence; and the sets that it keeps are largest ones when all baselines are
/// there: (n − 1)(n − 2)/2 triangles, n(n − 3)/2 quadrangles of n stations.
pub fn keep_independent(
    baselines: usize,
    candidates: impl Iterator<Item = impl Iterator<Item = usize>>,
) -> Vec<usize> {
    let words = baselines.div_ceil(64);
    // Rows in echelon form, by their lowest baseline.
    let mut echelon: Vec<Option<Vec<u64>>> = vec![None; baselines];
    let mut kept = Vec::new();
    for (index, members) in candidates.enumerate() {
        let mut row = vec![0u64; words];
        members.for_each(|b| row[b / 64] ^= 1 << (b % 64));
        while let Some(lowest) = lowest(&row) {
            match &echelon[lowest] {
                Some(pivot) => row.iter_mut().zip(pivot).for_each(|(a, b)| *a ^= b),
                None => {
                    echelon[lowest] = Some(row);
                    kept.push(index);
                    break;
                }
            }
        }
    }
    kept
}

fn lowest(row: &[u64]) -> Option<usize> {
    let word = row.iter().position(|word| *word != 0)?;
    Some(word * 64 + row[word].trailing_zeros() as usize)
}

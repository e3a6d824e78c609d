//! Clocks and yardsticks of benches.

use rayon::prelude::*;
use std::time::Instant;

/// Seconds that the threads of this process have computed, on average; the wall clock where the
/// system does not tell.
fn clock(start: Instant) -> f64 {
    let of = |entry: std::io::Result<std::fs::DirEntry>| -> Option<f64> {
        let text = std::fs::read_to_string(entry.ok()?.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse().ok()
    };
    let threads = std::fs::read_dir("/proc/self/task");
    let total = threads.ok().map(|all| all.filter_map(of).sum::<f64>()).filter(|sum| *sum > 0.0);
    let wall = start.elapsed().as_secs_f64();
    total.map_or(wall, |sum| sum * 1e-9 / rayon::current_num_threads() as f64)
}

/// Returns whether something is to be measured: its name has the first word of the command line in it.
pub fn wanted(name: &str) -> bool {
    let filter = std::env::args().skip(1).find(|word| !word.starts_with('-')).unwrap_or_default();
    name.contains(&filter)
}

/// Seconds of one piece of work: the least of five means over a tenth of a second or more.
pub fn least(mut work: impl FnMut()) -> f64 {
    let zero = Instant::now();
    let mut least = f64::INFINITY;
    for _ in 0..5 {
        // The clock is asked so rarely that asking costs nothing.
        let (start, mut count, mut more) = (clock(zero), 0, 1);
        let spent = loop {
            (0..more).for_each(|_| work());
            count += more;
            more *= 2;
            let spent = clock(zero) - start;
            if spent > 0.1 {
                break spent;
            }
        };
        least = least.min(spent / f64::from(count));
    }
    least
}

/// GFLOP/s of a product of 2048 × 2048 matrices of f32, each thread with its share of columns.
pub fn large_sgemm() -> f64 {
    const N: usize = 2048;
    let (a, b, mut c) = (vec![1.0f32; N * N], vec![0.5f32; N * N], vec![0.0f32; N * N]);
    let share = N.div_ceil(rayon::current_num_threads());
    let seconds = least(|| {
        c.par_chunks_mut(N * share).zip(b.par_chunks(N * share)).for_each(|(c, b)| {
            let (columns, stride) = (c.len() / N, N as isize);
            // SAFETY: a is N × N; b and c are N × columns, column by column.
            unsafe {
                let (a, b, c) = (a.as_ptr(), b.as_ptr(), c.as_mut_ptr());
                let serial = gemm::Parallelism::None;
                gemm::gemm(
                    N, columns, N, c, stride, 1, false, a, stride, 1, b, stride, 1, 0.0, 1.0,
                    false, false, false, serial,
                );
            }
        });
    });
    assert!(c.iter().all(|x| *x == 1024.0));
    2.0 * (N as f64).powi(3) / seconds * 1e-9
}

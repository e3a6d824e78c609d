//! Ranks of truths among draws: uniform, if the draws are those of the posterior (Talts et al. 2018).

use super::Volume;
use super::metrics::same_nodes;
use crate::Error;
use rand::{Rng, RngExt};

/// Bins of a histogram of ranks.
pub const BINS: usize = 10;

/// Ranks of true values among draws of them, each as a part of all places, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ranks {
    /// Number of values.
    pub count: usize,
    /// Part of them within the middle 68 % of the draws.
    pub within_68: f64,
    /// Part of them within the middle 95 %.
    pub within_95: f64,
    /// Numbers of ranks in each tenth.
    pub histogram: [usize; BINS],
}

/// The rank of a value among draws, 0 to 1. Among equal numbers, as those of dark voxels are, and inside its own place it
/// lies at random: so the rank of one more draw is uniform for any number of draws.
pub fn rank(truth: f64, draws: impl Iterator<Item = f64>, random: &mut impl Rng) -> f64 {
    let (mut below, mut equal, mut all) = (0, 0, 0);
    for draw in draws {
        all += 1;
        below += usize::from(draw < truth);
        equal += usize::from(draw == truth);
    }
    (below as f64 + random.random::<f64>() * (equal as f64 + 1.0)) / (all as f64 + 1.0)
}

impl Ranks {
    /// Counts some ranks.
    pub fn of(ranks: impl Iterator<Item = f64>) -> Self {
        let mut all = Self::default();
        for rank in ranks {
            let away = (rank - 0.5).abs();
            all.count += 1;
            all.within_68 += f64::from(u8::from(away <= 0.34));
            all.within_95 += f64::from(u8::from(away <= 0.475));
            all.histogram[((rank * BINS as f64) as usize).min(BINS - 1)] += 1;
        }
        all.within_68 /= all.count.max(1) as f64;
        all.within_95 /= all.count.max(1) as f64;
        all
    }

    /// Returns the ranks of a truth among draws of it, at the nodes that are wanted.
    ///
    /// # Errors
    /// If nodes differ.
    pub fn of_nodes(
        draws: &[Volume],
        truth: &Volume,
        random: &mut impl Rng,
        mut wanted: impl FnMut(usize) -> bool,
    ) -> Result<Self, Error> {
        draws.iter().try_for_each(|draw| same_nodes(draw, truth))?;
        let nodes: Vec<usize> = (0..truth.values().len()).filter(|node| wanted(*node)).collect();
        let at = |volume: &Volume, node: usize| f64::from(volume.values()[node]);
        let of = |node: usize| {
            rank(at(truth, node), draws.iter().map(|draw| at(draw, node)), &mut *random)
        };
        Ok(Self::of(nodes.into_iter().map(of)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    /// A draw among others like it has a uniform rank, also where half of them are 0.
    #[test]
    fn exact_ranks_of_one_more_draw_are_uniform() {
        let mut random = Pcg64::seed_from_u64(3);
        let mut one = move || (random.random::<f64>() - 0.5).max(0.0);
        let mut other = Pcg64::seed_from_u64(4);
        let many = 40_000;
        let ranks = (0..many).map(|_| {
            let draws: Vec<f64> = (0..7).map(|_| one()).collect();
            rank(one(), draws.into_iter(), &mut other)
        });
        let found = Ranks::of(ranks);
        let error = |p: f64| 4.0 * (p * (1.0 - p) / many as f64).sqrt();
        assert_eq!(found.count, many);
        assert!((found.within_68 - 0.68).abs() < error(0.68), "{found:?}");
        assert!((found.within_95 - 0.95).abs() < error(0.95), "{found:?}");
        for bin in found.histogram {
            assert!((bin as f64 / many as f64 - 0.1).abs() < error(0.1), "{found:?}");
        }
    }

    /// A truth above all draws is in the last place, below all in the first.
    #[test]
    fn exact_ranks_tell_what_is_too_bright() {
        let volume = |value: f32| Volume::new([2; 3], [-1.0; 3], [1.0; 3], vec![value; 8]).unwrap();
        let draws: Vec<Volume> = (1..=9).map(|k| volume(k as f32)).collect();
        let mut random = Pcg64::seed_from_u64(1);
        let mut of =
            |value| Ranks::of_nodes(&draws, &volume(value), &mut random, |node| node > 1).unwrap();
        let (above, below) = (of(9.5), of(0.0));
        assert_eq!((above.count, above.within_68), (6, 0.0));
        assert_eq!(above.histogram[..9], [0; 9]);
        assert_eq!(below.histogram[1..], [0; 9]);
        assert_eq!(of(5.5).within_68, 1.0);
    }
}

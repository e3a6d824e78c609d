//! Journal of long searches, so that one that was interrupted looks at nothing twice.
//!
//! Searches are the same each time they run. One that begins anew and is told what it has found before ends with the same
//! bits, within moments of where it was.

use std::hash::{DefaultHasher, Hash, Hasher};

/// Numbers by the key of what they were found for.
pub trait Journal: Sync {
    /// Returns the value under a key.
    fn recall(&self, key: u64) -> Option<Vec<f64>>;

    /// Keeps numbers, bit by bit.
    fn keep(&self, key: u64, numbers: &[f64]);
}

/// Keeps nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Forgetful;

impl Journal for Forgetful {
    fn recall(&self, _: u64) -> Option<Vec<f64>> {
        None
    }

    fn keep(&self, _: u64, _: &[f64]) {}
}

/// The key of something: the same in every process of the same program.
pub(crate) fn key(of: impl Hash) -> u64 {
    // Its keys are fixed, unlike those of a `RandomState`.
    let mut hasher = DefaultHasher::new();
    of.hash(&mut hasher);
    hasher.finish()
}

/// Bits of numbers, which can be part of a key.
pub(crate) fn bits(numbers: &[f64]) -> Vec<u64> {
    numbers.iter().map(|x| x.to_bits()).collect()
}

/// A journal beside what all its entries are about.
#[derive(Clone, Copy)]
pub struct Memory<'a> {
    journal: &'a dyn Journal,
    about: u64,
}

impl<'a> Memory<'a> {
    /// Remembers in a journal.
    pub fn new(journal: &'a dyn Journal) -> Self {
        Self { journal, about: 0 }
    }

    /// The same beside something else.
    #[must_use]
    pub(crate) fn about(self, other: u64) -> Self {
        Self { about: key((self.about, other)), ..self }
    }

    /// The number that was found for something, or one that is found now and kept.
    pub(crate) fn number<E>(
        self,
        of: impl Hash,
        find: impl FnOnce() -> Result<f64, E>,
    ) -> Result<f64, E> {
        let key = key((self.about, of));
        if let Some(&[number]) = self.journal.recall(key).as_deref() {
            return Ok(number);
        }
        let number = find()?;
        self.journal.keep(key, &[number]);
        Ok(number)
    }
}

/// Memory of searches that keep nothing.
impl Default for Memory<'_> {
    fn default() -> Self {
        Self::new(&Forgetful)
    }
}

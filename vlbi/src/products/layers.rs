//! Rows of a scan, so that none is lost where a baseline is there more than once.

use std::collections::HashMap;

/// Things of the baselines of a scan: the first of every baseline, the second, and so on.
pub struct Layers<T> {
    counts: HashMap<[u16; 2], usize>,
    layers: Vec<Vec<T>>,
}

impl<T> Default for Layers<T> {
    fn default() -> Self {
        Layers { counts: HashMap::new(), layers: Vec::new() }
    }
}

impl<T> Layers<T> {
    /// Adds what belongs to a baseline, its stations in ascending order.
    pub fn add(&mut self, stations: [u16; 2], thing: T) {
        let count = self.counts.entry(stations).or_insert(0);
        if *count == self.layers.len() {
            self.layers.push(Vec::new());
        }
        self.layers[*count].push(thing);
        *count += 1;
    }

    /// The layers, each with a baseline once at most.
    pub fn all(self) -> impl Iterator<Item = Vec<T>> {
        self.layers.into_iter()
    }
}

//! Memory of a thread for the rays of its tiles.

use super::grid::Square;
use crate::Error;
use crate::transport::{Block, Layers, PreparedScene, RayResult, Scratch};

/// Rays that are traced together.
pub(super) const BLOCK: usize = 1024;

/// Memory that is reused from tile to tile.
#[derive(Debug, Default)]
pub(super) struct Workspace {
    pub scratch: Scratch,
    pub alpha: Vec<f64>,
    pub beta: Vec<f64>,
    /// The squares whose centres have been pushed.
    pub squares: Vec<Square>,
    pub seen: Vec<RayResult>,
    /// Other layers of the rays, if any are wanted.
    pub layers: Vec<Layers>,
}

impl Workspace {
    /// Forgets the rays of before.
    pub fn clear(&mut self) {
        self.alpha.clear();
        self.beta.clear();
        self.squares.clear();
    }

    /// One more ray, through the centre of a square.
    pub fn push(&mut self, square: Square) {
        self.alpha.push(square.center.0);
        self.beta.push(square.center.1);
        self.squares.push(square);
    }

    /// One more ray of a square.
    pub fn push_ray(&mut self, x: f64, y: f64) {
        self.alpha.push(x);
        self.beta.push(y);
    }

    /// Returns the results of all rays, in their order.
    pub fn observe(&mut self, prepared: &PreparedScene) -> Result<&[RayResult], Error> {
        self.seen.clear();
        self.seen.resize(self.alpha.len(), RayResult::default());
        let rays = self.alpha.chunks(BLOCK).zip(self.beta.chunks(BLOCK));
        for ((alpha, beta), seen) in rays.zip(self.seen.chunks_mut(BLOCK)) {
            prepared.observe_block(alpha, beta, &[prepared.time()], &mut self.scratch, seen)?;
        }
        Ok(&self.seen)
    }

    /// Returns the number of rays.
    pub fn len(&self) -> usize {
        self.alpha.len()
    }

    /// Returns the results of a block of rays at each of `times`: ray k at time j is `[j · rays +
    /// k]`.
    pub fn observe_at(
        &mut self,
        prepared: &PreparedScene,
        times: &[f64],
    ) -> Result<&[RayResult], Error> {
        self.seen.clear();
        self.seen.resize(self.alpha.len() * times.len(), RayResult::default());
        self.layers.clear();
        if prepared.wanted().any {
            self.layers.resize(self.seen.len(), Layers::default());
        }
        let block = Block { alpha: &self.alpha, beta: &self.beta, times };
        let (seen, layers) = (&mut self.seen, &mut self.layers);
        prepared.observe_layers(block, &mut self.scratch, seen, layers)?;
        Ok(&self.seen)
    }
}

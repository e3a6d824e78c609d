//! Layout of parameters.

use core::ops::Range;

/// Numbers on each node of a grid.
pub const FEATURES: usize = 2;
/// Units of a hidden layer.
pub const WIDTH: usize = 16;
/// The most grids.
pub const MAX_LEVELS: usize = 6;
/// The most inputs of the network.
pub const MAX_INPUTS: usize = MAX_LEVELS * FEATURES;

/// Order of the parameters: see [`FeatureGrid`](super::FeatureGrid).
#[derive(Clone, Debug)]
pub struct Layout {
    nodes: Vec<usize>,
    /// Starts of the features of each grid, and at last of the network.
    starts: Vec<usize>,
}

impl Layout {
    pub fn new(coarsest: usize, levels: usize) -> Self {
        let nodes: Vec<usize> = (0..levels).map(|level| (coarsest << level) + 1).collect();
        let starts = nodes.iter().fold(vec![0], |mut starts, n| {
            starts.push(starts[starts.len() - 1] + FEATURES * n.pow(3));
            starts
        });
        Self { nodes, starts }
    }

    /// Nodes of a grid along an axis; those of the finest beyond.
    pub fn nodes(&self, level: usize) -> usize {
        self.nodes[level.min(self.nodes.len() - 1)]
    }

    /// Inputs of the network.
    pub fn inputs(&self) -> usize {
        self.nodes.len() * FEATURES
    }

    /// One feature of one grid.
    pub fn plane(&self, level: usize, feature: usize) -> Range<usize> {
        let size = self.nodes[level].pow(3);
        let start = self.starts[level] + feature * size;
        start..start + size
    }

    /// Returns the start of the network's parameters.
    pub fn network_start(&self) -> usize {
        self.starts[self.nodes.len()]
    }

    /// Parameters of the network.
    pub fn network(&self) -> usize {
        WIDTH * (self.inputs() + 1) + WIDTH * (WIDTH + 1) + WIDTH + 1
    }

    /// Numbers of a point that the way back needs: features, units, and the activation's slope.
    pub fn kept(&self) -> usize {
        self.inputs() + 2 * WIDTH + 1
    }

    /// All parameters.
    pub fn parameters(&self) -> usize {
        self.network_start() + self.network()
    }

    /// Weights of the three layers, counted from the network's start; biases lie behind each.
    pub fn kernels(&self) -> [Range<usize>; 3] {
        let first = self.inputs() * WIDTH;
        let second = first + WIDTH;
        let last = second + WIDTH * WIDTH + WIDTH;
        [0..first, second..second + WIDTH * WIDTH, last..last + WIDTH]
    }
}

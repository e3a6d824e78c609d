//! Settings of linear problems.

/// Grid on which a solution is first looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coarse {
    /// Nodes along each axis of the coarse grid.
    pub nodes: usize,
    /// Every how many-eth frame counts.
    pub stride: usize,
    /// Iterations there.
    pub iterations: usize,
}

/// Settings of a linear problem.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearSettings {
    /// The coarse problem whose solution says where to begin; all nodes of the grid count at once, without one.
    pub coarse: Option<Coarse>,
    /// Times that nodes may be admitted again.
    pub rounds: usize,
    /// Iterations in each round.
    pub iterations: usize,
    /// A round ends where the projected gradient has fallen to this part of what it began with.
    pub tolerance: f64,
    /// A round ends, too, where ten of them lower the function by less than this part of what noise
    /// changes it by, √(2/data) of it.
    pub settled: f64,
    /// Bytes of the sparse matrix; frames beyond are computed anew in each iteration.
    pub memory: usize,
}

impl Default for LinearSettings {
    fn default() -> Self {
        Self {
            coarse: Some(Coarse { nodes: 32, stride: 8, iterations: 20 }),
            rounds: 8,
            iterations: 80,
            tolerance: 1e-4,
            settled: 0.0,
            memory: 768 << 20,
        }
    }
}

//! Nodes of the grid that count: the columns of the matrix.

/// No column.
pub(super) const NONE: u32 = u32::MAX;

/// The nodes that count, in the order of the grid.
#[derive(Clone, Debug)]
pub(super) struct Active {
    /// Node of each column.
    pub node: Vec<u32>,
    /// Column of each node, or [`NONE`].
    pub column: Vec<u32>,
    /// Mask of cells any of whose nodes counts, by their first nodes. Cells of nodes at the edge reach into the next row,
    /// plane or knot: no ray meets them.
    pub cells: Vec<bool>,
    /// Columns of a quiescent image behind those of nodes: all of them count.
    pub beside: usize,
}

impl Active {
    /// These nodes, and all of so many columns behind them.
    pub fn new(is_active: &[bool], corners: &[usize], beside: usize) -> Self {
        let nodes = is_active.len() - beside;
        let mut column = vec![NONE; is_active.len()];
        let mut cells = vec![false; is_active.len()];
        let mut node = Vec::new();
        let counts = |(k, active): &(usize, &bool)| *k >= nodes || **active;
        for (k, _) in is_active.iter().enumerate().filter(counts) {
            column[k] = node.len() as u32;
            node.push(k as u32);
            // Pixels of a quiescent image belong to no cell.
            if k >= nodes {
                continue;
            }
            for corner in corners.iter().filter(|corner| **corner <= k) {
                cells[k - corner] = true;
            }
        }
        Self { node, column, cells, beside }
    }

    /// Number of columns.
    pub fn count(&self) -> usize {
        self.node.len()
    }

    /// Values at all nodes: 0 where they do not count.
    pub fn expand<U: Copy + Default>(&self, x: &[U]) -> Vec<U> {
        let mut all = vec![U::default(); self.column.len()];
        self.node.iter().zip(x).for_each(|(node, x)| all[*node as usize] = *x);
        all
    }

    /// Values at the nodes that count.
    pub fn gather<U: Copy>(&self, all: &[U]) -> Vec<U> {
        self.node.iter().map(|node| all[*node as usize]).collect()
    }
}

//! Shape of a network, and how its products of matrices are cut into tiles.

/// Shape of a network: parameters are layer after layer, each its kernel (inputs × outputs, row by row) and then its
/// biases.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// Input.
    pub front: Front,
    /// Start of its parameters.
    pub start: usize,
    /// Units of a hidden layer.
    pub width: usize,
    /// Hidden layers.
    pub hidden: usize,
    /// Hidden layer, counted from 1, to whose units the input is appended.
    pub skip: Option<usize>,
    /// Activation of the output: 0 sigmoid, 1 softplus, 2 none.
    pub activation: u32,
    /// Added to the output before it.
    pub shift: f32,
}

/// Inputs of a network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Front {
    /// The encoded point.
    Encoded {
        /// Factors of x, y, z (or t, x, y, z).
        scales: [f32; 4],
        /// Coordinates: 3 or 4.
        dimension: usize,
        /// Degree of the positional encoding.
        degree: usize,
    },
    /// Numbers that another kernel has made, so many, and a one behind them; their slopes are wanted.
    Given(usize),
}

/// A layer: columns of activations, and where its parameters are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layer {
    /// Columns of the units before it.
    pub base: usize,
    /// Number of units.
    pub units: usize,
    /// Columns behind them: the encoded point and the one, or the one alone.
    pub tail: usize,
    /// All of them.
    pub inputs: usize,
    /// Its own units.
    pub outputs: usize,
    /// Their column.
    pub into: usize,
    /// Offset of its parameters.
    pub offset: usize,
}

/// Tiling: how 256 lanes share a tile of a product of matrices, four numbers of the left one by eight of the right
/// one each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tiling {
    left_lanes: usize,
    right_lanes: usize,
    slab: usize,
}

impl Tiling {
    /// Returns the tiling for layers so wide: no wider than they are, where that can be.
    pub fn of(width: usize) -> Self {
        // Of 64 lanes on the left a slab of 16 would be four fours a lane: the shader fetches two.
        let (right_lanes, slab) = match width {
            0..=32 => (4, 8),
            33..=64 => (8, 16),
            _ => (16, 16),
        };
        Self { left_lanes: 256 / right_lanes, right_lanes, slab }
    }

    /// Returns the constants in front of the shader.
    pub fn constants(self) -> String {
        let Self { left_lanes, right_lanes, slab } = self;
        format!(
            "const LEFT_LANES = {left_lanes}u;\nconst RIGHT_LANES = {right_lanes}u;\nconst SLAB = {slab}u;\n"
        )
    }

    /// Tiles of so many rows of the left matrix.
    pub fn left(self, numbers: usize) -> u32 {
        numbers.div_ceil(4 * self.left_lanes) as u32
    }

    /// Tiles of so many rows of the right one.
    pub fn right(self, numbers: usize) -> u32 {
        numbers.div_ceil(8 * self.right_lanes) as u32
    }
}

impl Layer {
    /// Its encoded point alone, as if that were all that it takes: of the layer that takes it behind units.
    pub fn of_encoded(self, encoded: usize) -> Self {
        let Self { units, outputs, offset, .. } = self;
        let (inputs, offset) = (encoded + 1, offset + units * outputs);
        Self { base: 0, units: encoded, tail: encoded, inputs, offset, ..self }
    }
}

impl Shape {
    /// Numbers of the encoded point, or those that are given.
    pub fn encoded(&self) -> usize {
        match self.front {
            Front::Encoded { dimension, degree, .. } => dimension * (1 + 2 * degree),
            Front::Given(inputs) => inputs,
        }
    }

    /// Returns whether they are given.
    pub fn is_given(&self) -> bool {
        matches!(self.front, Front::Given(_))
    }

    /// Columns of activations: the encoded point, a one, and all units.
    pub fn columns(&self) -> usize {
        self.encoded() + 1 + self.hidden * self.width
    }

    /// Hidden layers, and at last the output.
    pub fn layers(&self) -> Vec<Layer> {
        let (encoded, width) = (self.encoded(), self.width);
        let mut offset = self.start;
        let layer = |k: usize| {
            let skip = k > 0 && self.skip == Some(k);
            let units = if k == 0 { encoded } else { width };
            let made = Layer {
                base: if k == 0 { 0 } else { encoded + 1 + (k - 1) * width },
                units,
                tail: if skip { 0 } else { encoded },
                inputs: units + if skip { encoded } else { 0 } + 1,
                outputs: if k == self.hidden { 1 } else { width },
                into: encoded + 1 + k * width,
                offset,
            };
            offset += made.inputs * made.outputs;
            made
        };
        (0..=self.hidden).map(layer).collect()
    }

    /// Number of parameters.
    pub fn parameters(&self) -> usize {
        self.layers().iter().map(|layer| layer.inputs * layer.outputs).sum()
    }
}

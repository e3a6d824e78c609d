//! Layout of parameters and activations.

use super::settings::NetworkSettings;

/// Activations lie point by point; a row has its units, then (after the skip) the encoded point, then
/// a one, whose weight is the next layer's bias.
#[derive(Clone, Copy, Debug)]
pub struct Rows {
    /// Units, and what is appended to them.
    pub columns: usize,
    /// Units of the layer itself.
    pub units: usize,
    /// Numbers from one point to the next.
    pub stride: usize,
}

impl Rows {
    fn new(units: usize, appended: usize) -> Self {
        // Room for the panels that are written and for the rows of a block that are read past the
        // end; an odd number of cache lines, so that neighbours do not compete for a set.
        let columns = units + appended;
        let room = units.next_multiple_of(WIDEST_PANEL).max(columns + WIDEST_PANEL);
        let lines = room.div_ceil(LINE) | 1;
        Self { columns, units, stride: lines * LINE }
    }
}

/// The widest panel of any instruction set (AVX-512, f32).
pub const WIDEST_PANEL: usize = 32;
/// Numbers of a cache line in f32, half of them in f64.
pub const LINE: usize = 16;

/// One fully connected layer: kernel (inputs × outputs, row by row), then biases.
#[derive(Clone, Copy, Debug)]
pub struct Layer {
    /// Number of inputs that it takes from a row.
    pub inputs: usize,
    /// Its units.
    pub outputs: usize,
    /// Start of its parameters.
    pub offset: usize,
}

impl Layer {
    /// Number of its parameters.
    pub fn size(self) -> usize {
        (self.inputs + 1) * self.outputs
    }
}

/// All layers and what is between them.
#[derive(Clone, Debug)]
pub struct Layout {
    /// Row formats: of the encoded point, then of each hidden layer.
    pub rows: Vec<Rows>,
    /// Hidden layers, then the output.
    pub layers: Vec<Layer>,
    /// The row to which the encoded point is appended.
    pub skip: Option<usize>,
    /// Numbers of an encoded point.
    pub encoded: usize,
}

impl Layout {
    pub fn new(settings: &NetworkSettings) -> Self {
        let encoded = settings.encoded();
        let of_layer = |layer: usize| {
            Rows::new(settings.width, if settings.skip_after == Some(layer) { encoded } else { 0 })
        };
        let hidden = (1..=settings.hidden_layers).map(of_layer);
        let rows: Vec<Rows> = core::iter::once(Rows::new(encoded, 0)).chain(hidden).collect();
        let mut layers: Vec<Layer> = Vec::with_capacity(rows.len());
        for (k, row) in rows.iter().enumerate() {
            let outputs = if k < settings.hidden_layers { settings.width } else { 1 };
            let offset = layers.last().map_or(0, |last| last.offset + last.size());
            layers.push(Layer { inputs: row.columns, outputs, offset });
        }
        Self { rows, layers, skip: settings.skip_after, encoded }
    }

    /// Number of parameters.
    pub fn parameters(&self) -> usize {
        self.layers.iter().map(|layer| layer.size()).sum()
    }

    /// The hidden layers.
    pub fn hidden(&self) -> &[Layer] {
        &self.layers[..self.layers.len() - 1]
    }

    /// The output layer.
    pub fn output(&self) -> Layer {
        self.layers[self.layers.len() - 1]
    }

    /// The rows that the output layer takes.
    pub fn last_rows(&self) -> Rows {
        self.rows[self.rows.len() - 1]
    }
}

//! Pictures too large for memory, made smaller on the way.

use super::{Channel, Picture};

/// Averages over boxes of `factor` × `factor` pixels; rows come from the top, band by band.
#[derive(Debug, Clone)]
pub struct Reduction {
    factor: usize,
    /// Size of the picture that comes in.
    width: usize,
    height: usize,
    /// Rows that have come in.
    rows: usize,
    /// Destination of every incoming channel, if it is wanted.
    wanted: Vec<Option<usize>>,
    /// Sums of the boxes that are open, channel after channel.
    sums: Vec<Vec<f64>>,
    picture: Picture,
}

impl Reduction {
    /// Reduces a picture with the channels `names`, of which `wanted` are kept, by the least factor
    /// with which at most `most` pixels are left.
    pub fn new(width: usize, height: usize, names: &[&str], wanted: &[&str], most: usize) -> Self {
        let pixels = |factor: usize| width.div_ceil(factor) * height.div_ceil(factor);
        let factor = (1..width.max(height)).find(|f| pixels(*f) <= most);
        let factor = factor.unwrap_or(width.max(height).max(1));
        let kept: Vec<&str> = wanted.iter().copied().filter(|name| names.contains(name)).collect();
        let place = |name: &&str| kept.iter().position(|kept| kept == name);
        let (small, low) = (width.div_ceil(factor), height.div_ceil(factor));
        let channel = |name: &&str| Channel {
            name: (*name).to_owned(),
            values: Vec::with_capacity(small * low),
        };
        Reduction {
            factor,
            width,
            height,
            rows: 0,
            wanted: names.iter().map(place).collect(),
            sums: vec![vec![0.0; small]; kept.len()],
            picture: Picture {
                width: small,
                height: low,
                channels: kept.iter().map(channel).collect(),
            },
        }
    }

    /// Side of the boxes in pixels; 1 leaves the picture as it is.
    pub fn factor(&self) -> usize {
        self.factor
    }

    /// Takes the next rows; `channels[k]` holds them row by row.
    pub fn add(&mut self, channels: &[Vec<f32>]) {
        let rows = channels.first().map_or(0, |values| values.len() / self.width);
        for row in 0..rows {
            for (values, place) in channels.iter().zip(&self.wanted) {
                let Some(place) = *place else { continue };
                let line = &values[row * self.width..(row + 1) * self.width];
                for (sum, values) in self.sums[place].iter_mut().zip(line.chunks(self.factor)) {
                    *sum += values.iter().map(|value| f64::from(*value)).sum::<f64>();
                }
            }
            self.rows += 1;
            if self.rows.is_multiple_of(self.factor) || self.rows == self.height {
                self.close();
            }
        }
    }

    /// Ends a row of boxes.
    fn close(&mut self) {
        let high = (self.rows - 1) % self.factor + 1;
        for (sums, channel) in self.sums.iter_mut().zip(&mut self.picture.channels) {
            for (k, sum) in sums.iter_mut().enumerate() {
                let wide = self.factor.min(self.width - k * self.factor);
                channel.values.push((*sum / (wide * high) as f64) as f32);
                *sum = 0.0;
            }
        }
    }

    /// The smaller picture.
    pub fn picture(self) -> Picture {
        self.picture
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_box_averages() {
        // 5 × 3 pixels of two channels, boxes of 2 × 2, rows in two bands.
        let values: Vec<f32> = (0..15).map(|k| k as f32).collect();
        let twice: Vec<f32> = values.iter().map(|v| 2.0 * v).collect();
        let bands =
            |from: usize, to: usize| vec![twice[from..to].to_vec(), values[from..to].to_vec()];
        let mut reduction = Reduction::new(5, 3, &["x", "y"], &["y"], 6);
        assert_eq!(reduction.factor(), 2);
        reduction.add(&bands(0, 5));
        reduction.add(&bands(5, 15));
        let picture = reduction.picture();
        assert_eq!((picture.width, picture.height), (3, 2));
        let expected = vec![3.0, 5.0, 6.5, 10.5, 12.5, 14.0];
        assert_eq!(picture.channels, [Channel { name: "y".to_owned(), values: expected }]);
        let mut same = Reduction::new(5, 3, &["x", "y"], &["y", "x"], 15);
        same.add(&bands(0, 15));
        assert_eq!(same.picture().channel("x"), Some(&twice[..]));
    }
}

//! A table as colours with its numbers.

use image::RgbImage;
use kerrlight_render::image::canvas::{Align, BLACK, Canvas, WHITE};
use kerrlight_render::image::colormap::Colormap;

/// Means over two factors.
pub struct Map {
    /// The name of the factor, then its levels, from the top.
    pub rows: Vec<String>,
    /// The same from the left.
    pub columns: Vec<String>,
    /// Row by row.
    pub means: Vec<Vec<Option<f64>>>,
    /// Digits after the point.
    pub digits: usize,
}

/// Pixels of a cell.
const CELL: [f64; 2] = [96.0, 56.0];
/// Most pixels of all cells along a side: of more cells each is smaller, and has no number.
const MOST: f64 = 4000.0;
/// Pixels between the names of rows.
const LINE: f64 = 20.0;
const LEFT: f64 = 120.0;
const TOP: f64 = 60.0;

impl Map {
    /// The picture; nothing of nothing.
    pub fn draw(&self) -> Option<RgbImage> {
        let (across, down) = (self.columns.len().checked_sub(1)?, self.rows.len().checked_sub(1)?);
        let [wide, high] = [CELL[0].min(MOST / across as f64), CELL[1].min(MOST / down as f64)];
        let has_numbers = [wide, high] == CELL;
        let size = [LEFT + wide * across as f64 + 16.0, TOP + high * down as f64 + 16.0];
        let mut canvas = Canvas::new(size[0] as u32, size[1] as u32, WHITE)?;
        let values: Vec<f64> = self.means.iter().flatten().flatten().copied().collect();
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let table = Colormap::Inferno.table();
        canvas.text(&self.columns[0], [LEFT, 20.0], 15.0, Align::Left, BLACK);
        canvas.text(&self.rows[0], [8.0, TOP - 10.0], 15.0, Align::Left, BLACK);
        // A name needs the width of a full cell.
        let every = (CELL[0] / wide).ceil() as usize;
        for (k, name) in self.columns[1..].iter().enumerate().step_by(every) {
            let x = LEFT + wide * (k as f64 + 0.5);
            canvas.text(name, [x, TOP - 10.0], 15.0, Align::Center, BLACK);
        }
        for (j, (name, row)) in self.rows[1..].iter().zip(&self.means).enumerate() {
            let y = TOP + high * j as f64;
            if j % (LINE / high).ceil() as usize == 0 {
                canvas.text(name, [LEFT - 12.0, y + 0.6 * high], 15.0, Align::Right, BLACK);
            }
            for (k, mean) in row.iter().enumerate() {
                let x = LEFT + wide * k as f64;
                let Some(mean) = mean else { continue };
                let part = if most > least { (mean - least) / (most - least) } else { 0.5 };
                let color = table[(part * (table.len() - 1) as f64).round() as usize];
                let gap = if has_numbers { 1.0 } else { 0.0 };
                canvas.rectangle(x + gap, y + gap, wide - 2.0 * gap, high - 2.0 * gap, color);
                if !has_numbers {
                    continue;
                }
                let text = format!("{mean:.*}", self.digits);
                // The upper part of Inferno is bright, the lower one dark.
                let ink = if part > 0.6 { BLACK } else { WHITE };
                canvas.text(
                    &text,
                    [x + 0.5 * CELL[0], y + 0.6 * CELL[1]],
                    15.0,
                    Align::Center,
                    ink,
                );
            }
        }
        Some(canvas.into_picture())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_a_map_of_many_cells_is_no_larger() {
        let names = |count: usize| (0..=count).map(|k| k.to_string()).collect::<Vec<String>>();
        let means = (0..400).map(|k| vec![Some(f64::from(k)); 100]).collect();
        let map = Map { rows: names(400), columns: names(100), means, digits: 1 };
        let drawn = map.draw().unwrap();
        assert_eq!(drawn.dimensions(), (4136, 4076));
        let at = |y: u32| drawn.get_pixel(2000, y).0.map(u32::from).iter().sum::<u32>();
        assert!(at(65) < at(2000) && at(2000) < at(4050));
    }

    #[test]
    fn exact_cells_are_as_bright_as_their_numbers() {
        let names = |of: [&str; 3]| of.map(str::to_owned).to_vec();
        let map = Map {
            rows: names(["m", "1", "2"]),
            columns: names(["l", "a", "b"]),
            means: vec![vec![Some(0.0), Some(1.0)], vec![None, Some(2.0)]],
            digits: 1,
        };
        let drawn = map.draw().unwrap();
        let at = |column: f64, row: f64| {
            let (x, y) = (LEFT + CELL[0] * column + 5.0, TOP + CELL[1] * row + 5.0);
            drawn.get_pixel(x as u32, y as u32).0.map(u32::from).iter().sum::<u32>()
        };
        assert!(at(0.0, 0.0) < at(1.0, 0.0) && at(1.0, 0.0) < at(1.0, 1.0));
        assert_eq!(at(0.0, 1.0), 765, "an empty cell is white");
    }
}

//! Map of the cells in a pixel, and the edges that pass between neighbours.

use super::DEEPEST;
use super::cell::{Cell, area};
use super::light::Light;

/// Map of the cells in a pixel.
pub(super) struct CellMap(Vec<u16>);

impl CellMap {
    /// Cells along a side, of the smallest kind.
    const SIDE: usize = 1 << DEEPEST;

    pub(super) fn new(cells: &[Cell]) -> Self {
        let mut map = CellMap(vec![0; Self::SIDE * Self::SIDE]);
        for (number, cell) in cells.iter().enumerate() {
            let size = Self::SIDE >> cell.level;
            let first = |x: f64| ((x + 0.5) * Self::SIDE as f64) as usize - size / 2;
            let [column, row] = cell.center.map(first);
            for row in row..row + size {
                let start = row * Self::SIDE + column;
                // A pixel has at most MOST_SAMPLES cells.
                map.0[start..start + size].fill(number as u16);
            }
        }
        map
    }

    /// The light of the ray of the quarter that a place lies in, if it is in the pixel.
    pub(super) fn light<'a>(&self, cells: &'a [Cell], place: [f64; 2]) -> Option<&'a Light> {
        if place.iter().any(|x| x.abs() >= 0.5) {
            return None;
        }
        let [column, row] = place.map(|x| ((x + 0.5) * Self::SIDE as f64) as usize);
        let cell = cells.get(usize::from(*self.0.get(row * Self::SIDE + column)?))?;
        let [x, y] = [0, 1].map(|c| usize::from(place[c] > cell.center[c]));
        cell.quarters.get(2 * y + x)
    }

    /// Returns the largest error of edges that pass between the rays of cell number `k` and those of the cells
    /// next to it. Between a ray and the border lies half of its quarter; the edge may be anywhere between
    /// this ray and the next cell's, which is taken for a quarter of the quarter. Images of the disc, as
    /// bright as `disc`, that pass between them lie in one of the two, and count twice.
    pub(super) fn seam(&self, cells: &[Cell], k: usize, disc: f64) -> f64 {
        let cell = &cells[k];
        let size = 0.5f64.powi(cell.level as i32);
        let quarter = 0.25 * area(cell.level);
        let mut seam = 0.0;
        for (place, light) in cell.rays() {
            for axis in 0..2 {
                let mut across = place;
                // Just over the border, on the level of the ray.
                across[axis] += (place[axis] - cell.center[axis]).signum() * 0.251 * size;
                let next = self.light(cells, across).filter(|next| next.other_piece(light));
                if let Some(next) = next {
                    let height = (next.intensity - light.intensity).abs();
                    seam += quarter * (0.25 * height + next.between(light) * disc);
                }
            }
        }
        seam
    }
}

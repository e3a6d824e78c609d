//! Static images beside each other.

use super::Figures;
use crate::compare::experiment::FigureAsked;
use crate::interferometry::movie_files;
use crate::report::{self, Figure};

/// Least width of a drawn image, pixels.
const DRAWN: usize = 160;

impl Figures<'_> {
    /// The images of the first seed of all cases that have one, on one scale.
    pub(super) fn images(&self, asked: &FigureAsked) -> anyhow::Result<Option<Figure>> {
        let mut images: Vec<(String, Vec<f32>)> = Vec::new();
        let mut side = 0;
        for (case, _) in self.chosen(asked).filter(|(case, _)| case.seed == 1) {
            let path = self.runner.run_of(case).join("image.npz");
            if !path.exists() {
                continue;
            }
            let (movie, _) = movie_files::read(&[path], None)?;
            let n = movie.i.grid.width;
            if side != 0 && n != side {
                anyhow::bail!("images have {side} and {n} pixels a side: `where` can choose some");
            }
            side = n;
            images.push((case.name(), movie.i.pixels.iter().map(|x| *x as f32).collect()));
        }
        if images.is_empty() {
            return Ok(None);
        }
        let zoom = DRAWN.div_ceil(side);
        let drawn: Vec<(&str, Vec<f32>)> = images
            .iter()
            .map(|(name, image)| (name.as_str(), report::enlarged(image, side, zoom)))
            .collect();
        let what = format!("{}. {}", asked.title, asked.caption);
        report::images(&drawn, side * zoom, &what).map(Some)
    }
}

//! The images of a fit with twice the nodes on rays: what its sums along rays are off by.

use super::observable::seen;
use super::{Instrument, Result};
use crate::fit::settings::{FitFile, Region};
use crate::fit::{Batch, Field, Motion, Observable, Sampling};
use crate::representation::Workspace;

/// Pixels whose rays are held at a time.
const BLOCK: usize = 2048;

/// Images of some frames, one after the other, with twice the panels on each ray. None where nodes are those of other
/// sums by intention, or more than the total intensity of what moves is seen.
///
/// # Errors
/// If a setting is out of range.
pub fn finer_images(
    file: &FitFile,
    motion: &Motion,
    field: Field<'_, f32>,
    frames: &[usize],
) -> Result<Option<Vec<f32>>> {
    let Sampling::Gauss { order, split } = file.region.nodes else { return Ok(None) };
    let is_plain = file.polarization.is_none() && file.quiescent.is_none();
    if !is_plain || seen(file)? != Observable::Images {
        return Ok(None);
    }
    let nodes = Sampling::Gauss { order, split: 2 * split };
    let file = &FitFile { region: Region { nodes, ..file.region.clone() }, ..file.clone() };
    let pixels = file.screen.pixels * file.screen.pixels;
    let mut movie = vec![0.0; frames.len() * pixels];
    let (mut batch, mut workspace) = (Batch::default(), Workspace::new());
    // Pixels of a block are spread over the screen.
    let blocks = pixels.div_ceil(BLOCK);
    for first in 0..blocks {
        let block: Vec<usize> = (first..pixels).step_by(blocks).collect();
        let instrument = Instrument::of(file, &block)?;
        let mut model = instrument.forward::<f32>(motion)?;
        model.weigh(field.axis);
        let mut part = vec![0.0; frames.len() * block.len()];
        model.movie(field, frames, &mut batch, &mut workspace, &mut part);
        for (image, part) in movie.chunks_exact_mut(pixels).zip(part.chunks_exact(block.len())) {
            block.iter().zip(part).for_each(|(pixel, value)| image[*pixel] = *value);
        }
    }
    Ok(Some(movie))
}

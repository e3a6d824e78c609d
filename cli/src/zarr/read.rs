//! Volumes and movies of a store.

use super::{Reading, Store, files};
use crate::output;
use anyhow::{Context, bail};
use kerrlight_render::volume::VolumeArrays;
use kerrlight_vlbi::files::images::{WithSize, frames_with, image_of};
use std::path::Path;

/// Reads a volume: the array `emission` of a group, or an array, of shape (nx, ny, nz). Corners are the first and the last
/// of the coordinates `x`, `y` and `z` beside it, the axis is the group's attribute `axis`, as far as they are there.
///
/// # Errors
/// If there is no such array, or the store is damaged.
pub fn volume(path: &Path) -> anyhow::Result<VolumeArrays> {
    let read = || {
        let store = Store::open(path)?;
        let array = store.wanted("emission")?;
        let [x, y, z] = array.shape() else {
            bail!("array {}: shape {:?}: (nx, ny, nz) is expected", array.name, array.shape());
        };
        let nodes = [x, y, z].map(|n| *n as usize);
        let axis = store.attributes.get("axis").map(|axis| serde_json::from_value(axis.clone()));
        let axis = axis.transpose().context("attribute axis: 3 numbers are expected")?;
        let found = VolumeArrays::new(nodes, &array.all()?, corners(&store, nodes)?, axis);
        found.with_context(|| format!("array {}", array.name))
    };
    read().with_context(|| path.display().to_string())
}

/// First and last node along each direction, M, where there are coordinates.
fn corners(store: &Store, nodes: [usize; 3]) -> anyhow::Result<[Option<[f64; 3]>; 2]> {
    let (mut low, mut high) = ([0.0; 3], [0.0; 3]);
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let Some(array) = store.array(name)? else { return Ok([None; 2]) };
        [low[axis], high[axis]] = ends(&array, nodes[axis])?;
    }
    Ok([Some(low), Some(high)])
}

/// The ends of coordinates, which are as many as there are nodes, at equal distances.
fn ends(array: &Reading, nodes: usize) -> anyhow::Result<[f64; 2]> {
    let (name, shape) = (&array.name, array.shape());
    if shape != [nodes as u64] {
        bail!("array {name}: shape {shape:?}: {nodes} coordinates are expected");
    }
    let all = array.all()?;
    let [Some(low), Some(high)] = [all.first(), all.last()].map(Option::<&f64>::copied) else {
        bail!("array {name} has no coordinates");
    };
    let step = (high - low) / (nodes.max(2) - 1) as f64;
    // What is not a number is off, too.
    let fits = |(k, x): (usize, &f64)| (x - (low + k as f64 * step)).abs() <= 1e-5 * step.abs();
    if let Some(k) = all.iter().enumerate().position(|one| !fits(one)) {
        bail!("array {name}: coordinate {} of node {k} is not allowed: equal distances", all[k]);
    }
    Ok([low, high])
}

/// Reads the images of a movie: the array `movie`, `image` or `recovered` of a group, its only one, or an array, of shape
/// (height, width) or (frames, height, width). As many frames as a chunk has are in memory together.
///
/// # Errors
/// If there is no such array, or the store is damaged.
pub fn movie(path: &Path) -> anyhow::Result<WithSize> {
    for file in files(path)? {
        output::read_through(&file)?;
    }
    let read = || {
        let store = Store::open(path)?;
        let array = match &store.chosen {
            Some(name) => store.wanted(name)?,
            None => store.wanted(image_of(&store.names)?)?,
        };
        images(&array).with_context(|| format!("array {}", array.name))
    };
    read().with_context(|| path.display().to_string())
}

fn images(array: &Reading) -> anyhow::Result<WithSize> {
    let mut refused = None;
    let frames = frames_with(array.shape(), |pixels, sink| {
        let mut hand_over =
            |some: &[f64]| anyhow::Ok(some.chunks(pixels).try_for_each(&mut *sink)?);
        // One image has no frames to be cut into.
        let read = match array.shape() {
            [_, _] => array.all().and_then(|all| hand_over(&all)),
            _ => array.slabs(hand_over),
        };
        read.map_err(|error| {
            refused = Some(error);
            std::io::Error::other("no image").into()
        })
    });
    match refused {
        Some(error) => Err(error),
        None => Ok(frames?),
    }
}

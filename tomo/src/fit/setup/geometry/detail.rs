//! What searches hand on to one another.

use crate::fit::geometry::{Geometry, Spread};
use crate::fit::journal::Memory;
use crate::fit::settings::{FitFile, UnknownGeometry};
use crate::fit::setup::FitData;

/// Resolution at which geometries are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolution {
    /// Voxels along each axis.
    pub nodes: usize,
    /// Pixels along each side.
    pub pixels: usize,
    /// Rays along each side of a pixel of images, which is their mean.
    pub rays: usize,
    /// Panels of a ray for each of the coarsest.
    pub panels: u32,
}

/// Where one search ended, in [`Geometry`]'s units.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Where it began.
    pub start: Geometry,
    /// Where it ended.
    pub end: Geometry,
    /// χ² over the number of data there.
    pub reduced_chi2: f64,
    /// Half of χ² there, and −ln of the priors' densities.
    pub value: f64,
    /// Geometries that were evaluated.
    pub trials: usize,
    /// The lowest point of a quadratic form through the geometries around; none without such a form.
    pub further: Option<Geometry>,
}

/// A geometry and how sure it is.
pub(super) struct Sure {
    /// The best one.
    pub geometry: Geometry,
    /// Its errors; none if the data leave a parameter open.
    pub spread: Option<Spread>,
    /// χ²/N there, times what χ² is multiplied by.
    pub reduced_chi2: f64,
}

/// What was found in detail, and how.
pub(super) struct Detailed {
    pub sure: Sure,
    /// By what χ² was multiplied.
    pub errors: f64,
    /// What it was looked at through.
    pub resolution: Resolution,
}

/// What is looked at in detail, about one geometry.
pub(super) struct Detail<'a> {
    /// Settings.
    pub file: &'a FitFile,
    /// Data.
    pub measured: &'a FitData,
    /// What is not known.
    pub unknown: &'a UnknownGeometry,
    /// What an earlier search has found.
    pub memory: Memory<'a>,
    /// By what χ² is multiplied where it leaves so much of each datum.
    pub scale: &'a dyn Fn(f64) -> f64,
}

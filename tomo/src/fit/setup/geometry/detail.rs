//! Parts that searches hand on to one another.

use super::search_data::SearchData;
use crate::fit::geometry::{Geometry, Spread};
use crate::fit::journal::Memory;
use crate::fit::settings::{FitFile, SearchView, UnknownGeometry};
use crate::fit::setup::FitData;
use crate::fit::setup::instrument::RING_RAYS;

/// Resolution at which geometries are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolution {
    /// Voxels along each axis.
    pub nodes: usize,
    /// Pixels along each side.
    pub pixels: usize,
    /// Rays of a pixel of images, and nodes along them.
    pub rays: RaySampling,
}

impl Resolution {
    /// Returns the settings with as many voxels that are solved for, if they have fewer.
    #[must_use]
    pub fn refined(&self, mut file: FitFile) -> FitFile {
        let grid = &mut file.representation.linear_grid;
        grid.nodes = grid.nodes.max(self.nodes);
        file
    }
}

/// Rays through which a fit sees a geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RaySampling {
    /// Rays along each side of a pixel, which is their mean.
    pub per_side: usize,
    /// Rays of a pixel near the critical curve; as those of others, without.
    pub ring: Option<usize>,
    /// Panels of a ray for each of the settings.
    pub panels: u32,
    /// Number of the lattice of rays near the critical curve, 0 for the usual one.
    pub lattice: u64,
}

/// Factor on the rays of pixels near the critical curve, and the most of them in a search.
pub(super) const MORE: usize = 4;
const MOST_RING: usize = 256;

impl RaySampling {
    /// Means over twice as many rays along each side.
    pub fn denser(self) -> Self {
        Self { per_side: 2 * self.per_side, ring: self.ring.or(Some(RING_RAYS)), ..self }
    }

    /// Four times as many rays in pixels near the critical curve, if these have rays of their own.
    pub fn ringed(self) -> Option<Self> {
        Some(Self { ring: Some(MORE * self.ring?), ..self })
    }

    /// The same, up to the most of a search.
    pub fn grown(self) -> Option<Self> {
        self.ringed().filter(|more| more.ring <= Some(MOST_RING))
    }
}

impl Default for RaySampling {
    fn default() -> Self {
        Self { per_side: 1, ring: None, panels: 1, lattice: 0 }
    }
}

/// Data at a resolution.
pub(super) struct Place {
    pub seen: SearchData,
    pub at: Resolution,
    pub view: SearchView,
    /// Factor of χ².
    pub errors: f64,
    /// The rays of the data on an even lattice, where these explain images better than the means through which geometries are
    /// compared.
    pub even: Option<RaySampling>,
}

/// End of one search, in [`Geometry`]'s units.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Geometry at its start.
    pub start: Geometry,
    /// Geometry at its end.
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
    /// Its errors; none if no quadratic form describes the values around.
    pub spread: Option<Spread>,
    /// χ²/N there, times what χ² is multiplied by.
    pub reduced_chi2: f64,
}

/// Result of the detailed search.
pub(super) struct Detailed {
    pub sure: Sure,
    /// Factor of χ².
    pub errors: f64,
    /// Resolution of the result.
    pub resolution: Resolution,
}

/// Data and settings of the detailed search, about one geometry.
pub(super) struct Detail<'a> {
    /// Settings.
    pub file: &'a FitFile,
    /// Data.
    pub measured: &'a FitData,
    /// Unknown parameters.
    pub unknown: &'a UnknownGeometry,
    /// Results of an earlier search.
    pub memory: Memory<'a>,
    /// Factor of χ², of what it leaves of each datum.
    pub scale: &'a dyn Fn(f64) -> f64,
}

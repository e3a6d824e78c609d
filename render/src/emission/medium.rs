//! Media that fill space and shine: the interface between sources of volume emission and the sum of
//! light along a ray.

use kerrlight_geodesic::Quantities;
use kerrlight_geodesic::simd::RayNodes;

/// Purpose of work.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Part {
    /// Rays: their fate, crossings and, where a source needs it, their path.
    Rays,
    /// Nodes inside the gas, its emission and absorption.
    Gas,
    /// Nodes inside volumes, and their emission.
    Volumes,
    /// Light of the disc and of meshes where rays meet them.
    Surfaces,
    /// Hot spots.
    Spots,
    /// The sky, and beams that average it.
    Sky,
}

impl Part {
    /// All of them.
    pub const ALL: [Part; 6] =
        [Part::Rays, Part::Gas, Part::Volumes, Part::Surfaces, Part::Spots, Part::Sky];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Part::Rays => "rays",
            Part::Gas => "gas",
            Part::Volumes => "volumes",
            Part::Surfaces => "surfaces",
            Part::Spots => "spots",
            Part::Sky => "sky",
        }
    }
}

/// Something that shines, and may absorb, all over a sphere.
pub trait Medium: core::fmt::Debug + Send + Sync {
    /// Returns the part of the plan that its cost belongs to.
    fn part(&self) -> Part;
    /// Radius in M of the sphere outside of which there is nothing.
    fn sphere(&self) -> f64;
    /// Returns the size of its cells, if its light is not smooth along panels of any length.
    fn cell_size(&self) -> Option<CellSize>;
    /// Standard deviation in cos θ of a layer about the equator that may lie between the coarsest nodes.
    fn thin_layer(&self) -> Option<f64> {
        None
    }
    /// Size of its finest features by their radius, at most about 1: structure of cells is some of them
    /// wide.
    fn relative_size(&self) -> f64 {
        self.cell_size().map_or(1.0, |cell| 2.0 * cell.size / self.sphere())
    }
    /// Returns the quantities that it needs at its nodes besides r and cos θ.
    fn quantities(&self) -> Quantities;
    /// Linear colour.
    fn color(&self) -> [f32; 3];
    /// Intensity that its brightest parts may reach: what errors of faint rays are measured by.
    fn scale(&self) -> f64;
    /// Contravariant Boyer–Lindquist four-velocity of its matter, for polarised light; `None` where
    /// there is none. The azimuth is 0 where it is not among its needs.
    fn four_velocity(&self, r: f64, cos_theta: f64, azimuth: f64) -> Option<[f64; 4]>;
    /// Returns whether it looks different at different times.
    fn changes(&self) -> bool;
    /// `false` only if it is dark all along a segment of a ray.
    fn may_shine(&self, segment: &PathSegment, moment: Moment) -> bool {
        let _ = (segment, moment);
        true
    }
    /// Returns whether [`fill`](Self::fill) gives absorption.
    fn absorbs(&self) -> bool;
    /// Appends emission and absorption at the nodes of a ray with angular momentum `lambda`.
    fn fill(&self, nodes: &RayNodes<'_>, lambda: f64, moment: Moment, out: &mut Emission);
}

/// A short piece of a ray.
#[derive(Debug, Clone, Copy)]
pub struct PathSegment {
    /// r n of its ends, in M.
    pub positions: [[f64; 3]; 2],
    /// Its least and its largest radius, in M.
    pub radii: [f64; 2],
    /// Its largest and its least delay, in M; 0 where delays are not requested.
    pub delays: [f64; 2],
    /// Largest distance from its chord, in M; infinite if that is not known.
    pub off: f64,
}

/// Cells in which a medium is smooth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellSize {
    /// Shortest edge of a cell in M. Panels are never longer, and not cut any more once they are
    /// shorter than a quarter of it.
    pub size: f64,
    /// Radius in M of the sphere inside of which there is nothing.
    pub inner: f64,
}

impl CellSize {
    /// The part of a cell below which panels are not cut for the sake of the tolerance.
    pub(crate) const FINEST: f64 = 0.25;

    /// The longest panel of a ray outside of the inner sphere, M.
    pub(crate) fn longest(&self, nodes: &RayNodes<'_>, order: usize) -> f64 {
        let panels = nodes.weight.chunks_exact(order).zip(nodes.radius.chunks_exact(order));
        let outside = panels.filter(|(_, radius)| radius.iter().any(|r| *r >= self.inner));
        outside.map(|(weights, _)| weights.iter().sum()).fold(0.0, f64::max)
    }
}

/// Time at which a ray is seen.
#[derive(Debug, Clone, Copy)]
pub struct Moment {
    /// Time of observation, in M.
    pub observed: f64,
    /// True if light takes its time.
    pub slow_light: bool,
}

/// A medium along a ray, node by node.
#[derive(Debug, Clone, Default)]
pub struct Emission {
    /// Observed intensity gained per unit of the affine parameter: g² j.
    pub emissivity: Vec<f64>,
    /// Optical depth gained per unit of the affine parameter, κ/g; empty without absorption.
    pub absorption: Vec<f64>,
    /// g = ν_obs/ν_em, dimensionless; 1 where redshift is off.
    pub redshift: Vec<f64>,
    /// Q, U, V over I; empty without polarisation.
    pub polarization: Vec<[f64; 3]>,
}

impl Emission {
    /// Empty, with its memory.
    pub fn clear(&mut self) {
        self.emissivity.clear();
        self.absorption.clear();
        self.redshift.clear();
        self.polarization.clear();
    }

    /// Adds nodes of another.
    pub(crate) fn append(&mut self, other: &Emission, range: core::ops::Range<usize>) {
        let pairs = [
            (&mut self.emissivity, &other.emissivity),
            (&mut self.absorption, &other.absorption),
            (&mut self.redshift, &other.redshift),
        ];
        for (column, more) in pairs {
            column.extend_from_slice(more.get(range.clone()).unwrap_or(&[]));
        }
        self.polarization.extend_from_slice(other.polarization.get(range).unwrap_or(&[]));
    }
}

//! Stokes parameters of a fit: what a unit of emission at each node adds to I, Q and U of its pixel, and several images
//! of one model.

use super::sightlines::{Arrival, Sightlines};
use crate::Error;
use kerrlight_common::simd::Float;
use kerrlight_geodesic::vector::norm;
use kerrlight_geodesic::{Kerr, ScreenPoint, ZamoFrame};
use kerrlight_render::dynamics::{AngularVelocity, Axis};
use kerrlight_render::polarization::{
    Gas, Normalisation, PolarizationLaw, Stokes, StokesParameter, SynchrotronView,
};
use rayon::prelude::*;

/// View of polarised light of a fit.
#[derive(Clone, Debug)]
pub struct PolarizedView {
    /// The law of emission.
    pub law: PolarizationLaw,
    /// The axis that matter turns about.
    pub axis: Axis,
    /// Sine of the angle between the spin and the line of sight.
    pub sin_inclination: f64,
    /// Position angle of the spin on the sky, radians east of north.
    pub position_angle: f64,
    /// Unit of |b|, where it is not to be that of the nodes that are seen: a mean field depends on them.
    pub unit: Option<f64>,
}

impl PolarizedView {
    /// Returns the light that a unit of emission at each node adds per weight of the node: I, Q and U of matter that
    /// moves like this; zero where it would be faster than light. The nodes must have momenta.
    ///
    /// # Errors
    /// If a number of the law is out of its range, or the nodes have no momenta.
    pub fn factors(
        &self,
        lines: &Sightlines,
        hole: &Kerr,
        velocity: &AngularVelocity,
    ) -> Result<Vec<Stokes>, Error> {
        self.law.check()?;
        let is_whole = lines.arrivals.last().map_or(0, |last| last.end) == lines.points();
        let ok = is_whole && lines.radial.len() == lines.points();
        Error::check("polarization", lines.points() as f64, ok, "nodes with momenta")?;
        // The unit may be the mean field of all nodes: no factor is known before all are seen.
        let views = self.views(lines, hole, velocity);
        let unit = self.unit.unwrap_or_else(|| self.unit_of(views.iter().flatten().flatten()));
        let of = |seen: &Option<SynchrotronView>| {
            seen.map_or(Stokes::default(), |seen| self.law.stokes(&seen, unit))
        };
        // Angles of the law count from the projection of the spin, those of data from north.
        Ok(views.iter().flatten().map(|seen| of(seen).turned(self.position_angle)).collect())
    }

    /// Returns the unit of |b| at these nodes.
    pub fn unit_along(&self, lines: &Sightlines, hole: &Kerr, velocity: &AngularVelocity) -> f64 {
        self.unit_of(self.views(lines, hole, velocity).iter().flatten().flatten())
    }

    /// The light of all nodes, ray by ray; none where matter would be faster than light.
    fn views(
        &self,
        lines: &Sightlines,
        hole: &Kerr,
        velocity: &AngularVelocity,
    ) -> Vec<Vec<Option<SynchrotronView>>> {
        let along = |ray: usize| -> Vec<Option<SynchrotronView>> {
            let Arrival { end, place: [alpha, beta] } = lines.arrivals[ray];
            let start = ray.checked_sub(1).map_or(0, |before| lines.arrivals[before].end);
            let screen = ScreenPoint::new(hole, self.sin_inclination, alpha, beta);
            (start..end).map(|k| self.node(lines, k, &screen, hole, velocity)).collect()
        };
        (0..lines.arrivals.len()).into_par_iter().map(along).collect()
    }

    fn unit_of<'a>(&self, views: impl Iterator<Item = &'a SynchrotronView>) -> f64 {
        if self.law.normalisation == Normalisation::None {
            return 1.0;
        }
        let (sum, count) = views.fold((0.0, 0.0), |(sum, n), seen| (sum + seen.field, n + 1.0));
        // Without any field all factors are 0, whatever the unit.
        if sum > 0.0 { sum / count } else { 1.0 }
    }

    fn node(
        &self,
        lines: &Sightlines,
        k: usize,
        screen: &ScreenPoint,
        hole: &Kerr,
        velocity: &AngularVelocity,
    ) -> Option<SynchrotronView> {
        let of = |columns: &[Vec<f64>; 3]| [0, 1, 2].map(|c| columns[c][k]);
        // Angular momentum L of the arriving photon, and d(1/r)/dτ of the backward ray.
        let (position, turn, radial) = (of(&lines.position), of(&lines.momentum), lines.radial[k]);
        let r = norm(position);
        let n = position.map(|x| x / r);
        let [x, y, u] = n;
        let sin = x.hypot(y);
        let frame = ZamoFrame::at(hole, r, sin, u)?;
        let omega = self.axis.vector().map(|axis| velocity.rate(r) * axis);
        let gas = Gas::falling(&frame, n, (omega, velocity.fall(r)))?;
        let (cos_phi, sin_phi) = if sin > 0.0 { (x / sin, y / sin) } else { (1.0, 0.0) };
        // With L = p_θ φ̂ − p_φ θ̂/sin θ: p_θ = L·φ̂ and p_φ = L_z.
        let polar = turn[1] * cos_phi - turn[0] * sin_phi;
        // p_r = (dr/dτ)/Δ: backwards dr/dτ = −r² d(1/r)/dτ, and the photon has the opposite.
        let momentum = [-1.0, radial * r * r / hole.delta(r), polar, turn[2]];
        self.law.view(&frame, screen, frame.covariant(momentum), gas)
    }
}

/// Quantities of a model that data depend on.
#[derive(Clone, Debug, PartialEq)]
pub enum Observable {
    /// Every pixel, of total intensity.
    Images,
    /// Every pixel, an image for each of these parameters, one after the other.
    StokesImages(Vec<StokesParameter>),
    /// The flux of all pixels together: a number for each of these parameters.
    Fluxes(Vec<StokesParameter>),
}

impl Observable {
    /// The parameters, in the order of the images.
    pub fn parameters(&self) -> &[StokesParameter] {
        match self {
            Observable::Images => &[StokesParameter::I],
            Observable::StokesImages(parameters) | Observable::Fluxes(parameters) => parameters,
        }
    }

    /// Returns whether pixels are added up.
    pub fn is_flux(&self) -> bool {
        matches!(self, Observable::Fluxes(_))
    }
}

/// Factors with which the emission of a node enters several images.
#[derive(Clone, Debug)]
pub(in crate::fit) struct Planes<T> {
    /// Number of planes.
    pub count: usize,
    /// Pixels of one image.
    pub stride: usize,
    factors: Vec<T>,
}

impl<T: Float> Planes<T> {
    /// Bytes of the factors of all nodes.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.factors)
    }

    /// Takes the factors of all nodes.
    pub fn new(factors: &[Stokes], parameters: &[StokesParameter], stride: usize) -> Self {
        let mut all = Vec::with_capacity(factors.len() * parameters.len());
        for stokes in factors {
            all.extend(parameters.iter().map(|parameter| T::of(stokes.get(*parameter))));
        }
        Self { count: parameters.len(), stride, factors: all }
    }

    /// Turns Q and U of all nodes, whose places among the planes are given.
    pub fn turn(&mut self, [q, u]: [usize; 2], radians: f64) {
        let (sin, cos) = (2.0 * radians).sin_cos();
        for factors in self.factors.chunks_exact_mut(self.count) {
            let (x, y) = (factors[q].double(), factors[u].double());
            factors[q] = T::of(x * cos - y * sin);
            factors[u] = T::of(x * sin + y * cos);
        }
    }

    /// Those of a node.
    #[inline(always)]
    pub fn of(&self, node: u32) -> &[T] {
        &self.factors[node as usize * self.count..(node as usize + 1) * self.count]
    }

    /// Returns the derivative of a loss by the light of a node in a pixel of the first image.
    #[inline(always)]
    pub fn slope(&self, of_image: &[T], pixel: usize, node: u32) -> T {
        let factors = self.of(node).iter().enumerate();
        factors.map(|(plane, factor)| of_image[pixel + plane * self.stride] * *factor).sum()
    }
}

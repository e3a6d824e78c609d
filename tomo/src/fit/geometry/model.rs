//! Forward model of a fit in a geometry.

use super::{Geometry, Parameter};
use crate::Error;
use crate::fit::forward::pixel_rays::{PixelRays, near_the_ring};
use crate::fit::{
    ForwardModel, Motion, Observable, PolarizedView, Redshift, Region, RingRays, Sampling,
    SightlineRequest, Sightlines,
};
use kerrlight_common::simd::Float;
use kerrlight_geodesic::infall::Mixture;
use kerrlight_geodesic::{Inclination, Kerr, Observer};
use kerrlight_render::dynamics::infall::{self, Falling};
use kerrlight_render::dynamics::{AngularVelocity, Axis};
use kerrlight_render::polarization::PolarizationLaw;
use std::sync::Arc;

/// Law of the motion of matter.
#[derive(Clone, Debug, PartialEq)]
pub enum Law {
    /// 1/(r^{3/2} + a): circular geodesics about whatever spin the hole has.
    CircularOrbits,
    /// The same for all geometries.
    Fixed(AngularVelocity),
    /// The family between circular orbits and free fall that [`Parameter::Xi`], [`Parameter::BetaR`] and
    /// [`Parameter::BetaPhi`] say, about a spin (M) of the flow's own or, without one, that of each geometry along the axis.
    Infall(Option<f64>),
}

impl Law {
    /// Returns the velocity in a geometry, about an axis.
    fn velocity(&self, geometry: &Geometry, axis: Axis) -> Result<AngularVelocity, Error> {
        // Matter about another axis meets the component of the spin along it: −a about −z.
        let drag = geometry.get(Parameter::Spin) * axis.vector()[2];
        Ok(match self {
            Law::CircularOrbits => AngularVelocity::Keplerian { drag },
            Law::Fixed(law) => law.clone(),
            Law::Infall(own) => {
                let [xi, beta_r, beta_phi] = Parameter::FLOW.map(|of| geometry.get(of));
                let mixture = Mixture { xi, beta_r, beta_phi };
                let family = infall::Family { spin: own.unwrap_or(drag), mixture };
                AngularVelocity::Falling(Arc::new(Falling::new(infall::Law::Family(family))?))
            }
        })
    }
}

/// Properties that all geometries share: the screen, where emission is looked for, the law of motion and the frames.
#[derive(Clone, Debug)]
pub struct GeometryModel {
    /// Places of the pixels, M to the right of the middle of the screen.
    pub x: Vec<f64>,
    /// The same, upwards.
    pub y: Vec<f64>,
    /// More rays for pixels near the critical curve, where they are wanted.
    pub ring: Option<RingRays>,
    /// Width of pixels, M, and into how many parts each side is cut, where a pixel is the mean over the middles of its
    /// parts; none where it is what its own middle shows.
    pub parts: Option<(f64, usize)>,
    /// Distance of the observer, M; infinity without one.
    pub observer_radius: Option<f64>,
    /// Region of the emission.
    pub region: Region,
    /// Nodes of a Gauss–Legendre panel, at most 16.
    pub order: usize,
    /// Number of panels into which each of the coarsest is cut.
    pub split: u32,
    /// True if light takes its time.
    pub slow_light: bool,
    /// The power of g that emission goes like; none without redshift.
    pub redshift: Option<Redshift>,
    /// Law of the rotation of matter.
    pub law: Law,
    /// Axis of the rotation.
    pub axis: Axis,
    /// Times of the frames, M, and when emission is what a representation says; its velocity
    /// is not used.
    pub motion: Motion,
    /// Jy in a pixel of a ray with 1 M of emission 1.
    pub jy: f64,
    /// The law of polarised light, which has a power of g of its own; unpolarised, without one.
    pub polarization: Option<PolarizationLaw>,
    /// Quantities that data depend on.
    pub seen: Observable,
}

impl GeometryModel {
    /// Nodes on the rays of a geometry.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn sightlines(&self, geometry: &Geometry) -> Result<Sightlines, Error> {
        let (hole, observer) = self.observed(geometry)?;
        let request = SightlineRequest {
            region: self.region,
            sampling: Sampling::Gauss { order: self.order, split: self.split },
            delay: self.slow_light,
            momentum: self.redshift.is_some() || self.polarization.is_some(),
        };
        let (rays, turn) = (self.rays(geometry, &hole, &observer), turn(geometry));
        let mut lines = Sightlines::of_pixels(&hole, &observer, &rays, turn, &request)?;
        lines.weight.iter_mut().for_each(|weight| *weight *= self.jy);
        Ok(lines)
    }

    /// The forward model of a geometry, with the weights of its gas.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn forward<T: Float>(&self, geometry: &Geometry) -> Result<ForwardModel<T>, Error> {
        let lines = self.sightlines(geometry)?;
        let (hole, _) = self.observed(geometry)?;
        let motion = self.motion_of(geometry)?;
        let model = ForwardModel::new(&lines, &motion, &hole, self.redshift)?;
        let view = self.polarized(geometry);
        let factors = view.map(|view| view.factors(&lines, &hole, &motion.velocity)).transpose()?;
        let mut model = model.seen(factors.as_deref(), &self.seen)?;
        model.weigh(self.axis);
        Ok(model)
    }

    /// Returns the view of polarised light in a geometry.
    pub fn polarized(&self, geometry: &Geometry) -> Option<PolarizedView> {
        let law = self.polarization?;
        Some(PolarizedView {
            law,
            axis: self.axis,
            sin_inclination: geometry.get(Parameter::Inclination).sin(),
            position_angle: geometry.get(Parameter::PositionAngle),
            unit: None,
        })
    }

    fn observed(&self, geometry: &Geometry) -> Result<(Kerr, Observer), Error> {
        let geometry = geometry.checked()?;
        let hole = Kerr::new(geometry.get(Parameter::Spin))?;
        let inclination = Inclination::from_radians(geometry.get(Parameter::Inclination))?;
        let observer = match self.observer_radius {
            None => Observer::at_infinity(inclination),
            Some(radius) => Observer::at_radius(inclination, radius)?,
        };
        Ok((hole, observer))
    }

    /// The same with other rays for the pixels near the critical curve; those of number 0 are the usual ones.
    pub fn seen_along(&self, number: u64) -> Self {
        let other = |ring| RingRays { lattice: number, ..ring };
        Self { ring: self.ring.map(other), ..self.clone() }
    }

    /// Returns the motion of matter in a geometry.
    ///
    /// # Errors
    /// If a parameter of the flow is out of its range.
    pub fn motion_of(&self, geometry: &Geometry) -> Result<Motion, Error> {
        Ok(Motion { velocity: self.law.velocity(geometry, self.axis)?, ..self.motion.clone() })
    }

    /// Returns the pixels that are nearer to the critical curve of a geometry than a limit, M.
    ///
    /// # Errors
    /// If a parameter is out of its range.
    pub fn ring_pixels(&self, geometry: &Geometry, limit: f64) -> Result<Vec<bool>, Error> {
        let (hole, observer) = self.observed(geometry)?;
        let turn = turn(geometry);
        let pairs = self.x.iter().zip(&self.y);
        let places: Vec<[f64; 2]> = pairs.map(|(x, y)| turn([*x, *y])).collect();
        Ok(near_the_ring(&hole, &observer, &places, limit))
    }

    /// The rays of all pixels of a geometry.
    fn rays(&self, geometry: &Geometry, hole: &Kerr, observer: &Observer) -> PixelRays {
        let rays = match self.ring {
            Some(ring) => PixelRays::new(ring, hole, observer, [&self.x, &self.y], turn(geometry)),
            None => PixelRays::single(&self.x, &self.y),
        };
        match self.parts {
            Some((spacing, n)) => rays.divided(spacing, n),
            None => rays,
        }
    }
}

/// Returns the map from a place on the screen (M to the right and upwards) to α and β, M: α across the spin's projection, β
/// along it.
pub(super) fn turn(geometry: &Geometry) -> impl Fn([f64; 2]) -> [f64; 2] + Copy {
    let (sin, cos) = geometry.get(Parameter::PositionAngle).sin_cos();
    move |[x, y]| [x * cos + y * sin, y * cos - x * sin]
}

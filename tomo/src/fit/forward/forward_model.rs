//! The forward model: all that stands between a field of emission at the reference time and the pixels of a movie,
//! and does not change in a fit. Representations and data terms share it.

use super::fall::Fall;
use super::occupancy::Occupancy;
use super::shift::{Circles, Shift};
use super::sightlines::Sightlines;
use super::stokes::{Observable, Planes};
use crate::Error;
use crate::fit::quiescent::Quiescent;
use crate::representation::Representation;
use kerrlight_common::simd::Float;
use kerrlight_geodesic::Kerr;
use kerrlight_render::dynamics::{AngularVelocity, Axis, Injection};
use kerrlight_render::polarization::{Stokes, StokesParameter};
use rayon::prelude::*;

/// Motion of the matter, and the times at which it is seen.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Velocity of matter about the axis.
    pub velocity: AngularVelocity,
    /// Time at which the field of emission is what a representation says, M.
    pub reference: f64,
    /// Time at which it begins to shine; always, without one.
    pub injection: Option<Injection>,
    /// Times of the frames, M.
    pub times: Vec<f64>,
}

impl Motion {
    /// Returns the places at the reference time of the matter at points (M) at a time since the reference time (M).
    pub fn matter<T: Float>(&self, axis: Axis, time: f64, [x, y, z]: [&[T]; 3]) -> [Vec<T>; 3] {
        let before = |k: usize| {
            self.velocity.before(axis, [x[k], y[k], z[k]].map(Float::double), time).map(T::of)
        };
        let places: Vec<[T; 3]> = (0..x.len()).into_par_iter().map(before).collect();
        [0, 1, 2].map(|c| places.iter().map(|place| place[c]).collect())
    }
}

/// Redshift of the emission: j ∝ g^power a unit of affine parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Redshift {
    /// 2 + spectral index; BH-NeRF's tutorials have 2.
    pub power: f64,
}

/// Nodes with all that does not change in a fit, in the scalar that it runs in.
#[derive(Clone, Debug)]
pub struct ForwardModel<T> {
    pub(in crate::fit) pixels: usize,
    pub(in crate::fit) pixel: Vec<u32>,
    pub(in crate::fit) starts: Vec<usize>,
    pub(in crate::fit) position: [Vec<T>; 3],
    /// −Ω: by how much a point is turned back in a unit of time.
    pub(in crate::fit) rate: Vec<T>,
    /// Ω · delay.
    pub(in crate::fit) phase: Vec<T>,
    /// Times at which the light left, relative to the frame's.
    pub(in crate::fit) delay: Vec<T>,
    pub(in crate::fit) weight: Vec<T>,
    pub(in crate::fit) plain_weight: Vec<f64>,
    pub(in crate::fit) shift: Option<Shift>,
    /// Origins of matter that changes its radius; `rate` and `phase` then do not say it.
    pub(in crate::fit) fall: Option<Fall>,
    /// Factors with which nodes enter several images; one image without.
    pub(in crate::fit) planes: Option<Planes<T>>,
    /// Emission that does not move; its parameters are the last of a field's.
    pub(in crate::fit) quiescent: Option<Quiescent>,
    /// True if all rays add to the same pixel.
    pub(in crate::fit) is_flux: bool,
    pub(in crate::fit) factors: Vec<f64>,
    weighted_for: Option<Axis>,
    /// Times of the frames since the reference time.
    pub(in crate::fit) times: Vec<T>,
    /// Earliest time of emission since the reference time.
    pub(in crate::fit) earliest: Option<T>,
}

impl<T: Float> ForwardModel<T> {
    /// Makes the model of these nodes and this motion.
    ///
    /// # Errors
    /// If a number is out of its range, or redshift is asked of nodes without momenta.
    pub fn new(
        lines: &Sightlines,
        motion: &Motion,
        hole: &Kerr,
        redshift: Option<Redshift>,
    ) -> Result<Self, Error> {
        check(motion, redshift)?;
        let velocity = &motion.velocity;
        let rate = |k: usize| {
            let [x, y, z] = &lines.position;
            -velocity.rate((x[k] * x[k] + y[k] * y[k] + z[k] * z[k]).sqrt())
        };
        let rates: Vec<f64> = (0..lines.points()).map(rate).collect();
        let column = |numbers: &[f64]| numbers.iter().map(|x| T::of(*x)).collect::<Vec<T>>();
        let phase = lines.delay.iter().zip(&rates).map(|(delay, rate)| T::of(-rate * delay));
        let since = |time: f64| T::of(time - motion.reference);
        Ok(Self {
            pixels: lines.pixels,
            pixel: lines.pixel.clone(),
            starts: lines.starts.clone(),
            position: [0, 1, 2].map(|c| column(&lines.position[c])),
            phase: phase.collect(),
            rate: column(&rates),
            delay: column(&lines.delay),
            weight: column(&lines.weight),
            plain_weight: lines.weight.clone(),
            shift: redshift.map(|shift| Shift::new(lines, hole, velocity, shift.power)),
            fall: velocity.falling().map(|flow| Fall::new(flow, lines)),
            planes: None,
            quiescent: None,
            is_flux: false,
            factors: Vec::new(),
            weighted_for: None,
            times: motion.times.iter().map(|time| since(*time)).collect(),
            earliest: motion.injection.map(|injection| since(injection.time)),
        })
    }

    /// The same as data see it that are not images of total intensity alone; `factors` are those of all nodes
    /// ([`PolarizedView::factors`](crate::fit::PolarizedView::factors)), and without them there is no Q, U and V.
    ///
    /// # Errors
    /// If there are no parameters, or no factors for all of them.
    pub fn seen(mut self, factors: Option<&[Stokes]>, seen: &Observable) -> Result<Self, Error> {
        let parameters = seen.parameters();
        let known = factors.map_or(0, <[Stokes]>::len);
        let ok = factors.is_none() || known == self.points();
        Error::check("Stokes factors", known as f64, ok, "as many as nodes")?;
        // Before the planes: pixels of one image are the way from one of them to the next.
        if seen.is_flux() {
            (self.pixels, self.is_flux) = (1, true);
            self.pixel.fill(0);
        }
        match factors {
            // One image needs no planes: its factor goes into the weights.
            Some(factors) if parameters == [StokesParameter::I] => self.scale(factors),
            Some(factors) if !parameters.is_empty() => {
                let planes = Planes::new(factors, parameters, self.pixels);
                self.pixels *= planes.count;
                self.planes = Some(planes);
            }
            None if parameters == [StokesParameter::I] => {}
            _ => {
                let allowed = "I, and with a law of polarisation Q and U";
                let count = parameters.len() as f64;
                return Err(Error::out_of_range("Stokes parameters", count, allowed));
            }
        }
        Ok(self)
    }

    /// Turns all position angles, east of north, where `parameters` are those that it was made for.
    ///
    /// # Errors
    /// If Q and U are not among them.
    pub fn turn(&mut self, parameters: &[StokesParameter], radians: f64) -> Result<(), Error> {
        let place = |wanted| parameters.iter().position(|parameter| *parameter == wanted);
        let places = [StokesParameter::Q, StokesParameter::U].map(place);
        let ([Some(q), Some(u)], Some(planes)) = (places, &mut self.planes) else {
            let count = parameters.len() as f64;
            return Err(Error::out_of_range("Stokes parameters", count, "with Q and U"));
        };
        planes.turn([q, u], radians);
        Ok(())
    }

    /// The same with an image beside the emission: fields then have its parameters behind their own
    /// ([`WithStaticImage`](crate::fit::WithStaticImage)).
    ///
    /// # Errors
    /// If a number of the image is out of its range, or it has other pixels.
    pub fn beside(mut self, image: Quiescent) -> Result<Self, Error> {
        let image = image.checked()?;
        let pixels = image.pixels * image.signed.len();
        let allowed = "as many as the images of a frame have";
        Error::check("quiescent pixels", pixels as f64, pixels == self.pixels, allowed)?;
        self.quiescent = Some(image);
        Ok(self)
    }

    /// Returns the emission that does not move, where it is recovered.
    pub fn quiescent(&self) -> Option<&Quiescent> {
        self.quiescent.as_ref()
    }

    /// Weights of total intensity.
    fn scale(&mut self, factors: &[Stokes]) {
        for ((weight, plain), factor) in
            self.weight.iter_mut().zip(&mut self.plain_weight).zip(factors)
        {
            *plain *= factor.i;
            *weight = T::of(*plain);
        }
    }

    /// Pixels of an image, of all images of a frame together.
    pub fn pixels(&self) -> usize {
        self.pixels
    }

    /// Images of the movie.
    pub fn frames(&self) -> usize {
        self.times.len()
    }

    /// Rays that meet the region.
    pub fn rays(&self) -> usize {
        self.pixel.len()
    }

    /// Nodes of all rays.
    pub fn points(&self) -> usize {
        self.weight.len()
    }

    /// The pixel of each ray.
    pub fn pixel(&self) -> &[u32] {
        &self.pixel
    }

    /// Returns whether weights depend on the axis.
    pub fn is_shifted(&self) -> bool {
        self.shift.is_some()
    }

    /// Makes the weights those of gas that turns about this axis. Costs nothing without redshift, or for the
    /// same axis again.
    pub fn weigh(&mut self, axis: Axis) {
        let Some(shift) = &self.shift else { return };
        if self.weighted_for == Some(axis) {
            return;
        }
        self.factors.resize(self.plain_weight.len(), 0.0);
        shift.factors(axis, &mut self.factors);
        for ((weight, plain), factor) in
            self.weight.iter_mut().zip(&self.plain_weight).zip(&self.factors)
        {
            *weight = T::of(plain * factor);
        }
        self.weighted_for = Some(axis);
    }
}

impl<T: Float> ForwardModel<T> {
    /// Circles of which parts are dark; none without redshift, or of matter that falls.
    pub fn circles(&self) -> Option<&Circles> {
        self.shift.as_ref()?.circles.as_ref()
    }

    /// Gradient along the sphere of a loss with respect to the axis, by way of the weights alone:
    /// `cotangents` holds dL/dweight of each node, summed over frames. Zero without redshift.
    pub fn weights_vjp(&self, axis: Axis, cotangents: &[f64]) -> [f64; 3] {
        let Some(shift) = &self.shift else { return [0.0; 3] };
        // Of a weight, plain · g^power, the axis changes the second factor alone.
        let of_factor: Vec<f64> =
            cotangents.iter().zip(&self.plain_weight).map(|(c, plain)| c * plain).collect();
        shift.vjp(axis, &of_factor)
    }
}

#[cfg(feature = "wgpu")]
impl ForwardModel<f32> {
    /// Slope of each node's weight with respect to the axis, in the space around the sphere, and nothing; none without
    /// redshift.
    pub(in crate::fit) fn slopes_of_weights(&self, axis: Axis) -> Vec<[f32; 4]> {
        self.shift.as_ref().map_or(Vec::new(), |shift| shift.slopes(axis, &self.plain_weight))
    }
}

/// An emission field: a representation with its parameters, and where it is worth evaluating.
#[derive(Clone, Copy)]
pub struct Field<'a, T> {
    /// e(x; parameters).
    pub representation: &'a dyn Representation<T>,
    /// Its parameters.
    pub parameters: &'a [T],
    /// The axis that matter turns about.
    pub axis: Axis,
    /// Outside of it nothing shines.
    pub occupancy: Option<&'a Occupancy>,
}

fn check(motion: &Motion, redshift: Option<Redshift>) -> Result<(), Error> {
    motion.velocity.clone().checked()?;
    let finite =
        |field, value: f64| Error::check(field, value, value.is_finite(), "a finite number");
    finite("reference time", motion.reference)?;
    motion.injection.map_or(Ok(()), |injection| finite("injection time", injection.time))?;
    redshift.map_or(Ok(()), |shift| finite("redshift power", shift.power))?;
    motion.times.iter().try_for_each(|time| finite("frame time", *time))
}

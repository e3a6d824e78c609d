//! Emission that is simulated.

use super::glyph::Glyph;
use super::random_field::RandomField;
use super::ring::Rings;
use super::{AXIS, Instrument, Result, known_axis, motion};
use crate::fit::forward::known_field::collected;
use crate::fit::settings::{FitError, FitFile, Spot, Tube, Within, refuse};
use crate::fit::{Batch, ForwardModel};
use kerrlight_common::frames::{Frames, Sink};
use kerrlight_common::simd::Float;
use kerrlight_geodesic::vector::distance;
use kerrlight_render::dynamics::{AngularVelocity, Axis};
use kerrlight_render::polarization::StokesParameter;

/// Advice where there is no truth.
pub(super) const SPOT: &str = "add a table [[simulation.truth.spot]] with `center = [x, y, z]` and `sigma = …` in M and `amplitude = 1.0`";

/// The emission that is simulated.
#[derive(Clone)]
pub struct Truth {
    spots: Vec<Spot>,
    glyphs: Vec<Glyph>,
    field: Option<RandomField>,
    pub(super) rings: Rings,
    axis: Axis,
    velocity: AngularVelocity,
    /// M.
    reference: f64,
    /// Factor of its amplitudes.
    scale: f64,
}

/// Distance at which a Gaussian is 5e-32 of its peak, in its standard deviations: nothing beside any rounding.
const DARK: f64 = 12.0;

impl Truth {
    /// The truth of settings that have one and an axis.
    ///
    /// # Errors
    /// If there is none, or a number is out of range.
    pub fn new(file: &FitFile) -> Result<Self> {
        let missing = || {
            FitError::missing("simulation.truth", format!("there is nothing to simulate; {SPOT}"))
        };
        let truth = file.truth().ok_or_else(missing)?;
        let moves = [truth.spot.len(), truth.glyph.len(), truth.tube.len()];
        if moves == [0; 3] && truth.field.is_none() && truth.ring.is_empty() {
            refuse!("simulation.truth is empty; {SPOT}");
        }
        let mut spots = truth.spot.clone();
        spots.extend(truth.tube.iter().flat_map(Tube::spots));
        let missing = || FitError::missing("motion.axis", format!("a simulation needs it; {AXIS}"));
        let axis = known_axis(file)?.ok_or_else(missing)?;
        let glyph = |(k, shape)| {
            Glyph::new(shape, axis.vector()).within(format!("simulation.truth.glyph {k}"))
        };
        Ok(Self {
            spots,
            glyphs: truth.glyph.iter().enumerate().map(glyph).collect::<Result<_>>()?,
            field: truth.field.map(|field| RandomField::new(file, &field)).transpose()?,
            rings: Rings::new(file)?,
            axis,
            velocity: motion(file, Vec::new())?.velocity,
            reference: file.motion.reference_time,
            scale: 1.0,
        })
    }

    /// Makes it so many times as bright.
    pub fn scale(&mut self, factor: f64) {
        self.scale *= factor;
    }

    /// Emission at a place (M) at the reference time.
    pub fn at(&self, x: [f64; 3]) -> f64 {
        self.seen_at(x, 0.0)
    }

    /// Emission at a place (M) at a time since the reference time, M.
    pub fn seen_at(&self, x: [f64; 3], time: f64) -> f64 {
        let way = self.velocity.way_back(self.axis, x);
        let before = |elapsed: f64| if elapsed == 0.0 { x } else { way.before(elapsed) };
        // Spots that were round at the same time share the way back.
        let mut moved = (time, before(time));
        let reference = moved.1;
        let light = |spot: &Spot| {
            let shines = spot.shines.map_or(1.0, |shines| shines.at(self.reference + time));
            if shines < f64::EPSILON {
                return 0.0;
            }
            if time + spot.wound_for != moved.0 {
                moved = (time + spot.wound_for, before(time + spot.wound_for));
            }
            let offset = distance(moved.1, spot.center) / spot.sigma;
            if offset > DARK {
                return 0.0;
            }
            spot.amplitude * shines * (-0.5 * offset * offset).exp()
        };
        let of_spots: f64 = self.spots.iter().map(light).sum();
        let of_glyphs = self.glyphs.iter().map(|glyph| glyph.at(reference)).sum::<f64>();
        let of_field = self.field.as_ref().map_or(0.0, |field| field.at(reference));
        self.scale * (of_spots + of_glyphs + of_field)
    }

    /// Images in Jy per pixel of a forward model with the truth's motion, all frames one after the other.
    pub fn movie_through<T: Float>(&self, model: &mut ForwardModel<T>) -> Vec<f64> {
        model.weigh(self.axis);
        collected(|sink| self.images(model, sink))
    }

    fn images<T: Float>(&self, model: &ForwardModel<T>, sink: &mut Sink<'_, f64>) -> Result<()> {
        match self.is_carried() {
            true => model.images_of(self.axis, &|x| self.at(x), &mut Batch::default(), sink),
            false => {
                model.images_of_events(&|x, t| self.seen_at(x, t), &mut Batch::default(), sink)
            }
        }
    }

    /// Returns whether every amplitude is 0: data of noise alone.
    pub fn is_dark(&self) -> bool {
        self.spots.iter().all(|spot| spot.amplitude == 0.0)
            && self.glyphs.iter().all(Glyph::is_dark)
            && self.field.is_none()
    }

    /// Returns whether matter carries it unchanged.
    pub fn is_carried(&self) -> bool {
        self.spots.iter().all(|spot| spot.shines.is_none())
    }

    /// Its axis.
    pub fn axis(&self) -> Axis {
        self.axis
    }

    /// Returns the emission that does not move, Jy per pixel, rows from the top; none without rings.
    pub fn quiescent(&self, parameter: StokesParameter) -> Option<&[f64]> {
        (!self.rings.is_empty()).then(|| self.rings.of(parameter))
    }

    /// Its movie at some times, rings included, in double precision: Jy per pixel, frame by frame, rows from the top.
    ///
    /// # Errors
    /// If the motion is out of range, or there is no room for the movie.
    pub fn movie(
        &self,
        file: &FitFile,
        instrument: &Instrument,
        times: &[f64],
    ) -> Result<Frames<f64>> {
        let mut model = instrument.pictured::<f64>(&motion(file, times.to_vec())?)?;
        model.weigh(self.axis);
        Frames::made(model.frames(), model.pixels(), |sink| {
            if self.rings.is_empty() {
                return self.images(&model, sink);
            }
            self.images(&model, &mut |image| {
                let mut image = image.to_vec();
                self.rings.add_to(&mut image, &[StokesParameter::I]);
                sink(&image)
            })
        })
    }
}

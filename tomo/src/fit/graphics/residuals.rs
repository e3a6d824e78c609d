//! The loss of a step and its gradient: on the device, or with a part of it made by this processor.

use super::GraphicsFit;
use super::pending::{Pending, Share, Squares};
use super::pixels::{Gathering, Pair};
use super::rooms::{Ends, pieces};
use crate::fit::learning::device::Stretch;
use crate::fit::loss::objective::{Drawn, Loss};
use crate::fit::loss::terms::ImageTerm;
use kerrlight_geodesic::gpu::{Commands, GpuError};

impl GraphicsFit {
    /// Has the device find loss and gradient of step number `k` of a stretch, and take the step if it `learns`.
    pub(super) fn loss(
        &self,
        stretch: &Stretch<'_>,
        k: usize,
        learns: bool,
    ) -> Result<Pending, GpuError> {
        match (&stretch.draws[k], &stretch.objective.data.image) {
            (Drawn::Pixels(pairs), Some(image)) => {
                let model = &stretch.objective.model;
                // Pairs stand for all rays; pixels without one are in the mean, but always zero.
                let rays = model.rays() as f64 / model.pixels() as f64;
                let variance = f64::from(image.term.inverse_variance());
                let scale = rays * variance / pairs.len() as f64;
                let slope = (2.0 * image.weight * scale) as f32;
                for (some, ends) in pieces(pairs, self.pieces.pairs, learns) {
                    self.pairs(stretch, some, slope, k, ends, 0)?;
                }
                let squares = Squares { scale, dark: 0.0, weight: image.weight };
                Ok(Pending::There(Some(squares), Vec::new()))
            }
            (Drawn::Frames(frames), _) if self.makes_residuals => {
                self.frames(stretch, frames, k, learns)
            }
            (Drawn::Frames(frames), _) => self.shared_frames(stretch, frames, k, learns),
            // Without images there are no pairs to draw.
            (Drawn::Pixels(_), None) => Ok(Pending::Known(Loss::default())),
        }
    }

    /// Some pairs, whole frames if there are data but images, whose residuals are made on the device.
    fn pairs(
        &self,
        stretch: &Stretch<'_>,
        pairs: &[(u32, u32)],
        slope: f32,
        record: usize,
        ends: Ends,
        frames: usize,
    ) -> Result<(), GpuError> {
        let Self { device, pixels, .. } = self;
        let (model, image) = (&stretch.objective.model, &stretch.objective.data.image);
        let datum = |ray: u32, frame: u32| {
            let pixel = model.pixel[ray as usize] as usize;
            image.as_ref().map_or(0.0, |image| image.term.pixel(frame as usize, pixel))
        };
        let points = self.set(stretch, pairs, &datum, slope, record)?;
        device.run(|commands| {
            self.light(commands, pairs.len(), points, ends);
            if let Some(visibilities) = self.visibilities.as_ref().filter(|_| frames > 0) {
                visibilities.compare(commands, frames);
            }
            pixels.spread(commands, pairs.len());
            self.back(commands, pairs.len(), points, ends);
        })
    }

    /// Whole frames, whose residuals are made on the device.
    fn frames(
        &self,
        stretch: &Stretch<'_>,
        frames: &[usize],
        record: usize,
        learns: bool,
    ) -> Result<Pending, GpuError> {
        let objective = stretch.objective;
        let shares = Share::all(objective, frames.len());
        let factors: Vec<f32> = shares.iter().map(Share::factor).collect();
        let image = objective.data.image.as_ref().map(|image| {
            let variance = image.term.inverse_variance();
            let scale = 1.0 / objective.data_of(&*image.term, frames.len());
            let factor = (image.weight * scale) as f32;
            // Pixels without a ray are in no pair, but their data count.
            let dark = frames.iter().map(|frame| self.in_the_dark(&image.term, *frame)).sum();
            let scale = scale * f64::from(variance);
            // In floats and in this order, as the processor has it.
            ((factor + factor) * variance, Squares { scale, dark, weight: image.weight })
        });
        let slope = image.map_or(0.0, |(slope, _)| slope);
        for (some, ends) in pieces(frames, self.pieces.frames, learns) {
            if let Some(visibilities) = &self.visibilities {
                visibilities.set(&self.device, some, &factors, record)?;
            }
            let pairs = pairs_of(stretch, some);
            self.pairs(stretch, &pairs, slope, record, ends, some.len())?;
        }
        Ok(Pending::There(image.map(|(_, squares)| squares), shares))
    }

    /// Whole frames, of which this processor makes what data say of their images.
    fn shared_frames(
        &self,
        stretch: &Stretch<'_>,
        frames: &[usize],
        record: usize,
        learns: bool,
    ) -> Result<Pending, GpuError> {
        let Self { device, pixels, .. } = self;
        let objective = stretch.objective;
        let mut loss = objective.empty_loss();
        for (some, ends) in pieces(frames, self.pieces.frames, learns) {
            let pairs = pairs_of(stretch, some);
            let points = self.set(stretch, &pairs, &|_, _| 0.0, 0.0, record)?;
            device.run(|commands| self.light(commands, pairs.len(), points, ends))?;
            let fluxes = pixels.fluxes(device, pairs.len())?;
            let slopes = objective.of_frames(some, frames.len(), &fluxes, &mut loss);
            pixels.set_slopes(device, &slopes)?;
            device.run(|commands| {
                pixels.spread(commands, pairs.len());
                self.back(commands, pairs.len(), points, ends);
            })?;
        }
        objective.add_terms(&mut loss);
        Ok(Pending::Known(loss))
    }

    /// Computes the light of the rays of the pairs of a piece; before the first piece of a step, a new
    /// gradient.
    fn light(&self, commands: &mut Commands, pairs: usize, points: usize, ends: Ends) {
        if ends.is_first {
            commands.clear(&self.learning.gradient);
            self.pixels.axis.iter().for_each(|axis| axis.begin(commands));
        }
        self.pixels.gather(commands, pairs);
        self.field.forward(commands, points);
        self.pixels.sum(commands, pairs);
    }

    /// Computes the gradient from the cotangents of a piece; behind the last piece of a step that is taken, the
    /// step.
    fn back(&self, commands: &mut Commands, pairs: usize, points: usize, ends: Ends) {
        self.field.backward(commands, points);
        self.pixels.axis.iter().for_each(|axis| axis.add(commands, pairs));
        if ends.is_last_and_learns {
            self.learning.learn(commands);
            self.turning.iter().for_each(|turning| turning.learn(commands));
        }
    }

    /// Puts pairs there; the most points that they can have.
    fn set(
        &self,
        stretch: &Stretch<'_>,
        pairs: &[(u32, u32)],
        datum: &dyn Fn(u32, u32) -> f32,
        slope: f32,
        record: usize,
    ) -> Result<usize, GpuError> {
        let model = &stretch.objective.model;
        let pair = |(ray, frame): &(u32, u32)| Pair {
            nodes: [0, 1].map(|end| model.starts[*ray as usize + end] as u32),
            time: model.times[*frame as usize],
            datum: datum(*ray, *frame),
        };
        let pairs: Vec<Pair> = pairs.iter().map(pair).collect();
        let how = Gathering {
            axis: stretch.axis.vector().map(|x| x as f32),
            earliest: model.earliest,
            mask: stretch.occupancy.map(|mask| mask.shape()),
            events: self.events,
            slope,
            record: record as u32,
        };
        self.pixels.set(&self.device, &pairs, &how)?;
        Ok(pairs.iter().map(|pair| (pair.nodes[1] - pair.nodes[0]) as usize).sum())
    }

    /// Squares of the data where no ray is.
    fn in_the_dark(&self, term: &ImageTerm<f32>, frame: usize) -> f64 {
        self.dark.iter().map(|pixel| f64::from(term.pixel(frame, *pixel)).powi(2)).sum()
    }
}

fn pairs_of(stretch: &Stretch<'_>, frames: &[usize]) -> Vec<(u32, u32)> {
    let rays = stretch.objective.model.rays() as u32;
    frames.iter().flat_map(|frame| (0..rays).map(|ray| (ray, *frame as u32))).collect()
}

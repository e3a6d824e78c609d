//! Steps of a fit on a graphics device (feature `wgpu`).
//!
//! The device holds the nodes of all rays, parameters, gradient and Adam's moments. A step is a handful of commands:
//! nodes of the drawn (ray, frame) pairs are turned back to the reference time and those that are dark left out, the
//! representation goes forward, light is summed along rays, residuals go back to points, the representation goes back,
//! Adam or Muon learns. Sums have a fixed order or are sums of whole numbers: the same steps on the same device give the same
//! bytes. What is drawn is drawn by this processor, so that both devices take the same steps but for rounding.
//!
//! Residuals of images are made on the device, and nothing but losses comes back before the end of a stretch. For all
//! other data the light of the rays comes back at each step, data terms make their gradient of it on this processor, and
//! that goes to the device.

mod adam;
mod axis;
mod bytes;
mod fall;
mod field;
mod grid;
mod kernels;
mod muon;
mod network;
mod nodes;
mod pixels;
mod refusals;
mod rooms;
mod shape;
mod terms;

use super::device::{DeviceError, Drawn, StepDevice, Stretch, Taken};
use super::objective::{Loss, Objective};
use super::state::Progress;
use super::terms::ImageTerm;
use super::training::Training;
use crate::Error;
use crate::dynamics::Axis;
use crate::representation::Representation;
use adam::{Learning, Rule};
use fall::FallTable;
use field::Field;
use kerrlight_geodesic::gpu::{Adapter, Commands, Compute, GpuError, Needs};
use muon::Turning;
use pixels::{Gathering, Pair, Pixels};
pub use refusals::check;
use rooms::{Ends, Pieces, pieces};

impl From<GpuError> for Error {
    fn from(error: GpuError) -> Self {
        Self::Device(DeviceError(error.to_string()))
    }
}

/// Opens a device that has what fits need.
///
/// # Errors
/// If it refuses, or its limits are too small.
pub fn open(adapter: &Adapter) -> Result<Compute, GpuError> {
    let needs =
        Needs { invocations: 256, workgroup_bytes: 12288, buffers: 8, buffer_bytes: 1 << 24 };
    Compute::open(adapter, needs)
}

/// A fit on a graphics device.
#[derive(Debug)]
pub struct GraphicsFit {
    device: Compute,
    pixels: Pixels,
    learning: Learning,
    turning: Option<Turning>,
    field: Field,
    pieces: Pieces,
    /// Whether the field is one of places and times.
    events: bool,
    /// Whether images are all the data, so that residuals are made on the device.
    images_only: bool,
    /// Pixels without a ray.
    dark: Vec<usize>,
    loaded_for: Option<Axis>,
}

/// The loss of a step, as far as it is known before the device is done.
enum Pending {
    /// Of images: factor on the sum of squares, squares of pixels without a ray, and weight of the term.
    Squares { scale: f64, dark: f64, weight: f64 },
    /// All of it.
    Known(Loss),
}

/// The most steps of a stretch.
const STEPS: usize = 256;

impl GraphicsFit {
    /// A fit of this objective, with all that does not change on the device. `most` is the most points of a block of the
    /// network, if fewer than usual.
    ///
    /// # Errors
    /// If the device has no room or fails, or something is asked for that it does not do.
    pub fn new(
        device: Compute,
        objective: &Objective<f32>,
        representation: &dyn Representation<f32>,
        training: &Training,
        most: Option<usize>,
    ) -> Result<Self, Error> {
        check(objective, representation, training)?;
        let model = &objective.model;
        let cells = training.occupancy.map_or(0, |plan| plan.settings.cells);
        let pieces = Pieces::new(objective, training.batch);
        let events = !representation.is_carried();
        // What is not carried does not fall.
        let fall = model.fall.as_ref().filter(|_| !events).map(FallTable::new);
        let axis = training.learns_axis(representation).then(|| model.is_shifted());
        let room = pieces.room((model.points(), cells, STEPS), axis);
        let pixels = Pixels::new(&device, room, fall)?;
        let positive = field::is_positive(representation);
        let matrices = training.muon.map(|_| representation.matrices()).unwrap_or_default();
        let count = representation.parameters();
        let learning = Learning::new(&device, count, positive, &matrices)?;
        let turning = training.muon.map(|muon| Turning::new(&device, muon, &matrices, &learning));
        let turning = turning.transpose()?.flatten();
        let (buffers, how) = ((&pixels.points, &learning), (most, axis.is_some()));
        let field = Field::new(&device, representation, buffers, how)?;
        let mut lit = vec![false; model.pixels()];
        model.pixel().iter().for_each(|pixel| lit[*pixel as usize] = true);
        let dark = (0..lit.len()).filter(|pixel| !lit[*pixel]).collect();
        let images_only = objective.data.others.is_empty() && !model.is_flux;
        Ok(Self {
            device,
            pixels,
            learning,
            turning,
            field,
            pieces,
            events,
            images_only,
            dark,
            loaded_for: None,
        })
    }

    /// Loss of the first step of a stretch, which is not taken, and its gradient with respect to parameters and, if that is
    /// learnt, the axis.
    ///
    /// # Errors
    /// If the device fails.
    pub fn gradient(
        &mut self,
        stretch: &Stretch<'_, f32>,
        from: &Progress<f32>,
    ) -> Result<(Loss, Vec<f32>, [f64; 3]), Error> {
        self.load(stretch, from)?;
        let pending = self.loss(stretch, 0, false)?;
        let buffers = [self.pixels.records(), &self.learning.gradient];
        let read = self.device.read_as(&buffers, bytes::read)?;
        let gradient = read[1][..from.parameters.len()].to_vec();
        Ok((pending.ended(&read[0]), gradient, self.of_axis(stretch.axis)?))
    }

    /// The slope of the last step's loss along the sphere of axes; zero if the axis is not learnt.
    fn of_axis(&self, axis: Axis) -> Result<[f64; 3], GpuError> {
        let sum = self.pixels.axis.as_ref().map(|slope| slope.sum(&self.device)).transpose()?;
        Ok(axis.tangent(sum.unwrap_or_default()))
    }

    /// The device.
    pub fn device(&self) -> &Compute {
        &self.device
    }

    /// Puts what a stretch starts from there.
    fn load(&mut self, stretch: &Stretch<'_, f32>, from: &Progress<f32>) -> Result<(), GpuError> {
        let Self { device, pixels, learning, events, .. } = self;
        let model = &stretch.objective.model;
        if self.loaded_for != Some(stretch.axis) {
            pixels.load(device, nodes::nodes(model, !*events))?;
            if let Some(axis) = &pixels.axis {
                axis.load(device, &model.slopes_of_weights(stretch.axis))?;
            }
            self.loaded_for = Some(stretch.axis);
        }
        if let Some(mask) = stretch.occupancy {
            pixels.load_mask(device, mask.cells())?;
        }
        learning.load(device, [&from.parameters, &from.adam.first, &from.adam.second])?;
        device.run(|commands| pixels.forget(commands))
    }

    /// Has the device find loss and gradient of step number `k` of a stretch, and take the step if it `learns`.
    fn loss(
        &self,
        stretch: &Stretch<'_, f32>,
        k: usize,
        learns: bool,
    ) -> Result<Pending, GpuError> {
        match (&stretch.draws[k], &stretch.objective.data.image) {
            (Drawn::Pixels(pairs), Some(image)) => {
                let model = &stretch.objective.model;
                let rays = model.rays() as f64 / model.pixels() as f64;
                let variance = f64::from(image.term.inverse_variance());
                let scale = rays * variance / pairs.len() as f64;
                let slope = (2.0 * image.weight * scale) as f32;
                for (some, ends) in pieces(pairs, self.pieces.pairs, learns) {
                    self.images(stretch, some, (slope, k), &image.term, ends)?;
                }
                Ok(Pending::Squares { scale, dark: 0.0, weight: image.weight })
            }
            (Drawn::Frames(frames), Some(image)) if self.images_only => {
                let variance = image.term.inverse_variance();
                let scale = 1.0 / stretch.objective.data_of(&*image.term, frames.len());
                let factor = (image.weight * scale) as f32;
                let slope = (factor + factor) * variance;
                for (some, ends) in pieces(frames, self.pieces.frames, learns) {
                    self.images(stretch, &pairs_of(stretch, some), (slope, k), &image.term, ends)?;
                }
                let dark = frames.iter().map(|frame| self.in_the_dark(&image.term, *frame)).sum();
                let scale = scale * f64::from(variance);
                Ok(Pending::Squares { scale, dark, weight: image.weight })
            }
            (Drawn::Frames(frames), _) => self.frames(stretch, frames, k, learns),
            // Without images there are no pairs to draw.
            (Drawn::Pixels(_), None) => Ok(Pending::Known(Loss::default())),
        }
    }

    /// Some pairs, whose residuals are made on the device.
    fn images(
        &self,
        stretch: &Stretch<'_, f32>,
        pairs: &[(u32, u32)],
        (slope, record): (f32, usize),
        term: &ImageTerm<f32>,
        ends: Ends,
    ) -> Result<(), GpuError> {
        let Self { device, pixels, field, .. } = self;
        let model = &stretch.objective.model;
        let datum =
            |ray: u32, frame: u32| term.pixel(frame as usize, model.pixel[ray as usize] as usize);
        let points = self.set(stretch, pairs, &datum, (slope, record))?;
        device.run(|commands| {
            self.begin(commands, ends);
            pixels.gather(commands, pairs.len());
            field.forward(commands, points);
            pixels.sum(commands, pairs.len());
            pixels.spread(commands, pairs.len());
            self.back(commands, (pairs.len(), points), ends);
        })
    }

    /// Whole frames, of which this processor makes what data say of their images.
    fn frames(
        &self,
        stretch: &Stretch<'_, f32>,
        frames: &[usize],
        record: usize,
        learns: bool,
    ) -> Result<Pending, GpuError> {
        let Self { device, pixels, field, .. } = self;
        let objective = stretch.objective;
        let mut loss = objective.empty_loss();
        for (some, ends) in pieces(frames, self.pieces.frames, learns) {
            let pairs = pairs_of(stretch, some);
            let points = self.set(stretch, &pairs, &|_, _| 0.0, (0.0, record))?;
            device.run(|commands| {
                self.begin(commands, ends);
                pixels.gather(commands, pairs.len());
                field.forward(commands, points);
                pixels.sum(commands, pairs.len());
            })?;
            let fluxes = pixels.fluxes(device, pairs.len())?;
            let slopes = objective.of_frames((some, frames.len()), &fluxes, &mut loss);
            pixels.set_slopes(device, &slopes)?;
            device.run(|commands| {
                pixels.spread(commands, pairs.len());
                self.back(commands, (pairs.len(), points), ends);
            })?;
        }
        objective.add_terms(&mut loss);
        Ok(Pending::Known(loss))
    }

    /// Before the first piece of a step.
    fn begin(&self, commands: &mut Commands, ends: Ends) {
        if ends.is_first {
            commands.clear(&self.learning.gradient);
            self.pixels.axis.iter().for_each(|axis| axis.begin(commands));
        }
    }

    /// From the cotangents of a piece to the gradient; behind the last piece of a step that is taken, the step.
    fn back(&self, commands: &mut Commands, (pairs, points): (usize, usize), ends: Ends) {
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
        stretch: &Stretch<'_, f32>,
        pairs: &[(u32, u32)],
        datum: &dyn Fn(u32, u32) -> f32,
        (slope, record): (f32, usize),
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

impl StepDevice<f32> for GraphicsFit {
    fn name(&self) -> &str {
        self.device.name()
    }

    fn most(&self) -> usize {
        // The processor turns the axis.
        if self.pixels.axis.is_some() { 1 } else { STEPS }
    }

    fn take(
        &mut self,
        stretch: &Stretch<'_, f32>,
        from: &Progress<f32>,
    ) -> Result<Taken<f32>, Error> {
        self.load(stretch, from)?;
        self.learning.hold([&[]; 3]);
        let Self { device, pixels, learning, turning, .. } = &*self;
        let mut pending = Vec::with_capacity(stretch.draws.len());
        for (k, rate) in stretch.rates.iter().enumerate() {
            let adam = stretch.adam;
            let (beta, epsilon) = ([adam.beta1, adam.beta2], adam.epsilon);
            let steps = from.adam.steps + k as u64 + 1;
            learning.set(device, Rule { beta, epsilon, rate: *rate, steps })?;
            turning.as_ref().map_or(Ok(()), |turning| turning.set(device, *rate))?;
            pending.push(self.loss(stretch, k, true)?);
        }
        let [parameters, first, second] = learning.buffers();
        let mut read =
            device.read_as(&[parameters, first, second, pixels.records()], bytes::read)?;
        let records = read.pop().unwrap_or_default();
        read.iter_mut().for_each(|numbers| numbers.truncate(from.parameters.len()));
        let [parameters, first, second] = [0, 1, 2].map(|k| core::mem::take(&mut read[k]));
        self.learning.hold([&parameters, &first, &second]);
        let losses = pending.into_iter().zip(records.chunks(2));
        Ok(Taken {
            parameters,
            moments: [first, second],
            losses: losses.map(|(pending, record)| pending.ended(record)).collect(),
            of_axis: self.of_axis(stretch.axis)?,
        })
    }
}

impl Pending {
    /// With what the device has recorded: a sum of squares, and the bits of the number of points.
    fn ended(self, record: &[f32]) -> Loss {
        let points = record[1].to_bits() as usize;
        match self {
            Self::Known(loss) => Loss { points, ..loss },
            Self::Squares { scale, dark, weight } => {
                let term = scale * (f64::from(record[0]) + dark);
                Loss { total: weight * term, terms: vec![term], points, ..Loss::default() }
            }
        }
    }
}

fn pairs_of(stretch: &Stretch<'_, f32>, frames: &[usize]) -> Vec<(u32, u32)> {
    let rays = stretch.objective.model.rays() as u32;
    frames.iter().flat_map(|frame| (0..rays).map(|ray| (ray, *frame as u32))).collect()
}

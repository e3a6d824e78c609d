//! Steps of a fit on a graphics device (feature `wgpu`).
//!
//! The device holds the nodes of all rays, parameters, gradient and Adam's moments. A step is a handful of commands:
//! nodes of the drawn (ray, frame) pairs are turned back to the reference time and those that are dark left out, the
//! representation goes forward, light is summed along rays, residuals go back to points, the representation goes back,
//! Adam or Muon learns. Sums have a fixed order or are sums of whole numbers: the same steps on the same device give the same
//! bytes. What is drawn is drawn by this processor, so that both devices take the same steps but for rounding.
//!
//! Residuals of images, fluxes, visibilities, amplitudes and closure quantities are made on the device, and nothing but
//! losses comes back before the end of a stretch. For all other data (gains that are solved for) the light of the rays comes
//! back at each step, data terms make their gradient of it on this processor, and that goes to the device.

mod adam;
mod axis;
mod bytes;
mod comparisons;
mod fall;
mod field;
mod grid;
mod kernels;
mod muon;
mod network;
mod pending;
mod pixels;
mod residuals;
mod rooms;
mod shape;
mod terms;
mod visibilities;

use super::learning::device::{DeviceError, StepDevice, Stretch, Taken};
use super::learning::state::Progress;
use super::learning::training::Training;
use super::loss::objective::{Loss, Objective};
use crate::Error;
use crate::representation::{BuiltIn, Representation};
use adam::Learning;
use fall::FallTable;
use kernels::Field;
use kerrlight_geodesic::gpu::{Adapter, Compute, GpuError, Needs};
use kerrlight_render::dynamics::Axis;
use muon::Turning;
use pending::Pending;
use pixels::{Pixels, nodes};
use rooms::Pieces;
use visibilities::Visibilities;

/// Parameters of a network, at most: kernels have a workgroup for 64 of them, and WebGPU has 65,535 in a row.
const MOST_PARAMETERS: usize = 64 * 65_535;

impl From<GpuError> for Error {
    fn from(error: GpuError) -> Self {
        Self::Device(DeviceError(error.to_string()))
    }
}

/// Refuses what is not done on a device, with the key that asks for it.
///
/// # Errors
/// Names the first such key.
pub fn check(
    objective: &Objective<f32>,
    representation: &dyn Representation<f32>,
    training: &Training,
) -> Result<(), Error> {
    let model = &objective.model;
    let is_network = matches!(representation.built_in(), Some(BuiltIn::Network(_)));
    let is_large = is_network && representation.parameters() > MOST_PARAMETERS;
    for (asked, key, what) in [
        (training.change.is_some(), "change", "emission that changes while matter carries it is"),
        (model.planes.is_some(), "polarization", "Stokes parameters are"),
        (representation.built_in().is_none(), "representation.kind", "this representation is"),
        (is_large, "representation.network", "networks of more than 4,194,240 parameters are"),
    ] {
        if asked {
            let why =
                format!("{key}: {what} not computed on graphics devices, the processor does it");
            return Err(DeviceError(why).into());
        }
    }
    Ok(())
}

/// Opens a device that has what fits need.
///
/// # Errors
/// If it refuses, or its limits are too small.
pub fn open(adapter: &Adapter) -> Result<Compute, GpuError> {
    // Slabs of the network's products take 12 KiB, its workgroups have 256 lanes, and `pull` and
    // `open` of visibilities bind 8 storage buffers.
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
    /// True if the field is one of places and times.
    events: bool,
    /// True if the device makes all residuals.
    makes_residuals: bool,
    /// Comparison with data but images, where there are any.
    visibilities: Option<Visibilities>,
    /// Pixels without a ray.
    dark: Vec<usize>,
    loaded_for: Option<Axis>,
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
        let cells = training.occupancy.map_or(0, |mask| mask.cells);
        let pieces = Pieces::new(objective, training.batch);
        let events = !representation.is_carried();
        // What is not carried does not fall.
        let fall = model.fall.as_ref().filter(|_| !events).map(FallTable::new);
        let axis = training.learns_axis(representation).then(|| model.is_shifted());
        let room = pieces.room(model.points(), cells, STEPS, axis);
        let pixels = Pixels::new(&device, room, fall)?;
        let positive = field::is_positive(representation);
        let matrices = training.muon.map(|_| representation.matrices()).unwrap_or_default();
        let count = representation.parameters();
        let learning = Learning::new(&device, count, positive, &matrices)?;
        let turning = training.muon.map(|muon| Turning::new(&device, muon, &matrices, &learning));
        let turning = turning.transpose()?.flatten();
        let points = &pixels.points;
        let of_places = axis.is_some();
        let field = field::on_device(&device, representation, points, &learning, most, of_places)?;
        let mut lit = vec![false; model.pixels()];
        model.pixel().iter().for_each(|pixel| lit[*pixel as usize] = true);
        let dark = (0..lit.len()).filter(|pixel| !lit[*pixel]).collect();
        let only_images = objective.data.others.is_empty() && !model.is_flux;
        let visibilities = match only_images {
            true => None,
            false => Visibilities::new(&device, objective, &pixels, pieces.frames, STEPS)?,
        };
        Ok(Self {
            device,
            pixels,
            learning,
            turning,
            field,
            pieces,
            events,
            makes_residuals: only_images || visibilities.is_some(),
            visibilities,
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
        stretch: &Stretch<'_>,
        from: &Progress<f32>,
    ) -> Result<(Loss, Vec<f32>, [f64; 3]), Error> {
        self.load(stretch, from)?;
        let pending = self.loss(stretch, 0, false)?;
        let mut buffers = vec![&self.pixels.records, &self.learning.gradient];
        buffers.extend(self.visibilities.as_ref().map(Visibilities::losses));
        let read = self.device.read_as(&buffers, bytes::read)?;
        let gradient = read[1][..from.parameters.len()].to_vec();
        let others = read.get(2).map_or(&[][..], Vec::as_slice);
        Ok((pending.ended(&read[0], others), gradient, self.of_axis(stretch.axis)?))
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
    fn load(&mut self, stretch: &Stretch<'_>, from: &Progress<f32>) -> Result<(), GpuError> {
        let Self { device, pixels, visibilities, learning, events, .. } = self;
        let model = &stretch.objective.model;
        // An axis that is learnt changes the weights of nodes; nothing else of them changes.
        if self.loaded_for != Some(stretch.axis) {
            pixels.load(device, nodes(model, !*events))?;
            if let Some(axis) = &pixels.axis {
                axis.load(device, &model.slopes_of_weights(stretch.axis))?;
            }
            self.loaded_for = Some(stretch.axis);
        }
        if let Some(mask) = stretch.occupancy {
            pixels.load_mask(device, mask.cells())?;
        }
        learning.load(device, [&from.parameters, &from.adam.first, &from.adam.second])?;
        device.run(|commands| {
            pixels.forget(commands);
            visibilities.iter().for_each(|visibilities| visibilities.forget(commands));
        })
    }
}

impl StepDevice for GraphicsFit {
    fn name(&self) -> &str {
        self.device.name()
    }

    fn makes_residuals(&self) -> bool {
        self.makes_residuals
    }

    fn most(&self) -> usize {
        // The processor turns the axis.
        if self.pixels.axis.is_some() { 1 } else { STEPS }
    }

    fn take(&mut self, stretch: &Stretch<'_>, from: &Progress<f32>) -> Result<Taken, Error> {
        self.load(stretch, from)?;
        // If a step fails, nobody knows what the device holds.
        self.learning.hold([&[]; 3]);
        let Self { device, pixels, learning, turning, .. } = &*self;
        let mut pending = Vec::with_capacity(stretch.draws.len());
        for (k, rate) in stretch.rates.iter().enumerate() {
            learning.set(device, *rate, from.adam.steps + k as u64 + 1)?;
            turning.as_ref().map_or(Ok(()), |turning| turning.set(device, *rate))?;
            pending.push(self.loss(stretch, k, true)?);
        }
        let [parameters, first, second] = learning.buffers();
        let mut buffers = vec![parameters, first, second, &pixels.records];
        buffers.extend(self.visibilities.as_ref().map(Visibilities::losses));
        let mut read = device.read_as(&buffers, bytes::read)?;
        let (others, terms) = match read.len() {
            5 => (read.pop().unwrap_or_default(), stretch.objective.data.others.len()),
            _ => (Vec::new(), 0),
        };
        let records = read.pop().unwrap_or_default();
        // Buffers may be longer than what was asked for.
        read.iter_mut().for_each(|numbers| numbers.truncate(from.parameters.len()));
        let [parameters, first, second] = [0, 1, 2].map(|k| core::mem::take(&mut read[k]));
        self.learning.hold([&parameters, &first, &second]);
        let ended = |(k, pending): (usize, Pending)| {
            let others = others.get(k * terms..(k + 1) * terms).unwrap_or_default();
            pending.ended(&records[2 * k..2 * k + 2], others)
        };
        let losses = pending.into_iter().enumerate().map(ended).collect();
        Ok(Taken {
            parameters,
            moments: [first, second],
            losses,
            of_axis: self.of_axis(stretch.axis)?,
        })
    }
}

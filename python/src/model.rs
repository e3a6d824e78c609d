//! The forward model: from emission on nodes, or on voxels, to images, with its adjoint.

use crate::call::detached;
use crate::model_settings::{Refusal, Settings};
use crate::rays::Place;
use crate::refusal::refused;
use kerrlight_geodesic::{Kerr, interrupt};
use kerrlight_render::dynamics::Axis;
use kerrlight_render::polarization::StokesParameter;
use kerrlight_tomo::Error;
use kerrlight_tomo::fit::{Batch, ForwardModel, PolarizedView, Redshift, Sightlines};
use kerrlight_tomo::representation::{
    Activation, Coordinates, Float, Gradient, Grid, GridSettings, Representation, Workspace,
};
use numpy::{Element, IntoPyArray, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use std::convert::Infallible;

/// Nodes on rays, and what each gives to its pixel.
#[pyclass(frozen, module = "kerrlight._core")]
pub struct Model {
    model: ForwardModel<f64>,
    axis: Axis,
    /// Ray k has the nodes `starts[k]..starts[k + 1]`.
    starts: Vec<usize>,
    weight: Vec<f64>,
    position: [Vec<f64>; 3],
    /// Empty without slow light.
    delay: Vec<f64>,
    /// Times of the frames, and when it begins to shine.
    times: Vec<f64>,
    injection: Option<f64>,
    /// Masks of nodes whose matter was outside of the region, frame by frame; empty where none can have been.
    dark: Vec<Vec<bool>>,
    /// Factors of each wanted Stokes parameter at each node; none for intensity alone.
    factors: Vec<Vec<f64>>,
}

impl Model {
    fn build(
        hole: &Kerr,
        place: &kerrlight_geodesic::Observer,
        [alpha, beta]: [&[f64]; 2],
        settings: Settings,
    ) -> Result<Self, Refusal> {
        let stokes = settings.stokes()?;
        let mut lines = Sightlines::trace(hole, place, alpha, beta, &settings.request())?;
        if lines.rays() == 0 {
            let allowed = "above the least radius that the rays reach: no ray meets the region";
            return Err(Error::out_of_range("r_max", settings.region.1, allowed).into());
        }
        // Within the weights, the factor is part of the model and of its adjoint.
        lines.weight.iter_mut().for_each(|weight| *weight *= settings.scale);
        let redshift = settings.redshift_power.map(|power| Redshift { power });
        let axis = Axis::new(settings.axis)?;
        let motion = settings.motion(hole.spin(), axis)?;
        let factors = stokes.map_or(Ok(Vec::new()), |(law, parameters)| {
            let sin_inclination = place.inclination().sin();
            let view =
                PolarizedView { law, axis, sin_inclination, position_angle: 0.0, unit: None };
            let factors = view.factors(&lines, hole, &motion.velocity)?;
            let of = |p: &StokesParameter| factors.iter().map(|stokes| stokes.get(*p)).collect();
            Ok::<_, Error>(parameters.iter().map(of).collect())
        })?;
        let falls = motion.velocity.falling().is_some();
        let mut model = ForwardModel::new(&lines, &motion, hole, redshift)?;
        model.weigh(axis);
        let mut batch = Batch::default();
        // Any frame would do: redshifts are those of the places of nodes, the same in all frames.
        batch.set((0..lines.rays() as u32).map(|ray| (ray, 0)));
        batch.gather_whole(&model, axis);
        let mut model = Model {
            axis,
            dark: Vec::new(),
            starts: batch.starts,
            weight: batch.columns.weight,
            position: lines.position,
            delay: lines.delay,
            times: settings.times,
            injection: settings.injection,
            factors,
            model,
        };
        if falls {
            model.dark = (0..model.times.len()).into_par_iter().map(|k| model.unlit(k)).collect();
        }
        Ok(model)
    }

    /// Nodes of a frame whose matter was outside of the region at the reference time.
    fn unlit(&self, frame: usize) -> Vec<bool> {
        self.carried(frame)[0].iter().map(|x| x.is_nan()).collect()
    }

    fn nodes(&self) -> usize {
        self.weight.len()
    }

    /// The weight of a node in a frame: 0 before the emission begins, and for matter that was outside of the region.
    fn weight(&self, frame: usize, k: usize) -> f64 {
        let emitted = self.times[frame] - self.delay.get(k).copied().unwrap_or(0.0);
        let is_dark = self.injection.is_some_and(|injection| emitted < injection);
        if is_dark || self.dark.get(frame).is_some_and(|dark| dark[k]) {
            0.0
        } else {
            self.weight[k]
        }
    }

    /// Images of a frame, one for each Stokes parameter.
    fn planes(&self) -> usize {
        self.factors.len().max(1)
    }

    /// Pixels of all images of a frame.
    fn pixels(&self) -> usize {
        self.planes() * self.model.pixels()
    }

    /// Returns the light that a node gives to an image per emission.
    fn light(&self, plane: usize, frame: usize, k: usize) -> f64 {
        let weight = self.weight(frame, k);
        self.factors.get(plane).map_or(weight, |factors| weight * factors[k])
    }

    /// The nodes of each ray with its pixel.
    fn rays(&self) -> impl Iterator<Item = (usize, std::ops::Range<usize>)> + '_ {
        let ranges = self.starts.windows(2).map(|ends| ends[0]..ends[1]);
        self.model.pixel().iter().map(|pixel| *pixel as usize).zip(ranges)
    }

    fn image<T: Float>(&self, frame: usize, emission: &[T], images: &mut [T]) {
        for (plane, image) in images.chunks_mut(self.model.pixels()).enumerate() {
            interrupt::check();
            for (pixel, nodes) in self.rays() {
                // Sums are in double precision, whatever the arrays are.
                let light = nodes.map(|k| self.light(plane, frame, k) * emission[k].double());
                image[pixel] = T::of(light.sum());
            }
        }
    }

    fn back<T: Float>(&self, frame: usize, images: &[T], cotangents: &mut [T]) {
        interrupt::check();
        let cotangent =
            |plane: usize, pixel: usize| images[plane * self.model.pixels() + pixel].double();
        for (pixel, nodes) in self.rays() {
            for k in nodes {
                // A node lies on one ray: it is summed over Stokes parameters, not over pixels.
                let part = |plane| self.light(plane, frame, k) * cotangent(plane, pixel);
                cotangents[k] = T::of((0..self.planes()).map(part).sum());
            }
        }
    }

    fn apply<T: Float>(&self, emission: &[T], frames: &[usize]) -> Vec<T> {
        let mut movie = vec![T::zero(); frames.len() * self.pixels()];
        let images = movie.par_chunks_mut(self.pixels()).zip(emission.par_chunks(self.nodes()));
        images.zip(frames).for_each(|((image, field), frame)| self.image(*frame, field, image));
        movie
    }

    fn vjp<T: Float>(&self, movie: &[T], frames: &[usize]) -> Vec<T> {
        let mut cotangents = vec![T::zero(); frames.len() * self.nodes()];
        let images = movie.par_chunks(self.pixels());
        let fields = cotangents.par_chunks_mut(self.nodes()).zip(images).zip(frames);
        fields.for_each(|((field, image), frame)| self.back(*frame, image, field));
        cotangents
    }

    /// Returns the places of the matter of a frame's nodes at the reference time: x, y and z, no numbers outside of
    /// the region.
    fn carried(&self, frame: usize) -> [Vec<f64>; 3] {
        interrupt::check();
        let mut batch = Batch::default();
        batch.set((0..self.model.rays()).map(|ray| (ray as u32, frame as u32)));
        batch.gather_whole(&self.model, self.axis);
        batch.columns.pulled
    }

    /// The same with the places of the nodes themselves where there are no numbers: nothing shines there.
    fn pulled<T: Float>(&self, frame: usize) -> [Vec<T>; 3] {
        let mut columns = self.carried(frame);
        for (column, places) in columns.iter_mut().zip(&self.position) {
            column.iter_mut().zip(places).filter(|(x, _)| x.is_nan()).for_each(|(x, at)| *x = *at);
        }
        columns.map(|column| column.into_iter().map(T::of).collect())
    }

    fn places<T: Float>(&self, frames: &[usize]) -> Vec<T> {
        let mut all = vec![T::zero(); frames.len() * self.nodes() * 3];
        all.par_chunks_mut(self.nodes() * 3).zip(frames).for_each(|(places, frame)| {
            let [x, y, z] = self.pulled::<T>(*frame);
            for (k, place) in places.chunks_exact_mut(3).enumerate() {
                place.copy_from_slice(&[x[k], y[k], z[k]]);
            }
        });
        all
    }

    fn of_voxels<T: Float>(&self, grid: &Grid, volume: &[T], frames: &[usize]) -> Vec<T> {
        let mut movie = vec![T::zero(); frames.len() * self.pixels()];
        let images = movie.par_chunks_mut(self.pixels()).zip(frames);
        images.for_each_init(Workspace::new, |workspace, (image, frame)| {
            let [x, y, z] = self.pulled::<T>(*frame);
            let mut values = vec![T::zero(); self.nodes()];
            grid.eval(volume, Coordinates::xyz(&x, &y, &z), &mut values, workspace);
            self.image(*frame, &values, image);
        });
        movie
    }

    /// Frames one after the other, so that the sum has one order.
    fn to_voxels<T: Float>(&self, grid: &Grid, movie: &[T], frames: &[usize]) -> Vec<T> {
        let count = grid.settings().nodes.iter().product();
        // A linear grid has the same gradient at any volume.
        let (mut sum, volume) = (vec![T::zero(); count], vec![T::zero(); count]);
        let (mut workspace, mut cotangents) = (Workspace::new(), vec![T::zero(); self.nodes()]);
        for (image, frame) in movie.chunks(self.pixels()).zip(frames) {
            let [x, y, z] = self.pulled::<T>(*frame);
            self.back(*frame, image, &mut cotangents);
            let into = Gradient { parameters: &mut sum, coordinates: None };
            let at = Coordinates::xyz(&x, &y, &z);
            grid.vjp(&volume, at, &cotangents, into, &mut workspace);
        }
        sum
    }
}

/// A box of voxels: nodes along x, y and z, and the coordinates of the first and the last of them.
type Voxels = ([usize; 3], [f64; 3], [f64; 3]);

fn grid((nodes, low, high): Voxels) -> PyResult<Grid> {
    let settings = GridSettings { nodes, low, high, activation: Activation::Linear, initial: 0.0 };
    Grid::new(settings).map_err(refused)
}

/// Does work on arrays of either precision.
macro_rules! either {
    ($py:expr, $array:expr, |$slice:ident| $work:expr) => {
        match $array {
            Numbers::Double(array) => {
                let $slice = array.as_slice()?;
                numbers($py, || $work)
            }
            Numbers::Single(array) => {
                let $slice = array.as_slice()?;
                numbers($py, || $work)
            }
        }
    };
}

/// An array of either precision.
#[derive(FromPyObject)]
enum Numbers<'py> {
    Double(PyReadonlyArray1<'py, f64>),
    Single(PyReadonlyArray1<'py, f32>),
}

fn numbers<T: Element + Send>(
    py: Python<'_>,
    work: impl FnOnce() -> Vec<T> + Send,
) -> PyResult<Bound<'_, PyAny>> {
    let done = detached(py, || Ok::<_, Infallible>(work()))?;
    Ok(done.into_pyarray(py).into_any())
}

#[pymethods]
impl Model {
    /// Traces the nodes of a screen's rays.
    #[new]
    fn new(
        py: Python<'_>,
        spin: f64,
        place: Place,
        screen: (PyReadonlyArray1<'_, f64>, PyReadonlyArray1<'_, f64>),
        settings: Settings,
    ) -> PyResult<Self> {
        let (hole, observer) = (Kerr::new(spin).map_err(refused)?, place.observer()?);
        let screen = [screen.0.as_slice()?, screen.1.as_slice()?];
        detached(py, || Self::build(&hole, &observer, screen, settings))
    }

    /// Pixels of an image, nodes of a frame, and frames.
    fn sizes(&self) -> (usize, usize, usize) {
        (self.model.pixels(), self.nodes(), self.model.frames())
    }

    /// Returns the factor of each wanted Stokes parameter at each node, one after the other.
    fn factors<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        self.factors.concat().into_pyarray(py).into_any()
    }

    /// Returns the nodes' places, weights, pixels and delays.
    fn columns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        let place = |k: usize| [0, 1, 2].map(|c| self.position[c][k]);
        let places: Vec<f64> = (0..self.nodes()).flat_map(place).collect();
        dict.set_item("position", places.into_pyarray(py))?;
        dict.set_item("weight", self.weight.clone().into_pyarray(py))?;
        let pixels = self.rays().flat_map(|(pixel, nodes)| nodes.map(move |_| pixel as u32));
        dict.set_item("pixel", pixels.collect::<Vec<u32>>().into_pyarray(py))?;
        dict.set_item("delay", self.delay.clone().into_pyarray(py))?;
        Ok(dict)
    }

    /// x, y and z of every node of these frames at the reference time.
    fn coordinates<'py>(
        &self,
        py: Python<'py>,
        frames: Vec<usize>,
        single: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        if single {
            return numbers(py, || self.places::<f32>(&frames));
        }
        numbers(py, || self.places::<f64>(&frames))
    }

    /// Images of emission on the nodes of these frames.
    #[pyo3(name = "apply")]
    fn apply_py<'py>(
        &self,
        py: Python<'py>,
        emission: Numbers<'py>,
        frames: Vec<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        either!(py, emission, |slice| self.apply(slice, &frames))
    }

    /// The adjoint of `apply`.
    #[pyo3(name = "vjp")]
    fn vjp_py<'py>(
        &self,
        py: Python<'py>,
        movie: Numbers<'py>,
        frames: Vec<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        either!(py, movie, |slice| self.vjp(slice, &frames))
    }

    /// Images of emission on voxels, linear in between.
    fn apply_voxels<'py>(
        &self,
        py: Python<'py>,
        voxels: Voxels,
        volume: Numbers<'py>,
        frames: Vec<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let grid = grid(voxels)?;
        either!(py, volume, |slice| self.of_voxels(&grid, slice, &frames))
    }

    /// The adjoint of `apply_voxels`.
    fn vjp_voxels<'py>(
        &self,
        py: Python<'py>,
        voxels: Voxels,
        movie: Numbers<'py>,
        frames: Vec<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let grid = grid(voxels)?;
        either!(py, movie, |slice| self.to_voxels(&grid, slice, &frames))
    }
}

/// Refuses boxes of voxels that make no grid.
#[pyfunction]
pub fn check_voxels(voxels: Voxels) -> PyResult<()> {
    grid(voxels).map(|_| ())
}

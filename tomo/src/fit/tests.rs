//! The forward model from parameters and axis to the loss, in double precision.

use super::*;

mod blobs;
mod falling_volume;
mod leakage;
mod orbital;
mod penalised;
mod quiescent;
mod stokes;
mod training;
mod transport;

pub(super) use crate::optimise::dot;
use crate::representation::{
    Activation, Coordinates, Gradient, Grid, GridSettings, Representation, Workspace,
};
pub(super) use blobs::Blobs;
use kerrlight_common::simd::Float;
use kerrlight_geodesic::vector::{distance, norm};
use kerrlight_geodesic::{Inclination, Kerr, Observer};
use kerrlight_render::dynamics::{AngularVelocity, Axis, Injection, Velocity};
use kerrlight_render::scene::apply_override;
use kerrlight_vlbi::array::built_in;
use kerrlight_vlbi::data_terms::{DataTerm, Residual};
use kerrlight_vlbi::operator::{Dtft, ImageGrid, Pulse, Transform};
use num_complex::Complex;

const SIDE: usize = 9;

/// x + h d.
pub(super) fn moved(x: &[f64], along: &[f64], h: f64) -> Vec<f64> {
    x.iter().zip(along).map(|(x, d)| x + h * d).collect()
}

/// The same along a single one of the numbers.
pub(super) fn beside(x: &[f64], k: usize, h: f64) -> Vec<f64> {
    x.iter().enumerate().map(|(j, x)| if j == k { x + h } else { *x }).collect()
}

/// A central difference.
pub(super) fn slope(h: f64, mut at: impl FnMut(f64) -> f64) -> f64 {
    (at(h) - at(-h)) / (2.0 * h)
}

/// All images of a field.
pub(super) fn images(model: &ForwardModel<f64>, field: Field<'_, f64>) -> Vec<f64> {
    let frames: Vec<usize> = (0..model.frames()).collect();
    model.images(field, &frames)
}

/// Settings with changes.
fn changed(text: &str, changes: &[&str]) -> String {
    let change = |text: String, change: &&str| apply_override(&text, change).unwrap();
    changes.iter().fold(text.to_owned(), change)
}

/// The instrument of settings, and what they simulate.
fn simulated(file: &settings::FitFile) -> (setup::Instrument, setup::FitData) {
    let instrument = setup::Instrument::new(file).unwrap();
    let array = file.observation().map(|seen| built_in(&seen.array).unwrap());
    let measured = setup::FitData::simulated(file, &instrument, array.as_ref()).unwrap();
    (instrument, measured)
}

fn lines(delay: bool, momentum: bool) -> (Kerr, Sightlines) {
    let hole = Kerr::new(0.6).unwrap();
    let observer = Observer::at_infinity(Inclination::from_degrees(55.0).unwrap());
    let at = |k: usize| -6.0 + 12.0 * k as f64 / (SIDE - 1) as f64;
    let (alpha, beta): (Vec<f64>, Vec<f64>) =
        (0..SIDE * SIDE).map(|k| (at(k % SIDE), -at(k / SIDE))).unzip();
    let region = Region { r_min: 3.0, r_max: 6.0, z_width: 4.0 };
    let sampling = Sampling::Gauss { order: 4, split: 1 };
    let request = SightlineRequest { region, sampling, delay, momentum };
    (hole, Sightlines::trace(&hole, &observer, &alpha, &beta, &request).unwrap())
}

fn forward_model<T: Float>(delay: bool, momentum: bool) -> ForwardModel<T> {
    forward_model_of(AngularVelocity::Keplerian { drag: 0.6 }, delay, momentum)
}

fn falling() -> AngularVelocity {
    let law = Velocity::Infall { xi: 0.7, beta_r: 0.97, beta_phi: 0.9, drag: None };
    law.angular(0, 0.6).unwrap()
}

fn forward_model_of<T: Float>(
    velocity: AngularVelocity,
    delay: bool,
    momentum: bool,
) -> ForwardModel<T> {
    let (hole, lines) = lines(delay, momentum);
    let motion = Motion {
        velocity,
        reference: 3.0,
        injection: Some(Injection { time: 1.0 }),
        times: vec![0.0, 9.0, 17.0, 40.0],
    };
    ForwardModel::new(&lines, &motion, &hole, momentum.then_some(Redshift { power: 2.5 })).unwrap()
}

/// Visibilities against fixed ones, all errors 1 Jy: `Observation`s need a schedule.
struct Plain(Vec<Complex<f64>>);

impl DataTerm<f64> for Plain {
    fn visibilities(&self) -> usize {
        self.0.len()
    }
    fn degrees_of_freedom(&self) -> usize {
        2 * self.0.len()
    }
    fn value_and_gradient(
        &self,
        model: &[Complex<f64>],
        weight: f64,
        gradient: &mut [Complex<f64>],
    ) -> f64 {
        let pairs = model.iter().zip(&self.0).zip(gradient);
        pairs
            .map(|((model, datum), gradient)| {
                *gradient += (model - datum).scale(2.0 * weight);
                (model - datum).norm_sqr()
            })
            .sum()
    }
    fn residuals(&self, model: &[Complex<f64>]) -> Vec<Residual> {
        let pairs = model.iter().zip(&self.0).map(|(model, datum)| (model - datum, datum));
        let parts = pairs.flat_map(|(left, datum)| [(left.re, datum.re), (left.im, datum.im)]);
        parts
            .map(|(value, datum)| Residual { value, datum, freedom: 1.0, stations: vec![0, 1] })
            .collect()
    }
}

fn scans() -> ScanTerm<f64> {
    let grid = ImageGrid::new(SIDE, SIDE, 4e-10).unwrap();
    let scan = |frame: usize| {
        let uv = |k: usize| [(k * 7 + frame) as f64 * 1e8, (k * k) as f64 * -2e8];
        let uv: Vec<[f64; 2]> = (0..5).map(uv).collect();
        let data = (0..5).map(|k| Complex::new(0.3 * k as f64, 0.1 * frame as f64)).collect();
        let transform = Transform::Direct(Dtft::new(grid, Pulse::Triangle, &[uv], usize::MAX));
        (frame != 2).then(|| Scan { transform, term: Box::new(Plain(data)) })
    };
    ScanTerm::new("visibilities", SIDE * SIDE, true, (0..4).map(scan).collect())
}

fn movie() -> Vec<f64> {
    (0..4 * SIDE * SIDE).map(|k| (k as f64 * 0.37).sin().abs()).collect()
}

fn objective(delay: bool, momentum: bool, others: bool) -> Objective<f64> {
    let term = Box::new(ImageTerm::new(movie(), SIDE * SIDE, 0.5).unwrap());
    let mut data = Data { image: Some(Weighted { weight: 0.7, term }), others: Vec::new() };
    if others {
        data.others.push(Weighted { weight: 1.3, term: Box::new(scans()) });
        let (flux, sigma) = (vec![1.0, 3.0, 2.0, 5.0], [0.5, 1.0, 2.0, 0.7]);
        let term = LightCurveTerm::new(flux, &sigma, SIDE * SIDE).unwrap();
        data.others.push(Weighted { weight: 0.4, term: Box::new(term) });
    }
    Objective { model: forward_model(delay, momentum), data }
}

fn grid() -> Grid {
    let (low, high) = ([-6.0; 3], [6.0; 3]);
    let activation = Activation::Softplus;
    Grid::new(GridSettings { nodes: [7; 3], low, high, activation, initial: 0.0 }).unwrap()
}

fn start(representation: &dyn Representation<f64>) -> Vec<f64> {
    let mut parameters = vec![0.0; representation.parameters()];
    representation.initialise(5, &mut parameters);
    for (k, x) in parameters.iter_mut().enumerate() {
        *x += 0.1 * (k as f64 * 1.7).sin();
    }
    parameters
}

fn pairs(model: &ForwardModel<f64>) -> Vec<(u32, u32)> {
    let rays = model.rays() as u32;
    (0..4).flat_map(|frame| (0..rays).map(move |ray| (ray, frame))).collect()
}

struct Case<'a> {
    objective: Objective<f64>,
    representation: &'a dyn Representation<f64>,
    pixels: bool,
}

impl Case<'_> {
    fn loss(&mut self, parameters: &[f64], axis: Axis, gradients: Gradients<'_, f64>) -> f64 {
        self.objective.model.weigh(axis);
        let representation = self.representation;
        let field = Field { representation, parameters, axis, occupancy: None };
        let drawn = match self.pixels {
            true => Drawn::Pixels(pairs(&self.objective.model)),
            false => Drawn::Frames(vec![0, 1, 3, 2]),
        };
        self.objective.value_and_gradient(field, &drawn, gradients, &mut Buffers::default()).total
    }

    fn value(&mut self, parameters: &[f64], axis: Axis) -> f64 {
        let mut unused = vec![0.0; parameters.len()];
        self.loss(parameters, axis, Gradients { parameters: &mut unused, axis: None })
    }

    /// Central differences along a few directions of the parameters, and along the sphere.
    fn check(&mut self) {
        let (axis, parameters) = (Axis::new([0.3, -0.5, 0.8]).unwrap(), start(self.representation));
        let (mut slopes, mut of_axis) = (vec![0.0; parameters.len()], [0.0; 3]);
        let gradients = Gradients { parameters: &mut slopes, axis: Some(&mut of_axis) };
        let value = self.loss(&parameters, axis, gradients);
        assert!((value - self.value(&parameters, axis)).abs() < 1e-13 * value);
        let compare = |difference: f64, slopes: &[f64], way: &[f64]| {
            let (product, size) = (dot(slopes, way), dot(slopes, slopes).sqrt());
            assert!((difference - product).abs() < 1e-7 * size.max(1.0), "{difference} {product}");
        };
        for seed in 1..4 {
            let way: Vec<f64> =
                (0..slopes.len()).map(|k| (k as f64 * 0.7 * f64::from(seed)).cos()).collect();
            let difference = slope(1e-5, |h| self.value(&moved(&parameters, &way, h), axis));
            compare(difference, &slopes, &way);
        }
        for way in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.3]].map(|way| axis.tangent(way)) {
            let turned = |h: f64| axis.moved(way.map(|x| h * x));
            compare(slope(1e-5, |h| self.value(&parameters, turned(h))), &of_axis, &way);
        }
    }
}

#[test]
fn exact_gradients_of_parameters_and_axis_by_differences() {
    for (delay, momentum) in [(false, false), (true, true)] {
        let kinds = [Blobs::STEADY, Blobs::CHANGING, Blobs::EVENTS];
        let data = [(true, false), (false, true)];
        for (representation, (pixels, others)) in
            kinds.iter().flat_map(|kind| data.map(|data| (kind, data)))
        {
            let mut objective = objective(delay, momentum, others);
            Case { objective, representation, pixels }.check();
            objective = self::objective(delay, momentum, others);
            objective.model = forward_model_of(falling(), delay, momentum);
            Case { objective, representation, pixels }.check();
        }
    }
}

/// Nodes of falling matter are where the equations of motion have them come from, and dark if that is outside of the
/// region. Events do not move.
#[test]
fn exact_falling_matter_is_pulled_back_to_where_it_was() {
    let (model, axis) =
        (forward_model_of::<f64>(falling(), true, false), Axis::new([0.3, -0.5, 0.8]).unwrap());
    let (_, lines) = lines(true, false);
    let (mut batch, mut lit) = (Batch::default(), 0);
    for frame in [1, 2, 3] {
        batch.set((0..model.rays()).map(|ray| (ray as u32, frame)));
        batch.gather(&model, axis, None);
        let seen = lines
            .delay
            .iter()
            .enumerate()
            .filter(|(_, delay)| model.times[frame as usize] - **delay >= -2.0);
        let came = seen.filter_map(|(k, delay)| {
            let point = [0, 1, 2].map(|c| lines.position[c][k]);
            let from = falling().before(axis, point, model.times[frame as usize] - delay);
            (3.0..=6.0).contains(&norm(from)).then_some((k, from))
        });
        let came: Vec<_> = came.collect();
        assert!(
            came.len() == batch.points() && came.len() > 50,
            "{} {}",
            came.len(),
            batch.points()
        );
        lit += came.len();
        for (place, (k, from)) in came.into_iter().enumerate() {
            assert_eq!(batch.columns.node[place] as usize, k);
            let pulled = batch.columns.pulled.each_ref().map(|column| column[place]);
            assert!(distance(pulled, from) < 1e-11, "{pulled:?} {from:?}");
        }
    }
    assert!(lit < 3 * lines.points());
    let field = Blobs::EVENTS;
    let field = Field { representation: &field, parameters: &[], axis, occupancy: None };
    batch.gather_field(&model, field);
    let first = batch.columns.node[0] as usize;
    assert_eq!(batch.columns.position[0][0], lines.position[0][first]);
}

/// All pixels one by one are all frames as a whole, gradients included.
#[test]
fn exact_pixels_and_frames_agree() {
    let net = Blobs::STEADY;
    let axis = Axis::new([-0.2, 0.4, -0.8]).unwrap();
    let run = |pixels: bool| {
        let objective = objective(true, true, false);
        let mut case = Case { objective, representation: &net, pixels };
        let parameters = start(&net);
        let (mut slopes, mut of_axis) = (vec![0.0; parameters.len()], [0.0; 3]);
        let gradients = Gradients { parameters: &mut slopes, axis: Some(&mut of_axis) };
        (case.loss(&parameters, axis, gradients), slopes, of_axis)
    };
    let (one, whole) = (run(true), run(false));
    // Pixels without a ray have the same loss for ever: only whole frames count it.
    let dark = {
        let model = forward_model::<f64>(true, true);
        let mut seen = [false; SIDE * SIDE];
        model.pixel().iter().for_each(|pixel| seen[*pixel as usize] = true);
        let dark = |(k, x): (usize, &f64)| if seen[k % (SIDE * SIDE)] { 0.0 } else { x * x };
        0.7 * 4.0 * movie().iter().enumerate().map(dark).sum::<f64>() / (4 * SIDE * SIDE) as f64
    };
    assert!((one.0 + dark - whole.0).abs() < 1e-12 * whole.0, "{} {dark} {}", one.0, whole.0);
    for (a, b) in one.1.iter().zip(&whole.1).chain(one.2.iter().zip(&whole.2)) {
        assert!((a - b).abs() < 1e-11, "{a} {b}");
    }
}

#[test]
fn sightlines_lie_in_their_region_and_errors_are_named() {
    let (hole, lines) = lines(true, true);
    for k in 0..lines.points() {
        let [x, y, z] = [0, 1, 2].map(|c| lines.position[c][k]);
        let r = (x * x + y * y + z * z).sqrt();
        assert!((3.0..6.0).contains(&r) && z.abs() <= 4.0);
    }
    assert!(lines.rays() > 20 && lines.rays() < SIDE * SIDE);
    let observer = Observer::at_infinity(Inclination::from_degrees(30.0).unwrap());
    let region = Region { r_min: 3.0, r_max: 2.0, z_width: 1.0 };
    let mut request = SightlineRequest {
        region,
        sampling: Sampling::EqualMinoTime { per_ray: 10 },
        delay: false,
        momentum: false,
    };
    let mut say = |change: &dyn Fn(&mut SightlineRequest)| {
        change(&mut request);
        Sightlines::trace(&hole, &observer, &[1.0], &[1.0], &request).unwrap_err().to_string()
    };
    assert_eq!(say(&|_| ()), "r_max = 2 is not allowed: above r_min");
    let text = say(&|request| request.region.r_max = 5.0);
    assert!(text.starts_with("observer radius = inf is not allowed"), "{text}");
}

/// A uniform medium leaves (1 − e^{−κL})/κ of a path L, and nodes come from the observer on: the further, the later.
#[test]
fn exact_a_uniform_medium_dims_what_is_behind_it() {
    let (_, plain) = lines(true, false);
    let (mut dimmed, kappa) = (plain.clone(), 0.02);
    dimmed.absorb(|_| kappa);
    for ends in plain.starts.windows(2) {
        let length: f64 = plain.weight[ends[0]..ends[1]].iter().sum();
        let left: f64 = dimmed.weight[ends[0]..ends[1]].iter().sum();
        let exact = (1.0 - (-kappa * length).exp()) / kappa;
        assert!((left - exact).abs() < 1e-3 * exact, "{left} {exact}");
        assert!(plain.delay[ends[0]..ends[1]].is_sorted());
    }
}

/// The critical curve of a hole without spin is the circle √27. A ray 1e-11 inside it is traced step by step, one 1e-7
/// inside it in closed form; outside 3.5 M both have the same length. Rays come in the order of pixels.
#[test]
fn exact_rays_beside_the_critical_curve_have_nodes_in_their_place() {
    let hole = Kerr::new(0.0).unwrap();
    let inclination = Inclination::from_degrees(60.0).unwrap();
    let region = Region { r_min: 3.5, r_max: 20.0, z_width: 20.0 };
    let critical = 27f64.sqrt();
    let alpha = [-4.0, critical * (1.0 - 1e-7), 0.0, critical * (1.0 - 1e-11), 2.0];
    let gauss = Sampling::Gauss { order: 12, split: 4 };
    let equal = Sampling::EqualMinoTime { per_ray: 40_000 };
    let far = Observer::at_radius(inclination, 4000.0).unwrap();
    for (observer, sampling) in
        [(Observer::at_infinity(inclination), gauss), (far, gauss), (far, equal)]
    {
        let request = SightlineRequest { region, sampling, delay: true, momentum: false };
        let lines = Sightlines::trace(&hole, &observer, &alpha, &[0.0; 5], &request).unwrap();
        assert_eq!(lines.pixel, [0, 1, 2, 3, 4]);
        let length = |ray: usize| -> f64 {
            lines.weight[lines.starts[ray]..lines.starts[ray + 1]].iter().sum()
        };
        assert!((length(3) / length(1) - 1.0).abs() < 1e-3);
    }
}

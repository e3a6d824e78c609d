//! Representation and its training, from settings.

use super::change::{self, change};
use super::quiescent::{self, quiescent};
use super::{Result, axis, linear, motion, polarized};
use crate::fit::linear::{Change, Voxels};
use crate::fit::settings;
use crate::fit::settings::{
    AxisSearch, FieldKind, FitError, FitFile, Kind, LossKind, Optimiser, Start, Within,
    check_losses, refuse,
};
use crate::fit::{BatchSize, ChangePrice, OccupancySettings, Region, Training, WithStaticImage};
use crate::optimise::{LinearDecay, Muon};
use crate::representation::{
    Activation, Carrier, Changing, Degree, FeatureGrid, FeatureGridSettings, Grid, GridSettings,
    Network, NetworkSettings, OwnSettings, Registry, Representation,
};
use kerrlight_common::memory;

/// Returns the representation, with the parameters of emission that does not move behind its own; `registry` has what the
/// program adds to kerrlight's own representations. Where emission may change, `times` are those of the first and the last
/// emission, M since the reference time ([`emission_times`](super::emission_times)).
///
/// # Errors
/// If there is none of this kind, or a number is out of range.
pub fn representation(
    file: &FitFile,
    registry: &Registry,
    times: [f64; 2],
) -> Result<Box<dyn Representation<f32>>> {
    let inner = over_time(file, registry, times)?;
    Ok(match quiescent(file, file.screen.pixels * file.screen.pixels)? {
        Some(image) => Box::new(WithStaticImage::new(inner, &image)),
        None => inner,
    })
}

/// The emission, which may change.
fn over_time(
    file: &FitFile,
    registry: &Registry,
    times: [f64; 2],
) -> Result<Box<dyn Representation<f32>>> {
    let inner = of_matter(file, registry)?;
    let Change { knots, .. } = change(file, times)?;
    if knots.count == 1 {
        return Ok(inner);
    }
    if file.representation.kind == Kind::Bhnerf {
        let paper = NetworkSettings::changing([knots.spacing, knots.last() - knots.first]);
        // Whatever `representation.network.time_scale` is.
        let time_scale = paper.time_scale;
        let chosen = chosen_network(&file.representation, paper);
        let network = Network::new(NetworkSettings { time_scale, ..chosen });
        return Ok(Box::new(network.within("representation")?));
    }
    let (count, each) = (knots.count, inner.parameters());
    let what = || format!("change.spacing: {count} times of {each} parameters");
    memory::afford(what, memory::parameters(each as f64 * count as f64))?;
    let carrier = match file.representation.kind {
        Kind::LinearGrid => Some(carrier(file)?),
        _ => None,
    };
    Ok(Box::new(Changing::new(inner, knots, carrier)?))
}

/// The motion that carries voxels, whose births are given at places of several times.
fn carrier(file: &FitFile) -> Result<Carrier> {
    let Region { r_min, r_max, .. } = file.region.limits();
    let (axis, velocity) = (axis(file)?.0, motion(file, Vec::new())?.velocity);
    Ok(Carrier { axis, velocity, limits: [r_min, r_max] })
}

/// Returns the representation where matter carries emission unchanged.
pub(super) fn of_matter(
    file: &FitFile,
    registry: &Registry,
) -> Result<Box<dyn Representation<f32>>> {
    let chosen = &file.representation;
    let network = |settings: NetworkSettings| {
        Network::new(chosen_network(chosen, settings)).within("representation")
    };
    let r = file.region.r_max;
    Ok(match &chosen.kind {
        Kind::Own(name) => own(name, file, registry)?,
        Kind::FeatureGrid | Kind::Bhnerf | Kind::Mlp4d
            if chosen.activation == Activation::Linear =>
        {
            refuse!(
                "representation.activation = linear is not allowed: sigmoid or softplus with {}, whose network's output has any sign",
                chosen.kind.name()
            )
        }
        Kind::Bhnerf => Box::new(network(NetworkSettings::bhnerf())?),
        Kind::Mlp4d => Box::new(network(NetworkSettings::mlp4d())?),
        Kind::FeatureGrid => {
            let settings = FeatureGridSettings {
                coarsest: chosen.feature_grid.coarsest,
                levels: chosen.feature_grid.levels,
                low: [-r; 3],
                high: [r; 3],
                activation: chosen.activation,
                initial: FAINT,
            };
            Box::new(FeatureGrid::new(settings).within("representation")?)
        }
        Kind::LinearGrid if degree(file) != Degree::Linear => {
            let nodes = chosen.linear_grid.nodes;
            Box::new(Voxels::cube(nodes, r, degree(file)).field().within("representation")?)
        }
        Kind::Grid | Kind::LinearGrid => {
            Box::new(Grid::new(chosen_grid(chosen, r)).within("representation")?)
        }
    })
}

/// The paper's network with what the file says of it.
fn chosen_network(chosen: &settings::Representation, paper: NetworkSettings) -> NetworkSettings {
    let settings::Network { degree, width, hidden_layers, length_scale, time_scale, .. } =
        chosen.network;
    NetworkSettings {
        degree,
        width,
        hidden_layers,
        // Fewer layers have no place for the paper's skip.
        skip_after: paper.skip_after.filter(|layer| *layer <= hidden_layers),
        length_scale,
        time_scale,
        activation: chosen.activation,
        ..paper
    }
}

/// Trilinear voxels of the cube |x| ≤ `r`, as dark as a network starts: sigmoid(−10).
fn chosen_grid(chosen: &settings::Representation, r: f64) -> GridSettings {
    let (nodes, activation) = match chosen.kind {
        Kind::LinearGrid => (chosen.linear_grid.nodes, Activation::Linear),
        _ => (chosen.grid.nodes, chosen.activation),
    };
    let initial = if activation == Activation::Linear { 0.0 } else { -10.0 };
    GridSettings { nodes: [nodes; 3], low: [-r; 3], high: [r; 3], activation, initial }
}

/// Returns the degree of the interpolation of a linear grid.
fn degree(file: &FitFile) -> Degree {
    file.linear.as_ref().map_or(Degree::Cubic, |linear| linear.degree)
}

/// A feature grid starts with a faint glow, 1/55: darker ones start late.
const FAINT: f64 = -4.0;

/// A representation that the program adds.
fn own(name: &str, file: &FitFile, registry: &Registry) -> Result<Box<dyn Representation<f32>>> {
    let Region { r_min, r_max, z_width } = file.region.limits();
    let table = file.representation.own.settings.clone();
    if let Some(built) = registry.build(name, &OwnSettings { r_min, r_max, z_width, table }) {
        return Ok(built.map_err(FitError::from)?);
    }
    let known: Vec<&str> = Kind::BUILT_IN.iter().map(Kind::name).chain(registry.names()).collect();
    Err(FitError::range("representation.kind", format!("{name:?}"), &known.join(", ")).into())
}

/// Returns the training; where emission may change, `times` are those of the first and the last emission, M since the
/// reference time ([`emission_times`](super::emission_times)).
///
/// # Errors
/// If a number is out of range, or settings contradict each other.
pub fn training(
    file: &FitFile,
    axis_rate: Option<LinearDecay>,
    times: [f64; 2],
) -> Result<Training> {
    let chosen = &file.training;
    if matches!(chosen.batch, BatchSize::Pixels(0) | BatchSize::Frames(0)) {
        refuse!("training.batch of 0 is not allowed: 1 or more");
    }
    let muon = (chosen.optimiser == Optimiser::Muon).then(Muon::default);
    let occupancy = chosen.occupancy.map(occupancy).transpose()?;
    if occupancy.is_some() && file.representation.kind == Kind::Mlp4d {
        refuse!(
            "training.occupancy does not work with mlp4d, which has no co-rotating coordinates"
        );
    }
    Ok(Training {
        seed: file.seed,
        muon,
        rate: rate(file)?,
        axis_rate,
        ramp: chosen.ramp,
        batch: chosen.batch,
        occupancy,
        change: price(file, times)?,
        region: file.region.limits(),
        keep_every: 50,
    })
}

/// Returns the price of change in steps; the linear problem has its own price.
fn price(file: &FitFile, times: [f64; 2]) -> Result<Option<ChangePrice>> {
    let kind = &file.representation.kind;
    if file.change.is_none() || *kind == Kind::LinearGrid {
        return Ok(None);
    }
    let Change { knots, weight, .. } = change(file, times)?;
    // The network takes the time as a coordinate; all others are linear between the knots.
    let linear = *kind != Kind::Bhnerf;
    Ok(Some(ChangePrice { weight, knots, linear, region: file.region.limits() }))
}

/// Names a setting that is allowed and most probably not meant.
pub fn caution(file: &FitFile) -> Option<&'static str> {
    let training = &file.training;
    let is_dark = file.representation.kind == Kind::Grid && training.start == Start::Drawn;
    (is_dark && training.occupancy.is_some()).then_some(
        "a grid that starts in the dark is lit node by node: the mask of training.occupancy takes what is still dark for \
         empty, and holds it back; leave the mask out, or take a linear start",
    )
}

/// Learning rate over the steps; those of voxels that are solved for have no rate.
fn rate(file: &FitFile) -> Result<LinearDecay> {
    let [from, to] = file.representation.rates().map_or([1.0, 1.0], |(_, rates)| rates);
    let rate = LinearDecay { from, to, steps: file.training.steps };
    rate.checked().within("training")
}

fn occupancy(chosen: OccupancySettings) -> Result<OccupancySettings> {
    for (name, value) in [("threshold", chosen.threshold), ("memory", chosen.memory)] {
        if !(0.0..1.0).contains(&value) {
            let key = format!("training.occupancy.{name}");
            return Err(FitError::range(key, value, "0 to 1, 1 excluded").into());
        }
    }
    Ok(chosen)
}

/// Refuses what can be told of settings without tracing rays.
///
/// # Errors
/// Names the first setting that is out of range, missing, or in contradiction to another.
pub fn check(file: &FitFile, registry: &Registry) -> Result<()> {
    let (_, axis_rate) = axis(file)?;
    afford(file, registry)?;
    file.check_unknowns()?;
    // Of any length: those of the data are known once rays are traced.
    let training = training(file, axis_rate, [0.0, 0.0])?;
    change::check(file)?;
    polarized::check(file)?;
    quiescent::check(file)?;
    if let Some(held_out) = &file.held_out {
        held_out.check(file)?;
    }
    if file.band.is_some() && file.unknown_geometry()?.is_some() {
        refuse!("band and numbers with a prior exclude each other");
    }
    let images_only = file.loss.iter().all(|loss| loss.data == LossKind::Image);
    if matches!(training.batch, BatchSize::Pixels(_)) && !images_only {
        refuse!("training.batch: pixels work with images only; use frames = N");
    }
    check_losses(&file.loss)?;
    if file.representation.kind == Kind::LinearGrid || file.training.start != Start::Drawn {
        linear(file)?;
    }
    if file.representation.kind == Kind::Mlp4d && file.training.start != Start::Drawn {
        refuse!(
            "training.start needs to be \"drawn\" with mlp4d: a linear start is a field that matter carries, which this network does not know"
        );
    }
    if file.unknown_geometry()?.is_some() {
        linear(file).within("search")?;
        unweighted(
            file,
            "1 with a number that has a prior, whose errors follow from those of the data",
        )?;
    }
    check_prior(file)?;
    check_axis(file, registry)?;
    enough_nodes_and_iterations(file)?;
    check_reference(file)
}

/// Refuses an axis that nothing learns, and flows that would have to turn with it.
fn check_axis(file: &FitFile, registry: &Registry) -> Result<()> {
    if file.axis == (AxisSearch::Known {}) {
        return Ok(());
    }
    let is_solved = file.representation.kind == Kind::LinearGrid;
    if axis(file)?.1.is_some() && (is_solved || !of_matter(file, registry)?.is_carried()) {
        refuse!(
            "representation.kind = \"{}\" learns no axis: use another one, [axis.known], or [axis.scan] with rate = 0",
            file.representation.kind.name()
        );
    }
    let motion = &file.motion;
    if motion.axis.is_none() && file.hole.spin.value() != 0.0 && motion.follows_spin() {
        refuse!(
            "motion.velocity needs a drag where the axis is not known: flows about different axes are compared, and a ξ_z is another one for each"
        );
    }
    Ok(())
}

/// Refuses a truth that is compared with the fit at another time.
fn check_reference(file: &FitFile) -> Result<()> {
    let (own, of_truth) = (file.motion.reference_time, file.simulated()?.motion.reference_time);
    if own == of_truth {
        return Ok(());
    }
    let allowed = format!("{own}, that of the fit: truth and fit are compared there");
    Err(FitError::range("simulation.motion.reference_time", of_truth, &allowed).into())
}

/// Refuses a prior of voxels where it would have no part, or where data do not count as their errors say.
fn check_prior(file: &FitFile) -> Result<()> {
    let Some((linear, prior)) = file.linear.as_ref().and_then(|l| Some((l, l.prior?))) else {
        return Ok(());
    };
    prior.check()?;
    let is_linear = file.representation.kind == Kind::LinearGrid;
    if !is_linear && !matches!(file.training.start, Start::Linear { .. }) {
        refuse!("linear.prior needs representation.kind = \"linear-grid\" or a linear start");
    }
    if file.change.is_some() {
        refuse!(
            "linear.prior does not work together with [change]: it knows no covariance in time"
        );
    }
    if file.quiescent.is_some() {
        refuse!("linear.prior does not work together with [quiescent]: leave one of them out");
    }
    if let Some(flux) = linear.flux_jy.filter(|_| prior.kind == FieldKind::LogNormal) {
        refuse!(
            "linear.flux_jy = {flux} and linear.prior.kind = \"log-normal\" exclude each other: such a prior says how \
             bright the emission is"
        );
    }
    unweighted(file, "1 with [linear.prior], beside which data count as their errors say")
}

/// Refuses losses that count more or less than the errors of their data say.
fn unweighted(file: &FitFile, allowed: &str) -> Result<()> {
    match file.loss.iter().position(|loss| loss.weight != 1.0) {
        Some(k) => {
            Err(FitError::range(format!("loss.{k}.weight"), file.loss[k].weight, allowed).into())
        }
        None => Ok(()),
    }
}

/// Refuses grids with fewer nodes than a B-spline of the linear problem reaches over, and a start that takes no iteration.
fn enough_nodes_and_iterations(file: &FitFile) -> Result<()> {
    let least = degree(file).taps();
    let mut grids = Vec::new();
    if let Start::Linear { nodes, iterations, .. } = file.training.start {
        if iterations == Some(0) {
            return Err(FitError::range("training.start.linear.iterations", 0, "1 or more").into());
        }
        grids.push(("training.start.linear.nodes", nodes));
    }
    if let Some(unknown) = file.unknown_geometry()? {
        grids.push(("search.coarse.nodes", unknown.search.coarse.nodes));
        grids.push(("search.fine.nodes", unknown.search.fine.nodes));
    }
    match grids.into_iter().find(|(_, nodes)| *nodes < least) {
        Some((key, nodes)) => {
            let allowed = format!("{least} or more with this linear.degree");
            Err(FitError::range(key, nodes, &allowed).into())
        }
        None => Ok(()),
    }
}

/// Refuses representations, grids and volumes that there is no memory for.
fn afford(file: &FitFile, registry: &Registry) -> Result<()> {
    let parameters = of_matter(file, registry)?.parameters();
    let what = || format!("{parameters} parameters of the representation");
    memory::afford(what, memory::parameters(parameters as f64))?;
    if let Start::Linear { nodes, .. } = file.training.start {
        let what = || format!("training.start.linear.nodes = {nodes}: a grid");
        memory::afford(what, memory::parameters((nodes as f64).powi(3)))?;
    }
    let nodes = file.output.nodes;
    memory::afford(|| format!("output.nodes = {nodes}: volumes"), memory::volume(nodes as f64))?;
    Ok(())
}

//! From settings to a world that is not known: its model, its parameters, the search for them and how sure they are.

mod posterior;
mod search;
mod seen;

pub use posterior::WorldPosterior;
pub use search::{FoundWorld, SearchWatch, Trial, find_world};

use super::instrument::ring;
use super::{Instrument, Measured, Result, axis, drag, motion};
use crate::dynamics::Velocity;
use crate::fit::settings::{AxisSearch, FitError, FitFile, UnknownWorld};
use crate::fit::world::{Law, Parameter, World, WorldModel};
use crate::fit::{Motion, Redshift, Sampling};
use kerrlight_geodesic::Kerr;

/// The world that the settings say, for parameters that are known, and for data that are simulated.
pub fn known_world(file: &FitFile) -> World {
    let inclination = file.observer.inclination_deg.to_radians();
    let power = file.effects.redshift_power.unwrap_or(0.0);
    let world = World::new(file.hole.spin, inclination, power);
    let Velocity::Infall { xi, beta_r, beta_phi, .. } = file.motion.velocity else { return world };
    let flow = Parameter::FLOW.into_iter().zip([xi, beta_r, beta_phi]);
    flow.fold(world, |world, (parameter, value)| world.with(parameter, value))
}

/// The world that data are simulated in.
///
/// # Errors
/// If a setting is missing or out of range.
pub fn true_world(file: &FitFile) -> Result<World> {
    let (world, view) = (known_world(&file.simulated()?), drawn_view(file)?);
    Ok(view.into_iter().fold(world, |world, (parameter, value)| world.with(parameter, value)))
}

fn drawn_view(file: &FitFile) -> Result<Vec<(Parameter, f64)>> {
    let view = file.unknown_world()?.map(|unknown| unknown.drawn_view(file.seed));
    Ok(view.transpose()?.unwrap_or_default())
}

/// What the settings of a simulation look through, turned and shifted as the world that is drawn says, along other rays
/// near the critical curve than a fit does.
///
/// # Errors
/// As [`in_world`].
pub(super) fn seen_in_truth(
    file: &FitFile,
    simulated: &FitFile,
    instrument: Instrument,
) -> Result<Instrument> {
    let unknown = file.unknown_world()?.filter(|unknown| unknown.drawn);
    let Some(unknown) = unknown else { return Ok(instrument) };
    let world = (&true_world(file)?, OTHERS + file.seed % OTHERS);
    let (seen, _) =
        through(simulated, &unknown, &instrument, &motion(simulated, Vec::new())?, world)?;
    Ok(seen)
}

/// Rays near the critical curve that a simulation of a drawn world has, from this number on: none that a fit looks along.
const OTHERS: u64 = 1 << 20;

/// What a fit looks through in a world, along the rays near the critical curve of this number, and how matter moves there.
/// Rays of number 0 are the usual ones.
///
/// # Errors
/// If a setting is missing or out of range.
pub fn in_world(
    file: &FitFile,
    unknown: &UnknownWorld,
    instrument: &Instrument,
    measured: &Measured,
    world: (&World, u64),
) -> Result<(Instrument, Motion)> {
    through(file, unknown, instrument, &motion(file, measured.times.clone())?, world)
}

fn through(
    file: &FitFile,
    unknown: &UnknownWorld,
    instrument: &Instrument,
    plain: &Motion,
    (world, rays): (&World, u64),
) -> Result<(Instrument, Motion)> {
    let model = model(file, unknown, instrument, plain)?.seen_along(rays);
    let power = world.get(Parameter::RedshiftPower);
    let hole = Kerr::new(world.get(Parameter::Spin))?;
    let found = Instrument {
        pixels: instrument.pixels.clone(),
        hole,
        lines: model.sightlines(world)?,
        redshift: instrument.redshift.map(|_| Redshift { power }),
        polarized: model.polarized(world),
        seen: instrument.seen.clone(),
        quiescent: instrument.quiescent.clone(),
    };
    Ok((found, model.motion_of(world)?))
}

/// What all worlds share.
fn model(
    file: &FitFile,
    unknown: &UnknownWorld,
    instrument: &Instrument,
    motion: &Motion,
) -> Result<WorldModel> {
    let Sampling::Gauss { order, split } = file.region.nodes else {
        let why = "an unknown world needs region.nodes = { gauss = { order, split } }: nodes equidistant in Mino time \
                   have no derivatives";
        return Err(FitError::Conflict(why.to_owned()).into());
    };
    if file.effects.absorption.is_some() {
        let why = "an unknown world and effects.absorption exclude each other".to_owned();
        return Err(FitError::Conflict(why).into());
    }
    if !matches!(file.axis, AxisSearch::Known {}) {
        let why = "an unknown world needs [axis.known]: matter turns about motion.axis, in the frame of the hole";
        return Err(FitError::Conflict(why.to_owned()).into());
    }
    let follows = unknown.search.drag_is_spin;
    let law = match file.motion.velocity {
        Velocity::Keplerian { .. } if follows => Law::CircularOrbits,
        Velocity::Infall { .. } if follows => Law::Infall(None),
        Velocity::Infall { drag: own, .. } => Law::Infall(Some(own.unwrap_or(drag(file)?))),
        _ => Law::Fixed(motion.velocity.clone()),
    };
    let [x, y] = instrument.pixels.clone();
    Ok(WorldModel {
        x,
        y,
        ring: ring(file)?,
        observer_radius: file.observer.radius,
        region: file.region.limits(),
        order,
        split,
        slow_light: file.effects.slow_light,
        redshift: instrument.redshift.is_some(),
        law,
        axis: axis(file)?.0,
        motion: motion.clone(),
        jy: file.screen.jy_per_pixel,
        polarization: file.polarization,
        seen: instrument.seen.clone(),
    })
}

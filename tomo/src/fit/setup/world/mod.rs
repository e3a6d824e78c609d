//! From settings to a world that is not known: its model, its parameters, the search for them and how sure they are.

mod discretisation;
mod fine;
mod posterior;
mod search;
mod seen;
mod tangent;

pub use posterior::WorldPosterior;
pub use search::{FoundWorld, SearchWatch, Trial, find_world};

use super::instrument::ring;
use super::{Instrument, Measured, Result, axis, drag, motion};
use crate::fit::settings::{AxisSearch, FitError, FitFile, UnknownWorld};
use crate::fit::world::{Law, Parameter, World, WorldModel};
use crate::fit::{Motion, Sampling};
use kerrlight_geodesic::Kerr;
use kerrlight_render::dynamics::Velocity;

/// The world that the settings say, for parameters that are known, and for data that are simulated.
pub fn known_world(file: &FitFile) -> World {
    let inclination = file.observer.inclination_deg.to_radians();
    let world = World::new(file.hole.spin, inclination);
    let Velocity::Infall { xi, beta_r, beta_phi, .. } = file.motion.velocity else { return world };
    let flow = Parameter::FLOW.into_iter().zip([xi, beta_r, beta_phi]);
    flow.fold(world, |world, (parameter, value)| world.with(parameter, value))
}

/// The world that data are simulated in.
///
/// # Errors
/// If a setting is missing or out of range.
pub fn true_world(file: &FitFile) -> Result<World> {
    let simulated = file.simulated()?;
    let (world, view) = (known_world(&simulated), drawn_view(file)?);
    Ok(view.map_or(world, |angle| world.with(Parameter::PositionAngle, angle)))
}

fn drawn_view(file: &FitFile) -> Result<Option<f64>> {
    let view = file.unknown_world()?.map(|unknown| unknown.drawn_view(file.seed));
    Ok(view.transpose()?.flatten())
}

/// What the settings of a simulation look through, turned as the world that is drawn says, with more rays near
/// the critical curve than a fit has.
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
    let plain = motion(simulated, Vec::new())?;
    let mut dense = simulated.clone();
    dense.screen.ring_rays = dense.screen.ring_rays.map(|rays| (DENSER * rays).min(MOST_RAYS));
    Ok(through(&dense, &unknown, &instrument, &plain, &true_world(file)?, 0)?.0)
}

/// So many times the rays near the critical curve of a fit are those of a simulation of a drawn world, up to
/// [`MOST_RAYS`]: data do not know rays.
const DENSER: usize = 16;
/// Of a pixel.
const MOST_RAYS: usize = 1024;

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
    world: &World,
    rays: u64,
) -> Result<(Instrument, Motion)> {
    through(file, unknown, instrument, &motion(file, measured.times.clone())?, world, rays)
}

fn through(
    file: &FitFile,
    unknown: &UnknownWorld,
    instrument: &Instrument,
    plain: &Motion,
    world: &World,
    rays: u64,
) -> Result<(Instrument, Motion)> {
    let model = model(file, unknown, instrument, plain)?.seen_along(rays);
    let hole = Kerr::new(world.get(Parameter::Spin))?;
    let found = Instrument {
        pixels: instrument.pixels.clone(),
        hole,
        lines: model.sightlines(world)?,
        redshift: instrument.redshift,
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
        quartered: None,
        observer_radius: file.observer.radius,
        region: file.region.limits(),
        order,
        split,
        slow_light: file.effects.slow_light,
        redshift: instrument.redshift,
        law,
        axis: axis(file)?.0,
        motion: motion.clone(),
        jy: file.screen.jy_per_pixel,
        polarization: file.polarization,
        seen: instrument.seen.clone(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_common::toml_file;
    use kerrlight_vlbi::array::built_in;

    const SIDE: usize = 12;

    /// The built-in flare as a movie, with what is not known of its world.
    fn settings(world: &str) -> FitFile {
        let text = include_str!("../../../../../cli/src/fit/built_in.toml");
        let mut file: FitFile = toml_file::read(text).unwrap();
        let view = "{ worlds = 1, nodes = 8, iterations = 1, pixels = 12, frames = 2 }";
        let text = format!(
            "drawn = true\n{world}[search]\nstarts = 1\ndrag_is_spin = false\ncoarse = {view}\nfine = {view}\n"
        );
        file.world = text.parse().unwrap();
        file.screen.pixels = SIDE;
        file
    }

    fn simulated(world: &str) -> (World, Vec<f64>) {
        let file = settings(world);
        let instrument = Instrument::new(&file).unwrap();
        let array = built_in("ngEHT");
        let measured = Measured::simulated(&file, &instrument, array.as_ref()).unwrap();
        let movie = measured.movie.unwrap();
        let mut all = Vec::new();
        for frame in 0..3 {
            all.extend_from_slice(&movie.image(frame).unwrap());
        }
        (true_world(&file).unwrap(), all)
    }

    /// A position angle of 90 degrees turns images from north to east, anticlockwise.
    #[test]
    fn exact_drawn_views_turn_what_is_simulated() {
        let (upright, images) = simulated("position_angle_deg = { uniform = [0.0, 1e-9] }\n");
        let (turned, other) =
            simulated("position_angle_deg = { uniform = [90.0, 90.000000001] }\n");
        let angle = |world: &World| world.get(Parameter::PositionAngle).to_degrees();
        assert!(angle(&upright).abs() < 1e-8 && (angle(&turned) - 90.0).abs() < 1e-8);
        let brightest = images.iter().fold(0.0f64, |most, x| most.max(*x));
        assert!(brightest > 0.0);
        for (k, x) in other.iter().enumerate() {
            let (frame, row, column) = (k / SIDE / SIDE, k / SIDE % SIDE, k % SIDE);
            // What is in the last column comes to the first row.
            let from = images[(frame * SIDE + column) * SIDE + SIDE - 1 - row];
            assert!((x - from).abs() < 1e-6 * brightest, "{frame} {row} {column}: {x} {from}");
        }
    }

    #[test]
    fn exact_other_seeds_draw_other_worlds() {
        let mut file = settings(
            "inclination_deg = { uniform = [20.0, 70.0] }\nposition_angle_deg = { uniform = [-180.0, 180.0] }\n",
        );
        let first = true_world(&file).unwrap();
        file.seed += 1;
        let second = true_world(&file).unwrap();
        for parameter in [Parameter::Inclination, Parameter::PositionAngle] {
            assert_ne!(first.get(parameter), second.get(parameter));
        }
        let inclination = first.get(Parameter::Inclination).to_degrees();
        assert!((20.0..=70.0).contains(&inclination) && inclination != 60.0);
    }
}

//! Unknown geometry of a fit, from settings: its model, its parameters, the search for them and their errors.

mod detail;
mod discretisation;
mod fine;
mod posterior;
mod rays_of_data;
mod refinement;
mod search;
mod search_data;
mod steps;
mod tangent;

pub use detail::{RaySampling, Resolution, Trial};
pub use posterior::GeometryPosterior;
pub use rays_of_data::{rays_of_data, through};
pub use search::{FoundGeometry, SearchWatch, find_geometry};

use super::instrument::ring;
use super::{FitData, Instrument, Result, axis, motion, spacing};
use crate::fit::geometry::{Geometry, GeometryModel, Law, Parameter};
use crate::fit::settings::{AxisSearch, FitFile, refuse};
use crate::fit::{Motion, Sampling};
use kerrlight_geodesic::Kerr;
use kerrlight_render::dynamics::Velocity;

/// The geometry that the settings say, with the medians of priors in place of what is not known.
pub fn known_geometry(file: &FitFile) -> Geometry {
    let inclination = file.observer.inclination_deg.value().to_radians();
    let geometry = Geometry::new(file.hole.spin.value(), inclination)
        .with(Parameter::PositionAngle, file.observer.position_angle_deg.value().to_radians());
    let Velocity::Infall { xi, beta_r, beta_phi, .. } = file.motion.law() else { return geometry };
    let flow = Parameter::FLOW.into_iter().zip([xi, beta_r, beta_phi]);
    flow.fold(geometry, |geometry, (parameter, value)| geometry.with(parameter, value))
}

/// The geometry that data are simulated in.
///
/// # Errors
/// If a setting is missing or out of range.
pub fn true_geometry(file: &FitFile) -> Result<Geometry> {
    Ok(known_geometry(&file.simulated()?))
}

/// Returns the instrument of a fit in a geometry, seen through these rays, and the motion of matter there.
///
/// # Errors
/// If a setting is missing or out of range.
pub fn in_geometry(
    file: &FitFile,
    instrument: &Instrument,
    measured: &FitData,
    geometry: &Geometry,
    rays: RaySampling,
) -> Result<(Instrument, Motion)> {
    let plain = motion(file, measured.times.clone())?;
    let model = seen_through(file, model(file, instrument, &plain)?, rays)?;
    let hole = Kerr::new(geometry.get(Parameter::Spin))?;
    let found = Instrument {
        pixels: instrument.pixels.clone(),
        hole,
        lines: model.sightlines(geometry)?,
        redshift: instrument.redshift,
        polarized: model.polarized(geometry),
        seen: instrument.seen.clone(),
        quiescent: instrument.quiescent.clone(),
    };
    Ok((found, model.motion_of(geometry)?))
}

/// The model seen through these rays.
fn seen_through(file: &FitFile, model: GeometryModel, rays: RaySampling) -> Result<GeometryModel> {
    let split = rays.panels * model.split;
    let model = GeometryModel { split, ..model };
    if rays.per_side == 1 {
        return Ok(model.seen_along(rays.lattice));
    }
    let parts = Some((spacing(&file.screen)?, rays.per_side));
    // By the settings of the fit that follows: search, fit and draws see the same rays.
    let ring = ring(&through(file.clone(), rays))?;
    Ok(GeometryModel { parts, ring, ..model }.seen_along(rays.lattice))
}

/// Returns the properties that all geometries share.
fn model(file: &FitFile, instrument: &Instrument, motion: &Motion) -> Result<GeometryModel> {
    let Sampling::Gauss { order, split } = file.region.nodes else {
        refuse!(
            "a number with a prior needs region.nodes = {{ gauss = {{ order, split }} }}: nodes equidistant in Mino time \
             have no derivatives"
        );
    };
    if file.effects.absorption.is_some() {
        refuse!("a number with a prior and effects.absorption exclude each other");
    }
    if !matches!(file.axis, AxisSearch::Known {}) {
        refuse!(
            "a number with a prior needs [axis.known]: matter turns about motion.axis, in the frame of the hole"
        );
    }
    let law = match &file.motion.velocity {
        Velocity::Perturbed(_)
            if file.hole.spin.prior().is_some() && file.motion.follows_spin() =>
        {
            refuse!(
                "a spin with a prior needs a number for `drag` in motion.velocity.perturbed.of: rates that were perturbed \
                 stay the same in every trial"
            );
        }
        Velocity::Keplerian { drag: None } => Law::CircularOrbits,
        Velocity::Infall { drag, .. } => Law::Infall(*drag),
        _ => Law::Fixed(motion.velocity.clone()),
    };
    let [x, y] = instrument.pixels.clone();
    Ok(GeometryModel {
        x,
        y,
        ring: ring(file)?,
        parts: None,
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
    use crate::fit::settings::{PriorSettings, Quantity};
    use core::f64::consts::PI;
    use kerrlight_common::toml_file;
    use kerrlight_vlbi::array::built_in;

    const SIDE: usize = 12;

    /// The built-in flare, seen from directions that are drawn.
    fn settings(inclination: Quantity, position_angle: Quantity) -> FitFile {
        let text = include_str!("../../../../../cli/src/fit/built_in.toml");
        let mut file: FitFile = toml_file::read(text).unwrap();
        file.observer.inclination_deg = inclination;
        file.observer.position_angle_deg = position_angle;
        file.simulation.as_mut().unwrap().drawn = true;
        file.screen.pixels = SIDE;
        file
    }

    fn simulated(position_angle: Quantity) -> (Geometry, Vec<f64>) {
        let file = settings(60.0.into(), position_angle);
        let instrument = Instrument::new(&file).unwrap();
        let array = built_in("ngEHT");
        let measured = FitData::simulated(&file, &instrument, array.as_ref()).unwrap();
        let movie = measured.movie.unwrap();
        let mut all = Vec::new();
        for frame in 0..3 {
            all.extend_from_slice(&movie.image(frame).unwrap());
        }
        (true_geometry(&file).unwrap(), all)
    }

    /// Settings that say how many rays a pixel has are obeyed everywhere.
    #[test]
    fn exact_only_pixels_of_which_nothing_is_said_have_more_rays_near_the_critical_curve() {
        let one = RaySampling::default();
        let means = one.denser();
        let even = RaySampling { ring: None, ..means };
        for (samples, asked, rays, expected) in [
            (None, None, one, None),
            (None, None, means, Some(16)),
            (None, None, even, None),
            (None, Some(1), means, Some(1)),
            (None, Some(40), means, Some(40)),
            (None, Some(40), even, Some(40)),
            (Some(4), None, means, None),
            (Some(4), Some(8), means, Some(8)),
        ] {
            let mut file = settings(60.0.into(), 0.0.into());
            (file.screen.samples_per_pixel, file.screen.ring_rays) = (samples, asked);
            let instrument = Instrument::new(&file).unwrap();
            let plain = motion(&file, vec![0.0]).unwrap();
            let model = model(&file, &instrument, &plain).unwrap();
            let ring = seen_through(&file, model, rays).unwrap().ring.map(|ring| ring.count);
            assert_eq!(ring, expected.filter(|count| *count > 1), "{samples:?} {asked:?}");
            let seen = through(file, rays);
            assert_eq!(seen.screen.ring_rays, expected, "{samples:?} {asked:?}");
        }
    }

    /// A position angle of 90 degrees turns images from north to east, anticlockwise.
    #[test]
    fn exact_drawn_views_turn_what_is_simulated() {
        let (upright, images) = simulated(0.0.into());
        let (turned, other) = simulated(PriorSettings::Uniform([90.0, 90.000000001]).into());
        let (known, same) = simulated(90.0.into());
        assert!((known.get(Parameter::PositionAngle) - PI / 2.0).abs() < 1e-15);
        let angle = |geometry: &Geometry| geometry.get(Parameter::PositionAngle).to_degrees();
        assert!(angle(&upright).abs() < 1e-8 && (angle(&turned) - 90.0).abs() < 1e-8);
        let brightest = images.iter().fold(0.0f64, |most, x| most.max(*x));
        assert!(brightest > 0.0);
        for (k, x) in other.iter().enumerate() {
            let (frame, row, column) = (k / SIDE / SIDE, k / SIDE % SIDE, k % SIDE);
            // What is in the last column comes to the first row.
            let from = images[(frame * SIDE + column) * SIDE + SIDE - 1 - row];
            assert!((x - from).abs() < 1e-6 * brightest, "{frame} {row} {column}: {x} {from}");
            assert!((same[k] - from).abs() < 1e-6 * brightest, "{frame} {row} {column}");
        }
    }

    #[test]
    fn exact_other_seeds_draw_other_geometries() {
        let mut file = settings(
            PriorSettings::Uniform([20.0, 70.0]).into(),
            PriorSettings::Uniform([-180.0, 180.0]).into(),
        );
        let first = true_geometry(&file).unwrap();
        file.seed += 1;
        let second = true_geometry(&file).unwrap();
        for parameter in [Parameter::Inclination, Parameter::PositionAngle] {
            assert_ne!(first.get(parameter), second.get(parameter));
        }
        let inclination = first.get(Parameter::Inclination).to_degrees();
        assert!((20.0..=70.0).contains(&inclination) && inclination != 60.0);
    }
}

//! Geometries that are drawn for calibration, as a forward model that no fit uses makes their images.

use super::{Result, Truth, spacing};
use crate::fit::geometry::{Geometry, Parameter};
use crate::fit::settings::{AxisSearch, FitFile, Spot};
use kerrlight_common::frames::Frames;
use kerrlight_render::dynamics::Velocity;

/// A drawn geometry for another forward model: matter on circular geodesics about the hole, which shines in a region, seen from
/// far away with the time that light takes.
#[derive(Clone, Copy, Debug)]
pub struct Drawn<'a> {
    /// Spin, M.
    pub spin: f64,
    /// Inclination from the spin axis, radians.
    pub inclination: f64,
    /// Position angle of the spin axis, radians east of north.
    pub position_angle: f64,
    /// Power of the redshift factor that emission goes with.
    pub redshift_power: f64,
    /// Least and largest radius of the region, M.
    pub radii: [f64; 2],
    /// Largest |z|, M.
    pub height: f64,
    /// Width between the edges of the screen, M.
    pub width: f64,
    /// Pixels along each side.
    pub pixels: usize,
    /// Times of the images, M since the time at which emission is known.
    pub times: &'a [f64],
}

/// Integrals along one ray through each pixel of emission at (x, y, z), image after image, rows from the top.
pub type OtherModel<'a> =
    &'a dyn Fn(&Drawn<'_>, &(dyn Fn([f64; 3]) -> f64 + Sync)) -> Result<Vec<Vec<f64>>>;

/// Pixels of the other model along each side of one of the fit's.
pub(super) const FINER: usize = 4;

/// Returns whether the geometry of a simulation is drawn from priors.
pub(super) fn is_drawn(file: &FitFile) -> bool {
    file.simulation.as_ref().is_some_and(|simulation| simulation.drawn)
}

/// Returns whether a fit simulates its data along its own rays.
pub fn has_own_rays(file: &FitFile) -> bool {
    file.data.is_none() && !is_drawn(file)
}

/// Returns whether data of these settings are those of a drawn geometry that another forward model can make.
pub(super) fn is_drawn_elsewhere(file: &FitFile) -> Result<bool> {
    Ok(is_drawn(file) && is_of_other_model(&file.simulated()?))
}

/// Returns whether another forward model can make the data of a drawn geometry.
fn is_of_other_model(drawn: &FitFile) -> bool {
    let is_circular = matches!(drawn.motion.velocity, Velocity::Keplerian { drag: None });
    let is_upright = drawn.motion.axis == Some([0.0, 0.0, 1.0]);
    let is_far = drawn.observer.radius.is_none() && drawn.effects.slow_light;
    let is_steady = |spot: &Spot| spot.shines.is_none();
    let is_plain = drawn.motion.injection_time.is_none()
        && drawn.effects.absorption.is_none()
        && drawn.polarization.is_none()
        && drawn.simulated_curve().is_none()
        && drawn
            .truth()
            .is_some_and(|truth| truth.ring.is_empty() && truth.spot.iter().all(is_steady))
        && matches!(drawn.axis, AxisSearch::Known {});
    is_circular && is_upright && is_far && is_plain
}

/// Images of a drawn geometry in Jy per pixel, with [`FINER`] times the pixels of the settings along each side.
pub(super) fn fine_images(
    file: &FitFile,
    geometry: &Geometry,
    truth: &Truth,
    times: &[f64],
    model: OtherModel<'_>,
) -> Result<Vec<Vec<f64>>> {
    let times: Vec<f64> = times.iter().map(|time| time - file.motion.reference_time).collect();
    let region = file.region.limits();
    let drawn = Drawn {
        spin: geometry.get(Parameter::Spin),
        inclination: geometry.get(Parameter::Inclination),
        position_angle: geometry.get(Parameter::PositionAngle),
        redshift_power: file.effects.redshift_power.unwrap_or(0.0),
        radii: [region.r_min, region.r_max],
        height: region.z_width,
        width: spacing(&file.screen)? * file.screen.pixels as f64,
        pixels: FINER * file.screen.pixels,
        times: &times,
    };
    let mut images = model(&drawn, &|x| truth.at(x))?;
    // The light of a pixel goes with its area.
    let jy = file.screen.jy_per_pixel / (FINER * FINER) as f64;
    images.iter_mut().flatten().for_each(|x| *x *= jy);
    Ok(images)
}

/// Sums over the pixels of the settings.
pub(super) fn binned(images: &[Vec<f64>], pixels: usize) -> Frames<f64> {
    let mut all = Vec::with_capacity(images.len() * pixels * pixels);
    for image in images {
        let first = all.len();
        all.resize(first + pixels * pixels, 0.0);
        let fine = FINER * pixels;
        for (k, x) in image.iter().enumerate() {
            let (row, column) = (k / fine / FINER, k % fine / FINER);
            all[first + row * pixels + column] += x;
        }
    }
    Frames::of(all, pixels * pixels)
}

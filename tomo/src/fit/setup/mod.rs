//! Parts of a fit, from settings: sight lines, motion, data with their losses, the representation and its training.

mod band;
mod change;
mod coarse_view;
mod curve;
mod drawn;
mod errors;
mod fit_data;
mod gains;
mod geometry;
mod glyph;
mod held_out;
mod imported;
mod instrument;
mod leakage;
mod learning;
mod light_curve;
mod linear_problem;
mod losses;
mod memory_budget;
mod observable;
mod observed;
mod polarized;
mod polarized_terms;
mod preview_image;
mod quadrature;
mod quiescent;
mod random_field;
mod resampled_noise;
mod ring;
mod simulated;
mod solved_leakage;
mod truth;
mod visibilities;
mod warm_start;

pub use band::{
    BandGeometry, BandScan, BandWatch, band_motion, check_band, in_band_geometry, scan_band,
};
pub use change::{change, emission_times};
pub use coarse_view::CoarseView;
pub use curve::Curve;
pub use drawn::{Drawn, OtherModel, has_own_rays};
pub use errors::errors;
pub use fit_data::FitData;
pub use geometry::{
    FoundGeometry, GeometryPosterior, RaySampling, Resolution, SearchWatch, Trial, find_geometry,
    in_geometry, known_geometry, rays_of_data, through, true_geometry,
};
pub use held_out::{Held, HeldWatch, best as best_held, check_folds, hold_out, told_end};
pub use imported::Reduction;
pub use instrument::Instrument;
pub use leakage::LeakageUnknown;
pub use learning::{caution, check, representation, training};
pub use linear_problem::solve_linear;
pub use memory_budget::check_memory_budget;
pub use preview_image::{PreviewImage, PreviewView};
pub use quadrature::finer_images;
pub use random_field::deviation_of_prior;
pub use solved_leakage::SolvedLeakage;
pub use truth::Truth;
pub use visibilities::{frames_of, prepared};
pub use warm_start::{WarmStarted, warm_start};

use super::linear::Prior;
use super::settings::{
    AxisScan, AxisSearch, FitError, FitFile, Linear, Observer as ObserverSettings, Screen,
};
use super::settings::{WidthOf, Within, refuse};
use super::{Motion, Regulariser};
use crate::optimise::LinearDecay;
use kerrlight_common::units::{MICROARCSECOND, gravitational_angle, gravitational_time};
use kerrlight_geodesic::{Inclination, Observer};
use kerrlight_render::dynamics::{Axis, Injection};
use kerrlight_vlbi::operator::ImageGrid;

type Result<T> = std::result::Result<T, crate::Error>;

/// The observer.
///
/// # Errors
/// If an angle or a radius is out of range.
pub fn observer(observer: &ObserverSettings) -> Result<Observer> {
    let inclination =
        Inclination::from_degrees(observer.inclination_deg.value()).within("observer")?;
    match observer.radius {
        None => Ok(Observer::at_infinity(inclination)),
        Some(radius) => Observer::at_radius(inclination, radius).within("observer"),
    }
}

/// M from one pixel to the next.
///
/// # Errors
/// If the number of pixels or the width is out of range.
pub fn spacing(screen: &Screen) -> Result<f64> {
    let Screen { pixels, width, width_of, .. } = *screen;
    if !(2..=4096).contains(&pixels) {
        return Err(FitError::range("screen.pixels", pixels, "2 to 4096").into());
    }
    if !(width > 0.0 && width.is_finite()) {
        return Err(FitError::range("screen.width", width, "M above 0").into());
    }
    Ok(match width_of {
        WidthOf::Edges => width / pixels as f64,
        WidthOf::Centers => width / (pixels - 1) as f64,
    })
}

/// Returns the grid of the model's pixels on the sky.
///
/// # Errors
/// If neither a field nor mass and distance are given, or they are out of range.
pub fn sky(file: &FitFile) -> Result<ImageGrid> {
    let n = file.screen.pixels;
    let field_uas = match (file.screen.field_uas, file.hole.mass_msun, file.hole.distance_kpc) {
        (Some(field), ..) => field,
        (None, Some(mass), Some(distance)) => {
            spacing(&file.screen)? * n as f64 * gravitational_angle(mass, distance)
        }
        (None, None, _) => {
            let why = format!("visibilities need angles; {MASS}");
            return Err(FitError::missing("hole.mass_msun", why).into());
        }
        _ => {
            return Err(FitError::missing(
                "hole.distance_kpc",
                "visibilities need angles; give `distance_kpc = …` in [hole], e.g. 8.178 for Sgr A*, 16800.0 for M87*, or \
                 `field_uas = …`, the width of the field on the sky, in [screen]",
            ).into());
        }
    };
    Ok(ImageGrid::new(n, n, field_uas * MICROARCSECOND)?)
}

/// Refuses images whose own field on the sky differs from that of the settings, where these tell angles, by more than a hundredth.
///
/// # Errors
/// Names the images and both fields.
pub fn check_field(file: &FitFile, own: ImageGrid, name: &str) -> Result<()> {
    let Ok(sky) = sky(file) else { return Ok(()) };
    let [own, fit] = [own, sky].map(|of| of.pixel_rad * of.width as f64 / MICROARCSECOND);
    if (own - fit).abs() > 0.01 * own.max(fit) {
        refuse!(
            "{name} says that its field is {own:.4} µas wide, and the fit's is {fit:.4} µas: screen.width at the mass and the \
             distance of the hole, or screen.field_uas"
        );
    }
    Ok(())
}

/// Advice where the mass is missing.
const MASS: &str =
    "give `mass_msun = …`, in solar masses, in [hole], e.g. 4.154e6 for Sgr A*, 6.5e9 for M87*";

/// Advice where the axis is missing.
const AXIS: &str = "give `axis = [0.0, 0.0, 1.0]`, the direction that matter turns about right-handed (this one: \
     the hole's), in [motion]";

/// Advice where the linear problem is missing.
const LINEAR: &str = "add a table [linear] with `upper = 3.0` (the largest emission that is allowed: a few times what \
     you expect), `rounds = 4` and `iterations = 200`";

/// Hours of one M.
///
/// # Errors
/// If the mass is missing or not above 0.
pub fn hours_per_m(file: &FitFile) -> Result<f64> {
    let missing = || {
        FitError::missing("hole.mass_msun", format!("times of an observation are hours; {MASS}"))
    };
    let mass = file.hole.mass_msun.ok_or_else(missing)?;
    Ok(gravitational_time(mass) / 3600.0)
}

/// The linear problem's settings.
///
/// # Errors
/// If they are missing.
pub fn linear(file: &FitFile) -> Result<&Linear> {
    let missing = || {
        let why = format!(
            "linear-grid, a linear start, and searches for axes and geometries need it; {LINEAR}"
        );
        FitError::missing("linear", why)
    };
    Ok(file.linear.as_ref().ok_or_else(missing)?)
}

/// Penalties of the linear problem.
pub fn priors(linear: &Linear) -> Vec<Prior> {
    let of =
        [(Regulariser::Smoothness, linear.smoothness), (Regulariser::Sparsity, linear.sparsity)];
    let asked = of.into_iter().filter(|(_, weight)| *weight > 0.0);
    asked.map(|(regulariser, weight)| Prior { regulariser, weight }).collect()
}

/// Returns the motion of matter, with the times of the frames in M.
///
/// # Errors
/// If the velocity is out of range.
pub fn motion(file: &FitFile, times: Vec<f64>) -> Result<Motion> {
    let law = file.motion.law();
    let velocity = law.angular(file.seed, drag(file)?).within("motion.velocity")?;
    Ok(Motion {
        velocity,
        reference: file.motion.reference_time,
        injection: file.motion.injection_time.map(|time| Injection { time }),
        times,
    })
}

/// The spin as matter sees it that turns about the axis, M: a ξ_z, and a without an axis.
///
/// # Errors
/// If the axis has no direction.
pub fn drag(file: &FitFile) -> Result<f64> {
    Ok(file.hole.spin.value() * known_axis(file)?.map_or(1.0, |axis| axis.vector()[2]))
}

/// The true or known axis.
///
/// # Errors
/// If it has no direction.
pub fn known_axis(file: &FitFile) -> Result<Option<Axis>> {
    file.motion.axis.map(Axis::new).transpose().within("motion")
}

/// Returns the axis at the start, and its rates if it is learnt.
///
/// # Errors
/// If the axis is said to be known and is missing, or a rate is out of range.
pub fn axis(file: &FitFile) -> Result<(Axis, Option<LinearDecay>)> {
    match &file.axis {
        AxisSearch::Known {} => {
            let missing = || {
                FitError::missing(
                    "motion.axis",
                    format!("[axis.known] says that it is known; {AXIS}"),
                )
            };
            Ok((known_axis(file)?.ok_or_else(missing)?, None))
        }
        AxisSearch::From { start, rate, last_rate } => {
            let steps = file.training.steps;
            let rate = LinearDecay { from: *rate, to: *last_rate, steps };
            let rate = rate.checked().within("axis.from")?;
            Ok((Axis::new(*start).within("axis.from.start")?, Some(rate)))
        }
        AxisSearch::Scan(AxisScan { rate, last_rate, .. }) => {
            linear(file)?;
            let (from, to, steps) = (*rate, *last_rate, file.training.steps);
            let rate = LinearDecay { from, to, steps };
            // A rate of 0 holds the axis that the scan finds.
            let rate = (from != 0.0).then(|| rate.checked()).transpose().within("axis.scan")?;
            // Until the scan has found a better one.
            Ok((Axis::new([0.0, 0.0, 1.0])?, rate))
        }
    }
}

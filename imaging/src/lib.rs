//! Static images of radio visibilities of a source that does not change: positive pixels, a prior on their flux, penalties
//! whose strength data choose that are held out, gains solved for beside every image, and errors from measurements of the
//! image with other noise. No hole, no gas and no motion are assumed.
//!
//! A ring as the Event Horizon Telescope would see it, from a file of visibilities:
//!
//! ```
//! # use kerrlight_common::units::MICROARCSECOND;
//! # use kerrlight_vlbi::{array, earth, noise, operator, schedule, simulate, source::Source};
//! # let setup = schedule::Setup {
//! #     frequency_hz: 229.1e9,
//! #     bandwidth_hz: 1.856e9,
//! #     integration_s: 120.0,
//! #     elevation_deg: [10.0, 85.0],
//! #     ut1: earth::Ut1::Table,
//! #     frame: earth::Frame::Catalogue,
//! # };
//! # let m87: Source = "m87".parse().unwrap();
//! # let clock = schedule::Clock::Utc;
//! # let plan = schedule::Schedule { mjd: 57853, clock, start_h: 0.5, stop_h: 8.0, scans: 12 };
//! # let eht = array::built_in("EHT2017").unwrap();
//! # let mut seen = schedule::observe_affordable(&eht, m87.position, &plan, &setup)?;
//! # let grid = operator::ImageGrid::new(64, 64, 120.0 * MICROARCSECOND)?;
//! # let light = |k: usize| {
//! #     let radius = grid.east(k % 64).hypot(grid.north(k / 64)) / MICROARCSECOND;
//! #     1e-3 * (-0.5 * ((radius - 21.0) / 5.0).powi(2)).exp()
//! # };
//! # let hours = plan.hours_utc(setup.ut1)?;
//! # let pixels = (0..hours.len() * 4096).map(|k| light(k % 4096)).collect();
//! # let movie = simulate::Movie { grid, pixels };
//! # simulate::fill(&mut seen, &movie, operator::Pulse::Triangle, &hours, operator::Method::Direct)?;
//! # noise::add_thermal_noise(&mut seen, 1);
//! # let bytes = kerrlight_vlbi::files::to_csv(&seen, true)?.into_bytes();
//! use kerrlight_imaging::image;
//! use kerrlight_imaging::settings::{ImageSettings, RingSettings, StartImage, StaticImageFile};
//! use kerrlight_tomo::fit::settings::{Loss, LossKind};
//!
//! let (_, observation) = kerrlight_vlbi::files::decode(&bytes)?;
//! let starts = vec![StartImage::Gaussian { fwhm_uas: 50.0 }];
//! let (flux_jy, flux_sigma_jy) = (0.6, 0.2);
//! let pixels = ImageSettings {
//!     pixels: 24, field_uas: 120.0, flux_jy, flux_sigma_jy, starts, iterations: 100, draws: None,
//! };
//! let data = [LossKind::ClosurePhases, LossKind::LogClosureAmplitudes].map(Loss::new);
//! let mut settings = StaticImageFile::new(pixels, data.to_vec());
//! settings.ring = Some(RingSettings { least_radius_uas: 5.0, most_radius_uas: 45.0 });
//! let survey = image(&settings, observation)?;
//! let ring = survey.found().ring.expect("a ring");
//! println!("{:.1} µas", ring.diameter_uas);
//! # assert!((ring.diameter_uas - 42.0).abs() < 4.0, "{ring:?}");
//! # Ok::<(), kerrlight_imaging::Error>(())
//! ```
//!
//! [`settings`] → [`data`] → start → problem (loss and gradient) → solve (one minimum) → [`ring`](Ring) and [shapes](Shape)
//! → [`survey()`] (all that is asked) → [`survey_polarized`] (Q and U beside it). Data terms, gains and penalties are those
//! of [`kerrlight_tomo`], and so are errors.

// A library tells its caller, not the terminal.
#![cfg_attr(not(test), warn(clippy::print_stdout, clippy::print_stderr))]

// In the order of the flow of data: a module imports from those above it.
pub mod settings;

pub mod data;

mod beam;

mod start;

mod envelope;

mod problem;

mod solve;

mod ring;

mod shapes;

mod found;

mod survey;

mod polarized;

#[cfg(test)]
mod tests;

pub use beam::blurred;
pub use envelope::{Envelope, Profile};
pub use found::{Calibration, Candidate, Survey, mean_with_error};
pub use kerrlight_tomo::Error;
pub use polarized::{
    LinearPolarization, PolarizedCandidate, PolarizedProblem, PolarizedSurvey, survey_polarized,
};
pub use problem::{FluxPrior, ImageProblem};
pub use ring::{MOST_CENTRAL, Ring};
pub use shapes::{Shape, ShapeFit, best_shape, fit_shapes};
pub use solve::Solution;
pub use survey::{Stage, SurveyWatch, image, known_skies, survey};

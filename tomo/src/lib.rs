//! Emission around a black hole, recovered from images, visibilities or light curves.
//!
//! [`fit()`] takes a [`Problem`] (settings with their data) and gives a [`Recovery`] (volume, movie, residuals, verdict).
//! A flare on a circular orbit, seen in eight images, and its emission recovered on voxels:
//!
//! ```
//! use kerrlight_tomo::fit::settings::{FitFile, Hole, Kind, Spot, Truth};
//! use kerrlight_tomo::{Problem, Silent, fit};
//!
//! let spot = Spot { center: [6.0, 0.0, 0.0], sigma: 1.5, amplitude: 1.0, ..Spot::default() };
//! let truth = Truth { spot: vec![spot], ..Truth::default() };
//! let mut settings = FitFile::new(Hole::new(0.5), 40.0, [3.0, 10.0], Kind::LinearGrid)
//!     .simulating(truth, 8, 0.0, 60.0, 1e-2);
//! settings.screen.pixels = 16;
//! settings.representation.linear_grid.nodes = 14;
//! settings.output.nodes = 20;
//! let recovery = fit(&Problem::simulated(settings, None)?, &mut Silent)?;
//! println!("{}", recovery.judged.worth());
//! # let psnr = recovery.closeness.and_then(|close| close.psnr_db).unwrap();
//! # assert!(psnr > 20.0, "{psnr}");
//! # Ok::<(), kerrlight_tomo::Error>(())
//! ```
//!
//! Measured data come as [`Problem::of_visibilities`], [`Problem::of_movie`] or [`Problem::of_light_curve`];
//! [`Progress`] follows a fit, stops it and keeps what it has found.
//!
//! Data flow: points are pulled back along the gas ([`kerrlight_render::dynamics`]) → [`representation`] → images or
//! visibilities ([`kerrlight_vlbi`]) → loss → gradient → [`optimise`]; [`mod@fit`] has the parts, [`recovery`] puts them
//! together. Nothing here knows a path or a terminal: codecs work on bytes.

// A library tells its caller, not the terminal.
#![cfg_attr(not(test), warn(clippy::print_stdout, clippy::print_stderr))]

// In the order of the flow of data: a module imports from those above it.
mod null;

pub mod exr_picture;

pub mod representation;

pub mod optimise;

pub mod fit;

pub mod recovery;

mod error;

pub use error::Error;
pub use recovery::{Problem, Progress, Recovery, Silent, fit};

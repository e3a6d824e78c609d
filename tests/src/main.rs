//! Tests that touch two crates or the binary, named by their authority: exact_ (closed
//! form), paper_ (a published number), code_ (another code's number), regress_ (own past).

mod accuracy;
mod architecture;
mod bad_input;
mod bounded;
mod browser;
#[cfg(unix)]
mod cases;
mod changing_emission;
mod closed_forms;
mod command_line;
mod compare;
mod compositing;
mod critical_curve;
mod data_files;
mod documents;
mod eht_data;
mod eht_polarized;
mod file_fields;
mod film;
mod film_stars;
mod fit;
mod fit_bad_luck;
mod fit_data;
mod fit_start;
mod fit_without_phases;
mod graphics_devices;
mod held_out;
mod interferometry;
mod kerr_references;
mod key_tables;
mod known_skies;
mod leakage;
mod lensing;
mod other_sky;
#[cfg(unix)]
mod pictures;
mod posterior;
mod quick_looks;
mod quiescent;
mod radiative_transfer;
mod readme;
mod reference;
mod resolved_rings;
mod results;
mod resume;
mod resumed_fits;
mod resumed_searches;
mod scene_files;
#[cfg(unix)]
mod signals;
#[cfg(unix)]
mod static_image;
mod static_sky;
mod station_gains;
mod support;
mod system_limits;
mod unknown_geometry;
mod verdict;
mod view;
mod view_input;

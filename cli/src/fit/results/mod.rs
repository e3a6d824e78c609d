//! Results of a run: the volume, the movie, numbers, pictures and the report.

mod advice;
mod bounds;
pub mod gains;
pub mod leakage;
mod light_curve;
pub mod medium;
mod numbers;
mod over_time;
pub mod page;
pub mod plots;
mod quadrature;
mod quiescent;
pub mod residuals;
mod scene;
pub mod verdict;

pub use kerrlight_tomo::recovery::recovered;
pub use light_curve::TABLE as LIGHT_CURVE;
pub use numbers::last_step;

use super::folder::Folder;
use gains::Gains;
use kerrlight_common::frames::Frames;
use kerrlight_common::units::MICROARCSECOND;
use kerrlight_render::volume::{Shown, Volume, VolumeFile, vti};
use kerrlight_tomo::fit::settings::FitFile;
use kerrlight_tomo::fit::setup::{self, FitData, Instrument, PreviewImage, PreviewView};
use kerrlight_tomo::fit::{Loss, Motion, State};
use kerrlight_tomo::recovery::Fit;
use kerrlight_vlbi::files::images;
use leakage::Leakage;
use over_time::Changes;
use quiescent::Quiescent;
use serde_json::Value;
use std::time::Instant;
use verdict::{DataVerdict, Evidence};

/// All that the results are made of.
pub struct Estimate<'a> {
    /// Settings.
    pub file: &'a FitFile,
    /// Folder of the results.
    pub folder: &'a Folder,
    /// Rays.
    pub instrument: &'a Instrument,
    /// Motion.
    pub motion: &'a Motion,
    /// Data.
    pub measured: &'a FitData,
    /// Emission that was simulated.
    pub true_volume: Option<Volume>,
    /// The graphics device that took the last steps, if one did.
    pub device: Option<String>,
}

impl<'a> Estimate<'a> {
    /// Takes a fit, in its folder.
    pub fn new<'b: 'a>(fit: &mut Fit<'b, '_>, folder: &'a Folder) -> Self {
        let Fit { file, instrument, motion, measured, .. } = *fit;
        let device = fit.trainer.device.take().map(|device| device.name().to_owned());
        let true_volume = fit.true_volume.clone();
        Self { file, folder, instrument, motion, measured, true_volume, device }
    }
}

impl Estimate<'_> {
    /// Writes all of them: a line with the quality of the fit, and results.json.
    pub fn write(
        &self,
        fit: &mut Fit<'_, '_>,
        state: &State<f32>,
        begun: Instant,
    ) -> anyhow::Result<(String, Value)> {
        let seen = fit.seen(state)?;
        let movie = fit.pictured(state, &seen)?;
        // Before verdict and loss, which see the leakage from here on.
        let leakage = self.leakage(&seen)?;
        let judged = fit.judged(state, &seen, &movie)?;
        let light = fit.quiescent_light(state);
        let trainer = &mut fit.trainer;
        let volume = recovered(self.file, trainer, state)?;
        let frames: Vec<usize> = (0..self.measured.times.len()).collect();
        let quiescent = self.quiescent(trainer, state)?;
        let loss = trainer.objective.loss_of(&frames, &seen)?;
        let mask = numbers::mask_error(trainer, state, &seen)?;
        let quadrature = self.quadrature_error(trainer, state)?;
        self.volumes(&volume, state)?;
        self.movies(&movie)?;
        let changes = self.changes(trainer, state)?;
        if let Some(changes) = &changes {
            self.folder.file("emission.csv")?.write(changes.table().as_bytes())?;
        }
        self.scene(trainer, state, &movie, &light)?;
        let Self { file, instrument, motion, measured, .. } = *self;
        let view = PreviewView { file, instrument, motion, truth: measured.truth.as_ref() };
        let still = view.at(self.time_of_still(), trainer, state)?;
        if let Some(table) = self.curve_table(&seen)? {
            self.folder.file(LIGHT_CURVE)?.write(table.as_bytes())?;
        }
        let gains = self.gains(&movie, &seen)?;
        let found = Found {
            volume,
            changes,
            still,
            loss,
            mask,
            quadrature,
            judged,
            gains,
            leakage,
            quiescent,
            seen,
            movie,
            state,
            begun,
        };
        let results = self.results(trainer, &found)?;
        self.folder.keep("results.json", &results)?;
        // After results.json: a comparison takes the page as the sign that a fit is whole.
        self.report(&found, &results)?;
        let last = numbers::last_line(&found.judged.worth(), &results);
        Ok((last, serde_json::to_value(results)?))
    }

    fn evidence(&self) -> Evidence<'_> {
        let Estimate { file, measured, .. } = *self;
        Evidence { file: Some(file), losses: &file.loss, seed: file.seed, measured }
    }

    fn volumes(&self, volume: &Volume, state: &State<f32>) -> anyhow::Result<()> {
        let save = |name: &str, volume: &Volume, axis| {
            let file = VolumeFile { volume: volume.clone(), axis: Some(axis) };
            self.folder.file(name)?.write(&file.to_npz())
        };
        save("volume.npz", volume, state.now.axis.vector())?;
        let mut fields = vec![Shown { name: "emission", volume }];
        if let (Some(volume), Some(truth)) = (&self.true_volume, &self.measured.truth) {
            save("truth.npz", volume, truth.axis().vector())?;
            fields.push(Shown { name: "truth", volume });
        }
        let write = |out: &mut std::io::BufWriter<&std::fs::File>| Ok(vti::write(out, &fields)?);
        self.folder.file("volume.vti")?.write_with(write)
    }

    fn movies(&self, movie: &Frames<f32>) -> anyhow::Result<()> {
        let n = self.file.screen.pixels;
        let times = &self.measured.times;
        let mut lists = vec![("time", times.clone())];
        // What `observe` needs to see it, where it is known.
        if let Ok(hours) = setup::hours_per_m(self.file) {
            lists.push(("hours", times.iter().map(|time| (time - times[0]) * hours).collect()));
        }
        lists.extend(self.field());
        self.folder.file("movie.npz")?.write_with(|out| {
            let mut archive = images::MovieWriter::new(out, n);
            archive.add("recovered", movie)?;
            self.measured.movie.iter().try_for_each(|truth| archive.add("data", truth))?;
            lists.iter().try_for_each(|(name, list)| archive.list(name, list))?;
            Ok(archive.finish()?)
        })
    }

    /// The width of the field, where it is known.
    fn field(&self) -> Option<(&'static str, Vec<f64>)> {
        let sky = setup::sky(self.file).ok()?;
        let n = self.file.screen.pixels as f64;
        Some(("field_uas", vec![sky.pixel_rad / MICROARCSECOND * n]))
    }

    /// Returns the time of the still image, M: at the reference time, or in the middle of the data if that lies outside
    /// of them.
    fn time_of_still(&self) -> f64 {
        let (times, reference) = (&self.measured.times, self.motion.reference);
        let within = times.first().is_some_and(|first| reference >= *first)
            && times.last().is_some_and(|last| reference <= *last);
        if within { reference } else { times[times.len() / 2] }
    }
}

/// Recovered quantities.
pub struct Found<'a> {
    volume: Volume,
    /// The emission over time, where it is not the same at all times.
    changes: Option<Changes>,
    still: PreviewImage,
    loss: Loss,
    /// Part of the flux that the mask of what shines leaves out; nothing without a mask.
    mask: Option<f64>,
    /// Error of sums along rays, over the errors of the data, where that is known.
    quadrature: Option<f64>,
    judged: DataVerdict,
    /// Gains of stations, where they are solved for.
    gains: Option<Gains>,
    /// Leakage of stations, where it is solved for.
    leakage: Option<Leakage>,
    /// Emission that does not move, where it is recovered.
    quiescent: Option<Quiescent>,
    /// Quantities of the movie that data depend on: the movie itself, its images of Stokes parameters, or its fluxes.
    seen: Frames<f32>,
    movie: Frames<f32>,
    state: &'a State<f32>,
    begun: Instant,
}

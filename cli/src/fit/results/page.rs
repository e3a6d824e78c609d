//! The report.

use super::bounds::Reached;
use super::gains::Gains;
use super::leakage::Leakage;
use super::medium;
use super::numbers::{Closeness, Results, last_step, outcomes};
use super::over_time::Changes;
use super::plots;
use super::quiescent::Quiescent;
use super::residuals;
use super::verdict::{self, DataVerdict};
use super::{Estimate, Found};
use crate::fit::folder::Folder;
use crate::fit::{band_plots, band_words, held_out};
use crate::output;
use crate::report::{self, LinePlot, Report, View3d};
use anyhow::Context;
use kerrlight_common::toml_file::{self, Keys};
use kerrlight_render::volume::Shown;
use kerrlight_render::volume::projection::Surroundings;
use kerrlight_render::volume::slices::Through;
use kerrlight_tomo::fit::settings::{AxisSearch, DataFiles, FitFile, Kind};
use kerrlight_tomo::fit::setup::PreviewImage;

/// Emission in Jy/pixel a M would mean little: 1 M of emission 1 gives `screen.jy_per_pixel`.
const UNIT: &str = "model units";

impl Estimate<'_> {
    /// Draws and writes it.
    pub fn report(&self, found: &Found<'_>, results: &Results) -> anyhow::Result<()> {
        let lines = self.folder.lines()?;
        let mut plots: Vec<LinePlot> = plots::losses(&lines).into_iter().collect();
        plots.extend(plots::quality(&lines));
        plots.extend(results.held_out.as_deref().map(held_out::plot));
        plots.extend(self.light_curves(&found.seen)?);
        if let Some(band) = results.band.as_deref() {
            plots.extend(band_plots::of_runs(&[("these data".to_owned(), band.clone())], ""));
        }
        plots.push(self.light_curve(&found.movie)?);
        plots.extend(found.changes.as_ref().map(Changes::plot));
        let gains = found.gains.as_ref();
        plots.extend(plots::amplitudes(&self.evidence(), &found.movie, gains)?);
        plots.extend(residuals::plots(&found.judged, self.measured));
        plots.extend(found.gains.iter().flat_map(Gains::plots));
        plots.extend(found.leakage.as_ref().map(Leakage::plot));
        let report = Report {
            title: self.file.title.clone(),
            notice: Some(verdict::notice(&found.judged)),
            summary: self.summary(found, results),
            parts: band_words::parts(self.file, self.measured),
            results: outcomes(results),
            details: details(&found.judged, gains, found.leakage.as_ref()),
            view: Some(self.view(found)),
            figures: self.figures(found)?,
            plots,
            settings: settings(self.file, FitFile::keys(), self.folder)?
                .into_iter()
                .filter(|setting| self.file.uses(&setting.key))
                .collect(),
            ..Report::default()
        };
        let names = ["views.png", "lensed.png", "slices.png", "movie.png"];
        for (figure, name) in report.figures.iter().zip(names) {
            self.folder.file(name)?.write(&figure.png)?;
        }
        report.write(&self.folder.file("report.html")?)
    }

    fn shown<'b>(&'b self, found: &'b Found<'_>) -> Vec<Shown<'b>> {
        let mut shown = vec![Shown { name: "recovered", volume: &found.volume }];
        shown.extend(self.true_volume.as_ref().map(|volume| Shown { name: "truth", volume }));
        shown
    }

    fn figures(&self, found: &Found<'_>) -> anyhow::Result<Vec<report::Figure>> {
        let shown = self.shown(found);
        let hole_radius = self.instrument.hole.horizon();
        let around = Surroundings {
            hole_radius,
            axis: found.state.now.axis.vector(),
            ring_radius: self.file.region.r_max,
            half_width: self.file.region.r_max,
        };
        let mut figures = vec![
            report::projections(&shown, &around, UNIT)?,
            self.lensed(&found.still)?,
            report::slices(&shown, Through::Maximum, hole_radius, None, UNIT)?,
        ];
        let n = self.file.screen.pixels;
        let mut rows = vec![report::Strip::new("recovered", &found.movie)?];
        if let Some(movie) = &self.measured.movie {
            rows.push(report::Strip::new(self.known_movie(), movie)?);
        }
        figures.push(report::frames(&rows, n, &self.measured.times)?);
        if let Some(figure) = self.residual_map(found)? {
            self.folder.file("residuals.png")?.write(&figure.png)?;
            figures.push(figure);
        }
        if let Some(quiescent) = &found.quiescent {
            figures.extend(self.quiescent_figure(quiescent)?);
        }
        figures.extend(self.axes()?);
        Ok(figures)
    }

    /// Names the movie beside the recovered one.
    pub fn known_movie(&self) -> &'static str {
        if self.measured.truth.is_some() { "truth" } else { "data" }
    }

    fn lensed(&self, still: &PreviewImage) -> anyhow::Result<report::Figure> {
        let mut images = vec![("recovered", &still.recovered)];
        images.extend(still.truth.as_ref().map(|truth| ("truth", truth)));
        let delay = self.file.effects.slow_light;
        // A law of polarised light has a power of g of its own.
        let shift = self.file.effects.redshift_power.is_some() || self.file.polarization.is_some();
        let with = match (delay, shift) {
            (true, true) => "delays and Doppler shifts included",
            (true, false) => "delays included, Doppler shifts left out as in the fit",
            (false, true) => "Doppler shifts included, delays left out as in the fit",
            (false, false) => "delays and Doppler shifts left out as in the fit",
        };
        report::still(&images, still.side, still.time, with)
    }

    /// The map of a scan of axes, if there was one.
    fn axes(&self) -> anyhow::Result<Option<report::Figure>> {
        let path = self.folder.path().join("axis_scan.png");
        if !matches!(self.file.axis, AxisSearch::Scan { .. }) || !path.is_file() {
            return Ok(None);
        }
        Ok(Some(report::Figure {
            png: output::read(&path)?,
            caption: "How well each axis that matter might turn about explains the data: the loss of a coarse volume that was fitted about that axis, over the whole sphere of directions. The smaller the better; the fit went on from the best one.".to_owned(),
            alt: "Map of the loss over all directions of the axis.".to_owned(),
        }))
    }

    fn view(&self, found: &Found<'_>) -> View3d {
        let (r_min, r_max) = (self.file.region.r_min, self.file.region.r_max);
        // The table of rates begins above 0, where a Keplerian law has no value.
        let rates = report::rates(&self.motion.velocity, [r_min.max(1e-3), r_max]);
        let times = &self.measured.times;
        let ends = [times.first(), times.last()].map(|time| time.copied().unwrap_or(0.0));
        View3d {
            recovered: found.volume.clone(),
            truth: self.true_volume.clone(),
            unit: UNIT.to_owned(),
            // The viewer turns matter about the axis, and knows of no fall.
            motion: (ends[1] > ends[0] && !self.file.motion.law().falls()).then(|| {
                report::Motion {
                    axis: found.state.now.axis.vector(),
                    rates,
                    times: ends,
                    reference: self.motion.reference,
                    time_unit: "GM/c³".to_owned(),
                }
            }),
            hole_radius: self.instrument.hole.horizon(),
            r_max,
        }
    }

    /// Describes what was fitted to what.
    fn subject(&self, results: &Results) -> String {
        let file = self.file;
        let data: Vec<&str> = file.loss.iter().map(|l| l.data.label()).collect();
        let fitted = match results.band.as_ref().and_then(|band| band.is_seen()) {
            Some(false) => "was fitted to",
            _ => "was recovered from",
        };
        format!(
            "Emission around a black hole of spin {}, seen at {}° from its spin axis, {fitted} {} frames of {}. It is represented by {}.",
            rounded(file.hole.spin.value()),
            rounded(file.observer.inclination_deg.value()),
            self.measured.times.len(),
            data.join(", "),
            file.recovered()
        )
    }

    fn summary(&self, found: &Found<'_>, results: &Results) -> Vec<String> {
        let file = self.file;
        let mut lines = vec![self.subject(results)];
        lines.extend(results.geometry.iter().flat_map(|of| of.sentences()));
        lines.extend(results.band.iter().flat_map(|of| of.sentences()));
        lines.extend(results.held_out.as_ref().and_then(|of| of.sentence()));
        let (step, of) = (results.steps, file.training.steps);
        let is_early = file.representation.kind != Kind::LinearGrid && step < of;
        lines.extend(is_early.then(|| last_step(step, of)));
        lines.extend(results.advice.iter().cloned());
        lines.extend(results.bounds.iter().map(Reached::sentence));
        let linear = results.linear.iter();
        lines.extend(linear.map(|of| format!("The linear grid's solution: {}.", of.statement)));
        lines.extend(results.unknown.iter().map(|open| format!("Note that {open}.")));
        let chi2 = results.chi2_per_datum.iter();
        let each = chi2.map(|(name, value)| format!("{name}: χ² per data point {value:.4}"));
        lines.push(format!(
            "{}. χ² per data point is the mean squared residual in units of the error bars: about 1 for the right model and errors, less for noise-free data.",
            each.collect::<Vec<_>>().join("; ")
        ));
        if let Some(DataFiles::Visibilities { scattering, variability, .. }) = file.data {
            lines.extend(medium::sentences(scattering, variability));
        }
        lines.extend(found.gains.iter().flat_map(Gains::sentences));
        lines.extend(found.leakage.iter().flat_map(Leakage::sentences));
        lines.extend(found.quiescent.iter().flat_map(Quiescent::sentences));
        lines.extend(results.closeness.iter().flat_map(Closeness::sentences));
        lines
    }
}

/// Tables of residuals, and of gains and leakage where they are solved for.
pub fn details(
    judged: &DataVerdict,
    gains: Option<&Gains>,
    leakage: Option<&Leakage>,
) -> Vec<report::Table> {
    let residuals = [Some(verdict::table(judged)), verdict::parts::by_station(judged)];
    let solved = [gains.map(Gains::details), leakage.map(Leakage::details)];
    residuals.into_iter().chain(solved).flatten().collect()
}

/// Every setting with its meaning; those that the run's file leaves out are called assumed.
pub fn settings(
    file: &impl serde::Serialize,
    keys: &Keys,
    folder: &Folder,
) -> anyhow::Result<Vec<report::Setting>> {
    let table = toml_file::table_of(file).context("settings")?;
    let given: toml::Table = folder.settings.parse()?;
    let (mut all, mut written) = (Vec::new(), Vec::new());
    flatten("", &toml::Value::Table(table), &mut all);
    flatten("", &toml::Value::Table(given), &mut written);
    let is_written = |key: &str| written.iter().any(|(other, _)| other == key);
    let row = |(key, value): (String, String)| {
        let about = keys.at(&key).map_or(String::new(), |about| about.meaning);
        let meaning = if is_written(&key) { about } else { format!("Assumed. {about}") };
        report::Setting { key, value, meaning: meaning.trim_end().to_owned() }
    };
    Ok(all.into_iter().map(row).collect())
}

/// Rounds to four digits behind the point, as far as there are any.
fn rounded(x: f64) -> f64 {
    (1e4 * x).round() / 1e4
}

/// `a.b = value` of every leaf.
fn flatten(prefix: &str, value: &toml::Value, all: &mut Vec<(String, String)>) {
    match value {
        toml::Value::Table(table) => {
            for (key, value) in table {
                let path = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
                flatten(&path, value, all);
            }
        }
        toml::Value::Array(values) if values.iter().any(toml::Value::is_table) => {
            for (k, value) in values.iter().enumerate() {
                flatten(&format!("{prefix}.{k}"), value, all);
            }
        }
        leaf => all.push((prefix.to_owned(), leaf.to_string())),
    }
}

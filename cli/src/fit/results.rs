//! What a run leaves: the volume, the movie, pictures and the report.

use super::config::{AxisSearch, FitFile};
use super::curves::{loss_plot, psnr_plot};
use super::data::Measured;
use super::folder::Folder;
use super::setup::{self, Instrument};
use super::truth::Truth;
use crate::report::{self, Axis, LinePlot, Marks, Report, Series, View3d};
use crate::usage::usage;
use crate::volume_files;
use anyhow::{Context, anyhow};
use kerrlight_tomo::fit::{Loss, Motion, State, Trainer};
use kerrlight_tomo::interferometry::operator::{Method, Operator, Pulse, Transform};
use kerrlight_tomo::volume::metrics::{self, Comparison, Mask};
use kerrlight_tomo::volume::projection::Surroundings;
use kerrlight_tomo::volume::slices::Through;
use kerrlight_tomo::volume::{Shown, Volume, VolumeFile, vti};
use num_complex::Complex;
use serde_json::{Value, json};
use std::time::Instant;

/// Emission in Jy/pixel a M would mean little: 1 M of emission 1 gives `screen.jy_per_pixel`.
const UNIT: &str = "model units";

/// The nodes of the volume.
struct Box3 {
    nodes: [usize; 3],
    half: f64,
}

impl Box3 {
    fn new(file: &FitFile) -> Self {
        Self { nodes: [file.output.nodes; 3], half: file.region.r_max }
    }

    fn volume(&self, values: Vec<f32>) -> anyhow::Result<Volume> {
        Ok(Volume::new(self.nodes, [-self.half; 3], [self.half; 3], values)?)
    }

    fn positions(&self) -> Vec<[f64; 3]> {
        let n = self.nodes[0];
        let at = |k: usize| -self.half + 2.0 * self.half * k as f64 / (n - 1) as f64;
        (0..n.pow(3)).map(|k| [at(k / (n * n)), at(k / n % n), at(k % n)]).collect()
    }
}

/// The field at the reference time, zero outside the region.
fn recovered(
    file: &FitFile,
    trainer: &mut Trainer<'_, f32>,
    state: &State<f32>,
) -> anyhow::Result<Volume> {
    let (nodes, region) = (Box3::new(file), setup::region(&file.region));
    let positions = nodes.positions();
    let inside: Vec<usize> = (0..positions.len()).filter(|k| region.holds(positions[*k])).collect();
    let column = |c: usize| inside.iter().map(|k| positions[*k][c] as f32).collect::<Vec<f32>>();
    let [x, y, z] = [0, 1, 2].map(column);
    let found = trainer.emission(&state.now, [&x, &y, &z]);
    let mut values = vec![0.0; positions.len()];
    inside.iter().zip(found).for_each(|(k, value)| values[*k] = value);
    nodes.volume(values)
}

/// Σ |masked − unmasked|/Σ |unmasked| over a few frames.
fn mask_error(trainer: &mut Trainer<'_, f32>, state: &State<f32>, masked: &[f32]) -> Option<f64> {
    state.now.occupancy.as_ref()?;
    let chain = &trainer.objective.chain;
    let (all, pixels) = (chain.frames(), chain.pixels());
    let frames: Vec<usize> = [1, 3].map(|k| k * all / 4).to_vec();
    let whole = trainer.movie(&state.now, &frames, false);
    let mut sums = [0.0; 2];
    for (frame, image) in frames.iter().zip(whole.chunks_exact(pixels)) {
        for (pixel, masked) in image.iter().zip(&masked[frame * pixels..]) {
            sums[0] += f64::from((pixel - masked).abs());
            sums[1] += f64::from(pixel.abs());
        }
    }
    (sums[1] > 0.0).then(|| sums[0] / sums[1])
}

fn true_volume(file: &FitFile, truth: &Truth) -> anyhow::Result<Volume> {
    let nodes = Box3::new(file);
    nodes.volume(nodes.positions().iter().map(|x| truth.at(*x) as f32).collect())
}

/// What the field is worth beside the truth.
pub fn compare(
    file: &FitFile,
    trainer: &mut Trainer<'_, f32>,
    state: &State<f32>,
    truth: &Truth,
) -> Option<Comparison> {
    let estimate = recovered(file, trainer, state).ok()?;
    metrics::compare(&estimate, &true_volume(file, truth).ok()?, None).ok()
}

/// All that the results are made of.
pub struct Estimate<'a> {
    /// Settings.
    pub file: &'a FitFile,
    /// Where they go.
    pub folder: &'a Folder,
    /// Rays.
    pub instrument: &'a Instrument,
    /// Motion.
    pub motion: &'a Motion,
    /// Data.
    pub measured: &'a Measured,
}

impl Estimate<'_> {
    /// Writes all of them.
    pub fn write(
        &self,
        trainer: &mut Trainer<'_, f32>,
        state: &State<f32>,
        begun: Instant,
    ) -> anyhow::Result<()> {
        let volume = recovered(self.file, trainer, state)?;
        let truth = self.measured.truth.as_ref();
        let true_volume = truth.map(|truth| true_volume(self.file, truth)).transpose()?;
        let frames: Vec<usize> = (0..self.measured.times.len()).collect();
        let movie = trainer.movie(&state.now, &frames, true);
        let loss = trainer.objective.loss_of(&frames, &movie);
        let mask = mask_error(trainer, state, &movie);
        self.volumes(&volume, true_volume.as_ref(), state)?;
        self.movies(&movie)?;
        let found = Found { volume, true_volume, loss, mask, movie, state, begun };
        let results = self.results(trainer, &found)?;
        self.folder.file("results.json")?.write(format!("{results:#}\n").as_bytes())?;
        self.report(&found, &results)
    }

    fn volumes(
        &self,
        volume: &Volume,
        truth: Option<&Volume>,
        state: &State<f32>,
    ) -> anyhow::Result<()> {
        let save = |name: &str, volume: &Volume, axis| {
            let file = VolumeFile { volume: volume.clone(), axis: Some(axis) };
            volume_files::write(&self.folder.file(name)?, &file)
        };
        save("volume.npz", volume, state.now.axis.vector())?;
        let mut fields = vec![vti::Field { name: "emission", volume }];
        if let (Some(volume), Some(truth)) = (truth, &self.measured.truth) {
            save("truth.npz", volume, truth.axis().vector())?;
            fields.push(vti::Field { name: "truth", volume });
        }
        let write = |out: &mut std::io::BufWriter<&std::fs::File>| Ok(vti::write(out, &fields)?);
        self.folder.file("volume.vti")?.write_with(write)
    }

    fn movies(&self, movie: &[f32]) -> anyhow::Result<()> {
        let n = self.file.screen.pixels;
        let shape = [self.measured.times.len(), n, n];
        let mut arrays = vec![("recovered", movie.to_vec())];
        if let Some(truth) = &self.measured.movie {
            arrays.push(("data", truth.iter().map(|x| *x as f32).collect()));
        }
        let bytes = volume_files::movie_archive(shape, &arrays, &self.measured.times)?;
        self.folder.file("movie.npz")?.write(&bytes)
    }

    fn results(&self, trainer: &Trainer<'_, f32>, found: &Found<'_>) -> anyhow::Result<Value> {
        let names = trainer.objective.names();
        let chi2: serde_json::Map<String, Value> = names
            .iter()
            .zip(&found.loss.terms)
            .map(|(name, value)| ((*name).to_owned(), json!(value)))
            .collect();
        let now = &found.state.now;
        let mut results = json!({
            "version": env!("CARGO_PKG_VERSION"),
            "steps": now.step,
            "seconds": found.begun.elapsed().as_secs_f64(),
            "cpu_seconds": usage().map(|usage| usage.cpu_seconds),
            "peak_memory_mib": usage().map(|usage| usage.peak_mib),
            "loss": found.loss.total,
            "chi2_per_datum": chi2,
            "axis": now.axis.vector(),
        });
        if let Some(mask) = found.mask {
            results["mask_error"] = json!(mask);
        }
        let (Some(truth), Some(volume)) = (&self.measured.truth, &found.true_volume) else {
            return Ok(results);
        };
        let region = &self.file.region;
        let z_width = region.z_width.unwrap_or(f64::INFINITY);
        let mask = Mask::new(region.r_min, region.r_max, z_width)?;
        let all = metrics::compare(&found.volume, volume, None)?;
        let inside = metrics::compare(&found.volume, volume, Some(&mask))?;
        results["axis_dot_truth"] = json!(now.axis.dot(truth.axis()));
        results["psnr_db"] = json!(all.psnr_db);
        results["psnr_inside_db"] = json!(inside.psnr_db);
        results["nrmse"] = json!(all.nrmse);
        results["correlation"] = json!(all.correlation);
        Ok(results)
    }

    fn report(&self, found: &Found<'_>, results: &Value) -> anyhow::Result<()> {
        let lines = self.folder.lines()?;
        let mut plots: Vec<LinePlot> = loss_plot(&lines).into_iter().collect();
        plots.extend(psnr_plot(&lines));
        plots.push(self.light_curve(&found.movie));
        plots.extend(self.amplitudes(&found.movie)?);
        let report = Report {
            title: self.file.title.clone(),
            summary: self.summary(results),
            results: outcomes(results),
            view: Some(self.view(found)),
            figures: self.figures(found)?,
            plots,
            settings: self.settings()?,
            ..Report::default()
        };
        for (figure, name) in report.figures.iter().zip(["views.png", "slices.png", "movie.png"]) {
            self.folder.file(name)?.write(&figure.png)?;
        }
        report.write(&self.folder.file("report.html")?)
    }

    fn shown<'b>(&self, found: &'b Found<'_>) -> Vec<Shown<'b>> {
        let mut shown = vec![Shown { name: "recovered", volume: &found.volume }];
        shown.extend(found.true_volume.as_ref().map(|volume| Shown { name: "truth", volume }));
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
            report::slices(&shown, Through::Maximum, hole_radius, UNIT)?,
        ];
        let n = self.file.screen.pixels;
        let rows: Vec<(&str, Vec<f32>)> = [
            Some(("recovered", found.movie.clone())),
            self.measured
                .movie
                .as_ref()
                .map(|movie| ("truth", movie.iter().map(|x| *x as f32).collect())),
        ]
        .into_iter()
        .flatten()
        .collect();
        figures.push(report::frames(&rows, n, &self.measured.times)?);
        Ok(figures)
    }

    fn view(&self, found: &Found<'_>) -> View3d {
        let (r_min, r_max) = (self.file.region.r_min, self.file.region.r_max);
        let rates = report::rates(&self.motion.velocity, [r_min.max(1e-3), r_max]);
        let times = &self.measured.times;
        let ends = [times.first(), times.last()].map(|time| time.copied().unwrap_or(0.0));
        View3d {
            recovered: found.volume.clone(),
            truth: found.true_volume.clone(),
            unit: UNIT.to_owned(),
            motion: (ends[1] > ends[0]).then(|| report::Motion {
                axis: found.state.now.axis.vector(),
                rates,
                times: ends,
                reference: self.motion.reference,
                time_unit: "GM/c³".to_owned(),
            }),
            hole_radius: self.instrument.hole.horizon(),
            r_max,
        }
    }

    fn summary(&self, results: &Value) -> Vec<String> {
        let file = self.file;
        let data: Vec<String> = file.loss.iter().map(|l| format!("{:?}", l.data)).collect();
        let number = |key: &str| results[key].as_f64();
        let mut lines = vec![format!(
            "Emission around a black hole of spin {} seen at {}° was recovered from {} frames ({}), as {:?}.",
            file.hole.spin,
            file.observer.inclination_deg,
            self.measured.times.len(),
            data.join(", "),
            file.representation.kind
        )];
        if let Some(chi2) = results["chi2_per_datum"].as_object() {
            let each = chi2.iter().map(|(name, value)| {
                format!("{name}: χ² a datum {:.4}", value.as_f64().unwrap_or(f64::NAN))
            });
            lines.push(format!(
                "{}. Data with honest errors have about 1 where the model is right.",
                each.collect::<Vec<_>>().join("; ")
            ));
        }
        if let (Some(psnr), Some(nrmse)) = (number("psnr_db"), number("nrmse")) {
            lines.push(format!(
                "Beside the truth the volume has a peak signal-to-noise ratio of {psnr:.2} dB and a relative error of {nrmse:.3} (an empty volume has 1)."
            ));
        }
        if !matches!(file.axis, AxisSearch::Known {})
            && let Some(dot) = number("axis_dot_truth")
        {
            let angle = dot.clamp(-1.0, 1.0).acos().to_degrees();
            lines.push(format!("The axis that matter turns about was learnt: {angle:.2}° from the true one (cosine {dot:.5})."));
        }
        lines
    }

    fn settings(&self) -> anyhow::Result<Vec<report::Setting>> {
        let table = toml::Table::try_from(self.file).context("settings")?;
        let mut all = Vec::new();
        flatten("", &toml::Value::Table(table), &mut all);
        Ok(all)
    }

    fn light_curve(&self, movie: &[f32]) -> LinePlot {
        let n = self.file.screen.pixels;
        let flux = |image: &[f32]| image.iter().map(|x| f64::from(*x)).sum::<f64>();
        let times = &self.measured.times;
        let points = |fluxes: Vec<f64>| times.iter().zip(fluxes).map(|(t, f)| [*t, f]).collect();
        let mut series = vec![Series {
            name: "recovered".to_owned(),
            points: points(movie.chunks(n * n).map(flux).collect()),
            errors: Vec::new(),
            marks: Marks::Line,
        }];
        if let Some(truth) = &self.measured.movie {
            series.push(Series {
                name: "truth".to_owned(),
                points: points(truth.chunks(n * n).map(|image| image.iter().sum()).collect()),
                errors: Vec::new(),
                marks: Marks::Points,
            });
        }
        LinePlot {
            title: "Light curve".to_owned(),
            caption: "Total flux of each frame.".to_owned(),
            x: Axis { label: "time".to_owned(), unit: "GM/c³".to_owned(), log: false },
            y: Axis { label: "flux".to_owned(), unit: "Jy".to_owned(), log: false },
            series,
        }
    }

    /// Amplitudes of the data and of the model, with the data's errors.
    fn amplitudes(&self, movie: &[f32]) -> anyhow::Result<Option<LinePlot>> {
        let Some((observation, frames)) = &self.measured.visibilities else { return Ok(None) };
        let sky = self.measured.sky.ok_or_else(|| anyhow!("no sky"))?;
        let rows = || {
            observation.rows.iter().zip(frames).filter_map(|(row, frame)| {
                row.stokes_i(observation.basis).map(|i| (row, *frame, i))
            })
        };
        let mut uv = vec![Vec::new(); self.measured.times.len()];
        rows().for_each(|(row, frame, _)| uv[frame].push(row.uv));
        let transform = Transform::<f32>::new(sky, Pulse::Triangle, &uv, Method::Direct, 64 << 20)?;
        let mut model = vec![Complex::new(0.0, 0.0); transform.data()];
        transform.forward(movie, &mut model);
        // The model is in the order of frames.
        let mut order: Vec<_> = rows().collect();
        order.sort_by_key(|(_, frame, _)| *frame);
        let length = |uv: [f64; 2]| uv[0].hypot(uv[1]) * 1e-9;
        let data = order.iter().map(|(row, _, i)| [length(row.uv), i.visibility.norm()]);
        let fitted =
            order.iter().zip(&model).map(|((row, ..), v)| [length(row.uv), f64::from(v.norm())]);
        let series = vec![
            Series {
                name: "data".to_owned(),
                points: data.collect(),
                errors: order.iter().map(|(_, _, i)| i.noise_sigma).collect(),
                marks: Marks::Points,
            },
            Series {
                name: "recovered".to_owned(),
                points: fitted.collect(),
                errors: Vec::new(),
                marks: Marks::Points,
            },
        ];
        Ok(Some(LinePlot {
            title: "Visibilities".to_owned(),
            caption: "Amplitudes of all frames against the length of the projected baseline; bars are standard deviations.".to_owned(),
            x: Axis { label: "baseline".to_owned(), unit: "10⁹ wavelengths".to_owned(), log: false },
            y: Axis { label: "amplitude".to_owned(), unit: "Jy".to_owned(), log: true },
            series,
        }))
    }
}

/// What was found.
struct Found<'a> {
    volume: Volume,
    true_volume: Option<Volume>,
    loss: Loss,
    /// What the mask of what shines leaves out, of the flux; nothing without a mask.
    mask: Option<f64>,
    movie: Vec<f32>,
    state: &'a State<f32>,
    begun: Instant,
}

/// Key, digits after the point, unit and meaning of each result.
const MEANINGS: [(&str, usize, &str, &str); 9] = [
    ("loss", 6, "", "what was minimised, of all data"),
    (
        "psnr_db",
        2,
        "dB",
        "peak signal-to-noise ratio of the volume: 10 log10(largest true value² / mean square error)",
    ),
    ("psnr_inside_db", 2, "dB", "the same, of the nodes inside the region alone"),
    (
        "nrmse",
        4,
        "",
        "root mean square error over that of the truth: 0 is perfect, 1 an empty volume",
    ),
    ("correlation", 5, "", "normalised cross-correlation with the truth: 1 is perfect"),
    ("axis_dot_truth", 6, "", "cosine of the angle between the axis and the true one"),
    (
        "mask_error",
        6,
        "",
        "light that the mask of what shines leaves out, as a part of all, in two frames",
    ),
    ("steps", 0, "", "steps of the optimiser"),
    ("seconds", 1, "s", "wall time of this run"),
];

fn outcomes(results: &Value) -> Vec<report::Outcome> {
    let one = |(key, digits, unit, meaning): &(&str, usize, &str, &str)| {
        Some(report::Outcome {
            name: (*key).to_owned(),
            value: format!("{:.*}", *digits, results[*key].as_f64()?),
            unit: (*unit).to_owned(),
            meaning: (*meaning).to_owned(),
        })
    };
    MEANINGS.iter().filter_map(one).collect()
}

/// `a.b = value` of every leaf.
fn flatten(prefix: &str, value: &toml::Value, all: &mut Vec<report::Setting>) {
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
        leaf => all.push(report::Setting {
            key: prefix.to_owned(),
            value: leaf.to_string(),
            unit: String::new(),
        }),
    }
}

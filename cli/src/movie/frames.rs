//! The numbered files of a film: which are there, which are to be written.

use crate::output::{self, Output};
use crate::render::exr_options::ExrOptions;
use crate::render::report;
use crate::render::source::at_time;
use anyhow::{Context, bail};
use kerrlight_render::image::Picture;
use kerrlight_render::image::exr::{self, Attributes, Style};
use kerrlight_render::picture::Rendered;
use kerrlight_render::picture::{Frame, Raster};
use kerrlight_render::scene::Scene;
use rayon::prelude::*;
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A film's frames.
pub struct Sequence {
    folder: PathBuf,
    plans: Vec<Plan>,
    /// Those that are wanted of all.
    part: Range<usize>,
    /// Mask of the frames that are there.
    done: Vec<bool>,
    /// Fluxes of those that are there, with their unit.
    fluxes: Vec<Option<(f64, String)>>,
    /// Rays of those that are there which were given up.
    unresolved: Vec<u64>,
    /// Factor from the scene's unit of intensity, that of the first frame.
    factor: Option<f64>,
    /// Lengths and checksums of the files that the scene names.
    files: String,
    /// The device that traces rays, if it is not this processor.
    device: String,
    /// Form of the files.
    style: FrameStyle,
}

/// Origin of a film.
pub struct Origin<'a> {
    /// Name of its scene in messages.
    pub name: &'a str,
    /// The scene's text.
    pub text: &'a str,
    /// Lengths and checksums of the files that the scene names.
    pub files: &'a str,
    /// The device that traces rays; nothing for this processor.
    pub device: &'a str,
    /// Form of the files.
    pub style: FrameStyle,
}

/// Form of a film's files.
#[derive(Clone, Copy)]
pub struct FrameStyle {
    pub exr: ExrOptions,
    /// Frames a second, told in the header.
    pub per_second: u16,
}

/// A frame to be.
struct Plan {
    scene: Scene,
    /// The scene's text with the frame's time in it.
    text: String,
}

impl Sequence {
    /// The frames at `times`, of which a part is wanted, in `folder`, which is made if it is not there.
    pub fn new(
        folder: &Path,
        of: &Origin<'_>,
        times: &[f64],
        part: &RangeInclusive<u32>,
    ) -> anyhow::Result<Self> {
        let Origin { name, text, files, device, style } = of;
        let plan = |time: &f64| -> anyhow::Result<Plan> {
            let (scene, text) = at_time(name, text, *time)?;
            Ok(Plan { scene, text })
        };
        let plans: Vec<Plan> = times.iter().map(plan).collect::<Result<_, _>>()?;
        if folder.exists() && !folder.is_dir() {
            bail!("output {} is not a folder", folder.display());
        }
        let done = vec![false; plans.len()];
        let [files, device] = [*files, *device].map(str::to_owned);
        let folder = folder.to_owned();
        let (fluxes, unresolved) = (vec![None; plans.len()], vec![0; plans.len()]);
        let part = *part.start() as usize..*part.end() as usize + 1;
        let (factor, style) = (None, *style);
        Ok(Sequence { folder, plans, part, done, fluxes, unresolved, factor, files, device, style })
    }

    /// Looks which frames are there. Frames with other settings, or beyond the last, are errors:
    /// nothing is written over, and no film is made of two.
    pub fn find(&mut self) -> anyhow::Result<()> {
        let folder = self.folder.display().to_string();
        std::fs::create_dir_all(&self.folder).with_context(|| format!("cannot make {folder}"))?;
        self.refuse_others()?;
        let is_frame = |name: &str| number_of(name, "exr").or(number_of(name, "png")).is_some();
        output::sweep(&self.folder, is_frame);
        // The first frame has the scale of all.
        let first = (self.part.start > 0).then_some(0);
        for k in first.into_iter().chain(self.part.clone()) {
            let Some(attributes) = self.known(k)? else { continue };
            self.done[k] = true;
            self.fluxes[k] = flux_of(&attributes);
            self.unresolved[k] = number(&attributes, "unresolved_rays").unwrap_or(0);
            if k == 0 {
                self.factor = number(&attributes, FACTOR);
            }
        }
        Ok(())
    }

    /// The attributes of a frame that is there, which has to be one of this film.
    fn known(&self, k: usize) -> anyhow::Result<Option<Attributes>> {
        let path = self.path(k, "exr");
        if !path.exists() {
            return Ok(None);
        }
        let shown = path.display().to_string();
        let (_, attributes) = exr::decode(&output::read(&path)?).with_context(|| shown.clone())?;
        if let Some(name) = differs(&self.settings(k), &attributes) {
            bail!(
                "{shown} is a frame with other settings ({name} differs): give another folder \
                 or remove the frames in {}",
                self.folder.display()
            );
        }
        Ok(Some(attributes))
    }

    /// Refuses frames that this film does not have.
    fn refuse_others(&self) -> anyhow::Result<()> {
        let shown = || format!("cannot read {}", self.folder.display());
        for entry in std::fs::read_dir(&self.folder).with_context(shown)? {
            let name = entry.with_context(shown)?.file_name();
            let number = name.to_str().and_then(|name| number_of(name, "exr"));
            if number.is_some_and(|k| k >= self.plans.len()) {
                bail!(
                    "{} holds {}, but this film has {} frames: give another folder or remove it",
                    self.folder.display(),
                    name.display(),
                    self.plans.len()
                );
            }
        }
        Ok(())
    }

    /// Refuses to take the place of a file that is read.
    pub fn spare(&self, input: &Path) -> anyhow::Result<()> {
        let Ok(input) = input.canonicalize() else { return Ok(()) };
        let same = |k: usize| self.path(k, "exr").canonicalize().is_ok_and(|path| path == input);
        if (0..self.plans.len()).any(same) {
            bail!("{} is an input and would be lost: give another folder", input.display());
        }
        Ok(())
    }

    /// Returns the path of a frame.
    pub fn path(&self, k: usize, extension: &str) -> PathBuf {
        self.folder.join(format!("frame_{k:04}.{extension}"))
    }

    /// The frames that are wanted.
    pub fn wanted(&self) -> Range<usize> {
        self.part.clone()
    }

    /// Those of them that are not there yet.
    pub fn missing(&self) -> Vec<usize> {
        self.wanted().filter(|k| !self.done[*k]).collect()
    }

    /// Returns whether the first frame, which no batch begins with, is needed for its scale.
    pub fn lacks_scale(&self) -> bool {
        let is_scaled = self.plans.first().is_some_and(|p| p.scene.screen.total_flux_jy.is_some());
        is_scaled && self.factor.is_none() && self.missing().first().is_some_and(|k| *k > 0)
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.plans.len()
    }

    /// Least and largest flux of the frames, with their unit.
    pub fn fluxes(&self) -> Option<(f64, f64, &str)> {
        let mut known = self.fluxes[self.wanted()].iter().flatten();
        let (first, unit) = known.next()?;
        let (least, most) =
            known.fold((*first, *first), |(least, most), (x, _)| (least.min(*x), most.max(*x)));
        Some((least, most, unit))
    }

    /// Rays of some frames that were given up.
    pub fn unresolved(&self, frames: &[usize]) -> u64 {
        frames.iter().map(|k| self.unresolved[*k]).sum()
    }

    /// Gives all frames the scale of this one.
    pub fn scale_like(&mut self, film: &Raster, first: &Frame) -> anyhow::Result<()> {
        self.factor = Some(film.unit_factor(first)?);
        Ok(())
    }

    /// Rows of a frame.
    pub fn height(&self) -> usize {
        self.plans.first().map_or(0, |plan| plan.scene.screen.rows() as usize)
    }

    /// Time of a frame in M.
    pub fn time(&self, k: usize) -> f64 {
        self.plans[k].scene.observer.time
    }

    /// A frame that is there.
    pub fn read(&self, k: usize) -> anyhow::Result<Picture> {
        let path = self.path(k, "exr");
        let decoded = exr::decode(&output::read(&path)?);
        Ok(decoded.with_context(|| path.display().to_string())?.0)
    }

    /// Writes a batch of frames. What is scaled to Jy is scaled by the first frame's factor.
    pub fn write(
        &mut self,
        film: &Raster,
        batch: &[usize],
        frames: Vec<Frame>,
    ) -> anyhow::Result<()> {
        if let (None, Some(first)) = (self.factor, frames.first()) {
            self.scale_like(film, first)?;
        }
        let factor = self.factor.context("the film has no unit of intensity")?;
        let this: &Sequence = self;
        let written = batch.par_iter().zip(frames).map(|(k, frame)| -> anyhow::Result<_> {
            let style = this.style.exr.style(film.camera_of(&frame)?);
            let style = Style { frames_per_second: Some(this.style.per_second), ..style };
            let Rendered { picture, summary } = film.rendered(frame, factor)?;
            let Plan { scene, text } = &this.plans[*k];
            let mut attributes = report::attributes(scene, text, "", film, &summary);
            attributes.append(&mut this.settings(*k));
            let bytes = exr::encode(&picture, &attributes, style);
            let bytes = bytes.context("cannot encode the EXR")?;
            // Another process may have written it since these began: the same, or a frame of another film.
            if this.known(*k)?.is_some() {
                return Ok(summary);
            }
            Output::new(&this.path(*k, "exr"), "exr")?.write(&bytes)?;
            Ok(summary)
        });
        let summaries = written.collect::<anyhow::Result<Vec<_>>>()?;
        for (k, summary) in batch.iter().zip(summaries) {
            self.done[*k] = true;
            self.fluxes[*k] = Some((summary.flux, summary.flux_unit.to_owned()));
            self.unresolved[*k] = summary.unresolved;
        }
        Ok(())
    }

    /// Returns the settings that decide a frame.
    fn settings(&self, k: usize) -> Attributes {
        let scene = &self.plans[k].scene;
        let minutes = scene.hole.seconds().map(|unit| scene.observer.time * unit / 60.0);
        let entry = |name: &str, value: String| (name.to_owned(), value);
        let mut settings = Attributes::from([
            entry("version", env!("CARGO_PKG_VERSION").to_owned()),
            entry("scene_resolved", scene.to_toml()),
            entry("frame", k.to_string()),
            entry("frames", self.plans.len().to_string()),
            entry("frame_time_m", scene.observer.time.to_string()),
            entry("frame_options", self.style.exr.to_string()),
        ]);
        settings.extend(minutes.map(|minutes| entry("frame_time_min", minutes.to_string())));
        if !self.files.is_empty() {
            settings.insert("frame_files".to_owned(), self.files.clone());
        }
        if !self.device.is_empty() {
            settings.insert("device".to_owned(), self.device.clone());
        }
        settings
    }
}

/// The number of the frame that a name stands for.
fn number_of(name: &str, extension: &str) -> Option<usize> {
    let number = name.strip_prefix("frame_")?.strip_suffix(extension)?.strip_suffix('.')?;
    number.parse().ok()
}

/// The first setting that a file does not have or has otherwise.
fn differs(settings: &Attributes, attributes: &Attributes) -> Option<String> {
    let other = |name: &&str| attributes.get(*name) != settings.get(*name);
    // Frames of this processor name no device.
    settings.keys().map(String::as_str).chain(["device"]).find(other).map(str::to_owned)
}

fn flux_of(attributes: &Attributes) -> Option<(f64, String)> {
    Some((number(attributes, "flux")?, attributes.get("flux_unit")?.clone()))
}

/// The attribute of a frame's scale.
const FACTOR: &str = "intensity_per_scene_unit";

fn number<T: FromStr>(attributes: &Attributes, name: &str) -> Option<T> {
    attributes.get(name)?.parse().ok()
}

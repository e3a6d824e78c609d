//! Sources of scenes.

use crate::changed::{self, Changed};
use crate::output;
use crate::paths;
use anyhow::Context;
use kerrlight_render::Error;
use kerrlight_render::image::exr;
use kerrlight_render::scene::{Scene, SceneError, apply_override};
use std::path::{Path, PathBuf};

/// The scene that is rendered when none is given.
pub const BUILT_IN: &str = include_str!("../built_in_scene.toml");

/// A scene with where it came from.
#[derive(Debug)]
pub struct Source {
    pub text: String,
    /// Name in messages.
    pub name: String,
    /// Folder from which relative paths in it start.
    pub folder: PathBuf,
    /// Identity of the files that it named, where it comes from a picture.
    pub files: Option<String>,
}

impl Source {
    /// The built-in scene.
    pub fn built_in() -> Self {
        let name = "built-in scene".to_owned();
        let (text, folder) = (BUILT_IN.to_owned(), PathBuf::from("."));
        Source { text, name, folder, files: None }
    }

    /// The scene of a file, or the built-in one.
    pub fn new(path: Option<&Path>) -> anyhow::Result<Self> {
        let Some(path) = path else {
            eprintln!("rendering the built-in scene: Sgr A* with a flare and a disc");
            return Ok(Source::built_in());
        };
        let name = path.display().to_string();
        let folder = path.parent().unwrap_or(Path::new(".")).to_owned();
        if paths::ending(path) != "exr" {
            return Ok(Source { text: output::read_text(path)?, name, folder, files: None });
        }
        let (text, files) = scene_of_exr(path)?;
        Ok(Source { text, name, folder, files })
    }

    /// Warns where files that the scene of a picture names are not those that the picture was made of.
    pub fn compare(&self, identity: &str) {
        if self.files.as_ref().is_some_and(|files| files != identity) {
            eprintln!(
                "warning: files of the scene have changed since {} was rendered: the picture will differ",
                self.name
            );
        }
    }

    /// The scene with all overrides, and its text.
    pub fn scene(&self, overrides: &[String]) -> anyhow::Result<(String, Scene)> {
        let mut text = self.text.clone();
        for assignment in overrides {
            let assignment = paths::from_here(assignment, Some(&self.folder))?;
            text = apply_override(&text, &assignment).map_err(|error| match error {
                // Not the override's fault.
                Error::Scene(SceneError::Syntax(_)) => {
                    anyhow::Error::new(error).context(self.name.clone())
                }
                _ => anyhow::Error::new(error).context("--set"),
            })?;
        }
        let by = changed::assignments(overrides);
        let changed = Changed { name: &self.name, own: &self.text, text: &text, by: &by };
        let scene = changed.read(|text| Ok(Scene::parse(text)?), Into::into)?;
        Ok((text, scene))
    }
}

/// The scene of a picture or of a film's frame, and what tells the files that it named from others.
fn scene_of_exr(path: &Path) -> anyhow::Result<(String, Option<String>)> {
    let name = || path.display().to_string();
    let file = output::open(path)?;
    let attributes = exr::decode_attributes(file).with_context(name)?;
    let scene = attributes.get("scene").cloned();
    let scene = scene.with_context(|| format!("{} holds no scene of kerrlight", name()))?;
    if attributes.contains_key("frame") && scene.contains("total_flux_jy") {
        eprintln!(
            "warning: {}: frames of a film share the scale of the first; this picture has one of its own",
            name()
        );
    }
    let files = attributes.get("files").or(attributes.get("frame_files"));
    Ok((scene, files.cloned()))
}

/// The scene of a text at a time of observation, M, and its text.
pub fn at_time(name: &str, text: &str, time: f64) -> anyhow::Result<(Scene, String)> {
    // `:?` writes whole numbers with a point, so that TOML reads a float.
    let text = apply_override(text, &format!("observer.time={time:?}"))?;
    let scene = Scene::parse(&text).map_err(Error::without_line);
    let scene = scene.with_context(|| format!("{name} at the time {time} of a frame"))?;
    Ok((scene, text))
}

//! Where a scene comes from.

use crate::output;
use anyhow::Context;
use kerrlight_tomo::image::exr;
use kerrlight_tomo::scene::{Scene, SceneError, apply_override};
use std::path::{Path, PathBuf};

/// The scene that is rendered when none is given.
const BUILT_IN: &str = include_str!("../built_in_scene.toml");

/// A scene with where it came from.
pub struct Source {
    pub text: String,
    /// What it is called in messages.
    pub name: String,
    /// What relative paths in it are relative to.
    pub folder: PathBuf,
}

impl Source {
    /// The scene of a file, or the built-in one.
    pub fn new(path: Option<&Path>) -> anyhow::Result<Self> {
        let Some(path) = path else {
            eprintln!("rendering the built-in scene: Sgr A* with a flare and a disc");
            let name = "built-in scene".to_owned();
            return Ok(Source { text: BUILT_IN.to_owned(), name, folder: PathBuf::from(".") });
        };
        let name = path.display().to_string();
        let folder = path.parent().unwrap_or(Path::new(".")).to_owned();
        let is_exr = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("exr"));
        let text = if is_exr { scene_of_exr(path)? } else { output::read_text(path)? };
        Ok(Source { text, name, folder })
    }

    /// The scene with all overrides, and its text.
    pub fn scene(&self, overrides: &[String]) -> anyhow::Result<(String, Scene)> {
        let mut text = self.text.clone();
        if overrides.is_empty() {
            let scene = Scene::parse(&text).with_context(|| self.name.clone())?;
            return Ok((text, scene));
        }
        for assignment in overrides {
            text = apply_override(&text, assignment).map_err(|error| match error {
                // Not the override's fault.
                SceneError::Syntax(_) => anyhow::Error::new(error).context(self.name.clone()),
                _ => anyhow::Error::new(error).context("--set"),
            })?;
        }
        // Lines of the changed text are nobody's.
        let scene = Scene::parse(&text)
            .map_err(SceneError::without_line)
            .with_context(|| format!("{} with --set {}", self.name, overrides.join(" --set ")))?;
        Ok((text, scene))
    }
}

fn scene_of_exr(path: &Path) -> anyhow::Result<String> {
    let name = || path.display().to_string();
    let file = output::open(path)?;
    let attributes = exr::decode_attributes(file).with_context(name)?;
    let scene = attributes.get("scene").cloned();
    scene.with_context(|| format!("{} holds no scene of kerrlight", name()))
}

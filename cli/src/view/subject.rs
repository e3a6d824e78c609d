//! Subject of the page: a scene with its files, or the folder of a fit.

use super::run_folder::{self, Measured};
use crate::assets::{self, Reach};
use crate::render::source::Source;
use anyhow::Context;
use kerrlight_render::scene::Scene;
use kerrlight_render::transport::Assets;
use kerrlight_render::volume::VolumeFile;
use std::path::Path;

/// A scene with everything that the page needs of it.
pub struct Subject {
    pub scene: Scene,
    /// The text of the scene, with what was changed.
    pub text: String,
    pub assets: Assets,
    /// Words that stand behind `kerrlight render` for this scene.
    pub words: Vec<String>,
    /// Title of the page.
    pub title: String,
    /// The volume that a fit should have recovered, if it is known.
    pub truth: Option<VolumeFile>,
    /// The pictures that a fit was made of, if it was made of pictures.
    pub measured: Option<Measured>,
}

impl Subject {
    /// The scene of a file or of the folder of a fit, or the built-in one, with changes.
    pub fn open(path: Option<&Path>, overrides: &[String], reach: Reach) -> anyhow::Result<Self> {
        let run = path.filter(|path| path.is_dir());
        let within = run.map(run_folder::scene_of).transpose()?;
        let file = within.as_deref().or(path);
        let source = match file {
            Some(_) => Source::new(file)?,
            None => Source::built_in(),
        };
        let (text, scene) = source.scene(overrides)?;
        let assets = assets::load(&scene, &source.folder, &[], reach)?.decoded;
        let mut words: Vec<String> = file.map(shown).transpose()?.into_iter().collect();
        for change in overrides {
            words.extend(["--set".to_owned(), change.clone()]);
        }
        let title =
            path.map_or("Sgr A* with a flare".to_owned(), |path| path.display().to_string());
        let truth = run.map(run_folder::truth_of).transpose()?.flatten();
        let measured = run.map(|run| run_folder::measured_of(run, &scene)).transpose()?.flatten();
        Ok(Subject { scene, text, assets, words, title, truth, measured })
    }
}

fn shown(path: &Path) -> anyhow::Result<String> {
    let text = path.to_str().with_context(|| format!("{}: not a name in UTF-8", path.display()))?;
    Ok(text.to_owned())
}

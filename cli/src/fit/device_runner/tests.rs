//! A device that fails in the middle of a run.

use crate::fit::folder::Folder;
use crate::fit::inputs::Inputs;
use crate::fit::{Failed, assigned, parse, run};
use kerrlight_tomo::Error;
use kerrlight_tomo::fit::{DeviceError, Loss, Progress, StepDevice, Stretch, Taken, checkpoint};
use kerrlight_tomo::representation::Registry;
use std::path::Path;
use std::time::Duration;

/// Learns nothing, and is unplugged after some steps.
struct Unplugged {
    left: usize,
}

impl StepDevice for Unplugged {
    fn name(&self) -> &str {
        "a card"
    }
    fn makes_residuals(&self) -> bool {
        true
    }
    fn most(&self) -> usize {
        1
    }
    fn take(&mut self, stretch: &Stretch<'_>, from: &Progress<f32>) -> Result<Taken, Error> {
        if self.left == 0 {
            return Err(DeviceError("the graphics device was lost: unplugged".to_owned()).into());
        }
        self.left -= 1;
        assert_eq!((stretch.draws.len(), stretch.rates.len()), (1, 1));
        let loss = Loss { total: 1.0, terms: vec![1.0], ..Loss::default() };
        let moments = [from.adam.first.clone(), from.adam.second.clone()];
        let (parameters, losses) = (from.parameters.clone(), vec![loss]);
        Ok(Taken { parameters, moments, losses, of_axis: [0.0; 3] })
    }
}

fn settings() -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/fits/scene_1.toml");
    let mut text = std::fs::read_to_string(path).unwrap();
    for change in [
        "screen.pixels=8",
        "region.nodes={equal-mino-time={per_ray=10}}",
        "simulation.movie.frames=4",
        "representation.network.width=8",
        "training.steps=12",
        "training.batch={pixels=20}",
        "training.start=drawn",
        "training.log_every=4",
        "output.nodes=8",
    ] {
        text = assigned(&text, change).unwrap();
    }
    text
}

#[test]
fn exact_a_lost_device_leaves_a_checkpoint_that_the_processor_takes_up() {
    let (text, registry) = (settings(), Registry::default());
    let prepared = run::problem(parse(&text).unwrap(), Path::new("."), &registry).unwrap();
    let at = tempfile::tempdir().unwrap();
    let path = at.path().join("run");
    let folder = Folder::create(&path, &text, Inputs::new(&text, Vec::new())).unwrap();
    let device: crate::devices::FitDevice =
        (|_, _, _| Ok(()), Box::new(|_, _, _| Ok(Box::new(Unplugged { left: 7 }))));
    let error = run::run(&prepared, &folder, Some(device)).err().unwrap();
    let told = error.to_string();
    assert!(
        told.contains("lost: unplugged; step 7 is kept") && told.contains("--resume"),
        "{told}"
    );
    // Exit code 2, not that of a fit that has failed.
    assert!(!error.is::<Failed>());
    let bytes = folder.checkpoint().unwrap().unwrap();
    assert_eq!(checkpoint::header(&bytes).unwrap().step, 7);
    drop(folder);
    let folder = Folder::open(&path, Duration::ZERO).unwrap();
    run::run(&prepared, &folder, None).unwrap();
    let bytes = folder.checkpoint().unwrap().unwrap();
    assert_eq!(checkpoint::header(&bytes).unwrap().step, 12);
    let results = std::fs::read_to_string(folder.path().join("results.json")).unwrap();
    assert!(!results.contains("\"device\""));
}

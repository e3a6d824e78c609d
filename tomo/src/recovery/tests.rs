//! Fits as functions: stopped, resumed, simulated and read.

use super::*;
use crate::fit::BatchSize;
use crate::fit::geometry::Geometry;
use crate::fit::settings::{PriorSettings, Spot, Start, Truth};
use crate::fit::setup::{RaySampling, Resolution};
use kerrlight_vlbi::simulate::Movie;

fn settings(kind: Kind) -> FitFile {
    let spot = Spot { center: [5.0, 2.0, 0.0], sigma: 1.5, amplitude: 1.0, ..Spot::default() };
    let truth = Truth { spot: vec![spot], ..Truth::default() };
    let hole = crate::fit::settings::Hole::new(0.5);
    let mut settings =
        FitFile::new(hole, 40.0, [3.0, 9.0], kind).simulating(truth, 6, 0.0, 50.0, 1e-2);
    settings.screen.pixels = 10;
    settings.representation.linear_grid.nodes = 10;
    settings.output.nodes = 12;
    settings.training.start = Start::Drawn;
    settings.training.occupancy = None;
    settings.training.steps = 12;
    settings.training.batch = BatchSize::Frames(2);
    settings
}

/// Stops after a step, and keeps its last state.
#[derive(Default)]
struct Stopping {
    after: u64,
    kept: Option<State<f32>>,
}

impl Progress for Stopping {
    fn goes_on(&mut self, at: At) -> bool {
        !matches!(at, At::Step(step) if step >= self.after)
    }

    fn resumed(&mut self, _: &State<f32>) -> Result<Option<Resumed>, Error> {
        Ok(self.kept.take().map(|state| (state, None)))
    }

    fn save(&mut self, state: &State<f32>) -> Result<(), Error> {
        self.kept = Some(state.clone());
        Ok(())
    }
}

#[test]
fn exact_a_fit_that_was_stopped_goes_on_with_the_same_bits() {
    let problem = Problem::simulated(settings(Kind::FeatureGrid), None).unwrap();
    let whole = fit(&problem, &mut Silent).unwrap();
    let mut progress = Stopping { after: 5, kept: None };
    let error = fit(&problem, &mut progress).unwrap_err();
    assert!(matches!(error, Error::Stopped(Stopped::After(5))), "{error}");
    assert_eq!(progress.kept.as_ref().map(|state| state.now.step), Some(5));
    progress.after = u64::MAX;
    let resumed = fit(&problem, &mut progress).unwrap();
    assert_eq!(resumed.state, whole.state);
    assert_eq!(resumed.volume.values(), whole.volume.values());
}

/// Images of the simulation, read as data, are explained by the same emission.
#[test]
fn exact_images_that_are_read_are_fitted_as_those_that_are_simulated() {
    let simulated = Problem::simulated(settings(Kind::LinearGrid), None).unwrap();
    let frames = simulated.measured.movie.clone().unwrap();
    let pixels: Vec<f64> = frames.images().flat_map(|image| image.unwrap().to_vec()).collect();
    let flux = pixels.chunks(100).map(|image| image.iter().sum::<f64>()).fold(0.0, f64::max);
    let read = settings(Kind::LinearGrid).with_images(10, [0.0, 50.0], flux, 1e-2);
    let grid = kerrlight_vlbi::operator::ImageGrid::new(10, 10, 1e-10).unwrap();
    let read = Problem::of_movie(read, Movie { grid, pixels }).unwrap();
    let recovery = fit(&read, &mut Silent).unwrap();
    let again = fit(&simulated, &mut Silent).unwrap();
    let sum = |recovery: &Recovery| recovery.movie.sums().unwrap().iter().sum::<f64>();
    assert!((sum(&recovery) / sum(&again) - 1.0).abs() < 0.02);
    assert!(recovery.closeness.is_none());
    assert!((recovery.loss.total / again.loss.total - 1.0).abs() < 0.1);
}

#[test]
fn exact_settings_without_data_name_what_is_missing() {
    let hole = crate::fit::settings::Hole::new(0.5);
    let bare = FitFile::new(hole, 40.0, [3.0, 9.0], Kind::LinearGrid);
    let error = Problem::simulated(bare, None).err().unwrap().to_string();
    assert!(error.contains("truth"), "{error}");
}

/// Has found a geometry with so many voxels.
struct Chosen(usize);

impl Progress for Chosen {
    fn chosen(&mut self, _: Stage) -> Result<Option<Choice>, Error> {
        let geometry = Geometry::new(0.5, 40f64.to_radians());
        let resolution = Resolution { nodes: self.0, pixels: 10, rays: RaySampling::default() };
        Ok(Some(Choice::Geometry { geometry, resolution }))
    }
}

/// Emission is solved for with as many voxels as the data asked a search for, and no fewer than the settings say.
#[test]
fn exact_voxels_of_a_search_are_those_of_the_fit() {
    let mut settings = settings(Kind::LinearGrid);
    settings.observer.inclination_deg = PriorSettings::Uniform([30.0, 50.0]).into();
    settings.simulation.as_mut().unwrap().drawn = true;
    let problem = Problem::simulated(settings, None).unwrap();
    for (of_search, expected) in [(13, 13), (8, 10)] {
        let recovery = fit(&problem, &mut Chosen(of_search)).unwrap();
        assert_eq!(recovery.state.now.parameters.len(), expected * expected * expected);
    }
}

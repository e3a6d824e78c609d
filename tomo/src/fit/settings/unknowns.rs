//! Emission that data leave unknown, and settings that have to be given or avoided because of it.

use super::{AxisSearch, FitError, FitFile, Kind, Linear, LossKind, Start, Weight, refuse};
use crate::representation::Activation;

impl FitFile {
    /// Returns whether a minimum over the emission of voxels can be told from other stationary points.
    pub fn is_convex(&self) -> bool {
        self.instrument.as_ref().is_none_or(|i| i.gains.is_none())
            && self.loss.iter().all(|loss| loss.data.is_convex())
    }

    /// Refuses what these data cannot decide.
    ///
    /// # Errors
    /// If closure quantities alone lack a flux, a flux is given that data know, or training starts in the dark where
    /// data have no slope.
    pub fn check_unknowns(&self) -> Result<(), FitError> {
        flux(self)?;
        let dark = self.representation.kind == Kind::Grid
            && self.representation.activation == Activation::Linear
            && self.training.start == Start::Drawn;
        if dark && !self.is_convex() {
            refuse!(
                "training.start = drawn is not allowed: a grid with activation linear starts at zero emission, where {} have no gradient; use {{ linear = {{ nodes, stride, steps }} }}",
                data(self)
            );
        }
        Ok(())
    }

    /// Describes the recovered quantity, in a sentence for somebody who does not know the names.
    pub fn recovered(&self) -> &str {
        match &self.representation.kind {
            Kind::Bhnerf => {
                "a neural network on coordinates pulled back to the reference time (BH-NeRF)"
            }
            Kind::Mlp4d => "a neural network of place and time, which knows nothing of orbits",
            Kind::FeatureGrid => {
                "a small neural network on multi-resolution feature grids that move with the matter"
            }
            Kind::Grid => "values at the nodes of a grid that is carried along the orbits",
            Kind::LinearGrid if !self.is_convex() => {
                "voxel values on a grid that moves with the matter, found by descent from several starts because these data make the problem non-convex"
            }
            Kind::LinearGrid => {
                "voxel values on a grid that moves with the matter, the solution of a convex problem"
            }
            Kind::Own(name) => name,
        }
    }

    /// Describes what these data leave open, a paragraph each.
    pub fn unknowns(&self) -> Vec<String> {
        let mut all = Vec::new();
        if !knows_flux(self) {
            let from = self.linear.as_ref().and_then(|linear| linear.flux_jy);
            let from = from.map_or("where training left it".to_owned(), |flux| {
                format!("that of linear.flux_jy = {flux} Jy, from which training may have led away")
            });
            all.push(format!(
                "{} alone do not determine the flux: the brightness is {from}; PSNR and relative error depend on it, the correlation does not. Nor do they determine the position on the sky: the hole is placed at the centre of the screen",
                data(self)
            ));
        }
        if !knows_phase(self) {
            all.push(format!(
                "data without phases ({}) cannot distinguish an image from itself rotated by 180°; only orbits, lensing and Doppler shifts can",
                data(self)
            ));
        }
        all
    }
}

/// Returns whether any of the data knows the flux.
fn knows_flux(file: &FitFile) -> bool {
    file.loss.is_empty() || file.loss.iter().any(|loss| loss.data.knows_flux())
}

fn knows_phase(file: &FitFile) -> bool {
    let none = [LossKind::Amplitudes, LossKind::LogClosureAmplitudes, LossKind::LightCurve];
    file.loss.is_empty() || file.loss.iter().any(|loss| !none.contains(&loss.data))
}

fn data(file: &FitFile) -> String {
    let names: Vec<&str> = file.loss.iter().map(|loss| loss.data.label()).collect();
    names.join(" and ")
}

/// The flux is given where data do not know it, and nothing pulls it down.
fn flux(file: &FitFile) -> Result<(), FitError> {
    let given = file.linear.as_ref().and_then(|linear| linear.flux_jy);
    if let Some(flux) = given.filter(|flux| !(*flux > 0.0 && flux.is_finite())) {
        refuse!("linear.flux_jy = {flux} is not allowed: Jy above 0");
    }
    if knows_flux(file) {
        return match given {
            Some(flux) => refuse!(
                "linear.flux_jy = {flux} is not allowed: it is for closure quantities alone, and {} determine the flux",
                data(file)
            ),
            None => Ok(()),
        };
    }
    let linear = file.representation.kind == Kind::LinearGrid
        || file.training.start != Start::Drawn
        || matches!(file.axis, AxisSearch::Scan(_));
    if linear && given.is_none() {
        refuse!(
            "linear.flux_jy is missing: {} alone do not determine the flux; give the mean flux of a frame in Jy, or add a loss of amplitudes or of the light curve",
            data(file)
        );
    }
    let pulls = |linear: &Linear| linear.smoothness > 0.0 || linear.sparsity > 0.0;
    let is_chosen = file
        .held_out
        .as_ref()
        .is_some_and(|held_out| matches!(held_out.setting, Weight::Smoothness | Weight::Sparsity));
    if file.linear.as_ref().is_some_and(pulls) || is_chosen {
        refuse!(
            "linear.smoothness and linear.sparsity are not allowed with {} alone: these do not determine the flux, and penalties would drive it to 0; add a loss of amplitudes or of the light curve",
            data(file)
        );
    }
    let pulls_image = file.quiescent.is_some_and(|image| {
        [image.smoothness, image.sparsity].into_iter().flatten().any(|weight| weight > 0.0)
    });
    if pulls_image {
        refuse!(
            "quiescent.smoothness and quiescent.sparsity are not allowed with {} alone: these do not determine the flux, and penalties would drive it to 0; give 0, or add a loss of amplitudes or of the light curve",
            data(file)
        );
    }
    Ok(())
}

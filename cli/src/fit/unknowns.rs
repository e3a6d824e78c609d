//! What data do not know of the emission, and what has to be given or avoided because of it.

use super::config::{Activation, AxisSearch, FitFile, Kind, LossKind, Start};
use super::words;
use anyhow::bail;

/// Whether a minimum over the emission of voxels can be told from other stationary points.
pub fn is_convex(file: &FitFile) -> bool {
    let convex =
        |kind| matches!(kind, LossKind::Image | LossKind::Visibilities | LossKind::LightCurve);
    file.loss.iter().all(|loss| convex(loss.data))
}

/// Whether any of the data knows the flux.
fn knows_flux(file: &FitFile) -> bool {
    let closure = |kind| matches!(kind, LossKind::ClosurePhases | LossKind::LogClosureAmplitudes);
    file.loss.is_empty() || file.loss.iter().any(|loss| !closure(loss.data))
}

fn knows_phase(file: &FitFile) -> bool {
    let none = [LossKind::Amplitudes, LossKind::LogClosureAmplitudes, LossKind::LightCurve];
    file.loss.is_empty() || file.loss.iter().any(|loss| !none.contains(&loss.data))
}

fn data(file: &FitFile) -> String {
    let names: Vec<&str> = file.loss.iter().map(|loss| words::data(loss.data)).collect();
    names.join(" and ")
}

/// Refuses what these data cannot decide.
pub fn check(file: &FitFile) -> anyhow::Result<()> {
    flux(file)?;
    let dark = file.representation.kind == Kind::Grid
        && file.representation.activation == Activation::Linear
        && file.training.start == Start::Drawn;
    if dark && !is_convex(file) {
        bail!(
            "training.start = drawn is not allowed: a grid with activation linear starts in the dark, where {} have no slope; take {{ linear = {{ nodes, stride, steps }} }}",
            data(file)
        );
    }
    Ok(())
}

/// The flux is given where data do not know it, and nothing pulls it down.
fn flux(file: &FitFile) -> anyhow::Result<()> {
    let given = file.linear.as_ref().and_then(|linear| linear.flux_jy);
    if let Some(flux) = given.filter(|flux| !(*flux > 0.0 && flux.is_finite())) {
        bail!("linear.flux_jy = {flux} is not allowed: Jy above 0");
    }
    if knows_flux(file) {
        return match given {
            Some(flux) => bail!(
                "linear.flux_jy = {flux} is not allowed: it is for closure quantities alone, {} know the flux",
                data(file)
            ),
            None => Ok(()),
        };
    }
    let linear = file.representation.kind == Kind::LinearGrid
        || file.training.start != Start::Drawn
        || matches!(file.axis, AxisSearch::Scan(_));
    if linear && given.is_none() {
        bail!(
            "linear.flux_jy is missing: {} alone do not know the flux; give the mean flux of a frame in Jy, or add a loss of amplitudes or of the light curve",
            data(file)
        );
    }
    let pulls = |linear: &super::config::Linear| linear.smoothness > 0.0 || linear.sparsity > 0.0;
    if !file.regulariser.is_empty() || file.linear.as_ref().is_some_and(pulls) {
        bail!(
            "regulariser, linear.smoothness and linear.sparsity are not allowed with {} alone: these do not know the flux, and penalties would take it to 0; add a loss of amplitudes or of the light curve",
            data(file)
        );
    }
    Ok(())
}

/// What a reader has to know of what these data leave open.
pub fn stated(file: &FitFile) -> Vec<String> {
    let mut all = Vec::new();
    if !knows_flux(file) {
        let from = file.linear.as_ref().and_then(|linear| linear.flux_jy);
        let from = from.map_or("where training left it".to_owned(), |flux| {
            format!("that of linear.flux_jy = {flux} Jy, from which training may have led away")
        });
        all.push(format!(
            "{} alone do not know the flux: the brightness is {from}; PSNR and relative error depend on it, the correlation does not. They do not know where on the sky the source is either: the hole is taken to be in the middle of the screen",
            data(file)
        ));
    }
    if !knows_phase(file) {
        all.push(format!(
            "{} know no phases: an image and the same turned by 180° are alike to them, and only orbits, lensing and Doppler shifts tell those apart",
            data(file)
        ));
    }
    all
}

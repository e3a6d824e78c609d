//! Settings to raise where a fit does not explain its data, or where its sums are too coarse for them, and by how much.

use super::{Estimate, Found, quadrature};
use core::f64::consts::PI;
use kerrlight_tomo::fit::settings::{FitFile, Kind, LossKind};
use kerrlight_tomo::fit::setup::spacing;
use kerrlight_tomo::fit::verdict::Outcome;
use serde_json::Value;

/// Pixels in the shortest period of an encoding, at most.
const SHORT: f64 = 2.0;
/// Decrease of the mean loss from a third of the steps to the next one from which on more steps would help.
const FALLING: f64 = 0.03;
/// Standard deviations of the difference of two means that count as chance.
const BY_CHANCE: f64 = 2.0;
/// Lines of the log in a third, at least.
const LINES: usize = 3;

impl Estimate<'_> {
    /// Returns what to raise, in sentences.
    pub(super) fn advice(&self, found: &Found<'_>, log: &[Value]) -> Vec<String> {
        let nodes = self.file.region.nodes;
        let sums = found.quadrature.and_then(|off| quadrature::sentence(off, nodes));
        // Any fit may need finer sums; more detail is for models that explain too little.
        if found.judged.verdict.outcome != Outcome::Unexplained {
            return sums.into_iter().collect();
        }
        let losses: Vec<f64> = log.iter().filter_map(|line| line["loss"].as_f64()).collect();
        let detail = voxels(self.file).or_else(|| encoding(self.file));
        sums.into_iter().chain(detail).chain(steps(self.file, &losses)).collect()
    }
}

/// Voxels that are wider than half a pixel.
fn voxels(file: &FitFile) -> Option<String> {
    let representation = &file.representation;
    let (key, nodes) = match representation.kind {
        Kind::LinearGrid => ("linear-grid", representation.linear_grid.nodes),
        Kind::Grid => ("grid", representation.grid.nodes),
        _ => return None,
    };
    let (pixel, width) = (spacing(&file.screen).ok()?, 2.0 * file.region.r_max);
    // Nodes are one more than the intervals between them.
    let enough = (width / (0.5 * pixel)).ceil() as usize + 1;
    (nodes < enough).then(|| {
        let wide = width / (nodes - 1) as f64 / pixel;
        format!(
            "Voxels are {wide:.2} pixels wide: representation.{key}.nodes = {enough} makes them half a pixel."
        )
    })
}

/// A positional encoding whose shortest period is above two pixels: a network learns what is smaller slowly, if at all.
fn encoding(file: &FitFile) -> Option<String> {
    let representation = &file.representation;
    // Pixels are the resolution of images alone.
    let are_images = file.loss.iter().all(|loss| loss.data == LossKind::Image);
    if !are_images || !matches!(representation.kind, Kind::Bhnerf | Kind::Mlp4d) {
        return None;
    }
    let network = &representation.network;
    // The encoding has sin(2^k x/L) for k below its degree: periods of 2πL/2^k, here in pixels.
    let longest = 2.0 * PI * network.length_scale / spacing(&file.screen).ok()?;
    let shortest = longest / 2f64.powi(network.degree as i32 - 1);
    let enough = 1 + (longest / SHORT).log2().ceil().max(0.0) as usize;
    (network.degree < enough).then(|| {
        format!(
            "The shortest period of the network's encoding is {shortest:.1} pixels: representation.network.degree = {enough} makes it \
             {SHORT} or less."
        )
    })
}

/// A loss that still falls, by more than it scatters from batch to batch.
fn steps(file: &FitFile, losses: &[f64]) -> Option<String> {
    let third = losses.len() / 3;
    if third < LINES {
        return None;
    }
    let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len() as f64;
    let variance = |all: &[f64]| {
        let about = mean(all);
        // That of the mean: the variance of one loss over their number.
        all.iter().map(|x| (x - about).powi(2)).sum::<f64>() / ((third - 1) * third) as f64
    };
    let (before, last) = losses[losses.len() - 2 * third..].split_at(third);
    let chance = BY_CHANCE * (variance(before) + variance(last)).sqrt();
    let fall = 1.0 - mean(last) / mean(before);
    (fall > FALLING && mean(before) - mean(last) > chance).then(|| {
        format!(
            "The loss fell by {:.0} % over the last third of the steps: training.steps = {} takes it further.",
            100.0 * fall,
            2 * file.training.steps
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::built_in_with;

    #[test]
    fn exact_wide_voxels_are_named_with_their_number() {
        let of = |nodes: &str| {
            voxels(&built_in_with(&[
                "representation=linear-grid",
                nodes,
                "screen.pixels=32",
                "screen.width=26",
                "region.r_max=13",
            ]))
        };
        let said = of("representation.linear-grid.nodes=33").unwrap();
        assert!(said.contains("1.00 pixels wide") && said.contains("nodes = 65 "), "{said}");
        assert_eq!(of("representation.linear-grid.nodes=65"), None);
    }

    /// 2π · 2 M/2² in pixels of 26/32 M.
    #[test]
    fn exact_long_periods_are_named_with_their_degree() {
        let of = |kind: &str, degree: &str| {
            let loss = "loss=[{data=\"image\",weight=1.0}]";
            encoding(&built_in_with(&[kind, degree, loss, "screen.pixels=32", "screen.width=26"]))
        };
        let [three, four] = [3, 4].map(|degree| format!("representation.network.degree={degree}"));
        for kind in ["representation=bhnerf", "representation=mlp4d"] {
            let said = of(kind, &three).unwrap();
            assert!(said.contains("is 3.9 pixels") && said.contains("degree = 4 "), "{said}");
            assert_eq!(of(kind, &four), None);
        }
        assert_eq!(of("representation=grid", &three), None);
        // The built-in fit is one of visibilities.
        assert_eq!(encoding(&built_in_with(&["representation=bhnerf", &three])), None);
    }

    #[test]
    fn exact_a_loss_that_falls_is_named() {
        let file = built_in_with(&["training.steps=400"]);
        let falling: Vec<f64> = (0..12).map(|k| 2.0 - 0.05 * f64::from(k)).collect();
        let said = steps(&file, &falling).unwrap();
        // From the mean of 1.725 to that of 1.525.
        assert!(said.contains("by 12 %") && said.contains("training.steps = 800"), "{said}");
        assert_eq!(steps(&file, &[1.0, 1.1, 0.9].repeat(4)), None);
        assert_eq!(steps(&file, &falling[..8]), None);
    }
}

//! Bounds that what was recovered has run into: the largest emission that it may have, and the edges of its region.

use super::{Estimate, Quiescent};
use kerrlight_render::volume::Volume;
use kerrlight_tomo::fit::settings::{FitFile, Kind};
use kerrlight_tomo::recovery::short;
use kerrlight_tomo::representation::Activation;
use serde::Serialize;

/// Part of the largest emission from which on a node is taken to have reached it: a sigmoid never does.
const REACHED: f64 = 0.95;
/// Nodes, or pixels, that may reach it.
const HANDFUL: usize = 8;
/// Part of the light that may be there.
const LIGHT: f64 = 0.01;

/// Thickness of an edge, over the region's extent, and in nodes of the volume.
const EDGE: f64 = 0.05;
const NODES: f64 = 1.5;
/// A thicker one, over the region's radius, is none.
const THICK: f64 = 0.2;
/// Part of the largest emission that is found at an edge where light is cut off: noise is fainter.
const BRIGHT: f64 = 0.5;
/// Part of the light that is found there.
const CUT: f64 = 0.02;

/// Factors by which a ceiling and a region that were reached become larger in what is advised.
const TENFOLD: f64 = 10.0;
const WIDER: f64 = 1.5;

/// A bound that was reached.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reached {
    /// The key of the setting.
    bound: &'static str,
    /// Its value.
    value: f64,
    /// Number of nodes or pixels at the ceiling.
    #[serde(skip_serializing_if = "Option::is_none")]
    count: Option<usize>,
    /// Part of the light that is there.
    light: f64,
}

impl Estimate<'_> {
    /// Every bound that was reached, with the part of the light that is there.
    pub fn bounds(
        &self,
        volume: &Volume,
        parameters: &[f32],
        quiescent: Option<&Quiescent>,
    ) -> Vec<Reached> {
        let file = self.file;
        let ceiling = ceiling(file).and_then(|(key, most)| {
            // Splines lie below the numbers of their nodes.
            let solved = file.representation.kind == Kind::LinearGrid && file.quiescent.is_none();
            let values = if solved { parameters } else { volume.values() };
            reached(key, most, values, HANDFUL)
        });
        let still = file.quiescent.as_ref().and_then(|settings| {
            let (values, is_flux) = quiescent?.values();
            let unit = if is_flux { 1.0 } else { file.screen.jy_per_pixel };
            // A light curve has one value for each of its Stokes parameters.
            let passed = if is_flux { 0 } else { HANDFUL };
            reached("quiescent.upper", settings.upper * unit, &values, passed)
        });
        // A simulation says where its light ends.
        let edges = if file.data.is_some() { edges(file, volume) } else { Vec::new() };
        ceiling.into_iter().chain(still).chain(edges).collect()
    }
}

/// The largest emission that a representation may have, and what sets it.
fn ceiling(file: &FitFile) -> Option<(&'static str, f64)> {
    let representation = &file.representation;
    match (&representation.kind, representation.activation) {
        (Kind::Own(_), _) => None,
        (Kind::LinearGrid, _) => Some(("linear.upper", file.linear.as_ref()?.upper)),
        (_, Activation::Sigmoid) => Some(("representation.activation", 1.0)),
        _ => None,
    }
}

/// Returns a bound that more than `passed` values have reached.
fn reached(bound: &'static str, most: f64, values: &[f32], passed: usize) -> Option<Reached> {
    // Q and U of a quiescent image have either sign.
    let sizes = || values.iter().map(|x| f64::from(x.abs()));
    let at = || sizes().filter(|x| *x >= REACHED * most);
    let (count, light) = (at().count(), at().sum::<f64>() / sizes().sum::<f64>());
    let is_told = count > passed && light > LIGHT;
    is_told.then_some(Reached { bound, value: most, count: Some(count), light })
}

/// Edges of the region at which light does not end.
fn edges(file: &FitFile, volume: &Volume) -> Vec<Reached> {
    let region = &file.region;
    let thickness = (EDGE * (region.r_max - region.r_min)).max(NODES * volume.finest());
    if thickness > THICK * region.r_max {
        return Vec::new();
    }
    let node = |(k, value): (usize, &f32)| {
        let [x, y, z] = volume.position(k);
        ([x.hypot(y).hypot(z), z.abs()], f64::from(value.max(0.0)))
    };
    let nodes: Vec<([f64; 2], f64)> = volume.values().iter().enumerate().map(node).collect();
    let brightest = nodes.iter().map(|(_, value)| *value).fold(0.0, f64::max);
    let light: f64 = nodes.iter().map(|(_, value)| value).sum();
    let edge = |bound: &'static str, value: f64, inside: &dyn Fn([f64; 2]) -> f64| {
        let there = || nodes.iter().filter(|(place, _)| inside(*place) < thickness);
        let most = there().map(|(_, value)| *value).fold(0.0, f64::max);
        let part = there().map(|(_, value)| value).sum::<f64>() / light;
        let is_cut = most > BRIGHT * brightest && part > CUT;
        is_cut.then_some(Reached { bound, value, count: None, light: part })
    };
    let (r_min, r_max) = (region.r_min, region.r_max);
    // A slab that holds the whole sphere has no edge of its own.
    let z_width = region.z_width.filter(|z| *z < r_max).unwrap_or(f64::INFINITY);
    [
        edge("region.r_min", r_min, &|[r, _]| r - r_min),
        edge("region.r_max", r_max, &|[r, _]| r_max - r),
        edge("region.z_width", z_width, &|[_, z]| z_width - z),
    ]
    .into_iter()
    .flatten()
    .collect()
}

impl Reached {
    /// Says so.
    pub fn sentence(&self) -> String {
        let Reached { bound: key, value, count, light } = self;
        let percent = 100.0 * light;
        let advice = match *key {
            "representation.activation" => {
                "the largest that a sigmoid allows: take activation = \"softplus\", or a larger screen.jy_per_pixel"
            }
            "linear.upper" | "quiescent.upper" => {
                &format!("the largest that is allowed: raise it to {}", short(TENFOLD * value))
            }
            _ => {
                let further = if *key == "region.r_min" { value / WIDER } else { value * WIDER };
                return format!(
                    "{percent:.0} % of the light lies at the edge of the region, {key} = {value}, and is as bright there as \
                     elsewhere: emission beyond it is missing from the model. Take {}.",
                    short(further)
                );
            }
        };
        let count = count.unwrap_or(0);
        let what = match *key {
            "quiescent.upper" if count > HANDFUL => "pixels",
            "quiescent.upper" => "fluxes",
            _ => "nodes",
        };
        let setting = if *key == "representation.activation" { "emission" } else { *key };
        format!(
            "{count} {what} with {percent:.0} % of the light are at {setting} = {value}, {advice}."
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::built_in_with;

    /// A ball of 1 M about a place at `r` on the x axis.
    fn ball(r: f64) -> Volume {
        let within = |k: usize, volume: &Volume| {
            let [x, y, z] = volume.position(k);
            if (x - r).hypot(y).hypot(z) < 1.0 { 1.0 } else { 0.01 }
        };
        let dark = Volume::new([41; 3], [-10.0; 3], [10.0; 3], vec![0.0; 41 * 41 * 41]).unwrap();
        let values = (0..41 * 41 * 41).map(|k| within(k, &dark)).collect();
        Volume::new([41; 3], [-10.0; 3], [10.0; 3], values).unwrap()
    }

    #[test]
    fn exact_light_that_is_cut_off_is_named() {
        let file = built_in_with(&["region.r_min=2", "region.r_max=10", "region.z_width=4"]);
        assert!(edges(&file, &ball(6.0)).is_empty());
        for (r, key) in [(9.8, "region.r_max"), (2.2, "region.r_min")] {
            let found = edges(&file, &ball(r));
            assert_eq!(found.len(), 1, "{found:?}");
            assert_eq!(found[0].bound, key);
            let said = found[0].sentence();
            assert!(said.contains(&format!("the edge of the region, {key} = ")), "{said:?}");
        }
    }

    #[test]
    fn exact_more_than_a_handful_at_the_ceiling_is_named() {
        let mut values = vec![0.5f32; 1000];
        values[..8].fill(0.99);
        assert_eq!(reached("representation.activation", 1.0, &values, HANDFUL), None);
        values[..100].fill(0.99);
        let found = reached("representation.activation", 1.0, &values, HANDFUL).unwrap();
        assert_eq!(found.count, Some(100));
        let said = found.sentence();
        assert!(
            said.starts_with("100 nodes with 18 % of the light are at emission = 1"),
            "{said:?}"
        );
        let kinds = ["grid", "feature-grid", "bhnerf"].map(|kind| format!("representation={kind}"));
        for kind in &kinds {
            assert_eq!(ceiling(&built_in_with(&[kind])), Some(("representation.activation", 1.0)));
            let soft = built_in_with(&[kind, "representation.activation=softplus"]);
            assert_eq!(ceiling(&soft), None);
        }
        let linear = built_in_with(&[
            "representation=linear-grid",
            "linear={upper=4.0,rounds=1,iterations=1}",
        ]);
        assert_eq!(ceiling(&linear), Some(("linear.upper", 4.0)));
    }
}

//! Matter that fills space, as the page takes it: volumes, how they turn, and spots.

use super::subject::Subject;
use kerrlight_geodesic::Kerr;
use kerrlight_render::dynamics::{AngularVelocity, Axis, Velocity};
use kerrlight_render::emission::spot::SpotModel;
use kerrlight_render::scene::{Rotation, Spot, VolumeSource};
use kerrlight_render::volume::{Volume, VolumeFile};
use serde_json::{Value, json};

/// Spots that the page has room for.
pub const SPOTS: usize = 8;

/// A volume as a texture of half floats.
pub struct Texture {
    /// `recovered` or `truth`.
    pub name: &'static str,
    volume: Volume,
    axis: [f64; 3],
    /// Emission in scene units where the texture has 1.
    pub scale: f64,
}

/// The volumes of a subject, the first of its scene and the truth, and how their matter turns; whether it falls, so that
/// there are none.
#[derive(Default)]
pub struct Volumes {
    pub textures: Vec<Texture>,
    /// The law of their motion: numbers or a table; null if they do not turn.
    pub law: Value,
    pub falls: bool,
    /// Radius in M beyond which they are dark.
    reach: f64,
}

impl Volumes {
    /// Those of a subject.
    pub fn of(subject: &Subject) -> anyhow::Result<Self> {
        let (Some(source), Some(file)) =
            (subject.scene.volume.first(), subject.assets.volumes.first())
        else {
            return Ok(Volumes::default());
        };
        let axis = source.axis.or(file.axis).unwrap_or([0.0, 0.0, 1.0]);
        let hole = Kerr::new(subject.scene.hole.spin)?;
        let turns = source.rotation.about(&hole, Axis::new(axis)?)?;
        let falls = turns.as_ref().is_some_and(|law| law.falling().is_some());
        let mut textures = Vec::new();
        if !falls {
            textures.push(Texture::new("recovered", file, axis, source.factor)?);
            let truth = subject.truth.iter();
            let truth = truth
                .map(|file| Texture::new("truth", file, file.axis.unwrap_or(axis), source.factor));
            textures.extend(truth.collect::<anyhow::Result<Vec<_>>>()?);
        }
        let corners = textures.iter().map(Texture::reach).fold(0.0, f64::max);
        let reach = source.region.map_or(corners, |region| region.r_max.min(corners));
        Ok(Volumes { law: law(source, turns.as_ref(), reach), textures, falls, reach })
    }

    /// Describes them for the page.
    pub fn described(&self) -> Value {
        self.textures.iter().map(Texture::described).collect()
    }

    /// The smallest distance of nodes, M.
    fn finest(&self) -> f64 {
        self.textures.iter().map(|texture| texture.volume.finest()).fold(f64::INFINITY, f64::min)
    }
}

/// A law that follows the spin stays a law; others become a table of radii (M) and rates (radians per M).
fn law(source: &VolumeSource, turns: Option<&AngularVelocity>, reach: f64) -> Value {
    match (&source.rotation, turns) {
        (_, None) => Value::Null,
        (Rotation::Keplerian, _) => json!({ "keplerian": {} }),
        (Rotation::Law(Velocity::Keplerian { drag }), _) => {
            json!({ "keplerian": { "drag": drag } })
        }
        (Rotation::Law(Velocity::PowerLaw { radius, rate, exponent }), _) => {
            json!({ "power": { "radius": radius, "rate": rate, "exponent": exponent } })
        }
        (_, Some(turns)) => {
            // Equal ratios, from inside any horizon to just beyond the volume.
            let ratio = (1.01 * reach.max(1.0) / 0.5).ln() / 1023.0;
            let radii: Vec<f64> = (0..1024).map(|k| 0.5 * (ratio * f64::from(k)).exp()).collect();
            let rates: Vec<f64> = radii.iter().map(|r| turns.rate(*r)).collect();
            json!({ "radii": radii, "rates": rates })
        }
    }
}

impl Texture {
    fn new(
        name: &'static str,
        file: &VolumeFile,
        axis: [f64; 3],
        factor: f64,
    ) -> anyhow::Result<Self> {
        let volume = crate::report::thinned(&file.volume)?;
        let largest = f64::from(volume.values().iter().copied().fold(0.0, f32::max));
        let axis = Axis::new(axis)?.vector();
        Ok(Texture { name, volume, axis, scale: factor * largest })
    }

    fn reach(&self) -> f64 {
        let (low, high) = (self.volume.low(), self.volume.high());
        let far = low.iter().zip(high).map(|(a, b)| a.abs().max(b.abs()).powi(2));
        far.sum::<f64>().sqrt()
    }

    fn described(&self) -> Value {
        let Texture { name, volume, axis, scale } = self;
        json!({ "name": name, "nodes": volume.nodes(), "low": volume.low(), "high": volume.high(), "axis": axis, "scale": scale })
    }

    /// Half floats, x fastest, of emission over the largest; 0 for what is below.
    pub fn bytes(&self) -> Vec<u8> {
        // A dark volume has no largest value to divide by.
        let largest = self.volume.values().iter().copied().fold(f32::MIN_POSITIVE, f32::max);
        let bytes = |value: f32| half::f16::from_f32((value / largest).max(0.0)).to_le_bytes();
        self.volume.x_fastest().flat_map(bytes).collect()
    }
}

/// Describes the spots for the page.
pub fn spots(subject: &Subject) -> anyhow::Result<Value> {
    let hole = Kerr::new(subject.scene.hole.spin)?;
    let spot = |spot: &Spot| {
        let norm = spot.axis.iter().map(|x| x * x).sum::<f64>().sqrt();
        json!({
            "start": SpotModel::new(spot, &hole).center(0.0), "axis": spot.axis.map(|x| x / norm),
            "sigma": spot.sigma, "peak": spot.peak_emissivity, "color": spot.color, "orbit": spot.radius,
            "since": spot.sheared_since,
        })
    };
    Ok(subject.scene.spot.iter().take(SPOTS).map(spot).collect())
}

/// The radius in M beyond which nothing of volumes and spots shines, the longest piece of a ray (M) of which two nodes are
/// enough, and the largest emission.
pub fn extent(subject: &Subject, volumes: &Volumes) -> [f64; 3] {
    let spots = || subject.scene.spot.iter().take(SPOTS);
    let reach = spots().map(|spot| spot.radius + 6.0 * spot.sigma).fold(volumes.reach, f64::max);
    let piece = spots().map(|spot| 0.7 * spot.sigma).fold(0.3 * volumes.finest(), f64::min);
    let largest = volumes.textures.iter().map(|texture| texture.scale);
    let most = spots().map(|spot| spot.peak_emissivity).chain(largest).fold(0.0, f64::max);
    [reach, if piece.is_finite() { piece } else { 1.0 }, if most > 0.0 { most } else { 1.0 }]
}

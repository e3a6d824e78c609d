//! Emission in 3D: data for the page's viewer.

use super::escape::escape;
use super::html::fill;
use super::pictures::encode;
use anyhow::bail;
use kerrlight_render::dynamics::AngularVelocity;
use kerrlight_render::image::colormap::Colormap;
use kerrlight_render::volume::projection::{self, Surroundings, View};
use kerrlight_render::volume::{Shown, Volume};
use serde::Serialize;
use serde_json::json;

const VIEWER: &str = include_str!("assets/viewer.html");
const SCRIPTS: [&str; 6] = [
    include_str!("assets/scene.js"),
    include_str!("assets/camera.js"),
    include_str!("assets/gpu.js"),
    include_str!("assets/software.js"),
    include_str!("assets/marks.js"),
    include_str!("assets/viewer.js"),
];

/// A volume with more nodes along an axis is sampled on as many.
const MOST_NODES: usize = 128;

/// Rotation of matter about the axis: right-handed by Ω(r)(t − t₀), r being the spherical radius.
#[derive(Debug, Clone, Serialize)]
pub struct Motion {
    /// Direction of the axis, of any length but zero.
    pub axis: [f64; 3],
    /// (r, Ω) with growing r, in M and radians a unit of time; linear in between and held beyond.
    pub rates: Vec<[f64; 2]>,
    /// First and last time of the slider.
    pub times: [f64; 2],
    /// t₀, the time of the volumes.
    pub reference: f64,
    /// The unit of time, for instance `GM/c³` or `h`.
    #[serde(rename = "unit")]
    pub time_unit: String,
}

/// Angular velocities at 200 radii between two, for [`Motion::rates`]; 0 < first < last, in M.
pub fn rates(flow: &AngularVelocity, [first, last]: [f64; 2]) -> Vec<[f64; 2]> {
    let radius = |k: u32| first + (last - first) * f64::from(k) / 199.0;
    (0..200).map(radius).map(|r| [r, flow.rate(r)]).collect()
}

/// Volumes that the viewer shows.
#[derive(Debug)]
pub struct View3d {
    /// Recovered volume.
    pub recovered: Volume,
    /// True volume, if that is known.
    pub truth: Option<Volume>,
    /// Unit of the emission.
    pub unit: String,
    /// Motion; without it there is no slider of time.
    pub motion: Option<Motion>,
    /// Radius of the outer horizon, M.
    pub hole_radius: f64,
    /// Radius of the fitted region, in M; nothing is drawn outside.
    pub r_max: f64,
}

/// One byte a node, x fastest; `scale` times the byte/255 is the emission.
fn quantised(volume: &Volume, scale: f64) -> Vec<u8> {
    let byte = |value: f32| (f64::from(value) / scale * 255.0).round().clamp(0.0, 255.0) as u8;
    volume.x_fastest().map(byte).collect()
}

/// The same volume with at most [`MOST_NODES`] nodes along each axis.
pub fn thinned(volume: &Volume) -> anyhow::Result<Volume> {
    let nodes = volume.nodes().map(|n| n.min(MOST_NODES));
    if nodes == volume.nodes() {
        return Ok(volume.clone());
    }
    let count = nodes.iter().product();
    let grid = Volume::new(nodes, volume.low(), volume.high(), vec![0.0; count])?;
    let values = (0..count).map(|k| volume.at(grid.position(k)) as f32).collect();
    Ok(Volume::new(nodes, volume.low(), volume.high(), values)?)
}

fn largest(volume: &Volume) -> f64 {
    f64::from(volume.values().iter().copied().fold(0.0, f32::max))
}

impl View3d {
    fn check(&self) -> anyhow::Result<()> {
        let allowed = |name: &str, value: f64, ok: bool, range: &str| {
            if !ok {
                bail!("{name} = {value} is not allowed: {range}");
            }
            Ok(())
        };
        let (r_max, hole) = (self.r_max, self.hole_radius);
        allowed("r_max", r_max, r_max.is_finite() && r_max > 0.0, "above 0")?;
        allowed("hole_radius", hole, (0.0..=r_max).contains(&hole), "0 to r_max")?;
        let Some(motion) = &self.motion else { return Ok(()) };
        let norm: f64 = motion.axis.iter().map(|x| x * x).sum();
        allowed("axis", norm, norm.is_finite() && norm > 0.0, "a direction")?;
        let [first, last] = motion.times;
        allowed("times", last, first.is_finite() && last.is_finite() && last > first, "growing")?;
        allowed("reference", motion.reference, motion.reference.is_finite(), "a finite number")?;
        let finite = motion.rates.iter().flatten().all(|x| x.is_finite());
        let grow = motion.rates.windows(2).all(|pair| pair[1][0] > pair[0][0]);
        let count = motion.rates.len();
        allowed("rates", count as f64, count > 0 && finite && grow, "1 or more, radii growing")
    }

    /// The viewer with its data.
    pub fn html(&self) -> anyhow::Result<String> {
        self.check()?;
        let known = [("recovered", Some(&self.recovered)), ("truth", self.truth.as_ref())];
        let known = known.into_iter().filter_map(|(name, volume)| Some((name, volume?)));
        let scale = known.clone().map(|(_, volume)| largest(volume)).fold(0.0, f64::max);
        let scale = if scale > 0.0 { scale } else { 1.0 };
        let mut volumes = Vec::new();
        for (name, volume) in known {
            let volume = thinned(volume)?;
            let bytes = base64::encode(quantised(&volume, scale));
            let (nodes, low, high) = (volume.nodes(), volume.low(), volume.high());
            volumes.push(json!({
                "name": name, "nodes": nodes, "low": low, "high": high, "bytes": bytes,
            }));
        }
        let colors: Vec<u8> = Colormap::AfmhotUs.table().into_iter().step_by(4).flatten().collect();
        let scene = json!({
            "volumes": volumes, "scale": scale, "unit": self.unit, "motion": self.motion,
            "holeRadius": self.hole_radius, "rMax": self.r_max, "colors": base64::encode(colors),
        });
        let parts = [
            ("caption", escape(&self.caption(scale))),
            ("still", base64::encode(self.still()?)),
            ("stillalt", escape("The emission from two sides, for print")),
            // Inside a script element nothing may look like its end.
            ("scene", scene.to_string().replace('<', "\\u003c")),
            ("script", SCRIPTS.concat()),
        ];
        Ok(fill(VIEWER, &parts))
    }

    /// Returns the picture of a printed page in place of the viewer: its first view, and the one from
    /// the other side.
    fn still(&self) -> anyhow::Result<Vec<u8>> {
        let mut shown = vec![Shown { name: "recovered", volume: &self.recovered }];
        shown.extend(self.truth.as_ref().map(|volume| Shown { name: "truth", volume }));
        let around = Surroundings {
            hole_radius: self.hole_radius,
            axis: self.motion.as_ref().map_or([0.0; 3], |motion| motion.axis),
            ring_radius: self.r_max,
            half_width: 1.1 * self.r_max,
        };
        let views = [40.0, 220.0].map(|azimuth| View { azimuth, elevation: 20.0 });
        encode(projection::sheet(&shown, &views, &around, &self.unit))
    }

    fn caption(&self, scale: f64) -> String {
        let (unit, hole, r_max) = (&self.unit, self.hole_radius, self.r_max);
        let mut caption = format!(
            "Emission within {r_max:.2} M, summed up along straight parallel rays: flat space, without \
             lensing, delay or Doppler shift. The ball has the radius of the horizon, {hole:.3} M, and \
             hides what is behind it; the green circle, {r_max:.2} M, lies in the hole's equatorial \
             plane."
        );
        if self.motion.is_some() {
            caption += " Matter is carried about the axis (blue line) with the angular velocity of its \
                        radius.";
        }
        let half = 0.5 * scale / 255.0;
        caption += &format!(
            " Stored in 8 bits a node: 0 to {scale:.4e} {unit}, rounded by at most {half:.1e} {unit}; \
             negative values count as 0."
        );
        let volumes = [Some(&self.recovered), self.truth.as_ref()];
        let nodes = |volume: &&Volume| volume.nodes().iter().any(|n| *n > MOST_NODES);
        if volumes.into_iter().flatten().any(|volume| nodes(&volume)) {
            caption += " Sampled on at most 128 nodes an axis.";
        }
        caption
    }
}

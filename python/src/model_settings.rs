//! Settings of a forward model.

use kerrlight_render::dynamics::{Axis, Velocity};
use kerrlight_render::polarization::{PolarizationLaw, StokesParameter};
use kerrlight_tomo::fit::{Motion, Region, Sampling, SightlineRequest};
use pyo3::prelude::*;

/// Reason why there is no such model.
pub type Refusal = Box<dyn std::error::Error + Send + Sync>;

/// Settings of a forward model, beside hole, observer and screen.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Settings {
    /// r_min, r_max and z_width, M.
    pub region: (f64, f64, f64),
    pub order: usize,
    pub split: u32,
    /// Nodes of a ray equidistant in Mino time, instead.
    pub per_ray: Option<usize>,
    pub slow_light: bool,
    pub redshift_power: Option<f64>,
    /// Motion of matter, as JSON of what files say.
    pub velocity: String,
    pub axis: [f64; 3],
    /// Times of the frames and of the field of emission, M.
    pub times: Vec<f64>,
    pub reference: f64,
    pub injection: Option<f64>,
    /// Flux of a pixel with an integral of 1.
    pub scale: f64,
    /// A law of polarised light as JSON, and the Stokes parameters that are wanted.
    pub polarization: Option<(String, Vec<String>)>,
}

impl Settings {
    pub fn request(&self) -> SightlineRequest {
        let (r_min, r_max, z_width) = self.region;
        let gauss = Sampling::Gauss { order: self.order, split: self.split };
        SightlineRequest {
            region: Region { r_min, r_max, z_width },
            sampling: self.per_ray.map_or(gauss, |per_ray| Sampling::EqualMinoTime { per_ray }),
            delay: self.slow_light,
            momentum: self.redshift_power.is_some() || self.polarization.is_some(),
        }
    }

    /// Returns the motion of matter about a hole of this spin.
    pub fn motion(&self, spin: f64, axis: Axis) -> Result<Motion, Refusal> {
        let law: Velocity =
            serde_json::from_str(&self.velocity).map_err(|e| format!("velocity: {e}"))?;
        Ok(Motion {
            // Matter that turns about a tilted axis ξ is dragged by the part a·ξ_z of the spin.
            velocity: law.angular(0, spin * axis.vector()[2])?,
            reference: self.reference,
            // `Model::weight` leaves dark what is emitted before the injection.
            injection: None,
            times: self.times.clone(),
        })
    }

    /// The law of polarised light with the wanted parameters.
    pub fn stokes(&self) -> Result<Option<(PolarizationLaw, Vec<StokesParameter>)>, Refusal> {
        let Some((law, names)) = &self.polarization else { return Ok(None) };
        if let Some(power) = self.redshift_power {
            return Err(format!(
                "redshift_power = {power} is not allowed together with polarization, whose redshift_power it is"
            )
            .into());
        }
        let law = serde_json::from_str(law).map_err(|e| format!("polarization: {e}"))?;
        Ok(Some((law, names.iter().map(|name| parameter(name)).collect::<Result<_, _>>()?)))
    }
}

fn parameter(name: &str) -> Result<StokesParameter, String> {
    let modelled = [StokesParameter::I, StokesParameter::Q, StokesParameter::U];
    modelled.into_iter().find(|known| known.name() == name).ok_or_else(|| {
        format!("stokes = \"{name}\" is not allowed: some of \"I\", \"Q\" and \"U\"")
    })
}

//! Models of the magnetic field.

use crate::Error;
use kerrlight_geodesic::ZamoFrame;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The `[magnetic_field]` of a scene: a mixture of three fields whose components are those
/// that the gas measures, as in Narayan et al. 2021 (arXiv:2105.01804) and Gelles et al. 2021
/// (arXiv:2105.09440). The unit is the scene's own.
///
/// The axes are e_r, e_θ, e_φ of the observer of zero angular momentum, boosted without
/// rotation to the gas's velocity. The three are orthogonal in the equatorial plane; off it
/// the vertical and the radial field enclose the angle θ.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MagneticField {
    /// Component along +z: cos θ e_r − sin θ e_θ.
    pub vertical: f64,
    /// Away from the hole, e_r.
    pub radial: f64,
    /// Around +z, e_φ. Not all three are 0.
    pub toroidal: f64,
}

impl MagneticField {
    /// Refuses components that are not finite or too large or small to be squared, and a field
    /// that is 0.
    ///
    /// # Errors
    /// With the key, its value and what is allowed.
    pub fn check(&self) -> Result<(), Error> {
        let components = [
            ("magnetic_field.vertical", self.vertical),
            ("magnetic_field.radial", self.radial),
            ("magnetic_field.toroidal", self.toroidal),
        ];
        for (field, value) in components {
            if value != 0.0 && !(1e-12..=1e12).contains(&value.abs()) {
                let allowed = "0, or a number of magnitude in [1e-12, 1e12]";
                return Err(Error::out_of_range(field, value, allowed));
            }
        }
        if components.iter().all(|(_, value)| *value == 0.0) {
            let allowed = "at least one of vertical, radial and toroidal is not 0";
            return Err(Error::out_of_range("magnetic_field.vertical", 0.0, allowed));
        }
        Ok(())
    }

    /// The components along e_r, e_θ, e_φ of the gas at a place, in units of the scene's field.
    pub fn at(&self, frame: &ZamoFrame) -> [f64; 3] {
        let [sin, cos] = frame.polar_angle();
        [self.radial + self.vertical * cos, -self.vertical * sin, self.toroidal]
    }
}

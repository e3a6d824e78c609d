//! Conversions between units of the hole (G = c = M = 1) and those of the sky.

/// GM☉/c³ in seconds (IAU 2015 nominal solar mass parameter, 1.3271244e20 m³ s⁻²).
pub const SOLAR_MASS_SECONDS: f64 =
    1.327_124_4e20 / (SPEED_OF_LIGHT * SPEED_OF_LIGHT * SPEED_OF_LIGHT);

/// Speed of light in m/s (exact).
pub const SPEED_OF_LIGHT: f64 = 299_792_458.0;

/// A kiloparsec in metres (IAU 2015: 648000/π astronomical units of 149 597 870 700 m).
pub const KILOPARSEC: f64 = 1e3 * 648_000.0 / core::f64::consts::PI * 149_597_870_700.0;

/// A microarcsecond in radians.
pub const MICROARCSECOND: f64 = core::f64::consts::PI / (180.0 * 3600.0 * 1e6);

/// An erg s⁻¹ cm⁻² Hz⁻¹ sr⁻¹ in Jy/µas².
pub const JY_PER_SQUARE_UAS: f64 = 1e23 * MICROARCSECOND * MICROARCSECOND;

/// M = GM/c³ in seconds for a mass in solar masses.
pub fn gravitational_time(mass_msun: f64) -> f64 {
    mass_msun * SOLAR_MASS_SECONDS
}

/// GM/(c²D) in microarcseconds for a mass in solar masses at a distance in kiloparsecs.
pub fn gravitational_angle(mass_msun: f64, distance_kpc: f64) -> f64 {
    gravitational_time(mass_msun) * SPEED_OF_LIGHT / (distance_kpc * KILOPARSEC) / MICROARCSECOND
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_sagittarius_a() {
        // GM/c³ of 4.154e6 and 4e6 solar masses; the shadow's diameter 2√27 GM/(c²D).
        assert!((gravitational_time(4.154e6) - 20.460).abs() < 1e-3);
        assert!((gravitational_time(4.0e6) - 19.702).abs() < 1e-3);
        let shadow = 2.0 * 27f64.sqrt() * gravitational_angle(4.154e6, 8.178);
        assert!((shadow - 52.1).abs() < 0.05, "{shadow}");
    }
}

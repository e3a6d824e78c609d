//! What one ray sees, and how light adds up to it.

use kerrlight_geodesic::PathPoint;

/// What became of a pixel's ray, as written into the `outcome` channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Fate {
    /// Fell into the hole (0).
    Captured = 0,
    /// Reached the sky (1).
    Escaped = 1,
    /// Met an opaque surface (2).
    Surface = 2,
    /// Was given up (3).
    #[default]
    Unresolved = 3,
}

/// What one ray sees.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Glimpse {
    /// Intensity of all emission (the sky left out), in the scene's unit.
    pub intensity: f64,
    /// Linear colour: emission and sky.
    pub rgb: [f32; 3],
    /// Intensity-weighted mean of g over the emission; 0 where there is none.
    pub redshift: f64,
    /// Number of crossings of the equatorial plane outside the horizon, along the whole ray.
    pub crossings: u32,
    /// Radius of the brightest contribution; 0 where there is none.
    pub radius: f64,
    /// Azimuth of the brightest contribution in \[−π, π\]; 0 where there is none.
    pub azimuth: f64,
    /// Delay of the brightest contribution in M; 0 where there is none.
    pub delay: f64,
    /// What became of the ray.
    pub fate: Fate,
}

impl Glimpse {
    /// Light as it is received by someone in whose frame it has `shift` times the frequency that
    /// it has at infinity: I_ν/ν³ is invariant, so that a spectrum ν^(−α) gains shift^(3 + α).
    pub(super) fn receive(&mut self, shift: f64, index: f64) {
        let boost = shift.powf(3.0 + index);
        self.intensity *= boost;
        self.redshift *= shift;
        for channel in &mut self.rgb {
            *channel *= boost as f32;
        }
    }
}

/// Light gathered along one ray.
#[derive(Clone)]
pub(super) struct Gather {
    pub intensity: f64,
    pub shift: f64,
    pub rgb: [f32; 3],
    pub brightest: f64,
    pub radius: f64,
    pub azimuth: f64,
    pub delay: f64,
}

impl Gather {
    pub fn new() -> Self {
        Gather {
            intensity: 0.0,
            shift: 0.0,
            rgb: [0.0; 3],
            brightest: 0.0,
            radius: 0.0,
            azimuth: 0.0,
            delay: 0.0,
        }
    }

    /// Adds intensity that is shifted by g.
    pub fn add(&mut self, intensity: f64, g: f64, color: [f32; 3]) {
        self.intensity += intensity;
        self.shift += g * intensity;
        for (channel, tint) in self.rgb.iter_mut().zip(color) {
            *channel += tint * intensity as f32;
        }
    }

    /// Remembers where the brightest contribution comes from.
    pub fn mark(&mut self, brightness: f64, point: &PathPoint) {
        if brightness > self.brightest {
            self.brightest = brightness;
            self.radius = point.radius();
            self.azimuth = wrap(point.azimuth);
            self.delay = point.delay;
        }
    }
}

/// Into \[−π, π\].
fn wrap(angle: f64) -> f64 {
    use core::f64::consts::TAU;
    angle - TAU * (angle / TAU).round()
}

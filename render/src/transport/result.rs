//! Result of one ray, and how light adds up to it.

use super::layers::{Origin, Record};
use kerrlight_geodesic::simd::RayNodes;
use kerrlight_geodesic::{Outcome, PathPoint, PlaneCrossing, TracedRay};

/// Result of one ray.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RayResult {
    /// Intensity of all emission (the sky left out), in the scene's unit.
    pub intensity: f64,
    /// Linear colour: emission and sky.
    pub rgb: [f32; 3],
    /// Intensity-weighted mean of g over the emission; 0 where there is none.
    pub redshift: f64,
    /// Number of crossings of the equatorial plane outside the horizon, along the whole ray.
    pub crossings: u32,
    /// Crossings of the equatorial plane that are on the disc and seen: bit n for number n, counted from 0 (bit 15 for all
    /// from there on), and bit 16 + n where its matter plunges.
    pub disc_images: u32,
    /// Radius in M of the brightest contribution; 0 where there is none.
    pub radius: f64,
    /// Azimuth in radians of the brightest contribution in \[−π, π\]; 0 where there is none.
    pub azimuth: f64,
    /// Delay of the brightest contribution in M; 0 where there is none.
    pub delay: f64,
    /// Stokes Q, U, V of the emission, in the unit of intensity; 0 without polarisation.
    pub stokes: [f64; 3],
    /// Optical depth, dimensionless, of the way to the ray's end; 0 where nothing absorbs.
    pub optical_depth: f64,
    /// Outcome of the ray.
    pub outcome: Outcome,
    /// Passage by the disc.
    pub(crate) passes: Passes,
}

/// Crossings of the equatorial plane of which is known where they pass the disc.
pub(super) const PASSES: usize = 4;

/// Passage of a ray by the disc: what lies between two rays neither of which meets it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Passes {
    /// 1/r of each crossing, from 0 at the outer edge to 1 at the inner one; that of infinity or of the horizon where the
    /// ray ends before, 0 where it is not known or hidden.
    pub places: [f32; PASSES],
    /// Number of crossings.
    pub count: u32,
}

impl Passes {
    /// Returns the crossings that pass inside and outside the disc: two bits each.
    pub fn sides(&self) -> u8 {
        let side = |place: f32| u8::from(place < 0.0) + 2 * u8::from(place > 1.0);
        self.places.iter().fold(0, |sides, place| sides << 2 | side(*place))
    }

    /// The share of the way to another ray on which images of the disc lie that neither of them meets: one at least
    /// passes inside its inner edge, the other one outside the outer edge.
    pub fn between(&self, other: &Passes) -> f64 {
        let count = self.count.max(other.count) as usize;
        let share = |(a, b): (&f32, &f32)| {
            let (low, high) = (a.min(*b), a.max(*b));
            if low < 0.0 && high > 1.0 { f64::from(1.0 / (high - low)) } else { 0.0 }
        };
        self.places.iter().zip(&other.places).take(count).map(share).sum::<f64>().min(1.0)
    }
}

impl RayResult {
    /// Light as it is received by someone in whose frame it has `shift` times the frequency that
    /// it has at infinity: I_ν/ν³ is invariant, so that a spectrum ν^(−α) gains shift^(3 + α).
    ///
    /// Returns the factor on its intensity. Never inlined: its power would be computed ahead of the question whether there
    /// is a shift.
    #[inline(never)]
    pub(super) fn receive(&mut self, shift: f64, index: f64) -> f64 {
        let boost = shift.powf(3.0 + index);
        self.intensity *= boost;
        self.redshift *= shift;
        for channel in &mut self.rgb {
            *channel *= boost as f32;
        }
        boost
    }
}

/// Light gathered along one ray.
#[derive(Clone, Default)]
pub(super) struct Accumulator {
    pub intensity: f64,
    pub shift: f64,
    pub rgb: [f32; 3],
    pub brightest: f64,
    pub place: Place,
    pub depth: f64,
    pub stokes: [f64; 3],
    pub disc_images: u32,
    pub passes: [f32; PASSES],
    /// Other layers, if any are kept.
    pub record: Option<Box<Record>>,
}

impl Accumulator {
    /// Adds intensity from a Mino time that is shifted by g.
    #[inline(always)]
    pub fn add(&mut self, intensity: f64, g: f64, color: [f32; 3], mino_time: f64) {
        self.intensity += intensity;
        self.shift += g * intensity;
        for (channel, tint) in self.rgb.iter_mut().zip(color) {
            *channel += tint * intensity as f32;
        }
        if let Some(record) = &mut self.record {
            record.add(intensity, color, mino_time);
        }
    }

    /// Adds Q, U, V of light of some intensity, for which they are `share` each.
    pub fn add_stokes(&mut self, intensity: f64, share: [f64; 3]) {
        for (sum, x) in self.stokes.iter_mut().zip(share) {
            *sum += intensity * x;
        }
    }

    /// Adds the light of the medium that is source number `source`.
    pub fn add_light(&mut self, light: &Light, color: [f32; 3], source: u32) {
        self.intensity += light.intensity;
        self.shift += light.shift;
        self.depth += light.depth;
        self.add_stokes(1.0, light.stokes);
        for (channel, tint) in self.rgb.iter_mut().zip(color) {
            *channel += tint * light.intensity as f32;
        }
        if let Some(record) = &mut self.record {
            let [first, second] = light.later;
            record.add_parts([light.intensity - first, first - second, second], color);
        }
        let mino_time = light.mino_time;
        self.mark(light.intensity, light.place, Origin { source, mino_time });
    }

    /// Returns the result of the ray whose light this is.
    #[inline(always)]
    pub fn result(&self, ray: &TracedRay) -> RayResult {
        let outcome = if ray.surface.is_some() { Outcome::Surface } else { ray.outcome };
        RayResult {
            intensity: self.intensity,
            rgb: self.rgb,
            redshift: if self.intensity > 0.0 { self.shift / self.intensity } else { 0.0 },
            crossings: ray.crossing_count,
            disc_images: self.disc_images,
            radius: self.place.radius,
            azimuth: wrap(self.place.azimuth),
            delay: self.place.delay,
            optical_depth: self.depth,
            stokes: self.stokes,
            outcome,
            passes: Passes { places: self.passes, count: ray.crossing_count },
        }
    }

    /// Adds colour from behind everything.
    pub fn add_behind(&mut self, color: [f32; 3]) {
        let through = self.through();
        for (channel, light) in self.rgb.iter_mut().zip(color) {
            *channel += through * light;
        }
        if let Some(record) = &mut self.record {
            record.sky = color.map(|light| through * light);
        }
    }

    /// Share of the light from behind everything that gets through its gas.
    pub fn through(&self) -> f32 {
        (-self.depth).exp() as f32
    }

    /// Remembers where the brightest contribution comes from.
    #[inline(always)]
    pub fn mark(&mut self, brightness: f64, place: Place, origin: Origin) {
        if brightness > self.brightest {
            (self.brightest, self.place) = (brightness, place);
            if let Some(record) = &mut self.record {
                record.origin = Some(origin);
            }
        }
    }
}

/// Light of a medium along a ray.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Light {
    /// Observed intensity, scene units.
    pub intensity: f64,
    /// ∫ g dI.
    pub shift: f64,
    /// Q, U, V.
    pub stokes: [f64; 3],
    /// Optical depth of the whole way, dimensionless.
    pub depth: f64,
    /// Its brightest node.
    pub place: Place,
    /// Mino time of the brightest node, in M⁻¹.
    pub mino_time: f64,
    /// Intensity of the second image and later ones, and of the third and later ones; 0 unless they are kept apart.
    pub later: [f64; 2],
    /// An estimate of the error of the intensity, scene units.
    pub error: f64,
}

/// Origin of light; zeros where it has not been asked.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Place {
    pub radius: f64,
    pub azimuth: f64,
    pub delay: f64,
}

impl Place {
    /// A point of a path.
    pub fn of_point(point: &PathPoint) -> Self {
        Place { radius: point.radius(), azimuth: point.azimuth, delay: point.delay }
    }

    /// A crossing of the equatorial plane.
    pub fn of_crossing(crossing: &PlaneCrossing) -> Self {
        let PlaneCrossing { radius, azimuth, delay, .. } = *crossing;
        Place { radius, azimuth, delay }
    }

    /// Node number `k` of a ray.
    pub fn of_node(nodes: &RayNodes<'_>, k: usize) -> Self {
        let of = |column: &[f64]| column.get(k).copied().unwrap_or(0.0);
        let [radius, azimuth, delay] = [nodes.radius, nodes.azimuth, nodes.delay].map(of);
        Place { radius, azimuth, delay }
    }
}

/// Wraps into \[−π, π\].
pub(super) fn wrap(angle: f64) -> f64 {
    use core::f64::consts::{PI, TAU};
    if angle.abs() <= PI {
        return angle;
    }
    angle - TAU * (angle / TAU).round()
}

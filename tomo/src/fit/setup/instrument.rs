//! Instrument of a fit: sight lines, traced once.

use super::observable::seen;
use super::quiescent::quiescent;
use super::{AXIS, Result, known_axis, observer, spacing};
use crate::fit::forward::pixel_rays::PixelRays;
use crate::fit::settings::{Absorption, AxisSearch, FitError, FitFile, Screen, Within, refuse};
use crate::fit::{
    ForwardModel, Motion, Observable, PolarizedView, Quiescent, Redshift, RingRays, Sampling,
    SightlineRequest, Sightlines,
};
use kerrlight_common::memory;
use kerrlight_common::simd::Float;
use kerrlight_geodesic::Kerr;
use kerrlight_render::polarization::StokesParameter;

/// Instrument of a fit: the same for all data and representations.
pub struct Instrument {
    /// Places of its pixels: M to the right and upwards of the middle of the screen.
    pub pixels: [Vec<f64>; 2],
    /// The hole.
    pub hole: Kerr,
    /// Nodes on rays; weights in Jy a pixel for emission 1.
    pub lines: Sightlines,
    /// Emission goes like g to this power.
    pub redshift: Option<Redshift>,
    /// View of polarised light; total intensity alone, without.
    pub polarized: Option<PolarizedView>,
    /// Quantities that data depend on.
    pub seen: Observable,
    /// Emission that does not move, where it is recovered.
    pub quiescent: Option<Quiescent>,
}

/// Rays of pixels near the critical curve where nobody says how many.
pub(super) const RING_RAYS: usize = 16;

/// Rays of the trial by which the nodes of all are estimated.
const TRIAL: usize = 512;

impl Instrument {
    /// Traces the rays of all pixels.
    ///
    /// # Errors
    /// If a number is out of range, no ray meets the region, or there is no memory for the nodes.
    pub fn new(file: &FitFile) -> Result<Self> {
        file.check_ranges()?;
        let n = file.screen.pixels;
        Self::afford(file, n.saturating_mul(n))?;
        Self::of(file, &(0..n * n).collect::<Vec<_>>())
    }

    /// Refuses rays that there is no memory for, as estimated from a few of them.
    fn afford(file: &FitFile, pixels: usize) -> Result<()> {
        let Some((few, of_all)) = Self::trial(file)? else { return Ok(()) };
        let nodes = few.lines.points() as f64 * of_all;
        let (momenta, delays) = (few.lines.momentum[0].len(), few.lines.delay.len());
        let columns = [(momenta, 3.0), (delays, 2.0)];
        let columns = columns.iter().map(|(count, n)| if *count > 0 { *n } else { 0.0 }).sum();
        let n = file.screen.pixels;
        let what = || {
            format!("screen.pixels = {n}: about {nodes:.0} nodes on the rays of {pixels} pixels")
        };
        Ok(memory::afford(what, memory::nodes(nodes, columns))?)
    }

    /// Traces the rays of a few of all pixels, which are so many times as many; nothing if something is wrong with them,
    /// which is told by those of all pixels.
    pub(super) fn trial(file: &FitFile) -> Result<Option<(Self, f64)>> {
        spacing(&file.screen)?;
        let pixels = file.screen.pixels * file.screen.pixels;
        let each = match file.region.nodes {
            Sampling::Gauss { order, split } => order as f64 * f64::from(split),
            Sampling::EqualMinoTime { per_ray } => per_ray as f64,
        };
        // So many nodes may be asked for that even a few rays are too much.
        let block = || format!("region.nodes: {each} nodes or more on each ray of a block");
        memory::afford(block, memory::nodes(each * TRIAL.min(pixels) as f64, 0.0))?;
        let chosen = spread(file.screen.pixels);
        let few = Self::of(file, &chosen).ok();
        Ok(few.map(|few| (few, pixels as f64 / chosen.len() as f64)))
    }

    /// Traces the rays of some pixels, counted row by row from the top, each from the left.
    ///
    /// # Errors
    /// As [`Instrument::new`].
    pub fn of(file: &FitFile, chosen: &[usize]) -> Result<Self> {
        let hole = Kerr::new(file.hole.spin.value()).within("hole")?;
        let region = file.region.limits();
        let request = SightlineRequest {
            region,
            sampling: file.region.nodes,
            delay: file.effects.slow_light,
            momentum: file.effects.redshift_power.is_some() || file.polarization.is_some(),
        };
        let (alpha, beta) = pixels(&file.screen, chosen)?;
        let observer = observer(&file.observer)?;
        let turned = upright(file);
        let rays = match ring(file)? {
            None => PixelRays::single(&alpha, &beta),
            Some(ring) => PixelRays::new(ring, &hole, &observer, [&alpha, &beta], &turned),
        };
        let rays = match samples(file)? {
            1 => rays,
            side => rays.divided(spacing(&file.screen)?, side),
        };
        let mut lines = Sightlines::of_pixels(&hole, &observer, &rays, &turned, &request)
            .within("region and screen")?;
        if lines.rays() == 0 {
            refuse!(
                "no ray meets the region: region.r_min to r_max lies outside the field of view"
            );
        }
        let jy = file.screen.jy_per_pixel;
        // Before weights are in Jy: opacities are per M of the way.
        if let Some(medium) = file.effects.absorption {
            lines.absorb(opacity(medium));
        }
        lines.weight.iter_mut().for_each(|weight| *weight *= jy);
        let redshift = file.effects.redshift_power.map(|power| Redshift { power });
        let (pixels, polarized) = ([alpha, beta], polarized(file)?);
        let (seen, quiescent) = (seen(file)?, quiescent(file, chosen.len())?);
        Ok(Self { pixels, hole, lines, redshift, polarized, seen, quiescent })
    }

    /// Returns the forward model of emission that moves like this.
    ///
    /// # Errors
    /// If the motion is out of range.
    pub fn forward<T: Float>(&self, motion: &Motion) -> Result<ForwardModel<T>> {
        let model = self.model(motion, &self.seen)?;
        match &self.quiescent {
            Some(image) => model.beside(image.clone()),
            None => Ok(model),
        }
    }

    /// The same as images of total intensity, whatever data see.
    ///
    /// # Errors
    /// If the motion is out of range.
    pub fn pictured<T: Float>(&self, motion: &Motion) -> Result<ForwardModel<T>> {
        self.model(motion, &Observable::Images)
    }

    /// The same as fluxes in some Stokes parameters.
    ///
    /// # Errors
    /// If the motion is out of range, or a parameter needs a field that there is not.
    pub fn summed(
        &self,
        motion: &Motion,
        parameters: &[StokesParameter],
    ) -> Result<ForwardModel<f64>> {
        self.model(motion, &Observable::Fluxes(parameters.to_vec()))
    }

    fn model<T: Float>(&self, motion: &Motion, seen: &Observable) -> Result<ForwardModel<T>> {
        let Self { lines, hole, redshift, polarized, .. } = self;
        let model = ForwardModel::new(lines, motion, hole, *redshift)?;
        let factors = polarized.as_ref().map(|view| view.factors(lines, hole, &motion.velocity));
        model.seen(factors.transpose()?.as_deref(), seen)
    }
}

/// [`TRIAL`] of `side` × `side` pixels or a few hundred less, spread over rows and columns alike.
fn spread(side: usize) -> Vec<usize> {
    const GOLDEN: f64 = 0.618034;
    fn common(a: usize, b: usize) -> usize {
        if b == 0 { a } else { common(b, a % b) }
    }
    let pixels = side * side;
    let least = pixels.div_ceil(TRIAL).max(1);
    let mut step = least;
    if 4 * least > side {
        // Few of each row: every one by the golden section further on than the one before.
        step += ((GOLDEN * side as f64) as usize + side - least % side) % side;
    }
    // A step that shares a divisor with the side would miss columns.
    while common(step, side) > 1 {
        step += 1;
    }
    (0..pixels).step_by(step).collect()
}

/// Returns the view of polarised light, if any is modelled.
fn polarized(file: &FitFile) -> Result<Option<PolarizedView>> {
    let Some(law) = file.polarization else { return Ok(None) };
    law.check()?;
    if let Some(power) = file.effects.redshift_power {
        refuse!(
            "effects.redshift_power = {power} is not allowed together with [polarization], whose redshift_power it is"
        );
    }
    if !matches!(file.axis, AxisSearch::Known {}) {
        refuse!("polarization needs a known axis; add `[axis.known]` and `axis` in [motion]");
    }
    if !matches!(file.region.nodes, Sampling::Gauss { .. }) {
        refuse!("polarization needs region.nodes = {{ gauss = {{ order, split }} }}");
    }
    let missing = || FitError::missing("motion.axis", format!("polarization needs it; {AXIS}"));
    Ok(Some(PolarizedView {
        law,
        axis: known_axis(file)?.ok_or_else(missing)?,
        sin_inclination: observer(&file.observer)?.inclination().sin(),
        position_angle: file.observer.position_angle_deg.value().to_radians(),
        unit: None,
    }))
}

/// (α, β) of a place on the screen (to the right and upwards): β along the projection of the spin.
pub(super) fn upright(file: &FitFile) -> impl Fn([f64; 2]) -> [f64; 2] + use<> {
    let (sin, cos) = file.observer.position_angle_deg.value().to_radians().sin_cos();
    move |[x, y]| [x * cos + y * sin, y * cos - x * sin]
}

/// More rays for pixels of the photon ring, where they are wanted, or where data see the flux of the ring alone: nothing tells
/// single rays then that have missed it.
///
/// # Errors
/// If their number is out of range, or rays have no mean.
pub(super) fn ring(file: &FitFile) -> Result<Option<RingRays>> {
    let absorbs = file.effects.absorption.is_some();
    let count = match file.screen.ring_rays {
        Some(count) => count,
        None if seen(file)?.is_flux() && !absorbs => RING_RAYS,
        None => return Ok(None),
    };
    // Nodes of a pixel's rays are one list: each ray would dim the next.
    if absorbs && count > 1 {
        refuse!("screen.ring_rays and effects.absorption exclude each other");
    }
    Ok((count > 1).then_some(RingRays { count, spacing: spacing(&file.screen)?, lattice: 0 }))
}

/// Rays along each side of a pixel, whose mean is its light.
///
/// # Errors
/// If their number is no square, or rays have no mean.
pub(super) fn samples(file: &FitFile) -> Result<usize> {
    let count = file.screen.samples_per_pixel.unwrap_or(1);
    let side = count.isqrt();
    if side * side != count {
        let allowed = "a square number, 1 to 64";
        return Err(FitError::range("screen.samples_per_pixel", count, allowed).into());
    }
    if count > 1 && file.effects.absorption.is_some() {
        refuse!("screen.samples_per_pixel and effects.absorption exclude each other");
    }
    Ok(side)
}

/// κ(x) of the medium.
pub(super) fn opacity(medium: Absorption) -> impl Fn([f64; 3]) -> f64 {
    let Absorption { coefficient, radius, height } = medium;
    move |[x, y, z]: [f64; 3]| {
        let square = (x * x + y * y + z * z) / (radius * radius) + z * z / (height * height);
        coefficient * (-0.5 * square).exp()
    }
}

/// (α, β) of pixels, rows from the top, each from the left.
fn pixels(screen: &Screen, chosen: &[usize]) -> Result<(Vec<f64>, Vec<f64>)> {
    let (n, step) = (screen.pixels, spacing(screen)?);
    let at = |k: usize| (k as f64 - 0.5 * (n as f64 - 1.0)) * step;
    Ok(chosen.iter().map(|k| (at(k % n), -at(k / n))).unzip())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Along the equator only r counts, along the axis r and z.
    #[test]
    fn exact_opacity_of_the_medium() {
        let kappa = opacity(Absorption { coefficient: 0.3, radius: 4.0, height: 2.0 });
        for (place, exponent) in [
            ([0.0; 3], 0.0),
            ([4.0, 0.0, 0.0], -0.5),
            ([0.0, -4.0, 0.0], -0.5),
            ([0.0, 0.0, 2.0], -0.625),
        ] {
            assert!((kappa(place) - 0.3 * f64::exp(exponent)).abs() < 1e-15, "{place:?}");
        }
    }

    /// The part of pixels in a ring about the middle is that of its area.
    #[test]
    fn exact_a_few_pixels_are_of_all_parts() {
        for side in [24, 40, 64, 99, 128, 256, 316, 512, 1000, 4096] {
            let few = spread(side);
            assert!(few.len() > 100 && few.len() <= TRIAL.max(side * side), "{side}");
            let middle = 0.5 * (side as f64 - 1.0);
            let radius = |k: usize| ((k % side) as f64 - middle).hypot((k / side) as f64 - middle);
            let inside = few.iter().map(|k| radius(*k) / side as f64);
            let inside = inside.filter(|r| (0.1..0.42).contains(r)).count() as f64;
            let part = inside / few.len() as f64;
            let expected = core::f64::consts::PI * (0.42f64.powi(2) - 0.1f64.powi(2));
            assert!((part / expected - 1.0).abs() < 0.12, "{side}: {part} in place of {expected}");
        }
    }
}

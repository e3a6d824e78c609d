//! Emission on the nodes of a box, carried along by matter on circles about an axis
//! (Levis et al. 2022): e(t, x) = e₀(R(ξ, −Ω(|x|)(t − t₀)) x), in positions r n; or by matter that falls as well.

use super::medium::{CellSize, Emission, Medium, Moment, Part, PathSegment};
use super::occupied::Occupied;
use crate::Error;
use crate::dynamics::infall::Falling;
use crate::dynamics::{AngularVelocity, Axis, Injection};
use crate::scene::{Effects, Rotation, VolumeRegion, VolumeSource};
use crate::volume::{Volume, VolumeFile};
use kerrlight_geodesic::flow::{
    falling_norm, falling_redshift_at, rotating_redshift_at, rotation_norm,
};
use kerrlight_geodesic::simd::RayNodes;
use kerrlight_geodesic::vector::{cross, rotate};
use kerrlight_geodesic::{Kerr, Quantities};

/// A volume around one hole, ready to be evaluated.
#[derive(Debug, Clone)]
pub struct VolumeModel {
    hole: Kerr,
    volume: Volume,
    factor: f64,
    largest: f64,
    axis: [f64; 3],
    /// `None`: it stands still.
    rotation: Option<AngularVelocity>,
    reference: f64,
    injection: Option<Injection>,
    /// `None`: it shines wherever the file has light.
    region: Option<VolumeRegion>,
    /// Spectral index, if redshift is simulated.
    spectral_index: Option<f64>,
    slow_light: bool,
    occupied: Occupied,
    color: [f32; 3],
}

impl VolumeModel {
    /// The volume of a scene around `hole`.
    ///
    /// # Errors
    /// If a value is negative or there is no axis to turn about.
    pub fn new(
        source: &VolumeSource,
        file: &VolumeFile,
        hole: &Kerr,
        effects: &Effects,
    ) -> Result<Self, Error> {
        let range = |field, value, allowed| Error::out_of_range(field, value, allowed);
        let axis = match (source.axis.or(file.axis), &source.rotation) {
            (Some(axis), _) => axis,
            (None, Rotation::None) => [0.0, 0.0, 1.0],
            _ => return Err(range("volume axis", f64::NAN, "given by the scene or by the file")),
        };
        let not_zero = "finite numbers, not all 0";
        let axis = Axis::new(axis).map_err(|_| range("volume axis", axis[0], not_zero))?;
        let [least, largest] = file.volume.values().iter().fold([0.0f64; 2], |[l, h], value| {
            [l.min(f64::from(*value)), h.max(f64::from(*value))]
        });
        if least < 0.0 {
            return Err(range("least value of the volume", least, "0 or more"));
        }
        Ok(VolumeModel {
            hole: *hole,
            volume: file.volume.clone(),
            factor: source.factor,
            largest: source.factor * largest,
            axis: axis.vector(),
            rotation: source.rotation.about(hole, axis)?,
            reference: source.reference_time.unwrap_or(0.0),
            injection: source.injection_time.map(|time| Injection { time }),
            region: source.region,
            spectral_index: effects.index(),
            slow_light: effects.slow_light,
            occupied: Occupied::new(&file.volume, axis.vector()),
            color: source.color,
        })
    }

    /// Angular velocity vector of the matter at radius r.
    fn angular_velocity(&self, r: f64) -> [f64; 3] {
        let rate = self.rotation.as_ref().map_or(0.0, |rotation| rotation.rate(r));
        self.axis.map(|x| x * rate)
    }

    /// Angles by which matter between two radii has turned since the reference time by any time
    /// between two; `None` if they are not to be had from the ends.
    fn turned(&self, radii: [f64; 2], times: [f64; 2]) -> Option<[f64; 2]> {
        let rates = match &self.rotation {
            None => [0.0; 2],
            // Not monotonic in the radius: extremes may lie between the ends.
            Some(AngularVelocity::Table { .. } | AngularVelocity::Profile(_)) => return None,
            Some(rotation) => radii.map(|r| rotation.rate(r)),
        };
        let angle = |k: usize| rates[k & 1] * (times[k >> 1] - self.reference);
        let angles = [0, 1, 2, 3].map(angle);
        let [least, most] = angles
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], x| [l.min(*x), h.max(*x)]);
        (least.is_finite() && most.is_finite()).then_some([least, most])
    }

    /// Emissivity in the frame of the matter at x, r from the centre, at a time of emission.
    fn emissivity(&self, x: [f64; 3], r: f64, time: f64) -> f64 {
        if self.injection.is_some_and(|injection| !injection.shines(time)) {
            return 0.0;
        }
        let elapsed = time - self.reference;
        let origin = match &self.rotation {
            Some(rotation) => match rotation.falling() {
                Some(flow) => self.origin(flow, x, r, elapsed),
                None => Some(rotate(self.axis, -rotation.rate(r) * elapsed, x)),
            },
            None => Some(x),
        };
        origin.map_or(0.0, |origin| self.factor * self.volume.at(origin))
    }

    /// Returns the origin of falling matter; `None` where that is outside of the region.
    fn origin(&self, flow: &Falling, x: [f64; 3], r: f64, elapsed: f64) -> Option<[f64; 3]> {
        // As in a fit, only what was inside of the region at the reference time is followed.
        let [stretch, angle] = flow.before(&flow.origin(r), elapsed);
        let inside =
            |region: VolumeRegion| stretch * r >= region.r_min && stretch * r <= region.r_max;
        let followed = self.region.is_none_or(inside);
        followed.then(|| rotate(self.axis, angle, x.map(|c| stretch * c)))
    }

    fn falling(&self) -> Option<&Falling> {
        self.rotation.as_ref()?.falling().map(|flow| &**flow)
    }

    /// The least and the largest radius at the reference time of matter that is between two radii between two times.
    fn labels(&self, flow: &Falling, radii: [f64; 2], times: [f64; 2]) -> [f64; 2] {
        let corner = |k: usize| flow.radius_before(radii[k & 1], times[k >> 1] - self.reference);
        // A margin for the rounding of the table.
        let wider = |[low, high]: [f64; 2]| [low * (1.0 - 1e-9), high * (1.0 + 1e-9)];
        // Matter neither overtakes nor turns back: extremes are at the corners.
        wider(
            [0, 1, 2, 3]
                .map(corner)
                .iter()
                .fold([f64::INFINITY, 0.0], |[low, high], r| [low.min(*r), high.max(*r)]),
        )
    }

    /// g² j and g at node number `k`; `None` where nothing shines.
    fn node(
        &self,
        nodes: &RayNodes<'_>,
        k: usize,
        lambda: f64,
        moment: Moment,
    ) -> Option<[f64; 2]> {
        let (r, u) = (nodes.radius[k], nodes.cos_theta[k]);
        // Falling matter also shines at radii where nothing was at the reference time.
        let lit = (self.occupied.radii[0]..=self.occupied.radii[1]).contains(&r);
        if !lit && self.falling().is_none() {
            return None;
        }
        let n = direction(u, nodes.azimuth[k]);
        let x = n.map(|c| r * c);
        if self.region.is_some_and(|region| !region.holds(x[2], r)) {
            return None;
        }
        // No delays are requested where nothing changes.
        let delay = nodes.delay.get(k).filter(|_| moment.slow_light).copied().unwrap_or(0.0);
        let time = moment.observed - delay;
        let emissivity = self.emissivity(x, r, time);
        if emissivity <= 0.0 {
            return None;
        }
        let Some(index) = self.spectral_index else { return Some([emissivity, 1.0]) };
        // Not there where matter turns about z, for whose g λ is enough.
        let polar = nodes.polar_velocity.get(k).copied().unwrap_or(0.0);
        let omega = self.angular_velocity(r);
        let g = match self.falling() {
            None => rotating_redshift_at(&self.hole, (r, n), (lambda, polar), omega)?,
            Some(flow) => {
                let radial = nodes.radial_velocity.get(k).copied().unwrap_or(0.0);
                let motion = (omega, flow.rates(r)[0]);
                falling_redshift_at(&self.hole, (r, n), [lambda, polar, radial], motion)?
            }
        };
        Some([emissivity * g.powf(2.0 + index), g])
    }
}

/// n at cos θ and an azimuth.
fn direction(u: f64, azimuth: f64) -> [f64; 3] {
    let sin = ((1.0 - u) * (1.0 + u)).max(0.0).sqrt();
    let (y, x) = azimuth.sin_cos();
    [sin * x, sin * y, u]
}

impl Medium for VolumeModel {
    fn part(&self) -> Part {
        Part::Volumes
    }

    fn sphere(&self) -> f64 {
        // Somewhere outside of the horizon even where all is inside.
        let outer = self.region.map_or(f64::INFINITY, |region| region.r_max);
        // Before the reference time falling matter was farther out than the file has light.
        let lit = if self.falling().is_some() && outer.is_finite() {
            outer
        } else {
            self.occupied.radii[1].min(outer)
        };
        lit.max(1.01 * self.hole.horizon())
    }

    fn cell_size(&self) -> Option<CellSize> {
        let inner = self.region.map_or(0.0, |region| region.r_min);
        // Falling matter comes nearer than the file has light.
        let lit = if self.falling().is_some() { 0.0 } else { self.occupied.radii[0] };
        Some(CellSize { size: self.volume.finest(), inner: lit.max(inner) })
    }

    fn quantities(&self) -> Quantities {
        // About z the redshift is a function of λ: no momentum is needed.
        let tilted = self.axis[0] != 0.0 || self.axis[1] != 0.0;
        let moves = self.rotation.is_some() && tilted || self.falling().is_some();
        let velocity = self.spectral_index.is_some() && moves;
        Quantities { azimuth: true, time: self.slow_light && self.changes(), velocity }
    }

    fn color(&self) -> [f32; 3] {
        self.color
    }

    fn scale(&self) -> f64 {
        self.largest * self.occupied.radii[1]
    }

    fn four_velocity(&self, r: f64, u: f64, azimuth: f64) -> Option<[f64; 4]> {
        let n = direction(u, azimuth);
        let v = cross(self.angular_velocity(r), n);
        // On the axis both rates are 0/0: 0 comes out.
        let sin2 = (n[0] * n[0] + n[1] * n[1]).max(1e-300);
        let rates = [-v[2] / sin2.sqrt(), (n[0] * v[1] - n[1] * v[0]) / sin2];
        let fall = self.falling().map_or(0.0, |flow| flow.rates(r)[0]);
        let norm = match fall {
            0.0 => rotation_norm(&self.hole, r, n, v),
            fall => falling_norm(&self.hole, r, n, (v, fall)),
        };
        let time = 1.0 / norm.sqrt();
        (norm > 0.0).then_some([time, time * fall, time * rates[0], time * rates[1]])
    }

    fn changes(&self) -> bool {
        self.rotation.is_some() || self.injection.is_some()
    }

    fn absorbs(&self) -> bool {
        false
    }

    fn may_shine(&self, segment: &PathSegment, moment: Moment) -> bool {
        let [early, late] = match moment.slow_light {
            true => segment.delays.map(|delay| moment.observed - delay),
            false => [moment.observed; 2],
        };
        let before = |injection: Injection| !injection.shines(late);
        if let Some(flow) = self.falling() {
            let labels = self.labels(flow, segment.radii, [early, late]);
            return !self.injection.is_some_and(before)
                && self.occupied.may_shine_from(segment, labels);
        }
        !self.injection.is_some_and(before)
            && self.occupied.may_shine(segment, |radii| self.turned(radii, [early, late]))
    }

    fn fill(&self, nodes: &RayNodes<'_>, lambda: f64, moment: Moment, out: &mut Emission) {
        for k in 0..nodes.radius.len() {
            let [gain, g] = self.node(nodes, k, lambda, moment).unwrap_or([0.0; 2]);
            out.emissivity.push(gain);
            out.redshift.push(g);
        }
    }
}

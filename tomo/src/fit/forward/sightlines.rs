//! Sight lines: nodes on rays inside the region of recovery, from where the light of a movie's pixels may come, and what each
//! gives to its pixel. Computed once for a fit.

use super::pixel_rays::PixelRays;
use crate::Error;
use kerrlight_geodesic::simd::{NodeRequest, PanelRule, RayNodes, RaySamples};
use kerrlight_geodesic::vector::{distance, norm};
use kerrlight_geodesic::{
    BlockRequest, BlockTracer, Integrator, Kerr, Observer, PathOfRay, PlaneCrossing, Quantities,
    RayBlock, RayVisitor, SphereNodes, TracedRay, View,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Region in which emission is looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Region {
    /// Least radius.
    pub r_min: f64,
    /// Largest radius.
    pub r_max: f64,
    /// Largest |z|; unlimited without it.
    pub z_width: f64,
}

impl Region {
    /// Itself, if its numbers are in their ranges.
    ///
    /// # Errors
    /// Names the number that is not.
    pub fn checked(self) -> Result<Self, Error> {
        let Region { r_min, r_max, z_width } = self;
        Error::check("r_min", r_min, r_min.is_finite() && r_min >= 0.0, "0 or above")?;
        Error::check("r_max", r_max, r_max.is_finite() && r_max > r_min, "above r_min")?;
        Error::check("z_width", z_width, z_width > 0.0, "above 0")?;
        Ok(self)
    }

    /// Least and largest radius, M.
    pub fn radii(&self) -> [f64; 2] {
        [self.r_min, self.r_max]
    }

    /// Returns whether a point (r n, in M) lies in it; the outer sphere does not belong to it.
    pub fn holds(&self, point: [f64; 3]) -> bool {
        let r = norm(point);
        r >= self.r_min && r < self.r_max && point[2].abs() <= self.z_width
    }

    /// Returns whether matter at a point (M) passes it, or comes nearer than `margin` (M), while it turns about an axis (a unit
    /// vector) at the same radius.
    pub fn is_passed(&self, axis: [f64; 3], point: [f64; 3], margin: f64) -> bool {
        let r = norm(point);
        let along: f64 = point.iter().zip(axis).map(|(x, axis)| x * axis).sum();
        let across = (r * r - along * along).max(0.0).sqrt();
        // On the circle |z − along · ξ_z| ≤ `reach`; rounding may leave squares below 0.
        let reach = across * (1.0 - axis[2] * axis[2]).max(0.0).sqrt();
        let least = (along * axis[2]).abs() - reach;
        r > self.r_min - margin && r < self.r_max + margin && least <= self.z_width + margin
    }
}

/// Placement of nodes on a ray.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Sampling {
    /// Gauss–Legendre panels in Mino time: the integral over the affine parameter.
    Gauss {
        /// Nodes of a panel.
        #[schemars(range(min = 1, max = 16), extend("unit" = "nodes of a panel"))]
        order: usize,
        /// Panels into which each of the coarsest is cut.
        #[schemars(range(min = 1, max = 1_000_000_000), extend("unit" = "cuts of the coarsest panels"))]
        split: u32,
    },
    /// Equidistant in Mino time with chords as weights: the sums of BH-NeRF. Needs an observer at a finite radius.
    EqualMinoTime {
        /// Nodes of a ray.
        #[schemars(range(min = 2, max = 100_000), extend("unit" = "nodes of a ray"))]
        per_ray: usize,
    },
}

/// Quantities wanted of nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SightlineRequest {
    /// Region of the nodes.
    pub region: Region,
    /// Placement of the nodes.
    pub sampling: Sampling,
    /// Delays, for slow light.
    pub delay: bool,
    /// Angular momenta, for redshift.
    pub momentum: bool,
}

/// Nodes of the rays that meet the region, ray after ray.
#[derive(Clone, Debug, Default)]
pub struct Sightlines {
    /// Pixels of the screen, those without a node included.
    pub pixels: usize,
    /// Pixel of each ray.
    pub pixel: Vec<u32>,
    /// Ray k has the nodes `starts[k]..starts[k + 1]`.
    pub starts: Vec<usize>,
    /// r n: x, y and z, M.
    pub position: [Vec<f64>; 3],
    /// Weight of the node's emission in the sum that is the pixel, M.
    pub weight: Vec<f64>,
    /// t_o − t less r_o + 2 ln r_o, M; empty unless wanted.
    pub delay: Vec<f64>,
    /// Angular momentum (x, y and z) of the arriving photon per energy, M; empty unless wanted.
    /// (k_θ φ̂ − k_φ θ̂/sin θ: its product with an axis is the momentum conjugate to turns about
    /// it.)
    pub momentum: [Vec<f64>; 3],
    /// d(1/r)/dτ of the backward ray; empty unless momenta are wanted.
    pub radial: Vec<f64>,
    /// Least and largest radius of the region, M: matter that comes from elsewhere is dark. Without them, none is.
    pub limits: Option<[f64; 2]>,
    /// Arrivals of all rays that were traced, those of a pixel with several of them one by one.
    pub arrivals: Vec<Arrival>,
}

/// Place where a ray arrives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arrival {
    /// End of its nodes, which begin where those of the ray before end.
    pub end: usize,
    /// α and β, M.
    pub place: [f64; 2],
}

/// Rays traced at a time.
const BLOCK: usize = 1024;

/// The largest error of a node's position, relative, above which its ray is traced step by step.
const TOLERANCE: f64 = 1e-8;

impl Sightlines {
    /// Traces the rays that arrive at (`alpha[k]`, `beta[k]`), pixel k.
    ///
    /// # Errors
    /// If a number is out of its range, or momenta or delays are asked of a sampling that has none.
    pub fn trace(
        hole: &Kerr,
        observer: &Observer,
        alpha: &[f64],
        beta: &[f64],
        request: &SightlineRequest,
    ) -> Result<Self, Error> {
        request.region.checked()?;
        let wanted = request.of_rays(observer)?;
        let view = View::Screen(*observer);
        let tracer = BlockTracer::new(*hole, view, Integrator::Elliptic, TOLERANCE)?;
        let (flight, mut memory) = (flight(observer.inverse_radius()), RayBlock::default());
        let limits = Some(request.region.radii());
        let mut all = Self { pixels: alpha.len(), starts: vec![0], limits, ..Self::default() };
        for (block, (alpha, beta)) in alpha.chunks(BLOCK).zip(beta.chunks(BLOCK)).enumerate() {
            let (first, lines) = (all.rays(), &mut all);
            let mut visitor = Collector { request, flight, first: block * BLOCK, lines };
            tracer.trace(alpha, beta, &wanted, &mut memory, &mut visitor)?;
            // Rays that were traced step by step came last.
            all.sort_from(first);
        }
        let ends = all.starts[1..].iter().zip(&all.pixel);
        all.arrivals = ends
            .map(|(end, ray)| (*end, *ray as usize))
            .map(|(end, ray)| Arrival { end, place: [alpha[ray], beta[ray]] })
            .collect();
        // They have grown, and are kept for long.
        all.columns().into_iter().for_each(Vec::shrink_to_fit);
        Ok(all)
    }

    /// Traces the rays of pixels, each of which is the mean over its own.
    ///
    /// # Errors
    /// As those of [`trace`](Self::trace).
    pub(in crate::fit) fn of_pixels(
        hole: &Kerr,
        observer: &Observer,
        rays: &PixelRays,
        screen: impl Fn([f64; 2]) -> [f64; 2],
        request: &SightlineRequest,
    ) -> Result<Self, Error> {
        let places = rays.places.iter().map(|place| screen(*place));
        let (alpha, beta): (Vec<f64>, Vec<f64>) = places.map(|[a, b]| (a, b)).unzip();
        Ok(Self::trace(hole, observer, &alpha, &beta, request)?.grouped(rays))
    }

    /// The nodes of all rays of a pixel as those of one.
    fn grouped(mut self, rays: &PixelRays) -> Self {
        self.pixels = rays.starts.len() - 1;
        if self.pixels == rays.places.len() {
            return self;
        }
        let (of_rays, ends) = (core::mem::take(&mut self.pixel), core::mem::take(&mut self.starts));
        self.starts.push(0);
        for (ray, range) in of_rays.iter().zip(ends.windows(2)) {
            let pixel = rays.pixel_of(*ray as usize);
            // Rays without a node count in the share: they add darkness to the mean.
            let share = rays.share(pixel);
            self.weight[range[0]..range[1]].iter_mut().for_each(|weight| *weight *= share);
            // Rays of a pixel follow each other: ranges merge where the end between them goes.
            if self.pixel.last() == Some(&(pixel as u32)) {
                self.starts.pop();
            } else {
                self.pixel.push(pixel as u32);
            }
            self.starts.push(range[1]);
        }
        self
    }

    /// Rays that meet the region.
    pub fn rays(&self) -> usize {
        self.pixel.len()
    }

    /// Nodes of all rays.
    pub fn points(&self) -> usize {
        self.weight.len()
    }

    /// Dims nodes by what lies between them and the observer: each weight times e^{−τ}, where τ adds up a grey
    /// coefficient κ(x) along the nodes in front of it and half of its own. κ is per unit of the weights before this
    /// call, and what is outside the region does not absorb.
    pub fn absorb(&mut self, coefficient: impl Fn([f64; 3]) -> f64) {
        for ends in self.starts.windows(2) {
            let mut depth = 0.0;
            for k in ends[0]..ends[1] {
                let half = 0.5 * self.weight[k] * coefficient(self.point(k));
                self.weight[k] *= (-depth - half).exp();
                depth += 2.0 * half;
            }
        }
    }

    /// Node k: r n.
    fn point(&self, k: usize) -> [f64; 3] {
        [0, 1, 2].map(|c| self.position[c][k])
    }

    pub(in crate::fit) fn push(&mut self, point: [f64; 3], weight: f64) {
        self.position.iter_mut().zip(point).for_each(|(column, x)| column.push(x));
        self.weight.push(weight);
    }

    pub(in crate::fit) fn end_ray(&mut self, pixel: usize) {
        if self.weight.len() > *self.starts.last().unwrap_or(&0) {
            self.starts.push(self.weight.len());
            self.pixel.push(pixel as u32);
        }
    }

    /// Puts the rays from number `first` on into the order of their pixels.
    fn sort_from(&mut self, first: usize) {
        if self.pixel[first..].is_sorted() {
            return;
        }
        let start = self.starts[first];
        let (pixels, ends) = (self.pixel.split_off(first), self.starts.split_off(first + 1));
        // Columns of quantities that are not wanted are empty.
        let columns = self.columns().map(|column| column.split_off(start.min(column.len())));
        let mut order: Vec<usize> = (0..pixels.len()).collect();
        order.sort_by_key(|ray| pixels[*ray]);
        for ray in order {
            let from = ray.checked_sub(1).map_or(start, |before| ends[before]);
            for (to, column) in self.columns().into_iter().zip(&columns) {
                let nodes = column.get(from - start..ends[ray] - start);
                to.extend_from_slice(nodes.unwrap_or_default());
            }
            self.end_ray(pixels[ray] as usize);
        }
    }

    /// Bytes of its nodes.
    pub fn bytes(&self) -> usize {
        let scalars = [&self.weight, &self.delay, &self.radial];
        let columns = self.position.iter().chain(&self.momentum).chain(scalars);
        columns.map(|column| size_of_val(&**column)).sum()
    }

    /// Returns the columns of all quantities of nodes.
    fn columns(&mut self) -> [&mut Vec<f64>; 9] {
        let Self { position: [x, y, z], weight, delay, momentum: [mx, my, mz], radial, .. } = self;
        [x, y, z, weight, delay, mx, my, mz, radial]
    }
}

/// Returns the part of the time of flight to an observer at a radius of 1/w that times of frames leave out: r_o + 2 ln r_o at a finite
/// one, which grows without end. Times of frames mean the same at any distance then.
pub fn flight(w: f64) -> f64 {
    if w > 0.0 { 1.0 / w - 2.0 * w.ln() } else { 0.0 }
}

impl SightlineRequest {
    /// Returns the request of rays that it needs.
    fn of_rays(&self, observer: &Observer) -> Result<BlockRequest, Error> {
        match self.sampling {
            Sampling::Gauss { order, split } => {
                let (azimuth, time, velocity) = (true, self.delay, self.momentum);
                let request = NodeRequest {
                    radius: self.region.r_max,
                    rule: PanelRule::new(order),
                    split,
                    quantities: Quantities { azimuth, time, velocity },
                };
                let nodes = vec![SphereNodes { request, finest: split }];
                Ok(BlockRequest { nodes, ..BlockRequest::default() })
            }
            Sampling::EqualMinoTime { per_ray } => {
                self.check_equal(per_ray, observer)?;
                Ok(BlockRequest { samples: per_ray, ..BlockRequest::default() })
            }
        }
    }

    fn check_equal(&self, per_ray: usize, observer: &Observer) -> Result<(), Error> {
        let check = Error::check;
        // The first chord would be infinitely long.
        let allowed = "a finite observer.radius with nodes equidistant in Mino time";
        check("observer radius", f64::INFINITY, !observer.is_at_infinity(), allowed)?;
        // Samples of a ray have no velocities.
        let allowed = "without effects.redshift_power and [polarization]";
        check("per_ray of equal-mino-time", per_ray as f64, !self.momentum, allowed)?;
        check("samples per ray", per_ray as f64, per_ray >= 2, "at least 2")
    }
}

/// Takes the nodes of one block of rays.
struct Collector<'a> {
    request: &'a SightlineRequest,
    flight: f64,
    /// Pixel of the block's first ray.
    first: usize,
    lines: &'a mut Sightlines,
}

impl RayVisitor for Collector<'_> {
    fn take_nodes(
        &mut self,
        _sphere: usize,
        number: usize,
        ray: &TracedRay,
        _crossings: &[PlaneCrossing],
        nodes: &RayNodes<'_>,
    ) -> bool {
        for i in 0..nodes.weight.len() {
            self.node(nodes, i, ray.lambda);
        }
        self.lines.end_ray(self.first + number);
        true
    }

    fn take_samples(&mut self, number: usize, _ray: &TracedRay, samples: &RaySamples<'_>) {
        let mut before = None;
        for (i, r) in samples.radius.iter().enumerate() {
            let ((sin, cos), (s, u)) = (samples.azimuth[i].sin_cos(), samples.theta[i].sin_cos());
            let point = [r * s * cos, r * s * sin, r * u];
            let chord = before.map_or(0.0, |before| distance(point, before));
            before = Some(point);
            if self.request.region.holds(point) {
                self.lines.push(point, chord);
                if self.request.delay {
                    self.lines.delay.push(samples.delay[i] - self.flight);
                }
            }
        }
        self.lines.end_ray(self.first + number);
    }

    fn take(
        &mut self,
        _number: usize,
        _ray: &TracedRay,
        _crossings: &[PlaneCrossing],
        _path: Option<PathOfRay<'_>>,
    ) -> Result<(), kerrlight_geodesic::Error> {
        Ok(())
    }
}

impl Collector<'_> {
    /// Takes a node, if it lies in the region.
    fn node(&mut self, ray: &RayNodes<'_>, i: usize, lambda: f64) {
        let (r, u) = (ray.radius[i], ray.cos_theta[i]);
        // 1 − u² would lose its digits next to the axis.
        let (s, (sin, cos)) = (((1.0 - u) * (1.0 + u)).sqrt(), ray.azimuth[i].sin_cos());
        let point = [r * s * cos, r * s * sin, r * u];
        if !self.request.region.holds(point) {
            return;
        }
        self.lines.push(point, ray.weight[i]);
        if self.request.delay {
            self.lines.delay.push(ray.delay[i] - self.flight);
        }
        if self.request.momentum {
            // Backwards dθ/dτ = −u'/sin θ; the arriving photon has the opposite one.
            let of_theta = if s > 0.0 { ray.polar_velocity[i] / s } else { 0.0 };
            let of_phi = if s > 0.0 { lambda / s } else { 0.0 };
            let [phi, theta] = [[-sin, cos, 0.0], [u * cos, u * sin, -s]];
            for (c, column) in self.lines.momentum.iter_mut().enumerate() {
                column.push(of_theta * phi[c] - of_phi * theta[c]);
            }
            self.lines.radial.push(ray.radial_velocity[i]);
        }
    }
}

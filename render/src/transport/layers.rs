//! Layers of a ray besides its light, on request: opacity, the sky apart from emission, lensed images apart, and where
//! its brightest contribution comes from.

use crate::scene::Scene;
use kerrlight_geodesic::{Outcome, TracedRay};

/// Images that are kept apart: n = 0, n = 1, and all from n = 2 on.
pub(crate) const ORDERS: usize = 3;

/// Selection of layers of rays besides their light.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Wanted {
    /// Anything at all.
    pub any: bool,
    /// Images apart.
    pub orders: bool,
    /// The direction in which rays escape.
    pub exit: bool,
    /// Path length of the central ray.
    pub depth: bool,
    /// Motion of the brightest contribution to the central ray.
    pub motion: bool,
    /// True if the part of the sky that the pixel covers is wanted.
    pub footprint: bool,
}

impl Wanted {
    /// Returns the layers that the channels of a scene need.
    pub fn new(scene: &Scene) -> Self {
        let asks = |names: &[&str]| names.iter().any(|name| scene.screen.asks(name));
        let colors = |layer: &str| ["R", "G", "B"].iter().any(|c| asks(&[&format!("{layer}.{c}")]));
        let orders = ["n0", "n1", "n2"].iter().any(|layer| colors(layer));
        let (exit, depth) = (asks(&["st.u", "st.v", "st.a"]), asks(&["Z"]));
        let (motion, footprint) = (asks(&["motion.u", "motion.v"]), asks(&["footprint"]));
        let light = colors("sky") || colors("emission") || asks(&["A", "coverage", "id"]);
        let any = orders || exit || depth || motion || footprint || light;
        Wanted { any, orders, exit, depth, motion, footprint }
    }

    /// Returns whether central rays are traced once more.
    pub fn central(&self) -> bool {
        self.depth || self.motion || self.footprint
    }
}

/// Quantities averaged over the rays of a pixel.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Mixed {
    /// Share of the light from behind everything that is held up: 1 at the horizon and at opaque surfaces, 1 − e^−D in
    /// gas.
    pub opacity: f32,
    /// 1 where there is anything that is opaque or shines.
    pub coverage: f32,
    /// Linear colour of the sky.
    pub sky: [f32; 3],
    /// Linear colour of the emission of each image.
    pub orders: [[f32; 3]; ORDERS],
}

impl Mixed {
    /// Adds a share of another.
    pub fn add(&mut self, share: f32, other: &Mixed) {
        self.opacity += share * other.opacity;
        self.coverage += share * other.coverage;
        let pairs = self.orders.iter_mut().zip(&other.orders).chain([(&mut self.sky, &other.sky)]);
        for (sum, light) in pairs.flat_map(|(sum, light)| sum.iter_mut().zip(light)) {
            *sum += share * light;
        }
    }

    /// Linear colour of all emission.
    pub fn emission(&self) -> [f32; 3] {
        core::array::from_fn(|k| self.orders.iter().map(|light| light[k]).sum())
    }

    /// Light that is received with `boost` times its intensity.
    pub fn boost(&mut self, boost: f32) {
        let colors = self.orders.iter_mut().chain([&mut self.sky]);
        colors.flatten().for_each(|light| *light *= boost);
    }
}

/// Origin of light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Origin {
    /// Number of the source: see [`Numbering`].
    pub source: u32,
    /// Mino time in M⁻¹.
    pub mino_time: f64,
}

/// Layers of a ray besides its light.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Layers {
    /// Averaged quantities.
    pub mixed: Mixed,
    /// The brightest contribution, or else the surface that it ends at.
    pub origin: Option<Origin>,
    /// The direction in which it escapes, if it does.
    pub exit: Option<[f64; 3]>,
    /// Path length of the central ray of a pixel up to its origin (M), motion of the origin's image (pixels to the right
    /// and up per M), and the solid angle (sr) of the sky that the pixel covers.
    pub depth: Option<f64>,
    /// See `depth`.
    pub motion: [f64; 2],
    /// See `depth`.
    pub footprint: f64,
}

impl Layers {
    /// Makes the layers of a ray with emission of some intensity, which lets a share of light from behind it `through`.
    pub(super) fn of(ray: &TracedRay, record: &Record, intensity: f64, through: f32) -> Self {
        let is_open = ray.surface.is_none() && ray.outcome == Outcome::Escaped;
        let mixed = Mixed {
            opacity: if is_open { 1.0 - through } else { 1.0 },
            coverage: if is_open && intensity <= 0.0 { 0.0 } else { 1.0 },
            sky: record.sky,
            orders: record.orders,
        };
        let exit = ray.exit.filter(|_| is_open);
        Layers { mixed, origin: record.origin, exit, ..Layers::default() }
    }

    /// Place in an equirectangular picture of the sky, from 0 to 1 from left to right and from below upwards, and 1; all
    /// 0 where the ray does not reach the sky.
    pub fn st(&self) -> [f64; 3] {
        use core::f64::consts::{PI, TAU};
        let Some([x, y, z]) = self.exit else { return [0.0; 3] };
        [0.5 - y.atan2(x) / TAU, 1.0 - x.hypot(y).atan2(z) / PI, 1.0]
    }
}

/// Record gathered along one ray.
#[derive(Debug, Clone, Default)]
pub(super) struct Record {
    /// Mino times in M⁻¹ from which on light is of the next image.
    pub cuts: [f64; ORDERS - 1],
    pub orders: [[f32; 3]; ORDERS],
    pub sky: [f32; 3],
    pub origin: Option<Origin>,
}

impl Record {
    /// Adds intensity from a Mino time.
    pub fn add(&mut self, intensity: f64, color: [f32; 3], mino_time: f64) {
        let order = self.cuts.iter().filter(|cut| mino_time > **cut).count();
        self.add_to(order, intensity, color);
    }

    /// Adds intensity of each image.
    pub fn add_parts(&mut self, parts: [f64; ORDERS], color: [f32; 3]) {
        (0..).zip(parts).for_each(|(order, part)| self.add_to(order, part, color));
    }

    fn add_to(&mut self, order: usize, intensity: f64, color: [f32; 3]) {
        for (sum, tint) in self.orders[order].iter_mut().zip(color) {
            *sum += tint * intensity as f32;
        }
    }
}

/// Numbers of a scene's sources: 0 is the sky or nothing, 1 the hole; each kind counts from its first.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Numbering {
    pub disc: u32,
    pub media: u32,
    pub spots: u32,
    pub meshes: u32,
    end: u32,
}

/// Number of the hole.
pub(super) const HOLE: u32 = 1;

impl Numbering {
    /// Takes the settings of a scene.
    pub fn new(scene: &Scene) -> Self {
        let disc = HOLE + 1;
        let media = disc + u32::from(scene.disc.is_some());
        let spots = media + u32::from(scene.gas.is_some()) + scene.volume.len() as u32;
        let meshes = spots + scene.spot.len() as u32;
        Numbering { disc, media, spots, meshes, end: meshes + scene.mesh.len() as u32 }
    }

    /// Returns the kind of a source.
    pub fn kind(&self, source: u32) -> Kind {
        let from =
            |first: u32| (first..self.end).contains(&source).then(|| (source - first) as usize);
        let solid = from(self.meshes).map(Kind::Mesh).or_else(|| from(self.spots).map(Kind::Spot));
        let found = solid.or_else(|| from(self.media).map(Kind::Medium));
        found.or_else(|| from(self.disc).map(|_| Kind::Disc)).unwrap_or(Kind::Other)
    }
}

/// A kind of source, with the number among its like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Disc,
    Medium(usize),
    Spot(usize),
    Mesh(usize),
    /// The hole or the sky.
    Other,
}

/// Names of a scene's sources by their numbers: as `--set` has them, `sky` and `hole` first.
pub(crate) fn names(scene: &Scene) -> Vec<String> {
    let own = |name: &str, is: bool| is.then(|| name.to_owned());
    let list = |name: &'static str, count: usize| (0..count).map(move |k| format!("{name}.{k}"));
    let mut names = vec!["sky".to_owned(), "hole".to_owned()];
    names.extend(own("disc", scene.disc.is_some()));
    names.extend(own("gas", scene.gas.is_some()));
    names.extend(list("volume", scene.volume.len()));
    names.extend(list("spot", scene.spot.len()));
    names.extend(list("mesh", scene.mesh.len()));
    names
}

//! Triangle meshes as surfaces that shine, hide, or both. Positions are r n, Boyer–Lindquist
//! coordinates taken as Cartesian, as everywhere in a scene.

mod decode;
mod error;
mod file;
mod gltf_checks;
mod gltf_file;
mod gltf_unread;
mod mtl_file;
mod obj_file;
mod polygon;
mod text;
mod texture;

pub use error::MeshError;
pub use file::{Material, MeshFile, RawTriangle, Resources};

use crate::Error;
use crate::scene::{Mesh, MeshVelocity};
use kerrlight_geodesic::flow::rotating_redshift;
use kerrlight_geodesic::vector::{cross, difference, dot, norm, rotate};
use kerrlight_geodesic::{Kerr, PathPoint};

/// A triangle with what a test against it needs.
#[derive(Debug, Clone)]
pub struct Triangle {
    /// Corners, M.
    pub corners: [[f64; 3]; 3],
    /// Unit normal.
    normal: [f64; 3],
    /// In-plane unit vectors that point inward from the edge after each corner.
    inward: [[f64; 3]; 3],
    /// Longest edge, M.
    size: f64,
    texture: [[f32; 2]; 3],
    material: u32,
}

fn unit(a: [f64; 3]) -> Option<[f64; 3]> {
    let length = norm(a);
    (length > 0.0 && length.is_finite()).then(|| a.map(|x| x / length))
}

/// Distance outside of a triangle up to which a point counts as inside, in units of its longest edge: so
/// that no light slips through the seam between two triangles.
const SEAM: f64 = 1e-9;

impl Triangle {
    /// `None` if it has no area.
    fn new(corners: [[f64; 3]; 3], texture: [[f32; 2]; 3], material: u32) -> Option<Self> {
        let edges: [[f64; 3]; 3] =
            core::array::from_fn(|k| difference(corners[(k + 1) % 3], corners[k]));
        let normal = unit(cross(edges[0], edges[1]))?;
        let inward = edges.map(|edge| unit(cross(normal, edge)));
        let [Some(a), Some(b), Some(c)] = inward else { return None };
        let size = edges.map(norm).into_iter().fold(0.0, f64::max);
        Some(Triangle { corners, normal, inward: [a, b, c], size, texture, material })
    }

    /// Signed distance of a point from its plane, M.
    pub fn height(&self, x: [f64; 3]) -> f64 {
        dot(self.normal, difference(x, self.corners[0]))
    }

    /// Returns whether a point of its plane is inside, or outside by at most `margin` (M).
    pub fn holds(&self, x: [f64; 3], margin: f64) -> bool {
        let margin = margin + SEAM * self.size;
        (0..3).all(|k| dot(self.inward[k], difference(x, self.corners[k])) >= -margin)
    }

    /// Longest edge, M.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// The box around it, M.
    pub fn bounds(&self) -> [[f64; 3]; 2] {
        let fold = |pick: fn(f64, f64) -> f64| {
            core::array::from_fn(|k| self.corners.iter().map(|c| c[k]).reduce(pick).unwrap_or(0.0))
        };
        [fold(f64::min), fold(f64::max)]
    }

    /// Texture coordinates at a point inside, by areas.
    fn texture_at(&self, x: [f64; 3]) -> [f32; 2] {
        let area = |k: usize| {
            let (p, q) = (self.corners[(k + 1) % 3], self.corners[(k + 2) % 3]);
            // A point on a seam may lie outside by rounding.
            dot(self.normal, cross(difference(p, x), difference(q, x))).max(0.0)
        };
        let areas = [area(0), area(1), area(2)];
        let whole: f64 = areas.iter().sum();
        core::array::from_fn(|axis| {
            (0..3).map(|k| (areas[k] / whole) as f32 * self.texture[k][axis]).sum()
        })
    }
}

/// A mesh of a scene, in its place.
#[derive(Debug, Clone)]
pub struct MeshModel {
    /// All triangles with an area.
    pub triangles: Vec<Triangle>,
    /// True if it hides what is behind it.
    pub opaque: bool,
    materials: Vec<Material>,
    brightness: f64,
    color: Option<[f32; 3]>,
    /// True if its materials emit; if none does, their base colours are taken for light.
    emits: bool,
    velocity: MeshVelocity,
}

/// Largest distance of a vertex from the hole.
const FARTHEST: f64 = 1e7;

impl MeshModel {
    /// The mesh of a scene from its decoded file: scaled, turned, moved.
    ///
    /// # Errors
    /// If a vertex comes to lie farther than 1e7 M from the hole.
    pub fn new(mesh: &Mesh, file: &MeshFile) -> Result<Self, Error> {
        let length = norm(mesh.rotation_axis);
        let axis = mesh.rotation_axis.map(|x| x / length);
        let angle = mesh.rotation_deg.to_radians();
        let place = |x: [f64; 3]| {
            let turned = rotate(axis, angle, x.map(|x| x * mesh.scale));
            core::array::from_fn::<f64, 3, _>(|k| turned[k] + mesh.position[k])
        };
        let mut triangles = Vec::with_capacity(file.triangles.len());
        for raw in &file.triangles {
            let corners = raw.corners.map(place);
            let far = corners.map(norm).into_iter().fold(0.0, f64::max);
            // Infinite or NaN where scale or file are out of all bounds.
            if far.is_nan() || far > FARTHEST {
                let allowed = "vertices within 1e7 M of the hole: see `scale` and `position`";
                return Err(Error::out_of_range("mesh vertex distance", far, allowed));
            }
            triangles.extend(Triangle::new(corners, raw.texture, raw.material));
        }
        Ok(MeshModel {
            triangles,
            opaque: mesh.opaque,
            emits: file.materials.iter().any(|m| m.emission.color.iter().any(|c| *c > 0.0)),
            materials: file.materials.clone(),
            brightness: mesh.brightness,
            color: mesh.color,
            velocity: mesh.velocity.unwrap_or(MeshVelocity::Static),
        })
    }

    /// Returns whether it gives off light at all.
    pub fn shines(&self) -> bool {
        self.brightness > 0.0
    }

    /// Intensity (scene units) in the frame of the surface and its colour at a point (M) of a triangle. The
    /// material's colour counts by its largest component.
    pub fn light(&self, triangle: &Triangle, x: [f64; 3]) -> (f64, [f32; 3]) {
        if let Some(color) = self.color {
            return (self.brightness, color);
        }
        let Some(material) = self.materials.get(triangle.material as usize) else {
            return (self.brightness, [1.0; 3]);
        };
        let layer = if self.emits { &material.emission } else { &material.base };
        let color = layer.at(|| triangle.texture_at(x));
        let most = color.into_iter().fold(0.0, f32::max);
        if most > 0.0 {
            (self.brightness * f64::from(most), color.map(|c| c / most))
        } else {
            (0.0, [0.0; 3])
        }
    }

    /// g = ν_obs/ν_em, dimensionless, at a point of a ray; `None` where matter cannot move like this.
    pub fn redshift(&self, hole: &Kerr, point: &PathPoint) -> Option<f64> {
        let rate = match self.velocity {
            MeshVelocity::Static => 0.0,
            MeshVelocity::Keplerian => 1.0 / (point.radius().powf(1.5) + hole.spin()),
        };
        rotating_redshift(hole, point, [0.0, 0.0, rate])
    }
}

#[cfg(test)]
mod tests;

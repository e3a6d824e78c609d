//! Contents of a mesh file, whatever its format.

use super::MeshError;
use super::texture::Texture;

/// Reads what a mesh file refers to by a relative name: materials, buffers, pictures. `Ok(None)` where there is no such
/// file, an error where it cannot or may not be read.
pub type Resources<'a> = dyn Fn(&str) -> Result<Option<Vec<u8>>, String> + 'a;

/// A triangle of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct RawTriangle {
    /// Corners in the file's coordinates.
    pub corners: [[f64; 3]; 3],
    /// Texture coordinates of the corners, v growing downwards.
    pub texture: [[f32; 2]; 3],
    /// Number of its material; `u32::MAX` without one.
    pub material: u32,
}

/// A linear colour and a picture that it multiplies.
#[derive(Debug, Clone, Default)]
pub struct Layer {
    /// The colour.
    pub color: [f32; 3],
    /// The picture.
    pub(super) texture: Option<Texture>,
}

impl Layer {
    /// The colour where texture coordinates are `place()`.
    pub fn at(&self, place: impl Fn() -> [f32; 2]) -> [f32; 3] {
        let Some(texture) = &self.texture else { return self.color };
        let shade = texture.color_at(place());
        core::array::from_fn(|k| self.color[k] * shade[k])
    }
}

/// Appearance of a surface.
#[derive(Debug, Clone, Default)]
pub struct Material {
    /// Light that it emits: `Ke` of an OBJ file, `emissive…` of a glTF file.
    pub emission: Layer,
    /// Its colour under light: `Kd`, `baseColor…`.
    pub base: Layer,
}

/// A decoded mesh file.
#[derive(Debug, Clone, Default)]
pub struct MeshFile {
    /// Triangles; polygons are cut into them.
    pub triangles: Vec<RawTriangle>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Parts of the file that are not shown as it says.
    pub warnings: Vec<String>,
}

/// Most triangles of a file: 4 GiB of them.
const MOST_TRIANGLES: usize = 10_000_000;

impl MeshFile {
    /// Notes something that is not shown as the file says.
    pub(super) fn warn(&mut self, what: String) {
        self.warnings.push(what);
    }

    /// Refuses so many triangles more than it has.
    pub(super) fn affords(&self, more: usize) -> Result<(), MeshError> {
        match self.triangles.len() + more > MOST_TRIANGLES {
            true => {
                Err(MeshError::Content(format!("it holds more than {MOST_TRIANGLES} triangles")))
            }
            false => Ok(()),
        }
    }

    /// Checks that its numbers make triangles and colours.
    pub(super) fn check(&self) -> Result<(), MeshError> {
        let fail = |why: String| Err(MeshError::Content(why));
        if self.triangles.is_empty() {
            return fail("it holds no triangles".to_owned());
        }
        self.affords(0)?;
        let broken = |t: &RawTriangle| {
            let corners = t.corners.iter().flatten().all(|x| x.is_finite());
            !corners || !t.texture.iter().flatten().all(|x| x.is_finite())
        };
        if let Some(k) = self.triangles.iter().position(broken) {
            return fail(format!(
                "triangle {k} (counted from 0) has a coordinate that is not a finite number"
            ));
        }
        let is_color = |layer: &Layer| layer.color.iter().all(|c| (0.0..=1e6).contains(c));
        match self.materials.iter().position(|m| !is_color(&m.emission) || !is_color(&m.base)) {
            Some(k) => fail(format!("material {k} (counted from 0) has a colour outside [0, 1e6]")),
            None => Ok(()),
        }
    }
}

/// Asks for something the file refers to.
pub(super) fn resource(
    resources: &Resources<'_>,
    name: &str,
) -> Result<Option<Vec<u8>>, MeshError> {
    // As Windows writes folders.
    let found = resources(&name.replace('\\', "/"));
    found.map_err(|why| MeshError::Resource { name: name.to_owned(), why })
}

/// The same where it must be there.
pub(super) fn needed(resources: &Resources<'_>, name: &str) -> Result<Vec<u8>, MeshError> {
    let why = "there is no such file".to_owned();
    resource(resources, name)?.ok_or_else(|| MeshError::Resource { name: name.to_owned(), why })
}

//! Wavefront OBJ with its MTL.

use super::MeshError;
use super::file::{Layer, Material, MeshFile, RawTriangle, Resources, resource};
use super::texture::Texture;
use std::cell::RefCell;

pub(super) fn decode(bytes: &[u8], resources: &Resources<'_>) -> Result<MeshFile, MeshError> {
    check_numbers(bytes)?;
    let options = tobj::LoadOptions { triangulate: true, single_index: true, ..Default::default() };
    // The crate drops what went wrong with a material file.
    let failed = RefCell::new(None);
    let load = |path: &std::path::Path| {
        let bytes = resource(resources, &path.to_string_lossy()).map_err(|error| {
            failed.borrow_mut().get_or_insert(error);
            tobj::LoadError::OpenFileFailed
        })?;
        tobj::load_mtl_buf(&mut bytes.as_slice())
    };
    let (models, materials) = tobj::load_obj_buf(&mut &*bytes, &options, load)?;
    if let Some(error) = failed.into_inner() {
        return Err(error);
    }
    let materials = materials?.iter().map(|m| material(m, resources)).collect::<Result<_, _>>()?;
    let triangles = models.iter().flat_map(|model| triangles(&model.mesh)).collect();
    Ok(MeshFile { triangles, materials })
}

/// Refuses vertices of faces and lines whose numbers the crate would take beyond its own: more than ten digits.
fn check_numbers(bytes: &[u8]) -> Result<(), MeshError> {
    for (k, line) in bytes.split(|byte| *byte == b'\n').enumerate() {
        let [b'f' | b'l', b' ' | b'\t', rest @ ..] = line.trim_ascii_start() else { continue };
        if rest.split(|byte| !byte.is_ascii_digit()).any(|digits| digits.len() > 10) {
            return Err(MeshError::Content(format!(
                "line {}: the number of a vertex has more than ten digits",
                k + 1
            )));
        }
    }
    Ok(())
}

fn triangles(mesh: &tobj::Mesh) -> impl Iterator<Item = RawTriangle> + '_ {
    let material = mesh.material_id.map_or(u32::MAX, |id| id as u32);
    mesh.indices.chunks_exact(3).filter_map(move |corners| {
        // Indices were checked by the crate; a file without texture coordinates has none.
        let position = |k: usize| {
            let at = 3 * corners[k] as usize;
            mesh.positions.get(at..at + 3).map(|p| [p[0], p[1], p[2]])
        };
        let place = |k: usize| {
            let at = 2 * corners[k] as usize;
            // v grows upwards in OBJ.
            mesh.texcoords.get(at..at + 2).map_or([0.0; 2], |t| [t[0] as f32, 1.0 - t[1] as f32])
        };
        let corners = [position(0)?, position(1)?, position(2)?];
        Some(RawTriangle { corners, texture: [place(0), place(1), place(2)], material })
    })
}

fn material(material: &tobj::Material, resources: &Resources<'_>) -> Result<Material, MeshError> {
    let single = |c: [f64; 3]| c.map(|c| c as f32);
    let emissive_texture = material.unknown_param.get("map_Ke");
    let picture = |name: Option<&String>| {
        name.map(|name| Texture::decode(&resource(resources, name)?)).transpose()
    };
    // A picture of light without a colour is that light.
    let emission = match (material.emissive, emissive_texture) {
        (Some(color), _) => single(color),
        (None, Some(_)) => [1.0; 3],
        (None, None) => [0.0; 3],
    };
    Ok(Material {
        emission: Layer { color: emission, texture: picture(emissive_texture)? },
        base: Layer {
            color: material.diffuse.map_or([1.0; 3], single),
            texture: picture(material.diffuse_texture.as_ref())?,
        },
    })
}

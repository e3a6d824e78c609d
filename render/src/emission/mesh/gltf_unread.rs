//! Parts of glTF files that are not read: those that move vertices are refused, the rest is told.

use super::MeshError;
use gltf::material::AlphaMode;
use gltf::{Document, Node, Semantic};

/// Extensions that are read, or that change nothing of a surface which shines by itself.
const HARMLESS: [&str; 15] = [
    "KHR_materials_emissive_strength",
    "KHR_texture_transform",
    "KHR_lights_punctual",
    "KHR_materials_unlit",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_clearcoat",
    "KHR_materials_sheen",
    "KHR_materials_iridescence",
    "KHR_materials_anisotropy",
    "KHR_materials_dispersion",
    "KHR_materials_variants",
    "KHR_xmp",
    "KHR_xmp_json_ld",
    "EXT_lights_image_based",
];

/// Returns the parts of a file that are not shown as it says.
pub(super) fn of(document: &Document) -> Vec<String> {
    let primitives = || document.meshes().flat_map(|mesh| mesh.primitives());
    let clear = document.materials().filter(|m| m.alpha_mode() != AlphaMode::Opaque).count();
    let colored = primitives().filter(|p| p.get(&Semantic::Colors(0)).is_some()).count();
    let moving = document.animations().count();
    let told = [
        (clear, "transparent materials: a surface is opaque, or not, as a whole"),
        (colored, "parts with colours of vertices, which are not read"),
        (moving, "animations, which are not read: it is shown at rest"),
    ];
    let told = told.into_iter().filter(|(count, _)| *count > 0);
    let unread = document.extensions_used().filter(|name| !HARMLESS.contains(name));
    let unread = unread.map(|name| format!("extension {name} is not read"));
    told.map(|(count, what)| format!("it has {what}: {count}")).chain(unread).collect()
}

/// Refuses a node whose vertices are not where its matrix puts them.
pub(super) fn refuse(node: &Node<'_>) -> Result<(), MeshError> {
    let fail = |what: &str| {
        let k = node.index();
        Err(MeshError::Content(format!("node {k} (counted from 0) {what} before the export")))
    };
    if node.skin().is_some() && node.mesh().is_some() {
        return fail("has a skin, which is not read: apply its armature");
    }
    let mesh = node.mesh();
    let weights = node.weights().or_else(|| mesh.as_ref().and_then(gltf::Mesh::weights));
    if weights.unwrap_or_default().iter().any(|weight| *weight != 0.0) {
        return fail("has morph targets with weights, which are not read: apply its shape keys");
    }
    Ok(())
}

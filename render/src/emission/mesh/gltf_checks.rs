//! Checks of what the readers of glTF take for granted: sizes, types, sources of pictures, and that nodes are trees.

use super::MeshError;
use gltf::accessor::{DataType, Dimensions};
use gltf::{Accessor, Document, Semantic};
use kerrlight_common::memory;

/// Refuses a file that its readers would not bear.
pub(super) fn check(document: &Document, buffers: &[Vec<u8>]) -> Result<(), MeshError> {
    check_version(document)?;
    check_transforms(document)?;
    check_views(document, buffers)?;
    document.accessors().try_for_each(|accessor| check_accessor(&accessor, buffers))?;
    check_types(document)?;
    check_pictures(document)?;
    check_trees(document)
}

/// Refuses positions that are nowhere, which the crate looks up before it checks them.
pub(super) fn check_positions(document: &Document) -> Result<(), MeshError> {
    let json = document.as_json();
    let count = json.accessors.len();
    let primitives = json.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let accessors = primitives.flat_map(|primitive| primitive.attributes.values());
    match accessors.map(|index| index.value()).find(|k| *k >= count) {
        Some(k) => fail(format!("accessor {k} of an attribute is not there: the file has {count}")),
        None => Ok(()),
    }
}

fn fail(why: String) -> Result<(), MeshError> {
    Err(MeshError::Content(why))
}

fn check_version(document: &Document) -> Result<(), MeshError> {
    let asset = &document.as_json().asset;
    let version = asset.min_version.as_ref().unwrap_or(&asset.version);
    // A later version of 2 may be read as 2.0 unless the file asks for more.
    let is_read = match &asset.min_version {
        Some(least) => least == "2.0",
        None => version.split('.').next() == Some("2"),
    };
    match is_read {
        true => Ok(()),
        false => fail(format!("version {version:?} of glTF is not read: 2.0")),
    }
}

/// Refuses rotations that would change sizes, too, and matrices that are none of an affine map or one of two transforms.
fn check_transforms(document: &Document) -> Result<(), MeshError> {
    for (k, node) in document.as_json().nodes.iter().enumerate() {
        if let Some(matrix) = node.matrix {
            let [.., bottom] =
                [0, 1, 2, 3].map(|row| [0, 4, 8, 12].map(|column| matrix[column + row]));
            if bottom != [0.0, 0.0, 0.0, 1.0] {
                return fail(format!(
                    "node {k} (counted from 0): matrix with a last row of {bottom:?}: 0, 0, 0, 1"
                ));
            }
            if node.translation.is_some() || node.rotation.is_some() || node.scale.is_some() {
                return fail(format!(
                    "node {k} (counted from 0) has a matrix as well as a translation, rotation or scale: one of both"
                ));
            }
        }
        let Some(rotation) = node.rotation else { continue };
        let length = rotation.0.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
        let is_unit = (length - 1.0).abs() <= UNIT;
        if !is_unit {
            return fail(format!("node {k} (counted from 0): rotation of length {length}: 1"));
        }
    }
    Ok(())
}

/// Largest difference of the length of a quaternion from 1: what rounding to a few digits leaves.
const UNIT: f64 = 1e-2;

fn check_views(document: &Document, buffers: &[Vec<u8>]) -> Result<(), MeshError> {
    for view in document.views() {
        let size = buffers.get(view.buffer().index()).map_or(0, Vec::len);
        if view.offset().checked_add(view.length()).is_none_or(|end| end > size) {
            return beyond("buffer view", view.index());
        }
    }
    Ok(())
}

fn beyond(what: &str, k: usize) -> Result<(), MeshError> {
    fail(format!("{what} {k} (counted from 0) reaches beyond its buffer"))
}

/// Returns whether so many items of this size lie in a view.
fn holds(view: &gltf::buffer::View<'_>, offset: usize, count: usize, size: usize) -> bool {
    let step = view.stride().unwrap_or(size);
    // The last item takes its own size, not a whole stride.
    let reach = count.saturating_sub(1).checked_mul(step);
    let end = reach.and_then(|reach| reach.checked_add(offset)?.checked_add(size));
    step >= size && end.is_some_and(|end| end <= view.length())
}

fn check_accessor(accessor: &Accessor<'_>, buffers: &[Vec<u8>]) -> Result<(), MeshError> {
    let (count, size) = (accessor.count(), accessor.size());
    match accessor.view() {
        Some(view) if !holds(&view, accessor.offset(), count, size) => {
            return beyond("accessor", accessor.index());
        }
        Some(_) => {}
        // Zeros, as many as it states, of which some are replaced.
        None => {
            let what = || format!("accessor {} of {count} points", accessor.index());
            memory::afford(what, 64.0 * count as f64)
                .map_err(|error| MeshError::Content(error.to_string()))?;
        }
    }
    let Some(sparse) = accessor.sparse() else { return Ok(()) };
    let (indices, values) = (sparse.indices(), sparse.values());
    let of_index = match indices.index_type() {
        gltf::accessor::sparse::IndexType::U8 => 1,
        gltf::accessor::sparse::IndexType::U16 => 2,
        gltf::accessor::sparse::IndexType::U32 => 4,
    };
    let count = sparse.count();
    let holds_all = holds(&indices.view(), indices.offset(), count, of_index)
        && holds(&values.view(), values.offset(), count, size);
    if !holds_all {
        return beyond("sparse accessor", accessor.index());
    }
    let view = indices.view();
    let step = view.stride().unwrap_or(of_index);
    let buffer = buffers.get(view.buffer().index()).map_or(&[][..], Vec::as_slice);
    let index = |k: usize| {
        let start = view.offset() + indices.offset() + k * step;
        let bytes = buffer.get(start..start + of_index).unwrap_or_default();
        bytes.iter().rev().fold(0, |index, byte| index << 8 | usize::from(*byte))
    };
    match (0..count).map(index).find(|index| *index >= accessor.count()) {
        Some(k) => fail(format!(
            "sparse accessor {} (counted from 0) replaces point {k} of {}",
            accessor.index(),
            accessor.count()
        )),
        None => Ok(()),
    }
}

/// Positions, coordinates in textures and indices have the types that glTF allows.
fn check_types(document: &Document) -> Result<(), MeshError> {
    use DataType::{F32, U8, U16, U32};
    let is = |accessor: &Accessor<'_>, dimensions, types: &[DataType]| {
        if accessor.dimensions() == dimensions && types.contains(&accessor.data_type()) {
            return Ok(());
        }
        let (k, own, of) = (accessor.index(), accessor.dimensions(), accessor.data_type());
        fail(format!(
            "accessor {k} (counted from 0) is {own:?} of {of:?}: {dimensions:?} of {types:?} is expected"
        ))
    };
    for primitive in document.meshes().flat_map(|mesh| mesh.primitives()) {
        if let Some(positions) = primitive.get(&Semantic::Positions) {
            is(&positions, Dimensions::Vec3, &[F32])?;
        }
        if let Some(places) = primitive.get(&Semantic::TexCoords(0)) {
            is(&places, Dimensions::Vec2, &[F32, U8, U16])?;
        }
        if let Some(indices) = primitive.indices() {
            is(&indices, Dimensions::Scalar, &[U8, U16, U32])?;
        }
    }
    Ok(())
}

fn check_pictures(document: &Document) -> Result<(), MeshError> {
    for (k, image) in document.as_json().images.iter().enumerate() {
        if image.uri.is_none() && (image.buffer_view.is_none() || image.mime_type.is_none()) {
            return fail(format!(
                "image {k} (counted from 0) has neither a uri nor a bufferView with its mimeType"
            ));
        }
    }
    Ok(())
}

/// No node has two parents, and those of a scene have none: what hangs from them is finite.
fn check_trees(document: &Document) -> Result<(), MeshError> {
    let mut has_parent = vec![false; document.nodes().len()];
    for child in document.nodes().flat_map(|node| node.children()) {
        if core::mem::replace(&mut has_parent[child.index()], true) {
            return fail(format!("node {} (counted from 0) has two parents", child.index()));
        }
    }
    match document.scenes().flat_map(|scene| scene.nodes()).find(|node| has_parent[node.index()]) {
        Some(node) => fail(format!(
            "node {} (counted from 0) of a scene is the child of another node or of itself",
            node.index()
        )),
        None => Ok(()),
    }
}

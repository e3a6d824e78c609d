//! Writes volumes on the same nodes as a store.

use crate::output::folder::write_folder;
use anyhow::{Context, anyhow};
use kerrlight_render::volume::Volume;
use serde_json::{Map, Value, json};
use std::path::Path;
use std::sync::Arc;
use zarrs::array::codec::ZstdCodec;
use zarrs::array::{
    ArrayBuilder, ArrayMetadataOptions, DataType, Element, ZARR_NAN_F32, ZARR_NAN_F64,
};
use zarrs::filesystem::FilesystemStore;
use zarrs::group::GroupBuilder;

/// Most nodes of a chunk along each direction: a chunk of single precision has 1 MiB.
const CHUNK: u64 = 64;
/// How hard the chunks are compressed.
const LEVEL: i32 = 3;

/// A volume and its name in the store.
pub struct Field<'a> {
    /// Name of the array.
    pub name: &'a str,
    /// What it is, in words.
    pub meaning: &'a str,
    /// Its unit.
    pub unit: &'a str,
    /// Its numbers.
    pub volume: &'a Volume,
}

/// Writes fields on the same nodes, which are at least one, with coordinates `x`, `y` and `z` in M and `attributes` of the
/// group. A store that is there is replaced.
///
/// # Errors
/// If it cannot be written.
pub fn write(
    path: &Path,
    fields: &[Field<'_>],
    attributes: Map<String, Value>,
) -> anyhow::Result<()> {
    write_folder(path, |folder| {
        let failed = |error: &dyn core::fmt::Display| anyhow!("{error}");
        let store = FilesystemStore::new(folder).map_err(|error| failed(&error))?;
        let into = Writing { store: Arc::new(store) };
        into.group(attributes)?;
        let nodes = fields.first().context("no field")?.volume;
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            into.coordinates(name, nodes, axis)?;
        }
        fields.iter().try_for_each(|field| into.field(field))
    })
}

/// A store that is being written.
struct Writing {
    store: Arc<FilesystemStore>,
}

impl Writing {
    fn group(&self, attributes: Map<String, Value>) -> anyhow::Result<()> {
        let mut builder = GroupBuilder::new();
        let group = builder.attributes(attributes).build(self.store.clone(), "/");
        let group = group.map_err(|error| anyhow!("{error}"))?;
        group.store_metadata().map_err(|error| anyhow!("{error}"))
    }

    fn coordinates(&self, name: &str, volume: &Volume, axis: usize) -> anyhow::Result<()> {
        let (count, low, high) = (volume.nodes()[axis], volume.low()[axis], volume.high()[axis]);
        let at = |k: usize| {
            if k + 1 == count { high } else { low + (high - low) * k as f64 / (count - 1) as f64 }
        };
        let values: Vec<f64> = (0..count).map(at).collect();
        let mut builder = ArrayBuilder::new(
            vec![count as u64],
            vec![count as u64],
            DataType::Float64,
            ZARR_NAN_F64,
        );
        builder.dimension_names([name].into());
        self.array(&mut builder, name, &values, json!({"units": "GM/c^2", "long_name": name}))
    }

    fn field(&self, field: &Field<'_>) -> anyhow::Result<()> {
        let Field { name, meaning, unit, volume } = field;
        let shape = volume.nodes().map(|n| n as u64);
        let chunk = shape.map(|n| n.min(CHUNK));
        // A chunk that gets lost is read as what is not a number, not as darkness.
        let mut builder = ArrayBuilder::new(shape.to_vec(), chunk, DataType::Float32, ZARR_NAN_F32);
        builder.dimension_names(["x", "y", "z"].into());
        self.array(
            &mut builder,
            name,
            volume.values(),
            json!({"units": unit, "long_name": meaning}),
        )
    }

    fn array<T: Element>(
        &self,
        builder: &mut ArrayBuilder,
        name: &str,
        values: &[T],
        attributes: Value,
    ) -> anyhow::Result<()> {
        let named = || format!("array {name}");
        builder.attributes(attributes.as_object().cloned().unwrap_or_default());
        builder.bytes_to_bytes_codecs(vec![Arc::new(ZstdCodec::new(LEVEL, true))]);
        let array = builder.build(self.store.clone(), &format!("/{name}"));
        let array = array.map_err(|error| anyhow!("{error}")).with_context(named)?;
        let plain = ArrayMetadataOptions::default().with_include_zarrs_metadata(false);
        array.store_metadata_opt(&plain).map_err(|error| anyhow!("{error}")).with_context(named)?;
        let written = array.store_array_subset_elements(&array.subset_all(), values);
        written.map_err(|error| anyhow!("{error}")).with_context(named)
    }
}

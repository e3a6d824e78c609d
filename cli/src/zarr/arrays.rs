//! Arrays of a store, and numbers of their chunks.

use super::has_metadata;
use anyhow::{Context, anyhow, bail};
use kerrlight_common::memory;
use serde_json::{Map, Value};
use std::path::Path;
use std::sync::Arc;
use zarrs::array::{Array, DataType, ElementOwned, unravel_index};
use zarrs::array_subset::ArraySubset;
use zarrs::filesystem::FilesystemStore;
use zarrs::group::Group;

/// A group of arrays, or an array with those beside it.
pub struct Store {
    files: Arc<FilesystemStore>,
    /// Names of its arrays, in order.
    pub names: Vec<String>,
    /// The array that was named, if it was not a group.
    pub chosen: Option<String>,
    /// What the group tells of itself.
    pub attributes: Map<String, Value>,
}

impl Store {
    /// Of a group or an array.
    ///
    /// # Errors
    /// If there is no such store, or it is damaged.
    pub fn open(path: &Path) -> anyhow::Result<Self> {
        if !has_metadata(path) {
            bail!("holds no zarr.json: no store of Zarr, or a damaged one");
        }
        let group = match Self::group(path) {
            Ok(store) => return Ok(store),
            Err(error) => error,
        };
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default().to_owned();
        let Some(parent) = path.parent().filter(|parent| has_metadata(parent)) else {
            let files = files_of(path)?;
            // An array alone: its path in the store has no name.
            Reading::open(&files, "")?;
            let (names, chosen) = (vec![String::new()], Some(String::new()));
            return Ok(Store { files, names, chosen, attributes: Map::new() });
        };
        let store = Self::group(parent)?;
        if !store.names.contains(&name) {
            return Err(group);
        }
        Ok(Store { chosen: Some(name), ..store })
    }

    fn group(path: &Path) -> anyhow::Result<Self> {
        let damaged = |error: &dyn core::fmt::Display| anyhow!("damaged store: {error}");
        let files = files_of(path)?;
        let group = Group::open(files.clone(), "/").map_err(|error| damaged(&error))?;
        let arrays = group.child_array_paths().map_err(|error| damaged(&error))?;
        let names = arrays.iter().map(|path| path.as_str().trim_start_matches('/').to_owned());
        let mut names: Vec<String> = names.collect();
        names.sort();
        Ok(Store { files, names, chosen: None, attributes: group.attributes().clone() })
    }

    /// The array of this name, if there is one.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn array(&self, name: &str) -> anyhow::Result<Option<Reading>> {
        let there = self.names.iter().any(|one| one == name);
        there.then(|| Reading::open(&self.files, name)).transpose()
    }

    /// The array that was named, or the one of this name.
    ///
    /// # Errors
    /// If there is none, or it cannot be read.
    pub fn wanted(&self, name: &str) -> anyhow::Result<Reading> {
        let name = self.chosen.as_deref().unwrap_or(name);
        let names = || self.names.join(", ");
        self.array(name)?.with_context(|| format!("holds {}: no array named {name}", names()))
    }
}

fn files_of(path: &Path) -> anyhow::Result<Arc<FilesystemStore>> {
    // Its paths are told in texts.
    Ok(Arc::new(FilesystemStore::new(path).map_err(|error| anyhow!("{error}"))?))
}

/// An array that is read part by part.
pub struct Reading {
    /// Its name in the group.
    pub name: String,
    array: Array<FilesystemStore>,
}

impl Reading {
    fn open(files: &Arc<FilesystemStore>, name: &str) -> anyhow::Result<Self> {
        let array = Array::open(files.clone(), &format!("/{name}"));
        let array = array.map_err(|error| anyhow!("array {name}: damaged or unusual: {error}"))?;
        Ok(Self { name: name.to_owned(), array })
    }

    /// Length along each dimension.
    pub fn shape(&self) -> &[u64] {
        self.array.shape()
    }

    /// The type of its values.
    pub fn kind(&self) -> String {
        self.array.data_type().to_string()
    }

    /// Whether its values are numbers that are read.
    pub fn is_numbers(&self) -> bool {
        use DataType::{
            Float32, Float64, Int8, Int16, Int32, Int64, UInt8, UInt16, UInt32, UInt64,
        };
        let kind = self.array.data_type();
        let floats = matches!(kind, Float32 | Float64);
        floats || matches!(kind, Int8 | Int16 | Int32 | Int64 | UInt8 | UInt16 | UInt32 | UInt64)
    }

    /// What it tells of itself.
    pub fn attributes(&self) -> &Map<String, Value> {
        self.array.attributes()
    }

    /// Lengths of the first chunk.
    pub fn chunk(&self) -> anyhow::Result<Vec<u64>> {
        let shape = self.array.chunk_shape(&vec![0; self.shape().len()]);
        let shape = shape.map_err(|error| self.failed(&error))?;
        Ok(shape.iter().map(|length| length.get()).collect())
    }

    /// All numbers, the last dimension fastest.
    ///
    /// # Errors
    /// If they are no numbers, do not fit into memory, or a chunk is damaged.
    pub fn all(&self) -> anyhow::Result<Vec<f64>> {
        self.part(&ArraySubset::new_with_shape(self.shape().to_vec()))
    }

    /// Hands over the numbers of one chunk after the other.
    ///
    /// # Errors
    /// As those of [`Self::all`].
    pub fn chunks(&self, mut take: impl FnMut(Vec<f64>)) -> anyhow::Result<()> {
        let grid = self.array.chunk_grid_shape().clone();
        for k in 0..grid.iter().product() {
            let Some(chunk) = unravel_index(k, &grid) else { break };
            let part = self.array.chunk_subset_bounded(&chunk);
            take(self.part(&part.map_err(|error| self.failed(&error))?)?);
        }
        Ok(())
    }

    /// Hands over all numbers in order, for as many of the first dimension together as a chunk has.
    ///
    /// # Errors
    /// Those of `take`, and as those of [`Self::all`].
    pub fn slabs(&self, mut take: impl FnMut(&[f64]) -> anyhow::Result<()>) -> anyhow::Result<()> {
        let step = self.chunk()?.first().copied().unwrap_or(1);
        let Some((count, rest)) = self.shape().split_first() else {
            bail!("{}: one number", self.name)
        };
        for from in (0..*count).step_by(step as usize) {
            let ranges = std::iter::once(from..(from + step).min(*count));
            let ranges: Vec<_> = ranges.chain(rest.iter().map(|length| 0..*length)).collect();
            take(&self.part(&ArraySubset::new_with_ranges(&ranges))?)?;
        }
        Ok(())
    }

    fn part(&self, part: &ArraySubset) -> anyhow::Result<Vec<f64>> {
        match self.array.data_type() {
            DataType::Float32 => self.of::<f32>(part, f64::from),
            DataType::Float64 => self.of::<f64>(part, |x| x),
            DataType::Int8 => self.of::<i8>(part, f64::from),
            DataType::Int16 => self.of::<i16>(part, f64::from),
            DataType::Int32 => self.of::<i32>(part, f64::from),
            DataType::Int64 => self.of::<i64>(part, |n| n as f64),
            DataType::UInt8 => self.of::<u8>(part, f64::from),
            DataType::UInt16 => self.of::<u16>(part, f64::from),
            DataType::UInt32 => self.of::<u32>(part, f64::from),
            DataType::UInt64 => self.of::<u64>(part, |n| n as f64),
            other => bail!(
                "array {}: values of type {other}: whole numbers, float32 or float64 are expected",
                self.name
            ),
        }
    }

    fn of<T: ElementOwned>(
        &self,
        part: &ArraySubset,
        value: impl Fn(T) -> f64,
    ) -> anyhow::Result<Vec<f64>> {
        let numbers = |lengths: &[u64]| lengths.iter().map(|n| *n as f64).product::<f64>();
        let (wanted, chunk) = (numbers(part.shape()), numbers(&self.chunk()?));
        let bytes =
            wanted * (size_of::<T>() + size_of::<f64>()) as f64 + chunk * size_of::<T>() as f64;
        let what = || format!("array {}: {wanted} numbers in chunks of {chunk}", self.name);
        memory::afford(what, bytes)?;
        let values = self.array.retrieve_array_subset_elements::<T>(part);
        let values = values.map_err(|error| self.failed(&error))?;
        Ok(values.into_iter().map(value).collect())
    }

    fn failed(&self, error: &dyn core::fmt::Display) -> anyhow::Error {
        anyhow!("{error}").context(format!("array {} is damaged", self.name))
    }
}

//! A fit's memory as bytes: safetensors, with a header in TOML that a person can read.

use super::state::{Progress, State};
use crate::Error;
use crate::fit::forward::occupancy::Occupancy;
use crate::optimise::AdamState;
use kerrlight_common::toml_file;
use kerrlight_render::dynamics::Axis;
use safetensors::tensor::{Dtype, SafeTensorError, TensorView};
use safetensors::{SafeTensors, serialize};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::ops::Range;

/// Reason why bytes are no checkpoint of this fit.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// Not safetensors.
    #[error("not a checkpoint: {0}")]
    Format(#[from] SafeTensorError),
    /// Not by kerrlight, or damaged.
    #[error("not a checkpoint of a fit: {0}")]
    Header(String),
    /// Bytes that are not those that were written.
    #[error("damaged: the stored checksum is {written:08x}, that of the bytes {found:08x}")]
    Damaged {
        /// Checksum as it was written.
        written: u32,
        /// Checksum of the bytes.
        found: u32,
    },
    /// A tensor that does not fit.
    #[error("tensor {name} has {found} numbers where {wanted} are expected")]
    Tensor {
        /// Its name.
        name: String,
        /// Number of its parameters.
        found: usize,
        /// Number of parameters that the fit needs.
        wanted: usize,
    },
}

/// Header in front of a checkpoint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Version of the program.
    pub version: String,
    /// Steps taken.
    pub step: u64,
    /// Steps taken by the state that is gone back to; none yet, without it.
    pub good_step: Option<u64>,
    /// Number of times it has gone back.
    pub setbacks: u32,
    /// The settings of the fit, as they were given.
    pub settings: String,
}

/// The only key: a map with more has no fixed order.
const KEY: &str = "kerrlight";

/// The bytes of a state.
///
/// # Errors
/// If they cannot be laid out.
pub fn encode(state: &State<f32>, settings: &str) -> Result<Vec<u8>, Error> {
    let header = Header {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        step: state.now.step,
        good_step: state.good.as_ref().map(|good| good.step),
        setbacks: state.setbacks,
        settings: settings.to_owned(),
    };
    let text =
        toml_file::write(&header).map_err(|error| CheckpointError::Header(error.to_string()))?;
    // The sum of all bytes is known last, and needs a place from the beginning.
    let mut tensors = vec![(CHECKSUM.to_owned(), Dtype::U32, vec![0; 4])];
    push("now", &state.now, &mut tensors);
    if let Some(good) = &state.good {
        push("good", good, &mut tensors);
    }
    let views = tensors
        .iter()
        .map(|(name, dtype, bytes)| {
            let size = if *dtype == Dtype::F64 { 8 } else { 4 };
            let view = TensorView::new(*dtype, vec![bytes.len() / size], bytes)?;
            Ok((name.as_str(), view))
        })
        .collect::<Result<Vec<_>, SafeTensorError>>()
        .map_err(CheckpointError::from)?;
    let mut bytes = serialize(views, Some(HashMap::from([(KEY.to_owned(), text)])))
        .map_err(CheckpointError::from)?;
    let at = checksum_place(&bytes)?;
    let sum = checksum(&bytes, &at);
    bytes[at].copy_from_slice(&sum.to_le_bytes());
    Ok(bytes)
}

/// The tensor that holds the checksum of all other bytes.
const CHECKSUM: &str = "checksum";

/// Returns the range of the bytes of the checksum.
fn checksum_place(bytes: &[u8]) -> Result<Range<usize>, CheckpointError> {
    let (length, metadata) = SafeTensors::read_metadata(bytes)?;
    let missing = || CheckpointError::Header("its checksum is missing".to_owned());
    let tensor = metadata.info(CHECKSUM).ok_or_else(missing)?;
    // Behind eight bytes of the header's length.
    let (from, to) = (8 + length + tensor.data_offsets.0, 8 + length + tensor.data_offsets.1);
    if tensor.dtype != Dtype::U32 || to - from != 4 || to > bytes.len() {
        return Err(missing());
    }
    Ok(from..to)
}

/// CRC-32 of all bytes but those of the checksum, which count as 0.
fn checksum(bytes: &[u8], at: &Range<usize>) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&bytes[..at.start]);
    hasher.update(&[0; 4]);
    hasher.update(&bytes[at.end..]);
    hasher.finalize()
}

/// Refuses bytes that are not those that were written.
fn check(bytes: &[u8]) -> Result<(), CheckpointError> {
    let at = checksum_place(bytes)?;
    let found = checksum(bytes, &at);
    let mut written = [0; 4];
    written.copy_from_slice(&bytes[at]);
    let written = u32::from_le_bytes(written);
    if written == found { Ok(()) } else { Err(CheckpointError::Damaged { written, found }) }
}

type Tensor = (String, Dtype, Vec<u8>);

fn push(of: &str, progress: &Progress<f32>, tensors: &mut Vec<Tensor>) {
    let mut single = |name: &str, numbers: &[f32]| {
        let bytes = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        tensors.push((format!("{of}.{name}"), Dtype::F32, bytes));
    };
    single("parameters", &progress.parameters);
    single("adam.first", &progress.adam.first);
    single("adam.second", &progress.adam.second);
    if let Some(mask) = &progress.occupancy {
        single("brightness", &mask.brightness);
    }
    let mut double = |name: &str, numbers: &[f64]| {
        let bytes = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        tensors.push((format!("{of}.{name}"), Dtype::F64, bytes));
    };
    double("axis", &progress.axis.vector());
    double("axis.first", &progress.axis_adam.first);
    double("axis.second", &progress.axis_adam.second);
    // Exact below 2⁵³.
    double("adam.steps", &[progress.adam.steps as f64, progress.axis_adam.steps as f64]);
    double("caution", &[progress.caution, progress.loss]);
}

/// The header of a checkpoint.
///
/// # Errors
/// If it is none.
pub fn header(bytes: &[u8]) -> Result<Header, Error> {
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(CheckpointError::from)?;
    let missing = || CheckpointError::Header("its header is missing".to_owned());
    let text = metadata.metadata().as_ref().and_then(|map| map.get(KEY)).ok_or_else(missing)?;
    Ok(toml_file::read(text).map_err(|error| CheckpointError::Header(error.to_string()))?)
}

/// The state of a checkpoint, for a fit that would start as `start`.
///
/// # Errors
/// If it is none, damaged, or one of another fit.
pub fn decode(bytes: &[u8], start: &State<f32>) -> Result<State<f32>, Error> {
    // First of all: damaged bytes may still be tensors of the right size.
    check(bytes)?;
    let header = header(bytes)?;
    let tensors = SafeTensors::deserialize(bytes).map_err(CheckpointError::from)?;
    let read = |of: &str, step| progress(&tensors, of, step, &start.now);
    let good = header.good_step.map(|step| read("good", step)).transpose()?;
    let now = read("now", header.step)?;
    Ok(State { now, good: good.map(Box::new), setbacks: header.setbacks })
}

fn progress(
    tensors: &SafeTensors<'_>,
    of: &str,
    step: u64,
    start: &Progress<f32>,
) -> Result<Progress<f32>, CheckpointError> {
    let count = start.parameters.len();
    let single = |name: &str, wanted| {
        let words = words::<4>(tensors, &format!("{of}.{name}"), Dtype::F32, wanted)?;
        Ok::<_, CheckpointError>(words.map(f32::from_le_bytes).collect::<Vec<f32>>())
    };
    let double = |name: &str, wanted| {
        let words = words::<8>(tensors, &format!("{of}.{name}"), Dtype::F64, wanted)?;
        Ok::<_, CheckpointError>(words.map(f64::from_le_bytes).collect::<Vec<f64>>())
    };
    let (axis, steps, rest) = (double("axis", 3)?, double("adam.steps", 2)?, double("caution", 2)?);
    let adam = AdamState {
        steps: steps[0] as u64,
        first: single("adam.first", start.adam.first.len())?,
        second: single("adam.second", start.adam.second.len())?,
    };
    let axis_adam = AdamState {
        steps: steps[1] as u64,
        first: double("axis.first", 3)?,
        second: double("axis.second", 3)?,
    };
    let mask = |start: &Occupancy| {
        let mut mask = start.clone();
        mask.brightness = single("brightness", mask.brightness.len())?;
        // Which cells may shine follows from their brightness.
        mask.mark();
        Ok::<_, CheckpointError>(mask)
    };
    Ok(Progress {
        step,
        parameters: single("parameters", count)?,
        adam,
        // Normalised once more, it could differ in its last bits.
        axis: Axis::exact([axis[0], axis[1], axis[2]])
            .map_err(|error| CheckpointError::Header(error.to_string()))?,
        axis_adam,
        occupancy: start.occupancy.as_ref().map(mask).transpose()?,
        caution: rest[0],
        loss: rest[1],
    })
}

fn words<'a, const SIZE: usize>(
    tensors: &SafeTensors<'a>,
    name: &str,
    dtype: Dtype,
    wanted: usize,
) -> Result<impl Iterator<Item = [u8; SIZE]> + use<'a, SIZE>, CheckpointError> {
    let tensor = tensors.tensor(name)?;
    let found = if tensor.dtype() == dtype { tensor.data().len() / SIZE } else { 0 };
    if found != wanted {
        return Err(CheckpointError::Tensor { name: name.to_owned(), found, wanted });
    }
    Ok(tensor.data().chunks_exact(SIZE).map(|chunk| {
        let mut word = [0; SIZE];
        word.copy_from_slice(chunk);
        word
    }))
}

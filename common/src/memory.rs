//! Limits on memory. What a number of a user or of a file's header decides is estimated before it is allocated: nothing is
//! begun that cannot end.

use crate::Error;
use std::cell::Cell;
use std::io::{Read, Seek, Write};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes that may be taken.
static LIMIT: AtomicU64 = AtomicU64::new(u64::MAX);

std::thread_local! {
    /// The same for work on this thread, where that is another number.
    static OF_THREAD: Cell<Option<u64>> = const { Cell::new(None) };
}

/// Something would take more memory than there is.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{what} would take {} of memory, but the limit is {}", shown(*.needed), shown(*.limit as f64))]
pub struct TooLarge {
    /// Name of the thing that needs the memory.
    pub what: String,
    /// Bytes, estimated.
    pub needed: f64,
    /// Bytes that may be taken.
    pub limit: u64,
}

/// Sets how many bytes may be taken by this process; without it there is no limit.
pub fn set_limit(bytes: u64) {
    // Nothing else is published with this number: it needs no order.
    LIMIT.store(bytes, Ordering::Relaxed);
}

/// Sets how many bytes may be taken by work on this thread. A pool of threads does this when each of them starts.
pub fn set_limit_of_thread(bytes: u64) {
    OF_THREAD.set(Some(bytes));
}

/// Returns the number of bytes that may be taken.
pub fn limit() -> u64 {
    OF_THREAD.get().unwrap_or_else(|| LIMIT.load(Ordering::Relaxed))
}

/// A part of the bytes that may be taken, from 0 to 1.
pub fn part(part: f64) -> f64 {
    part * limit() as f64
}

/// A file for what does not fit into memory.
pub trait Scratch: Read + Write + Seek + Send {}

impl<F: Read + Write + Seek + Send> Scratch for F {}

/// Makes an empty one that has room for so many bytes.
pub type MakeScratch = fn(f64) -> std::io::Result<Box<dyn Scratch>>;

static SCRATCH: OnceLock<MakeScratch> = OnceLock::new();

/// Says how files are made for what does not fit into memory; without it, what does not fit is refused. The first call
/// counts.
pub fn set_scratch(make: MakeScratch) {
    let _ = SCRATCH.set(make);
}

/// An empty file with room for so many bytes, if it was said how to make one.
pub fn scratch(bytes: f64) -> Option<std::io::Result<Box<dyn Scratch>>> {
    SCRATCH.get().map(|make| make(bytes))
}

/// Refuses what would take more bytes than may be taken.
///
/// # Errors
/// Names it with what it would take and what there is.
pub fn afford(what: impl FnOnce() -> String, bytes: f64) -> Result<(), Error> {
    let limit = limit();
    if bytes <= limit as f64 {
        return Ok(());
    }
    Err(TooLarge { what: what(), needed: bytes, limit }.into())
}

/// Bytes as people write them: 3.5 GiB.
pub fn shown(bytes: f64) -> String {
    const UNITS: [&str; 7] = ["bytes", "KiB", "MiB", "GiB", "TiB", "PiB", "EiB"];
    let power = (bytes.max(1.0).log2() / 10.0).floor().clamp(0.0, 6.0) as usize;
    match power {
        0 => format!("{bytes:.0} bytes"),
        power => format!("{:.1} {}", bytes / 1024f64.powi(power as i32), UNITS[power]),
    }
}

/// Bytes of a decoded picture of colours: as it is decoded, in single precision, and as it is kept.
pub fn colours(width: f64, height: f64) -> f64 {
    width * height * (16.0 + 12.0 + 12.0)
}

/// Bytes of the channels of an EXR that is decoded: blocks, samples and channels.
pub fn channels(width: f64, height: f64, channels: f64) -> f64 {
    width * height * channels * 12.0
}

/// An array that is read: its bytes, and its values in double precision.
pub fn array(bytes: f64, values: f64) -> f64 {
    bytes + 8.0 * values
}

/// Bands of a picture that are under way, one for each thread and two more: pixels of 130 bytes.
pub fn bands(width: f64, threads: f64) -> f64 {
    130.0 * 16.0 * width * (threads + 2.0)
}

/// Bytes of the frames of a film that are rendered together: values, and what they are made of.
pub fn frames(frames: f64, pixels: f64, channels: f64) -> f64 {
    4.0 * frames * pixels * (channels + 2.0)
}

/// Bytes of a movie in double precision.
pub fn movie(frames: f64, pixels: f64) -> f64 {
    8.0 * frames * pixels
}

/// Nodes on the rays of a fit: as they are traced, and as the forward model keeps them in single precision;
/// `columns` of momenta and delays beside positions, rates and weights.
pub fn nodes(nodes: f64, columns: f64) -> f64 {
    nodes * (8.0 + 4.0) * (5.0 + columns)
}

/// Bytes of the parameters of a representation: as they are, moments of the steps, gradients, all of that once more to go back to,
/// and a checkpoint.
pub fn parameters(parameters: f64) -> f64 {
    4.0 * parameters * 10.0
}

/// Bytes of a volume on nodes along each axis, with the truth and what is written of both.
pub fn volume(nodes: f64) -> f64 {
    4.0 * nodes.powi(3) * 6.0
}

/// Bytes of the points of a traced ray and the table of them: numbers as they are traced, as columns, and as text.
pub fn table(rows: f64, numbers: f64) -> f64 {
    rows * numbers * (8.0 + 8.0 + 24.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_bytes_as_people_write_them() {
        let all = [0.0, 1023.0, 1024.0, 1536.0, 5.0 * 1024f64.powi(3), 1e30];
        let words = all.map(shown);
        let expected =
            ["0 bytes", "1023 bytes", "1.0 KiB", "1.5 KiB", "5.0 GiB", "867361737988.4 EiB"];
        assert_eq!(words, expected);
    }

    #[test]
    fn exact_what_is_too_large_is_named() {
        afford(|| unreachable!(), 1e18).unwrap();
        let error = TooLarge { what: "a sky".to_owned(), needed: 3e9, limit: 1 << 30 };
        let said = "a sky would take 2.8 GiB of memory, but the limit is 1.0 GiB";
        assert_eq!(error.to_string(), said);
    }
}

//! A fit by the ranks of one job: each takes parts of every step, and the first one adds them up. All ranks have the same
//! state after every step, and it does not depend on how many there are.

use super::folder::Folder;
use crate::output;
use crate::ranks::{self, Connection, Listener};
use anyhow::Context;
use kerrlight_tomo::fit::Loss;
use kerrlight_tomo::fit::parts::{Part, Ranks, combine, nodes, share};
use kerrlight_tomo::fit::settings::{FitFile, Kind};
use kerrlight_tomo::representation::InstructionSet;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether other ranks than the first have anything to do in a fit.
pub fn is_divided(file: &FitFile) -> bool {
    file.training.parts > 1 && file.representation.kind != Kind::LinearGrid
}

/// Has other ranks come to the first one, if there are any; `is_known` says whether they know where the run is.
pub fn open(
    file: &FitFile,
    text: &str,
    folder: &Folder,
    is_known: bool,
) -> anyhow::Result<Option<Listener>> {
    let Some((0, size)) = ranks::this() else { return Ok(None) };
    if !is_divided(file) || !is_known {
        let need = match is_known {
            true => "training.parts > 1, and steps",
            false => "to know where the run is: give -o or --resume",
        };
        eprintln!("note: rank 0 fits alone; for their share the other {} need {need}", size - 1);
        return Ok(None);
    }
    Listener::open(folder.path(), size, facts(text)).map(Some)
}

/// What decides the bits of a fit.
fn facts(text: &str) -> String {
    let (version, arch) = (env!("CARGO_PKG_VERSION"), std::env::consts::ARCH);
    let set = InstructionSet::best();
    format!(
        "kerrlight {version} on {arch} with {set:?} and settings of checksum {:08x}",
        crc32fast::hash(text.as_bytes())
    )
}

/// Gives the state to all other ranks when they have come.
pub fn begin(listener: Listener, state: &[u8], run: &Path) -> anyhow::Result<Box<dyn Ranks<f32>>> {
    let run = run.to_owned();
    let mut connections = listener.gather(|rank| {
        let run = run.clone();
        Box::new(move || gone(rank, &run))
    })?;
    connections.iter_mut().try_for_each(|connection| connection.send(state))?;
    Ok(Box::new(First { connections, run }))
}

/// Comes to the first rank as another one, with the same settings.
pub fn join((run, rank, size): (&Path, u32, u32), text: &str) -> anyhow::Result<Other> {
    // The first rank has said why, or was killed.
    let lost = Box::new(|| std::process::exit(1));
    Ok(Other { connection: ranks::connect(run, rank, &facts(text), lost)?, rank, size })
}

/// Ends the program for the loss of a rank: steps need all of them, and the last checkpoint has what was found.
fn gone(rank: u32, run: &Path) {
    fail(&format!("rank {rank} is gone"), run);
}

fn fail(what: &str, run: &Path) -> ! {
    static IS_TOLD: AtomicBool = AtomicBool::new(false);
    if !IS_TOLD.swap(true, Ordering::Relaxed) {
        let run = run.display();
        eprintln!(
            "\nerror: {what}: the fit has stopped; resume it with any number of ranks: kerrlight fit --resume {run}"
        );
    }
    output::remove_unfinished();
    std::process::exit(1)
}

/// The first rank, which adds up.
struct First {
    connections: Vec<Connection>,
    run: PathBuf,
}

impl First {
    fn size(&self) -> usize {
        self.connections.len() + 1
    }
}

impl Ranks<f32> for First {
    fn mine(&self, parts: usize) -> Range<usize> {
        share(0, self.size(), parts)
    }

    fn sum(&mut self, parts: usize, state: u32, own: Vec<Part<f32>>) -> Part<f32> {
        let size = self.size();
        let ranges = (0..size).flat_map(|k| nodes(0..parts, &share(k, size, parts)));
        let mut all = own;
        for (k, connection) in self.connections.iter_mut().enumerate() {
            // One that is gone ends the program.
            let bytes = connection.receive().unwrap_or_default();
            match decode(&bytes) {
                Ok((theirs, found)) if theirs == state => all.extend(found),
                Ok(_) => fail(
                    &format!("rank {} has come to another state than rank 0", k + 1),
                    &self.run,
                ),
                Err(error) => {
                    fail(&format!("rank {} has sent no sums: {error:#}", k + 1), &self.run)
                }
            }
        }
        let sum = combine(0..parts, &mut ranges.zip(all));
        let bytes = encode(state, std::slice::from_ref(&sum));
        for (k, connection) in self.connections.iter_mut().enumerate() {
            if connection.send(&bytes).is_err() {
                gone(k as u32 + 1, &self.run);
            }
        }
        sum
    }
}

impl Drop for First {
    fn drop(&mut self) {
        self.connections.iter_mut().for_each(Connection::end);
    }
}

/// Any other rank.
pub struct Other {
    connection: Connection,
    rank: u32,
    size: u32,
}

impl Other {
    /// The state that all begin with, as bytes, when the first rank has come so far.
    pub fn state(&mut self) -> anyhow::Result<Vec<u8>> {
        self.connection.receive().context("rank 0 has stopped")
    }
}

impl Ranks<f32> for Other {
    fn mine(&self, parts: usize) -> Range<usize> {
        share(self.rank as usize, self.size as usize, parts)
    }

    fn sum(&mut self, _: usize, state: u32, own: Vec<Part<f32>>) -> Part<f32> {
        // If the first rank does not take it any more, it does not answer either.
        let _ = self.connection.send(&encode(state, &own));
        let found = self.connection.receive().map(|bytes| decode(&bytes));
        match found {
            Some(Ok((_, mut parts))) if parts.len() == 1 => parts.remove(0),
            // It was told to stop, and has said what there is to say.
            _ => std::process::exit(0),
        }
    }
}

impl Drop for Other {
    fn drop(&mut self) {
        self.connection.end();
    }
}

/// The checksum of a state and sums as bytes.
fn encode(state: u32, parts: &[Part<f32>]) -> Vec<u8> {
    let size = |part: &Part<f32>| 64 + 8 * part.loss.terms.len() + 4 * part.gradient.len();
    let mut bytes = Vec::with_capacity(8 + parts.iter().map(size).sum::<usize>());
    bytes.extend([state, parts.len() as u32].map(u32::to_le_bytes).concat());
    for Part { gradient, of_axis, loss } in parts {
        let counts = [loss.points, loss.terms.len(), gradient.len()];
        bytes.extend(counts.map(|count| (count as u64).to_le_bytes()).concat());
        bytes.extend(loss.total.to_le_bytes());
        of_axis.iter().chain(&loss.terms).for_each(|x| bytes.extend(x.to_le_bytes()));
        let from = bytes.len();
        bytes.resize(from + 4 * gradient.len(), 0);
        for (four, x) in bytes[from..].chunks_exact_mut(4).zip(gradient) {
            four.copy_from_slice(&x.to_le_bytes());
        }
    }
    bytes
}

/// What [`encode`] has made into bytes.
fn decode(mut bytes: &[u8]) -> anyhow::Result<(u32, Vec<Part<f32>>)> {
    let rest = &mut bytes;
    let [state, count] = [number(rest)?, number(rest)?].map(u32::from_le_bytes);
    let mut parts = Vec::new();
    for _ in 0..count {
        let whole = |rest: &mut &[u8]| anyhow::Ok(u64::from_le_bytes(number(rest)?) as usize);
        let real = |rest: &mut &[u8]| anyhow::Ok(f64::from_le_bytes(number(rest)?));
        let (points, terms, length) = (whole(rest)?, whole(rest)?, whole(rest)?);
        let total = real(rest)?;
        let of_axis = [real(rest)?, real(rest)?, real(rest)?];
        let terms = (0..terms).map(|_| real(rest)).collect::<anyhow::Result<Vec<f64>>>()?;
        let four = length.checked_mul(4).and_then(|length| rest.split_at_checked(length));
        let (numbers, behind) = four.context("it ends too early")?;
        *rest = behind;
        let gradient =
            numbers.chunks_exact(4).map(|x| f32::from_le_bytes([x[0], x[1], x[2], x[3]]));
        let loss = Loss { total, terms, points, ..Loss::default() };
        parts.push(Part { gradient: gradient.collect(), of_axis, loss });
    }
    Ok((state, parts))
}

fn number<const N: usize>(rest: &mut &[u8]) -> anyhow::Result<[u8; N]> {
    let (number, behind) = rest.split_first_chunk().context("it ends too early")?;
    *rest = behind;
    Ok(*number)
}

#[cfg(test)]
mod network;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_sums_are_the_same_bits_on_the_other_side() {
        let part = |count: usize| Part {
            gradient: (0..count).map(|k| (k as f32 - 3.0) * 0.1).collect(),
            of_axis: [0.1, -0.2, f64::MIN_POSITIVE],
            loss: Loss { total: 0.3, terms: vec![1.5; count], points: 7, ..Loss::default() },
        };
        let parts = [part(5), part(0)];
        let bytes = encode(0xdead_beef, &parts);
        assert_eq!(decode(&bytes).unwrap(), (0xdead_beef, parts.to_vec()));
        for end in 0..bytes.len() {
            assert!(decode(&bytes[..end]).is_err(), "{end}");
        }
    }
}

//! The program `kerrlight`: from scene files to lensed images of black holes, and from data to emission.
//!
//! It is a library so that a program of one's own can be all of `kerrlight` and more:
//!
//! ```no_run
//! # use kerrlight_cli::{OwnSettings, Program};
//! # use kerrlight_tomo::representation::{Network, NetworkSettings, Representation};
//! fn small(own: &OwnSettings) -> anyhow::Result<Box<dyn Representation<f32>>> {
//!     let width = own.number("width", 8.0..=512.0)? as usize;
//!     Ok(Box::new(Network::new(NetworkSettings { width, ..NetworkSettings::bhnerf() })?))
//! }
//!
//! fn main() -> std::process::ExitCode {
//!     Program::new().representation("small", small).run()
//! }
//! ```
//!
//! From then on `representation.kind = "small"` with `representation.own.width = 32` works in every fit and every
//! comparison of that program.

mod accuracy;
mod assets;
mod checksum;
mod columns;
mod compare;
mod convert;
mod critical_curve;
mod fit;
mod inspect;
mod interferometry;
mod interrupt;
mod lock;
mod memory;
mod movie;
mod npz;
mod observe;
mod output;
mod overlay;
mod paths;
mod program;
mod progress;
mod render;
mod report;
mod trace;
mod usage;
mod uv;
mod volume_files;

pub use memory::Bounded;
pub use program::{BuildRepresentation, OwnSettings, Program};

use clap::{Parser, Subcommand};

/// Lensed images of spinning black holes
#[derive(Debug, Parser)]
#[command(name = "kerrlight", version, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    verb: Verb,
    /// Threads to use [default: one for each core]; results do not depend on it
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Most memory to take, e.g. 4GiB: what would need more is refused [default: what the machine, the control group and
    /// ulimit leave]
    #[arg(long, global = true, value_name = "SIZE", value_parser = memory::parse)]
    memory: Option<u64>,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Render a scene to EXR and PNG
    Render(render::Render),
    /// Render many frames of a scene: numbered EXR files, and a GIF, APNG or PNGs to look at
    Movie(movie::Movie),
    /// Show what a file holds: channels and settings of a picture, arrays, visibilities of an
    /// observation, the state of a fit
    Inspect(inspect::Inspect),
    /// See an image, a movie or a scene through an array of telescopes
    Observe(observe::Observe),
    /// Write the (u, v) coverage of an array, as a table and as a picture
    Uv(uv::Uv),
    /// Rewrite visibilities in another format; average, flag, merge hands
    Convert(convert::Convert),
    /// Recover the emission around a hole from movies or visibilities
    Fit(fit::Fit),
    /// Run many fits that differ in named factors: the comparisons of BH-NeRF's paper, or your own
    Compare(compare::Compare),
    /// Trace single rays from a table to a table
    Trace(trace::Trace),
    /// Write the critical curve, the edge of the shadow, as a table
    CriticalCurve(critical_curve::CriticalCurveTable),
    /// Measure what a digit costs in time, or trace hard rays against 28 digits
    Accuracy(accuracy::Accuracy),
}

fn run(arguments: &Arguments) -> anyhow::Result<()> {
    memory::limit(arguments.memory)?;
    if let Some(threads) = arguments.threads {
        rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global()?;
    }
    match &arguments.verb {
        Verb::Render(render) => render.run(),
        Verb::Movie(movie) => movie.run(),
        Verb::Inspect(inspect) => inspect.run(),
        Verb::Observe(observe) => observe.run(),
        Verb::Uv(uv) => uv.run(),
        Verb::Convert(convert) => convert.run(),
        Verb::Fit(fit) => fit.run(),
        Verb::Compare(compare) => compare.run(arguments.threads, arguments.memory),
        Verb::Trace(trace) => trace.run(),
        Verb::CriticalCurve(table) => table.run(),
        Verb::Accuracy(accuracy) => accuracy.run(),
    }
}

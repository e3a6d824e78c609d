//! The program `kerrlight`: from scene files to lensed images of black holes, and from data to emission.
//!
//! It is a library so that a program of one's own can be all of `kerrlight` and more:
//!
//! ```no_run
//! # use kerrlight_cli::Program;
//! # use kerrlight_tomo::representation::{
//! #     BuildError, Network, NetworkSettings, OwnSettings, Representation,
//! # };
//! fn small(own: &OwnSettings) -> Result<Box<dyn Representation<f32>>, BuildError> {
//!     let width = own.number("width", 8.0..=512.0)? as usize;
//!     Ok(Box::new(Network::new(NetworkSettings { width, ..NetworkSettings::bhnerf() })?))
//! }
//!
//! fn main() -> std::process::ExitCode {
//!     Program::new().representation("small", small).run()
//! }
//! ```
//!
//! From then on `representation.kind = "small"` with `representation.own.settings.width = 32` works in every fit and every
//! comparison of that program.

/// Prints like the standard library's macro, but a message that cannot be written, as into a file on a full disk, is no panic,
/// control characters of foreign names are escaped, and the caller of a [`Call`] hears of it instead.
macro_rules! eprint {
    ($($words:tt)*) => {{
        $crate::session::say(&std::format!($($words)*));
    }};
}

/// The same with an end of the line.
macro_rules! eprintln {
    ($($words:tt)*) => {
        eprint!("{}\n", std::format_args!($($words)*))
    };
}

mod accuracy;
mod answer;
mod assets;
mod call;
mod changed;
mod checksum;
mod columns;
mod compare;
mod convert;
mod critical_curve;
mod devices;
mod file_sums;
mod fit;
mod help;
mod inspect;
mod interferometry;
mod interrupt;
mod keys;
mod lock;
mod memory;
mod movie;
mod observe;
mod output;
mod paths;
pub mod pictures;
mod plain;
mod program;
mod progress;
mod record;
mod render;
mod report;
mod session;
pub mod threads;
mod trace;
mod usage;
mod uv;
mod view;
mod volume_files;

pub use call::Call;
pub use fit::is_same_fit;
pub use memory::Bounded;
pub use program::Program;
pub use session::Said;

use answer::{Answer, Form};
use anyhow::{anyhow, bail};
use clap::{FromArgMatches, Parser, Subcommand};
use std::ffi::OsString;
use std::process::ExitCode;

/// Black holes: lensed images, simulated interferometry, 3D emission tomography
#[derive(Debug, Parser)]
#[command(name = "kerrlight", version, propagate_version = true)]
struct Arguments {
    #[command(subcommand)]
    verb: Verb,
    /// Threads; results are the same [default: one a core]
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=threads::MOST))]
    threads: Option<u16>,
    /// Memory limit, e.g. 4GiB [default: what the system leaves]
    #[arg(long, global = true, value_name = "SIZE", value_parser = memory::parse)]
    memory: Option<u64>,
    /// Print the result as one JSON object
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Render a scene to EXR and PNG
    Render(render::Render),
    /// Render a sequence of EXR frames, or a GIF
    Movie(movie::Movie),
    /// Fly around a scene or a recovered volume in a browser
    View(view::View),
    /// Trace the rays of a table
    Trace(trace::Trace),
    /// Tabulate the critical curve, the edge of the shadow
    CriticalCurve(critical_curve::CriticalCurveTable),
    /// Benchmark integrators: error against time, or hard rays
    Accuracy(accuracy::Accuracy),
    /// Simulate visibilities of an image, a movie or a scene
    Observe(observe::Observe),
    /// Tabulate and plot the (u, v) coverage of an array
    Uv(uv::Uv),
    /// Convert visibilities between formats; average, flag
    Convert(convert::Convert),
    /// Reconstruct emission in 3D from visibilities or movies
    Fit(fit::Fit),
    /// Draw samples around a finished fit: how sure is it?
    Posterior(fit::Posterior),
    /// Run a grid of fits and compare their results
    Compare(compare::Compare),
    /// Show what a file or the folder of a fit contains
    Inspect(inspect::Inspect),
    /// List the graphics devices that can trace rays
    Devices(devices::Devices),
}

/// The exit code of a case that another process runs: EX_TEMPFAIL of sysexits.h, to try again.
pub const BUSY: u8 = 75;

impl Program {
    /// Does what the command line says; 0 is success, 2 an error, 1 a fit that failed while it ran or a comparison of which
    /// a part did, 75 a case that another process runs, 128 and the number of the signal what a signal has stopped: 130 after Ctrl-C, 143 after SIGTERM, 152 after SIGXCPU.
    pub fn run(self) -> ExitCode {
        ExitCode::from(self.run_with(std::env::args_os()))
    }

    /// The same for a command line of the caller's, whose first word is the program's name; returns the exit code.
    /// Help, and what is wrong with the words themselves, end the process.
    pub fn run_with(self, words: impl IntoIterator<Item = OsString>) -> u8 {
        let words: Vec<OsString> = words.into_iter().collect();
        // Before the parser, whose messages repeat words as they were given.
        if let Err(error) = plain::check_words(&words) {
            eprintln!("error: {}", plain::reasons(&error));
            return 2;
        }
        let matches = help::command().try_get_matches_from(words);
        let arguments = matches.and_then(|matches| Arguments::from_arg_matches(&matches));
        let arguments = arguments.unwrap_or_else(|error| output::exit(&error));
        let Err(error) = interrupt::listen().and_then(|()| run(&arguments, &self)) else {
            return 0;
        };
        let before = if error.is::<interrupt::Interrupted>() { "" } else { "error: " };
        let Ended { code, words } = error.into();
        eprintln!("{before}{words}");
        code
    }
}

/// A program that has not done what it was told.
#[derive(Debug, thiserror::Error)]
#[error("{words}")]
pub struct Ended {
    /// The exit code, as [`Program::run`] has it.
    pub code: u8,
    /// Why.
    pub words: String,
}

impl From<anyhow::Error> for Ended {
    fn from(error: anyhow::Error) -> Self {
        let code = match &error {
            error if error.is::<interrupt::Interrupted>() => interrupt::code(),
            error if error.is::<compare::Busy>() => BUSY,
            error if error.is::<compare::Failed>() || error.is::<fit::Failed>() => 1,
            _ => 2,
        };
        Ended { code, words: plain::reasons(&error) }
    }
}

impl Arguments {
    /// Those of a command line, which does not end the process whatever it says.
    fn parsed(words: Vec<OsString>) -> anyhow::Result<Self> {
        plain::check_words(&words)?;
        let matches = help::command().try_get_matches_from(words);
        let parsed = matches.and_then(|matches| Arguments::from_arg_matches(&matches));
        parsed.map_err(|error| {
            let words = error.to_string();
            // What follows is how to ask for help on a terminal.
            let first = words.split("\n\n").next().unwrap_or_default();
            anyhow!("{}", first.trim().trim_start_matches("error: "))
        })
    }
}

fn run(arguments: &Arguments, program: &Program) -> anyhow::Result<()> {
    memory::limit(arguments.memory)?;
    threads::start(arguments.threads)?;
    let form = match (arguments.json, arguments.verb.pipes()) {
        (true, true) => bail!("--json and `-` both ask for standard output: give a file's name"),
        (true, false) => Form::Json,
        (false, true) => Form::Aside,
        (false, false) => Form::Text,
    };
    arguments.verb.run(arguments, program)?.print(form)
}

impl Verb {
    /// Returns whether standard output carries a file, because a path is `-`.
    fn pipes(&self) -> bool {
        let outputs = match self {
            Verb::Render(of) => [of.output.as_ref(), of.preview.as_ref()],
            Verb::Trace(of) => [of.output.as_ref(), None],
            Verb::CriticalCurve(of) => [of.output.as_ref(), None],
            Verb::Observe(of) => [Some(&of.output), None],
            Verb::Uv(of) => [of.output.as_ref(), None],
            Verb::Convert(of) => [Some(&of.output), None],
            _ => [None, None],
        };
        outputs.into_iter().flatten().any(|path| output::is_pipe(path))
    }

    fn run(&self, arguments: &Arguments, program: &Program) -> anyhow::Result<Answer> {
        match self {
            Verb::Render(render) => render.run(),
            Verb::Movie(movie) => movie.run(),
            Verb::View(view) => view.run(),
            Verb::Trace(trace) => trace.run(),
            Verb::CriticalCurve(table) => table.run(),
            Verb::Accuracy(accuracy) => accuracy.run(),
            Verb::Observe(observe) => observe.run(),
            Verb::Uv(uv) => uv.run(),
            Verb::Convert(convert) => convert.run(),
            Verb::Fit(fit) => among_workers(|| fit.run(&program.registry)),
            Verb::Posterior(posterior) => among_workers(|| posterior.run(&program.registry)),
            Verb::Compare(compare) => compare.run(arguments, program),
            Verb::Inspect(inspect) => inspect.run(),
            Verb::Devices(devices) => devices.run(),
        }
    }
}

/// Runs on one of the threads that loops are shared among. A fit starts a hundred thousand short loops; from outside of these
/// threads each would cost two switches of threads, a third of the fit's time.
fn among_workers<T: Send>(run: impl FnOnce() -> T + Send) -> T {
    rayon::scope(|_| run())
}

//! Standard output.

use anyhow::{Context, bail};
use std::fs::File;
use std::io::{ErrorKind, Seek, Write};
use std::sync::atomic::{AtomicBool, Ordering};

/// True if standard output was closed when the program started, as by `>&-` in a shell. Before `main` the standard
/// library opens what leads nowhere in its place, and writing there never fails.
static WAS_CLOSED: AtomicBool = AtomicBool::new(false);

/// Looks before the standard library does.
#[cfg(unix)]
extern "C" fn look() {
    // SAFETY: it asks for the flags of a file descriptor, and changes nothing.
    let flags = unsafe { nix::libc::fcntl(nix::libc::STDOUT_FILENO, nix::libc::F_GETFD) };
    WAS_CLOSED.store(flags == -1, Ordering::Relaxed);
}

// SAFETY: the function has the type that the loader calls, and needs nothing of the standard library's start.
#[cfg(unix)]
#[used]
#[cfg_attr(target_vendor = "apple", unsafe(link_section = "__DATA,__mod_init_func"))]
#[cfg_attr(not(target_vendor = "apple"), unsafe(link_section = ".init_array"))]
static LOOK: extern "C" fn() = look;

/// An error if standard output is closed.
pub fn check() -> anyhow::Result<()> {
    if WAS_CLOSED.load(Ordering::Relaxed) {
        bail!("cannot write to standard output: it is closed");
    }
    Ok(())
}

/// Prints to standard output; a reader who has closed the pipe has seen enough.
pub fn print(text: &str) -> anyhow::Result<()> {
    if text.is_empty() {
        return Ok(());
    }
    check()?;
    let mut out = std::io::stdout().lock();
    printed(out.write_all(text.as_bytes()).and_then(|()| out.flush()))
}

/// Copies a whole file to standard output.
pub fn pour(mut file: &File) -> anyhow::Result<()> {
    file.rewind().context("cannot read the temporary file")?;
    check()?;
    let mut out = std::io::stdout();
    printed(std::io::copy(&mut file, &mut out).and_then(|_| out.flush()))
}

fn printed(result: std::io::Result<()>) -> anyhow::Result<()> {
    match result {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        result => result.context("cannot write to standard output"),
    }
}

/// Ends the process with what the command line asks for in place of work, such as help, or with what is wrong with it.
pub fn exit(words: &clap::Error) -> ! {
    let printed = || printed(words.print().and_then(|()| std::io::stdout().flush()));
    let told = if words.use_stderr() {
        words.print().or(Ok(()))
    } else {
        check().and_then(|()| printed())
    };
    if let Err(error) = told {
        eprintln!("error: {}", crate::plain::reasons(&error));
        std::process::exit(2)
    }
    std::process::exit(words.exit_code())
}

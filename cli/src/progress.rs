//! Bars with the time left on a terminal, nothing in a pipe.

use indicatif::{ProgressBar, ProgressStyle};

/// A bar that shows how much of the work is done.
pub fn bar(length: u64) -> ProgressBar {
    styled(length, "{bar:40} {percent:>3} %  {elapsed} gone, {eta} left")
}

/// A bar that counts frames.
pub fn frames(count: u64) -> ProgressBar {
    styled(count, "{bar:40} frame {pos} of {len}  {elapsed} gone, {eta} left")
}

fn styled(length: u64, style: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(style).unwrap_or(ProgressStyle::default_bar());
    ProgressBar::new(length).with_style(style)
}

/// A bar that counts steps, with a message.
pub fn steps(count: u64) -> ProgressBar {
    styled(count, "{bar:30} step {pos} of {len}  {msg}  {elapsed} gone, {eta} left")
}

/// A bar that counts cases, with the name of the one that runs.
pub fn cases(count: u64) -> ProgressBar {
    styled(count, "{bar:30} {pos} of {len} done  {elapsed} gone, {eta} left  {msg}")
}

/// A bar that counts worlds, and says which search goes on.
pub fn worlds(count: u64) -> ProgressBar {
    styled(count, "{bar:30} world {pos} of at most {len}  {msg}  {elapsed} gone, {eta} left")
}

/// A bar that counts rotations.
pub fn rotations(count: u64) -> ProgressBar {
    styled(count, "{bar:30} rotation {pos} of about {len}  {elapsed} gone, {eta} left")
}

/// A bar that counts draws from a posterior, and says what the present one does.
pub fn samples(count: u64) -> ProgressBar {
    styled(count, "{bar:30} draw {pos} of {len}  {msg}  {elapsed} gone, {eta} left")
}

/// A bar that counts solutions without a part of the frames.
pub fn held_out(count: u64) -> ProgressBar {
    styled(count, "{bar:30} solution {pos} of {len}  {msg}  {elapsed} gone, {eta} left")
}

/// A bar that counts axes.
pub fn axes(count: u64) -> ProgressBar {
    styled(count, "{bar:30} axis {pos} of {len}  {elapsed} gone, {eta} left")
}

/// A line for work of unknown length.
pub fn waiting(what: &str) -> ProgressBar {
    let style = ProgressStyle::with_template("{prefix}: {msg}  {elapsed} gone");
    let style = style.unwrap_or(ProgressStyle::default_spinner());
    ProgressBar::new_spinner().with_style(style).with_prefix(what.to_owned())
}

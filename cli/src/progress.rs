//! Bars with the time left on a terminal; of pictures and films, a line a minute in a pipe.

use crate::session;
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::thread;
use std::time::Duration;

/// A bar that shows how much of the work is done.
pub fn bar(length: u64) -> ProgressBar {
    let bar = styled(length, "{bar:40} {percent:>3} %  {elapsed} gone, {eta} left");
    if !std::io::stderr().is_terminal() {
        tell(&bar, Duration::from_secs(60), |line| eprintln!("{line}"));
    }
    bar
}

/// Tells every so often how much of the work is done, until the bar is finished or gone.
fn tell(bar: &ProgressBar, every: Duration, say: impl Fn(&str) + Send + 'static) {
    let bar = bar.downgrade();
    let lines = move || {
        loop {
            thread::sleep(every);
            let Some(bar) = bar.upgrade().filter(|bar| !bar.is_finished()) else { return };
            let percent = 100 * bar.position() / bar.length().unwrap_or(1).max(1);
            say(&format!("{percent} %  {} gone", HumanDuration(bar.elapsed())));
        }
    };
    // Without a thread for it there are no lines.
    let _ = thread::Builder::new().spawn(lines);
}

/// Writes a line above a bar, or where there is none.
pub fn line(bar: &ProgressBar, line: &str) {
    if bar.is_hidden() { eprintln!("{line}") } else { bar.println(line) }
}

/// A bar that counts frames.
pub fn frames(count: u64) -> ProgressBar {
    styled(count, "{bar:40} frame {pos} of {len}  {elapsed} gone, {eta} left")
}

fn styled(length: u64, style: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(style).unwrap_or(ProgressStyle::default_bar());
    let bar = match session::is_here() {
        true => ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::hidden()),
        false => ProgressBar::new(length),
    };
    bar.with_style(style)
}

/// A bar that counts steps, with a message.
pub fn steps(count: u64) -> ProgressBar {
    styled(count, "{bar:30} step {pos} of {len}  {msg}  {elapsed} gone, {eta} left")
}

/// A bar that counts cases, with the name of the one that runs.
pub fn cases(count: u64) -> ProgressBar {
    styled(count, "{bar:30} {pos} of {len} done  {elapsed} gone, {eta} left  {msg}")
}

/// A bar that counts trials, and says which search goes on.
pub fn geometries(count: u64) -> ProgressBar {
    styled(count, "{bar:30} trial {pos} of at most {len}  {msg}  {elapsed} gone, {eta} left")
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
    let bar = if session::is_here() { ProgressBar::hidden() } else { ProgressBar::new_spinner() };
    bar.with_style(style).with_prefix(what.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;

    /// Lines come while the work goes on, and end with it.
    #[test]
    fn regress_lines_in_a_pipe() {
        let (bar, (send, lines)) = (ProgressBar::hidden(), mpsc::channel());
        bar.set_length(8);
        bar.inc(2);
        tell(&bar, Duration::from_millis(2), move |line| {
            let _ = send.send(line.to_owned());
        });
        let line = lines.recv().unwrap();
        assert!(line.starts_with("25 %  ") && line.ends_with(" gone"), "{line}");
        bar.finish_and_clear();
        // The sender goes with the thread.
        while lines.recv().is_ok() {}
    }
}

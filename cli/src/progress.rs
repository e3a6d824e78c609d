//! Bars with the time left on a terminal; in a pipe, a line a minute.

use crate::session;
use crate::threads;
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::sync::LazyLock;
use std::thread;
use std::time::{Duration, Instant};

/// A bar that shows how much of the work is done.
pub fn bar(length: u64) -> ProgressBar {
    styled(Some(length), "{bar:40} {percent:>3} %  {elapsed} gone, {eta} left", "")
}

/// The first look at the clock.
static BEGUN: LazyLock<Instant> = LazyLock::new(Instant::now);

/// Tells every so often how much of the work is done, until the bar is finished or gone. What is counted has this name; parts of
/// a hundred have none.
fn tell(
    bar: &ProgressBar,
    every: Duration,
    name: &'static str,
    say: impl Fn(&str) + Send + 'static,
) {
    // A thread that held the bar would go on after the work has dropped it.
    let bar = bar.downgrade();
    let lines = move || {
        loop {
            // All bars tell at the same times: work of many short parts would tell nothing by clocks of its own.
            let gone = BEGUN.elapsed().as_nanos() % every.as_nanos();
            thread::sleep(every - Duration::from_nanos(gone as u64));
            let Some(bar) = bar.upgrade().filter(|bar| !bar.is_finished()) else { return };
            let (done, length) = (bar.position(), bar.length());
            let of = match length {
                None => name.to_owned(),
                Some(length) if name.is_empty() => format!("{} %", 100 * done / length.max(1)),
                Some(length) => format!("{name} {done} of {length}"),
            };
            let parts = [of, bar.message(), format!("{} gone", HumanDuration(bar.elapsed()))];
            let parts = parts.into_iter().filter(|part| !part.is_empty());
            say(&parts.collect::<Vec<_>>().join("  "));
        }
    };
    // Without a thread for it there are no lines.
    let _ = threads::spawn(lines);
}

/// Writes a line above a bar, or where there is none.
pub fn line(bar: &ProgressBar, line: &str) {
    if bar.is_hidden() { eprintln!("{line}") } else { bar.println(line) }
}

fn styled(length: Option<u64>, style: &str, name: &'static str) -> ProgressBar {
    let style = ProgressStyle::with_template(style).unwrap_or(ProgressStyle::default_bar());
    let target = match session::is_here() {
        true => ProgressDrawTarget::hidden(),
        false => ProgressDrawTarget::stderr(),
    };
    let bar = ProgressBar::with_draw_target(length, target).with_style(style);
    if !session::is_here() && !std::io::stderr().is_terminal() {
        tell(&bar, Duration::from_secs(60), name, |line| eprintln!("{line}"));
    }
    bar
}

/// A bar that counts things of this name, with a message.
pub fn counting(length: u64, name: &'static str) -> ProgressBar {
    let style =
        format!("{{bar:30}} {name} {{pos}} of {{len}}  {{msg}}  {{elapsed}} gone, {{eta}} left");
    styled(Some(length), &style, name)
}

/// A line for work of unknown length.
pub fn waiting(what: &'static str) -> ProgressBar {
    let style = "{prefix}: {msg}  {elapsed} gone";
    styled(None, style, what).with_prefix(what)
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
        bar.set_message("search 1");
        tell(&bar, Duration::from_millis(2), "trial", move |line| {
            let _ = send.send(line.to_owned());
        });
        let line = lines.recv().unwrap();
        assert!(line.starts_with("trial 2 of 8  search 1  ") && line.ends_with(" gone"), "{line}");
        bar.finish_and_clear();
        // The sender goes with the thread.
        while lines.recv().is_ok() {}
    }
}

//! Memory of the machine, and an allocator that takes no more.

use anyhow::bail;
use kerrlight_common::memory::{self, Scratch, shown};
use std::alloc::{GlobalAlloc, Layout, System};
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// `4GiB`, `500 MB`, `2g` or a number of bytes.
pub fn parse(text: &str) -> Result<u64, String> {
    let text = text.trim();
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic() || c == ' ');
    let unit = match text[digits.len()..].trim().to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "k" | "kib" => 1024.0,
        "m" | "mib" => 1048576.0,
        "g" | "gib" => 1073741824.0,
        "t" | "tib" => 1099511627776.0,
        "kb" => 1e3,
        "mb" => 1e6,
        "gb" => 1e9,
        "tb" => 1e12,
        _ => return Err(WANTED.to_owned()),
    };
    let bytes = digits.trim().parse::<f64>().map_err(|_| WANTED.to_owned())? * unit;
    // Below that not even a thread starts.
    if !(LEAST..1e18).contains(&bytes) {
        return Err(format!("{WANTED}, 16 MiB or more"));
    }
    Ok(bytes as u64)
}

const WANTED: &str = "a size such as 4GiB, 500MB or 2G is wanted";
const LEAST: f64 = 16.0 * 1048576.0;

/// Sets the limit of this process: as it was given, or what the machine has to give.
pub fn limit(given: Option<u64>) -> anyhow::Result<()> {
    let (bytes, note) = bytes(given)?;
    note.into_iter().for_each(|note| eprintln!("{note}"));
    if let Some(bytes) = bytes {
        memory::set_limit(bytes);
        LIMIT.store(usize::try_from(bytes).unwrap_or(usize::MAX), Ordering::Relaxed);
    }
    Ok(())
}

/// The limit as it was given, or what the machine has to give, if that is known, and what is to be noted of it.
pub fn bytes(given: Option<u64>) -> anyhow::Result<(Option<u64>, Option<String>)> {
    let (there, by) = available();
    let too_much = given.zip(there).filter(|(given, there)| given > there);
    let note = too_much.map(|(given, there)| {
        let [given, there] = [given, there].map(|bytes| shown(bytes as f64));
        format!("note: --memory {given} is more than the {there} that {by} leaves")
    });
    let bytes = given.or(there);
    if bytes == Some(0) {
        bail!("no memory is left: {by}");
    }
    memory::set_scratch(scratch);
    Ok((bytes, note))
}

/// A file that nobody else sees and that is gone with the process: where TMPDIR says, else in the current folder, which
/// is less often a disk in memory than the system's folder for such files.
fn scratch(bytes: f64) -> std::io::Result<Box<dyn Scratch>> {
    let folder = std::env::var_os("TMPDIR").map_or_else(|| PathBuf::from("."), PathBuf::from);
    if let Some(free) = free(&folder).filter(|free| bytes > *free) {
        let [needed, free] = [bytes, free].map(shown);
        let folder = folder.display();
        return Err(std::io::Error::other(format!(
            "{needed} are needed, but {folder} has {free} left: let TMPDIR name another folder, or give more --memory"
        )));
    }
    Ok(Box::new(tempfile::tempfile_in(&folder)?))
}

/// Bytes that are left where a folder is, if the system says so.
#[cfg(unix)]
fn free(folder: &Path) -> Option<f64> {
    let all = nix::sys::statvfs::statvfs(folder).ok()?;
    Some(all.blocks_available() as f64 * all.fragment_size() as f64)
}

#[cfg(not(unix))]
fn free(_: &Path) -> Option<f64> {
    None
}

/// Bytes that are left, and what leaves them: the least of all that says something.
fn available() -> (Option<u64>, &'static str) {
    let all = [
        (machine(), "the machine"),
        (groups(), "the control group"),
        (address_space(), "the limit of the address space (ulimit -v)"),
    ];
    let known = all.into_iter().filter_map(|(bytes, by)| Some((bytes?, by)));
    known.min().map_or((None, "the machine"), |(bytes, by)| (Some(bytes), by))
}

/// Returns the memory of the whole machine.
fn machine() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    Some(line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok()? * 1024)
}

/// Returns the memory of the control groups that the process is in, of both versions.
fn groups() -> Option<u64> {
    let own = std::fs::read_to_string("/proc/self/cgroup").ok()?;
    let of = |line: &str| {
        let mut parts = line.splitn(3, ':').skip(1);
        let (controllers, path) = (parts.next()?, parts.next()?);
        let (root, names) = match controllers {
            "" => ("/sys/fs/cgroup", ["memory.max", "memory.current"]),
            "memory" => {
                ("/sys/fs/cgroup/memory", ["memory.limit_in_bytes", "memory.usage_in_bytes"])
            }
            _ => return None,
        };
        let at = Path::new(root).join(path.trim_start_matches('/'));
        // The limits of all groups above hold as well; a container may see its own as the root.
        at.ancestors().take_while(|at| at.starts_with(root)).filter_map(|at| left(at, names)).min()
    };
    own.lines().filter_map(of).min()
}

/// Returns the memory that one group leaves: pages of files are given back where memory is needed.
fn left(group: &Path, [limit, used]: [&str; 2]) -> Option<u64> {
    let number =
        |name: &str| std::fs::read_to_string(group.join(name)).ok()?.trim().parse::<u64>().ok();
    let (limit, used) = (number(limit)?, number(used)?);
    let pages = std::fs::read_to_string(group.join("memory.stat")).ok().and_then(|text| {
        let line = |name: &str| text.lines().find_map(|line| line.strip_prefix(name));
        // Version 1 counts groups below under `total_` alone, version 2 always.
        line("total_inactive_file ").or(line("inactive_file "))?.trim().parse::<u64>().ok()
    });
    Some(limit.saturating_sub(used.saturating_sub(pages.unwrap_or(0))))
}

#[cfg(unix)]
fn address_space() -> Option<u64> {
    use nix::sys::resource::{RLIM_INFINITY, Resource, getrlimit};
    let (soft, _) = getrlimit(Resource::RLIMIT_AS).ok()?;
    (soft != RLIM_INFINITY).then_some(soft)
}

#[cfg(not(unix))]
fn address_space() -> Option<u64> {
    None
}

/// The system's allocator within the limit: what was not foreseen ends the program with a message, not by a signal.
/// A program of one's own may have it too, as its `#[global_allocator]`.
pub struct Bounded;

static LIMIT: AtomicUsize = AtomicUsize::new(usize::MAX);
static TAKEN: AtomicUsize = AtomicUsize::new(0);

/// Smaller blocks are not counted: they are many, and together they are small.
const LARGE: usize = 1 << 16;

/// Counts a block that is about to be taken.
fn take(size: usize) {
    if size >= LARGE {
        let before = TAKEN.fetch_add(size, Ordering::Relaxed);
        if before.saturating_add(size) > LIMIT.load(Ordering::Relaxed) {
            exhausted(size, before);
        }
    }
}

fn give_back(size: usize) {
    if size >= LARGE {
        TAKEN.fetch_sub(size, Ordering::Relaxed);
    }
}

// SAFETY: every request goes to the system's allocator unchanged, or the program ends.
unsafe impl GlobalAlloc for Bounded {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        take(layout.size());
        // SAFETY: the caller's promises are those that the system's allocator wants.
        there(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        take(layout.size());
        // SAFETY: as above.
        there(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // A block that grows counts by its new size, not by both.
        give_back(layout.size());
        take(size);
        // SAFETY: as above.
        there(unsafe { System.realloc(pointer, layout, size) }, size)
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        give_back(layout.size());
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// The block, if the system has given one.
fn there(block: *mut u8, size: usize) -> *mut u8 {
    if block.is_null() {
        exhausted(size, TAKEN.load(Ordering::Relaxed));
    }
    block
}

/// Ends the program with what was wanted and what there is; nothing may be allocated here.
#[cold]
fn exhausted(size: usize, taken: usize) -> ! {
    let mib = |bytes: usize| bytes as f64 / 1048576.0;
    let mut text = Cursor::new([0u8; 320]);
    let limit = LIMIT.load(Ordering::Relaxed);
    let _ = write!(text, "error: out of memory: {:.0} MiB more are needed, and ", mib(size));
    let _ = write!(text, "{:.0} MiB of ", mib(taken));
    let _ = match limit {
        usize::MAX => writeln!(text, "all that the system gives are taken"),
        limit => writeln!(text, "{:.0} MiB are taken (--memory sets how much may be)", mib(limit)),
    };
    crate::output::remove_unfinished();
    end(&text.get_ref()[..text.position() as usize])
}

#[cfg(unix)]
fn end(text: &[u8]) -> ! {
    let _ = nix::unistd::write(std::io::stderr(), text);
    // SAFETY: it ends the process, without the handlers of `exit`, which may want memory.
    unsafe { nix::libc::_exit(2) }
}

#[cfg(not(unix))]
fn end(text: &[u8]) -> ! {
    let _ = std::io::stderr().write_all(text);
    std::process::exit(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_sizes() {
        let sizes = ["4GiB", "4g", "500MB", "1.5 GiB", "123456789", "32 MiB"];
        let bytes = [4 << 30, 4 << 30, 500_000_000, 3 << 29, 123_456_789, 32 << 20];
        assert_eq!(sizes.map(|size| parse(size).unwrap()), bytes);
        for wrong in ["", "GiB", "4 potatoes", "-1G", "nan", "0", "1e30", "1"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    #[cfg(unix)]
    fn exact_a_file_that_no_disk_holds_is_refused() {
        let message = scratch(1e24).err().unwrap().to_string();
        assert!(message.starts_with("867361.7 EiB are needed, but "), "{message}");
        assert!(message.contains("TMPDIR") && message.contains("--memory"), "{message}");
    }

    #[test]
    fn exact_what_a_group_leaves() {
        let folder = tempfile::tempdir().unwrap();
        let names = ["memory.max", "memory.current"];
        let write =
            |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        assert_eq!(left(folder.path(), names), None);
        write("memory.max", "max\n");
        write("memory.current", "700\n");
        assert_eq!(left(folder.path(), names), None);
        write("memory.max", "1000\n");
        assert_eq!(left(folder.path(), names), Some(300));
        write("memory.stat", "anon 5\ninactive_file 200\n");
        assert_eq!(left(folder.path(), names), Some(500));
    }
}

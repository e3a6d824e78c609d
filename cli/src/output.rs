//! Files that appear whole or not at all.

mod leftovers;
mod standard;

pub use leftovers::{BESIDE, lock, prefix_of, sweep};
use standard::pour;
pub use standard::{exit, print};

use crate::checksum::Sum;
use crate::{paths, plain};
use anyhow::{Context, bail};
use kerrlight_common::memory;
use std::cell::RefCell;
use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError, TryLockError};
use std::time::Duration;

/// A file to be written, checked before any work is done for it.
#[derive(Debug, Clone)]
pub struct Output {
    given: PathBuf,
    path: PathBuf,
    folder: PathBuf,
    /// True if the bytes go to standard output once they are whole.
    piped: bool,
}

/// The name of standard output and of standard input.
pub const PIPE: &str = "-";

/// Returns whether a path stands for standard output or standard input.
pub fn is_pipe(path: &Path) -> bool {
    path == Path::new(PIPE)
}

impl Output {
    /// A place to write to, whose name must end in `.extension` (any, if empty).
    pub fn new(path: &Path, extension: &str) -> anyhow::Result<Self> {
        let any = [extension];
        Self::ending_in(path, if extension.is_empty() { &[] } else { &any })
    }

    /// A place to write to, whose name must end in one of `extensions` (any, if there are none).
    pub fn ending_in(path: &Path, extensions: &[&str]) -> anyhow::Result<Self> {
        let shown = plain::path(path);
        if path.is_dir() {
            bail!("output {shown} is a directory: give the name of a file in it");
        }
        let given = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        if !extensions.is_empty() && !extensions.iter().any(|e| given.eq_ignore_ascii_case(e)) {
            let ending = if given.is_empty() { "nothing".to_owned() } else { format!(".{given}") };
            let allowed: Vec<String> = extensions.iter().map(|e| format!(".{e}")).collect();
            bail!("output {shown} must end in {}, not in {ending}", allowed.join(" or "));
        }
        let folder = paths::folder_of(path);
        if !folder.is_dir() {
            bail!("output {shown}: there is no directory {}", plain::path(folder));
        }
        // Through a symbolic link to the file it names, and never over a protected file.
        let given = path.to_owned();
        let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        if std::fs::metadata(&path).is_ok_and(|m| m.permissions().readonly() || !m.is_file()) {
            bail!("output {shown} exists and is not a writable file");
        }
        let folder = paths::folder_of(&path).to_owned();
        let output = Output { given, path, folder, piped: false };
        // A read-only folder is better found out now than after the work.
        output.beside()?;
        Ok(output)
    }

    /// The same, where `-` is standard output.
    pub fn or_pipe(path: &Path, extensions: &[&str]) -> anyhow::Result<Self> {
        if !is_pipe(path) {
            return Self::ending_in(path, extensions);
        }
        standard::check()?;
        let (given, folder) = (path.to_owned(), std::env::temp_dir());
        Ok(Output { path: given.clone(), given, folder, piped: true })
    }

    /// Returns whether it is standard output.
    pub fn is_pipe(&self) -> bool {
        self.piped
    }

    fn beside(&self) -> anyhow::Result<tempfile::NamedTempFile> {
        let mut builder = tempfile::Builder::new();
        let prefix = prefix_of(&self.path);
        builder.prefix(&prefix);
        // The permissions of any newly created file, which the process's mask narrows.
        #[cfg(unix)]
        let builder = {
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o666))
        };
        loop {
            let file = builder
                .tempfile_in(&self.folder)
                .with_context(|| format!("cannot write to {}", plain::path(&self.folder)))?;
            // It tells others that somebody writes here. One that came before the lock has removed the file.
            if lock(file.as_file()) {
                return Ok(file);
            }
        }
    }

    /// Removes what processes have left beside its place that were killed in the middle of writing it.
    fn sweep(&self) {
        if let Some(name) = self.path.file_name().filter(|_| !self.piped) {
            leftovers::sweep_once(&self.folder, &name.to_string_lossy());
        }
    }

    /// Refuses to take the place of a file that is read.
    pub fn must_differ_from(&self, input: &Path) -> anyhow::Result<()> {
        match (self.path.canonicalize(), input.canonicalize()) {
            (Ok(output), Ok(input)) if output == input && !self.piped => {
                bail!(
                    "output {} is an input and would be lost: give another name",
                    plain::path(&input)
                )
            }
            _ => Ok(()),
        }
    }

    /// An error if it is the same file as another output.
    pub fn differs(&self, other: &Path) -> anyhow::Result<()> {
        let full = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        if full(&self.path) == full(other) {
            bail!("{} is given for two outputs: use different names", plain::path(other));
        }
        Ok(())
    }

    /// Writes the whole file beside its place and moves it there.
    pub fn write(&self, bytes: &[u8]) -> anyhow::Result<()> {
        self.write_with(|file| Ok(file.write_all(bytes)?))
    }

    /// The same for what is not in memory as a whole: `write` is given the file beside its place.
    pub fn write_with(
        &self,
        write: impl FnOnce(&mut BufWriter<&File>) -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let name = || format!("cannot write {}", plain::path(&self.path));
        let fill = |file: &File| -> anyhow::Result<()> {
            let mut buffer = BufWriter::new(file);
            write(&mut buffer).with_context(name)?;
            buffer.flush().with_context(name)
        };
        if self.piped {
            // The bytes are kept in a file without a name until they are whole.
            let file = tempfile::tempfile_in(&self.folder).with_context(name)?;
            fill(&file)?;
            return pour(&file);
        }
        self.sweep();
        let file = self.beside()?;
        let _unfinished = Unfinished::new(file.path());
        fill(file.as_file())?;
        // On the disk before the rename: a crash of the machine leaves the old file or the new one.
        file.as_file().sync_all().with_context(name)?;
        file.persist(&self.path).with_context(name)?;
        Ok(())
    }

    /// Returns the path where an interrupted run keeps what it needs to be resumed: beside the file itself. Standard
    /// output has no such place.
    pub fn partial(&self) -> Option<PathBuf> {
        let mut name = self.path.clone().into_os_string();
        name.push(".partial");
        (!self.piped).then(|| name.into())
    }

    /// The place, as it was given.
    pub fn shown(&self) -> &Path {
        &self.given
    }
}

/// Files that are being written.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A file that is being written: for as long as this lives.
struct Unfinished(PathBuf);

impl Unfinished {
    fn new(path: &Path) -> Self {
        UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner).push(path.to_owned());
        Unfinished(path.to_owned())
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        let mut all = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
        all.retain(|path| *path != self.0);
    }
}

/// Removes what is being written, before the program ends in the middle of it.
pub fn remove_unfinished() {
    // A thread that has run out of memory while it holds the lock would wait for itself.
    let held = (0..100).find_map(|_| match UNFINISHED.try_lock() {
        Ok(all) => Some(all),
        Err(TryLockError::Poisoned(error)) => Some(error.into_inner()),
        Err(TryLockError::WouldBlock) => {
            std::thread::sleep(Duration::from_millis(1));
            None
        }
    });
    for path in held.iter().flat_map(|all| all.iter()) {
        // It may have been moved to its place.
        let _ = std::fs::remove_file(path).or_else(|_| std::fs::remove_dir_all(path));
    }
}

/// A regular file to read that is not empty, with an error that names it.
pub fn open(path: &Path) -> anyhow::Result<File> {
    let file = open_any(path)?;
    let shown = plain::path(path);
    if file.metadata().with_context(|| format!("cannot read {shown}"))?.len() == 0 {
        bail!("{shown} is empty (0 bytes)");
    }
    Ok(file)
}

fn open_any(path: &Path) -> anyhow::Result<File> {
    let shown = plain::path(path);
    let metadata = std::fs::metadata(path).with_context(|| format!("cannot read {shown}"))?;
    if metadata.is_dir() {
        bail!("{shown} is a directory, not a file");
    }
    if !metadata.is_file() {
        bail!("{shown} is not a regular file");
    }
    File::open(path).with_context(|| format!("cannot read {shown}"))
}

/// The bytes of a file that is not empty, with an error that names it.
pub fn read(path: &Path) -> anyhow::Result<Vec<u8>> {
    bytes_of(path, open(path)?)
}

fn bytes_of(path: &Path, mut file: File) -> anyhow::Result<Vec<u8>> {
    let name = || format!("cannot read {}", plain::path(path));
    let length = file.metadata().with_context(name)?.len();
    memory::afford(|| plain::path(path), length as f64)?;
    let mut bytes = Vec::with_capacity(length as usize);
    file.read_to_end(&mut bytes).with_context(name)?;
    READ.with_borrow_mut(|read| {
        if let Some(read) = read {
            read.push((path.to_owned(), Sum::of(&bytes)));
        }
    });
    Ok(bytes)
}

/// The same file, read once from its beginning to its end for its checksum: what it holds need not fit into memory.
pub fn read_through(path: &Path) -> anyhow::Result<BufReader<File>> {
    let name = || format!("cannot read {}", plain::path(path));
    let mut file = BufReader::with_capacity(1 << 16, open(path)?);
    let sum = Sum::of_file(&mut file).with_context(name)?;
    file.rewind().with_context(name)?;
    READ.with_borrow_mut(|read| {
        if let Some(read) = read {
            read.push((path.to_owned(), sum));
        }
    });
    Ok(file)
}

thread_local! {
    /// Files that this thread has read since somebody wants to know.
    static READ: RefCell<Option<Vec<(PathBuf, Sum)>>> = const { RefCell::new(None) };
}

/// The result of some work on this thread, and all files that it has read.
pub fn with_reads<R>(work: impl FnOnce() -> R) -> (R, Vec<(PathBuf, Sum)>) {
    READ.set(Some(Vec::new()));
    let result = work();
    (result, READ.take().unwrap_or_default())
}

/// The text of a file that is not empty, with an error that names it.
pub fn read_text(path: &Path) -> anyhow::Result<String> {
    text_of(path, open(path)?)
}

/// The text of a log, which may have no line yet.
pub fn read_log(path: &Path) -> anyhow::Result<String> {
    text_of(path, open_any(path)?)
}

fn text_of(path: &Path, file: File) -> anyhow::Result<String> {
    let text = String::from_utf8(bytes_of(path, file)?);
    let text = text.with_context(|| format!("{} is not UTF-8 text", plain::path(path)))?;
    // Spreadsheets and editors of Windows put a byte order mark before it.
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}

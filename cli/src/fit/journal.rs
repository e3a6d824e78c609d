//! Journal of a search, in a file of its run: an interrupted one resumes where it was.

use super::folder::Folder;
use anyhow::Context;
use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// The file, in the folder of the run, until the search has ended.
const FILE: &str = "search.log";
/// First bytes: numbers of another version are not those of this one.
const HEAD: &str = concat!("kerrlight ", env!("CARGO_PKG_VERSION"), " search");

/// Numbers by key, all of which are on the disk: a line each, of hexadecimal bits, with its checksum.
pub struct Journal {
    path: PathBuf,
    known: HashMap<u64, Vec<f64>>,
    file: Mutex<Option<File>>,
}

impl Journal {
    /// Opens the journal of a run, with what an interrupted search has left there.
    pub fn open(folder: &Folder) -> anyhow::Result<Self> {
        let journal = Self::at(&folder.path().join(FILE))?;
        if !journal.known.is_empty() {
            let known = journal.known.len();
            eprintln!("an interrupted search is resumed: {known} of its results are known");
        }
        Ok(journal)
    }

    fn at(path: &Path) -> anyhow::Result<Self> {
        let name = || format!("cannot write {}", path.display());
        let text = std::fs::read_to_string(path).unwrap_or_default();
        let mut lines = text.lines();
        let known = match lines.next() {
            Some(HEAD) => lines.filter_map(entry).collect(),
            _ => HashMap::new(),
        };
        let mut file =
            OpenOptions::new().create(true).append(true).open(path).with_context(name)?;
        if !text.starts_with(HEAD) {
            file.set_len(0).with_context(name)?;
            writeln!(file, "{HEAD}").with_context(name)?;
        } else if !text.ends_with('\n') {
            // A line that a kill has cut short.
            writeln!(file).with_context(name)?;
        }
        Ok(Self { path: path.to_owned(), known, file: Mutex::new(Some(file)) })
    }

    /// Ends a search whose result is kept: its file is removed.
    pub fn remove(folder: &Folder) {
        // What is left behind is found by the next search and does no harm.
        let _ = std::fs::remove_file(folder.path().join(FILE));
    }
}

/// Key and numbers of a line; none of one that is not whole.
fn entry(line: &str) -> Option<(u64, Vec<f64>)> {
    let (words, sum) = line.rsplit_once(' ')?;
    if u32::from_str_radix(sum, 16).ok()? != crc32fast::hash(words.as_bytes()) {
        return None;
    }
    let mut bits = words.split(' ').map(|word| u64::from_str_radix(word, 16).ok());
    let key = bits.next()??;
    let numbers = bits.map(|bits| bits.map(f64::from_bits)).collect::<Option<_>>()?;
    Some((key, numbers))
}

impl kerrlight_tomo::fit::journal::Journal for Journal {
    fn recall(&self, key: u64) -> Option<Vec<f64>> {
        self.known.get(&key).cloned()
    }

    fn keep(&self, key: u64, numbers: &[f64]) {
        let words: String = numbers.iter().map(|x| format!(" {:016x}", x.to_bits())).collect();
        let words = format!("{key:016x}{words}");
        // A line is a single write: a kill cuts short the last one at most.
        let line = format!("{words} {:08x}\n", crc32fast::hash(words.as_bytes()));
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        // A full disk ends the notes, not the search.
        if file.as_mut().is_some_and(|file| file.write_all(line.as_bytes()).is_err()) {
            let path = self.path.display();
            eprintln!("cannot write {path}: an interrupted search would begin anew from here");
            *file = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_tomo::fit::journal::Journal as _;

    #[test]
    fn exact_numbers_come_back_and_lines_cut_short_do_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.log");
        let all = [(1, vec![0.1, f64::NEG_INFINITY, -0.0]), (u64::MAX, vec![]), (7, vec![1e-300])];
        let journal = Journal::at(&path).unwrap();
        all.iter().for_each(|(key, numbers)| journal.keep(*key, numbers));
        assert!(journal.recall(1).is_none(), "of this search itself nothing is asked twice");
        drop(journal);
        let again = Journal::at(&path).unwrap();
        assert_eq!(again.known.len(), 3);
        assert!(all.iter().all(|(key, numbers)| again.recall(*key).as_ref() == Some(numbers)));
        // Killed in the middle of the last line, which is then followed by others.
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, &text[..text.len() - 5]).unwrap();
        let cut = Journal::at(&path).unwrap();
        assert_eq!((cut.known.len(), cut.recall(7)), (2, None));
        cut.keep(8, &[2.0]);
        let whole = Journal::at(&path).unwrap();
        assert_eq!((whole.known.len(), whole.recall(8)), (3, Some(vec![2.0])));
        // Those of another version are not used.
        std::fs::write(&path, text.replace("kerrlight", "kerrdark")).unwrap();
        assert_eq!(Journal::at(&path).unwrap().known.len(), 0);
    }
}

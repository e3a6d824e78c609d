//! Checksums of files.

use crate::checksum::Sum;
use crate::output;
use anyhow::Context;
use std::collections::BTreeMap;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Sums of files, each of which is read once.
#[derive(Default)]
pub struct FileSums(BTreeMap<PathBuf, Sum>);

impl FileSums {
    /// The sum of a file.
    pub fn of(&mut self, path: &Path) -> anyhow::Result<Sum> {
        if let Some(sum) = self.0.get(path) {
            return Ok(sum.clone());
        }
        let name = || format!("cannot read {}", path.display());
        let sum = Sum::of_file(&mut BufReader::new(output::open(path)?)).with_context(name)?;
        self.0.insert(path.to_owned(), sum.clone());
        Ok(sum)
    }
}

//! Runs all oracles and writes docs/measurements/validation.md.

use anyhow::{Context, bail};
use kerrlight_validation::{report, run_all};
use std::io::Write;
use std::path::Path;

fn main() -> anyhow::Result<()> {
    let cases = run_all();
    let text = report::markdown(&cases);
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/measurements");
    let mut file = tempfile::NamedTempFile::new_in(&folder).context("docs/measurements")?;
    file.write_all(text.as_bytes())?;
    file.persist(folder.join("validation.md"))?;
    let failed: Vec<_> = cases.iter().filter(|case| !case.passed()).collect();
    for case in &failed {
        eprintln!("failed: {} ({}): error {:.1e}", case.name, case.authority, case.error);
    }
    println!("{} passed, {} failed", cases.len() - failed.len(), failed.len());
    if !failed.is_empty() {
        bail!("{} cases failed", failed.len());
    }
    Ok(())
}

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
    print!("{}", report::lines(&cases));
    let passed = report::passed(&cases);
    println!("{passed} of {} passed", cases.len());
    if passed < cases.len() {
        bail!("{} cases failed", cases.len() - passed);
    }
    Ok(())
}

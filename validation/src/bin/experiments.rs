//! Holds results of `kerrlight compare` against `validation/experiments`: give an experiment's name and
//! its folder or its results.json.

use anyhow::{Context, bail};
use kerrlight_validation::experiments::Expected;
use std::path::{Path, PathBuf};

fn main() -> anyhow::Result<()> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [name, results] = words.as_slice() else {
        bail!(
            "give an experiment and its results: representations kerrlight-representations/results.json"
        );
    };
    let file = format!("experiments/{name}.toml");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(&file);
    let text = std::fs::read_to_string(&path)
        .with_context(|| format!("nothing is expected of {name}: there is no validation/{file}"))?;
    let expected = Expected::parse(&text).context(file)?;
    let mut path = PathBuf::from(results);
    if path.is_dir() {
        path.push("results.json");
    }
    let shown = path.display().to_string();
    let text = std::fs::read_to_string(&path).with_context(|| shown.clone())?;
    let results = serde_json::from_str(&text).with_context(|| shown.clone())?;
    let verdicts = expected.hold(&results).context(shown)?;
    for verdict in &verdicts {
        let word = match (&verdict.found, verdict.passed) {
            (None, _) => "not run",
            (_, true) => "passed",
            (_, false) => "FAILED",
        };
        let found = verdict.found.as_deref().unwrap_or("-");
        println!("{word:8} {}: {found}", verdict.what);
    }
    let failed = verdicts.iter().filter(|verdict| !verdict.passed).count();
    if failed > 0 {
        bail!("{failed} of {} expectations failed", verdicts.len());
    }
    Ok(())
}

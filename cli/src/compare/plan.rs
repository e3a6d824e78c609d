//! Plan in a folder of results: whoever joins runs the same cases, from any current folder.

use super::recipe::Choice;
use super::source::Source;
use crate::checksum::{is_whole, sealed};
use crate::lock::{self, Lock};
use crate::output::{self, Output};
use crate::paths;
use anyhow::{Context, bail};
use kerrlight_tomo::representation::Registry;
use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

/// Its name in the folder.
pub const FILE: &str = "plan.json";
/// The experiment's own text beside it.
pub const EXPERIMENT: &str = "experiment.toml";

/// Words for another process in the folder.
pub const BUSY: &str = "compares in";
/// Longest time that somebody who begins in a folder that is there may take.
const BEGINNING: Duration = Duration::from_secs(5);

/// Cases of an experiment, and how they are run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Version of the program.
    version: String,
    /// Folder from which paths in the experiment start; none for one that the program carries.
    pub base: Source,
    /// The command line's; paths in assignments start from the root.
    #[serde(flatten)]
    choice: Choice,
}

impl Plan {
    /// Takes the plan of a command line.
    pub fn new(source: &Source, choice: &Choice) -> anyhow::Result<Self> {
        if choice
            .set
            .iter()
            .any(|set| set.split('=').next().is_some_and(|key| key.trim() == "seed"))
        {
            bail!("--set seed is not allowed: --seeds tells how many there are");
        }
        let set = choice.set.iter().map(|set| paths::from_here(set, None));
        let choice = Choice { set: set.collect::<anyhow::Result<_>>()?, ..choice.clone() };
        let version = env!("CARGO_PKG_VERSION").to_owned();
        Ok(Plan { version, base: source.clone(), choice })
    }

    /// Reads the plan in a folder, with the text of the experiment; nothing if no comparison was begun there.
    pub fn load(folder: &Path) -> anyhow::Result<Option<(Self, String)>> {
        let path = folder.join(FILE);
        if !path.is_file() {
            return Ok(None);
        }
        let text = output::read_text(&path)?;
        if !is_whole(&text) {
            bail!("{} is damaged: begin anew in another folder", path.display());
        }
        let plan = serde_json::from_str(&text).with_context(|| path.display().to_string())?;
        Ok(Some((plan, output::read_text(&folder.join(EXPERIMENT))?)))
    }

    /// Writes it into a folder, with the text of the experiment.
    pub fn write(&self, folder: &Path, experiment: &str) -> anyhow::Result<()> {
        Output::new(&folder.join(EXPERIMENT), "toml")?.write(experiment.as_bytes())?;
        // The plan last: whoever finds it reads the experiment beside it.
        let text = sealed(serde_json::to_value(self)?);
        Output::new(&folder.join(FILE), "")?.write(text.as_bytes())
    }

    /// Begun anew by this program.
    pub fn again(self) -> Self {
        Self { version: env!("CARGO_PKG_VERSION").to_owned(), ..self }
    }

    /// Returns the choice of cases.
    pub fn choice(&self, registry: &Registry) -> Choice {
        Choice { registry: registry.clone(), ..self.choice.clone() }
    }

    /// Refuses to work on the cases of another plan, or of another version.
    pub fn joins(&self, other: &Self, folder: &Path) -> anyhow::Result<()> {
        let shown = folder.display();
        if self.version != other.version {
            bail!(
                "{shown} was begun by kerrlight {}, and this is {}: join it with that, or give another folder with -o",
                other.version,
                self.version
            );
        }
        if self != other {
            bail!(
                "{shown} has other cases: run them with `kerrlight compare {shown} --case ID`, or give another folder with -o"
            );
        }
        Ok(())
    }
}

/// Enters a folder together with others, of whom some may enter it in the same moment: whoever is first begins it, and
/// the others must want the same cases.
pub fn join(plan: &Plan, experiment: &str, folder: &Path) -> anyhow::Result<Lock> {
    if !folder.join(FILE).is_file() && !appear(plan, experiment, folder)? {
        begin_within(plan, experiment, folder)?;
    }
    let lock = Lock::share(folder, BUSY, BEGINNING)?;
    match Plan::load(folder)? {
        Some((begun, _)) => plan.joins(&begun, folder)?,
        None => bail!("{}: {FILE} is gone", folder.display()),
    }
    Ok(lock)
}

/// Makes a folder with its plan in it, by one rename: nobody sees the one without the other. False if something is in
/// the way.
fn appear(plan: &Plan, experiment: &str, folder: &Path) -> anyhow::Result<bool> {
    let name = || format!("cannot make the folder {}", folder.display());
    let place = std::path::absolute(folder).with_context(name)?;
    let parent = place.parent().with_context(name)?;
    fs::create_dir_all(parent).with_context(name)?;
    let mut builder = tempfile::Builder::new();
    let prefix = output::prefix_of(&place);
    builder.prefix(&prefix);
    // Those of any newly made folder, which the process's mask narrows.
    #[cfg(unix)]
    let builder = {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o777))
    };
    let beside = builder.tempdir_in(parent).with_context(name)?;
    // The lock tells other processes that this is no leftover of a killed one.
    let _lock = fs::File::open(beside.path()).ok().filter(output::lock);
    plan.write(beside.path(), experiment)?;
    // The rename replaces an empty folder, and fails where the plan of another process is there.
    Ok(fs::rename(beside.path(), &place).is_ok())
}

/// Begins in a folder that is there, and cannot be replaced: where file systems are mounted, or that an earlier version
/// has left. Whoever has its lock writes the plan.
fn begin_within(plan: &Plan, experiment: &str, folder: &Path) -> anyhow::Result<()> {
    let (shown, clock) = (folder.display(), Instant::now());
    let is_foreign = is_foreign(folder);
    // What others add to a folder they add after its plan.
    while !folder.join(FILE).is_file() {
        if is_foreign {
            bail!("{shown} holds other files than a comparison: give another folder with -o");
        }
        match Lock::take(folder, BUSY, Duration::ZERO) {
            Ok(_alone) if folder.join(FILE).is_file() => break,
            Ok(_alone) => plan.write(folder, experiment)?,
            // Whoever has the lock is about to write the plan.
            Err(error) if clock.elapsed() > BEGINNING => return Err(error),
            Err(_) => std::thread::sleep(Duration::from_millis(20)),
        }
    }
    Ok(())
}

/// Returns whether there is something in a folder that no comparison leaves there before its plan.
fn is_foreign(folder: &Path) -> bool {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let names: Vec<_> = entries.map(|entry| entry.file_name()).collect();
    let is_ours = |name: &OsString| {
        [lock::NAME, FILE, EXPERIMENT].iter().any(|ours| name == ours)
            || name.to_string_lossy().starts_with(output::BESIDE)
    };
    // An experiment without a plan is a beginning that was cut short.
    !names.iter().any(|name| name == EXPERIMENT) && !names.iter().all(is_ours)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Barrier;

    fn plan(seeds: u64) -> Plan {
        let choice = Choice { seeds: Some(seeds), ..Choice::default() };
        Plan::new(&Source::default(), &choice).unwrap()
    }

    /// Eight that want the same cases in the same moment all get in, whatever there is of the folder.
    #[test]
    fn exact_all_who_begin_together_join() {
        let at = tempfile::tempdir().unwrap();
        for round in 0..30 {
            let folder = at.path().join(format!("a/{round}"));
            if round % 3 > 0 {
                fs::create_dir_all(&folder).unwrap();
            }
            if round % 3 > 1 {
                fs::write(folder.join(lock::NAME), "").unwrap();
            }
            let start = Barrier::new(8);
            let enter = || {
                start.wait();
                join(&plan(3), "text", &folder).map(drop)
            };
            std::thread::scope(|scope| {
                let all: Vec<_> = (0..8).map(|_| scope.spawn(enter)).collect();
                all.into_iter().for_each(|one| one.join().unwrap().unwrap());
            });
            assert_eq!(Plan::load(&folder).unwrap(), Some((plan(3), "text".to_owned())));
        }
        // Nothing stays beside the folders.
        assert_eq!(fs::read_dir(at.path().join("a")).unwrap().count(), 30);
    }

    /// One of two plans with different cases is refused.
    #[test]
    fn exact_one_plan_wins() {
        let at = tempfile::tempdir().unwrap();
        let folder = at.path().join("out");
        let enter = |seeds| join(&plan(seeds), "text", &folder).map(drop);
        let (one, other) = std::thread::scope(|scope| {
            let one = scope.spawn(|| enter(1));
            (one.join().unwrap(), enter(2))
        });
        assert!(one.is_ok());
        assert!(other.unwrap_err().to_string().contains("has other cases"));
        fs::write(at.path().join("notes"), "mine").unwrap();
        let error = join(&plan(1), "text", at.path()).map(drop).unwrap_err().to_string();
        assert!(error.contains("holds other files than a comparison"), "{error}");
    }
}

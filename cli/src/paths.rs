//! Paths in settings that are given on the command line start from the current folder; those in a file
//! start from the file's.

use anyhow::Context;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// The folder of the public files of the Event Horizon Telescope.
const EHT_DATA: &str = "KERRLIGHT_EHT_DATA";

/// Returns the path of a file of data: `$KERRLIGHT_EHT_DATA/NAME` in the folder that this variable of the environment
/// names, any other path from `base_dir`.
///
/// # Errors
/// If the variable is not set.
pub fn of_data(path: &Path, base_dir: &Path) -> anyhow::Result<PathBuf> {
    let Ok(name) = path.strip_prefix(format!("${EHT_DATA}")) else {
        return Ok(base_dir.join(path));
    };
    let folder = std::env::var_os(EHT_DATA).filter(|folder| !folder.is_empty());
    let folder = folder.with_context(|| {
        format!(
            "{}: {EHT_DATA} is not set; set it to the folder with the public data of the Event Horizon Telescope, or give the \
             file with --set, such as data.visibilities.path=FILE or data.light-curve.path=FILE",
            path.display()
        )
    })?;
    let full = std::path::absolute(Path::new(&folder).join(name));
    full.with_context(|| path.display().to_string())
}

/// Returns the folder that a file is named in, the current one for a bare name.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."))
}

/// Returns the ending of a file's name in lower case, nothing without one.
pub fn ending(path: &Path) -> String {
    path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase()
}

/// An assignment `key.path=value` whose relative paths start from the current folder, as one for settings
/// whose paths start from `folder` (from the root without one). Everything else stays as it is.
pub fn from_here(assignment: &str, folder: Option<&Path>) -> anyhow::Result<String> {
    let Some((keys, text)) = assignment.split_once('=') else { return Ok(assignment.to_owned()) };
    let text = text.trim();
    let parsed = format!("value = {text}").parse::<Table>().ok();
    let parsed = parsed.and_then(|mut table| table.remove("value"));
    let mut value = parsed.unwrap_or_else(|| Value::String(text.to_owned()));
    let before = value.clone();
    let key = keys.trim().rsplit('.').next().unwrap_or_default();
    let here = std::path::absolute(".").context("the current folder")?;
    let folder = folder.map(|folder| here.join(folder));
    move_paths(key.trim(), &mut value, &|path| moved(path, &here, folder.as_deref()));
    // What names no file keeps its digits and its layout.
    Ok(if value == before { assignment.to_owned() } else { format!("{keys}={value}") })
}

/// Makes the paths in a table start from the root.
pub fn anchor(table: &mut Table, folder: &Path) {
    for (key, value) in table.iter_mut() {
        move_paths(key, value, &|path| folder.join(path).display().to_string());
    }
}

/// The same with one name for each file that is there: without links and `..`.
pub fn resolve(table: &mut Table, folder: &Path) {
    for (key, value) in table.iter_mut() {
        move_paths(key, value, &|path| {
            let full = folder.join(path);
            full.canonicalize().unwrap_or(full).display().to_string()
        });
    }
}

/// Keys that name files.
fn is_path(key: &str, value: &str) -> bool {
    let is_array = key == "array" && kerrlight_vlbi::array::built_in(value).is_none();
    ["path", "times"].contains(&key) || is_array
}

fn move_paths(key: &str, value: &mut Value, moved: &dyn Fn(&str) -> String) {
    match value {
        Value::String(path) if !path.is_empty() && !path.starts_with('$') && is_path(key, path) => {
            *path = moved(path);
        }
        Value::Table(table) => {
            table.iter_mut().for_each(|(key, value)| move_paths(key, value, moved));
        }
        Value::Array(values) => {
            values.iter_mut().for_each(|value| move_paths(key, value, moved));
        }
        _ => {}
    }
}

/// A path from `here` as one from `folder`: short where the file lies below it.
fn moved(path: &str, here: &Path, folder: Option<&Path>) -> String {
    if Path::new(path).is_absolute() {
        return path.to_owned();
    }
    let full = here.join(path);
    let below = folder.and_then(|folder| full.strip_prefix(folder).ok());
    below.unwrap_or(&full).display().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_paths_start_from_the_current_folder() {
        let here = std::path::absolute(".").unwrap();
        let of = |assignment: &str, folder: &str| {
            from_here(assignment, Some(Path::new(folder))).unwrap()
        };
        // Below the file's folder, beside it, and in it.
        assert_eq!(of("sky.image.path=a/b.png", "a"), "sky.image.path=\"b.png\"");
        let full = here.join("b.png").display().to_string();
        assert_eq!(of("data.movie.path=b.png", "a"), format!("data.movie.path=\"{full}\""));
        assert_eq!(of("mesh.0.path=b.obj", "."), "mesh.0.path=b.obj");
        assert_eq!(of("mesh.0.path=b.obj", ""), "mesh.0.path=b.obj");
        assert_eq!(of("mesh.0.path=/b.obj", "a"), "mesh.0.path=/b.obj");
        let table = of("data={visibilities={path=\"a/b.txt\", average_s=1.0}}", "a");
        assert!(table.contains("path = \"b.txt\"") && table.contains("average_s"), "{table}");
        // Names of arrays are no paths, other settings are nothing of the kind.
        assert_eq!(
            of("simulation.observation.array=ngEHT", "a"),
            "simulation.observation.array=ngEHT"
        );
        assert_eq!(
            of("simulation.observation.array=a/b.txt", "a"),
            "simulation.observation.array=\"b.txt\""
        );
        assert_eq!(of("hole.spin=0.5", "a"), "hole.spin=0.5");
        assert_eq!(of("sky.image.path=", "a"), "sky.image.path=");
        assert_eq!(of("nonsense", "a"), "nonsense");
        let whole = from_here("mesh.0.path=b.png", None).unwrap();
        assert_eq!(whole, format!("mesh.0.path=\"{full}\""));
    }
}

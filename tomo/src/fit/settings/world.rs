//! Settings that take the place of others.

use super::{FitError, FitFile, Within};
use kerrlight_common::toml_file;
use toml::{Table, Value};

/// Tables that say which of several things they are by their only key: another key takes their place.
const CHOICES: [&str; 6] = ["axis", "batch", "data", "nodes", "start", "velocity"];

/// Puts what `changes` holds into a table: tables are merged, all else is replaced.
pub fn merge(into: &mut Table, changes: &Table) {
    for (key, change) in changes {
        match (into.get_mut(key), change) {
            (Some(Value::Table(old)), Value::Table(new))
                if !CHOICES.contains(&key.as_str()) || old.keys().eq(new.keys()) =>
            {
                merge(old, new);
            }
            _ => {
                into.insert(key.clone(), change.clone());
            }
        }
    }
}

/// What may differ between what is simulated and what a fit assumes.
pub(super) const SIMULATED: [&str; 6] =
    ["hole", "observer", "region", "effects", "motion", "polarization"];

impl FitFile {
    /// Whether data are simulated with other settings than the fit's.
    pub fn is_simulated_elsewhere(&self) -> bool {
        let is_drawn = self.world.get("drawn").and_then(Value::as_bool) == Some(true);
        is_drawn || self.world.keys().any(|key| SIMULATED.contains(&key.as_str()))
    }

    /// The settings that data are simulated with: these with the changes of `world`.
    ///
    /// # Errors
    /// If `world` has a key that is no part of what is simulated, or is no setting at all.
    pub fn simulated(&self) -> Result<Self, FitError> {
        let unknown = self.unknown_world()?;
        let mut table = toml_file::table_of(self).within("settings")?;
        let simulated = |(key, value): (&String, &Value)| {
            SIMULATED.contains(&key.as_str()).then(|| (key.clone(), value.clone()))
        };
        merge(&mut table, &self.world.iter().filter_map(simulated).collect());
        table.remove("world");
        let mut file: Self = toml_file::read_table(&table).within("world")?;
        if let Some(unknown) = unknown.filter(|unknown| unknown.drawn) {
            unknown.draw(&mut file)?;
        }
        Ok(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Table {
        text.parse().unwrap()
    }

    #[test]
    fn exact_tables_are_merged_and_choices_replaced() {
        let mut all = table("a = 1\n[hole]\nspin = 0.5\nmass = 2\n[axis.known]\n");
        merge(&mut all, &table("[hole]\nspin = 0.9\n[axis.scan]\nframes = 3\n"));
        let expected = "a = 1\n[hole]\nspin = 0.9\nmass = 2\n[axis.scan]\nframes = 3\n";
        assert_eq!(all, table(expected));
        merge(&mut all, &table("[axis.scan]\nrate = 1\n"));
        let both = table("[scan]\nframes = 3\nrate = 1\n");
        assert_eq!(all["axis"], Value::Table(both), "the same choice with another number");
    }

    #[test]
    fn exact_a_world_changes_what_is_simulated() {
        let mut file: FitFile =
            toml_file::read(include_str!("../../../../cli/src/fit/built_in.toml")).unwrap();
        assert_eq!(file.simulated().unwrap(), file);
        file.world = table("[hole]\nspin = 0.9\n[effects]\nslow_light = false");
        let world = file.simulated().unwrap();
        assert_eq!((world.hole.spin, world.hole.mass_msun), (0.9, file.hole.mass_msun));
        assert!(!world.effects.slow_light && world.effects.redshift_power == Some(2.0));
        file.world = table("[loss]\n");
        let error = format!("{:#}", file.simulated().unwrap_err());
        assert!(error.contains("world: unknown field `loss`, expected one of `hole`"), "{error}");
        file.world = table("[hole]\nspn = 0.9\n");
        let error = format!("{:#}", file.simulated().unwrap_err());
        assert!(error.contains("unknown field `spn`"), "{error}");
    }
}

//! Settings that take the place of others.

use toml::{Table, Value};

/// Tables that say which of several things they are by their only key: another key takes their place.
const CHOICES: [&str; 12] = [
    "axis",
    "batch",
    "beta_phi",
    "beta_r",
    "data",
    "inclination_deg",
    "nodes",
    "position_angle_deg",
    "spin",
    "start",
    "velocity",
    "xi",
];

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
}

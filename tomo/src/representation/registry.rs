//! Representations of others, beside those that kerrlight has itself.

use super::Representation;
use crate::Error;
use std::ops::RangeInclusive;

/// Reason why a representation cannot be built: any error, of which the message is shown.
pub type BuildError = Box<dyn std::error::Error + Send + Sync>;

/// Makes a representation of its settings.
pub type BuildRepresentation = fn(&OwnSettings) -> Result<Box<dyn Representation<f32>>, BuildError>;

/// Makes a representation of a name that is not known before, or says with `None` that the name is none of its own.
pub type FindRepresentation =
    fn(&str, &OwnSettings) -> Option<Result<Box<dyn Representation<f32>>, BuildError>>;

/// Settings of a representation of one's own.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnSettings {
    /// Inner radius of the region of recovery, M.
    pub r_min: f64,
    /// Outer radius of the region of recovery, M.
    pub r_max: f64,
    /// Largest |z| of the region of recovery, M; infinite where there is no limit.
    pub z_width: f64,
    /// `representation.own.settings` of the fit.
    pub table: toml::Table,
}

/// A number of `representation.own.settings` that is missing or out of range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum OwnError {
    /// The number is missing: none has a default.
    #[error(
        "representation.own.settings.{key} is missing: add it to [representation.own.settings], a \
         number from {low} to {high}"
    )]
    Missing {
        /// The key.
        key: String,
        /// Least value.
        low: f64,
        /// Largest value.
        high: f64,
    },
    /// The value is no number, or out of range.
    #[error("representation.own.settings.{key} = {value} is not allowed: {low} to {high}")]
    Range {
        /// The key.
        key: String,
        /// The value that was given.
        value: String,
        /// Least value.
        low: f64,
        /// Largest value.
        high: f64,
    },
}

impl OwnSettings {
    /// A number of `representation.own.settings`, which has no default.
    ///
    /// # Errors
    /// If it is missing, no number, or out of range.
    pub fn number(&self, key: &str, allowed: RangeInclusive<f64>) -> Result<f64, Error> {
        let (low, high) = (*allowed.start(), *allowed.end());
        let missing = || OwnError::Missing { key: key.to_owned(), low, high };
        let value = self.table.get(key).ok_or_else(missing)?;
        let number = value.as_float().or(value.as_integer().map(|n| n as f64));
        Ok(number.filter(|number| allowed.contains(number)).ok_or_else(|| OwnError::Range {
            key: key.to_owned(),
            value: value.to_string(),
            low,
            high,
        })?)
    }
}

/// Representations that a program adds, by the names that `representation.kind` gives them.
#[derive(Debug, Clone, Default)]
pub struct Registry {
    all: Vec<(&'static str, BuildRepresentation)>,
    find: Option<FindRepresentation>,
}

impl Registry {
    /// No representation but kerrlight's own.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a representation; of several with one name the first counts.
    pub fn add(&mut self, name: &'static str, build: BuildRepresentation) {
        self.all.push((name, build));
    }

    /// Asks `find` for the names that were not added: those of a plug-in that is loaded when a fit names it.
    pub fn find_others(&mut self, find: FindRepresentation) {
        self.find = Some(find);
    }

    /// The names, in the order in which they were added.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.all.iter().map(|(name, _)| *name)
    }

    /// Builds the representation of a name; `None` if there is none.
    pub fn build(
        &self,
        name: &str,
        settings: &OwnSettings,
    ) -> Option<Result<Box<dyn Representation<f32>>, BuildError>> {
        match self.all.iter().find(|(known, _)| *known == name) {
            Some((_, build)) => Some(build(settings)),
            None => self.find.and_then(|find| find(name, settings)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::representation::{Network, NetworkSettings};

    fn small(own: &OwnSettings) -> Result<Box<dyn Representation<f32>>, BuildError> {
        let width = own.number("width", 8.0..=512.0)? as usize;
        Ok(Box::new(Network::new(NetworkSettings { width, ..NetworkSettings::bhnerf() })?))
    }

    #[test]
    fn exact_what_is_added_is_built_and_refuses_by_name() {
        let mut registry = Registry::new();
        registry.add("small", small);
        let own = |text: &str| OwnSettings {
            r_min: 0.0,
            r_max: 8.0,
            z_width: f64::INFINITY,
            table: text.parse().unwrap(),
        };
        let build = |text: &str| registry.build("small", &own(text)).unwrap();
        assert!(build("width = 8").unwrap().parameters() > 0);
        let says = |text: &str| build(text).err().unwrap().to_string();
        assert!(says("").starts_with("representation.own.settings.width is missing"));
        assert_eq!(
            says("width = 4"),
            "representation.own.settings.width = 4 is not allowed: 8 to 512"
        );
        assert!(registry.build("other", &own("")).is_none());
        assert!(registry.names().eq(["small"]));
        registry.find_others(|name, own| name.starts_with("plug-in:").then(|| small(own)));
        assert!(registry.build("plug-in:small", &own("width = 8")).unwrap().is_ok());
        assert!(registry.build("other", &own("")).is_none());
    }
}

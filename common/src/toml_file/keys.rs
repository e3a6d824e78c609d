//! Keys of settings, from the types that they are read into: meaning, unit, range and default stand at a field, once.

use schemars::{JsonSchema, SchemaGenerator};
use serde_json::{Map, Value};

/// Keys of a type of settings, as its JSON Schema describes them.
///
/// A field's documentation is its meaning; `#[schemars(range(min = …, max = …))]` its range, `extend("unit" = …)` its
/// unit. A range on a table holds for all numbers in it that have none of their own.
///
/// # Examples
/// ```
/// # use kerrlight_common::toml_file::Keys;
/// #[derive(schemars::JsonSchema)]
/// struct Hole {
///     /// Spin along +z.
///     #[schemars(range(min = -1.0, max = 1.0), extend("unit" = "a/M"))]
///     spin: f64,
/// }
/// let keys = Keys::of::<Hole>();
/// assert_eq!(keys.at("spin").unwrap().meaning, "Spin along +z.");
/// let wrong: toml::Table = "spin = 2.0".parse().unwrap();
/// assert_eq!(keys.check(&wrong).unwrap_err().allowed(), "-1 to 1 (a/M)");
/// ```
#[derive(Debug)]
pub struct Keys(Value);

/// A key of settings.
#[derive(Debug, Clone, PartialEq)]
pub struct Key {
    /// Its name in its table.
    pub name: String,
    /// Type of the value: `number`, `"edges"` or `"centers"`, …
    pub kind: String,
    /// Documentation of its field.
    pub meaning: String,
    /// Words or tables that it may be, each with its documentation.
    pub choices: Vec<(String, String)>,
    /// Its range, if it is a number or numbers.
    pub range: Option<Range>,
    /// Default value, as TOML; `None` if there is none.
    pub default: Option<String>,
    /// A value to begin with where nothing stands for it, as TOML.
    pub example: Option<String>,
    /// True if its table needs it.
    pub is_required: bool,
}

impl Key {
    /// Meaning, range and values in a line.
    pub fn note(&self) -> String {
        let meaning = self.meaning.trim_end_matches('.');
        let range = self.range.as_ref().filter(|range| range.is_given());
        let range = range
            .map(|range| format!("; {}", Range { unit: String::new(), ..range.clone() }.words()));
        let words = self.kind.starts_with(['"', '{']).then(|| format!(": {}", self.kind));
        format!("{meaning}{}{}", range.unwrap_or_default(), words.unwrap_or_default())
    }

    /// Returns whether it stands as a table of its own.
    pub fn is_table(&self) -> bool {
        matches!(&*self.kind, "table" | "list of table")
    }
}

/// Least and largest value of a number, both allowed, and its unit.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Range {
    /// The least value.
    pub least: Option<f64>,
    /// The largest value.
    pub most: Option<f64>,
    /// The unit, empty if there is none.
    pub unit: String,
}

/// A number out of its range, or none at all.
#[derive(Debug, Clone, PartialEq)]
pub struct OutOfRange {
    /// Dotted path of the key.
    pub key: String,
    /// The number.
    pub value: f64,
    /// Range of allowed values.
    pub range: Range,
}

impl OutOfRange {
    /// Returns the allowed values, in words.
    pub fn allowed(&self) -> String {
        self.range.words()
    }
}

impl Range {
    fn has(&self, number: f64) -> bool {
        // Above a least value alone, infinity says that there is no limit.
        number >= self.least.unwrap_or(f64::MIN)
            && (number <= self.most.unwrap_or(f64::MAX)
                || (self.least.is_some() && self.most.is_none() && !number.is_nan()))
    }

    /// Returns whether it says more than that a count is not negative.
    pub fn is_given(&self) -> bool {
        self.most.is_some() || self.least.is_some_and(|least| least != 0.0)
    }

    fn words(&self) -> String {
        let unit = if self.unit.is_empty() { String::new() } else { format!(" ({})", self.unit) };
        match (self.least, self.most) {
            (Some(least), Some(most)) => format!("{} to {}{unit}", bound(least), bound(most)),
            (Some(least), None) => format!("at least {}{unit}", bound(least)),
            (None, Some(most)) => format!("at most {}{unit}", bound(most)),
            (None, None) => format!("a finite number{unit}"),
        }
    }

    /// The same in which a part of settings has its own.
    fn within(&self, part: &Map<String, Value>) -> Self {
        let number = |name: &str| part.get(name).and_then(Value::as_f64);
        let unit = part.get("unit").and_then(Value::as_str);
        Self {
            least: number("minimum").or(self.least),
            most: number("maximum").or(self.most),
            unit: unit.map_or(self.unit.clone(), str::to_owned),
        }
    }
}

/// A number as a person would write it: `0.5`, `1e-12`.
pub fn shown(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && size.is_finite() && !(1e-4..1e9).contains(&size) {
        format!("{value:e}")
    } else {
        value.to_string()
    }
}

/// An end of a range: large round numbers as powers of ten.
pub fn bound(value: f64) -> String {
    let (plain, power) = (shown(value), format!("{value:e}"));
    if value.abs() >= 1e5 && power.len() < plain.len() { power } else { plain }
}

/// A part of the schema with the range that it takes from above.
#[derive(Clone)]
struct Part<'a> {
    schema: &'a Map<String, Value>,
    range: Range,
}

impl Keys {
    /// Those of a type.
    pub fn of<T: JsonSchema>() -> Self {
        let schema = SchemaGenerator::default().into_root_schema_for::<T>();
        Self(schema.into())
    }

    /// The JSON Schema itself, for editors.
    pub fn schema(&self) -> &Value {
        &self.0
    }

    /// Refuses the first number that is out of its range.
    ///
    /// # Errors
    /// With its key, its value and what is allowed.
    pub fn check(&self, table: &toml::Table) -> Result<(), OutOfRange> {
        table.iter().try_for_each(|(name, value)| {
            self.walk(value, &self.below(&self.root(), name), &mut name.clone())
        })
    }

    /// The key at a dotted path, in which names of variants count as keys, and numbers of list elements may be left out.
    pub fn at(&self, path: &str) -> Option<Key> {
        let (table, name) = path.rsplit_once('.').unwrap_or(("", path));
        self.table(table).into_iter().find(|key| key.name == name)
    }

    /// The keys of the table at a dotted path, those first that it needs; empty if it has none.
    pub fn table(&self, path: &str) -> Vec<Key> {
        let mut keys = Vec::new();
        for part in &self.tables_at(path) {
            let required = part.schema.get("required").and_then(Value::as_array);
            let required: Vec<&str> =
                required.into_iter().flatten().filter_map(Value::as_str).collect();
            let properties = part.schema.get("properties").and_then(Value::as_object);
            let all = properties.into_iter().flatten();
            let mut own: Vec<Key> = all
                .map(|(name, value)| self.key(name, value, part, required.contains(&name.as_str())))
                .collect();
            own.sort_by_key(|key| {
                required.iter().position(|name| *name == key.name).unwrap_or(usize::MAX)
            });
            keys.extend(own);
        }
        keys
    }

    /// The documentation of the table at a dotted path.
    pub fn about(&self, path: &str) -> String {
        let own = self.at(path).map(|key| key.meaning).filter(|meaning| !meaning.is_empty());
        let of_type =
            || self.tables_at(path).iter().find_map(|part| text(part.schema, "description"));
        own.or_else(of_type).unwrap_or_default()
    }

    /// Returns the types that a value at a dotted path may have; of a list, those of its elements.
    fn tables_at<'a>(&'a self, path: &str) -> Vec<Part<'a>> {
        let names = path.split('.').filter(|name| !name.is_empty());
        let parts = names.fold(self.root(), |parts, name| self.below(&parts, name));
        let elements = |part: Part<'a>| match part.schema.get("items") {
            Some(_) => self.below(&[part], "0"),
            None => vec![part],
        };
        parts.into_iter().flat_map(elements).collect()
    }

    fn root(&self) -> Vec<Part<'_>> {
        self.parts(&self.0, &Range::default())
    }

    /// All that a value may be: references are followed, alternatives put beside each other.
    fn parts<'a>(&'a self, value: &'a Value, from: &Range) -> Vec<Part<'a>> {
        let Some(schema) = value.as_object() else { return Vec::new() };
        let range = from.within(schema);
        if let Some(name) = schema.get("$ref").and_then(Value::as_str) {
            let name = name.trim_start_matches("#/$defs/");
            return self.parts(&self.0["$defs"][name], &range);
        }
        let lists = ["anyOf", "oneOf", "allOf"].into_iter().filter_map(|name| schema.get(name));
        let among = lists.filter_map(Value::as_array).flatten();
        let mut parts: Vec<Part<'_>> = among.flat_map(|value| self.parts(value, &range)).collect();
        if parts.is_empty() || schema.contains_key("properties") {
            parts.push(Part { schema, range });
        }
        parts
    }

    /// Returns the types that the value of a name in a table, or of a number in a list, may have.
    fn below<'a>(&'a self, parts: &[Part<'a>], name: &str) -> Vec<Part<'a>> {
        let of = |part: &Part<'a>| -> Option<Vec<Part<'a>>> {
            let items = part.schema.get("items");
            if let (Some(items), Err(_)) = (items, name.parse::<usize>()) {
                return Some(self.below(&self.parts(items, &part.range), name));
            }
            let inner = part.schema.get("properties").and_then(|all| all.get(name));
            let any = || part.schema.get("additionalProperties").filter(|value| value.is_object());
            Some(self.parts(inner.or(items).or_else(any)?, &part.range))
        };
        parts.iter().filter_map(of).flatten().collect()
    }

    fn walk(
        &self,
        value: &toml::Value,
        parts: &[Part<'_>],
        key: &mut String,
    ) -> Result<(), OutOfRange> {
        let mut each = |name: &str, value: &toml::Value| {
            let length = key.len();
            key.push('.');
            key.push_str(name);
            let result = self.walk(value, &self.below(parts, name), key);
            key.truncate(length);
            result
        };
        let number = match value {
            toml::Value::Table(table) => {
                return table.iter().try_for_each(|(name, value)| each(name, value));
            }
            toml::Value::Array(values) => {
                let mut all = values.iter().enumerate();
                return all.try_for_each(|(k, value)| each(&k.to_string(), value));
            }
            toml::Value::Float(number) => *number,
            toml::Value::Integer(number) => *number as f64,
            _ => return Ok(()),
        };
        let ranges = || parts.iter().filter(|part| is_number(part.schema)).map(|part| &part.range);
        let mut all = ranges();
        // Keys without a number in the schema are a user's own, or refused where settings are read.
        match all.next() {
            Some(first) if !first.has(number) && !all.any(|range| range.has(number)) => {
                Err(OutOfRange { key: key.clone(), value: number, range: first.clone() })
            }
            _ => Ok(()),
        }
    }

    fn key(&self, name: &str, value: &Value, table: &Part<'_>, is_required: bool) -> Key {
        let parts = self.parts(value, &table.range);
        let own = value.as_object();
        let about = |part: &Part<'_>| text(part.schema, "description");
        // A variant's documentation stands above its only property.
        let only =
            |part: &&Part<'_>| part.schema.get("properties")?.as_object().map(|all| all.len() == 1);
        let of_variant = || Some(table).filter(|part| only(part) == Some(true)).and_then(about);
        let meaning = own.and_then(|own| text(own, "description")).or_else(of_variant);
        let meaning = meaning.or_else(|| parts.iter().find_map(about));
        let numbers = parts.iter().flat_map(|part| {
            let element = part.schema.get("items").map(|items| self.parts(items, &part.range));
            element.unwrap_or_else(|| vec![part.clone()])
        });
        let range = numbers.filter(|part| is_number(part.schema)).map(|part| part.range).next();
        let default = own.and_then(|own| own.get("default")).filter(|value| !value.is_null());
        Key {
            name: name.to_owned(),
            kind: self.kind(&parts),
            meaning: meaning.unwrap_or_default(),
            choices: self.choices(&parts),
            range,
            default: default.map(inline),
            example: own.and_then(|own| own.get("examples")?.get(0)).map(inline),
            is_required,
        }
    }

    /// Alternatives with their documentation, if there are several.
    fn choices(&self, parts: &[Part<'_>]) -> Vec<(String, String)> {
        let of = |part: &Part<'_>| {
            let kind = self.kind_of(part);
            let is_one = kind.starts_with(['"', '{']) && !kind.contains(", ");
            is_one.then(|| Some((kind, text(part.schema, "description")?))).flatten()
        };
        let all: Vec<_> = parts.iter().filter_map(of).collect();
        if all.len() > 1 { all } else { Vec::new() }
    }

    /// Names the type of values, in a word or two.
    fn kind(&self, parts: &[Part<'_>]) -> String {
        let mut kinds: Vec<String> = Vec::new();
        for part in parts {
            let kind = self.kind_of(part);
            if !kind.is_empty() && !kinds.contains(&kind) {
                kinds.push(kind);
            }
        }
        kinds.join(", ")
    }

    fn kind_of(&self, part: &Part<'_>) -> String {
        if let Some(word) = part.schema.get("const").and_then(Value::as_str) {
            return format!("{word:?}");
        }
        if let Some(words) = part.schema.get("enum").and_then(Value::as_array) {
            let words: Vec<String> =
                words.iter().filter(|word| !word.is_null()).map(Value::to_string).collect();
            return words.join(", ");
        }
        let names = part.schema.get("properties").and_then(Value::as_object);
        match (types(part.schema).next(), names) {
            (Some("object"), Some(names)) if names.len() == 1 => {
                let name: Vec<&str> = names.keys().map(String::as_str).collect();
                format!("{{ {} = … }}", name.concat())
            }
            (Some("object"), _) => "table".to_owned(),
            (Some("array"), _) => {
                let of = part.schema.get("items").map(|items| self.parts(items, &part.range));
                format!("list of {}", self.kind(&of.unwrap_or_default()))
            }
            (Some("number"), _) => "number".to_owned(),
            (Some("integer"), _) => "integer".to_owned(),
            (Some("boolean"), _) => "true or false".to_owned(),
            (Some(other), _) if other != "null" => other.to_owned(),
            _ => String::new(),
        }
    }
}

/// A value of JSON as TOML has it in a line.
fn inline(value: &Value) -> String {
    super::inline(&without_null(value)).unwrap_or_else(|_| value.to_string())
}

/// The same without keys of no value, which TOML does not write.
fn without_null(value: &Value) -> Value {
    match value {
        Value::Object(all) => {
            let given = all.iter().filter(|(_, value)| !value.is_null());
            given.map(|(key, value)| (key.clone(), without_null(value))).collect()
        }
        Value::Array(all) => all.iter().map(without_null).collect(),
        other => other.clone(),
    }
}

fn types(schema: &Map<String, Value>) -> impl Iterator<Item = &str> {
    let kind = schema.get("type");
    let list = kind.and_then(Value::as_array).into_iter().flatten();
    kind.and_then(Value::as_str).into_iter().chain(list.filter_map(Value::as_str))
}

fn is_number(schema: &Map<String, Value>) -> bool {
    types(schema).any(|kind| matches!(kind, "number" | "integer"))
        || (!schema.contains_key("type") && schema.contains_key("minimum"))
}

fn text(schema: &Map<String, Value>, name: &str) -> Option<String> {
    Some(schema.get(name)?.as_str()?.replace('\n', " "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// A file.
    #[derive(JsonSchema)]
    #[allow(dead_code)]
    struct File {
        /// The law
        /// of motion.
        #[schemars(extend("unit" = "M"))]
        law: Option<Law>,
        /// Radii.
        #[schemars(inner(range(min = 1.0, max = 9.0)))]
        radii: Vec<f64>,
        #[schemars(range(min = 2, max = 8), extend("unit" = "nodes"))]
        #[serde(default = "four")]
        nodes: usize,
        #[schemars(extend("minimum" = 0.0, "maximum" = 180.0, "unit" = "degrees"))]
        angles: Steps,
        #[schemars(extend("additionalProperties" = {"type": "number", "minimum": 0.0}))]
        stations: BTreeMap<String, f64>,
        width: f64,
        #[schemars(with = "BTreeMap<String, Value>")]
        own: toml::Table,
    }

    fn four() -> usize {
        4
    }

    #[derive(JsonSchema)]
    #[allow(dead_code)]
    struct Steps {
        from: f64,
        #[schemars(range(min = 1e-3))]
        step: f64,
    }

    #[derive(JsonSchema)]
    #[serde(rename_all = "kebab-case")]
    #[allow(dead_code)]
    enum Law {
        /// Rigid.
        Rigid,
        Power {
            /// Radius of the rate.
            #[schemars(range(max = 5.0))]
            radius: f64,
        },
        Perturbed(Box<Law>),
    }

    fn refused(text: &str) -> String {
        let error = Keys::of::<File>().check(&text.parse().unwrap()).unwrap_err();
        format!("{} = {}: {}", error.key, shown(error.value), error.allowed())
    }

    #[test]
    fn exact_numbers_out_of_range_are_named() {
        for (text, says) in [
            ("radii = [2.0, 0.5]", "radii.1 = 0.5: 1 to 9"),
            ("nodes = 9", "nodes = 9: 2 to 8 (nodes)"),
            ("law = { power = { radius = 6.0 } }", "law.power.radius = 6: at most 5 (M)"),
            (
                "law = { perturbed = { power = { radius = nan } } }",
                "law.perturbed.power.radius = NaN: at most 5 (M)",
            ),
            ("angles = { from = 181.0 }", "angles.from = 181: 0 to 180 (degrees)"),
            ("angles = { step = 1e-300 }", "angles.step = 1e-300: 0.001 to 180 (degrees)"),
            ("stations = { AA = -1.0 }", "stations.AA = -1: at least 0"),
            ("width = inf", "width = inf: a finite number"),
        ] {
            assert_eq!(refused(text), says, "{text}");
        }
        let keys = Keys::of::<File>();
        let allowed = "own = { x = nan }\nradii = [1, 9]\nstations = { AA = inf }\nunknown = nan";
        keys.check(&allowed.parse().unwrap()).unwrap();
    }

    #[test]
    fn exact_keys_have_what_stands_at_their_fields() {
        let keys = Keys::of::<File>();
        let law = keys.at("law").unwrap();
        assert_eq!((&*law.meaning, law.is_required), ("The law of motion.", false));
        assert_eq!(law.kind, "\"rigid\", { power = … }, { perturbed = … }");
        assert_eq!(keys.at("law.power.radius").unwrap().meaning, "Radius of the rate.");
        let nodes = keys.at("nodes").unwrap();
        assert_eq!((nodes.default.as_deref(), nodes.is_required), (Some("4"), false));
        assert_eq!(keys.at("radii").unwrap().range.unwrap().most, Some(9.0));
        let names: Vec<String> = keys.table("").into_iter().map(|key| key.name).collect();
        assert_eq!(names[..2], ["radii", "angles"], "what is needed comes first: {names:?}");
        assert!(keys.at("nonsense").is_none() && keys.at("law.rigid.x").is_none());
    }
}

//! A parsed TOML text as serde's data model. Generic code is kept small: it is compiled for every type that is read.

use super::ReadError;
use super::error::brief;
use serde::de::value::StrDeserializer;
use serde::de::{
    DeserializeSeed, Deserializer, EnumAccess, Error, Expected, IntoDeserializer, MapAccess,
    SeqAccess, Unexpected, VariantAccess, Visitor,
};
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeFloat, DeInteger, DeTable, DeValue};

type Entry<'a> = (&'a Spanned<std::borrow::Cow<'a, str>>, &'a Spanned<DeValue<'a>>);

/// The table that a whole text is, or a value in it.
#[derive(Clone, Copy)]
pub(super) struct Value<'a>(pub(super) &'a Spanned<DeValue<'a>>);

enum Number {
    Integer(i64),
    Float(f64),
}

fn integer(value: &DeInteger<'_>) -> Result<i64, ReadError> {
    let digits = value.as_str().replace('_', "");
    i64::from_str_radix(&digits, value.radix())
        .map_err(|_| ReadError::custom(format_args!("{} has more than 64 bits", brief(&digits))))
}

fn float(value: &DeFloat<'_>) -> Result<f64, ReadError> {
    let digits = value.as_str().replace('_', "");
    digits
        .parse()
        .map_err(|_| ReadError::custom(format_args!("{} is not a number", brief(&digits))))
}

impl<'a> Value<'a> {
    fn number(self, expected: &dyn Expected) -> Result<Number, ReadError> {
        match self.0.get_ref() {
            DeValue::Integer(value) => integer(value).map(Number::Integer),
            DeValue::Float(value) => float(value).map(Number::Float),
            _ => Err(self.refused(expected)),
        }
    }

    fn string(self, expected: &dyn Expected) -> Result<&'a str, ReadError> {
        self.0.get_ref().as_str().ok_or_else(|| self.refused(expected))
    }

    fn table(self, expected: &dyn Expected) -> Result<Entries<'a>, ReadError> {
        let table = self.0.get_ref().as_table().ok_or_else(|| self.refused(expected))?;
        Ok(Entries::new(table))
    }

    fn array(self, expected: &dyn Expected) -> Result<Elements<'a>, ReadError> {
        let array = self.0.get_ref().as_array().ok_or_else(|| self.refused(expected))?;
        Ok(Elements { rest: array.iter().enumerate() })
    }

    /// An array of a given length.
    fn tuple(self, length: usize, expected: &dyn Expected) -> Result<Elements<'a>, ReadError> {
        let elements = self.array(expected)?;
        let given = elements.rest.len();
        if given == length { Ok(elements) } else { Err(ReadError::invalid_length(given, expected)) }
    }

    /// Name of a variant, one of these, and what it holds.
    fn variant(self, names: &[&str]) -> Result<Variant<'a>, ReadError> {
        if let DeValue::String(name) = self.0.get_ref() {
            return Ok(Variant { name, value: None, span: self.0.span() });
        }
        let mut entries = self.table(&"a string or a table of one key")?.rest;
        let Some((name, value)) = entries.next() else {
            let names = names.join("`, `");
            return Err(ReadError::custom(format!("an empty table, expected one of `{names}`")));
        };
        if entries.next().is_some() {
            let names = names.join("`, `");
            return Err(ReadError::custom(format!("more than one key, expected one of `{names}`")));
        }
        Ok(Variant { name: name.get_ref(), value: Some(Value(value)), span: name.span() })
    }

    /// Returns the error for a value of another type.
    fn refused(self, expected: &dyn Expected) -> ReadError {
        let text;
        let found = match self.0.get_ref() {
            DeValue::String(value) => {
                text = brief(value);
                Unexpected::Str(&text)
            }
            DeValue::Boolean(value) => Unexpected::Bool(*value),
            DeValue::Integer(value) => match integer(value) {
                Ok(value) => Unexpected::Signed(value),
                Err(error) => return error,
            },
            DeValue::Float(value) => match float(value) {
                Ok(value) => Unexpected::Float(value),
                Err(error) => return error,
            },
            DeValue::Datetime(value) => {
                text = format!("date {value}");
                Unexpected::Other(&text)
            }
            DeValue::Array(_) => Unexpected::Seq,
            DeValue::Table(_) => Unexpected::Map,
        };
        ReadError::invalid_type(found, expected)
    }
}

macro_rules! numbers {
    ($($method:ident)*) => {
        $(fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadError> {
            match self.number(&visitor)? {
                Number::Integer(value) => visitor.visit_i64(value),
                Number::Float(value) => visitor.visit_f64(value),
            }
        })*
    };
}

macro_rules! strings {
    ($($method:ident)*) => {
        $(fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadError> {
            let text = self.string(&visitor)?;
            visitor.visit_str(text)
        })*
    };
}

impl<'de> Deserializer<'de> for Value<'_> {
    type Error = ReadError;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadError> {
        match self.0.get_ref() {
            DeValue::String(value) => visitor.visit_str(value),
            DeValue::Integer(value) => visitor.visit_i64(integer(value)?),
            DeValue::Float(value) => visitor.visit_f64(float(value)?),
            DeValue::Boolean(value) => visitor.visit_bool(*value),
            DeValue::Datetime(_) => Err(ReadError::custom("dates are not used here")),
            DeValue::Array(_) => visitor.visit_seq(self.array(&"an array")?),
            DeValue::Table(_) => visitor.visit_map(self.table(&"a table")?),
        }
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadError> {
        match self.0.get_ref().as_bool() {
            Some(value) => visitor.visit_bool(value),
            None => Err(self.refused(&visitor)),
        }
    }

    numbers! {
        deserialize_i8 deserialize_i16 deserialize_i32 deserialize_i64 deserialize_i128
        deserialize_u8 deserialize_u16 deserialize_u32 deserialize_u64 deserialize_u128
        deserialize_f32 deserialize_f64
    }

    strings! {
        deserialize_char deserialize_str deserialize_string deserialize_identifier
        deserialize_bytes deserialize_byte_buf
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadError> {
        // TOML has no null: a key that stands there has a value.
        visitor.visit_some(self)
    }

    fn deserialize_unit<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadError> {
        Err(self.refused(&visitor))
    }

    fn deserialize_unit_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, ReadError> {
        Err(self.refused(&visitor))
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, ReadError> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadError> {
        let elements = self.array(&visitor)?;
        visitor.visit_seq(elements)
    }

    fn deserialize_tuple<V: Visitor<'de>>(
        self,
        length: usize,
        visitor: V,
    ) -> Result<V::Value, ReadError> {
        let elements = self.tuple(length, &visitor)?;
        visitor.visit_seq(elements)
    }

    fn deserialize_tuple_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        length: usize,
        visitor: V,
    ) -> Result<V::Value, ReadError> {
        self.deserialize_tuple(length, visitor)
    }

    fn deserialize_map<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadError> {
        let entries = self.table(&visitor)?;
        visitor.visit_map(entries)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, ReadError> {
        self.deserialize_map(visitor)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        names: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, ReadError> {
        visitor.visit_enum(self.variant(names)?)
    }

    fn deserialize_ignored_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, ReadError> {
        visitor.visit_unit()
    }
}

/// Remaining entries of a table.
struct Entries<'a> {
    rest: std::vec::IntoIter<Entry<'a>>,
    value: Option<Entry<'a>>,
}

impl<'a> Entries<'a> {
    /// Takes entries in the order of the text, so that the first error is the first that a reader meets.
    fn new(table: &'a DeTable<'a>) -> Self {
        let mut entries: Vec<Entry<'a>> = table.iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start);
        Entries { rest: entries.into_iter(), value: None }
    }
}

impl<'de> MapAccess<'de> for Entries<'_> {
    type Error = ReadError;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, ReadError> {
        self.value = self.rest.next();
        let Some((key, _)) = self.value else { return Ok(None) };
        match seed.deserialize(name(key.get_ref())) {
            Ok(key) => Ok(Some(key)),
            Err(error) => Err(error.at(key.span())),
        }
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, ReadError> {
        let Some((key, value)) = self.value else {
            return Err(ReadError::custom("a value before its key"));
        };
        let result = seed.deserialize(Value(value));
        result.map_err(|error| error.under(key.get_ref().clone().into_owned(), value.span()))
    }
}

fn name(text: &str) -> StrDeserializer<'_, ReadError> {
    text.into_deserializer()
}

/// Remaining elements of an array.
struct Elements<'a> {
    rest: std::iter::Enumerate<std::slice::Iter<'a, Spanned<DeValue<'a>>>>,
}

impl<'de> SeqAccess<'de> for Elements<'_> {
    type Error = ReadError;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, ReadError> {
        let Some((k, value)) = self.rest.next() else { return Ok(None) };
        match seed.deserialize(Value(value)) {
            Ok(value) => Ok(Some(value)),
            Err(error) => Err(error.under(k.to_string(), value.span())),
        }
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.rest.len())
    }
}

/// One of several kinds.
struct Variant<'a> {
    name: &'a str,
    value: Option<Value<'a>>,
    span: Range<usize>,
}

impl<'a> Variant<'a> {
    /// Returns the value that the kind holds.
    fn held(&self) -> Result<Value<'a>, ReadError> {
        self.value.ok_or_else(|| {
            ReadError::custom(format_args!("`{}` needs values: a table of this key", self.name))
        })
    }

    fn under(&self, error: ReadError) -> ReadError {
        match self.value {
            Some(value) => error.under(self.name.to_owned(), value.0.span()),
            None => error.at(self.span.clone()),
        }
    }
}

impl<'de> EnumAccess<'de> for Variant<'_> {
    type Error = ReadError;
    type Variant = Self;

    fn variant_seed<V: DeserializeSeed<'de>>(self, seed: V) -> Result<(V::Value, Self), ReadError> {
        match seed.deserialize(name(self.name)) {
            Ok(kind) => Ok((kind, self)),
            Err(error) => Err(error.at(self.span)),
        }
    }
}

impl<'de> VariantAccess<'de> for Variant<'_> {
    type Error = ReadError;

    fn unit_variant(self) -> Result<(), ReadError> {
        match self.value {
            None => Ok(()),
            Some(value) => Err(self.under(value.refused(&"no value"))),
        }
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, ReadError> {
        seed.deserialize(self.held()?).map_err(|error| self.under(error))
    }

    fn tuple_variant<V: Visitor<'de>>(
        self,
        length: usize,
        visitor: V,
    ) -> Result<V::Value, ReadError> {
        self.held()?.deserialize_tuple(length, visitor).map_err(|error| self.under(error))
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, ReadError> {
        self.held()?.deserialize_map(visitor).map_err(|error| self.under(error))
    }
}

//! serde's data model as a TOML document whose keys stand in the order of the fields. As in the deserialiser, generic
//! code is kept small.

use super::ReadError;
use serde::Serialize;
use serde::ser::{
    Error, SerializeMap, SerializeSeq, SerializeStruct, SerializeStructVariant, SerializeTuple,
    SerializeTupleStruct, SerializeTupleVariant, Serializer,
};
use toml_edit::{Array, ArrayOfTables, Item, Table, Value};

/// A value in TOML; nothing for `None`.
type Written = Result<Option<Item>, ReadError>;

/// A document into which a value is written.
pub(super) struct Document;

/// A table that grows, and the variant whose values it holds.
pub(super) struct Fields {
    table: Table,
    key: Option<String>,
    variant: Option<&'static str>,
}

/// An array that grows, and the variant whose values it holds.
pub(super) struct Elements {
    items: Vec<Item>,
    variant: Option<&'static str>,
}

fn value(value: impl Into<Value>) -> Written {
    Ok(Some(Item::Value(value.into())))
}

/// The values of a variant as a table of its name.
fn under(variant: Option<&'static str>, item: Item) -> Item {
    let Some(name) = variant else { return item };
    let mut table = Table::new();
    // As `[law.infall]` names both, `law` needs no heading of its own.
    table.set_implicit(true);
    table.insert(name, item);
    Item::Table(table)
}

impl Fields {
    fn new(variant: Option<&'static str>) -> Self {
        Fields { table: Table::new(), key: None, variant }
    }

    fn push(&mut self, key: &str, item: Option<Item>) {
        if let Some(item) = item {
            self.table.insert(key, item);
        }
    }

    /// A table of nothing but tables needs no heading of its own.
    fn finish(mut self) -> Written {
        let is_table = |item: &Item| item.is_table() || item.is_array_of_tables();
        let all_are = self.table.iter().all(|(_, item)| is_table(item));
        self.table.set_implicit(all_are && !self.table.is_empty());
        Ok(Some(under(self.variant, Item::Table(self.table))))
    }
}

impl Elements {
    fn new(variant: Option<&'static str>) -> Self {
        Elements { items: Vec::new(), variant }
    }

    fn push(&mut self, item: Option<Item>) -> Result<(), ReadError> {
        self.items.push(item.ok_or_else(|| ReadError::custom("TOML's arrays have no gaps"))?);
        Ok(())
    }

    /// Tables alone are an array of tables.
    fn finish(self) -> Written {
        let are_tables = !self.items.is_empty() && self.items.iter().all(Item::is_table);
        let item = if are_tables {
            let tables = self.items.into_iter().filter_map(|item| item.into_table().ok());
            Item::ArrayOfTables(tables.collect::<ArrayOfTables>())
        } else {
            let values = self.items.into_iter().filter_map(|item| item.into_value().ok());
            Item::Value(Value::Array(values.collect::<Array>()))
        };
        Ok(Some(under(self.variant, item)))
    }
}

macro_rules! whole_numbers {
    ($($method:ident: $number:ty)*) => {
        $(fn $method(self, number: $number) -> Written {
            match i64::try_from(number) {
                Ok(number) => value(number),
                Err(_) => Err(ReadError::custom(format_args!("{number} is too large for TOML"))),
            }
        })*
    };
}

impl Serializer for Document {
    type Ok = Option<Item>;
    type Error = ReadError;
    type SerializeSeq = Elements;
    type SerializeTuple = Elements;
    type SerializeTupleStruct = Elements;
    type SerializeTupleVariant = Elements;
    type SerializeMap = Fields;
    type SerializeStruct = Fields;
    type SerializeStructVariant = Fields;

    whole_numbers! {
        serialize_i8: i8 serialize_i16: i16 serialize_i32: i32 serialize_i64: i64 serialize_i128: i128
        serialize_u8: u8 serialize_u16: u16 serialize_u32: u32 serialize_u64: u64 serialize_u128: u128
    }

    fn serialize_bool(self, flag: bool) -> Written {
        value(flag)
    }

    fn serialize_f32(self, number: f32) -> Written {
        // The digits of f32, not those of its neighbour in f64.
        value(number.to_string().parse().unwrap_or(f64::from(number)))
    }

    fn serialize_f64(self, number: f64) -> Written {
        value(number)
    }

    fn serialize_char(self, letter: char) -> Written {
        value(letter.to_string())
    }

    fn serialize_str(self, text: &str) -> Written {
        value(text)
    }

    fn serialize_bytes(self, bytes: &[u8]) -> Written {
        value(bytes.iter().map(|byte| i64::from(*byte)).collect::<Array>())
    }

    fn serialize_none(self) -> Written {
        Ok(None)
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Written {
        value.serialize(self)
    }

    fn serialize_unit(self) -> Written {
        Ok(None)
    }

    fn serialize_unit_struct(self, _: &'static str) -> Written {
        Ok(None)
    }

    fn serialize_unit_variant(self, _: &'static str, _: u32, variant: &'static str) -> Written {
        value(variant)
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        value: &T,
    ) -> Written {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        value: &T,
    ) -> Written {
        Ok(value.serialize(Document)?.map(|item| under(Some(variant), item)))
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<Elements, ReadError> {
        Ok(Elements::new(None))
    }

    fn serialize_tuple(self, _: usize) -> Result<Elements, ReadError> {
        Ok(Elements::new(None))
    }

    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<Elements, ReadError> {
        Ok(Elements::new(None))
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<Elements, ReadError> {
        Ok(Elements::new(Some(variant)))
    }

    fn serialize_map(self, _: Option<usize>) -> Result<Fields, ReadError> {
        Ok(Fields::new(None))
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Fields, ReadError> {
        Ok(Fields::new(None))
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<Fields, ReadError> {
        Ok(Fields::new(Some(variant)))
    }
}

macro_rules! elements {
    ($($kind:ident: $method:ident)*) => {
        $(impl $kind for Elements {
            type Ok = Option<Item>;
            type Error = ReadError;

            fn $method<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), ReadError> {
                self.push(value.serialize(Document)?)
            }

            fn end(self) -> Written {
                self.finish()
            }
        })*
    };
}

elements! {
    SerializeSeq: serialize_element SerializeTuple: serialize_element
    SerializeTupleStruct: serialize_field SerializeTupleVariant: serialize_field
}

macro_rules! fields {
    ($($kind:ident)*) => {
        $(impl $kind for Fields {
            type Ok = Option<Item>;
            type Error = ReadError;

            fn serialize_field<T: Serialize + ?Sized>(
                &mut self,
                key: &'static str,
                value: &T,
            ) -> Result<(), ReadError> {
                let item = value.serialize(Document)?;
                self.push(key, item);
                Ok(())
            }

            fn end(self) -> Written {
                self.finish()
            }
        })*
    };
}

fields! { SerializeStruct SerializeStructVariant }

impl SerializeMap for Fields {
    type Ok = Option<Item>;
    type Error = ReadError;

    fn serialize_key<T: Serialize + ?Sized>(&mut self, key: &T) -> Result<(), ReadError> {
        let item = key.serialize(Document)?;
        let text = item.as_ref().and_then(Item::as_str);
        self.key = Some(text.ok_or_else(|| ReadError::custom("a key is a string"))?.to_owned());
        Ok(())
    }

    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), ReadError> {
        let item = value.serialize(Document)?;
        let key = self.key.take().ok_or_else(|| ReadError::custom("a value before its key"))?;
        self.push(&key, item);
        Ok(())
    }

    fn end(self) -> Written {
        self.finish()
    }
}

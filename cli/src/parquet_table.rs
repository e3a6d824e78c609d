//! Tables as Parquet, for programs that read columns of many rows.

use crate::compare::Values;
use anyhow::Context;
use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::{Type, TypePtr};
use std::sync::Arc;

/// The bytes of a file with these columns, which have the same length.
pub fn encode(columns: &[(String, Values)]) -> anyhow::Result<Vec<u8>> {
    let fields = columns.iter().map(|(name, values)| field(name, values));
    let fields = fields.collect::<anyhow::Result<Vec<_>>>()?;
    let schema = Type::group_type_builder("table").with_fields(fields).build()?;
    let properties = Arc::new(WriterProperties::builder().build());
    let mut writer = SerializedFileWriter::new(Vec::new(), Arc::new(schema), properties)?;
    let mut rows = writer.next_row_group()?;
    for (name, values) in columns {
        let mut column = rows.next_column()?.with_context(|| format!("no column {name}"))?;
        write(&mut column, values)?;
        column.close()?;
    }
    rows.close()?;
    Ok(writer.into_inner()?)
}

fn field(name: &str, values: &Values) -> anyhow::Result<TypePtr> {
    let (physical, logical, repetition) = match values {
        Values::Text(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String), Repetition::REQUIRED),
        Values::Whole(_) => (Physical::INT64, None, Repetition::REQUIRED),
        Values::Number(_) => (Physical::DOUBLE, None, Repetition::OPTIONAL),
    };
    let field = Type::primitive_type_builder(name, physical);
    Ok(Arc::new(field.with_repetition(repetition).with_logical_type(logical).build()?))
}

fn write(column: &mut SerializedColumnWriter<'_>, values: &Values) -> anyhow::Result<()> {
    match values {
        Values::Text(all) => {
            let all: Vec<ByteArray> = all.iter().map(|word| word.as_str().into()).collect();
            column.typed::<ByteArrayType>().write_batch(&all, None, None)?;
        }
        Values::Whole(all) => {
            column.typed::<Int64Type>().write_batch(all, None, None)?;
        }
        Values::Number(all) => {
            let there: Vec<f64> = all.iter().flatten().copied().collect();
            let levels: Vec<i16> = all.iter().map(|value| i16::from(value.is_some())).collect();
            column.typed::<DoubleType>().write_batch(&there, Some(&levels), None)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;

    #[test]
    fn exact_what_is_written_is_read() {
        let words = ["grid", "", "ä, \"b\""].map(str::to_owned).to_vec();
        let numbers = vec![Some(0.1 + 0.2), None, Some(-1e300)];
        let table = [
            ("kind".to_owned(), Values::Text(words.clone())),
            ("seed".to_owned(), Values::Whole(vec![1, -2, i64::MAX])),
            ("psnr_db".to_owned(), Values::Number(numbers.clone())),
        ];
        let bytes = encode(&table).unwrap();
        assert!(bytes == encode(&table).unwrap());
        let reader = SerializedFileReader::new(parquet_bytes(bytes)).unwrap();
        let rows: Vec<_> = reader.get_row_iter(None).unwrap().map(Result::unwrap).collect();
        assert_eq!(rows.len(), 3);
        for (k, row) in rows.iter().enumerate() {
            let fields: Vec<&Field> = row.get_column_iter().map(|(_, field)| field).collect();
            assert_eq!(fields[0], &Field::Str(words[k].clone()));
            assert_eq!(fields[1], &Field::Long([1, -2, i64::MAX][k]));
            assert_eq!(fields[2], &numbers[k].map_or(Field::Null, Field::Double));
        }
    }

    #[test]
    fn exact_a_table_may_have_no_rows() {
        let none = [("seed".to_owned(), Values::Whole(Vec::new()))];
        let bytes = encode(&none).unwrap();
        let reader = SerializedFileReader::new(parquet_bytes(bytes)).unwrap();
        assert_eq!(reader.metadata().file_metadata().num_rows(), 0);
    }

    /// A file that is read.
    fn parquet_bytes(bytes: Vec<u8>) -> std::fs::File {
        use std::io::{Seek, Write};
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(&bytes).unwrap();
        file.rewind().unwrap();
        file
    }
}

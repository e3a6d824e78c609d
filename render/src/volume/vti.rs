//! The file of ParaView and other VTK programs: XML ImageData (`.vti`), fields as 32-bit floats on the
//! nodes, behind the header as they are in memory ("appended raw", little endian).
//!
//! <https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html>

use super::metrics::same_nodes;
use super::{Shown, Volume};
use crate::Error;
use std::io::{self, Write};

/// Reason why a file is not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VtiError {
    /// A name that is none.
    #[error("field name {0:?} is not allowed: unique names of letters, digits and _")]
    Name(String),
    /// A file holds one field or more.
    #[error("at least one field is needed")]
    Empty,
}

/// Writes volumes on the same nodes as fields, the first of them as the active one. Coordinates are in M, names are of
/// letters, digits and `_`.
///
/// # Errors
/// If the nodes differ, a name is not allowed or used twice, or the bytes cannot be written.
pub fn write(out: &mut impl Write, fields: &[Shown]) -> Result<(), Error> {
    let Some(first) = fields.first() else { return Err(VtiError::Empty.into()) };
    for (k, field) in fields.iter().enumerate() {
        let simple = field.name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        let used = fields.iter().take(k).any(|other| other.name == field.name);
        if field.name.is_empty() || !simple || used {
            return Err(VtiError::Name(field.name.to_owned()).into());
        }
        same_nodes(first.volume, field.volume)?;
    }
    out.write_all(header(fields, first).as_bytes())?;
    for field in fields {
        write_values(out, field.volume)?;
    }
    out.write_all(b"\n  </AppendedData>\n</VTKFile>\n")?;
    Ok(())
}

fn header(fields: &[Shown], first: &Shown) -> String {
    let volume = first.volume;
    let last = volume.nodes().map(|n| n - 1);
    let extent = format!("0 {} 0 {} 0 {}", last[0], last[1], last[2]);
    let [x, y, z] = volume.low();
    let [dx, dy, dz] = volume.spacing();
    // Each field is preceded by its length in 64 bits.
    let block = 8 + 4 * volume.values().len();
    let array = |(k, field): (usize, &Shown)| {
        let (name, offset) = (field.name, k * block);
        format!(
            r#"        <DataArray type="Float32" Name="{name}" format="appended" offset="{offset}"/>"#
        ) + "\n"
    };
    let arrays: String = fields.iter().enumerate().map(array).collect();
    format!(
        r#"<?xml version="1.0"?>
<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64">
  <ImageData WholeExtent="{extent}" Origin="{x} {y} {z}" Spacing="{dx} {dy} {dz}">
    <Piece Extent="{extent}">
      <PointData Scalars="{}">
{arrays}      </PointData>
    </Piece>
  </ImageData>
  <AppendedData encoding="raw">
   _"#,
        first.name
    )
}

/// The number of bytes, then the values.
fn write_values(out: &mut impl Write, volume: &Volume) -> io::Result<()> {
    let bytes = 4 * volume.values().len() as u64;
    out.write_all(&bytes.to_le_bytes())?;
    for value in volume.x_fastest() {
        out.write_all(&value.to_le_bytes())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> Volume {
        let values = (0..24).map(|k| k as f32 + 0.5).collect();
        Volume::new([2, 3, 4], [-5.0, -1.0, 0.25], [5.0, 1.0, 1.0], values).unwrap()
    }

    fn attribute<'a>(header: &'a str, name: &str) -> &'a str {
        let start = header.find(&format!(" {name}=\"")).unwrap() + name.len() + 3;
        header[start..].split('"').next().unwrap()
    }

    fn floats(text: &str) -> Vec<f64> {
        text.split(' ').map(|word| word.parse().unwrap()).collect()
    }

    #[test]
    fn exact_header_and_values_come_back() {
        let volume = ramp();
        let doubled = volume.values().iter().map(|v| 2.0 * v).collect();
        let doubled = Volume::new(volume.nodes(), volume.low(), volume.high(), doubled).unwrap();
        let fields = [
            Shown { name: "emission", volume: &volume },
            Shown { name: "emission_truth", volume: &doubled },
        ];
        let mut bytes = Vec::new();
        write(&mut bytes, &fields).unwrap();
        let mark = bytes.iter().position(|b| *b == b'_' && bytes.is_ascii()).or_else(|| {
            let start = b"encoding=\"raw\">\n   _";
            bytes.windows(start.len()).position(|w| w == start).map(|k| k + start.len() - 1)
        });
        let (header, data) = bytes.split_at(mark.unwrap() + 1);
        let header = std::str::from_utf8(header).unwrap();
        assert_eq!(attribute(header, "WholeExtent"), "0 1 0 2 0 3");
        assert_eq!(floats(attribute(header, "Origin")), [-5.0, -1.0, 0.25]);
        assert_eq!(floats(attribute(header, "Spacing")), [10.0, 1.0, 0.25]);
        assert_eq!(attribute(header, "Scalars"), "emission");
        assert!(header.contains(r#"Name="emission_truth" format="appended" offset="104""#));
        for (field, start) in fields.iter().zip([0, 104]) {
            assert_eq!(data[start..start + 8], 96u64.to_le_bytes());
            let value = |k: usize| {
                let place = start + 8 + 4 * k;
                f32::from_le_bytes(data[place..place + 4].try_into().unwrap())
            };
            for k in 0..24 {
                let [x, y, z] = [k % 2, k / 2 % 3, k / 6];
                assert_eq!(value(k), field.volume.values()[(x * 3 + y) * 4 + z]);
            }
        }
        assert!(data[208..].starts_with(b"\n  </AppendedData>"));
    }

    #[test]
    fn wrong_fields_are_named() {
        let (volume, mut bytes) = (ramp(), Vec::new());
        let other = Volume::new([2, 3, 4], [-5.0; 3], [5.0; 3], vec![0.0; 24]).unwrap();
        let field = |name, volume| Shown { name, volume };
        assert!(matches!(write(&mut bytes, &[]), Err(Error::Vti(VtiError::Empty))));
        for name in ["", "a\"b", "a b"] {
            assert!(matches!(
                write(&mut bytes, &[field(name, &volume)]),
                Err(Error::Vti(VtiError::Name(_)))
            ));
        }
        let twice = [field("a", &volume), field("a", &volume)];
        assert!(matches!(write(&mut bytes, &twice), Err(Error::Vti(VtiError::Name(_)))));
        let differ = [field("a", &volume), field("b", &other)];
        assert!(matches!(write(&mut bytes, &differ), Err(Error::Mismatch(_))));
        assert!(bytes.is_empty());
    }
}

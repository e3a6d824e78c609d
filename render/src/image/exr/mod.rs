//! Layers of float channels, in one part as every EXR viewer opens it or in one for each layer.

mod layout;
mod survey;

pub use layout::{BAND_ROWS, CameraMatrices, Layout, Style};
pub use survey::{ChannelSurvey, Survey, survey};

use super::{Channel, Picture};
use exr::meta::MetaData;
use exr::meta::attribute::EnvironmentMap;
use exr::meta::header::LayerAttributes;
use exr::prelude::{AttributeValue, Error, ReadChannels, ReadLayers, Text, Vec2, read};
use kerrlight_common::memory;
use kerrlight_common::toml_file;
use layout::REC_709;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::io::{Cursor, Read};
use std::ops::Range;

/// The name of the one attribute that holds all settings, as a TOML table. (The encoder
/// writes several attributes in random order, and the same picture should be the same bytes.)
const ATTRIBUTE: &str = "kerrlight";

/// Settings by name.
pub type Attributes = BTreeMap<String, String>;

/// OpenEXR keeps text as UTF-8; the crate's own conversion knows Latin-1 only.
fn utf8(text: &str) -> Text {
    Text::from_slice_unchecked(text.as_bytes())
}

/// The bytes of an EXR file with the channels of `picture` and settings, in some style.
///
/// # Errors
/// If the picture is empty, or on a failure of the encoder.
pub fn encode(
    picture: &Picture,
    attributes: &Attributes,
    style: Style,
) -> Result<Vec<u8>, crate::Error> {
    let names: Vec<&str> = picture.channels.iter().map(|c| c.name.as_str()).collect();
    let layout = Layout::new(picture.width, picture.height, &names, style)?;
    let bands = (0..layout.bands()).into_par_iter().map(|band| {
        let Range { start, end } = layout.rows(band);
        let values = start * picture.width..end * picture.width;
        let part = |c: &'_ Channel| c.values.get(values.clone()).unwrap_or_default().to_vec();
        layout.compress(band, &picture.channels.iter().map(part).collect::<Vec<_>>())
    });
    let bands = bands.collect::<exr::error::Result<Vec<_>>>()?;
    let mut bytes = Vec::new();
    layout.write(Cursor::new(&mut bytes), attributes, |write| {
        bands.into_iter().enumerate().try_for_each(|(band, bytes)| write(band, bytes))
    })?;
    Ok(bytes)
}

/// The attribute that holds the settings.
fn settings(attributes: &Attributes) -> exr::error::Result<(Text, AttributeValue)> {
    let text =
        toml::to_string_pretty(attributes).map_err(|e| Error::Invalid(e.to_string().into()))?;
    Ok((Text::from(ATTRIBUTE), AttributeValue::Text(utf8(&text))))
}

/// kerrlight's settings from the beginning of an EXR file; no pixel is read.
///
/// # Errors
/// If the bytes are no EXR file.
pub fn decode_attributes(mut file: impl Read) -> Result<Attributes, crate::Error> {
    // One kind of file, so that the decoder is compiled once.
    let file: &mut dyn Read = &mut file;
    let data = MetaData::read_from_unbuffered(file, true)?;
    let first = data.headers.first();
    Ok(first.map_or(Ok(Attributes::new()), |header| attributes(&header.own_attributes))?)
}

fn attributes(layer: &LayerAttributes) -> exr::error::Result<Attributes> {
    match layer.other.get(&Text::from(ATTRIBUTE)) {
        Some(AttributeValue::Text(text)) => {
            let settings = String::from_utf8_lossy(text.as_slice());
            toml_file::read(&settings).map_err(|e| Error::Invalid(e.to_string().into()))
        }
        _ => Ok(Attributes::new()),
    }
}

/// Columns and rows of the first layer, as the header states them.
///
/// # Errors
/// If the bytes are no EXR file.
pub fn dimensions(bytes: &[u8]) -> Result<(u32, u32), crate::Error> {
    let data = MetaData::read_from_unbuffered(Cursor::new(bytes), true)?;
    let size = data.headers.first().map_or(Vec2(0, 0), |header| header.layer_size);
    let number = |n: usize| u32::try_from(n).map_err(|_| Error::Invalid("size".into()));
    Ok((number(size.0)?, number(size.1)?))
}

/// Header of the first layer: the meaning of its pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct Header {
    /// True if its pixels fill the display window.
    pub whole: bool,
    /// True if it is the six faces of a cube.
    pub cube: bool,
    /// Chromaticities of red, green, blue and white, where they are not those of Rec. 709.
    pub foreign_primaries: Option<[[f32; 2]; 4]>,
}

impl Header {
    /// The header of the first layer.
    ///
    /// # Errors
    /// If the bytes are no EXR file.
    pub fn of(bytes: &[u8]) -> Result<Self, crate::Error> {
        let data = MetaData::read_from_unbuffered(Cursor::new(bytes), true)?;
        let header = data.headers.first().ok_or(Error::Invalid("no layer".into()))?;
        let (shared, own) = (&header.shared_attributes, &header.own_attributes);
        let primaries = shared
            .chromaticities
            .map(|c| [c.red, c.green, c.blue, c.white].map(|Vec2(x, y)| [x, y]));
        let same = |given: &[[f32; 2]; 4]| {
            given.iter().flatten().zip(REC_709.iter().flatten()).all(|(a, b)| (a - b).abs() < 2e-3)
        };
        let window = shared.display_window;
        Ok(Header {
            whole: (window.position, window.size) == (own.layer_position, header.layer_size),
            cube: matches!(own.environment_map, Some(EnvironmentMap::Cube)),
            foreign_primaries: primaries.filter(|given| !same(given)),
        })
    }
}

/// Window of the pixels of an EXR file in the picture, its display window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// Columns and rows of the picture.
    pub display: [usize; 2],
    /// Columns to the left of the pixels.
    pub left: usize,
    /// Rows above them.
    pub top: usize,
}

/// The place of the pixels of the first layer.
///
/// # Errors
/// If the bytes are no EXR file, pixels are not square or lie outside the display window, or layers of the same size lie
/// elsewhere.
pub fn window(bytes: &[u8]) -> Result<Window, crate::Error> {
    check_size(bytes)?;
    let data = MetaData::read_from_unbuffered(Cursor::new(bytes), true)?;
    let refuse = |what: String| crate::Error::from(Error::NotSupported(what.into()));
    let first = data.headers.first().ok_or_else(|| refuse("no layer".to_owned()))?;
    let (shared, size) = (&first.shared_attributes, first.layer_size);
    if shared.pixel_aspect != 1.0 {
        return Err(refuse(format!(
            "pixelAspectRatio = {}: square pixels are read",
            shared.pixel_aspect
        )));
    }
    let (display, at) = (shared.display_window, first.own_attributes.layer_position);
    let elsewhere = |header: &exr::meta::header::Header| {
        header.layer_size == size && header.own_attributes.layer_position != at
    };
    if data.headers.iter().any(elsewhere) {
        return Err(refuse("layers with other data windows".to_owned()));
    }
    let before = |at: i32, start: i32, size: usize, whole: usize| {
        let before = usize::try_from(i64::from(at) - i64::from(start)).ok()?;
        (before.checked_add(size)? <= whole).then_some(before)
    };
    let left = before(at.0, display.position.0, size.0, display.size.0);
    let top = before(at.1, display.position.1, size.1, display.size.1);
    let (Some(left), Some(top)) = (left, top) else {
        return Err(refuse("a data window beyond the display window: crop the picture".to_owned()));
    };
    let needed = memory::channels(display.size.0 as f64, display.size.1 as f64, 4.0);
    memory::afford(
        || format!("a picture of {} x {} pixels", display.size.0, display.size.1),
        needed,
    )?;
    Ok(Window { display: [display.size.0, display.size.1], left, top })
}

/// The channels and kerrlight's settings of an EXR file: of all parts that are as large as the first, and of those with the
/// same name the first.
///
/// # Errors
/// If the bytes are no EXR file, or a channel is subsampled.
pub fn decode(bytes: &[u8]) -> Result<(Picture, Attributes), crate::Error> {
    check_size(bytes)?;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .pedantic()
        .from_buffered(Cursor::new(bytes))?;
    let first = image.layer_data.first().ok_or(Error::Invalid("no layer".into()))?;
    let (size, attributes) = (first.size, attributes(&first.attributes)?);
    let mut picture = Picture { width: size.0, height: size.1, channels: Vec::new() };
    for layer in image.layer_data.iter().filter(|layer| layer.size == size) {
        for channel in &layer.channel_data.list {
            let name = channel.name.to_string();
            let values: Vec<f32> = channel.sample_data.values_as_f32().collect();
            if values.len() != size.area() {
                return Err(Error::NotSupported("subsampled channels".into()).into());
            }
            if picture.channel(&name).is_none() {
                picture.channels.push(Channel { name, values });
            }
        }
    }
    Ok((picture, attributes))
}

/// Refuses a picture that there is no memory for: its header may state any size.
fn check_size(bytes: &[u8]) -> exr::error::Result<()> {
    let data = MetaData::read_from_unbuffered(Cursor::new(bytes), false)?;
    for header in &data.headers {
        let Vec2(width, height) = header.layer_size;
        let count = header.channels.list.len();
        let what = || format!("its picture of {width} x {height} pixels with {count} channels");
        let needed = memory::channels(width as f64, height as f64, count as f64);
        memory::afford(what, needed).map_err(|error| Error::Invalid(error.to_string().into()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_round_trip() {
        let values = |k: usize| (0..6).map(|i| (i * k) as f32 - 2.5).collect();
        let names = ["R", "G", "B", "intensity", "delay"];
        let mut channels: Vec<Channel> = names
            .iter()
            .enumerate()
            .map(|(k, name)| Channel { name: (*name).to_owned(), values: values(k) })
            .collect();
        let picture = Picture { width: 3, height: 2, channels: channels.clone() };
        let scene = "[hole]\nspin = 0.9 # µ – Ω\n";
        let attributes = Attributes::from([("scene".to_owned(), scene.to_owned())]);
        let bytes = encode(&picture, &attributes, Style::default()).unwrap();
        let (back, text) = decode(&bytes).unwrap();
        channels.sort_by(|a, b| a.name.cmp(&b.name));
        assert_eq!(back, Picture { channels, ..picture });
        assert_eq!(text, attributes);
        assert!(decode(&bytes[..bytes.len() / 2]).is_err());
        assert!(decode(b"not an EXR").is_err());
    }
}

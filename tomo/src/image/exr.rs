//! One flat layer of 32-bit float channels, as every EXR viewer opens it.

use super::{Channel, Picture};
use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Blocks, Compression, Encoding, Error, FlatSamples,
    Image, Layer, LayerAttributes, LineOrder, ReadChannels, ReadLayers, Text, Vec2, WritableImage,
    read,
};
use std::collections::BTreeMap;
use std::io::Cursor;

/// The name of the one attribute that holds all settings, as a TOML table. (The encoder
/// writes several attributes in random order, and the same picture should be the same bytes.)
const ATTRIBUTE: &str = "kerrlight";

/// Settings by name.
pub type Attributes = BTreeMap<String, String>;

/// OpenEXR keeps text as UTF-8; the crate's own conversion knows Latin-1 only.
fn utf8(text: &str) -> Text {
    Text::from_slice_unchecked(text.as_bytes())
}

/// The bytes of an EXR file with the channels of `picture` and settings.
///
/// # Errors
/// If the picture is empty, or on a failure of the encoder.
pub fn encode(picture: &Picture, attributes: &Attributes) -> exr::error::Result<Vec<u8>> {
    let list = picture
        .channels
        .iter()
        .map(|c| AnyChannel::new(c.name.as_str(), FlatSamples::F32(c.values.clone())))
        .collect();
    let mut layer = LayerAttributes {
        software_name: Some(Text::from(concat!("kerrlight ", env!("CARGO_PKG_VERSION")))),
        ..LayerAttributes::default()
    };
    let settings =
        toml::to_string_pretty(attributes).map_err(|e| Error::Invalid(e.to_string().into()))?;
    layer.other.insert(Text::from(ATTRIBUTE), AttributeValue::Text(utf8(&settings)));
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let size = (picture.width, picture.height);
    let layer = Layer::new(size, layer, encoding, AnyChannels::sort(list));
    let mut bytes = Vec::new();
    Image::from_layer(layer).write().to_buffered(Cursor::new(&mut bytes))?;
    Ok(bytes)
}

/// The channels and kerrlight's settings of the first layer of an EXR file.
///
/// # Errors
/// If the bytes are no EXR file, or a channel is subsampled.
pub fn decode(bytes: &[u8]) -> exr::error::Result<(Picture, Attributes)> {
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .pedantic()
        .from_buffered(Cursor::new(bytes))?;
    let layer = image.layer_data;
    let Vec2(width, height) = layer.size;
    let mut channels = Vec::new();
    for channel in layer.channel_data.list {
        let values: Vec<f32> = channel.sample_data.values_as_f32().collect();
        if values.len() != width * height {
            return Err(Error::NotSupported("subsampled channels".into()));
        }
        channels.push(Channel { name: channel.name.to_string(), values });
    }
    let attributes = match layer.attributes.other.get(&Text::from(ATTRIBUTE)) {
        Some(AttributeValue::Text(text)) => {
            let settings = String::from_utf8_lossy(text.as_slice());
            toml::from_str(&settings).map_err(|e| Error::Invalid(e.to_string().into()))?
        }
        _ => Attributes::new(),
    };
    Ok((Picture { width, height, channels }, attributes))
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
        let bytes = encode(&picture, &attributes).unwrap();
        let (back, text) = decode(&bytes).unwrap();
        channels.sort_by(|a, b| a.name.cmp(&b.name));
        assert_eq!(back, Picture { channels, ..picture });
        assert_eq!(text, attributes);
        assert!(decode(&bytes[..bytes.len() / 2]).is_err());
        assert!(decode(b"not an EXR").is_err());
    }
}

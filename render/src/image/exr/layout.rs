//! Layout of a picture in its file: bands of rows, each compressed on its own, so that neither writing nor reading needs
//! the whole picture in memory.

use super::{Attributes, settings};
use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock};
use exr::block::writer::ChunksWriter;
use exr::error::{Error, Result};
use exr::math::Vec2;
use exr::meta::BlockDescription;
use exr::meta::attribute::{
    ChannelDescription, Chromaticities, IntegerBounds, LineOrder, SampleType, Text,
};
use exr::meta::header::Header;
use exr::prelude::{Compression, f16};
use flate2::write::ZlibEncoder;
use std::io::{Seek, Write};
use std::ops::Range;

/// Rows of pixels that are compressed together.
pub const BAND_ROWS: usize = 16;

/// A file of any kind, so that the encoder is compiled once.
trait AnyFile: Write + Seek {}

impl<F: Write + Seek> AnyFile for F {}

/// Writes the compressed bytes of each part of a band.
type WriteBand<'a> = dyn FnMut(usize, Vec<Vec<u8>>) -> Result<()> + 'a;

/// Level of DEFLATE, of 9: what OpenEXR uses too.
const LEVEL: u32 = 4;

/// ZIP of OpenEXR: bytes of even and odd places apart, differences (plus 128) of neighbours,
/// zlib; the bytes as they are where that does not make them fewer. The exr crate does the same
/// with a slower DEFLATE.
fn zip(bytes: Vec<u8>) -> std::io::Result<Vec<u8>> {
    let apart = bytes.iter().step_by(2).chain(bytes.iter().skip(1).step_by(2));
    let mut before = 128u8;
    let differences: Vec<u8> = apart
        .map(|byte| {
            let difference = byte.wrapping_sub(before).wrapping_add(128);
            before = *byte;
            difference
        })
        .collect();
    let buffer = Vec::with_capacity(bytes.len() / 2);
    let mut encoder = ZlibEncoder::new(buffer, flate2::Compression::new(LEVEL));
    encoder.write_all(&differences)?;
    let packed = encoder.finish()?;
    Ok(if packed.len() < bytes.len() { packed } else { bytes })
}

/// Style in which a picture is written: by default as one part of 32-bit floats.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Style {
    /// Colours and alpha as 16-bit floats, saturated at 65504; all other channels keep 32 bits.
    pub half: bool,
    /// A part for each layer.
    pub multi_part: bool,
    /// Camera of the picture.
    pub camera: Option<CameraMatrices>,
    /// Frames per second of the film that it is of.
    pub frames_per_second: Option<u16>,
}

impl Style {
    /// Returns whether channels lie in the file as in the default style.
    pub fn is_plain(&self) -> bool {
        !self.half && !self.multi_part
    }
}

/// Matrices of a camera in flat space, row by row, for row vectors as in OpenEXR's own library: a point p of the world (M)
/// goes to p M.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraMatrices {
    /// Matrix to the camera's coordinates (M): x to the right, y up, looking along −z.
    pub world_to_camera: [f32; 16],
    /// Matrix to normalised device coordinates: x and y from −1 to 1 from left to right and from below upwards.
    pub world_to_ndc: [f32; 16],
}

/// Size, channels and style of a file: one flat layer or several parts, ZIP, rows from the top.
#[derive(Debug, Clone)]
pub struct Layout {
    parts: Vec<Part>,
    style: Style,
    /// Number of channels.
    channels: usize,
}

/// A part of a file.
#[derive(Debug, Clone)]
struct Part {
    header: Header,
    /// Index of the k-th channel of the part in the caller's order.
    order: Vec<usize>,
}

/// The part that a channel belongs to: that of the colours, of its layer, or of all other channels.
fn part_of(name: &str) -> &str {
    match name.split_once('.') {
        Some((layer, _)) => layer,
        None if is_color(name) => COLORS,
        None => "data",
    }
}

/// The part with R, G, B and A.
const COLORS: &str = "rgba";

/// Returns whether a channel is a colour or alpha.
fn is_color(name: &str) -> bool {
    let last = name.rsplit('.').next().unwrap_or(name);
    ["R", "G", "B", "A"].contains(&last)
}

/// Chromaticities (CIE x, y) of red, green, blue and white of Rec. 709, which an EXR has unless it says otherwise.
pub(super) const REC_709: [[f32; 2]; 4] = [[0.64, 0.33], [0.3, 0.6], [0.15, 0.06], [0.3127, 0.329]];

impl Part {
    fn new(size: (usize, usize), names: &[&str], order: Vec<usize>, style: &Style) -> Self {
        let channel = |k: &usize| {
            let half = style.half && is_color(names[*k]);
            let kind = if half { SampleType::F16 } else { SampleType::F32 };
            ChannelDescription::new(names[*k], kind, true)
        };
        let channels = order.iter().map(channel).collect();
        let mut header = Header::new(Text::default(), size, channels).with_encoding(
            Compression::ZIP16,
            BlockDescription::ScanLines,
            LineOrder::Increasing,
        );
        let [red, green, blue, white] = REC_709.map(|[x, y]| Vec2(x, y));
        header.shared_attributes.chromaticities = Some(Chromaticities { red, green, blue, white });
        Part { header, order }
    }

    /// The compressed bytes of rows.
    fn compress(&self, rows: usize, width: usize, channels: &[Vec<f32>]) -> Result<Vec<u8>> {
        let mut bytes = Vec::with_capacity(rows * width * self.order.len() * 4);
        for row in 0..rows {
            for (k, channel) in self.order.iter().zip(&self.header.channels.list) {
                let line = &channels[*k][row * width..(row + 1) * width];
                match channel.sample_type {
                    SampleType::F16 => {
                        bytes.extend(line.iter().flat_map(|x| half(*x).to_le_bytes()))
                    }
                    _ => bytes.extend(line.iter().flat_map(|value| value.to_le_bytes())),
                }
            }
        }
        Ok(zip(bytes)?)
    }
}

/// A 16-bit float; the largest one for what is larger.
fn half(value: f32) -> f16 {
    f16::from_f32(value.clamp(f16::MIN.to_f32(), f16::MAX.to_f32()))
}

impl Layout {
    /// The layout of a picture with the channels `names`, in the caller's order; the file has
    /// them sorted by name.
    ///
    /// # Errors
    /// If a side is 0 or beyond 32 bits, there is no channel or one twice.
    pub fn new(width: usize, height: usize, names: &[&str], style: Style) -> Result<Self> {
        let mut order: Vec<usize> = (0..names.len()).collect();
        order.sort_by_key(|k| names[*k]);
        let twice = order.windows(2).any(|pair| names[pair[0]] == names[pair[1]]);
        let sides = [width, height].iter().all(|n| (1..=i32::MAX as usize).contains(n));
        if names.is_empty() || twice || !sides {
            return Err(Error::Invalid(
                "a picture needs pixels and channels of different names".into(),
            ));
        }
        let size = (width, height);
        let parts = match style.multi_part {
            true => Self::parts(size, names, &order, &style),
            false => vec![Part::new(size, names, order, &style)],
        };
        Ok(Layout { parts, style, channels: names.len() })
    }

    /// A part for each layer, in the caller's order of channels, colours first.
    fn parts(size: (usize, usize), names: &[&str], order: &[usize], style: &Style) -> Vec<Part> {
        let mut layers: Vec<&str> = Vec::new();
        for layer in names.iter().map(|name| part_of(name)) {
            if !layers.contains(&layer) {
                layers.push(layer);
            }
        }
        layers.sort_by_key(|layer| *layer != COLORS);
        let part = |layer: &&str| {
            let own = order.iter().copied().filter(|k| part_of(names[*k]) == *layer).collect();
            let mut part = Part::new(size, names, own, style);
            part.header.own_attributes.layer_name = Some(Text::from(*layer));
            part
        };
        layers.iter().map(part).collect()
    }

    /// Returns whether channels lie in the file as in the default style.
    pub fn is_plain(&self) -> bool {
        self.style.is_plain()
    }

    fn size(&self) -> Vec2<usize> {
        self.parts.first().map_or(Vec2(0, 0), |part| part.header.layer_size)
    }

    /// Number of bands.
    pub fn bands(&self) -> usize {
        self.size().height().div_ceil(BAND_ROWS)
    }

    /// The rows of a band, from the top.
    pub fn rows(&self, band: usize) -> Range<usize> {
        let height = self.size().height();
        (band * BAND_ROWS).min(height)..((band + 1) * BAND_ROWS).min(height)
    }

    fn window(&self, band: usize) -> IntegerBounds {
        let (rows, width) = (self.rows(band), self.size().width());
        IntegerBounds { position: Vec2(0, rows.start as i32), size: Vec2(width, rows.len()) }
    }

    /// The compressed bytes of a band, of each part; `channels[k]` are its values, row by row, in the
    /// caller's order of channels.
    ///
    /// # Errors
    /// If the numbers of channels or values are not the layout's.
    pub fn compress(&self, band: usize, channels: &[Vec<f32>]) -> Result<Vec<Vec<u8>>> {
        let (rows, width) = (self.rows(band).len(), self.size().width());
        let fits = |values: &Vec<f32>| values.len() == rows * width;
        if channels.len() != self.channels || !channels.iter().all(fits) || rows == 0 {
            return Err(Error::Invalid("a band of another size than its picture's".into()));
        }
        self.parts.iter().map(|part| part.compress(rows, width, channels)).collect()
    }

    /// The values of a band from the compressed bytes of a layout in the default style, in the caller's order of channels.
    ///
    /// # Errors
    /// If the bytes are damaged, or in another style.
    pub fn expand(&self, band: usize, bytes: Vec<u8>) -> Result<Vec<Vec<f32>>> {
        let (Some(Part { header, order }), true) = (self.parts.first(), self.style.is_plain())
        else {
            return Err(Error::NotSupported("a band of several parts or of 16-bit floats".into()));
        };
        let (rows, width) = (self.rows(band), self.size().width());
        let bytes = header.compression.decompress_image_section_from_le(
            header,
            bytes,
            self.window(band),
            true,
        )?;
        let mut channels = vec![Vec::with_capacity(rows.len() * width); order.len()];
        let (values, _) = bytes.as_chunks::<4>();
        // A row of pixels lies there channel after channel.
        for (k, line) in values.chunks_exact(width).enumerate() {
            let channel = &mut channels[order[k % order.len()]];
            channel.extend(line.iter().map(|bytes| f32::from_ne_bytes(*bytes)));
        }
        Ok(channels)
    }

    /// Writes the file: `bands` gives the compressed bytes of each part of every band to its argument, in order.
    ///
    /// # Errors
    /// On a failure to write, of `bands`, or if a band is missing.
    pub fn write(
        &self,
        mut out: impl Write + Seek,
        attributes: &Attributes,
        bands: impl FnOnce(&mut dyn FnMut(usize, Vec<Vec<u8>>) -> Result<()>) -> Result<()>,
    ) -> Result<()> {
        // `write_file` takes a `dyn FnMut`, which cannot consume `bands`, and calls it once.
        let mut bands = Some(bands);
        let mut once = |write: &mut WriteBand<'_>| bands.take().map_or(Ok(()), |give| give(write));
        self.write_file(&mut out, attributes, &mut once)
    }

    fn write_file(
        &self,
        out: &mut dyn AnyFile,
        attributes: &Attributes,
        bands: &mut dyn FnMut(&mut WriteBand<'_>) -> Result<()>,
    ) -> Result<()> {
        let header = |(k, part)| self.header(part, (k == 0).then_some(attributes));
        let headers = self.parts.iter().enumerate().map(header).collect::<Result<_>>()?;
        exr::block::write(out, headers, true, |_, writer| {
            bands(&mut |band, parts| {
                let y_coordinate = (band * BAND_ROWS) as i32;
                for (layer_index, compressed_pixels_le) in parts.into_iter().enumerate() {
                    let block = CompressedScanLineBlock { y_coordinate, compressed_pixels_le };
                    let compressed_block = CompressedBlock::ScanLine(block);
                    writer.write_chunk(band, Chunk { layer_index, compressed_block })?;
                }
                Ok(())
            })
        })
    }

    /// The header of a part; the first one has the settings.
    fn header(&self, part: &Part, attributes: Option<&Attributes>) -> Result<Header> {
        let mut header = part.header.clone();
        let own = &mut header.own_attributes;
        own.software_name = Some(Text::from(concat!("kerrlight ", env!("CARGO_PKG_VERSION"))));
        own.world_to_camera = self.style.camera.map(|camera| camera.world_to_camera);
        own.world_to_normalized_device = self.style.camera.map(|camera| camera.world_to_ndc);
        own.frames_per_second = self.style.frames_per_second.map(|n| (i32::from(n), 1));
        if let Some(attributes) = attributes {
            let (name, value) = settings(attributes)?;
            own.other.insert(name, value);
        }
        Ok(header)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The exr crate reads what is written here, compressible or not.
    #[test]
    fn code_bands_are_read_by_the_exr_crate() {
        let layout = Layout::new(37, 20, &["b", "a"], Style::default()).unwrap();
        let mut state = 1u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f32::from_bits(state >> 2)
        };
        for band in 0..layout.bands() {
            let count = layout.rows(band).len() * 37;
            let smooth: Vec<f32> = (0..count).map(|k| (k / 7) as f32).collect();
            let rough: Vec<f32> = (0..count).map(|_| noise()).collect();
            for channels in [[smooth.clone(), rough.clone()], [rough.clone(), rough.clone()]] {
                let bytes = layout.compress(band, &channels).unwrap().remove(0);
                assert!(bytes.len() <= count * 8);
                assert_eq!(layout.expand(band, bytes).unwrap(), channels);
            }
        }
    }
}

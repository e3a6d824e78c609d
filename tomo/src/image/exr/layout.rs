//! How a picture lies in its file: bands of rows, each compressed on its own, so that neither
//! writing nor reading needs the whole picture in memory.

use super::{Attributes, settings};
use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock};
use exr::block::writer::ChunksWriter;
use exr::error::{Error, Result};
use exr::math::Vec2;
use exr::meta::BlockDescription;
use exr::meta::attribute::{ChannelDescription, IntegerBounds, LineOrder, SampleType, Text};
use exr::meta::header::{Header, LayerAttributes};
use exr::prelude::Compression;
use flate2::write::ZlibEncoder;
use std::io::{Seek, Write};
use std::ops::Range;

/// Rows of pixels that are compressed together.
pub const BAND_ROWS: usize = 16;

/// A file of any kind, so that the encoder is compiled once.
trait AnyFile: Write + Seek {}

impl<F: Write + Seek> AnyFile for F {}

/// Writes the compressed bytes of a band.
type WriteBand<'a> = dyn FnMut(usize, Vec<u8>) -> Result<()> + 'a;

/// How hard DEFLATE tries, of 9: what OpenEXR does too.
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

/// Size and channels of a file: one flat layer of 32-bit floats, ZIP, rows from the top.
#[derive(Debug, Clone)]
pub struct Layout {
    header: Header,
    /// Where the k-th channel of the file is in the caller's order.
    order: Vec<usize>,
}

impl Layout {
    /// The layout of a picture with the channels `names`, in the caller's order; the file has
    /// them sorted by name.
    ///
    /// # Errors
    /// If a side is 0 or beyond 32 bits, there is no channel or one twice.
    pub fn new(width: usize, height: usize, names: &[&str]) -> Result<Self> {
        let mut order: Vec<usize> = (0..names.len()).collect();
        order.sort_by_key(|k| names[*k]);
        let twice = order.windows(2).any(|pair| names[pair[0]] == names[pair[1]]);
        let sides = [width, height].iter().all(|n| (1..=i32::MAX as usize).contains(n));
        if names.is_empty() || twice || !sides {
            return Err(Error::Invalid(
                "a picture needs pixels and channels of different names".into(),
            ));
        }
        let channel = |k: &usize| ChannelDescription::new(names[*k], SampleType::F32, true);
        let channels = order.iter().map(channel).collect();
        let header = Header::new(Text::default(), (width, height), channels).with_encoding(
            Compression::ZIP16,
            BlockDescription::ScanLines,
            LineOrder::Increasing,
        );
        Ok(Layout { header, order })
    }

    /// Number of bands.
    pub fn bands(&self) -> usize {
        self.header.layer_size.height().div_ceil(BAND_ROWS)
    }

    /// The rows of a band, from the top.
    pub fn rows(&self, band: usize) -> Range<usize> {
        let height = self.header.layer_size.height();
        (band * BAND_ROWS).min(height)..((band + 1) * BAND_ROWS).min(height)
    }

    fn window(&self, band: usize) -> IntegerBounds {
        let (rows, width) = (self.rows(band), self.header.layer_size.width());
        IntegerBounds { position: Vec2(0, rows.start as i32), size: Vec2(width, rows.len()) }
    }

    /// The compressed bytes of a band; `channels[k]` are its values, row by row, in the
    /// caller's order of channels.
    ///
    /// # Errors
    /// If the numbers of channels or values are not the layout's.
    pub fn compress<V: AsRef<[f32]>>(&self, band: usize, channels: &[V]) -> Result<Vec<u8>> {
        let (rows, width) = (self.rows(band), self.header.layer_size.width());
        let fits = |values: &V| values.as_ref().len() == rows.len() * width;
        if channels.len() != self.order.len() || !channels.iter().all(fits) || rows.is_empty() {
            return Err(Error::Invalid("a band of another size than its picture's".into()));
        }
        let mut bytes = Vec::with_capacity(rows.len() * width * channels.len() * 4);
        for row in 0..rows.len() {
            for k in &self.order {
                let line = &channels[*k].as_ref()[row * width..(row + 1) * width];
                bytes.extend(line.iter().flat_map(|value| value.to_le_bytes()));
            }
        }
        Ok(zip(bytes)?)
    }

    /// The values of a band from its compressed bytes, in the caller's order of channels.
    ///
    /// # Errors
    /// If the bytes are damaged.
    pub fn expand(&self, band: usize, bytes: Vec<u8>) -> Result<Vec<Vec<f32>>> {
        let (rows, width) = (self.rows(band), self.header.layer_size.width());
        let compression = self.header.compression;
        let bytes = compression.decompress_image_section_from_le(
            &self.header,
            bytes,
            self.window(band),
            true,
        )?;
        let mut channels = vec![Vec::with_capacity(rows.len() * width); self.order.len()];
        let (values, _) = bytes.as_chunks::<4>();
        for (k, line) in values.chunks_exact(width).enumerate() {
            let channel = &mut channels[self.order[k % self.order.len()]];
            channel.extend(line.iter().map(|bytes| f32::from_ne_bytes(*bytes)));
        }
        Ok(channels)
    }

    /// Writes the file: `bands` gives every band's compressed bytes to its argument, in order.
    ///
    /// # Errors
    /// On a failure to write, of `bands`, or if a band is missing.
    pub fn write(
        &self,
        mut out: impl Write + Seek,
        attributes: &Attributes,
        bands: impl FnOnce(&mut dyn FnMut(usize, Vec<u8>) -> Result<()>) -> Result<()>,
    ) -> Result<()> {
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
        let mut own = LayerAttributes {
            software_name: Some(Text::from(concat!("kerrlight ", env!("CARGO_PKG_VERSION")))),
            ..LayerAttributes::default()
        };
        let (name, value) = settings(attributes)?;
        own.other.insert(name, value);
        let header = self.header.clone().with_attributes(own);
        exr::block::write(out, [header].into_iter().collect(), true, |_, writer| {
            bands(&mut |band, compressed_pixels_le| {
                let y_coordinate = (band * BAND_ROWS) as i32;
                let block = CompressedScanLineBlock { y_coordinate, compressed_pixels_le };
                let compressed_block = CompressedBlock::ScanLine(block);
                writer.write_chunk(band, Chunk { layer_index: 0, compressed_block })
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The exr crate reads what is written here, compressible or not.
    #[test]
    fn code_bands_are_read_by_the_exr_crate() {
        let layout = Layout::new(37, 20, &["b", "a"]).unwrap();
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
                let bytes = layout.compress(band, &channels).unwrap();
                assert!(bytes.len() <= count * 8);
                assert_eq!(layout.expand(band, bytes).unwrap(), channels);
            }
        }
    }
}

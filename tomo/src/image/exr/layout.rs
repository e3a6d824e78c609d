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
use std::io::{Seek, Write};
use std::ops::Range;

/// Rows of pixels that are compressed together.
pub const BAND_ROWS: usize = 16;

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
                bytes.extend(line.iter().flat_map(|value| value.to_ne_bytes()));
            }
        }
        let compression = self.header.compression;
        compression.compress_image_section_to_le(&self.header, bytes, self.window(band))
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
        out: impl Write + Seek,
        attributes: &Attributes,
        bands: impl FnOnce(&mut dyn FnMut(usize, Vec<u8>) -> Result<()>) -> Result<()>,
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

//! Statistics of the channels of an EXR file, read band by band.

use super::{Attributes, attributes};
use exr::block::reader::ChunksReader;
use exr::error::Error;
use exr::math::Vec2;
use exr::meta::attribute::SampleType;
use exr::prelude::f16;
use std::io::{Read, Seek};

/// The values of a channel, at a glance.
#[derive(Debug, Clone, PartialEq)]
pub struct ChannelSurvey {
    /// Name as in the file.
    pub name: String,
    /// Least finite value; infinite if there is none.
    pub least: f32,
    /// Largest finite value; negatively infinite if there is none.
    pub most: f32,
    /// Mean of the finite values; 0 if there is none.
    pub mean: f64,
    /// Number of values that are infinite or NaN.
    pub not_finite: u64,
}

/// A file at a glance.
#[derive(Debug, Clone, PartialEq)]
pub struct Survey {
    /// Pixels from left to right.
    pub width: usize,
    /// Pixels from top to bottom.
    pub height: usize,
    /// The channels of the first layer.
    pub channels: Vec<ChannelSurvey>,
    /// kerrlight's settings.
    pub attributes: Attributes,
}

/// Surveys the first layer of an EXR file, at full resolution; memory does not grow with
/// the picture.
///
/// # Errors
/// If the bytes are no EXR file of flat data, or a channel is subsampled.
pub fn survey(file: impl Read + Seek) -> Result<Survey, crate::Error> {
    let reader = exr::block::read(file, true)?;
    let unusual = |what: &'static str| crate::Error::from(Error::NotSupported(what.into()));
    let header = reader.headers().first().ok_or_else(|| unusual("no layer"))?.clone();
    if header.deep {
        return Err(unusual("deep data"));
    }
    if header.channels.list.iter().any(|channel| channel.sampling != Vec2(1, 1)) {
        return Err(unusual("subsampled channels"));
    }
    let kinds: Vec<SampleType> = header.channels.list.iter().map(|c| c.sample_type).collect();
    let mut sums = vec![Sums::default(); kinds.len()];
    let chunks = reader.filter_chunks(true, |_, tile, block| {
        block.layer == 0 && tile.is_largest_resolution_level()
    })?;
    chunks.decompress_sequential(true, |_, block| {
        for line in block.lines(&header.channels) {
            let k = line.location.channel;
            sums[k].add(kinds[k], line.value);
        }
        Ok(())
    })?;
    let named = header.channels.list.iter().zip(sums);
    let Vec2(width, height) = header.layer_size;
    Ok(Survey {
        width,
        height,
        channels: named.map(|(channel, sums)| sums.named(channel.name.to_string())).collect(),
        attributes: attributes(&header.own_attributes)?,
    })
}

#[derive(Debug, Clone)]
struct Sums {
    least: f32,
    most: f32,
    sum: f64,
    finite: u64,
    not_finite: u64,
}

impl Default for Sums {
    fn default() -> Self {
        let (least, most) = (f32::INFINITY, f32::NEG_INFINITY);
        Sums { least, most, sum: 0.0, finite: 0, not_finite: 0 }
    }
}

impl Sums {
    /// A line of samples in the machine's order of bytes.
    fn add(&mut self, kind: SampleType, line: &[u8]) {
        match kind {
            SampleType::F16 => {
                line.as_chunks().0.iter().for_each(|b| self.one(f16::from_ne_bytes(*b).to_f32()));
            }
            SampleType::F32 => {
                line.as_chunks().0.iter().for_each(|b| self.one(f32::from_ne_bytes(*b)));
            }
            SampleType::U32 => {
                line.as_chunks().0.iter().for_each(|b| self.one(u32::from_ne_bytes(*b) as f32));
            }
        }
    }

    fn one(&mut self, value: f32) {
        if !value.is_finite() {
            self.not_finite += 1;
            return;
        }
        self.least = self.least.min(value);
        self.most = self.most.max(value);
        self.sum += f64::from(value);
        self.finite += 1;
    }

    fn named(self, name: String) -> ChannelSurvey {
        let Sums { least, most, sum, finite, not_finite } = self;
        ChannelSurvey { name, least, most, mean: sum / finite.max(1) as f64, not_finite }
    }
}

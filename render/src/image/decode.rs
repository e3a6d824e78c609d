//! PNG, JPEG and Radiance HDR pictures as linear colours.

use image::codecs::hdr::HdrDecoder;
use image::{DynamicImage, ImageError, ImageReader};
use std::io::Cursor;

/// A picture in linear colours, row by row from the top.
pub(crate) struct Colors {
    pub width: usize,
    pub height: usize,
    pub pixels: Vec<[f32; 3]>,
}

/// Columns and rows of a picture, as its header states them.
pub(crate) fn dimensions(bytes: &[u8]) -> Result<(u32, u32), ImageError> {
    ImageReader::new(Cursor::new(bytes)).with_guessed_format()?.into_dimensions()
}

/// Decodes a picture: 8- and 16-bit colours are sRGB (IEC 61966-2-1), floats are linear, those of Radiance HDR divided by
/// the exposure and colour correction of their header.
pub(crate) fn linear_colors(bytes: &[u8]) -> Result<Colors, ImageError> {
    let picture = image::load_from_memory(bytes)?;
    let scale = if bytes.starts_with(b"#?") { exposure(bytes)? } else { [1.0; 3] };
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let pixels = match picture {
        DynamicImage::ImageRgb8(picture) => of_bytes::<3>(&picture),
        DynamicImage::ImageRgba8(picture) => of_bytes::<4>(&picture),
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
            let scaled = |c: [f32; 3]| core::array::from_fn(|k| c[k] / scale[k]);
            picture.into_rgb32f().pixels().map(|pixel| scaled(pixel.0)).collect()
        }
        _ => picture.into_rgb32f().pixels().map(|pixel| pixel.0.map(srgb_to_linear)).collect(),
    };
    Ok(Colors { width, height, pixels })
}

/// What the header of a Radiance HDR has multiplied red, green and blue by.
fn exposure(bytes: &[u8]) -> Result<[f32; 3], ImageError> {
    let header = HdrDecoder::new(Cursor::new(bytes))?.metadata();
    let (r, g, b) = header.color_correction.unwrap_or((1.0, 1.0, 1.0));
    Ok([r, g, b].map(|c| c * header.exposure.unwrap_or(1.0)))
}

/// What a PNG says of its colours that are not those of sRGB: a gamma, or the name of a profile.
pub(crate) fn other_than_srgb(bytes: &[u8]) -> Option<String> {
    let mut rest = bytes.strip_prefix(b"\x89PNG\r\n\x1a\n")?;
    let mut found = None;
    while let Some((length, after)) = rest.split_first_chunk() {
        let length = usize::try_from(u32::from_be_bytes(*length)).ok()?;
        let (kind, after) = after.split_first_chunk::<4>()?;
        let content = after.get(..length)?;
        match kind {
            // Goes before the others (PNG specification, section 4.3).
            b"sRGB" => return None,
            b"IDAT" => break,
            b"gAMA" => {
                let gamma = u32::from_be_bytes(*content.first_chunk()?);
                if !(45_000..46_000).contains(&gamma) {
                    found.get_or_insert_with(|| format!("gAMA = {}", f64::from(gamma) / 1e5));
                }
            }
            b"iCCP" => {
                let name = content.split(|byte| *byte == 0).next().unwrap_or_default();
                let name: String = name.iter().map(|byte| char::from(*byte)).collect();
                if !name.contains("sRGB") {
                    found = Some(format!("iCCP = {name:?}"));
                }
            }
            _ => {}
        }
        rest = after.get(length + 4..)?;
    }
    found
}

/// Pixels of so many bytes each, the first three of which are sRGB.
fn of_bytes<const N: usize>(bytes: &[u8]) -> Vec<[f32; 3]> {
    let linear: [f32; 256] = core::array::from_fn(|byte| srgb_to_linear(byte as f32 / 255.0));
    let (pixels, _) = bytes.as_chunks::<N>();
    let color = |pixel: &[u8; N]| [0, 1, 2].map(|k: usize| linear[usize::from(pixel[k])]);
    pixels.iter().map(color).collect()
}

fn srgb_to_linear(c: f32) -> f32 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ImageFormat, RgbImage};

    /// The table of bytes is the same as the conversion of each colour to a float, with and without opacity.
    #[test]
    fn exact_bytes_are_colors() {
        let picture = RgbImage::from_fn(16, 16, |x, y| {
            image::Rgb([(16 * y + x) as u8, (255 - x) as u8, (5 * y) as u8])
        });
        let opaque = DynamicImage::ImageRgb8(picture.clone());
        let expected: Vec<[f32; 3]> =
            opaque.to_rgb32f().pixels().map(|pixel| pixel.0.map(srgb_to_linear)).collect();
        for picture in [DynamicImage::ImageRgba8(opaque.to_rgba8()), opaque] {
            let mut file = Cursor::new(Vec::new());
            picture.write_to(&mut file, ImageFormat::Png).unwrap();
            let found = linear_colors(file.get_ref()).unwrap();
            assert_eq!((found.width, found.height), (16, 16));
            assert_eq!(found.pixels, expected);
        }
        // A Radiance HDR of one pixel of 0.5 that was made twice as bright, and red thrice more.
        let hdr = |lines: &str| {
            let head = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n{lines}\n-Y 1 +X 1\n");
            let bytes = [head.as_bytes(), &[128, 128, 128, 128]].concat();
            linear_colors(&bytes).unwrap().pixels[0]
        };
        assert_eq!(hdr(""), [0.5; 3]);
        assert_eq!(hdr("EXPOSURE=2\nCOLORCORR=4 1 1\n"), [0.0625, 0.25, 0.25]);
        let png = |chunk: &[u8]| [b"\x89PNG\r\n\x1a\n", chunk, &[0; 4]].concat();
        let gamma = png(b"\0\0\0\x04gAMA\0\x01\x86\xa0");
        assert_eq!(other_than_srgb(&gamma).as_deref(), Some("gAMA = 1"));
        assert_eq!(other_than_srgb(&png(b"\0\0\0\x04gAMA\0\0\xb1\x8f")), None);
        let profile = png(b"\0\0\0\x08iCCPAdobe\0\0\0");
        assert_eq!(other_than_srgb(&profile).as_deref(), Some("iCCP = \"Adobe\""));
        // 188 of 255 is half of the light (IEC 61966-2-1).
        assert!((srgb_to_linear(188.0 / 255.0) - 0.503).abs() < 1e-3);
    }
}

//! PNG, JPEG and Radiance HDR pictures as linear colours.

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

/// Decodes a picture: 8- and 16-bit colours are sRGB (IEC 61966-2-1), floats are linear.
pub(crate) fn linear_colors(bytes: &[u8]) -> Result<Colors, ImageError> {
    let picture = image::load_from_memory(bytes)?;
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let pixels = match picture {
        DynamicImage::ImageRgb8(picture) => of_bytes::<3>(&picture),
        DynamicImage::ImageRgba8(picture) => of_bytes::<4>(&picture),
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
            picture.into_rgb32f().pixels().map(|pixel| pixel.0).collect()
        }
        _ => picture.into_rgb32f().pixels().map(|pixel| pixel.0.map(srgb_to_linear)).collect(),
    };
    Ok(Colors { width, height, pixels })
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
        // 188 of 255 is half of the light (IEC 61966-2-1).
        assert!((srgb_to_linear(188.0 / 255.0) - 0.503).abs() < 1e-3);
    }
}

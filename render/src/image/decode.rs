//! PNG, JPEG and Radiance HDR pictures as linear colours.

use image::codecs::hdr::HdrDecoder;
use image::{DynamicImage, ImageDecoder, ImageError, ImageReader};
use std::io::Cursor;

/// A picture in linear colours, row by row from the top.
pub(crate) struct Colors {
    pub width: usize,
    pub height: usize,
    pub pixels: Vec<[f32; 3]>,
}

/// Bilinear look-up in a picture with rows of `width` pixels, between two columns and between two rows, each with the
/// weight of the second.
#[inline]
pub(crate) fn bilinear(
    pixels: &[[f32; 3]],
    width: usize,
    (x0, x1, tx): (usize, usize, f32),
    (y0, y1, ty): (usize, usize, f32),
) -> [f32; 3] {
    let at = |x: usize, y: usize| pixels[y * width + x];
    let (a, b, c, d) = (at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1));
    core::array::from_fn(|k| {
        (1.0 - ty) * ((1.0 - tx) * a[k] + tx * b[k]) + ty * ((1.0 - tx) * c[k] + tx * d[k])
    })
}

/// Columns and rows of a picture, as its header states them.
pub(crate) fn dimensions(bytes: &[u8]) -> Result<(u32, u32), ImageError> {
    reader(bytes)?.into_dimensions()
}

/// A reader of the picture that the bytes begin as.
pub(super) fn reader(bytes: &[u8]) -> Result<ImageReader<Cursor<&[u8]>>, ImageError> {
    Ok(ImageReader::new(Cursor::new(bytes)).with_guessed_format()?)
}

/// Decodes a picture: 8- and 16-bit colours are sRGB (IEC 61966-2-1), floats are linear, those of Radiance HDR divided by
/// the exposure and colour correction of their header. It is turned as its EXIF says.
pub(crate) fn linear_colors(bytes: &[u8]) -> Result<Colors, ImageError> {
    let mut decoder = reader(bytes)?.into_decoder()?;
    let orientation = decoder.orientation()?;
    let mut picture = DynamicImage::from_decoder(decoder)?;
    picture.apply_orientation(orientation);
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

/// Returns the factors by which the header of a Radiance HDR has multiplied red, green and blue.
fn exposure(bytes: &[u8]) -> Result<[f32; 3], ImageError> {
    let header = HdrDecoder::new(Cursor::new(bytes))?.metadata();
    let (r, g, b) = header.color_correction.unwrap_or((1.0, 1.0, 1.0));
    Ok([r, g, b].map(|c| c * header.exposure.unwrap_or(1.0)))
}

/// Pixels of so many bytes each, the first three of which are sRGB.
fn of_bytes<const N: usize>(bytes: &[u8]) -> Vec<[f32; 3]> {
    // A byte has 256 values: a table saves a power a pixel.
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
    use image::{ImageEncoder, ImageFormat, RgbImage};

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
        // 188 of 255 is half of the light (IEC 61966-2-1).
        assert!((srgb_to_linear(188.0 / 255.0) - 0.503).abs() < 1e-3);
    }
    /// A red and a blue pixel side by side that stand on end: tag 274 (orientation) of EXIF 2.3 is 6.
    #[test]
    fn exact_orientation_of_exif() {
        let mut file = Vec::new();
        let mut encoder = image::codecs::png::PngEncoder::new(&mut file);
        let entry = b"\x01\x12\0\x03\0\0\0\x01\0\x06\0\0";
        let exif = [b"MM\0*\0\0\0\x08\0\x01", &entry[..], &[0; 4]].concat();
        encoder.set_exif_metadata(exif).unwrap();
        let pixels = [255, 0, 0, 0, 0, 255];
        encoder.write_image(&pixels, 2, 1, image::ExtendedColorType::Rgb8).unwrap();
        let turned = linear_colors(&file).unwrap();
        assert_eq!((turned.width, turned.height), (1, 2));
        assert_eq!(turned.pixels, [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
    }
}

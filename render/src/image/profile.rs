//! Colour profiles of pictures that are not sRGB (IEC 61966-2-1), the default.

use super::decode::reader;
use image::codecs::hdr::HdrDecoder;
use image::{ImageDecoder, ImageError};
use std::io::Cursor;

/// Chromaticities of red, green, blue and white: those of sRGB (Rec. 709), and those of Radiance's own pictures.
const PRIMARIES: [[f64; 8]; 2] = [
    [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329],
    [0.64, 0.33, 0.29, 0.6, 0.15, 0.06, 0.3333, 0.3333],
];

/// Largest difference of colours that look the same.
const ALIKE: f64 = 0.002;

/// Colours other than those of sRGB, as the header of a picture states them.
pub(crate) fn other_than_srgb(bytes: &[u8]) -> Result<Option<String>, ImageError> {
    if bytes.starts_with(b"#?") {
        return Ok(of_hdr(&HdrDecoder::new(Cursor::new(bytes))?.metadata().custom_attributes));
    }
    let chunks = of_png(bytes);
    let profile = || -> Result<_, ImageError> {
        let profile = reader(bytes)?.into_decoder()?.icc_profile()?;
        let name = profile.map(|profile| description(&profile).unwrap_or_default());
        Ok(name.filter(|name| !name.contains("sRGB")).map(|name| format!("the profile {name:?}")))
    };
    match chunks {
        Chunks::Decided(other) => Ok(other),
        Chunks::Weaker(other) => Ok(profile()?.or(other)),
    }
}

fn of_hdr(lines: &[(String, String)]) -> Option<String> {
    let is_other = |(key, value): &&(String, String)| {
        let numbers: Option<Vec<f64>> = value.split_whitespace().map(|n| n.parse().ok()).collect();
        match key.as_str() {
            "PRIMARIES" => !numbers.is_some_and(|numbers| is_known(&numbers)),
            "GAMMA" => numbers.as_deref() != Some(&[1.0]),
            _ => false,
        }
    };
    let (key, value) = lines.iter().find(is_other)?;
    Some(format!("{key} = {}", value.trim()))
}

fn is_known(found: &[f64]) -> bool {
    let is_near = |(a, b): (&f64, &f64)| (a - b).abs() <= ALIKE;
    let is_it = |known: &[f64; 8]| found.len() == 8 && known.iter().zip(found).all(is_near);
    PRIMARIES.iter().any(is_it)
}

/// Chunks of a PNG, by their rank beside a profile (PNG specification, third edition, section 4.3).
enum Chunks {
    /// cICP or sRGB.
    Decided(Option<String>),
    /// gAMA and cHRM.
    Weaker(Option<String>),
}

fn of_png(bytes: &[u8]) -> Chunks {
    let mut rest = bytes.strip_prefix(b"\x89PNG\r\n\x1a\n").unwrap_or_default();
    let (mut is_srgb, mut other) = (false, Vec::new());
    while let Some((kind, content, after)) = chunk(rest) {
        let numbers: Vec<u32> =
            content.as_chunks::<4>().0.iter().map(|number| u32::from_be_bytes(*number)).collect();
        let scaled = || numbers.iter().map(|number| f64::from(*number) / 1e5).collect::<Vec<_>>();
        match kind {
            // Primaries of Rec. 709 with the curve of sRGB.
            b"cICP" if content.starts_with(&[1, 13]) => return Chunks::Decided(None),
            b"cICP" => return Chunks::Decided(Some(format!("cICP = {content:?}"))),
            b"sRGB" => is_srgb = true,
            // Writers of sRGB give its curve as an exponent of 1/2.2 as well: 45455.
            b"gAMA" if !matches!(numbers[..], [45_000..46_000]) => {
                other.push(format!("gAMA = {:?}", scaled()));
            }
            b"cHRM" => {
                // White stands first.
                let mut found = scaled();
                found.rotate_left(2.min(numbers.len()));
                if !is_known(&found) {
                    other.push(format!("cHRM = {:?}", scaled()));
                }
            }
            b"IDAT" => break,
            _ => {}
        }
        rest = after;
    }
    match is_srgb {
        true => Chunks::Decided(None),
        false => Chunks::Weaker((!other.is_empty()).then(|| other.join(" and "))),
    }
}

/// Kind and content of the first chunk, and what is behind it.
fn chunk(bytes: &[u8]) -> Option<(&[u8; 4], &[u8], &[u8])> {
    let (length, after) = bytes.split_first_chunk()?;
    let length = usize::try_from(u32::from_be_bytes(*length)).ok()?;
    let (kind, after) = after.split_first_chunk()?;
    Some((kind, after.get(..length)?, after.get(length.checked_add(4)?..)?))
}

/// Name of a profile: its tag `desc`, as text (ICC.1:2001-04, section 6.5.17) or in the first of its languages
/// (ICC.1:2022, section 10.15).
fn description(profile: &[u8]) -> Option<String> {
    let number = |at: usize| {
        let bytes = profile.get(at..)?.first_chunk()?;
        usize::try_from(u32::from_be_bytes(*bytes)).ok()
    };
    let tags = profile.get(132..)?.chunks_exact(12).take(number(128)?);
    let at = tags.clone().position(|tag| tag.starts_with(b"desc"))?;
    let at = number(132 + 12 * at + 4)?;
    let tag = profile.get(at..)?;
    let text = |from: usize, length: usize| tag.get(from..from.checked_add(length)?);
    if tag.starts_with(b"mluc") {
        let text = text(number(at + 24)?, number(at + 20)?)?;
        let units: Vec<u16> =
            text.as_chunks().0.iter().map(|unit| u16::from_be_bytes(*unit)).collect();
        return Some(String::from_utf16_lossy(&units));
    }
    let text = text(12, number(at + 8)?)?;
    Some(text.iter().take_while(|byte| **byte != 0).map(|byte| char::from(*byte)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::codecs::{jpeg::JpegEncoder, png::PngEncoder};
    use image::{ExtendedColorType, ImageEncoder};

    /// A profile of nothing but a name.
    fn profile(name: &[u8]) -> Vec<u8> {
        let number = |n: usize| (n as u32).to_be_bytes();
        let tag = [b"desc", &number(144)[..], &number(name.len())].concat();
        [&[0; 128], &number(1)[..], &tag, name].concat()
    }

    fn as_text(name: &str) -> Vec<u8> {
        let length = (name.len() as u32 + 1).to_be_bytes();
        profile(&[b"desc\0\0\0\0", &length[..], name.as_bytes(), &[0]].concat())
    }

    fn in_languages(name: &str) -> Vec<u8> {
        let utf16: Vec<u8> = name.encode_utf16().flat_map(u16::to_be_bytes).collect();
        let number = |n: usize| (n as u32).to_be_bytes();
        let head = [b"mluc\0\0\0\0", &number(1)[..], &number(12), b"enUS"].concat();
        profile(&[&head, &number(utf16.len())[..], &number(28), &utf16].concat())
    }

    fn pictures(profile: Vec<u8>) -> [Vec<u8>; 2] {
        let (mut png, mut jpeg) = (Vec::new(), Vec::new());
        let mut encoder = PngEncoder::new(&mut png);
        encoder.set_icc_profile(profile.clone()).unwrap();
        encoder.write_image(&[0; 24], 4, 2, ExtendedColorType::Rgb8).unwrap();
        let mut encoder = JpegEncoder::new(&mut jpeg);
        encoder.set_icc_profile(profile).unwrap();
        encoder.write_image(&[0; 24], 4, 2, ExtendedColorType::Rgb8).unwrap();
        [png, jpeg]
    }

    #[test]
    fn exact_profiles_are_named() {
        for kind in [as_text, in_languages] {
            for picture in pictures(kind("Adobe RGB (1998)")) {
                let other = other_than_srgb(&picture).unwrap();
                assert_eq!(other.as_deref(), Some("the profile \"Adobe RGB (1998)\""));
            }
            for picture in pictures(kind("sRGB IEC61966-2.1")) {
                assert_eq!(other_than_srgb(&picture).unwrap(), None);
            }
        }
    }

    /// A PNG with chunks before its pixels; readers of chunks look at no sums.
    #[test]
    fn exact_chunks_are_named() {
        let [png, _] = pictures(as_text("sRGB"));
        let (head, pixels) = png.split_at(33);
        let chunk = |kind: &[u8; 4], content: &[u8]| {
            let length = (content.len() as u32).to_be_bytes();
            let body = [kind, content].concat();
            [&length[..], &body, &crc32fast::hash(&body).to_be_bytes()].concat()
        };
        let numbers = |all: &[u32]| all.iter().flat_map(|n| n.to_be_bytes()).collect::<Vec<u8>>();
        let gamma = |n: u32| chunk(b"gAMA", &numbers(&[n]));
        let white_and = |red: u32| numbers(&[31270, 32900, red, 33000, 30000, 60000, 15000, 6000]);
        let primaries = |red: u32| chunk(b"cHRM", &white_and(red));
        let said = |chunks: &[Vec<u8>]| {
            let picture = [head, &chunks.concat(), pixels].concat();
            other_than_srgb(&picture).unwrap().unwrap_or_default()
        };
        assert_eq!(said(&[gamma(45_455), primaries(64_000)]), "");
        assert_eq!(said(&[gamma(100_000)]), "gAMA = [1.0]");
        let wide = "cHRM = [0.3127, 0.329, 0.708, 0.33, 0.3, 0.6, 0.15, 0.06]";
        assert_eq!(said(&[gamma(45_455), primaries(70_800)]), wide);
        let srgb = chunk(b"sRGB", &[0]);
        assert_eq!(said(&[gamma(100_000), srgb.clone(), primaries(70_800)]), "");
        assert_eq!(said(&[chunk(b"cICP", &[9, 16, 0, 1]), srgb]), "cICP = [9, 16, 0, 1]");
        assert_eq!(said(&[chunk(b"cICP", &[1, 13, 0, 1]), gamma(100_000)]), "");
    }

    #[test]
    fn exact_primaries_of_an_hdr_are_named() {
        let said = |line: &str| {
            let head = format!("#?RADIANCE\n{line}\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n");
            other_than_srgb(head.as_bytes()).unwrap().unwrap_or_default()
        };
        for known in PRIMARIES {
            let numbers: Vec<String> = known.iter().map(ToString::to_string).collect();
            assert_eq!(said(&format!("PRIMARIES= {}", numbers.join(" "))), "");
        }
        let wide = "PRIMARIES = 0.708 0.292 0.17 0.797 0.131 0.046 0.3127 0.329";
        assert_eq!(said(&wide.replace(" = ", "= ")), wide);
        assert_eq!(said("PRIMARIES= 0.64 0.33"), "PRIMARIES = 0.64 0.33");
        assert_eq!(said("GAMMA=2.2"), "GAMMA = 2.2");
        assert_eq!(said("GAMMA=1.0"), "");
    }
}

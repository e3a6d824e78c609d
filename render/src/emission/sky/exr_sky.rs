//! The colours of an EXR that is to be the sky.

use super::PanoramaError;
use crate::image::{Picture, exr};

/// Width, height and linear colours of an EXR.
pub(super) fn colors(bytes: &[u8]) -> Result<(usize, usize, Vec<[f32; 3]>), PanoramaError> {
    let refuse = |why: &str| Err(PanoramaError::Content(why.to_owned()));
    let header = exr::Header::of(bytes).map_err(PanoramaError::exr)?;
    if !header.whole {
        return refuse("an EXR of part of its display window, which would not fit the sky");
    }
    if header.cube {
        return refuse("an EXR with envmap = cube: latitude and longitude are expected");
    }
    if let Some(chromaticities) = header.foreign_primaries {
        return Err(PanoramaError::Content(format!(
            "an EXR with chromaticities (red, green, blue, white) {chromaticities:?}: those of Rec. 709 (sRGB) are expected, \
             convert it"
        )));
    }
    let (picture, _) = exr::decode(bytes).map_err(PanoramaError::exr)?;
    let [r, g, b] = channels(&picture)?;
    let pixels = r.iter().zip(g).zip(b).map(|((r, g), b)| [*r, *g, *b]).collect();
    Ok((picture.width, picture.height, pixels))
}

/// Red, green and blue, or the one channel of a grey picture: those without a layer, of the only layer that has them, or of
/// the one that Blender calls Combined.
fn channels(picture: &Picture) -> Result<[&[f32]; 3], PanoramaError> {
    let names = || picture.channels.iter().map(|channel| channel.name.as_str());
    let split = |name: &'_ str| {
        name.rsplit_once('.').map_or((String::new(), name.to_owned()), |(layer, name)| {
            (layer.to_owned(), name.to_owned())
        })
    };
    let find = |layer: &str, wanted: &str| {
        let own = |name: &&str| {
            let (of, name) = split(name);
            of == layer && name.eq_ignore_ascii_case(wanted)
        };
        // As it is written goes before other cases.
        let exact = if layer.is_empty() { wanted.to_owned() } else { format!("{layer}.{wanted}") };
        picture.channel(&exact).or_else(|| picture.channel(names().find(own)?))
    };
    let of = |layer: &str| Some([find(layer, "R")?, find(layer, "G")?, find(layer, "B")?]);
    let grey = |layer: &str| {
        let luminance_alone = find(layer, "RY").is_none() && find(layer, "BY").is_none();
        find(layer, "Y").filter(|_| luminance_alone).map(|y| [y; 3])
    };
    let mut layers: Vec<String> = names().map(|name| split(name).0).collect();
    layers.sort();
    layers.dedup();
    for colors in [&of as &dyn Fn(&str) -> Option<[_; 3]>, &grey] {
        if let Some(colors) = colors("") {
            return Ok(colors);
        }
        let with: Vec<&String> = layers.iter().filter(|layer| colors(layer).is_some()).collect();
        let combined = || with.iter().copied().filter(|layer| layer.ends_with("Combined"));
        let one = match with[..] {
            [] => continue,
            [one] => one,
            _ if combined().count() == 1 => combined().next().unwrap_or(with[0]),
            _ => {
                let message = format!("layers {with:?} have colours: one is expected");
                return Err(PanoramaError::Content(message));
            }
        };
        if let Some(colors) = colors(one) {
            return Ok(colors);
        }
    }
    let names: Vec<&str> = names().collect();
    Err(PanoramaError::Content(format!("channels {}: R, G, B or Y are expected", names.join(", "))))
}

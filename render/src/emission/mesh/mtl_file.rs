//! MTL: the materials of an OBJ file.

use super::MeshError;
use super::file::{Layer, Material, Resources, needed};
use super::text::{Line, lines};
use super::texture::{Placement, Texture};
use std::collections::{HashMap, HashSet};

/// The materials of all files that an OBJ file names.
#[derive(Default)]
pub(super) struct Materials {
    pub all: Vec<Material>,
    pub warnings: Vec<String>,
    numbers: HashMap<String, u32>,
    /// Files that were read.
    pub files: Vec<String>,
}

impl Materials {
    /// The number of a material; `u32::MAX` if no file describes it.
    pub fn number(&self, name: &str) -> u32 {
        self.numbers.get(name).copied().unwrap_or(u32::MAX)
    }
}

/// Description of a material in a file.
#[derive(Default)]
struct Described {
    name: String,
    diffuse: Option<[f32; 3]>,
    emissive: Option<[f32; 3]>,
    diffuse_texture: Option<Texture>,
    emissive_texture: Option<Texture>,
}

impl Described {
    fn material(self) -> Material {
        // A picture of light without a colour is that light.
        let unsaid = if self.emissive_texture.is_some() { [1.0; 3] } else { [0.0; 3] };
        Material {
            emission: Layer {
                color: self.emissive.unwrap_or(unsaid),
                texture: self.emissive_texture,
            },
            base: Layer { color: self.diffuse.unwrap_or([1.0; 3]), texture: self.diffuse_texture },
        }
    }
}

/// Adds the materials of a file. Keywords may be in lower case, as some programs write them.
pub(super) fn decode(
    bytes: &[u8],
    resources: &Resources<'_>,
    materials: &mut Materials,
) -> Result<(), MeshError> {
    let mut current: Option<Described> = None;
    let mut described: HashSet<String> = materials.numbers.keys().cloned().collect();
    let mut unread: Vec<String> = Vec::new();
    for line in lines(bytes)? {
        let keyword = line.keyword().to_ascii_lowercase();
        if keyword == "newmtl" {
            finish(current.take(), materials);
            let name = line.rest().to_owned();
            if !described.insert(name.clone()) {
                return Err(line.fails(format!("a second material is named `{name}`")));
            }
            current = Some(Described { name, ..Described::default() });
            continue;
        }
        let Some(material) = &mut current else {
            if matches!(&*keyword, "kd" | "ke" | "map_kd" | "map_ke") {
                return Err(line.fails(format!("{} before newmtl", line.keyword())));
            }
            continue;
        };
        match &*keyword {
            "kd" => once(&line, &mut material.diffuse, color(&line)?)?,
            "ke" => once(&line, &mut material.emissive, color(&line)?)?,
            "map_kd" => once(&line, &mut material.diffuse_texture, texture(&line, resources)?)?,
            "map_ke" => once(&line, &mut material.emissive_texture, texture(&line, resources)?)?,
            _ if changes_light(&keyword, &line)
                && !unread.iter().any(|k| k.eq_ignore_ascii_case(&keyword)) =>
            {
                unread.push(line.keyword().to_owned());
            }
            _ => {}
        }
    }
    finish(current, materials);
    if !unread.is_empty() {
        let names = unread.join(", ");
        materials.warnings.push(format!(
            "of its materials, {names} are not read: a surface is opaque, or not, as a whole"
        ));
    }
    Ok(())
}

fn finish(material: Option<Described>, materials: &mut Materials) {
    if let Some(material) = material {
        let number = materials.all.len() as u32;
        materials.numbers.insert(material.name.clone(), number);
        materials.all.push(material.material());
    }
}

/// Takes what a statement says, which no other said before.
fn once<T>(line: &Line<'_>, place: &mut Option<T>, said: T) -> Result<(), MeshError> {
    match place.replace(said) {
        None => Ok(()),
        Some(_) => Err(line.fails(format!("a second {} of one material", line.keyword()))),
    }
}

/// Returns whether a statement that is not read would show something of the surface that is not there, or hide
/// something.
fn changes_light(keyword: &str, line: &Line<'_>) -> bool {
    // The last word, since `d -halo` has its number there.
    let number = || line.words().last().and_then(|word| word.parse::<f64>().ok());
    match keyword {
        "d" => number() != Some(1.0),
        "tr" => number() != Some(0.0),
        "map_d" | "map_tr" | "disp" | "decal" => true,
        _ => false,
    }
}

/// A colour: one number for all, or three.
fn color(line: &Line<'_>) -> Result<[f32; 3], MeshError> {
    if let Some(kind @ ("spectral" | "xyz")) = line.words().next() {
        return Err(line
            .fails(format!("{} {kind} is not read: three numbers are expected", line.keyword())));
    }
    // NaN stands for numbers that are not given.
    let color = line.numbers_up_to(line.keyword(), 1..=3, [f64::NAN; 3])?;
    if color[1].is_nan() != color[2].is_nan() {
        return Err(line.fails(format!("{}: one number or three are expected", line.keyword())));
    }
    Ok(color.map(|c| if c.is_nan() { color[0] as f32 } else { c as f32 }))
}

/// A picture with its options.
fn texture(line: &Line<'_>, resources: &Resources<'_>) -> Result<Texture, MeshError> {
    let (mut rest, mut scale, mut offset) = (line.rest(), [1.0; 2], [0.0; 2]);
    while let Some(option) = rest.strip_prefix('-') {
        let (name, after) = option.split_once(char::is_whitespace).unwrap_or((option, ""));
        let (values, after) = values(after, name);
        let refused = || line.fails(format!("option -{name} {} is not read", values.join(" ")));
        let numbers = || values.iter().map(|v| v.parse().ok()).collect::<Option<Vec<f64>>>();
        let pair = |one: f64| {
            let numbers = numbers().filter(|v| !v.is_empty()).ok_or_else(refused)?;
            Ok::<_, MeshError>([numbers[0], numbers.get(1).copied().unwrap_or(one)])
        };
        match name {
            "s" => scale = pair(1.0)?,
            "o" => offset = pair(0.0)?,
            "blendu" | "blendv" | "texres" | "boost" | "bm" => {}
            "clamp" | "cc" if values == ["off"] => {}
            "mm" if numbers() == Some(vec![0.0, 1.0]) => {}
            "t" if numbers().is_some_and(|v| v.iter().all(|x| *x == 0.0)) => {}
            _ => return Err(refused()),
        }
        rest = after;
    }
    let texture = Texture::decode(&needed(resources, rest)?)?;
    // Scale and offset are those of coordinates whose v grows upwards.
    let affine = [[scale[0], 0.0, offset[0]], [0.0, scale[1], 1.0 - scale[1] - offset[1]]];
    Ok(texture.placed(Placement::affine(affine)))
}

/// The values of an option, and what follows them.
fn values<'a>(text: &'a str, option: &str) -> (Vec<&'a str>, &'a str) {
    let most = match option {
        "s" | "o" | "t" => 3,
        "mm" => 2,
        _ => 1,
    };
    let (mut values, mut rest) = (Vec::new(), text.trim_start());
    while values.len() < most {
        let (word, after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
        // Of these, only the first value must be there.
        if word.is_empty() || most == 3 && word.parse::<f64>().is_err() {
            break;
        }
        values.push(word);
        rest = after.trim_start();
    }
    (values, rest)
}

//! Wavefront OBJ: vertices, texture coordinates, faces, and the names of their materials.

use super::MeshError;
use super::file::{MeshFile, RawTriangle, Resources, resource};
use super::mtl_file::{self, Materials};
use super::polygon;
use super::text::{Line, lines};
use std::collections::HashMap;

/// Statements that bring no surface and no light of their own.
const WITHOUT_EFFECT: [&str; 28] = [
    "vn",
    "vp",
    "g",
    "o",
    "s",
    "l",
    "p",
    "mg",
    "bevel",
    "c_interp",
    "d_interp",
    "lod",
    "shadow_obj",
    "trace_obj",
    "cstype",
    "deg",
    "bmat",
    "step",
    "parm",
    "trim",
    "hole",
    "scrv",
    "sp",
    "end",
    "con",
    "curv",
    "curv2",
    "maplib",
];

/// Statements that bring surfaces, pictures or files which are not read.
const REFUSED: [&str; 9] = ["surf", "ctech", "stech", "bsp", "bzp", "cdc", "res", "usemap", "call"];

#[derive(Default)]
struct Reader {
    positions: Vec<[f64; 3]>,
    places: Vec<[f32; 2]>,
    normals: usize,
    /// Numbers of the names of materials; their names.
    named: HashMap<String, u32>,
    names: Vec<String>,
    current: Option<u32>,
    bent: Vec<usize>,
    colored: Vec<usize>,
    unknown: Vec<(usize, String)>,
    materials: Materials,
    file: MeshFile,
}

pub(super) fn decode(bytes: &[u8], resources: &Resources<'_>) -> Result<MeshFile, MeshError> {
    let mut reader = Reader::default();
    for line in lines(bytes)? {
        reader.statement(&line, resources)?;
    }
    Ok(reader.finish())
}

impl Reader {
    fn statement(&mut self, line: &Line<'_>, resources: &Resources<'_>) -> Result<(), MeshError> {
        match line.keyword() {
            "v" => self.vertex(line)?,
            "vt" => {
                let [u, v] = line.numbers_up_to("texture coordinates", 1..=3, [0.0; 2])?;
                // v grows upwards in OBJ.
                self.places.push([u as f32, 1.0 - v as f32]);
            }
            "f" | "fo" => self.face(line)?,
            "usemtl" => self.current = Some(self.material(line.rest())),
            "mtllib" => self.library(line, resources)?,
            known if REFUSED.contains(&known) => {
                return Err(
                    line.fails(format!("`{known}` is not read: export triangles or polygons"))
                );
            }
            known if WITHOUT_EFFECT.contains(&known) => self.normals += usize::from(known == "vn"),
            other => self.unknown.push((line.number, other.chars().take(20).collect())),
        }
        Ok(())
    }

    /// Coordinates, perhaps with a weight of 1 or with a colour behind them.
    fn vertex(&mut self, line: &Line<'_>) -> Result<(), MeshError> {
        let [x, y, z, weight] = line.numbers_up_to("coordinates", 3..=7, [0.0, 0.0, 0.0, 1.0])?;
        let count = line.words().count();
        if matches!(count, 4 | 5) && weight != 1.0 {
            return Err(line.fails(format!("the weight {weight} of a vertex is not allowed: 1")));
        }
        if count > 4 {
            self.colored.push(line.number);
        }
        self.positions.push([x, y, z]);
        Ok(())
    }

    fn material(&mut self, name: &str) -> u32 {
        let next = self.names.len() as u32;
        let names = &mut self.names;
        *self.named.entry(name.to_owned()).or_insert_with(|| {
            names.push(name.to_owned());
            next
        })
    }

    fn face(&mut self, line: &Line<'_>) -> Result<(), MeshError> {
        let corners = line.words().map(|word| self.corner(line, word));
        let corners = corners.collect::<Result<Vec<_>, _>>()?;
        if corners.len() < 3 {
            return Err(
                line.fails(format!("a face of {} corners: 3 or more are needed", corners.len()))
            );
        }
        self.file.affords(corners.len() - 2)?;
        let places: Vec<[f64; 3]> = corners.iter().map(|(k, _)| self.positions[*k]).collect();
        let cut = polygon::cut(&places).map_err(|why| line.fails(why.to_string()))?;
        if !cut.flat {
            self.bent.push(line.number);
        }
        let material = self.current.unwrap_or(u32::MAX);
        let place = |k: Option<usize>| k.map_or([0.0; 2], |k| self.places[k]);
        self.file.triangles.extend(cut.triangles.iter().map(|triangle| RawTriangle {
            corners: triangle.map(|k| places[k]),
            texture: triangle.map(|k| place(corners[k].1)),
            material,
        }));
        Ok(())
    }

    /// Vertex and texture coordinates of a corner, `v/vt/vn`, counted from 0.
    fn corner(&self, line: &Line<'_>, word: &str) -> Result<(usize, Option<usize>), MeshError> {
        let mut parts = word.split('/');
        let index = |part: &str, what: &str, count: usize| {
            let index: Option<i64> = part.parse().ok();
            let found = index.and_then(|k| match k {
                1.. => usize::try_from(k - 1).ok(),
                // 0 comes out as `count`, which is refused below.
                _ => count.checked_sub(usize::try_from(k.unsigned_abs()).ok()?),
            });
            found.filter(|k| *k < count).ok_or_else(|| {
                line.fails(format!(
                    "{what} {part} of a face is not allowed: 1 to {count}, or -{count} to -1"
                ))
            })
        };
        let vertex = index(parts.next().unwrap_or_default(), "vertex", self.positions.len())?;
        let filled =
            |part: Option<&'_ str>| part.filter(|part| !part.is_empty()).map(str::to_owned);
        let place = filled(parts.next());
        let place =
            place.map(|part| index(&part, "texture coordinate", self.places.len())).transpose()?;
        filled(parts.next()).map(|part| index(&part, "normal", self.normals)).transpose()?;
        match parts.next() {
            Some(_) => Err(line.fails(format!(
                "corner {word} of a face is not allowed: v, v/vt, v//vn or v/vt/vn"
            ))),
            None => Ok((vertex, place)),
        }
    }

    /// Reads material files: one name, or several with blanks between them.
    fn library(&mut self, line: &Line<'_>, resources: &Resources<'_>) -> Result<(), MeshError> {
        let whole = line.rest();
        let found = resource(resources, whole)?;
        if let (None, true) = (&found, whole.contains(char::is_whitespace)) {
            return whole.split_whitespace().try_for_each(|name| {
                let found = resource(resources, name)?;
                self.read_library(line, name, found, resources)
            });
        }
        self.read_library(line, whole, found, resources)
    }

    fn read_library(
        &mut self,
        line: &Line<'_>,
        name: &str,
        bytes: Option<Vec<u8>>,
        resources: &Resources<'_>,
    ) -> Result<(), MeshError> {
        if self.materials.files.iter().any(|file| file == name) {
            return Ok(());
        }
        self.materials.files.push(name.to_owned());
        let Some(bytes) = bytes else {
            let number = line.number;
            self.file.warn(format!(
                "line {number}: there is no `{name}`: the materials that it describes are white"
            ));
            return Ok(());
        };
        let read = mtl_file::decode(&bytes, resources, &mut self.materials);
        read.map_err(|error| MeshError::Within { name: name.to_owned(), error: Box::new(error) })
    }

    /// Names become numbers of materials; what was not read is told.
    fn finish(mut self) -> MeshFile {
        let known: Vec<u32> = self.names.iter().map(|name| self.materials.number(name)).collect();
        for triangle in &mut self.file.triangles {
            triangle.material = known.get(triangle.material as usize).copied().unwrap_or(u32::MAX);
        }
        let without = self.names.iter().zip(&known).filter(|(_, k)| **k == u32::MAX);
        let without: Vec<&str> = without.map(|(name, _)| name.as_str()).collect();
        if let ([first, ..], false) = (&without[..], self.materials.all.is_empty()) {
            let count = without.len();
            self.file.warn(format!(
                "materials that no MTL file describes are white: {count}, the first is `{first}`"
            ));
        }
        if let [first, ..] = self.bent[..] {
            let count = self.bent.len();
            self.file.warn(format!(
                "polygons that are not flat are cut as seen along their mean normal: {count}, the first on line {first}"
            ));
        }
        if let [first, ..] = self.colored[..] {
            let count = self.colored.len();
            self.file.warn(format!(
                "colours of vertices are not read: {count}, the first on line {first}"
            ));
        }
        if let [(first, word), ..] = &self.unknown[..] {
            let count = self.unknown.len();
            self.file.warn(format!("lines that are no statements of OBJ are left out: {count}, the first is line {first}, `{word}`"));
        }
        self.file.warnings.extend(self.materials.warnings);
        self.file.materials = self.materials.all;
        self.file
    }
}

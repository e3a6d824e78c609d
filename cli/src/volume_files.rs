//! Volumes of emission as NPZ or NPY.

use crate::interferometry::image_files::npy_array;
use crate::{npz, output};
use anyhow::{Context, anyhow, bail};
use kerrlight_tomo::scene::VolumeSource;
use kerrlight_tomo::volume::{Volume, VolumeFile};
use npyz::WriterBuilder;
use std::io::{Cursor, Write};
use std::path::Path;

/// What a file says of a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct Arrays {
    nodes: [usize; 3],
    values: Vec<f32>,
    corners: [Option<[f64; 3]>; 2],
    axis: Option<[f64; 3]>,
}

/// The arrays of an archive with `emission` of shape (nx, ny, nz), `low` and `high` (M) and
/// `axis`, or the only array of an NPY file: `path` tells which.
pub fn decode(path: &Path, bytes: &[u8]) -> anyhow::Result<Arrays> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    match extension.to_ascii_lowercase().as_str() {
        "npy" => {
            let (nodes, values) = emission(bytes)?;
            Ok(Arrays { nodes, values, corners: [None; 2], axis: None })
        }
        "npz" => archive(bytes),
        _ => bail!("a volume ends in .npz or .npy"),
    }
}

fn archive(bytes: &[u8]) -> anyhow::Result<Arrays> {
    let mut archive = npz::open(bytes)?;
    let mut member =
        |name: &str| npz::member(&mut archive, &npyz::npz::file_name_from_array_name(name));
    let found = member("emission")?.context("holds no array named emission")?;
    let (nodes, values) = emission(&found).context("array emission")?;
    let mut vector = |name: &str| {
        member(name)?
            .map(|bytes| three(&bytes))
            .transpose()
            .with_context(|| format!("array {name}"))
    };
    let corners = [vector("low")?, vector("high")?];
    Ok(Arrays { nodes, values, corners, axis: vector("axis")? })
}

/// Nodes along x, y and z and the values of an array of three dimensions.
fn emission(bytes: &[u8]) -> anyhow::Result<([usize; 3], Vec<f32>)> {
    let (shape, values) = npy_array(bytes)?;
    let [x, y, z] = shape[..] else { bail!("shape {shape:?}: (nx, ny, nz) is expected") };
    let nodes = [x, y, z].map(|n| n as usize);
    let single: Vec<f32> = values.iter().map(|value| *value as f32).collect();
    if let Some(k) = single.iter().position(|value| !value.is_finite()) {
        bail!("value {:e} of node {:?} is not finite in 32 bits", values[k], node(k, nodes));
    }
    Ok((nodes, single))
}

/// Where the k-th value of an array in C's order stands.
fn node(k: usize, nodes: [usize; 3]) -> (usize, usize, usize) {
    (k / (nodes[1] * nodes[2]), k / nodes[2] % nodes[1], k % nodes[2])
}

fn three(bytes: &[u8]) -> anyhow::Result<[f64; 3]> {
    let (shape, values) = npy_array(bytes)?;
    let three: [f64; 3] =
        values.try_into().map_err(|_| anyhow!("shape {shape:?}: 3 numbers are expected"))?;
    if three.iter().any(|x| !x.is_finite()) {
        bail!("{three:?}: 3 finite numbers are expected");
    }
    Ok(three)
}

impl Arrays {
    /// The volume where a scene puts it.
    pub fn placed(self, source: &VolumeSource) -> anyhow::Result<VolumeFile> {
        let [low, high] = self.corners;
        let missing = |name: &str| {
            format!("neither the file nor the scene gives `{name}`: coordinates of a corner (M)")
        };
        let low = source.low.or(low).with_context(|| missing("low"))?;
        let high = source.high.or(high).with_context(|| missing("high"))?;
        let turns = source.rotation != kerrlight_tomo::scene::Rotation::None;
        if turns && source.axis.or(self.axis).is_none() {
            bail!("neither the file nor the scene gives `axis`, about which it turns");
        }
        if let Some(k) = self.values.iter().position(|value| *value < 0.0) {
            let (place, value) = (node(k, self.nodes), self.values[k]);
            bail!("value {value:e} of node {place:?} is not allowed: emission is 0 or more");
        }
        let volume = Volume::new(self.nodes, low, high, self.values)?;
        Ok(VolumeFile { volume, axis: self.axis })
    }
}

/// Reads the volume of a scene from `bytes`, the content of `path`.
pub fn read(path: &Path, bytes: &[u8], source: &VolumeSource) -> anyhow::Result<VolumeFile> {
    decode(path, bytes)?.placed(source)
}

/// Reads a volume that says itself where it is.
pub fn load(path: &Path) -> anyhow::Result<VolumeFile> {
    let name = || path.display().to_string();
    let found = decode(path, &output::read(path)?).with_context(name)?;
    let [Some(low), Some(high)] = found.corners else {
        bail!("{}: arrays low and high are missing", name());
    };
    let volume = Volume::new(found.nodes, low, high, found.values).with_context(name)?;
    Ok(VolumeFile { volume, axis: found.axis })
}

/// Writes an NPZ archive, whole or not at all.
pub fn write(output: &output::Output, file: &VolumeFile) -> anyhow::Result<()> {
    output.write(&encode(file)?)
}

fn encode(file: &VolumeFile) -> anyhow::Result<Vec<u8>> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default();
    let mut member = |name: &str, bytes: Vec<u8>| -> anyhow::Result<()> {
        archive.start_file(npyz::npz::file_name_from_array_name(name), options)?;
        Ok(archive.write_all(&bytes)?)
    };
    let volume = &file.volume;
    let shape = volume.nodes().map(|n| n as u64);
    member("emission", npy(&shape, volume.values().iter().copied())?)?;
    let vectors = [("low", Some(volume.low())), ("high", Some(volume.high())), ("axis", file.axis)];
    for (name, vector) in vectors {
        if let Some(vector) = vector {
            member(name, npy(&[3], vector.into_iter())?)?;
        }
    }
    Ok(archive.finish()?.into_inner())
}

/// The bytes of an NPZ archive of movies of one shape (frames, rows from the top, columns), with lists of numbers
/// such as the times of the frames.
pub fn movie_archive(
    shape: [usize; 3],
    movies: &[(&str, Vec<f32>)],
    lists: &[(&str, Vec<f64>)],
) -> anyhow::Result<Vec<u8>> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default();
    let mut member = |name: &str, bytes: Vec<u8>| -> anyhow::Result<()> {
        archive.start_file(npyz::npz::file_name_from_array_name(name), options)?;
        Ok(archive.write_all(&bytes)?)
    };
    for (name, movie) in movies {
        member(name, npy(&shape.map(|n| n as u64), movie.iter().copied())?)?;
    }
    for (name, list) in lists {
        member(name, npy(&[list.len() as u64], list.iter().copied())?)?;
    }
    Ok(archive.finish()?.into_inner())
}

fn npy<T: npyz::AutoSerialize>(
    shape: &[u64],
    values: impl Iterator<Item = T>,
) -> anyhow::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut writer =
        npyz::WriteOptions::new().default_dtype().shape(shape).writer(&mut bytes).begin_nd()?;
    writer.extend(values)?;
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_tomo::scene::Rotation;

    fn source(low: Option<[f64; 3]>, axis: Option<[f64; 3]>) -> VolumeSource {
        VolumeSource {
            path: String::new(),
            factor: 1.0,
            low,
            high: low.map(|low| low.map(|x| x + 5.0)),
            axis,
            rotation: Rotation::Keplerian,
            reference_time: Some(0.0),
            injection_time: None,
            region: None,
            color: [1.0; 3],
        }
    }

    fn file(axis: Option<[f64; 3]>) -> VolumeFile {
        let values = (0..24).map(|k| k as f32 / 7.0).collect();
        let volume = Volume::new([2, 3, 4], [-1.0, 0.0, 2.0], [1.5, 3.0, 2.5], values).unwrap();
        VolumeFile { volume, axis }
    }

    #[test]
    fn exact_round_trip() {
        for axis in [None, Some([0.0, 0.6, 0.8])] {
            let bytes = encode(&file(axis)).unwrap();
            let source = source(None, Some([1.0, 0.0, 0.0]));
            assert_eq!(read(Path::new("v.npz"), &bytes, &source).unwrap(), file(axis));
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("volume.npz");
        write(&output::Output::new(&path, "npz").unwrap(), &file(None)).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), encode(&file(None)).unwrap());
    }

    /// The scene's box goes before the file's, and an NPY file has none.
    #[test]
    fn exact_boxes() {
        let (low, up) = (Some([7.0; 3]), Some([0.0, 0.0, 1.0]));
        let bytes = encode(&file(None)).unwrap();
        let placed = read(Path::new("v.npz"), &bytes, &source(low, up)).unwrap();
        assert_eq!((placed.volume.low(), placed.volume.high()), ([7.0; 3], [12.0; 3]));
        let values = (0..24).map(|k| f64::from(k) / 7.0);
        let bytes = npy(&[2, 3, 4], values).unwrap();
        let placed = read(Path::new("v.NPY"), &bytes, &source(low, up)).unwrap();
        assert_eq!(placed.volume.values(), file(None).volume.values());
        let error = read(Path::new("v.npy"), &bytes, &source(None, up)).unwrap_err();
        assert!(error.to_string().contains("`low`"), "{error}");
    }

    #[test]
    fn wrong_arrays_are_named() {
        let of = |name: &str, bytes: &[u8], axis| {
            format!("{:#}", read(Path::new(name), bytes, &source(None, axis)).unwrap_err())
        };
        let archive = |arrays: &[(&str, Vec<u8>)]| {
            let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
            for (name, bytes) in arrays {
                let options = zip::write::SimpleFileOptions::default();
                archive.start_file(format!("{name}.npy"), options).unwrap();
                archive.write_all(bytes).unwrap();
            }
            archive.finish().unwrap().into_inner()
        };
        let ones = |shape: &[u64]| npy(shape, (0..shape.iter().product()).map(|_| 1.0f32)).unwrap();
        let up = Some([0.0, 0.0, 1.0]);
        assert_eq!(of("v.npz", &archive(&[]), up), "holds no array named emission");
        let text = of("v.npz", &archive(&[("emission", ones(&[4, 2]))]), up);
        assert_eq!(text, "array emission: shape [4, 2]: (nx, ny, nz) is expected");
        let text =
            of("v.npz", &archive(&[("emission", ones(&[2, 2, 2])), ("low", ones(&[2]))]), up);
        assert_eq!(text, "array low: shape [2]: 3 numbers are expected");
        let bad = npy(&[2, 1, 2], [0.0, 1.0, 1e300, 0.0].into_iter()).unwrap();
        let text = of("v.npy", &bad, up);
        assert_eq!(text, "value 1e300 of node (1, 0, 0) is not finite in 32 bits");
        let bad = npy(&[2, 2, 2], [0.0, 1.0, 0.0, 0.0, -0.25, 0.0, 0.0, 0.0].into_iter()).unwrap();
        let placed = VolumeSource { low: Some([0.0; 3]), high: Some([1.0; 3]), ..source(None, up) };
        let text = format!("{:#}", read(Path::new("v.npy"), &bad, &placed).unwrap_err());
        assert_eq!(text, "value -2.5e-1 of node (1, 0, 0) is not allowed: emission is 0 or more");
        let whole = npy(&[2, 2, 2], 0..8i64).unwrap();
        let counts = read(Path::new("v.npy"), &whole, &placed).unwrap();
        assert_eq!(counts.volume.values(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        let words = npy(&[2, 1, 2], [true; 4].into_iter()).unwrap();
        let text = of("v.npy", &words, up);
        assert!(text.contains("'|b1': whole numbers, float32 or float64 are expected"), "{text}");
        let text = of("v.npz", &encode(&file(None)).unwrap(), None);
        assert_eq!(text, "neither the file nor the scene gives `axis`, about which it turns");
        assert_eq!(of("v.txt", &[], up), "a volume ends in .npz or .npy");
        assert!(of("v.npz", b"PK", up).contains("not an npz archive"));
    }
}

//! Volumes as NPZ archives and NPY arrays.

use super::{Volume, VolumeFile};
use crate::scene::{Rotation, VolumeSource};
use kerrlight_common::numpy::{Archive, NumpyError, read_array, write_archive, write_array};

/// Arrays of a volume in a file.
#[derive(Debug, Clone, PartialEq)]
pub struct VolumeArrays {
    nodes: [usize; 3],
    values: Vec<f32>,
    corners: [Option<[f64; 3]>; 2],
    axis: Option<[f64; 3]>,
}

type Result<T> = std::result::Result<T, crate::Error>;

/// Nodes along x, y and z and the values of an array of three dimensions.
fn emission(bytes: &[u8]) -> Result<([usize; 3], Vec<f32>)> {
    let (shape, values) = read_array(bytes)?;
    let [x, y, z] = shape[..] else {
        return Err(
            NumpyError::content(format!("shape {shape:?}: (nx, ny, nz) is expected")).into()
        );
    };
    let nodes = [x, y, z].map(|n| n as usize);
    let single = finite(nodes, &values).map_err(NumpyError::content)?;
    Ok((nodes, single))
}

/// The values in single precision, or which of them has none.
fn finite(nodes: [usize; 3], values: &[f64]) -> std::result::Result<Vec<f32>, String> {
    let single: Vec<f32> = values.iter().map(|value| *value as f32).collect();
    match single.iter().position(|value| !value.is_finite()) {
        None => Ok(single),
        Some(k) => {
            let (value, node) = (values[k], node(k, nodes));
            Err(format!("value {value:e} of node {node:?} is not finite in 32 bits"))
        }
    }
}

/// Returns the node of the k-th value of an array in C's order.
fn node(k: usize, nodes: [usize; 3]) -> (usize, usize, usize) {
    (k / (nodes[1] * nodes[2]), k / nodes[2] % nodes[1], k % nodes[2])
}

fn three(bytes: &[u8]) -> Result<[f64; 3]> {
    let (shape, values) = read_array(bytes)?;
    let expected = |_| NumpyError::content(format!("shape {shape:?}: 3 numbers are expected"));
    let three: [f64; 3] = values.try_into().map_err(expected)?;
    if three.iter().any(|x| !x.is_finite()) {
        return Err(NumpyError::content(format!("{three:?}: 3 finite numbers are expected")).into());
    }
    Ok(three)
}

impl VolumeArrays {
    /// Emission of `nodes` along x, y and z, z fastest, between `corners` (M) and about `axis`, as far as a file tells.
    ///
    /// # Errors
    /// If there are more or fewer values than nodes, or one is not finite in 32 bits.
    pub fn new(
        nodes: [usize; 3],
        values: &[f64],
        corners: [Option<[f64; 3]>; 2],
        axis: Option<[f64; 3]>,
    ) -> Result<Self> {
        let (found, wanted) = (values.len(), nodes.iter().product());
        if found != wanted {
            return Err(super::VolumeError::Length { found, wanted }.into());
        }
        let values = finite(nodes, values).map_err(NumpyError::content)?;
        Ok(VolumeArrays { nodes, values, corners, axis })
    }

    /// The only array of an NPY file: emission of shape (nx, ny, nz), which says nothing of where it is.
    ///
    /// # Errors
    /// If it is no array of three dimensions of numbers that are finite in 32 bits.
    pub fn from_npy(bytes: &[u8]) -> Result<Self> {
        let (nodes, values) = emission(bytes)?;
        Ok(VolumeArrays { nodes, values, corners: [None; 2], axis: None })
    }

    /// The arrays of an NPZ archive: `emission` of shape (nx, ny, nz) and, as far as they are there, `low` and `high`
    /// (corners, M) and `axis`.
    ///
    /// # Errors
    /// If there is no emission, or an array has another shape.
    pub fn from_npz(bytes: &[u8]) -> Result<Self> {
        let mut archive = Archive::open(bytes)?;
        let none = || NumpyError::content("holds no array named emission".to_owned());
        let found = archive.member("emission")?.ok_or_else(none)?;
        let (nodes, values) =
            emission(&found).map_err(|error| NumpyError::member("array emission", error))?;
        let mut vector = |name: &str| -> Result<Option<[f64; 3]>> {
            let bytes = archive.member(name)?;
            let three = bytes.map(|bytes| three(&bytes)).transpose();
            Ok(three.map_err(|error| NumpyError::member(format!("array {name}"), error))?)
        };
        let corners = [vector("low")?, vector("high")?];
        Ok(VolumeArrays { nodes, values, corners, axis: vector("axis")? })
    }

    /// Corners and axis of the file, by the ranges of scenes.
    fn check_place(&self) -> Result<()> {
        let refuse = |message: String| Err(NumpyError::content(message).into());
        for (name, corner) in ["low", "high"].into_iter().zip(self.corners) {
            if let Some(corner) = corner.filter(|corner| !corner.iter().all(|x| x.abs() <= 1e6)) {
                return refuse(format!(
                    "array {name}: {corner:?} is not allowed: three numbers in [-1e6, 1e6] (M)"
                ));
            }
        }
        let length = |axis: [f64; 3]| axis.iter().map(|x| x * x).sum::<f64>();
        match self.axis.filter(|axis| !(1e-30..=1e30).contains(&length(*axis))) {
            Some(axis) => refuse(format!(
                "array axis: {axis:?} is not allowed: three numbers that are not all 0, with a length in [1e-15, 1e15]"
            )),
            None => Ok(()),
        }
    }

    /// The volume where the file says that it is.
    ///
    /// # Errors
    /// If it does not say so, or the arrays are no volume.
    pub fn located(self) -> Result<VolumeFile> {
        let [Some(low), Some(high)] = self.corners else {
            return Err(NumpyError::content("arrays low and high are missing".to_owned()).into());
        };
        self.check_place()?;
        let volume = Volume::new(self.nodes, low, high, self.values)?;
        Ok(VolumeFile { volume, axis: self.axis })
    }

    /// The volume where a scene puts it, or the file where the scene does not.
    ///
    /// # Errors
    /// If neither says where it is, or about what it turns; if its emission is below 0.
    pub fn placed(self, source: &VolumeSource) -> Result<VolumeFile> {
        let [low, high] = self.corners;
        self.check_place()?;
        let refuse = |message: String| Err(NumpyError::content(message).into());
        let missing = |name: &str| {
            NumpyError::content(format!(
                "neither the file nor the scene gives `{name}`: coordinates of a corner (M)"
            ))
        };
        let low = source.low.or(low).ok_or_else(|| missing("low"))?;
        let high = source.high.or(high).ok_or_else(|| missing("high"))?;
        if source.rotation != Rotation::None && source.axis.or(self.axis).is_none() {
            let axis = "neither the file nor the scene gives `axis`, about which it turns";
            return refuse(axis.to_owned());
        }
        if let Some(k) = self.values.iter().position(|value| *value < 0.0) {
            let (place, value) = (node(k, self.nodes), self.values[k]);
            return refuse(format!(
                "value {value:e} of node {place:?} is not allowed: emission is 0 or more"
            ));
        }
        if let Some(k) =
            self.values.iter().position(|value| !shines(source.factor * f64::from(*value)))
        {
            let (place, value, factor) = (node(k, self.nodes), self.values[k], source.factor);
            return refuse(format!(
                "value {value:e} of node {place:?} is not allowed: times factor = {factor:e} it is a number in [0, 1e12]"
            ));
        }
        let volume = Volume::new(self.nodes, low, high, self.values)?;
        Ok(VolumeFile { volume, axis: self.axis })
    }
}

/// Returns whether a scene may have such an emission.
fn shines(value: f64) -> bool {
    (0.0..=1e12).contains(&value)
}

impl VolumeFile {
    /// The bytes of an NPZ archive: `emission`, `low`, `high` and, if there is one, `axis`.
    pub fn to_npz(&self) -> Vec<u8> {
        let volume = &self.volume;
        let shape = volume.nodes().map(|n| n as u64);
        let emission = ("emission", write_array(&shape, volume.values().iter().copied()));
        let vectors =
            [("low", Some(volume.low())), ("high", Some(volume.high())), ("axis", self.axis)];
        let vectors = vectors
            .into_iter()
            .filter_map(|(name, vector)| Some((name, write_array(&[3], vector?))));
        write_archive(std::iter::once(emission).chain(vectors))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_common::numpy::{write_archive, write_array};

    /// Reads a file of this name.
    fn read(name: &str, bytes: &[u8], source: &VolumeSource) -> Result<VolumeFile> {
        if name.ends_with(".npz") {
            VolumeArrays::from_npz(bytes)?.placed(source)
        } else {
            VolumeArrays::from_npy(bytes)?.placed(source)
        }
    }

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
            let bytes = file(axis).to_npz();
            let source = source(None, Some([1.0, 0.0, 0.0]));
            assert_eq!(read("v.npz", &bytes, &source).unwrap(), file(axis));
        }
    }

    /// The scene's box goes before the file's, and an NPY file has none.
    #[test]
    fn exact_boxes() {
        let (low, up) = (Some([7.0; 3]), Some([0.0, 0.0, 1.0]));
        let bytes = file(None).to_npz();
        let placed = read("v.npz", &bytes, &source(low, up)).unwrap();
        assert_eq!((placed.volume.low(), placed.volume.high()), ([7.0; 3], [12.0; 3]));
        let values = (0..24).map(|k| f64::from(k) / 7.0);
        let bytes = write_array(&[2, 3, 4], values);
        let placed = read("v.npy", &bytes, &source(low, up)).unwrap();
        assert_eq!(placed.volume.values(), file(None).volume.values());
        let error = read("v.npy", &bytes, &source(None, up)).unwrap_err();
        assert!(error.to_string().contains("`low`"), "{error}");
    }

    #[test]
    fn wrong_arrays_are_named() {
        let of = |name: &str, bytes: &[u8], axis| {
            format!("{:#}", read(name, bytes, &source(None, axis)).unwrap_err())
        };
        let archive = |arrays: &[(&'static str, Vec<u8>)]| write_archive(arrays.to_vec());
        let ones = |shape: &[u64]| write_array(shape, (0..shape.iter().product()).map(|_| 1.0f32));
        let up = Some([0.0, 0.0, 1.0]);
        assert_eq!(of("v.npz", &archive(&[]), up), "holds no array named emission");
        let text = of("v.npz", &archive(&[("emission", ones(&[4, 2]))]), up);
        assert_eq!(text, "array emission: shape [4, 2]: (nx, ny, nz) is expected");
        let text =
            of("v.npz", &archive(&[("emission", ones(&[2, 2, 2])), ("low", ones(&[2]))]), up);
        assert_eq!(text, "array low: shape [2]: 3 numbers are expected");
        let bad = write_array(&[2, 1, 2], [0.0, 1.0, 1e300, 0.0]);
        let text = of("v.npy", &bad, up);
        assert_eq!(text, "value 1e300 of node (1, 0, 0) is not finite in 32 bits");
        let bad = write_array(&[2, 2, 2], [0.0, 1.0, 0.0, 0.0, -0.25, 0.0, 0.0, 0.0]);
        let placed = VolumeSource { low: Some([0.0; 3]), high: Some([1.0; 3]), ..source(None, up) };
        let text = format!("{:#}", read("v.npy", &bad, &placed).unwrap_err());
        assert_eq!(text, "value -2.5e-1 of node (1, 0, 0) is not allowed: emission is 0 or more");
        let whole = write_array(&[2, 2, 2], 0..8i64);
        let counts = read("v.npy", &whole, &placed).unwrap();
        assert_eq!(counts.volume.values(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        let words = write_array(&[2, 1, 2], [true; 4]);
        let text = of("v.npy", &words, up);
        assert!(text.contains("'|b1': whole numbers, float32 or float64 are expected"), "{text}");
        let text = of("v.npz", &file(None).to_npz(), None);
        assert_eq!(text, "neither the file nor the scene gives `axis`, about which it turns");
        assert!(of("v.npz", b"PK", up).contains("not an npz archive"));
    }
}

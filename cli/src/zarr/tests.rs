use super::*;
use kerrlight_render::volume::{Volume, VolumeArrays};
use serde_json::{Map, Value, json};
use std::sync::Arc;
use zarrs::array::codec::GzipCodec;
use zarrs::array::{ArrayBuilder, DataType, Element, ZARR_NAN_F64};
use zarrs::filesystem::FilesystemStore;

/// Two chunks along x.
fn volume(factor: f32) -> Volume {
    let values = (0..70 * 3 * 2).map(|k| k as f32 * factor).collect();
    Volume::new([70, 3, 2], [-1.0, 0.0, 0.1], [1.5, 3.0, 2.5], values).unwrap()
}

fn arrays(volume: &Volume, axis: Option<[f64; 3]>) -> VolumeArrays {
    let values: Vec<f64> = volume.values().iter().map(|x| f64::from(*x)).collect();
    let corners = [volume.low(), volume.high()].map(Some);
    VolumeArrays::new(volume.nodes(), &values, corners, axis).unwrap()
}

fn attributes() -> Map<String, Value> {
    json!({"axis": [0.0, 0.6, 0.8], "version": "0"}).as_object().cloned().unwrap()
}

/// A store with two volumes.
fn stored(at: &Path) -> PathBuf {
    let (path, [mean, deviation]) = (at.join("v.zarr"), [0.1, 0.7].map(volume));
    let field = |name, volume| Field { name, meaning: "m", unit: "u", volume };
    let fields = [field("emission", &mean), field("deviation", &deviation)];
    write(&path, &fields, attributes()).unwrap();
    path
}

/// An array of `chunk` as others write it, and what is said when it is read as a movie.
fn written<T: Element>(
    path: &Path,
    (shape, chunk): (&[u64], &[u64]),
    kind: (DataType, zarrs::array::FillValue),
    values: &[T],
) {
    let store = Arc::new(FilesystemStore::new(path).unwrap());
    let mut builder = ArrayBuilder::new(shape.to_vec(), chunk.to_vec(), kind.0, kind.1);
    builder.bytes_to_bytes_codecs(vec![Arc::new(GzipCodec::new(5).unwrap())]);
    let array = builder.build(store, "/").unwrap();
    array.store_metadata().unwrap();
    array.store_array_subset_elements(&array.subset_all(), values).unwrap();
}

#[test]
fn exact_volumes_of_stores_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = stored(folder.path());
    assert!(is_store(&path) && is_store(&path.join("deviation")) && !is_store(folder.path()));
    let axis = Some([0.0, 0.6, 0.8]);
    assert_eq!(super::volume(&path).unwrap(), arrays(&volume(0.1), axis));
    assert_eq!(super::volume(&path.join("deviation")).unwrap(), arrays(&volume(0.7), axis));
    // Once more in its place: the same bytes, and nothing beside.
    let bytes = |path: &Path| -> Vec<_> {
        files(path).unwrap().into_iter().map(|f| (std::fs::read(&f).unwrap(), f)).collect()
    };
    let before = bytes(&path);
    assert_eq!(before.len(), 1 + 3 * 2 + 2 * 3);
    stored(folder.path());
    assert!(before == bytes(&path));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// Whole numbers and chunks that hold two frames and cut images; a group with other arrays; one image.
#[test]
fn exact_movies_of_stores_are_read_chunk_by_chunk() {
    let folder = tempfile::tempdir().unwrap();
    let values: Vec<u16> = (0..5 * 3 * 4).collect();
    let kind = || (DataType::UInt16, 0u16.into());
    let path = folder.path().join("m.zarr");
    written(&path, (&[5, 3, 4], &[2, 3, 3]), kind(), &values);
    let (frames, size) = movie(&path).unwrap();
    assert_eq!((size, frames.count()), ([4, 3], 5));
    let expected: Vec<f64> = values.iter().map(|x| f64::from(*x)).collect();
    assert_eq!(frames.to_vec().unwrap(), expected);
    let path = folder.path().join("one.zarr");
    written(&path, (&[3, 4], &[2, 2]), kind(), &values[..12]);
    let (frames, size) = movie(&path).unwrap();
    assert_eq!((size, frames.to_vec().unwrap()), ([4, 3], expected[..12].to_vec()));
}

#[test]
fn wrong_stores_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let of = |path: &Path| format!("{:#}", super::volume(path).unwrap_err());
    let empty = at.join("empty.zarr");
    std::fs::create_dir(&empty).unwrap();
    assert!(of(&empty).contains("empty.zarr: holds no zarr.json"), "{}", of(&empty));
    let path = stored(at);
    let chunk = path.join("emission/c/1/0/0");
    let whole = std::fs::read(&chunk).unwrap();
    std::fs::write(&chunk, &whole[..whole.len() / 2]).unwrap();
    assert!(of(&path).contains("array emission is damaged: "), "{}", of(&path));
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 1;
    std::fs::write(&chunk, &flipped).unwrap();
    assert!(of(&path).contains("array emission is damaged: "), "{}", of(&path));
    std::fs::remove_file(&chunk).unwrap();
    let lost = "array emission: value NaN of node (64, 0, 0) is not finite in 32 bits";
    assert!(of(&path).ends_with(lost), "{}", of(&path));
    let said = format!("{:#}", movie(&path).unwrap_err());
    assert!(said.contains("an array named movie, image or recovered is expected"), "{said}");
    std::fs::write(path.join("emission/zarr.json"), "{\"zarr_format\": 3").unwrap();
    assert!(of(&path).contains("damaged"), "{}", of(&path));
    std::fs::remove_dir_all(path.join("emission")).unwrap();
    assert!(of(&path).contains("holds deviation, x, y, z: no array named emission"));
    let coordinates = path.join("x");
    std::fs::remove_dir_all(&coordinates).unwrap();
    let uneven: Vec<f64> = (0..70).map(|k| f64::from(k * k)).collect();
    written(&coordinates, (&[70], &[70]), (DataType::Float64, ZARR_NAN_F64.into()), &uneven);
    let said = of(&path.join("deviation"));
    assert!(said.contains("array x: coordinate 1 of node 1 is not allowed: equal dist"), "{said}");
}

/// What zarr-python 3 writes by default, a shard of chunks, and what it says that we do not read.
#[test]
fn code_stores_of_zarr_python_are_read() {
    let at = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/reference/zarr_python");
    let (frames, size) = movie(&at.join("movie.zarr")).unwrap();
    assert_eq!((frames.count(), size), (3, [4, 2]));
    let expected: Vec<f64> = (0..24).map(|k| f64::from(k) / 8.0).collect();
    assert_eq!(frames.to_vec().unwrap(), expected);
    let (shards, _) = movie(&at.join("movie.zarr/shards")).unwrap();
    assert_eq!(shards.to_vec().unwrap(), expected.iter().map(|x| 8.0 * x).collect::<Vec<_>>());
    let said = format!("{:#}", movie(&at.join("movie.zarr/blosc")).unwrap_err());
    assert!(said.contains("array blosc: damaged or unusual: ") && said.contains("codec"), "{said}");
}

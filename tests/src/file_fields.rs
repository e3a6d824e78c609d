//! Fields of files: the same numbers however a file writes them, and none that a file does not tell.

use crate::support::{fail_with, new_folder, succeed, words_of};
use std::io::Write;
use std::path::Path;

/// An array of numpy's format 1.0.
pub fn npy(kind: &str, order: &str, shape: &str, bytes: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': {kind}, 'fortran_order': {order}, 'shape': {shape}, }}");
    let header = format!("{header:<117}\n");
    [b"\x93NUMPY\x01\x00\x76\x00", header.as_bytes(), bytes].concat()
}

fn archive(path: &Path, arrays: &[(&str, &[u8])]) {
    let mut archive = zip::ZipWriter::new(std::fs::File::create(path).unwrap());
    for (name, bytes) in arrays {
        archive.start_file(*name, zip::write::SimpleFileOptions::default()).unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap();
}

const SEEN: &str =
    "--array EHT2017 --source m87 --mjd 57854 --utc 3-4 --frames 1 --tint 10 --transform direct";

/// Pixels of an image of 4², in an order.
fn bytes(number: &dyn Fn(f64) -> Vec<u8>, order: &dyn Fn(usize) -> usize) -> Vec<u8> {
    (0..16).flat_map(|k| number(1.0 + (order(k) * order(k) % 7) as f64)).collect()
}

fn rows(k: usize) -> usize {
    k
}

fn columns(k: usize) -> usize {
    4 * (k % 4) + k / 4
}

fn little(number: f64) -> Vec<u8> {
    number.to_le_bytes().to_vec()
}

/// An image, its rows from the north, as every kind of array.
#[test]
fn exact_fields_of_numpy_images() {
    let at = &new_folder();
    let plain = npy("'<f8'", "False", "(4, 4)", &bytes(&little, &rows));
    let seen = |name: &str, field: &str| {
        let words = format!("observe {name} {field} {SEEN} -o -");
        succeed(at, &words_of(&words))
    };
    std::fs::write(at.join("plain.npy"), &plain).unwrap();
    let expected = seen("plain.npy", "--fov-uas 60");
    assert!(expected.lines().count() > 5, "{expected}");
    for (name, array) in [
        ("fortran", npy("'<f8'", "True", "(4, 4)", &bytes(&little, &columns))),
        ("big", npy("'>f8'", "False", "(4, 4)", &bytes(&|n| n.to_be_bytes().into(), &rows))),
        (
            "single",
            npy("'<f4'", "False", "(4, 4)", &bytes(&|n| (n as f32).to_le_bytes().into(), &rows)),
        ),
        (
            "whole",
            npy("'>i2'", "False", "(4, 4)", &bytes(&|n| (n as i16).to_be_bytes().into(), &rows)),
        ),
        ("bytes", npy("'|u1'", "False", "(4, 4)", &bytes(&|n| vec![n as u8], &rows))),
        ("movie", npy("'<f8'", "False", "(1, 4, 4)", &bytes(&little, &rows))),
    ] {
        let name = format!("{name}.npy");
        std::fs::write(at.join(&name), array).unwrap();
        assert_eq!(seen(&name, "--fov-uas 60"), expected, "{name}");
    }
    let field = npy("'<f8'", "False", "()", &60_f64.to_le_bytes());
    let half = npy("'<f8'", "False", "()", &30_f64.to_le_bytes());
    archive(&at.join("a.npz"), &[("image.npy", &plain), ("field_uas.npy", &field)]);
    assert_eq!(seen("a.npz", ""), expected);
    archive(&at.join("b.npz"), &[("image.npy", &plain), ("field_uas.npy", &half)]);
    assert_eq!(seen("b.npz", "--fov-uas 60"), expected);
    assert_ne!(seen("b.npz", ""), expected);
}

#[test]
fn exact_numpy_files_that_are_no_image_are_refused() {
    let at = &new_folder();
    let plain = npy("'<f8'", "False", "(4, 4)", &bytes(&little, &rows));
    archive(&at.join("two.npz"), &[("one.npy", &plain), ("other.npy", &plain)]);
    let two = [60_f64, 30.0].iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    let fields = npy("'<f8'", "False", "(2,)", &two);
    archive(&at.join("fields.npz"), &[("image.npy", &plain), ("field_uas.npy", &fields)]);
    let pair = |n: f64| [n, 0.0].iter().flat_map(|n| n.to_le_bytes()).collect();
    let nan = |n: f64| if n == 5.0 { f64::NAN } else { n }.to_le_bytes().into();
    for (name, array, said) in [
        ("complex", npy("'<c16'", "False", "(4, 4)", &bytes(&pair, &rows)), "c16"),
        ("records", npy("[('x', '<f8')]", "False", "(4, 4)", &bytes(&little, &rows)), "x"),
        ("flat", npy("'<f8'", "False", "(16,)", &bytes(&little, &rows)), "16"),
        ("nan", npy("'<f8'", "False", "(4, 4)", &bytes(&nan, &rows)), "NaN"),
        ("short", plain[..plain.len() - 8].to_vec(), "short.npy"),
        ("two.npz", Vec::new(), "other"),
        ("fields.npz", Vec::new(), "field_uas.npy: 2 numbers"),
    ] {
        let name = if name.contains('.') { name.to_owned() } else { format!("{name}.npy") };
        if name.ends_with(".npy") {
            std::fs::write(at.join(&name), array).unwrap();
        }
        let words = format!("observe {name} --fov-uas 60 {SEEN} -o -");
        fail_with(at, &words_of(&words), &[&name, said]);
    }
}

#[test]
fn exact_columns_of_rays() {
    let at = &new_folder();
    let write = |text: &str| std::fs::write(at.join("rays.csv"), text).unwrap();
    let words = ["trace", "--rays", "rays.csv"];
    write("spin,inclination_deg,alpha,beta\n0.5,60,3,2\n");
    let expected = succeed(at, &words);
    write("\u{feff}# a comment\nbeta,note,alpha,spin,inclination_deg\n\n2,far,3,0.5,60\n");
    assert_eq!(succeed(at, &words), expected);
    for (text, said) in [
        ("spin,inclination_deg,inclination_rad,alpha,beta\n0.5,60,1,3,2\n", "both"),
        ("spin,inclination_deg,alpha,alpha,beta\n0.5,60,3,3,2\n", "`alpha` appears twice"),
        ("spin,inclination_deg,alpha,beta\n0.5,60,3,2,1\n", "line 2: 5 fields"),
        ("spin,inclination_deg,alpha,beta\n0.5,60,3,2\n0.5,60,3,nan\n", "line 3: beta = NaN"),
        ("spin,inclination_deg,alpha\n0.5,60,3\n", "`beta` is missing"),
    ] {
        write(text);
        fail_with(at, &words, &["rays.csv: ", said]);
    }
}

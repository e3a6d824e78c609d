use super::*;

const OBJ: &str = "mtllib paint.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl lamp
f 1/1 2/2 3/3 4/4
";

const MTL: &str = "newmtl lamp\nKd 0.1 0.2 0.3\nKe 2 1 0\n";

fn none(name: &str) -> Result<Option<Vec<u8>>, String> {
    Err(format!("no {name} here"))
}

/// Bytes of the files of these names.
fn files<'a>(
    list: &'a [(&'a str, &'a [u8])],
) -> impl Fn(&str) -> Result<Option<Vec<u8>>, String> + 'a {
    |name| Ok(list.iter().find(|(own, _)| *own == name).map(|(_, bytes)| bytes.to_vec()))
}

fn scene_mesh(color: Option<[f32; 3]>) -> Mesh {
    Mesh {
        path: String::new(),
        scale: 2.0,
        position: [10.0, 0.0, 0.0],
        rotation_axis: [0.0, 0.0, 3.0],
        rotation_deg: 90.0,
        opaque: true,
        brightness: 0.5,
        color,
        velocity: None,
    }
}

#[test]
fn exact_obj_with_material_in_its_place() {
    let file = MeshFile::decode(OBJ.as_bytes(), &files(&[("paint.mtl", MTL.as_bytes())])).unwrap();
    assert_eq!(file.triangles.len(), 2);
    let model = MeshModel::new(&scene_mesh(None), &file).unwrap();
    // (1, 0, 0) becomes twice as long, points to +y, and is moved by 10 along x.
    let [_, second, _] = model.triangles[0].corners;
    assert!((0..3).all(|k| (second[k] - [10.0, 2.0, 0.0][k]).abs() < 1e-14));
    let (intensity, color) = model.light(&model.triangles[0], [9.5, 0.5, 0.0]);
    assert_eq!((intensity, color), (1.0, [1.0, 0.5, 0.0]));
    let painted = MeshModel::new(&scene_mesh(Some([0.0, 0.0, 1.0])), &file).unwrap();
    assert_eq!(painted.light(&painted.triangles[0], [0.0; 3]), (0.5, [0.0, 0.0, 1.0]));
}

const BASE64: &str = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"; // (0,0,0) (1,0,0) (0,1,0)

/// A file of one triangle, which says that its buffer has this length.
fn gltf(length: usize) -> String {
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
        "nodes":[{{"mesh":0,"translation":[0,0,5]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"material":0}}]}}],
        "materials":[{{"emissiveFactor":[0.5,0.5,0.25]}}],
        "buffers":[{{"uri":"data:application/octet-stream;base64,{BASE64}","byteLength":{length}}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}}]}}"#
    )
}

/// The file with `to` in place of `from`.
fn changed(from: &str, to: &str) -> Result<MeshFile, Error> {
    let text = gltf(36).replace(from, to);
    assert!(text != gltf(36), "{from}");
    MeshFile::decode(text.as_bytes(), &none)
}

/// Files that would break the crate's readers are refused first.
#[test]
fn exact_gltf_against_its_specification_says_why() {
    let with = |from: &str, to: &str| changed(from, to).unwrap_err().to_string();
    assert!(with("2.0", "3.0").contains("version \"3.0\" of glTF is not read"));
    let turned = |x: &str| with("\"translation\"", &format!("\"rotation\":[{x}],\"translation\""));
    assert!(turned("0,0,0,0").contains("node 0 (counted from 0): rotation of length 0: 1"));
    assert!(turned("0,0,2,0").contains("rotation of length 2"));
    let child = r#""mesh":0,"children":[0]"#;
    assert!(with(r#""mesh":0"#, child).contains("the child of another node or of itself"));
    let nodes = r#"{"children":[1,1]},{"mesh":0}],"meshes""#;
    assert!(
        with("{\"mesh\":0,\"translation\":[0,0,5]}],\n        \"meshes\"", nodes)
            .contains("two parents")
    );
    for images in ["{}", r#"{"bufferView":0}"#] {
        let error = with(r#""accessors""#, &format!(r#""images":[{images}],"accessors""#));
        assert!(error.contains("image 0 (counted from 0) has neither"), "{error}");
    }
    assert!(with(r#""POSITION":0"#, r#""POSITION":0,"TEXCOORD_0":0"#).contains("Vec2 of [F32"));
    assert!(with(r#""material":0"#, r#""material":0,"indices":0"#).contains("Scalar of [U8"));
    let sparse = r#""count":3,"sparse":{"count":2,"indices":{"bufferView":0,"componentType":5125},"values":{"bufferView":0,"byteOffset":24}}"#;
    assert!(with(r#""count":3"#, sparse).contains("sparse accessor 0"));
    // The bytes of a 1.0 in front of the values are no index of a point.
    let one = r#""count":3,"sparse":{"count":1,"indices":{"bufferView":0,"byteOffset":12,"componentType":5125},"values":{"bufferView":0,"byteOffset":24}}"#;
    let said = with(r#""count":3"#, one);
    assert!(
        said.contains("sparse accessor 0 (counted from 0) replaces point 1065353216 of 3"),
        "{said}"
    );
    assert!(
        with(r#""version":"2.0""#, r#""version":"2.0","minVersion":"2.1""#).contains("\"2.1\"")
    );
    let matrix = |last: &str, more: &str| {
        with(
            r#""translation":[0,0,5]"#,
            &format!(r#""matrix":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,5,{last}]{more}"#),
        )
    };
    assert!(matrix("2", "").contains("last row of [0.0, 0.0, 0.0, 2.0]"));
    assert!(matrix("1", r#","scale":[1,1,1]"#).contains("has a matrix as well as"));
}

/// A triangle in a buffer inside the text, raised by its node, half as bright as white.
#[test]
fn exact_gltf_with_embedded_buffer() {
    let file = MeshFile::decode(gltf(36).as_bytes(), &none).unwrap();
    assert_eq!(file.triangles[0].corners, [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0]]);
    let model = MeshModel::new(&scene_mesh(None), &file).unwrap();
    assert_eq!(model.light(&model.triangles[0], [0.0; 3]), (0.25, [1.0, 1.0, 0.5]));
    assert!(MeshFile::decode(gltf(400).as_bytes(), &none).is_err());
    let error = changed("\"count\":3", "\"count\":4").unwrap_err().to_string();
    assert!(error.contains("beyond its buffer"), "{error}");
    let inside = format!("data:application/octet-stream;base64,{BASE64}");
    let error = changed(&inside, "a.bin").unwrap_err().to_string();
    assert!(error.contains("`a.bin`") && error.contains("no a.bin here"), "{error}");
}

#[test]
fn files_that_are_no_meshes_say_why() {
    let error = |bytes: &[u8]| MeshFile::decode(bytes, &none).unwrap_err().to_string();
    assert!(error(OBJ.as_bytes()).contains("`paint.mtl`"));
    assert!(error(b"v 0 0 0\n").contains("no triangles"));
    assert!(error(b"v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n").contains("not a finite number"));
    assert_eq!(
        error(b"v 0 0 0\nf 1 2 3\n"),
        "line 2: vertex 2 of a face is not allowed: 1 to 1, or -1 to -1"
    );
    let wraps = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//-6148914691236517207 2//1 3//1\n";
    assert!(error(wraps).starts_with("line 5: normal -6148914691236517207"));
    assert!(error(b"glTF\x02\0\0\0").contains("glTF"));
    assert!(error(b"{\"asset\":").contains("glTF"));
    assert!(error(&[0xff, 0xfe, 0x00]).contains("OBJ"));
    assert!(error(b"").contains("no triangles"));
}

/// A picture of two columns, dark and light.
fn columns() -> Vec<u8> {
    let mut picture = image::RgbImage::new(2, 1);
    picture.put_pixel(1, 0, image::Rgb([255, 255, 255]));
    let mut png = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut png, image::ImageFormat::Png).unwrap();
    png.into_inner()
}

/// The left half of a surface is dark, the right one light.
#[test]
fn exact_textures_by_coordinates() {
    let (library, png) = (b"newmtl lamp\nmap_Ke columns.png\n", columns());
    let beside = [("paint.mtl", &library[..]), ("columns.png", &png[..])];
    let file = MeshFile::decode(OBJ.as_bytes(), &files(&beside)).unwrap();
    let flat = Mesh { scale: 1.0, position: [0.0; 3], rotation_deg: 0.0, ..scene_mesh(None) };
    let model = MeshModel::new(&flat, &file).unwrap();
    let light = |x, y| {
        let holding = model.triangles.iter().find(|t| t.holds([x, y, 0.0], 0.0)).unwrap();
        model.light(holding, [x, y, 0.0]).0
    };
    assert!(light(0.25, 0.1) < 1e-6 && light(0.25, 0.8) < 1e-6);
    assert!((light(0.75, 0.1) - 0.5).abs() < 1e-6 && (light(0.75, 0.9) - 0.5).abs() < 1e-6);
}

fn error(bytes: &[u8], beside: &[(&str, &[u8])]) -> String {
    MeshFile::decode(bytes, &files(beside)).unwrap_err().to_string()
}

#[test]
fn exact_colours_have_one_number_or_three() {
    let obj = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n";
    let said = error(obj, &[("a.mtl", b"newmtl a\nKe 1 2\n")]);
    assert!(said.contains("Ke: one number or three are expected"), "{said}");
}

/// Continued lines, a byte order mark, Windows' ends of lines, indices from behind.
#[test]
fn exact_lines_of_obj_as_other_programs_write_them() {
    let plain =
        MeshFile::decode(b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n", &none).unwrap();
    let odd = "\u{feff}v 0 0 0\r\nv 1 \\\r\n 0 0 # corner\r\nv 1 1 0 1.0\r\nv 0 1 0\r\nf -4 2 \\\r\n-2 4\r\n";
    let odd = MeshFile::decode(odd.as_bytes(), &none).unwrap();
    assert_eq!(odd.triangles, plain.triangles);
    assert!(odd.warnings.is_empty() && plain.warnings.is_empty());
    let told = b"v 0 0 0 1 0 0\nv 1 0 0\nv 1 1 0\nwhat is this\nusemtl x\nf 1 2 3\nmtllib no.mtl\n";
    let told = MeshFile::decode(told, &files(&[])).unwrap();
    let all = told.warnings.join("\n");
    for part in ["there is no `no.mtl`", "colours of vertices", "line 4, `what`"] {
        assert!(all.contains(part), "{all}");
    }
}

#[test]
fn exact_statements_of_obj_that_are_not_read_say_where() {
    let start = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    for (line, said) in [
        ("surf 0 1 0 1 1 2 3", "line 4: `surf` is not read"),
        ("f 1 2", "line 4: a face of 2 corners"),
        ("f 1 2 0", "line 4: vertex 0 of a face is not allowed: 1 to 3"),
        ("f 1 2 3/1", "line 4: texture coordinate 1 of a face"),
        ("f 1 2 99999999999999999999", "line 4: vertex 99999999999999999999"),
        ("f 1 2 3/1/1/1", "line 4: texture coordinate 1"),
        ("v 1 2", "line 4: 2 coordinates: 3 to 7 are allowed"),
        ("v 1 2 3 2", "line 4: the weight 2 of a vertex"),
        ("v 1 2 three", "line 4: coordinates: `three` is no number"),
        ("v 1 1 0\nf 1 4 2 3", "line 5: the outline of the polygon crosses itself"),
    ] {
        let found = error(format!("{start}{line}\n").as_bytes(), &[]);
        assert!(found.starts_with(said), "{found}");
    }
    let library = |text: &str| error(OBJ.as_bytes(), &[("paint.mtl", text.as_bytes())]);
    assert!(
        library("newmtl a\nKd spectral x.rfl\n")
            .contains("`paint.mtl`, to which it refers: line 2: Kd spectral")
    );
    for (text, said) in [
        ("newmtl a\nKe 1 0 0\nnewmtl a\nKe 0 1 0\n", "line 3: a second material is named `a`"),
        ("newmtl a\nKe 1 0 0\nke 0 1 0\n", "line 3: a second ke of one material"),
        ("Ke 1 0 0\nnewmtl a\n", "line 1: Ke before newmtl"),
    ] {
        assert!(library(text).contains(said), "{}", library(text));
    }
    assert!(library("newmtl a\nmap_Kd -mm 0 2 x.png\n").contains("option -mm 0 2 is not read"));
    assert!(library("newmtl a\nmap_Kd no.png\n").contains("`no.png`, to which it refers"));
    assert!(error(b"ply\nformat ascii 1.0\n", &[]).contains("PLY files are not read"));
}

/// Options -s and -o of a texture scale and move coordinates whose v grows upwards.
#[test]
fn exact_scale_and_offset_of_textures() {
    let png = columns();
    let shade = |options: &str, u: f64| {
        let library = format!("newmtl lamp\nmap_Kd {options}a b.png\n");
        let beside = [("paint.mtl", library.as_bytes()), ("a b.png", &png[..])];
        let file = MeshFile::decode(OBJ.as_bytes(), &files(&beside)).unwrap();
        file.materials[0].base.at(|| [u as f32, 0.5])[0]
    };
    assert!(shade("", 0.25) < 1e-6 && shade("", 0.75) > 1.0 - 1e-6);
    assert!(shade("-s 2 ", 0.375) > 1.0 - 1e-6 && shade("-s 2 1 1 -blendu on ", 0.625) < 1e-6);
    assert!(shade("-o 0.5 0 0 ", 0.25) > 1.0 - 1e-6);
}

/// Textures of glTF have the wrap modes of their samplers and KHR_texture_transform; names may have
/// escapes.
#[test]
fn exact_textures_of_gltf() {
    let png = columns();
    let shade = |sampler: &str, transform: &str, u: f32| {
        let info =
            format!(r#"{{"index":0,"extensions":{{"KHR_texture_transform":{{{transform}}}}}}}"#);
        let material = format!(r#""emissiveFactor":[1,1,1],"emissiveTexture":{info}"#);
        let text = gltf(36).replace(r#""emissiveFactor":[0.5,0.5,0.25]"#, &material).replace(
            r#""accessors""#,
            &format!(
                r#""extensionsUsed":["KHR_texture_transform"],"samplers":[{{{sampler}}}],
                "textures":[{{"source":0,"sampler":0}}],"images":[{{"uri":"a%20b.png"}}],"accessors""#
            ),
        );
        let file = MeshFile::decode(text.as_bytes(), &files(&[("a b.png", &png)])).unwrap();
        assert!(file.warnings.is_empty(), "{:?}", file.warnings);
        file.materials[0].emission.at(|| [u, 0.5])[0]
    };
    let near = |found: f32, expected: f32| assert!((found - expected).abs() < 1e-6, "{found}");
    near(shade("", "", 1.25), 0.0);
    near(shade(r#""wrapS":33648"#, "", 1.25), 1.0);
    near(shade(r#""wrapS":33071"#, "", 1.25), 1.0);
    near(shade("", r#""offset":[0.5,0]"#, 1.25), 1.0);
    near(shade("", r#""scale":[3,1]"#, 0.25), 1.0);
    // The extension's own example: the lower left quarter, where u is half of v.
    let quarter = r#""offset":[0,1],"rotation":1.57079632679,"scale":[0.5,0.5]"#;
    near(shade("", quarter, 0.3), 0.0);
    // By 180 degrees: u becomes -u.
    near(shade("", r#""rotation":3.14159265"#, 0.25), 1.0);
}

#[test]
fn exact_what_gltf_moves_is_refused_and_the_rest_told() {
    let primitive = r#"[{"primitives":[{"attributes":{"POSITION":0},"material":0}]"#;
    let morph = r#"[{"primitives":[{"attributes":{"POSITION":0},"targets":[{"POSITION":0}],"material":0}],"weights":[0.5]"#;
    let said = changed(primitive, morph).unwrap_err().to_string();
    assert!(said.contains("node 0 (counted from 0) has morph targets"), "{said}");
    assert!(changed(primitive, &morph.replace("0.5", "0")).is_ok());
    let skin = changed(r#"{"mesh":0"#, r#"{"skin":0,"mesh":0"#);
    assert!(skin.is_err(), "a skin that is not there");
    let skinned = gltf(36)
        .replace(r#"{"mesh":0"#, r#"{"skin":0,"mesh":0"#)
        .replace(r#""materials""#, r#""skins":[{"joints":[0]}],"materials""#);
    let said = MeshFile::decode(skinned.as_bytes(), &none).unwrap_err().to_string();
    assert!(said.contains("has a skin, which is not read"), "{said}");
    let clear = changed(r#""emissiveFactor""#, r#""alphaMode":"BLEND","emissiveFactor""#).unwrap();
    assert!(clear.warnings[0].contains("transparent materials"), "{:?}", clear.warnings);
    let used =
        changed(r#""accessors""#, r#""extensionsUsed":["EXT_mesh_gpu_instancing"],"accessors""#);
    assert_eq!(used.unwrap().warnings, ["extension EXT_mesh_gpu_instancing is not read"]);
}

/// Files cut short or with a byte changed give a mesh or an error, never a panic.
#[test]
fn regress_damaged_files_are_refused() {
    let mtl = "newmtl lamp\nKd 0.1 0.2 0.3\nmap_Kd -s 1 1 1 -o 2 x.png\nKe 2 1 0\n";
    let bent = "v 0 0 0\nv 9 0 1\nv 9 9 0\nv 4 1 \\\n 0\nv 0 9 0 1\nvt 0\nf -1 -2//  3 4/1 5\n";
    for text in [OBJ, mtl, bent, &gltf(36)] {
        for at in 0..text.len() {
            for byte in [None, Some(b'-'), Some(b'9'), Some(b' '), Some(b'/'), Some(0xff)] {
                let mut bytes = text.as_bytes().to_vec();
                match byte {
                    None => bytes.truncate(at),
                    Some(byte) => bytes[at] = byte,
                }
                let _ = MeshFile::decode(&bytes, &files(&[("paint.mtl", MTL.as_bytes())]));
                let _ = MeshFile::decode(OBJ.as_bytes(), &files(&[("paint.mtl", &bytes)]));
            }
        }
    }
}

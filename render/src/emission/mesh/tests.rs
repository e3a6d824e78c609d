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

fn none(name: &str) -> Result<Vec<u8>, String> {
    Err(format!("no {name} here"))
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
    let file = MeshFile::decode(OBJ.as_bytes(), &|name| {
        assert_eq!(name, "paint.mtl");
        Ok(MTL.as_bytes().to_vec())
    })
    .unwrap();
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

/// What the crate's readers take for granted is looked at before.
#[test]
fn exact_gltf_against_its_specification_says_why() {
    let with = |from: &str, to: &str| {
        let text = gltf(36).replace(from, to);
        assert!(text != gltf(36), "{from}");
        MeshFile::decode(text.as_bytes(), &none).unwrap_err().to_string()
    };
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
}

/// A triangle in a buffer inside the text, raised by its node, half as bright as white.
#[test]
fn exact_gltf_with_embedded_buffer() {
    let file = MeshFile::decode(gltf(36).as_bytes(), &none).unwrap();
    assert_eq!(file.triangles[0].corners, [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 1.0, 5.0]]);
    let model = MeshModel::new(&scene_mesh(None), &file).unwrap();
    assert_eq!(model.light(&model.triangles[0], [0.0; 3]), (0.25, [1.0, 1.0, 0.5]));
    assert!(MeshFile::decode(gltf(400).as_bytes(), &none).is_err());
    let beyond = gltf(36).replace("\"count\":3", "\"count\":4");
    let error = MeshFile::decode(beyond.as_bytes(), &none).unwrap_err().to_string();
    assert!(error.contains("beyond its buffer"), "{error}");
    let outside =
        gltf(36).replace(&format!("data:application/octet-stream;base64,{BASE64}"), "a.bin");
    let error = MeshFile::decode(outside.as_bytes(), &none).unwrap_err().to_string();
    assert!(error.contains("`a.bin`") && error.contains("no a.bin here"), "{error}");
}

#[test]
fn files_that_are_no_meshes_say_why() {
    let error = |bytes: &[u8]| MeshFile::decode(bytes, &none).unwrap_err().to_string();
    assert!(error(OBJ.as_bytes()).contains("`paint.mtl`"));
    assert!(error(b"v 0 0 0\n").contains("no triangles"));
    assert!(error(b"v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n").contains("not a finite number"));
    assert!(error(b"v 0 0 0\nf 1 2 3\n").contains("OBJ"));
    let wraps = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//-6148914691236517207 2//1 3//1\n";
    assert!(error(wraps).contains("line 5: the number of a vertex"));
    assert!(error(b"glTF\x02\0\0\0").contains("glTF"));
    assert!(error(b"{\"asset\":").contains("glTF"));
    assert!(error(&[0xff, 0xfe, 0x00]).contains("OBJ"));
    assert!(error(b"").contains("no triangles"));
}

/// A picture of two columns: the left half of a surface is dark, the right one light.
#[test]
fn exact_textures_by_coordinates() {
    let mut picture = image::RgbImage::new(2, 1);
    picture.put_pixel(1, 0, image::Rgb([255, 255, 255]));
    let mut png = Vec::new();
    let mut cursor = std::io::Cursor::new(&mut png);
    picture.write_to(&mut cursor, image::ImageFormat::Png).unwrap();
    let file = MeshFile::decode(OBJ.as_bytes(), &|name| match name {
        "paint.mtl" => Ok(b"newmtl lamp\nmap_Ke columns.png\n".to_vec()),
        _ => Ok(png.clone()),
    })
    .unwrap();
    let flat = Mesh { scale: 1.0, position: [0.0; 3], rotation_deg: 0.0, ..scene_mesh(None) };
    let model = MeshModel::new(&flat, &file).unwrap();
    let light = |x, y| {
        let holding = model.triangles.iter().find(|t| t.holds([x, y, 0.0], 0.0)).unwrap();
        model.light(holding, [x, y, 0.0]).0
    };
    assert!(light(0.25, 0.1) < 1e-6 && light(0.25, 0.8) < 1e-6);
    assert!((light(0.75, 0.1) - 0.5).abs() < 1e-6 && (light(0.75, 0.9) - 0.5).abs() < 1e-6);
}

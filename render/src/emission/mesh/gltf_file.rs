//! glTF 2.0, as text or binary, in the state of rest that its nodes describe.

use super::file::{Layer, Material, MeshFile, RawTriangle, Resources, needed, resource};
use super::texture::{Placement, Texture, Wrap};
use super::{MeshError, gltf_checks, gltf_unread};
use gltf::mesh::Mode;
use gltf::texture::WrappingMode;

type Matrix = [[f64; 4]; 4];

pub(super) fn decode(bytes: &[u8], resources: &Resources<'_>) -> Result<MeshFile, MeshError> {
    gltf_checks::check_positions(&gltf::Gltf::from_slice_without_validation(bytes)?.document)?;
    let gltf::Gltf { document, mut blob } = gltf::Gltf::from_slice(bytes)?;
    let buffers = document
        .buffers()
        .map(|buffer| {
            let bytes = match buffer.source() {
                gltf::buffer::Source::Uri(uri) if !uri.starts_with("data:") => {
                    beside(resources, uri)?
                }
                source => gltf::buffer::Data::from_source_and_blob(source, None, &mut blob)?.0,
            };
            if bytes.len() < buffer.length() {
                let (index, expected, actual) = (buffer.index(), buffer.length(), bytes.len());
                return Err(gltf::Error::BufferLength { buffer: index, expected, actual }.into());
            }
            Ok(bytes)
        })
        .collect::<Result<Vec<_>, MeshError>>()?;
    gltf_checks::check(&document, &buffers)?;
    let materials = document
        .materials()
        .map(|m| material(&m, &buffers, resources))
        .collect::<Result<_, _>>()?;
    let mut file = MeshFile { materials, ..MeshFile::default() };
    file.warnings = gltf_unread::of(&document);
    let scene = document.default_scene().or_else(|| document.scenes().next());
    let Some(scene) = scene else {
        return Err(MeshError::Content("it holds no scene".to_owned()));
    };
    let mut nodes: Vec<_> = scene.nodes().map(|node| (node, IDENTITY)).collect();
    // Nodes are taken from the end: reversed, triangles keep the order of the file.
    nodes.reverse();
    while let Some((node, parent)) = nodes.pop() {
        let own = node.transform().matrix().map(|column| column.map(f64::from));
        let matrix = product(parent, own);
        gltf_unread::refuse(&node)?;
        for primitive in node.mesh().iter().flat_map(|mesh| mesh.primitives()) {
            add_primitive(&primitive, matrix, &buffers, &mut file)?;
        }
        let children: Vec<_> = node.children().map(|child| (child, matrix)).collect();
        nodes.extend(children.into_iter().rev());
    }
    Ok(file)
}

const IDENTITY: Matrix =
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

fn product(a: Matrix, b: Matrix) -> Matrix {
    // Column-major, as in the file.
    core::array::from_fn(|c| core::array::from_fn(|r| (0..4).map(|k| a[k][r] * b[c][k]).sum()))
}

fn add_primitive(
    primitive: &gltf::Primitive<'_>,
    matrix: Matrix,
    buffers: &[Vec<u8>],
    file: &mut MeshFile,
) -> Result<(), MeshError> {
    let fail = |why: &str| Err(MeshError::Content(why.to_owned()));
    match primitive.mode() {
        Mode::Triangles => {}
        Mode::TriangleStrip | Mode::TriangleFan => {
            return fail("strips and fans of triangles are not read: export plain triangles");
        }
        _ => return Ok(()), // points and lines have no surface
    }
    let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(Vec::as_slice));
    let Some(positions) = reader.read_positions() else {
        return fail("a primitive has no positions");
    };
    let place = |p: [f32; 3]| {
        let [x, y, z] = p.map(f64::from);
        core::array::from_fn(|r| {
            matrix[0][r] * x + matrix[1][r] * y + matrix[2][r] * z + matrix[3][r]
        })
    };
    let positions: Vec<[f64; 3]> = positions.map(place).collect();
    let texture: Vec<[f32; 2]> =
        reader.read_tex_coords(0).map_or_else(Vec::new, |t| t.into_f32().collect());
    let indices: Vec<u32> = match reader.read_indices() {
        Some(indices) => indices.into_u32().collect(),
        None => (0..positions.len() as u32).collect(),
    };
    if !indices.len().is_multiple_of(3) {
        return fail("a primitive has indices that are no whole number of triangles");
    }
    file.affords(indices.len() / 3)?;
    let material = primitive.material().index().map_or(u32::MAX, |k| k as u32);
    for corners in indices.chunks_exact(3) {
        let corners = [corners[0], corners[1], corners[2]].map(|k| k as usize);
        if corners.iter().any(|k| *k >= positions.len()) {
            return fail("an index points behind the last vertex");
        }
        let at = |k: usize| texture.get(k).copied().unwrap_or([0.0; 2]);
        file.triangles.push(RawTriangle {
            corners: corners.map(|k| positions[k]),
            texture: corners.map(at),
            material,
        });
    }
    Ok(())
}

fn material(
    material: &gltf::Material<'_>,
    buffers: &[Vec<u8>],
    resources: &Resources<'_>,
) -> Result<Material, MeshError> {
    let strength = material.emissive_strength().unwrap_or(1.0);
    let surface = material.pbr_metallic_roughness();
    let [r, g, b, _] = surface.base_color_factor();
    let picture = |info: Option<gltf::texture::Info<'_>>| {
        info.map(|info| picture(&info, buffers, resources)).transpose()
    };
    Ok(Material {
        emission: Layer {
            color: material.emissive_factor().map(|c| c * strength),
            texture: picture(material.emissive_texture())?,
        },
        base: Layer { color: [r, g, b], texture: picture(surface.base_color_texture())? },
    })
}

/// A file that a URI names (RFC 3986), or one that is named so without its escapes.
fn beside(resources: &Resources<'_>, uri: &str) -> Result<Vec<u8>, MeshError> {
    match unescaped(uri).filter(|name| name != uri) {
        None => needed(resources, uri),
        Some(name) => match resource(resources, &name)? {
            Some(bytes) => Ok(bytes),
            None => needed(resources, uri),
        },
    }
}

/// A URI with its escapes, a percent sign and two hexadecimal digits, replaced; `None` if that is no text.
fn unescaped(uri: &str) -> Option<String> {
    let (mut bytes, mut rest) = (Vec::with_capacity(uri.len()), uri.as_bytes());
    while let [first, after @ ..] = rest {
        let digit = |k: usize| after.get(k).and_then(|c| char::from(*c).to_digit(16));
        let escaped = (*first == b'%').then(|| Some(16 * digit(0)? + digit(1)?)).flatten();
        bytes.push(escaped.map_or(*first, |byte| byte as u8));
        rest = &after[if escaped.is_some() { 2 } else { 0 }..];
    }
    String::from_utf8(bytes).ok()
}

fn picture(
    info: &gltf::texture::Info<'_>,
    buffers: &[Vec<u8>],
    resources: &Resources<'_>,
) -> Result<Texture, MeshError> {
    let transform = info.texture_transform();
    let set = transform.as_ref().and_then(gltf::texture::TextureTransform::tex_coord);
    if set.unwrap_or(info.tex_coord()) != 0 {
        let why = "a texture uses a second set of coordinates, which is not read".to_owned();
        return Err(MeshError::Content(why));
    }
    let texture = match info.texture().source().source() {
        gltf::image::Source::View { view, .. } => {
            let bytes = buffers
                .get(view.buffer().index())
                .and_then(|b| b.get(view.offset()..view.offset() + view.length()));
            Texture::decode(bytes.unwrap_or_default())
        }
        gltf::image::Source::Uri { uri, .. } if uri.starts_with("data:") => {
            let source = gltf::buffer::Source::Uri(uri);
            Texture::decode(&gltf::buffer::Data::from_source(source, None)?.0)
        }
        gltf::image::Source::Uri { uri, .. } => Texture::decode(&beside(resources, uri)?),
    }?;
    let mut placement = transform.map_or_else(Placement::default, |transform| {
        // Offset · rotation · scale of KHR_texture_transform, counterclockwise where v grows downwards.
        let ([sx, sy], [ox, oy]) = (transform.scale(), transform.offset());
        let (sin, cos) = f64::from(transform.rotation()).sin_cos();
        let [sx, sy, ox, oy] = [sx, sy, ox, oy].map(f64::from);
        Placement::affine([[cos * sx, sin * sy, ox], [-sin * sx, cos * sy, oy]])
    });
    let sampler = info.texture().sampler();
    placement.wrap = [sampler.wrap_s(), sampler.wrap_t()].map(|mode| match mode {
        WrappingMode::Repeat => Wrap::Repeat,
        WrappingMode::MirroredRepeat => Wrap::Mirror,
        WrappingMode::ClampToEdge => Wrap::Clamp,
    });
    Ok(texture.placed(placement))
}

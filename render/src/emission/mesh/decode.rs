//! Mesh files of any format.

use super::{MeshFile, Resources, gltf_file, obj_file};
use crate::Error;

impl MeshFile {
    /// Decodes an OBJ, glTF or GLB file; `resources` reads what it refers to.
    ///
    /// # Errors
    /// If the bytes are none of these, if something they refer to cannot be read, if there is no
    /// triangle or a coordinate is no number.
    pub fn decode(bytes: &[u8], resources: &Resources<'_>) -> Result<Self, Error> {
        if bytes.starts_with(b"ply") {
            let why = "PLY files are not read: export it as OBJ, glTF or GLB".to_owned();
            return Err(super::MeshError::Content(why).into());
        }
        let first = bytes.iter().find(|byte| !byte.is_ascii_whitespace());
        let file = if bytes.starts_with(b"glTF") || first == Some(&b'{') {
            gltf_file::decode(bytes, resources)?
        } else {
            obj_file::decode(bytes, resources)?
        };
        file.check()?;
        Ok(file)
    }
}

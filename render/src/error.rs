//! The error of this crate.

use crate::dynamics::ZeroAxis;
use crate::emission::mesh::MeshError;
use crate::emission::sky::{CatalogueError, PanoramaError};
use crate::image::animation::AnimationError;
use crate::picture::RenderError;
use crate::scene::SceneError;
use crate::volume::VolumeError;
use crate::volume::metrics::Mismatch;
use crate::volume::vti::VtiError;
use kerrlight_common::numpy::NumpyError;
use kerrlight_common::toml_file::shown;
use kerrlight_geodesic::Error as OutOfRange;
use std::borrow::Cow;

/// Reason why a function of this crate refuses its input, or cannot finish.
///
/// The message is complete in itself and names the field, its value and what is allowed; an error in
/// a text or a file also names the line or the byte. Match on a variant to treat one kind in a way of
/// its own; [`field`](Self::field), [`value`](Self::value), [`allowed`](Self::allowed) and
/// [`line`](Self::line) serve whoever marks the place in an editor or a form.
///
/// ```
/// use kerrlight_render::scene::Scene;
///
/// let error = Scene::parse(r#"
///     hole = { spin = 1.5 }
///     observer = { inclination_deg = 60.0 }
///     screen = { field_of_view_m = 30.0, width = 64 }
///     tracer = { integrator = "elliptic", tolerance = 1e-8 }
/// "#).unwrap_err();
/// assert_eq!(error.field(), Some("hole.spin"));
/// assert_eq!(error.value().as_deref(), Some("1.5"));
/// assert_eq!(error.allowed(), Some("-1 to 1 (a/M)"));
/// assert_eq!(error.line(), Some(2));
/// ```
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
#[non_exhaustive]
pub enum Error {
    /// A number outside the range that its definition allows.
    Range(#[from] OutOfRange),
    /// A scene, or an override of one of its keys.
    Scene(#[from] SceneError),
    /// The text of a catalogue of stars.
    Catalogue(#[from] CatalogueError),
    /// The bytes of a mesh.
    Mesh(#[from] MeshError),
    /// The bytes of a sky.
    Panorama(#[from] PanoramaError),
    /// A picture that cannot be rendered, or was stopped.
    Render(#[from] RenderError),
    /// A movie that cannot be encoded.
    Animation(#[from] AnimationError),
    /// A volume of emission.
    Volume(#[from] VolumeError),
    /// Volumes as fields of a VTK file.
    Vti(#[from] VtiError),
    /// Two volumes that do not have the same nodes.
    Mismatch(#[from] Mismatch),
    /// A direction that is none.
    Axis(#[from] ZeroAxis),
    /// The encoder or decoder of OpenEXR.
    Exr(#[from] exr::error::Error),
    /// The encoder or decoder of another image format.
    Image(#[from] image::ImageError),
    /// Memory, or an array of NumPy.
    Common(#[from] kerrlight_common::Error),
    /// Reading or writing.
    Io(#[from] std::io::Error),
}

/// Field, value, allowed range and line, where an error has them.
pub type Parts<'a> = (Option<&'a str>, Option<Cow<'a, str>>, Option<&'a str>, Option<usize>);

impl From<NumpyError> for Error {
    fn from(error: NumpyError) -> Self {
        Self::Common(error.into())
    }
}

impl Error {
    /// States that `field` cannot be `value`, with the allowed range in words.
    pub const fn out_of_range(field: &'static str, value: f64, allowed: &'static str) -> Self {
        Self::Range(OutOfRange::out_of_range(field, value, allowed))
    }

    /// The key or argument at fault, where it is a single one; a dotted path in scenes and settings.
    pub fn field(&self) -> Option<&str> {
        self.parts().0
    }

    /// The value that was given, as text.
    pub fn value(&self) -> Option<Cow<'_, str>> {
        self.parts().1
    }

    /// Returns the allowed values, in words.
    pub fn allowed(&self) -> Option<&str> {
        self.parts().2
    }

    /// The line of the text, counted from 1.
    pub fn line(&self) -> Option<usize> {
        self.parts().3
    }

    /// The same without its line: of a text that nobody sees, such as one that overrides have changed.
    #[must_use]
    pub fn without_line(self) -> Self {
        match self {
            Self::Scene(error) => Self::Scene(error.without_line()),
            other => other,
        }
    }

    /// Field, value, allowed range and line at once.
    pub fn parts(&self) -> Parts<'_> {
        let number = |value: f64| Some(Cow::Owned(shown(value)));
        match self {
            Self::Range(e) | Self::Common(kerrlight_common::Error::Range(e)) => {
                (Some(e.field()), number(e.value()), Some(e.allowed()), None)
            }
            Self::Scene(SceneError::Range { line, key, value, allowed }) => {
                (Some(key), Some(value.into()), Some(allowed), *line)
            }
            Self::Scene(SceneError::Missing { key, .. }) => (Some(key), None, None, None),
            _ => (None, None, None, None),
        }
    }
}

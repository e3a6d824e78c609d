//! The error of this crate.

use crate::dynamics::ZeroAxis;
use crate::emission::mesh::MeshError;
use crate::emission::sky::{CatalogueError, PanoramaError};
use crate::fit::checkpoint::CheckpointError;
use crate::fit::linear::LinearError;
use crate::fit::settings::FitError;
use crate::fit::{DeviceError, Diverged};
use crate::frames::ScratchError;
use crate::image::animation::AnimationError;
use crate::interferometry::array::ArrayError;
use crate::interferometry::data_terms::DataTermError;
use crate::interferometry::earth::EarthError;
use crate::interferometry::files::FileError;
use crate::interferometry::observation::Unknown;
use crate::interferometry::schedule::ScheduleError;
use crate::memory::TooLarge;
use crate::numpy::NumpyError;
use crate::render::RenderError;
use crate::representation::OwnError;
use crate::scene::{SceneError, shown};
use crate::volume::metrics::Mismatch;
use crate::volume::vti::VtiError;
use crate::volume::{VolumeError, VolumeFileError};
use kerrlight_geodesic::Error as OutOfRange;
use std::borrow::Cow;

/// Why a function of this crate refuses what it was given, or cannot finish.
///
/// The message is complete in itself and names the field, its value and what is allowed; an error in
/// a text or a file also names the line or the byte. Match on a variant to treat one kind in a way of
/// its own; [`field`](Self::field), [`value`](Self::value), [`allowed`](Self::allowed) and
/// [`line`](Self::line) serve whoever marks the place in an editor or a form.
///
/// ```
/// use kerrlight_tomo::scene::Scene;
///
/// let error = Scene::parse(r#"
///     hole = { spin = 1.5 }
///     observer = { inclination_deg = 60.0 }
///     screen = { field_of_view_m = 30.0, width = 64 }
///     tracer = { integrator = "elliptic", tolerance = 1e-8 }
/// "#).unwrap_err();
/// assert_eq!(error.field(), Some("hole.spin"));
/// assert_eq!(error.value().as_deref(), Some("1.5"));
/// assert_eq!(error.allowed(), Some("a number in [-1, 1]"));
/// assert_eq!(error.line(), Some(2));
/// ```
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
#[non_exhaustive]
pub enum Error {
    /// A number outside the range that its definition allows.
    Range(#[from] OutOfRange),
    /// More memory would be needed than may be taken.
    Memory(#[from] TooLarge),
    /// A file for what does not fit into memory.
    Scratch(#[from] ScratchError),
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
    /// Bytes that are no array of numpy.
    Numpy(#[from] NumpyError),
    /// A volume of emission.
    Volume(#[from] VolumeError),
    /// The file of a volume.
    VolumeFile(#[from] VolumeFileError),
    /// Volumes as fields of a VTK file.
    Vti(#[from] VtiError),
    /// Two volumes that do not have the same nodes.
    Mismatch(#[from] Mismatch),
    /// An array of telescopes.
    Array(#[from] ArrayError),
    /// A day or a direction of the sky.
    Earth(#[from] EarthError),
    /// A schedule of observations.
    Schedule(#[from] ScheduleError),
    /// A file of visibilities or images.
    File(#[from] FileError),
    /// What the data do not hold.
    Unknown(#[from] Unknown),
    /// Data that make no χ².
    DataTerm(#[from] DataTermError),
    /// A direction that is none.
    Axis(#[from] ZeroAxis),
    /// A setting of a representation that is not built in.
    Own(#[from] OwnError),
    /// The settings of a fit.
    Fit(#[from] FitError),
    /// A fit without a finite, distinct or lit solution.
    Linear(#[from] LinearError),
    /// A fit whose loss grows whatever the rate.
    Diverged(#[from] Diverged),
    /// A device that takes the steps of a fit.
    Device(#[from] DeviceError),
    /// A checkpoint of a fit.
    Checkpoint(#[from] CheckpointError),
    /// The encoder or decoder of OpenEXR.
    Exr(#[from] exr::error::Error),
    /// The encoder or decoder of another image format.
    Image(#[from] image::ImageError),
    /// Reading or writing.
    Io(#[from] std::io::Error),
}

/// Field, value, allowed range and line, where an error has them.
pub(crate) type Parts<'a> = (Option<&'a str>, Option<Cow<'a, str>>, Option<&'a str>, Option<usize>);

impl Error {
    /// That `field` cannot be `value`, with the allowed range in words.
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

    /// What would be allowed, in words.
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

    fn parts(&self) -> Parts<'_> {
        let number = |value: f64| Some(Cow::Owned(shown(value)));
        match self {
            Self::Range(e) => (Some(e.field()), number(e.value()), Some(e.allowed()), None),
            Self::Scene(SceneError::Range { line, key, value, allowed }) => {
                (Some(key), Some(value.into()), Some(allowed), *line)
            }
            Self::Scene(SceneError::Missing { key, .. }) => (Some(key), None, None, None),
            Self::Fit(error) => error.parts(),
            Self::File(FileError::Line { line, .. })
            | Self::Array(ArrayError::Line { line, .. }) => (None, None, None, Some(*line)),
            _ => (None, None, None, None),
        }
    }
}

//! The error of this crate.

use crate::fit::checkpoint::CheckpointError;
use crate::fit::linear::LinearError;
use crate::fit::settings::FitError;
use crate::fit::{DeviceError, Diverged};
use crate::recovery::Stopped;
use crate::representation::OwnError;
use kerrlight_geodesic::Error as OutOfRange;
use kerrlight_render::Error as RenderError;
use kerrlight_render::Parts;
use kerrlight_vlbi::Error as VlbiError;
use std::borrow::Cow;

/// Reason why a function of this crate refuses its input, or cannot finish.
///
/// The message is complete in itself and names the field, its value and what is allowed; an error in
/// a text or a file also names the line or the byte. Match on a variant to treat one kind in a way of
/// its own; [`field`](Self::field), [`value`](Self::value), [`allowed`](Self::allowed) and
/// [`line`](Self::line) serve whoever marks the place in an editor or a form.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
#[non_exhaustive]
pub enum Error {
    /// A scene, its emission or its picture.
    Render(RenderError),
    /// An array, its data or its files.
    Vlbi(VlbiError),
    /// Memory, or bytes that cannot be read or written.
    Common(kerrlight_common::Error),
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
    /// Reading or writing.
    Io(#[from] std::io::Error),
    /// A fit that cannot go on, with what is the reason.
    #[error("{0}")]
    Failed(String),
    /// A fit that was told to stop.
    Stopped(#[from] Stopped),
    /// An error in a part of a fit, such as `geometry.search`.
    #[error("{part}: {error}")]
    In {
        /// The part.
        part: &'static str,
        /// Error of that part.
        error: Box<Error>,
    },
    /// An error of the keeper of a fit's results.
    Kept(Box<dyn std::error::Error + Send + Sync>),
}

/// Errors of the crates below, from what their functions return as well as from a single kind.
macro_rules! from_below {
    ($($kind:ty => $variant:ident),* $(,)?) => {$(
        impl From<$kind> for Error {
            fn from(error: $kind) -> Self {
                Self::$variant(error.into())
            }
        }
    )*};
}

from_below! {
    RenderError => Render,
    OutOfRange => Render,
    kerrlight_common::Error => Common,
    kerrlight_common::memory::TooLarge => Common,
    kerrlight_vlbi::data_terms::DataTermError => Vlbi,
    VlbiError => Vlbi,
}

impl Error {
    /// States that `field` cannot be `value`, with the allowed range in words.
    pub const fn out_of_range(field: &'static str, value: f64, allowed: &'static str) -> Self {
        Self::Render(RenderError::out_of_range(field, value, allowed))
    }

    /// Refuses `value` of `field` unless it is `ok`, with the allowed range in words.
    pub(crate) fn check(
        field: &'static str,
        value: f64,
        ok: bool,
        allowed: &'static str,
    ) -> Result<(), Self> {
        if ok { Ok(()) } else { Err(Self::out_of_range(field, value, allowed)) }
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

    /// The same in a part of a fit; what was stopped stays that.
    #[must_use]
    pub(crate) fn while_in(self, part: &'static str) -> Self {
        match self {
            Self::Stopped(_) => self,
            error => Self::In { part, error: Box::new(error) },
        }
    }

    /// The same without its line: of a text that nobody sees, such as one that overrides have changed.
    #[must_use]
    pub fn without_line(self) -> Self {
        match self {
            Self::Render(error) => Self::Render(error.without_line()),
            Self::Fit(error) => Self::Fit(without_line(error)),
            other => other,
        }
    }

    fn parts(&self) -> Parts<'_> {
        match self {
            Self::Render(error) => error.parts(),
            Self::Fit(error) => error.parts(),
            Self::Vlbi(error) => (None, None, None, error.line()),
            Self::In { error, .. } => error.parts(),
            _ => (None, None, None, None),
        }
    }
}

fn without_line(error: FitError) -> FitError {
    match error {
        FitError::Syntax(error) => FitError::Syntax(error.without_line()),
        FitError::Range { key, value, allowed, .. } => {
            FitError::Range { line: None, key, value, allowed }
        }
        other => other,
    }
}

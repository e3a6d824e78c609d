//! Reasons why a linear problem has no solution.

/// Failure of a linear problem or of a scan of axes.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LinearError {
    /// A χ² that is no finite number.
    #[error("{data} of frame {frame}: χ² is {value}, which is not a finite number")]
    NotFinite {
        /// Name of the data.
        data: String,
        /// Frame of the movie, counted from 0.
        frame: usize,
        /// Their χ².
        value: f64,
    },
    /// Data that know no flux, and none is given.
    #[error("{0} do not determine the flux; give linear.flux_jy")]
    NoFlux(String),
    /// A flux that emission within the bounds cannot have.
    #[error(
        "a mean flux of {flux} Jy needs an emission of {needed:.4}, above linear.upper = {upper}"
    )]
    TooBright {
        /// Flux that was given, Jy.
        flux: f64,
        /// Largest emission.
        needed: f64,
        /// Largest one that is allowed.
        upper: f64,
    },
    /// Data that no lit field explains better than a dark one.
    #[error("no emission explains {0} better than none: the data contain no signal")]
    NoLight(String),
    /// Axes that data cannot tell apart.
    #[error("the losses of all {axes} axes are {loss:.6e}: the data do not constrain the axis")]
    Alike {
        /// Number of axes.
        axes: usize,
        /// Their loss.
        loss: f64,
    },
}

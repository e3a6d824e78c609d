//! The scalars that numbers are held in.

/// f32 (to run) or f64 (to test and to measure).
pub trait Real:
    num_traits::Float
    + num_traits::FromPrimitive
    + num_traits::NumAssign
    + core::iter::Sum
    + core::fmt::Debug
    + Send
    + Sync
    + 'static
{
    /// The nearest number of this kind.
    fn of(x: f64) -> Self;
    /// As double precision.
    fn double(self) -> f64;
}

impl Real for f32 {
    fn of(x: f64) -> Self {
        x as f32
    }

    fn double(self) -> f64 {
        self.into()
    }
}

impl Real for f64 {
    fn of(x: f64) -> Self {
        x
    }

    fn double(self) -> f64 {
        self
    }
}

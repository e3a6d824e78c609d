//! Outcomes of rays.

/// Outcome of a ray followed backward from the observer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// It reaches the outer horizon.
    Captured,
    /// It returns to infinity.
    Escaped,
    /// An opaque surface ends it. Only a [`RayVisitor`](crate::RayVisitor) knows surfaces, so that paths and tables of
    /// rays never end like this.
    Surface,
    /// It was given up.
    Unresolved(Unresolved),
}

/// Reason for giving a ray up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unresolved {
    /// It lies on the critical curve within rounding and circles on a photon orbit.
    PhotonOrbit,
    /// The limit on the number of steps was reached.
    StepLimit,
    /// It was made for a hole of another spin: a misuse.
    OtherHole,
}

impl Default for Outcome {
    /// The outcome of a ray that has not been traced.
    fn default() -> Self {
        Outcome::Unresolved(Unresolved::StepLimit)
    }
}

impl Outcome {
    /// Returns whether the ray was given up.
    pub fn is_unresolved(self) -> bool {
        matches!(self, Outcome::Unresolved(_))
    }

    /// The number that tables of C and Python use: 0 captured, 1 escaped, 2 on a photon orbit, 3 out of steps, 4 on a
    /// surface, 5 made for another hole.
    pub fn code(self) -> i8 {
        match self {
            Outcome::Captured => 0,
            Outcome::Escaped => 1,
            Outcome::Unresolved(Unresolved::PhotonOrbit) => 2,
            Outcome::Unresolved(Unresolved::StepLimit) => 3,
            Outcome::Surface => 4,
            Outcome::Unresolved(Unresolved::OtherHole) => 5,
        }
    }

    /// The word that tables use.
    pub fn name(self) -> &'static str {
        match self {
            Outcome::Captured => "captured",
            Outcome::Escaped => "escaped",
            Outcome::Surface => "surface",
            Outcome::Unresolved(_) => "unresolved",
        }
    }
}

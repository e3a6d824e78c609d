//! Certificates: the largest distance of a field from the minimum, or how flat it is there.

/// Bounds at a field x, from the gradient g with respect to every node of the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Certificate {
    /// f(x), the loss: dimensionless.
    pub value: f64,
    /// f of the dark field, dimensionless.
    pub dark: f64,
    /// The Frank–Wolfe gap max ⟨g, x − s⟩ over the fields 0 ≤ s ≤ `upper` (Jaggi 2013): f(x) exceeds the least value
    /// over that box by no more, as f is convex.
    pub gap: f64,
    /// The largest violation of the conditions for a minimum: |g| of nodes inside the box, the part of g that points
    /// into it at nodes on its boundary.
    pub violation: f64,
    /// Largest |g| of the dark field, per unit of emission: the scale of `violation`.
    pub dark_slope: f64,
    /// Largest value of the box, in units of emission.
    pub upper: f64,
}

impl Certificate {
    /// The gap as a part of what nothing that shines leaves unexplained.
    pub fn relative_gap(&self) -> f64 {
        self.gap / self.dark
    }

    /// The violation as a part of the largest slope where nothing shines.
    pub fn relative_violation(&self) -> f64 {
        self.violation / self.dark_slope
    }

    /// Gap and largest violation.
    pub(super) fn bounds(x: &[f64], gradient: &[f64], upper: f64) -> (f64, f64) {
        let (mut gap, mut violation) = (0.0, 0.0f64);
        for (x, g) in x.iter().zip(gradient) {
            // ⟨g, s⟩ is least over the box where s = 0 for g ≥ 0, and s = upper for g < 0.
            gap += g * x + upper * (-g).max(0.0);
            violation = violation.max(Self::wrong(*x, *g, upper));
        }
        (gap, violation)
    }

    /// What violates the conditions for a minimum at a node.
    pub(super) fn wrong(x: f64, g: f64, upper: f64) -> f64 {
        if x <= 0.0 {
            (-g).max(0.0)
        } else if x >= upper {
            g.max(0.0)
        } else {
            g.abs()
        }
    }
}

/// Flatness of the function at a field x, where it is not convex: there is no bound on how much less it could be elsewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stationarity {
    /// f(x), the loss: dimensionless.
    pub value: f64,
    /// f of the lit field that the descent began with, dimensionless.
    pub start: f64,
    /// The largest violation of the conditions for a stationary point, dimensionless, as in [`Certificate::violation`].
    pub violation: f64,
    /// Largest |g| at the start, per unit of emission: the scale of `violation`.
    pub start_slope: f64,
    /// Largest value of the box, in units of emission.
    pub upper: f64,
}

impl Stationarity {
    /// The violation as a part of the largest slope at the start.
    pub fn relative_violation(&self) -> f64 {
        self.violation / self.start_slope
    }
}

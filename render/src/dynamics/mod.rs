//! Dynamics: the place at the reference time of matter that shines at a point.
//!
//! Matter turns about one axis ξ on spheres, right-handed, with an angular velocity Ω(r) of the
//! radius alone; emission is carried along: e(t, x) = e₀(R(ξ, angle) x) with angle = −Ω(|x|)(t − t₀).
//! (Levis et al. 2022, Eqs. 1–3.) Matter that falls as well ([`infall`]) came from another radius, at the same angle to the
//! axis: the point is stretched before it is turned. Angles are computed once for all; [`pull_back`] and its derivative are what a fit
//! repeats.

mod angular_velocity;
pub mod infall;
mod law;
mod perturbed;
mod pull_back;
mod sphere;
#[cfg(test)]
mod tests;

pub use angular_velocity::{AngularVelocity, Injection, WayBack};
pub use law::{Perturbed, Velocity};
pub use pull_back::{Cotangents, Turned, pull_back, pull_back_vjp};
pub use sphere::{Axis, ZeroAxis};

//! Profiles of the flow whose values at the knots are not known.

use super::{PARAMETERS, Parameter};
use kerrlight_geodesic::Elementary;
use kerrlight_render::dynamics::infall::Profile;

/// A profile in a world, all its angular velocities times a factor.
pub(super) fn at_knots<N: Elementary>(
    profile: &Profile,
    world: [N; PARAMETERS],
    factor: N,
) -> Profile<N> {
    let knots = |of: fn(u8) -> Parameter| {
        (0..profile.knots() as u8).map(move |knot| world[of(knot).index()])
    };
    let angular: Vec<N> = knots(Parameter::Angular).map(|by| by * factor).collect();
    let radial: Vec<N> = knots(Parameter::Radial).collect();
    profile.times(&angular, &radial)
}

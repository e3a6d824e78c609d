//! Polarised light of a fit's nodes against parallel transport that is integrated step by step.

use super::stokes::{apart, law, traced, view};
use crate::fit::Sightlines;
use kerr_schild::Transported;
use kerrlight_geodesic::vector::{cross, norm};
use kerrlight_geodesic::{Kerr, ZamoFrame};
use kerrlight_render::dynamics::AngularVelocity;
use kerrlight_render::polarization::{FieldFrame, MagneticField};

#[path = "../../../../geodesic/tests/public/kerr_schild.rs"]
mod kerr_schild;

/// A node's photon with the electric vector k × B of gas of zero angular momentum.
fn emitted(hole: &Kerr, lines: &Sightlines, node: usize, field: &MagneticField) -> Transported {
    let at = |columns: &[Vec<f64>; 3]| [0, 1, 2].map(|c| columns[c][node]);
    let ([x, y, z], momentum) = (at(&lines.position), at(&lines.momentum));
    let r = norm([x, y, z]);
    let (u, s) = (z / r, x.hypot(y) / r);
    let (cos, sin) = (x / (r * s), y / (r * s));
    let polar = momentum[1] * cos - momentum[0] * sin;
    let radial = lines.radial[node] * r * r / hole.delta(r);
    let frame = ZamoFrame::at(hole, r, s, u).unwrap();
    let k = frame.covariant([-1.0, radial, polar, momentum[2]]);
    let b = [field.radial + field.vertical * u, -field.vertical * s, field.toroidal];
    let e = cross([k[1], k[2], k[3]], b);
    Transported::new(hole, &frame, y.atan2(x), k, [0.0, e[0], e[1], e[2]])
}

#[test]
fn exact_position_angles_are_those_of_parallel_transport() {
    let mut compared = 0;
    for (spin, degrees) in [(0.0, 20.0), (0.9, 60.0), (-0.7, 130.0)] {
        let (hole, lines) = traced(spin, degrees);
        let field = MagneticField { vertical: 0.8, radial: 0.5, toroidal: -0.4 };
        let law = law(FieldFrame::Gas, [field.vertical, field.radial, field.toroidal]);
        for node in (0..lines.points()).step_by(7) {
            let [x, y, z] = [0, 1, 2].map(|c| lines.position[c][node]);
            let r = norm([x, y, z]);
            // Gas without angular momentum turns with the frame.
            let area = (r * r + spin * spin).powi(2)
                - spin * spin * hole.delta(r) * (1.0 - (z / r).powi(2));
            let rate = 2.0 * spin * r / area;
            let gas = AngularVelocity::Table { radii: vec![2.0, 3.0], rates: vec![rate; 2] };
            let factors = view(law, degrees).factors(&lines, &hole, &gas).unwrap();
            let end = emitted(&hole, &lines, node, &field).carried_out(spin, 0.01);
            let ([north, east], miss) = end.on_screen(degrees.to_radians());
            assert!(miss < 1e-6, "the ray misses the observer by {miss}");
            let (expected, found) = (east.atan2(north), factors[node].evpa());
            assert!(apart(found, expected).abs() < 1e-6, "a = {spin}: {found} {expected}");
            compared += 1;
        }
    }
    assert!(compared > 30, "{compared}");
}

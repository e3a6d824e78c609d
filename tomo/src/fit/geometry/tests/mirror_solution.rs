//! The geometry that looks most like another one.

use super::*;

/// Seen from the other side of the orbit; what is known stays.
#[test]
fn exact_the_mirror_solution_of_a_geometry_is_seen_from_below() {
    let model = screen(6, 2);
    let free = [
        uniform(Parameter::Spin, -0.95, 0.95),
        uniform(Parameter::Inclination, 0.0, PI),
        uniform(Parameter::PositionAngle, -PI, PI),
    ];
    let geometry = Geometry::new(0.6, 1.05).with(Parameter::PositionAngle, 0.7);
    let mirror = of_hot_spot(&model, &free, &[]).mirror_solution(&geometry).unwrap();
    for (parameter, value) in [
        (Parameter::Spin, -0.6),
        (Parameter::Inclination, PI - 1.05),
        (Parameter::PositionAngle, 0.7 - PI),
    ] {
        assert!((mirror.get(parameter) - value).abs() < 1e-12, "{parameter:?}");
    }
    let of_known = of_hot_spot(&model, &free[1..], &[]).mirror_solution(&geometry).unwrap();
    assert_eq!(of_known.get(Parameter::Spin), 0.6);
    assert!(of_hot_spot(&model, &free[..1], &[]).mirror_solution(&geometry).is_none());
}

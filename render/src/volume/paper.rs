//! The scenes of BH-NeRF (Levis et al. 2022) that tests look at: Gaussian spots of 0.4 M at 3.5 M, on
//! nodes from −5 M to 5 M.

use super::Volume;
use crate::dynamics::{AngularVelocity, Axis, Turned, pull_back};
use crate::points::{Coordinates, CoordinatesMut};

/// The axis that all of them turn about.
pub fn axis() -> Axis {
    Axis::new([0.5, 0.0, -0.75f64.sqrt()]).unwrap()
}

/// R(ξ, angle) x.
fn turn(point: [f64; 3], angle: f64) -> [f64; 3] {
    let ([px, py, pz], angles) = (point.map(|p| [p]), [angle]);
    let [mut x, mut y, mut z] = [[0.0]; 3];
    let points = Coordinates::xyz(&px, &py, &pz);
    let pulled = CoordinatesMut::xyz(&mut x, &mut y, &mut z);
    pull_back(axis(), Turned { points, angles: &angles }, pulled);
    [x[0], y[0], z[0]]
}

/// Spots at these 127ths of a turn.
fn spots(phases: &[u32], x: [f64; 3]) -> f64 {
    let start = [3.5 * 0.75f64.sqrt(), 0.0, 1.75];
    let light = |phase: &u32| {
        let centre = turn(start, -core::f64::consts::TAU * f64::from(*phase) / 127.0);
        let square: f64 = x.iter().zip(centre).map(|(x, c)| (x - c).powi(2)).sum();
        (-square / (2.0 * 0.4 * 0.4)).exp()
    };
    phases.iter().map(light).sum()
}

fn sampled(nodes: usize, light: impl Fn([f64; 3]) -> f64) -> Volume {
    let volume = |values| Volume::new([nodes; 3], [-5.0; 3], [5.0; 3], values).unwrap();
    let empty = volume(vec![0.0; nodes.pow(3)]);
    volume((0..nodes.pow(3)).map(|k| light(empty.position(k)) as f32).collect())
}

/// One spot.
pub fn scene_1(nodes: usize) -> Volume {
    sampled(nodes, |x| spots(&[0], x))
}

/// Four spots.
pub fn scene_4(nodes: usize) -> Volume {
    sampled(nodes, |x| spots(&[60, 75, 105, 0], x))
}

/// Four spots sheared over a quarter of a turn, and four new ones.
pub fn scene_8(nodes: usize) -> Volume {
    let flow = AngularVelocity::bhnerf();
    sampled(nodes, |x| {
        let pulled = turn(x, flow.angle(x, 32.0 / 127.0, 0.0));
        spots(&[60, 75, 105, 0], pulled) + spots(&[25, 55, 60, 40], x)
    })
}

//! A volume as it would look in flat space: straight parallel rays, light that nothing absorbs, and the
//! hole as a ball that hides what is behind it.
//!
//! This is a drawing of the emission, not an image of the hole: no light is bent, and none is delayed.

mod drawing;

use super::Volume;
pub use drawing::{Tile, mosaic, sheet};
use kerrlight_geodesic::interrupt;
use rayon::prelude::*;

/// Direction from which a volume is seen, by a viewer far away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Direction to the viewer around +z, degrees from +x.
    pub azimuth: f64,
    /// And above the plane z = 0, degrees.
    pub elevation: f64,
}

/// Around the hole, a little above its equatorial plane, and down along its axis.
pub const VIEWS: [View; 4] = [
    View { azimuth: 0.0, elevation: 20.0 },
    View { azimuth: 90.0, elevation: 20.0 },
    View { azimuth: 180.0, elevation: 20.0 },
    View { azimuth: 0.0, elevation: 90.0 },
];

/// Surroundings of the emission, and how much of them is in the picture; lengths in M.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surroundings {
    /// Radius of the ball in M: that of the outer horizon.
    pub hole_radius: f64,
    /// Direction that matter turns about, of any length; zero draws no line.
    pub axis: [f64; 3],
    /// Radius in M of the circle in the plane z = 0: that of the region of recovery.
    pub ring_radius: f64,
    /// Half the width of the picture.
    pub half_width: f64,
}

impl View {
    /// Unit vectors to the right, upward and towards the viewer.
    pub fn frame(self) -> [[f64; 3]; 3] {
        let (sin_a, cos_a) = self.azimuth.to_radians().sin_cos();
        let (sin_e, cos_e) = self.elevation.to_radians().sin_cos();
        [
            [-sin_a, cos_a, 0.0],
            [-sin_e * cos_a, -sin_e * sin_a, cos_e],
            [cos_e * cos_a, cos_e * sin_a, sin_e],
        ]
    }

    /// Coordinates of a point of space: to the right, upward and towards the viewer.
    fn seen(self, point: [f64; 3]) -> [f64; 3] {
        self.frame().map(|unit| unit.iter().zip(point).map(|(u, x)| u * x).sum())
    }
}

/// ∫ e ds along the rays of `pixels` × `pixels` pixels, in the unit of the volume times M, row by row
/// from the top. Steps are as long as the shortest distance of nodes, light is taken in their middle.
pub fn project(volume: &Volume, view: View, around: &Surroundings, pixels: usize) -> Vec<f32> {
    let marcher = Marcher::new(volume, view, around.hole_radius);
    let at = |k: usize| around.half_width * ((2 * k + 1) as f64 / pixels as f64 - 1.0);
    let mut light = vec![0.0; pixels * pixels];
    light.par_chunks_mut(pixels.max(1)).enumerate().for_each(|(row, line)| {
        interrupt::check();
        for (column, pixel) in line.iter_mut().enumerate() {
            *pixel = marcher.light(at(column), -at(row));
        }
    });
    light
}

/// Rays of one view through the nodes of a volume.
struct Marcher<'a> {
    volume: &'a Volume,
    frame: [[f64; 3]; 3],
    hole_radius: f64,
    /// M from node to node along each axis, and the shortest of them.
    spacing: [f64; 3],
    step: f64,
}

impl<'a> Marcher<'a> {
    fn new(volume: &'a Volume, view: View, hole_radius: f64) -> Self {
        let (spacing, step) = (volume.spacing(), volume.finest());
        Self { volume, frame: view.frame(), hole_radius, spacing, step }
    }

    /// Returns the light at a point of the picture.
    fn light(&self, right: f64, up: f64) -> f32 {
        let [a, b, towards] = self.frame;
        let origin: [f64; 3] = core::array::from_fn(|k| right * a[k] + up * b[k]);
        let Some([far, near]) = self.inside(origin, towards) else { return 0.0 };
        // The ball ends a ray on its near side.
        let ball = self.hole_radius.powi(2) - right * right - up * up;
        let far = if ball > 0.0 { far.max(ball.sqrt()) } else { far };
        if near <= far {
            return 0.0;
        }
        let steps = ((near - far) / self.step).ceil();
        let length = (near - far) / steps;
        let node = |k: usize, s: f64| {
            ((origin[k] + s * towards[k] - self.volume.low[k]) / self.spacing[k]) as f32
        };
        let start = core::array::from_fn(|k| node(k, far + 0.5 * length));
        let stride = core::array::from_fn(|k| (length * towards[k] / self.spacing[k]) as f32);
        self.sum(start, stride, steps as u32) * length as f32
    }

    /// The piece of a ray inside the box, as distances towards the viewer.
    fn inside(&self, origin: [f64; 3], towards: [f64; 3]) -> Option<[f64; 2]> {
        let (mut far, mut near) = (f64::NEG_INFINITY, f64::INFINITY);
        for k in 0..3 {
            let ends = [self.volume.low[k] - origin[k], self.volume.high[k] - origin[k]];
            if towards[k].abs() < 1e-12 {
                if ends[0] > 0.0 || ends[1] < 0.0 {
                    return None;
                }
                continue;
            }
            let [a, b] = ends.map(|end| end / towards[k]);
            (far, near) = (far.max(a.min(b)), near.min(a.max(b)));
        }
        (near > far).then_some([far, near])
    }

    /// Sum of the values at points given in units of nodes.
    fn sum(&self, start: [f32; 3], stride: [f32; 3], steps: u32) -> f32 {
        let values = self.volume.values();
        let [_, ny, nz] = self.volume.nodes;
        let last = self.volume.nodes.map(|n| n as i32 - 2);
        let mut sum = 0.0;
        for step in 0..steps {
            let mut part = [0.0; 3];
            let cell: [usize; 3] = core::array::from_fn(|k| {
                let place = start[k] + step as f32 * stride[k];
                // Rounded towards 0: without SSE4.1, floor is a call.
                let first = (place as i32).clamp(0, last[k]);
                part[k] = place - first as f32;
                first as usize
            });
            let first = (cell[0] * ny + cell[1]) * nz + cell[2];
            let edge = |offset: usize| match values.get(first + offset..first + offset + 2) {
                Some([a, b]) => a + (b - a) * part[2],
                _ => 0.0,
            };
            let side = |offset: usize| {
                let (near, far) = (edge(offset), edge(offset + nz));
                near + (far - near) * part[1]
            };
            let (near, far) = (side(0), side(ny * nz));
            sum += near + (far - near) * part[0];
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::paper;
    use kerrlight_geodesic::vector::{cross, difference};

    fn around(hole_radius: f64) -> Surroundings {
        Surroundings { hole_radius, axis: [0.5, 0.0, -0.9], ring_radius: 5.0, half_width: 5.5 }
    }

    /// A ray sees its chord of a box that shines evenly, or what of it is in front of the ball.
    #[test]
    fn exact_chords_of_a_box_and_of_what_the_ball_hides() {
        let nodes = [9, 11, 13];
        let count = nodes.iter().product();
        let even =
            Volume::new(nodes, [-5.0, -4.0, -3.0], [5.0, 4.0, 3.0], vec![2.0; count]).unwrap();
        for (azimuth, elevation, chord) in [(0.0, 0.0, 10.0), (90.0, 0.0, 8.0), (0.0, 90.0, 6.0)] {
            let light = project(&even, View { azimuth, elevation }, &around(0.0), 11);
            assert!((light[60] - 2.0 * chord).abs() < 1e-4, "{azimuth} {elevation}");
            let hidden = project(&even, View { azimuth, elevation }, &around(1.5), 11);
            assert!((hidden[60] - 2.0 * (0.5 * chord - 1.5)).abs() < 1e-4);
            // Two pixels from the middle, 2 M, nothing is hidden.
            assert_eq!(hidden[62], light[62]);
        }
        let slant = project(&even, View { azimuth: 45.0, elevation: 0.0 }, &around(0.0), 11);
        assert!((f64::from(slant[60]) - 16.0 * 2f64.sqrt()).abs() < 1e-4);
    }

    /// ∫ of a Gaussian spot is √(2π) σ exp(−b²/2σ²), and it stands where its centre is seen.
    #[test]
    fn exact_place_and_light_of_a_spot() {
        let scene = paper::scene_1(96);
        let centre = [3.5 * 0.75f64.sqrt(), 0.0, 1.75];
        for view in [VIEWS[0], VIEWS[1], VIEWS[3], View { azimuth: 200.0, elevation: -40.0 }] {
            let (pixels, around) = (110, around(0.0));
            let light = project(&scene, view, &around, pixels);
            let at = |k: usize| around.half_width * ((2 * k + 1) as f64 / pixels as f64 - 1.0);
            let [right, up, _] = view.seen(centre);
            for (k, value) in light.iter().enumerate() {
                let distance = (at(k % pixels) - right).hypot(-at(k / pixels) - up);
                let closed = (2.0 * std::f64::consts::PI).sqrt()
                    * 0.4
                    * (-distance.powi(2) / (2.0 * 0.16)).exp();
                assert!((f64::from(*value) - closed).abs() < 0.02, "{view:?} {k}");
            }
        }
    }

    #[test]
    fn exact_frames_are_right_handed() {
        for view in VIEWS {
            let [a, b, c] = view.frame();
            assert!(difference(cross(a, b), c).iter().all(|x| x.abs() < 1e-15));
        }
        assert!((VIEWS[0].seen([0.0, 1.0, 0.0])[0] - 1.0).abs() < 1e-15);
    }
}

//! A volume as it would look in flat space: straight parallel rays, light that nothing absorbs, and the
//! hole as a ball that hides what is behind it.
//!
//! This is a drawing of the emission, not an image of the hole: no light is bent, and none is delayed.

use super::Volume;
use super::panels::{self, PANEL, Page, Panel, Shown};
use crate::image::canvas::{Canvas, Rgb};
use image::RgbImage;
use rayon::prelude::*;

/// From where a volume is seen, by a viewer far away.
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

/// What is around the emission, and how much of it is in the picture; lengths in M.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surroundings {
    /// Radius of the ball: that of the outer horizon.
    pub hole_radius: f64,
    /// Direction that matter turns about, of any length; zero draws no line.
    pub axis: [f64; 3],
    /// Radius of the circle in the plane z = 0: that of the region that was looked at.
    pub ring_radius: f64,
    /// Half the width of the picture.
    pub half_width: f64,
}

/// The ball, its edge, the axis, and the circle in the equatorial plane.
const BALL: Rgb = [26, 30, 40];
const EDGE: Rgb = [120, 130, 150];
const AXIS: Rgb = [110, 200, 255];
const RING: Rgb = [120, 150, 120];
const FAR_RING: Rgb = [60, 76, 60];

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
        let extent = |k: usize| volume.high[k] - volume.low[k];
        let spacing = core::array::from_fn(|k| extent(k) / (volume.nodes[k] - 1) as f64);
        let step = spacing.into_iter().fold(f64::INFINITY, f64::min);
        Self { volume, frame: view.frame(), hole_radius, spacing, step }
    }

    /// What is seen at a point of the picture.
    fn light(&self, right: f64, up: f64) -> f32 {
        let [a, b, towards] = self.frame;
        let origin: [f64; 3] = core::array::from_fn(|k| right * a[k] + up * b[k]);
        let Some([far, near]) = self.inside(origin, towards) else { return 0.0 };
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
        let last = self.volume.nodes.map(|n| (n - 2) as f32);
        let mut sum = 0.0;
        for step in 0..steps {
            let mut part = [0.0; 3];
            let cell: [usize; 3] = core::array::from_fn(|k| {
                let place = start[k] + step as f32 * stride[k];
                let first = place.floor().clamp(0.0, last[k]);
                part[k] = place - first;
                first as usize
            });
            let first = (cell[0] * ny + cell[1]) * nz + cell[2];
            let edge = |offset: usize| match values.get(first + offset..first + offset + 2) {
                Some([a, b]) => a + (b - a) * part[2],
                _ => 0.0,
            };
            let side = |offset: usize| edge(offset) + (edge(offset + nz) - edge(offset)) * part[1];
            sum += side(0) + (side(ny * nz) - side(0)) * part[0];
        }
        sum
    }
}

/// Volumes from several sides, a row each, in one scale of colours; `unit` is that of the emission.
/// `None` if there is nothing to draw.
pub fn sheet(
    shown: &[Shown],
    views: &[View],
    around: &Surroundings,
    unit: &str,
) -> Option<RgbImage> {
    let of = |s: &Shown| -> Vec<Vec<f32>> {
        views.iter().map(|view| project(s.volume, *view, around, PANEL as usize)).collect()
    };
    let light: Vec<Vec<Vec<f32>>> = shown.iter().map(of).collect();
    let most = panels::largest(light.iter().flatten());
    let panel = |(view, light): (&View, &Vec<f32>)| panel(*view, light, around, most);
    let row = |(s, light): (&Shown, &Vec<Vec<f32>>)| {
        let panels = views.iter().zip(light).map(panel).collect::<Option<Vec<Panel>>>()?;
        Some((s.name.to_owned(), panels))
    };
    let rows = shown.iter().zip(&light).map(row).collect::<Option<_>>()?;
    let quantity = format!("∫ emission ds ({unit} · M), straight rays");
    Page { rows, most, quantity }.draw()
}

fn panel(view: View, light: &[f32], around: &Surroundings, most: f64) -> Option<Panel> {
    let table = panels::colors();
    let pixels = PANEL as usize;
    let at = |k: usize| around.half_width * ((2 * k + 1) as f64 / pixels as f64 - 1.0);
    let pixel = |(k, value): (usize, &f32)| {
        let color = panels::shade(&table, *value, most);
        let hidden = at(k % pixels).hypot(at(k / pixels)) < around.hole_radius;
        let ground = if hidden { BALL } else { [0; 3] };
        core::array::from_fn::<u8, 3, _>(|c| color[c].max(ground[c]))
    };
    let pixels = light.iter().enumerate().flat_map(pixel).collect();
    let mut canvas = Canvas::of(&RgbImage::from_raw(PANEL, PANEL, pixels)?)?;
    marks(&mut canvas, view, around);
    let title = format!("azimuth {:.0}°, elevation {:.0}°", view.azimuth, view.elevation);
    let ends = [[-around.half_width, around.half_width]; 2];
    let axes = ["to the right (M)".to_owned(), "up (M)".to_owned()];
    Some(Panel { title, drawn: canvas.into_picture(), axes, ends })
}

/// The edge of the ball, the circle and the axis, where nothing of the hole is in front of them.
fn marks(canvas: &mut Canvas, view: View, around: &Surroundings) {
    let scale = 0.5 * f64::from(PANEL) / around.half_width;
    let middle = 0.5 * f64::from(PANEL);
    let on_canvas = |[x, y]: [f64; 2]| [middle + scale * x, middle - scale * y];
    let circle = |k: usize| (k as f64 * core::f64::consts::TAU / 180.0).sin_cos();
    let edge = |k: usize| {
        let (sin, cos) = circle(k);
        on_canvas([around.hole_radius * cos, around.hole_radius * sin])
    };
    canvas.line(&(0..180).map(edge).collect::<Vec<_>>(), true, 1.2, EDGE);
    let on_ring = |k: usize| {
        let (sin, cos) = circle(k);
        [around.ring_radius * cos, around.ring_radius * sin, 0.0]
    };
    let ring: Vec<[f64; 3]> = (0..=180).map(on_ring).collect();
    let mut lines = vec![(ring, [RING, FAR_RING])];
    let norm = around.axis.iter().map(|x| x * x).sum::<f64>().sqrt();
    // The axis from the ball outward: nobody sees what is inside.
    let span = 0.95 * around.half_width - around.hole_radius;
    if norm > 0.0 && span > 0.0 {
        for sign in [-1.0, 1.0] {
            let at = |k: i32| sign * (around.hole_radius + span * f64::from(k) / 60.0) / norm;
            let axis = (0..=60).map(|k| around.axis.map(|x| x * at(k))).collect();
            lines.push((axis, [AXIS, AXIS]));
        }
    }
    for (points, colors) in lines {
        for (run, is_far) in visible(&points, view, around.hole_radius) {
            let run: Vec<[f64; 2]> = run.into_iter().map(on_canvas).collect();
            canvas.line(&run, false, 1.2, colors[usize::from(is_far)]);
        }
    }
}

/// The parts of a line that the ball does not hide, as places on the picture, and whether they are
/// farther away than the hole.
fn visible(points: &[[f64; 3]], view: View, hole_radius: f64) -> Vec<(Vec<[f64; 2]>, bool)> {
    let mut runs: Vec<(Vec<[f64; 2]>, bool)> = Vec::new();
    let mut open = false;
    for pair in points.windows(2) {
        let [a, b] = [pair[0], pair[1]].map(|point| view.seen(point));
        let hidden = |p: [f64; 3]| p[2] < 0.0 && p[0].hypot(p[1]) < hole_radius;
        if hidden(a) || hidden(b) {
            open = false;
            continue;
        }
        let is_far = a[2] + b[2] < 0.0;
        match runs.last_mut() {
            Some((run, far)) if open && *far == is_far => run.push([b[0], b[1]]),
            _ => runs.push((vec![[a[0], a[1]], [b[0], b[1]]], is_far)),
        }
        open = true;
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::super::paper;
    use super::*;

    fn around(hole_radius: f64) -> Surroundings {
        Surroundings { hole_radius, axis: [0.5, 0.0, -0.9], ring_radius: 5.0, half_width: 5.5 }
    }

    /// Of a box that shines evenly a ray sees its chord, or what of it is in front of the ball.
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

    /// A line behind the ball is seen on both sides of it, one in front of it as a whole.
    #[test]
    fn exact_parts_of_lines_that_are_seen() {
        let view = View { azimuth: 0.0, elevation: 0.0 };
        let line = |x: f64| -> Vec<[f64; 3]> {
            (0..=100).map(|k| [x, 0.1 * f64::from(k) - 5.0, 0.0]).collect()
        };
        let behind = visible(&line(-3.0), view, 2.0);
        assert_eq!(behind.len(), 2);
        assert!(behind.iter().all(|(_, is_far)| *is_far));
        assert!((behind[0].0.last().unwrap()[0] + 2.0).abs() < 0.11);
        assert!((behind[1].0[0][0] - 2.0).abs() < 0.11);
        let front = visible(&line(3.0), view, 2.0);
        assert_eq!((front.len(), front[0].0.len(), front[0].1), (1, 101, false));
    }

    #[test]
    fn exact_frames_are_right_handed() {
        for view in VIEWS {
            let [a, b, c] = view.frame();
            for k in 0..3 {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                assert!((a[i] * b[j] - a[j] * b[i] - c[k]).abs() < 1e-15);
            }
        }
        assert!((VIEWS[0].seen([0.0, 1.0, 0.0])[0] - 1.0).abs() < 1e-15);
    }

    #[test]
    fn exact_scale_is_that_of_the_brightest_volume() {
        let scene = paper::scene_1(32);
        let half: Vec<f32> = scene.values().iter().map(|v| 0.5 * v).collect();
        let half = Volume::new(scene.nodes(), scene.low(), scene.high(), half).unwrap();
        let shown =
            [Shown { name: "half", volume: &half }, Shown { name: "whole", volume: &scene }];
        let around = Surroundings { axis: [0.0; 3], ..around(2.0) };
        let drawn = sheet(&shown, &VIEWS[1..2], &around, "unit").unwrap();
        let bright = |from: u32, to: u32| {
            let inside = |x: u32, y: u32| (60..350).contains(&x) && (from..to).contains(&y);
            drawn.enumerate_pixels().filter(|(x, y, p)| inside(*x, *y) && p.0[1] > 200).count()
        };
        let middle = (drawn.height() - 74) / 2;
        assert_eq!(bright(62, middle - 50), 0);
        assert!(bright(middle + 62, 2 * middle - 50) > 20);
    }
}

//! Projections of several volumes from several sides, with what is around them.

use super::super::panels::{self, PANEL, Page, Panel, Shown};
use super::{Surroundings, View, project};
use crate::image::canvas::{Canvas, Rgb};
use crate::volume::Volume;
use image::RgbImage;

/// The ball, its edge, the axis, and the circle in the equatorial plane.
const BALL: Rgb = [26, 30, 40];
const EDGE: Rgb = [120, 130, 150];
const AXIS: Rgb = [110, 200, 255];
const RING: Rgb = [120, 150, 120];
const FAR_RING: Rgb = [60, 76, 60];

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
    let panel = |(view, light): (&View, &Vec<f32>)| {
        let title = format!("azimuth {:.0}°, elevation {:.0}°", view.azimuth, view.elevation);
        panel(*view, light, around, most, title)
    };
    let row = |(s, light): (&Shown, &Vec<Vec<f32>>)| {
        let panels = views.iter().zip(light).map(panel).collect::<Option<Vec<Panel>>>()?;
        Some((s.name.to_owned(), panels))
    };
    let rows = shown.iter().zip(&light).map(row).collect::<Option<_>>()?;
    let quantity = format!("∫ emission ds ({unit} · M), straight rays");
    Page { rows, most, quantity }.draw()
}

/// A volume of a mosaic.
#[derive(Clone, Copy, Debug)]
pub struct Tile<'a> {
    /// Title above it.
    pub title: &'a str,
    /// Its emission.
    pub volume: &'a Volume,
    /// Surroundings.
    pub around: Surroundings,
    /// Direction of the viewer.
    pub view: View,
}

/// Rows of different volumes, each with its name. Every column has a scale of colours of its
/// own, which ends at its first volume's brightest place. `None` if there is nothing to draw.
pub fn mosaic(rows: &[(String, Vec<Tile>)]) -> Option<RgbImage> {
    let light = |tile: &Tile| project(tile.volume, tile.view, &tile.around, PANEL as usize);
    let firsts: Vec<f64> =
        rows.first()?.1.iter().map(|tile| panels::largest([&light(tile)])).collect();
    let row = |(name, tiles): &(String, Vec<Tile>)| {
        let panel = |(tile, most): (&Tile, &f64)| {
            panel(tile.view, &light(tile), &tile.around, *most, tile.title.to_owned())
        };
        let panels = tiles.iter().zip(&firsts).map(panel).collect::<Option<Vec<Panel>>>()?;
        Some((name.clone(), panels))
    };
    let rows = rows.iter().map(row).collect::<Option<_>>()?;
    let quantity = "∫ emission ds, straight rays; 1 is the brightest place of the first row";
    Page { rows, most: 1.0, quantity: quantity.to_owned() }.draw()
}

fn panel(
    view: View,
    light: &[f32],
    around: &Surroundings,
    most: f64,
    title: String,
) -> Option<Panel> {
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
    use super::super::VIEWS;
    use super::*;
    use crate::volume::paper;

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

    /// Each column is as bright as its own first row.
    #[test]
    fn exact_mosaics_scale_each_column() {
        let scene = paper::scene_1(32);
        let faint: Vec<f32> = scene.values().iter().map(|v| 0.01 * v).collect();
        let faint = Volume::new(scene.nodes(), scene.low(), scene.high(), faint).unwrap();
        let around =
            Surroundings { axis: [0.0; 3], hole_radius: 2.0, ring_radius: 5.0, half_width: 5.5 };
        let tile = |volume| Tile { title: "", volume, around, view: VIEWS[1] };
        let rows = [
            ("a".to_owned(), vec![tile(&scene), tile(&faint)]),
            ("b".to_owned(), vec![tile(&faint), tile(&scene)]),
        ];
        let drawn = mosaic(&rows).unwrap();
        let bright = |right: u32, below: u32| {
            let (left, top) = (58 + right * 372, 58 + below * 404);
            let inside =
                |x: u32, y: u32| (left..left + 300).contains(&x) && (top..top + 300).contains(&y);
            drawn.enumerate_pixels().filter(|(x, y, p)| inside(*x, *y) && p.0[1] > 200).count()
        };
        assert!(bright(0, 0) > 20);
        assert_eq!(bright(0, 0), bright(1, 0));
        assert_eq!(bright(0, 1), 0);
    }

    #[test]
    fn exact_scale_is_that_of_the_brightest_volume() {
        let scene = paper::scene_1(32);
        let half: Vec<f32> = scene.values().iter().map(|v| 0.5 * v).collect();
        let half = Volume::new(scene.nodes(), scene.low(), scene.high(), half).unwrap();
        let shown =
            [Shown { name: "half", volume: &half }, Shown { name: "whole", volume: &scene }];
        let around =
            Surroundings { axis: [0.0; 3], hole_radius: 2.0, ring_radius: 5.0, half_width: 5.5 };
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

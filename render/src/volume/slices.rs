//! A volume cut along the planes of its axes through one point.

use super::Volume;
use super::panels::{self, PANEL, Page, Panel, Shown};
use crate::image::canvas::{Canvas, Rgb};
use image::RgbImage;

/// The point that slices go through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Through {
    /// The node with the largest value, the first of several.
    Maximum,
    /// A place in M.
    Point([f64; 3]),
}

impl Through {
    /// Returns the point in a volume, M; an empty volume has its middle for all of them.
    pub fn point(self, volume: &Volume) -> [f64; 3] {
        let middle = core::array::from_fn(|k| 0.5 * (volume.low[k] + volume.high[k]));
        match self {
            Self::Maximum => maximum(volume).unwrap_or(middle),
            Self::Point(point) => point,
        }
    }

    /// Returns its name in a caption.
    pub fn name(self) -> &'static str {
        match self {
            Self::Maximum => "brightest node",
            Self::Point(_) => "chosen point",
        }
    }
}

fn maximum(volume: &Volume) -> Option<[f64; 3]> {
    let above = volume.values().iter().enumerate().filter(|(_, value)| **value > 0.0);
    let best = above.reduce(|best, next| if next.1 > best.1 { next } else { best });
    best.map(|(k, _)| volume.position(k))
}

/// Axes to the right, upward and along the line of sight of each slice.
const PLANES: [[usize; 3]; 3] = [[0, 1, 2], [0, 2, 1], [1, 2, 0]];
const NAMES: [&str; 3] = ["x", "y", "z"];
const EDGE: Rgb = [120, 130, 150];
const CROSS: Rgb = [70, 90, 110];

/// Values on `pixels` × `pixels` points of a plane, row by row from the top, over the whole box.
/// `plane` has the axes (0, 1, 2 for x, y, z) to the right, upward, and that of the fixed coordinate.
pub fn slice(volume: &Volume, plane: [usize; 3], point: [f64; 3], pixels: usize) -> Vec<f32> {
    let at = |axis: usize, k: usize| {
        let part = (2 * k + 1) as f64 / (2 * pixels) as f64;
        volume.low[axis] + (volume.high[axis] - volume.low[axis]) * part
    };
    let [right, up, _] = plane;
    let value = |k: usize| {
        let mut place = point;
        place[right] = at(right, k % pixels);
        place[up] = at(up, pixels - 1 - k / pixels);
        volume.at(place) as f32
    };
    (0..pixels * pixels).map(value).collect()
}

/// Outlines of where a volume is at least as large as each level.
#[derive(Clone, Copy, Debug)]
pub struct Outlines<'a> {
    /// Volume of the levels.
    pub volume: &'a Volume,
    /// Two levels: the line of the first is white, that of the second blue.
    pub levels: [f32; 2],
}

/// Colours of the two levels of [`Outlines`].
const OUTLINES: [Rgb; 2] = [[235, 235, 235], [90, 170, 255]];

/// Three slices of each volume through one point, a row each, in one scale of colours, with the hole's
/// outline where a plane cuts it; `unit` is that of the emission. `None` if there is nothing to draw.
pub fn sheet(
    shown: &[Shown],
    point: [f64; 3],
    hole_radius: f64,
    outlines: Option<Outlines<'_>>,
    unit: &str,
) -> Option<RgbImage> {
    let cuts = |s: &Shown| PLANES.map(|plane| slice(s.volume, plane, point, PANEL as usize));
    let values: Vec<[Vec<f32>; 3]> = shown.iter().map(cuts).collect();
    let most = panels::largest(values.iter().flatten());
    let row = |(s, values): (&Shown, &[Vec<f32>; 3])| {
        let drawn = |(plane, values): ([usize; 3], &Vec<f32>)| {
            let pixels = colored(values, most, outlines.map(|lines| (lines, plane, point)));
            panel(s.volume, plane, pixels, point, hole_radius)
        };
        let panels = PLANES.into_iter().zip(values).map(drawn).collect::<Option<Vec<Panel>>>()?;
        Some((s.name.to_owned(), panels))
    };
    let rows = shown.iter().zip(&values).map(row).collect::<Option<_>>()?;
    Page { rows, most, quantity: format!("emission ({unit})") }.draw()
}

/// Colours of the pixels of a plane, three bytes each, with outlines.
fn colored(
    values: &[f32],
    most: f64,
    outlines: Option<(Outlines<'_>, [usize; 3], [f64; 3])>,
) -> Vec<u8> {
    let table = panels::colors();
    let mut pixels: Vec<u8> =
        values.iter().flat_map(|value| panels::shade(&table, *value, most)).collect();
    if let Some((lines, plane, point)) = outlines {
        let size = PANEL as usize;
        let of = slice(lines.volume, plane, point, size);
        for (level, color) in lines.levels.into_iter().zip(OUTLINES) {
            for k in edge(&of, size, level) {
                pixels[3 * k..3 * k + 3].copy_from_slice(&color);
            }
        }
    }
    pixels
}

/// Pixels at least as large as `level` beside one that is smaller, of rows of `size`.
fn edge(values: &[f32], size: usize, level: f32) -> Vec<usize> {
    let inside = |k: usize| values[k] >= level;
    let is_edge = |k: &usize| {
        let (row, column) = (k / size, k % size);
        let beside = [
            (column > 0).then(|| k - 1),
            (column + 1 < size).then(|| k + 1),
            (row > 0).then(|| k - size),
            (k + size < values.len()).then(|| k + size),
        ];
        inside(*k) && beside.into_iter().flatten().any(|other| !inside(other))
    };
    (0..values.len()).filter(is_edge).collect()
}

fn panel(
    volume: &Volume,
    plane: [usize; 3],
    pixels: Vec<u8>,
    point: [f64; 3],
    hole_radius: f64,
) -> Option<Panel> {
    let mut canvas = Canvas::of(&RgbImage::from_raw(PANEL, PANEL, pixels)?)?;
    let [right, up, fixed] = plane;
    let ends = [right, up].map(|axis| [volume.low[axis], volume.high[axis]]);
    let size = f64::from(PANEL);
    let on_canvas = |[x, y]: [f64; 2]| {
        let part = |k: usize, value: f64| (value - ends[k][0]) / (ends[k][1] - ends[k][0]) * size;
        [part(0, x), size - part(1, y)]
    };
    let radius = (hole_radius.powi(2) - point[fixed].powi(2)).max(0.0).sqrt();
    let circle = |k: u32| {
        let (sin, cos) = (f64::from(k) * core::f64::consts::TAU / 120.0).sin_cos();
        on_canvas([radius * cos, radius * sin])
    };
    if radius > 0.0 {
        canvas.line(&(0..120).map(circle).collect::<Vec<_>>(), true, 1.2, EDGE);
    }
    // Short marks at the edges show where the other two slices cut this one.
    let [x, y] = on_canvas([point[right], point[up]]);
    for line in [[[x, 0.0], [x, 9.0]], [[x, size - 9.0], [x, size]]] {
        canvas.line(&line, false, 1.5, CROSS);
    }
    for line in [[[0.0, y], [9.0, y]], [[size - 9.0, y], [size, y]]] {
        canvas.line(&line, false, 1.5, CROSS);
    }
    let title = format!("{} = {:.2} M", NAMES[fixed], point[fixed]).replace('-', "−");
    let axes = [right, up].map(|axis| format!("{} (M)", NAMES[axis]));
    Some(Panel { title, drawn: canvas.into_picture(), axes, ends })
}

#[cfg(test)]
mod tests {
    use super::super::paper;
    use super::*;
    use kerrlight_geodesic::vector::distance;

    /// e = 100 + x + 10 y + 100 z: every pixel is where it says.
    #[test]
    fn exact_slices_of_a_plane() {
        let empty = Volume::new([4, 5, 6], [-1.0; 3], [1.0, 2.0, 3.0], vec![0.0; 120]).unwrap();
        let value = |[x, y, z]: [f64; 3]| (100.0 + x + 10.0 * y + 100.0 * z) as f32;
        let values = (0..120).map(|k| value(empty.position(k))).collect();
        let volume = Volume::new(empty.nodes(), empty.low(), empty.high(), values).unwrap();
        let point = [0.5, 0.25, 1.5];
        // Pixels of 2 × 2: at a quarter and three quarters of the box, the upper ones first.
        let [x, y, z] = [[-0.5, 0.5], [-0.25, 1.25], [0.0, 2.0]];
        for (plane, corners) in [
            ([0, 1, 2], [[x[0], y[1], 1.5], [x[1], y[0], 1.5]]),
            ([0, 2, 1], [[x[0], 0.25, z[1]], [x[1], 0.25, z[0]]]),
            ([1, 2, 0], [[0.5, y[0], z[1]], [0.5, y[1], z[0]]]),
        ] {
            let cut = slice(&volume, plane, point, 2);
            for (found, corner) in [cut[0], cut[3]].into_iter().zip(corners) {
                assert!((found - value(corner)).abs() < 1e-3, "{plane:?} {found}");
            }
        }
    }

    #[test]
    fn exact_points_to_cut_through() {
        let scene = paper::scene_1(65);
        let centre = [3.5 * 0.75f64.sqrt(), 0.0, 1.75];
        let off = distance(Through::Maximum.point(&scene), centre);
        assert!(off < 0.5 * 3f64.sqrt() * 10.0 / 64.0);
        let empty = Volume::new([2; 3], [0.0; 3], [1.0, 2.0, 4.0], vec![0.0; 8]).unwrap();
        assert_eq!(Through::Maximum.point(&empty), [0.5, 1.0, 2.0]);
    }

    #[test]
    fn exact_size_of_the_sheet() {
        let scene = paper::scene_1(16);
        let shown = [Shown { name: "truth", volume: &scene }; 2];
        let at = Through::Maximum.point(&scene);
        let drawn = sheet(&shown, at, 2.0, None, "unit").unwrap();
        assert_eq!(drawn.dimensions(), (3 * (58 + 300 + 14) + 14, 2 * (30 + 28 + 300 + 46) + 74));
        assert!(sheet(&[], [0.0; 3], 2.0, None, "unit").is_none());
    }

    #[test]
    fn exact_edges_of_a_square() {
        // A block of 3 × 3 in 5 × 5: all of it but its middle, and nothing at a level that it does not reach.
        let block = |k: usize| (1..4).contains(&(k / 5)) && (1..4).contains(&(k % 5));
        let values: Vec<f32> = (0..25).map(|k| if block(k) { 3.0 } else { 0.0 }).collect();
        assert_eq!(edge(&values, 5, 3.0), [6, 7, 8, 11, 13, 16, 17, 18]);
        assert!(edge(&values, 5, 3.1).is_empty());
    }

    #[test]
    fn exact_outlines_are_drawn_in_their_colours() {
        let scene = paper::scene_1(33);
        let shown = [Shown { name: "truth", volume: &scene }];
        let at = Through::Maximum.point(&scene);
        let lines = Outlines { volume: &scene, levels: [0.3, 0.6] };
        let drawn = sheet(&shown, at, 0.0, Some(lines), "unit").unwrap();
        let count = |color: Rgb| drawn.pixels().filter(|pixel| pixel.0 == color).count();
        // The line around the brighter part is the shorter one.
        let [outer, inner] = OUTLINES.map(count);
        assert!(inner > 30 && outer > inner, "{outer} {inner}");
        let plain = sheet(&shown, at, 0.0, None, "unit").unwrap();
        assert!(plain.pixels().all(|pixel| pixel.0 != OUTLINES[1]));
    }
}

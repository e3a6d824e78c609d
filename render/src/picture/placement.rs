//! Placement of the camera, for other programs: matrices in flat space.

use super::Raster;
use super::grid::Grid;
use super::raw::Frame;
use crate::Error;
use crate::image::exr::CameraMatrices;
use crate::transport::{FAR, view};
use kerrlight_geodesic::vector::dot;
use kerrlight_geodesic::{Camera, Observer, View};

/// Range of distances of a camera's view, in M.
const DEPTHS: [f64; 2] = [0.1, 1e5];

/// Placement of a view in flat space: its place (M), and its axes to the right, up and back.
struct Placement {
    place: [f64; 3],
    axes: [[f64; 3]; 3],
}

/// e_r, e_θ and e_φ.
fn frame(sin: f64, cos: f64, azimuth: f64) -> [[f64; 3]; 3] {
    let (y, x) = azimuth.sin_cos();
    [[sin * x, sin * y, cos], [cos * x, cos * y, -sin], [-y, x, 0.0]]
}

impl Placement {
    fn of_observer(observer: &Observer) -> Self {
        let inclination = observer.inclination();
        let [out, down, right] = frame(inclination.sin(), inclination.cos(), observer.azimuth());
        let w = observer.inverse_radius();
        let distance = if w > 0.0 { 1.0 / w } else { FAR };
        Placement { place: out.map(|x| x * distance), axes: [right, down.map(|x| -x), out] }
    }

    fn of_camera(camera: &Camera) -> Self {
        let inclination = camera.inclination();
        let frame = frame(inclination.sin(), inclination.cos(), camera.azimuth());
        let axes = camera.axes().map(|axis| {
            core::array::from_fn(|k| (0..3).map(|j| axis[j] * frame[j][k]).sum::<f64>())
        });
        let [right, up, forward] = axes;
        let place = frame[0].map(|x| x * camera.radius());
        Placement { place, axes: [right, up, forward.map(|x| -x)] }
    }

    /// Returns the matrix from the world to the camera's coordinates, for row vectors.
    fn world_to_camera(&self) -> [[f64; 4]; 4] {
        let row = |k: usize| [self.axes[0][k], self.axes[1][k], self.axes[2][k], 0.0];
        let [x, y, z] = self.axes.map(|axis| -dot(axis, self.place));
        [row(0), row(1), row(2), [x, y, z, 1.0]]
    }
}

/// Returns the matrix from the camera's coordinates to normalised device coordinates, for row vectors: in perspective, or
/// orthographic.
fn projection([width, height]: [f64; 2], perspective: bool) -> [[f64; 4]; 4] {
    let ([near, far], [x, y]) = (DEPTHS, [2.0 / width, 2.0 / height]);
    // Looking along −z, depths of −1 at the near and 1 at the far end, as in OpenGL.
    let depth = far - near;
    let (scale, shift, toward, one) = match perspective {
        true => (-(far + near) / depth, -2.0 * far * near / depth, -1.0, 0.0),
        false => (-2.0 / depth, -(far + near) / depth, 0.0, 1.0),
    };
    [[x, 0.0, 0.0, 0.0], [0.0, y, 0.0, 0.0], [0.0, 0.0, scale, toward], [0.0, 0.0, shift, one]]
}

fn product(a: &[[f64; 4]; 4], b: &[[f64; 4]; 4]) -> [[f64; 4]; 4] {
    let entry = |i: usize, j: usize| (0..4).map(|k| a[i][k] * b[k][j]).sum();
    core::array::from_fn(|i| core::array::from_fn(|j| entry(i, j)))
}

fn flat(matrix: &[[f64; 4]; 4]) -> [f32; 16] {
    core::array::from_fn(|k| matrix[k / 4][k % 4] as f32)
}

/// The matrices of a view on a picture of some width and height, in its own units.
fn matrices(view: &View, size: [f64; 2]) -> CameraMatrices {
    let (placement, perspective) = match view {
        View::Screen(observer) => (Placement::of_observer(observer), false),
        View::Camera(camera) => (Placement::of_camera(camera), true),
    };
    let world_to_camera = placement.world_to_camera();
    let world_to_ndc = flat(&product(&world_to_camera, &projection(size, perspective)));
    CameraMatrices { world_to_camera: flat(&world_to_camera), world_to_ndc }
}

impl Raster {
    /// Returns the camera, in the flat space of the coordinates r n: an observer's screen is orthographic, at the
    /// observer's radius or at 1000 M; a camera's motion does not count.
    pub fn camera(&self) -> CameraMatrices {
        let size = [self.grid.width, self.grid.height].map(|pixels| pixels as f64 * self.grid.size);
        matrices(self.prepared.view(), size)
    }

    /// The same of a frame.
    ///
    /// # Errors
    /// If the camera is impossible there.
    pub fn camera_of(&self, frame: &Frame) -> Result<CameraMatrices, Error> {
        let scene = self.scene_at(frame.time);
        let (Grid { width, height, size, .. }, hole) = (Grid::new(&scene), self.prepared.hole());
        let size = [width, height].map(|pixels| pixels as f64 * size);
        Ok(matrices(&view(&scene, hole)?, size))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_geodesic::{Inclination, Kerr, Motion};

    /// A point by a matrix for row vectors, divided by its last coordinate.
    fn apply(m: &[f32; 16], [x, y, z]: [f64; 3]) -> [f64; 3] {
        let column = |j: usize| {
            [x, y, z, 1.0].iter().enumerate().map(|(i, p)| p * f64::from(m[4 * i + j])).sum::<f64>()
        };
        [0, 1, 2].map(|j| column(j) / column(3))
    }

    fn near(found: [f64; 3], expected: [f64; 3]) {
        let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-4, "{found:?} {expected:?}");
    }

    /// In the equatorial plane +y is to the right of an observer on the x axis, and +z up.
    #[test]
    fn exact_places_before_a_screen_and_a_camera() {
        let side = Inclination::from_degrees(90.0).unwrap();
        let screen = matrices(&View::Screen(Observer::at_infinity(side)), [20.0, 10.0]);
        near(apply(&screen.world_to_camera, [3.0, 4.0, 5.0]), [4.0, 5.0, 3.0 - 1000.0]);
        let [x, y, _] = apply(&screen.world_to_ndc, [3.0, 4.0, 5.0]);
        near([x, y, 0.0], [0.4, 1.0, 0.0]);
        let hole = Kerr::new(0.3).unwrap();
        let camera = Camera::new(&hole, side, 50.0, Motion::Zamo).unwrap();
        let turned = camera.with_azimuth(core::f64::consts::FRAC_PI_2);
        let seen = matrices(&View::Camera(turned), [2.0, 1.0]);
        near(apply(&seen.world_to_camera, [1.0, 10.0, 2.0]), [-1.0, 2.0, -40.0]);
        let [x, y, _] = apply(&seen.world_to_ndc, [1.0, 10.0, 2.0]);
        near([x, y, 0.0], [-1.0 / 40.0, 2.0 / 40.0 * 2.0, 0.0]);
        // Near and far planes.
        for (z, depth) in [(49.9, -1.0), (50.0 - 1e5, 1.0)] {
            near(apply(&seen.world_to_ndc, [0.0, z, 0.0]), [0.0, 0.0, depth]);
        }
        // Turned to the right the hole is on the left; on the line of sight of (x, y) it is where a photon arrives.
        let aside = matrices(&View::Camera(turned.with_pointing(0.2, 0.0, 0.0)), [2.0, 2.0]);
        near(
            apply(&aside.world_to_ndc, [0.0; 3]),
            [-0.2f64.tan(), 0.0, apply(&aside.world_to_ndc, [0.0; 3])[2]],
        );
    }
}

//! Vectors in three dimensions, as arrays `[x, y, z]`.

/// The scalar product.
///
/// ```
/// use kerrlight_geodesic::vector::{cross, dot};
/// let (x, y) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
/// assert_eq!((dot(x, y), cross(x, y)), (0.0, [0.0, 0.0, 1.0]));
/// ```
#[inline]
pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The vector product a × b, in the product of their units.
#[inline]
pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The Euclidean length, in the unit of the vector.
#[inline]
pub fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

/// The vector from b to a, in their unit.
#[inline]
pub fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// The Euclidean distance of two points, in their unit.
#[inline]
pub fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    norm(difference(a, b))
}

/// `x` turned by `angle` (radians) about the unit vector `axis`, right-handed: Rodrigues' formula.
///
/// ```
/// use kerrlight_geodesic::vector::{distance, rotate};
/// let turned = rotate([0.0, 0.0, 1.0], 90f64.to_radians(), [2.0, 0.0, 5.0]);
/// assert!(distance(turned, [0.0, 2.0, 5.0]) < 1e-15);
/// ```
#[inline]
pub fn rotate(axis: [f64; 3], angle: f64, x: [f64; 3]) -> [f64; 3] {
    let (sin, cos) = angle.sin_cos();
    let (along, swirl) = (dot(axis, x), cross(axis, x));
    core::array::from_fn(|k| cos * x[k] + sin * swirl[k] + (1.0 - cos) * along * axis[k])
}

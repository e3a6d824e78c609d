//! The crate from C: the functions of `include/kerrlight.h`, which documents them.
//!
//! The crate itself stays a Rust library. A library for C is made of it by
//!
//! ```text
//! cargo rustc --release -p kerrlight-geodesic --features capi --crate-type staticlib
//! ```
//!
//! (or `cdylib`), and `examples/c/shadow.c` uses it. Rust programs have no need of this module.

use crate::error::{Error, check};
use crate::rays::columns::{Points, RayTable};
use crate::rays::integrator::Integrator;
use crate::rays::request::{Placement, Request};
use crate::screen::observer::{Inclination, Observer};
use crate::spacetime::kerr::Kerr;
use std::cell::RefCell;
use std::ffi::{c_char, c_int};
use std::panic::{AssertUnwindSafe, catch_unwind};

mod sky;

pub use sky::{
    CameraPlace, SkyColumns, kerrlight_critical_curve, kerrlight_keplerian_redshift, kerrlight_sky,
};

/// `KERRLIGHT_OK`.
pub const OK: i32 = 0;
/// `KERRLIGHT_NULL_POINTER`: a pointer that must not be is null or misaligned.
pub const NULL_POINTER: i32 = 1;
/// `KERRLIGHT_OUT_OF_RANGE`.
pub const OUT_OF_RANGE: i32 = 2;
/// `KERRLIGHT_NO_ROOM`: a stride is smaller than the request needs.
pub const NO_ROOM: i32 = 3;
/// `KERRLIGHT_INTERNAL`: a bug.
pub const INTERNAL: i32 = 4;

/// `kerrlight_scene`: the hole, the observer, and how rays are traced.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct Scene {
    /// Spin in \[−1, 1\], dimensionless.
    pub spin: f64,
    /// Inclination in \[0, 180\] degrees.
    pub inclination_degrees: f64,
    /// Radius of the observer in M, or infinity.
    pub observer_radius: f64,
    /// Tolerance in \[1e-14, 1e-2\].
    pub tolerance: f64,
    /// 0 taylor-mino, 1 dop853-mino, 2 rk45-mino, 3 rk45-affine, 4 elliptic.
    pub integrator: i32,
}

/// `kerrlight_placement`: where rays are sampled.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SamplePlacement {
    /// 0 nowhere, 1 Mino time, 2 path length, 3 Gauss–Legendre.
    pub kind: i32,
    /// Number of points.
    pub points: usize,
    /// Smaller radius, in M.
    pub from: f64,
    /// Larger radius or that of the sphere, in M.
    pub to: f64,
}

/// `kerrlight_points`: columns of points, owned by the caller; null for what is not wanted.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct PointColumns {
    /// Room for the points of each ray.
    pub stride: usize,
    /// Number of points of each ray.
    pub count: *mut u32,
    /// Mino times, M⁻¹.
    pub mino_time: *mut f64,
    /// Radii, M.
    pub radius: *mut f64,
    /// Polar angles, radians.
    pub theta: *mut f64,
    /// Azimuths, radians.
    pub azimuth: *mut f64,
    /// Delays, M.
    pub delay: *mut f64,
    /// Covariant momenta for unit energy, four numbers each: p_t and p_r dimensionless, p_θ and p_φ in M.
    pub momentum: *mut f64,
    /// Path weights.
    pub weight: *mut f64,
}

/// `kerrlight_rays`: columns of rays, owned by the caller; null for what is not wanted.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct RayColumns {
    /// 0 captured, 1 escaped, 2 on a photon orbit, 3 out of steps.
    pub outcome: *mut i32,
    /// Mino time of each whole ray, M⁻¹.
    pub mino_total: *mut f64,
    /// Smallest radius in M of each ray that turns.
    pub turning_radius: *mut f64,
    /// Equatorial crossings of each ray.
    pub crossing_count: *mut u32,
    /// Estimated errors of r (relative), θ and azimuth (radians) and delay (M) of each ray.
    pub uncertainty: *mut f64,
    /// The first crossings.
    pub crossings: PointColumns,
    /// The samples.
    pub samples: PointColumns,
}

thread_local! {
    static MESSAGE: RefCell<String> = const { RefCell::new(String::new()) };
}

/// A code and its message.
struct Failure(i32, String);

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Failure(OUT_OF_RANGE, error.to_string())
    }
}

fn no_room(what: &str) -> Failure {
    Failure(NO_ROOM, format!("{what} is too small for the requested points"))
}

/// `kerrlight_trace`: see the header.
///
/// # Safety
/// Pointers are null or point to what the header says, and nobody else uses the arrays of
/// `out` meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kerrlight_trace(
    scene: *const Scene,
    rays: usize,
    alpha: *const f64,
    beta: *const f64,
    placement: *const SamplePlacement,
    out: *const RayColumns,
) -> i32 {
    guarded(|| {
        // SAFETY: the caller's promise.
        unsafe { trace(scene, rays, alpha, beta, placement, out) }
    })
}

/// The code of what `work` returns; its message is kept for [`kerrlight_last_error`].
fn guarded(work: impl FnOnce() -> Result<(), Failure>) -> i32 {
    let Failure(code, message) = match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(())) => return OK,
        Ok(Err(failure)) => failure,
        Err(panic) => {
            let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
            let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
            Failure(INTERNAL, text.unwrap_or_else(|| "a bug in kerrlight".to_owned()))
        }
    };
    MESSAGE.with(|last| *last.borrow_mut() = message);
    code
}

/// # Safety
/// As for [`kerrlight_trace`].
unsafe fn trace(
    scene: *const Scene,
    rays: usize,
    alpha: *const f64,
    beta: *const f64,
    placement: *const SamplePlacement,
    out: *const RayColumns,
) -> Result<(), Failure> {
    // SAFETY: these are null or point to one structure each.
    let (scene, out) = unsafe { (one(scene, "scene")?, one(out, "out")?) };
    let placement = if placement.is_null() {
        Placement::None
    } else {
        // SAFETY: not null, so it points to a structure.
        placed(*unsafe { one(placement, "placement")? })?
    };
    let most = match placement {
        Placement::None => 0,
        Placement::MinoTime(points) | Placement::PathLength { points, .. } => points,
        Placement::GaussLegendre { points, .. } => points.saturating_mul(2),
    };
    if out.samples.stride < most {
        return Err(no_room("samples.stride"));
    }
    check_columns(out, rays)?;
    // SAFETY: each has as many numbers as there are rays.
    let (alpha, beta) = unsafe { (many(alpha, rays, "alpha")?, many(beta, rays, "beta")?) };
    let (hole, observer) = placed_observer(scene)?;
    let request = request(out, placement);
    let table =
        integrator(*scene)?.trace(&hole, &observer, alpha, beta, scene.tolerance, &request)?;
    // SAFETY: the arrays of `out` are null or have the lengths that the header says.
    unsafe { fill(out, &table, rays) };
    Ok(())
}

fn placed_observer(scene: &Scene) -> Result<(Kerr, Observer), Failure> {
    let hole = Kerr::new(scene.spin)?;
    let inclination = Inclination::from_degrees(scene.inclination_degrees)?;
    let observer = if scene.observer_radius == f64::INFINITY {
        Observer::at_infinity(inclination)
    } else {
        Observer::at_radius(inclination, scene.observer_radius)?
    };
    Ok((hole, observer))
}

fn placed(placement: SamplePlacement) -> Result<Placement, Failure> {
    let SamplePlacement { kind, points, from, to } = placement;
    let allowed = "one of KERRLIGHT_NOWHERE (0) to KERRLIGHT_GAUSS_LEGENDRE (3)";
    Ok(match kind {
        0 => Placement::None,
        1 => Placement::MinoTime(points),
        2 => Placement::PathLength { points, radius: to },
        3 => Placement::GaussLegendre { points, from, to },
        _ => return Err(Error::out_of_range("placement", f64::from(kind), allowed).into()),
    })
}

fn integrator(scene: Scene) -> Result<Integrator, Failure> {
    const NAMES: [&str; 5] = ["taylor-mino", "dop853-mino", "rk45-mino", "rk45-affine", "elliptic"];
    let name = usize::try_from(scene.integrator).ok().and_then(|k| NAMES.get(k));
    let found = name.and_then(|name| Integrator::named(name));
    let allowed = "0 to 4, without 3 in a library built without the feature `affine`";
    check("integrator", f64::from(scene.integrator), found.is_some(), allowed)?;
    Ok(found.unwrap_or_default())
}

fn request(out: &RayColumns, samples: Placement) -> Request {
    let wanted = |column: fn(&PointColumns) -> *mut f64| {
        [&out.crossings, &out.samples].into_iter().any(|points| !column(points).is_null())
    };
    Request {
        crossings: out.crossings.stride,
        samples,
        azimuth: wanted(|points| points.azimuth),
        time: wanted(|points| points.delay),
        momentum: wanted(|points| points.momentum),
        weight: !out.samples.weight.is_null(),
        uncertainty: !out.uncertainty.is_null(),
    }
}

/// Everything that can be wrong with the columns, before any of them is touched.
fn check_columns(out: &RayColumns, rays: usize) -> Result<(), Failure> {
    for (points, what) in [(&out.crossings, "crossings.stride"), (&out.samples, "samples.stride")] {
        let size =
            points.stride.checked_mul(4 * size_of::<f64>()).and_then(|s| s.checked_mul(rays));
        if size.is_none_or(|size| isize::try_from(size).is_err()) {
            let allowed = "a number of points that an array can hold";
            let value = points.stride as f64;
            return Err(Error::out_of_range(what, value, allowed).into());
        }
        let columns = [
            points.mino_time,
            points.radius,
            points.theta,
            points.azimuth,
            points.delay,
            points.momentum,
            points.weight,
        ];
        if !columns.iter().all(|column| column.is_aligned()) || !points.count.is_aligned() {
            return Err(Failure(NULL_POINTER, "a column of points is misaligned".to_owned()));
        }
    }
    let numbers = [out.mino_total, out.turning_radius, out.uncertainty];
    let integers = out.outcome.is_aligned() && out.crossing_count.is_aligned();
    if !integers || !numbers.iter().all(|column| column.is_aligned()) {
        return Err(Failure(NULL_POINTER, "a column of rays is misaligned".to_owned()));
    }
    Ok(())
}

/// # Safety
/// `pointer` is null, misaligned, or points to a value for the time of the call.
unsafe fn one<'a, T>(pointer: *const T, what: &str) -> Result<&'a T, Failure> {
    if pointer.is_null() || !pointer.is_aligned() {
        return Err(Failure(NULL_POINTER, format!("{what} is null or misaligned")));
    }
    // SAFETY: checked, and the caller's promise.
    Ok(unsafe { &*pointer })
}

/// # Safety
/// `pointer` is null, misaligned, or points to `n` values for the time of the call.
unsafe fn many<'a>(pointer: *const f64, n: usize, what: &str) -> Result<&'a [f64], Failure> {
    if n == 0 {
        return Ok(&[]);
    }
    // SAFETY: the caller's promise.
    let first = unsafe { one(pointer, what)? };
    // SAFETY: as above.
    Ok(unsafe { core::slice::from_raw_parts(first, n) })
}

/// Writes `values` to the start of an array, unless it is null.
///
/// # Safety
/// `column` is null or points to an array of at least as many values.
unsafe fn put<T>(column: *mut T, values: impl Iterator<Item = T>) {
    if column.is_null() {
        return;
    }
    for (k, value) in values.enumerate() {
        // SAFETY: the caller's promise.
        unsafe { column.add(k).write(value) };
    }
}

/// # Safety
/// The columns are null or have the lengths that the header says.
unsafe fn fill(out: &RayColumns, table: &RayTable, rays: usize) {
    let errors = table.uncertainty.iter().flat_map(|u| [u.radius, u.theta, u.azimuth, u.delay]);
    // SAFETY: the caller's promise, for each column.
    unsafe {
        put(out.outcome, table.outcome.iter().map(|outcome| i32::from(outcome.code())));
        put(out.mino_total, table.mino_total.iter().copied());
        put(out.turning_radius, table.turning_radius.iter().copied());
        put(out.crossing_count, table.crossing_count.iter().copied());
        put(out.uncertainty, errors);
        fill_points(&out.crossings, &table.crossings, rays);
        fill_points(&out.samples, &table.samples, rays);
    }
}

/// # Safety
/// As for [`fill`].
unsafe fn fill_points(out: &PointColumns, points: &Points, rays: usize) {
    let stride = out.stride;
    // Place by place: the point there, or nothing.
    let places = || {
        (0..rays).flat_map(move |ray| {
            let range = points.of(ray);
            (0..stride).map(move |k| Some(range.start + k).filter(|k| range.contains(k)))
        })
    };
    let at = |column: &[f64], place: Option<usize>| {
        place.and_then(|k| column.get(k)).copied().unwrap_or(f64::NAN)
    };
    let momenta = places().flat_map(|place| {
        place.and_then(|k| points.momentum.get(k)).copied().unwrap_or([f64::NAN; 4])
    });
    // SAFETY: the caller's promise: the columns have `rays` or `rays · stride` places.
    unsafe {
        put(out.count, (0..rays).map(|ray| points.of(ray).len() as u32));
        put(out.mino_time, places().map(|k| at(&points.mino_time, k)));
        put(out.radius, places().map(|k| at(&points.radius, k)));
        put(out.theta, places().map(|k| at(&points.theta, k)));
        put(out.azimuth, places().map(|k| at(&points.azimuth, k)));
        put(out.delay, places().map(|k| at(&points.delay, k)));
        put(out.weight, places().map(|k| at(&points.weight, k)));
        put(out.momentum, momenta);
    }
}

/// `kerrlight_last_error`: copies the message of this thread's last error, cut and ended by 0
/// as needed, and returns the length of the whole.
///
/// # Safety
/// `buffer` is null or points to `size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kerrlight_last_error(buffer: *mut c_char, size: usize) -> usize {
    let copied = catch_unwind(|| {
        MESSAGE.with(|last| {
            let message = last.borrow();
            if let Some(room) = size.checked_sub(1).filter(|_| !buffer.is_null()) {
                let bytes = &message.as_bytes()[..room.min(message.len())];
                // SAFETY: at most `size` bytes with the 0 at the end.
                unsafe { put(buffer, bytes.iter().map(|b| *b as c_char).chain([0])) };
            }
            message.len()
        })
    });
    copied.unwrap_or(0)
}

/// `kerrlight_version`: "major.minor.patch".
#[unsafe(no_mangle)]
pub extern "C" fn kerrlight_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

// The header's enumerations are of C's `int`, which `int32_t` holds on every platform that has
// Rust's standard library.
const _: () = assert!(size_of::<c_int>() == size_of::<i32>());

//! Data for a shader of the sky: cameras, directions of escape, frequency shifts, and the critical curve.

use super::{Failure, NULL_POINTER, Scene, guarded, integrator, many, one, placed_observer, put};
use crate::analytic::CriticalCurve;
use crate::error::{Error, check};
use crate::matter::flow;
use crate::rays::columns::RayTable;
use crate::rays::request::Request;
use crate::screen::camera::{Camera, Motion};
use crate::screen::observer::Inclination;
use crate::screen::view::View;
use crate::spacetime::kerr::Kerr;
use core::f64::consts::TAU;

/// `kerrlight_camera`: a camera in place of the scene's observer.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct CameraPlace {
    /// Boyer–Lindquist radius in M, outside the horizon.
    pub radius: f64,
    /// Polar angle in \[0, 180\] degrees.
    pub inclination_degrees: f64,
    /// Azimuth, radians.
    pub azimuth: f64,
    /// Turn to the right, radians.
    pub yaw: f64,
    /// Upwards, radians.
    pub pitch: f64,
    /// Clockwise, radians.
    pub roll: f64,
    /// 0 static, 1 zero angular momentum, 2 Keplerian, 3 free fall.
    pub motion: i32,
}

/// `kerrlight_sky_rays`: columns of rays, owned by the caller; null for what is not wanted.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct SkyColumns {
    /// 0 captured, 1 escaped, 2 on a photon orbit, 3 out of steps.
    pub outcome: *mut i32,
    /// Unit vectors of the directions in which rays escape, three numbers each.
    pub direction: *mut f64,
    /// Frequency at the camera over that at infinity.
    pub blueshift: *mut f64,
}

/// `kerrlight_sky`: see the header.
///
/// # Safety
/// Pointers are null or point to what the header says, and nobody else uses the arrays of
/// `out` meanwhile.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kerrlight_sky(
    scene: *const Scene,
    camera: *const CameraPlace,
    rays: usize,
    x: *const f64,
    y: *const f64,
    out: *const SkyColumns,
) -> i32 {
    guarded(|| {
        // SAFETY: the caller's promise.
        unsafe { trace(scene, camera, rays, [x, y], out) }
    })
}

/// # Safety
/// As for [`kerrlight_sky`].
unsafe fn trace(
    scene: *const Scene,
    camera: *const CameraPlace,
    rays: usize,
    [x, y]: [*const f64; 2],
    out: *const SkyColumns,
) -> Result<(), Failure> {
    // SAFETY: these are null or point to one structure each.
    let (scene, out) = unsafe { (one(scene, "scene")?, one(out, "out")?) };
    let aligned = out.direction.is_aligned() && out.blueshift.is_aligned();
    if !(aligned && out.outcome.is_aligned()) {
        return Err(Failure(NULL_POINTER, "a column of rays is misaligned".to_owned()));
    }
    // SAFETY: each has as many numbers as there are rays.
    let (x, y) = unsafe { (many(x, rays, "x")?, many(y, rays, "y")?) };
    let (hole, view) = if camera.is_null() {
        let (hole, observer) = placed_observer(scene)?;
        (hole, View::Screen(observer))
    } else {
        let hole = Kerr::new(scene.spin)?;
        // SAFETY: not null, so it points to a structure.
        (hole, View::Camera(placed(&hole, unsafe { one(camera, "camera")? })?))
    };
    let tracer = integrator(*scene)?;
    let table = tracer.trace_view(&hole, &view, x, y, scene.tolerance, &Request::default())?;
    // SAFETY: the arrays of `out` are null or have the lengths that the header says.
    unsafe { fill(out, &table, (&view, x, y)) };
    Ok(())
}

fn placed(hole: &Kerr, camera: &CameraPlace) -> Result<Camera, Failure> {
    let CameraPlace { radius, inclination_degrees, azimuth, yaw, pitch, roll, motion } = *camera;
    let motion = match motion {
        0 => Motion::Static,
        1 => Motion::Zamo,
        2 => Motion::Keplerian,
        3 => Motion::FreeFall,
        _ => {
            let allowed = "one of KERRLIGHT_STATIC (0) to KERRLIGHT_FREE_FALL (3)";
            return Err(Error::out_of_range("motion", f64::from(motion), allowed).into());
        }
    };
    let place = Inclination::from_degrees(inclination_degrees)?;
    let camera = Camera::new(hole, place, radius, motion)?;
    Ok(camera.with_azimuth(azimuth).with_pointing(yaw, pitch, roll))
}

/// # Safety
/// The columns are null or have the lengths that the header says.
unsafe fn fill(out: &SkyColumns, table: &RayTable, (view, x, y): (&View, &[f64], &[f64])) {
    let shift = |(x, y): (&f64, &f64)| match view {
        View::Screen(_) => 1.0,
        View::Camera(_) => view.blueshift(*x, *y).unwrap_or(f64::NAN),
    };
    // SAFETY: the caller's promise, for each column.
    unsafe {
        put(out.outcome, table.outcome.iter().map(|outcome| i32::from(outcome.code())));
        put(out.direction, table.exit.iter().flatten().copied());
        put(out.blueshift, x.iter().zip(y).map(shift));
    }
}

/// `kerrlight_keplerian_redshift`: see the header.
///
/// # Safety
/// `factor` is null or points to a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kerrlight_keplerian_redshift(
    spin: f64,
    radius: f64,
    lambda: f64,
    factor: *mut f64,
) -> i32 {
    guarded(|| {
        // SAFETY: the caller's promise.
        unsafe { one(factor.cast_const(), "factor")? };
        check("lambda", lambda, lambda.is_finite(), "a finite number (M)")?;
        let found = flow::keplerian_redshift(&Kerr::new(spin)?, radius, lambda);
        let allowed = "outside the photon orbit, where light with this lambda comes from (M)";
        let found = found.filter(|factor| factor.is_finite());
        let found = found.ok_or(Error::out_of_range("radius", radius, allowed))?;
        // SAFETY: checked, and the caller's promise.
        unsafe { put(factor, core::iter::once(found)) };
        Ok(())
    })
}

/// `kerrlight_critical_curve`: see the header.
///
/// # Safety
/// `alpha` and `beta` point to `points` numbers each.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kerrlight_critical_curve(
    spin: f64,
    inclination_degrees: f64,
    points: usize,
    alpha: *mut f64,
    beta: *mut f64,
) -> i32 {
    guarded(|| {
        if points == 0 {
            return Ok(());
        }
        // SAFETY: the caller's promise.
        unsafe { (one(alpha.cast_const(), "alpha")?, one(beta.cast_const(), "beta")?) };
        let hole = Kerr::new(spin)?;
        let curve = CriticalCurve::new(&hole, Inclination::from_degrees(inclination_degrees)?);
        let along = |k: usize| curve.point(TAU * k as f64 / points as f64);
        // SAFETY: the caller's promise.
        unsafe {
            put(alpha, (0..points).map(|k| along(k).alpha));
            put(beta, (0..points).map(|k| along(k).beta));
        }
        Ok(())
    })
}

//! Rays that were not traced, or not for this hole, are not numbers, and errors name what is wrong.

use crate::{at_infinity, at_radius, inclination};
use kerrlight_geodesic::analytic::ClosedForm;
use kerrlight_geodesic::{
    BlockRequest, BlockTracer, Camera, Error, Integrator, Kerr, Motion, Outcome, Path, PathOfRay,
    Placement, PlaneCrossing, Quantities, Ray, RayBlock, RayVisitor, Request, TracedRay, Tracer,
    Unresolved, View, ZamoFrame, flow, footprint,
};

fn traced(hole: &Kerr, ray: &Ray, quantities: Quantities) -> Path {
    let mut path = Path::new();
    Tracer::new(1e-12).unwrap().trace(hole, ray, quantities, &mut path);
    path
}

/// r and θ are those of a path with azimuth; what needs one is no number.
#[test]
fn exact_a_path_without_azimuth_has_no_place_and_no_redshift() {
    let hole = Kerr::new(0.9).unwrap();
    let ray = at_infinity(60.0).ray(&hole, -6.0, 2.0).unwrap();
    let [whole, polar] = [Quantities::ALL, Quantities::POLAR].map(|q| traced(&hole, &ray, q));
    let time = whole.equatorial_crossings().next().unwrap();
    let [known, bare] = [&whole, &polar].map(|path| path.at(time));
    assert!((bare.radius() / known.radius() - 1.0).abs() < 1e-11);
    assert!((bare.theta() - known.theta()).abs() < 1e-11);
    let turning = [0.0, 0.0, 0.02];
    assert!(flow::rotating_redshift(&hole, &known, turning).is_some());
    assert_eq!(flow::rotating_redshift(&hole, &bare, turning), None);
    assert!(bare.cartesian()[..2].iter().all(|x| x.is_nan()), "{:?}", bare.cartesian());
    assert!(bare.momentum(&hole, ray.lambda)[2].is_nan());
    let [known, bare] = [&known, &bare].map(|at| ZamoFrame::of(&hole, at).unwrap().radius());
    assert!((known / bare - 1.0).abs() < 1e-11);
}

/// A line to be drawn from infinity on has no NaN.
#[test]
fn exact_places_at_infinity_are_infinite() {
    let hole = Kerr::new(0.9).unwrap();
    for (angle, beta) in [(60.0, 2.0), (90.0, 0.0), (0.0, 1.0)] {
        let ray = at_infinity(angle).ray(&hole, -6.0, beta).unwrap();
        let path = traced(&hole, &ray, Quantities::ALL);
        for time in [0.0, path.mino_total()] {
            let place = path.at(time).cartesian();
            assert!(place.iter().all(|x| !x.is_nan()), "{angle}: {place:?}");
            assert!(place.iter().any(|x| x.is_infinite()), "{angle}: {place:?}");
        }
    }
}

#[test]
fn exact_a_ray_of_another_hole_is_refused() {
    let [own, other] = [0.9, -0.9].map(|spin| Kerr::new(spin).unwrap());
    let camera = Camera::new(&own, inclination(80.0), 12.0, Motion::Static).unwrap();
    let view = View::Camera(camera);
    let message = |error: Error| error.to_string();
    let refused =
        "spin = -0.9 is not allowed: the spin that the ray or the camera was made for".to_owned();
    assert!(view.ray(&own, 0.1, 0.2).is_ok());
    assert_eq!(view.ray(&other, 0.1, 0.2).map_err(message).unwrap_err(), refused);
    assert_eq!(view.beam(&other, 0.1, 0.2).map_err(message).unwrap_err(), refused);
    let block = BlockTracer::new(other, view, Integrator::TaylorMino, 1e-8);
    assert_eq!(block.map_err(message).unwrap_err(), refused);
    let beam = view.beam(&own, 0.1, 0.2).unwrap();
    let sky = footprint::of_ray(&other.lift(), &beam, 1e-8, &mut Path::empty());
    assert_eq!(sky.map_err(message).unwrap_err(), refused);

    let ray = view.ray(&own, 0.1, 0.2).unwrap();
    let path = traced(&other, &ray, Quantities::ALL);
    assert_eq!(path.outcome(), Outcome::Unresolved(Unresolved::OtherHole));
    assert!(path.at(0.1).radius().is_nan() && path.uncertainty_at(0.1).radius.is_infinite());
    let form = ClosedForm::new(&other, &ray);
    assert!(form.mino_total().is_nan() && form.crossings().next().is_none());
    let screen = at_infinity(80.0).ray(&own, 5.0, 1.0).unwrap();
    assert_eq!(traced(&other, &screen, Quantities::POLAR).steps(), 0);
}

#[test]
fn regress_errors_of_cameras_name_what_is_wrong() {
    let hole = Kerr::new(0.9).unwrap();
    let new = |radius, motion| Camera::new(&hole, inclination(80.0), radius, motion);
    for motion in [Motion::Static, Motion::Zamo, Motion::Keplerian, Motion::FreeFall] {
        assert!(new(1e30, motion).unwrap().ray(0.1, 0.2).is_ok());
        let error = new(1e300, motion).unwrap_err();
        let text = "camera radius = 1e300 is not allowed: outside the horizon and at most 1e30 (M)";
        assert_eq!(error.to_string(), text);
    }
    assert_eq!(new(f64::NAN, Motion::Zamo).unwrap_err().field(), "camera radius");
    for (rates, field) in [
        ([f64::NAN, 0.0, 0.0], "dr/dt"),
        ([0.0, f64::INFINITY, 0.0], "dtheta/dt"),
        ([0.0, 0.0, f64::NAN], "dphi/dt"),
        ([2.0, 0.0, 0.0], "camera speed"),
    ] {
        let error = Camera::moving(&hole, inclination(80.0), 9.0, rates).unwrap_err();
        assert_eq!(error.field(), field);
    }
    let camera = new(9.0, Motion::Static).unwrap();
    let astray = camera.with_pointing(f64::NAN, 0.0, 0.0).ray(0.0, 0.0).unwrap_err();
    assert_eq!(astray.field(), "yaw, pitch or roll");
    let astray = camera.with_azimuth(f64::INFINITY).ray(0.0, 0.0).unwrap_err();
    assert_eq!(astray.field(), "camera azimuth");
    let observer = at_infinity(60.0).with_azimuth(f64::NAN);
    assert_eq!(observer.ray(&hole, 1.0, 2.0).unwrap_err().field(), "observer azimuth");
}

struct Nothing;

impl RayVisitor for Nothing {
    fn take(
        &mut self,
        _: usize,
        _: &TracedRay,
        _: &[PlaneCrossing],
        _: Option<PathOfRay<'_>>,
    ) -> Result<(), Error> {
        Ok(())
    }
}

/// Every integrator ends a finite observer's ray at its radius, and knows its direction at infinity.
#[test]
fn exact_ends_and_directions_of_blocks_do_not_depend_on_the_integrator() {
    let hole = Kerr::new(0.7).unwrap();
    let request = BlockRequest { exit: true, crossings: 3, ..BlockRequest::default() };
    let bare = BlockRequest { exit: false, ..request.clone() };
    for radius in [20.0, 1000.0] {
        let observer = at_radius(60.0, radius);
        let trace = |integrator, request: &BlockRequest| {
            let tracer = BlockTracer::new(hole, View::Screen(observer), integrator, 1e-11).unwrap();
            let mut block = RayBlock::default();
            tracer.trace(&[7.0, -3.0], &[3.0, 8.0], request, &mut block, &mut Nothing).unwrap();
            block.rays().to_vec()
        };
        let steps = trace(Integrator::TaylorMino, &request);
        let closed = trace(Integrator::Elliptic, &request);
        for (a, b) in
            steps.iter().zip(&closed).chain(steps.iter().zip(&trace(Integrator::Elliptic, &bare)))
        {
            assert!((a.mino_total / b.mino_total - 1.0).abs() < 1e-10, "{a:?} {b:?}");
        }
        for (k, (a, b)) in steps.iter().zip(&closed).enumerate() {
            let (a, b) = (a.exit.unwrap(), b.exit.unwrap());
            let ray = observer.ray(&hole, [7.0, -3.0][k], [3.0, 8.0][k]).unwrap();
            let path = traced(&hole, &ray, Quantities::ALL);
            let far = path.at(path.mino_total()).direction;
            for axis in 0..3 {
                assert!((a[axis] - far[axis]).abs() < 1e-9 && (b[axis] - far[axis]).abs() < 1e-9);
            }
        }
    }
}

/// A table of a camera's rays: samples from the camera on, crossings and directions of escape are those of single paths.
#[test]
fn exact_tables_of_cameras_agree_with_paths() {
    let hole = Kerr::new(0.9).unwrap();
    let outside = Camera::new(&hole, inclination(80.0), 12.0, Motion::Keplerian).unwrap();
    let inside = Camera::new(&hole, inclination(90.0), 1.7, Motion::Zamo).unwrap();
    let inside = inside.with_pointing(3.0, 0.1, 0.0);
    let request = Request { crossings: 2, ..Request::samples(Placement::MinoTime(6)) };
    let (x, y): (Vec<f64>, Vec<f64>) =
        (0..60).map(|k| (0.09 * f64::from(k) - 2.6, 0.07 * f64::from(k % 7) - 0.2)).unzip();
    for camera in [outside, inside] {
        let view = View::Camera(camera);
        let mut seen = [0; 2];
        for integrator in [Integrator::TaylorMino, Integrator::Elliptic] {
            let rays = integrator.trace_view(&hole, &view, &x, &y, 1e-12, &request).unwrap();
            assert_eq!((rays.len(), rays.exit.len()), (60, 60));
            for (k, outcome) in rays.outcome.iter().enumerate() {
                let path = traced(&hole, &camera.ray(x[k], y[k]).unwrap(), Quantities::ALL);
                assert_eq!((*outcome, rays.mino_total[k]), (path.outcome(), path.mino_total()));
                let escapes = *outcome == Outcome::Escaped;
                let end = path.at(path.mino_total()).direction;
                assert!(if escapes { rays.exit[k] == end } else { rays.exit[k][0].is_nan() });
                seen[usize::from(escapes)] += 1;
                let samples = rays.samples.of(k);
                assert_eq!(samples.len(), 6);
                let dark = camera.ray(x[k], y[k]).unwrap().is_from_horizon;
                for (j, place) in samples.enumerate().filter(|_| !dark) {
                    let r = rays.samples.radius[place];
                    assert!(r.is_finite(), "{k} {j}");
                    let part = if escapes { 6.0 } else { 5.0 };
                    let expected = path.at(path.mino_total() * (j as f64 / part)).radius();
                    assert!((r / expected - 1.0).abs() < 1e-9, "{k} {j}: {r} {expected}");
                }
            }
        }
        assert!(seen.iter().all(|count| *count > 10), "{seen:?}");
    }
}

//! Stokes factors of a fit against published formulas, pictures of the renderer and each other.

use super::*;
use crate::fit::linear::tests::{movie_about, of_images, solved};
use crate::fit::linear::{LinearProblem, LinearSettings, Voxels, Weighted};
use crate::representation::Degree;
use core::f64::consts::{PI, TAU};
use kerrlight_render::polarization::{
    Components, FieldFrame, MixedField, Normalisation, PolarizationLaw, Stokes, StokesParameter,
};
use kerrlight_render::scene::Scene;
use kerrlight_render::transport::{PreparedScene, RayResult, Scratch};

/// The textbook's exponents, a field of these components (vertical, radial, toroidal).
pub fn law(frame: FieldFrame, [vertical, radial, toroidal]: [f64; 3]) -> PolarizationLaw {
    PolarizationLaw {
        field: MixedField { vertical, radial, toroidal, radial_sine_power: 0.0 },
        components: Components::Orthonormal,
        frame,
        redshift_power: 3.0,
        field_power: 2.0,
        sine_power: 2.0,
        fraction: 0.75,
        normalisation: Normalisation::None,
        turn_deg: 0.0,
    }
}

/// Few rays about a hole.
pub fn traced(spin: f64, degrees: f64) -> (Kerr, Sightlines) {
    some_traced(spin, degrees, 12)
}

fn some_traced(spin: f64, degrees: f64, count: usize) -> (Kerr, Sightlines) {
    let hole = Kerr::new(spin).unwrap();
    let observer = Observer::at_infinity(Inclination::from_degrees(degrees).unwrap());
    let at = |k: usize| (9.0 * (0.9 * k as f64).sin() + 0.1, 8.0 * (1.3 * k as f64).cos());
    let (alpha, beta): (Vec<f64>, Vec<f64>) = (0..count).map(at).unzip();
    let region = Region { r_min: 4.0, r_max: 12.0, z_width: 4.0 };
    let sampling = Sampling::Gauss { order: 4, split: 1 };
    let request = SightlineRequest { region, sampling, delay: false, momentum: true };
    let lines = Sightlines::trace(&hole, &observer, &alpha, &beta, &request).unwrap();
    (hole, lines)
}

pub fn view(law: PolarizationLaw, degrees: f64) -> PolarizedView {
    PolarizedView {
        law,
        axis: Axis::new([0.0, 0.0, 1.0]).unwrap(),
        sin_inclination: degrees.to_radians().sin(),
        position_angle: 0.0,
        unit: None,
    }
}

/// The difference of two position angles.
pub fn apart(a: f64, b: f64) -> f64 {
    let d = (a - b) / PI;
    PI * (d - d.round())
}

const KEPLERIAN: AngularVelocity = AngularVelocity::Keplerian { drag: 0.0 };

/// A ray from azimuth φ of a ring about a hole without spin, by Beloborodov's 1 − cos α = (1 − cos ψ)(1 − 2/r): where it
/// arrives, cos ψ and cos α, and 1 − 2/r.
fn ring(r: f64, phi: f64, inclination: f64) -> ([f64; 2], [f64; 3]) {
    let (s, c) = inclination.sin_cos();
    let cos_psi = s * phi.cos();
    let lapse = 1.0 - 2.0 / r;
    let cos_alpha = 1.0 - (1.0 - cos_psi) * lapse;
    let impact = r * (1.0 - cos_alpha * cos_alpha).max(0.0).sqrt() / lapse.sqrt();
    // Across the line of sight: west ŷ, north (−c, 0, s).
    let (west, north) = (phi.sin(), -c * phi.cos());
    let size = west.hypot(north);
    ([impact * west / size, impact * north / size], [cos_psi, cos_alpha, lapse])
}

/// Loops in Q and U of gas on a circle in a vertical field at low inclination, after Narayan et al. 2021
/// (arXiv:2105.01804) and Gelles et al. 2021 (arXiv:2105.09440): two of them in each orbit, one inside the other, and
/// I by their formula g³ sin²θ_B.
#[test]
fn paper_loops_of_a_vertical_field() {
    let (hole, r, inclination) = (Kerr::new(0.0).unwrap(), 8.0, 20f64.to_radians());
    let law = law(FieldFrame::Gas, [1.0, 0.0, 0.0]);
    let count = 360;
    let mut loops = Vec::new();
    for k in 0..count {
        let phi = TAU * k as f64 / count as f64;
        let ([alpha, beta], [cos_psi, cos_alpha, lapse]) = ring(r, phi, inclination);
        // The photon's momentum for unit energy: p_r = cos α/(1 − 2/r), L = −α sin i about the axis.
        let l_z = -alpha * inclination.sin();
        let impact = alpha.hypot(beta);
        let polar = -(impact * impact - l_z * l_z).max(0.0).sqrt();
        let (sin, cos) = phi.sin_cos();
        let lines = Sightlines {
            pixels: 1,
            pixel: vec![0],
            starts: vec![0, 1],
            position: [vec![r * cos], vec![r * sin], vec![0.0]],
            weight: vec![1.0],
            momentum: [vec![-polar * sin], vec![polar * cos], vec![l_z]],
            radial: vec![cos_alpha],
            arrivals: vec![Arrival { end: 1, place: [alpha, beta] }],
            ..Sightlines::default()
        };
        let seen = view(law, 20.0).factors(&lines, &hole, &KEPLERIAN).unwrap()[0];
        let expected = narayan(r, [alpha, beta], [cos_alpha, l_z, polar], lapse);
        assert!((seen.i / expected[0] - 1.0).abs() < 1e-9, "{phi}: {} {expected:?}", seen.i);
        assert!(apart(seen.evpa(), expected[1]).abs() < 1e-9, "{phi}: {cos_psi}");
        loops.push(seen.u.atan2(seen.q));
    }
    let step = |k: usize| {
        let turn = loops[(k + 1) % count] - loops[k];
        turn - TAU * (turn / TAU).round()
    };
    let turns = (0..count).map(step).sum::<f64>() / TAU;
    assert!((turns.abs() - 2.0).abs() < 1e-9, "{turns} loops");
}

/// Intensity and position angle by Narayan et al. 2021: Lorentz factors and cross products in axes r, φ, z.
fn narayan(r: f64, [alpha, beta]: [f64; 2], k: [f64; 3], lapse: f64) -> [f64; 2] {
    let [cos_alpha, l_z, polar] = k;
    let root = lapse.sqrt();
    let speed = r.powf(-1.5) * r / root;
    let gamma = 1.0 / (1.0 - speed * speed).sqrt();
    let (kt, kr, kp, kz) = (1.0 / root, cos_alpha / root, l_z / r, -polar / r);
    let of_gas = [gamma * (kt - speed * kp), kr, gamma * (kp - speed * kt), kz];
    // k × ẑ over the energy.
    let f = [of_gas[2] / of_gas[0], -of_gas[1] / of_gas[0]];
    let back = [gamma * speed * f[1], f[0], gamma * f[1]];
    let k1 = r * (kt * back[1] - kr * back[0]);
    let k2 = -r * kz * back[2];
    let (e_a, e_b) = (beta * k2 + alpha * k1, beta * k1 - alpha * k2);
    let sine = f[0] * f[0] + f[1] * f[1];
    [of_gas[0].powi(-3) * sine, (-e_a).atan2(e_b)]
}

/// A fit's I, Q and U of a spot are those of the renderer's picture of it.
#[test]
fn exact_polarised_spot_of_the_renderer() {
    let text = "hole = { spin = 0.9 }\nobserver = { inclination_deg = 50.0, time = 40.0 }\n\
         screen = { field_of_view_m = 24.0, width = 16 }\n\
         tracer = { integrator = \"taylor-mino\", tolerance = 1e-6 }\n\
         effects = { redshift = true, polarization = true, spectral_index = 1.0 }\n\
         magnetic_field = { vertical = 0.7, radial = 0.3, toroidal = 0.4 }\n\
         [[spot]]\nradius = 7.0\nphase_deg = 40.0\naxis = [0.0, 0.0, 1.0]\nsigma = 1.0\n\
         peak_emissivity = 1.0\nsheared_since = 40.0\n";
    let scene = PreparedScene::new(&Scene::parse(text).unwrap(), None).unwrap();
    let side = 14;
    let at = |k: usize| -10.0 + 20.0 * (k as f64 + 0.5) / side as f64;
    let (alpha, beta): (Vec<f64>, Vec<f64>) =
        (0..side * side).map(|k| (at(k % side), at(k / side))).unzip();
    let hole = Kerr::new(0.9).unwrap();
    let observer = Observer::at_infinity(Inclination::from_degrees(50.0).unwrap());
    let request = SightlineRequest {
        region: Region { r_min: 1.5, r_max: 13.0, z_width: f64::INFINITY },
        sampling: Sampling::Gauss { order: 16, split: 6 },
        delay: false,
        momentum: true,
    };
    let lines = Sightlines::trace(&hole, &observer, &alpha, &beta, &request).unwrap();
    let velocity = AngularVelocity::Keplerian { drag: 0.9 };
    let motion = Motion { velocity, reference: 40.0, injection: None, times: vec![40.0] };
    let law = law(FieldFrame::Gas, [0.7, 0.3, 0.4]);
    let factors = view(law, 50.0).factors(&lines, &hole, &motion.velocity).unwrap();
    let all = vec![StokesParameter::I, StokesParameter::Q, StokesParameter::U];
    let model = ForwardModel::<f64>::new(&lines, &motion, &hole, None).unwrap();
    let model = model.seen(Some(&factors), &Observable::StokesImages(all)).unwrap();
    // Where the renderer has its spot at the time of the frame.
    let phase = 40f64.to_radians() + 40.0 / (7f64.powf(1.5) + 0.9);
    let center = [7.0 * phase.cos(), 7.0 * phase.sin(), 0.0];
    let spot = |x: [f64; 3]| (-0.5 * distance(x, center).powi(2)).exp();
    let axis = Axis::new([0.0, 0.0, 1.0]).unwrap();
    let found = model.movie_of(axis, &spot, &mut Batch::default());
    let mut scratch = Scratch::default();
    let rays = alpha.iter().zip(&beta);
    let seen: Vec<_> = rays.map(|(x, y)| scene.observe(*x, *y, &mut scratch).unwrap()).collect();
    compare_stokes(&found, &seen);
}

/// Planes of I, Q and U beside what the renderer sees in every pixel.
fn compare_stokes(found: &[f64], seen: &[RayResult]) {
    let (pixels, mut lit, mut worst) = (seen.len(), 0, 0.0f64);
    let peak = seen.iter().fold(0.0f64, |peak, seen| peak.max(seen.intensity));
    for (k, seen) in seen.iter().enumerate() {
        lit += usize::from(seen.intensity > 0.1 * peak);
        let expected = [seen.intensity, seen.stokes[0], seen.stokes[1]];
        for (plane, expected) in expected.iter().enumerate() {
            worst = worst.max((found[k + plane * pixels] - expected).abs() / peak);
        }
    }
    assert!(lit > 10 && worst < 1e-4, "{lit} pixels, {worst}");
}

/// Ideal magnetohydrodynamics: the field that gas at rest in the frame of zero angular momentum measures is the field,
/// and what moving gas measures is b with b·u = 0 and b² of its invariant.
#[test]
fn exact_fields_of_ideal_magnetohydrodynamics() {
    use kerrlight_geodesic::ZamoFrame;
    use kerrlight_render::polarization::Gas;
    let (hole, [r, u]) = (Kerr::new(0.7).unwrap(), [6.0f64, 0.3f64]);
    let s = (1.0 - u * u).sqrt();
    let frame = ZamoFrame::at(&hole, r, s, u).unwrap();
    let ideal = law(FieldFrame::Ideal, [0.5, 0.4, -0.3]);
    let still = ideal.field_of_gas(&frame, Gas([1.0, 0.0, 0.0, 0.0])).unwrap();
    let field = [0.4 + 0.5 * u, -0.5 * s, -0.3];
    // Of gas that is still, uᵗ is one over the lapse.
    let lapse = 1.0 / frame.to_coordinates([1.0, 0.0, 0.0, 0.0])[0];
    for (found, field) in still.iter().zip(field) {
        assert!((found - field * lapse).abs() < 1e-13, "{still:?}");
    }
    let velocity = [0.2, -0.1, 0.5];
    let gas = Gas::with_velocity(velocity).unwrap();
    let found = ideal.field_of_gas(&frame, gas).unwrap();
    // b² = (B² + (v·B)²γ²)/γ², B the field of the frame.
    let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let field = field.map(|x| x * lapse);
    let gamma2 = 1.0 / (1.0 - dot(velocity, velocity));
    let square = dot(field, field) / gamma2 + dot(velocity, field).powi(2);
    assert!((dot(found, found) - square).abs() < 1e-13, "{found:?} {square}");
}

/// The rule of Levis et al. 2024 without spin, component by component: b_r, b_θ and b_φ of gas that circles.
#[test]
fn code_lowered_rule_of_circular_orbits() {
    use kerrlight_geodesic::ZamoFrame;
    use kerrlight_render::polarization::Gas;
    let (hole, [r, u]) = (Kerr::new(0.0).unwrap(), [9.0f64, 0.2f64]);
    let s = (1.0 - u * u).sqrt();
    let frame = ZamoFrame::at(&hole, r, s, u).unwrap();
    let mut published = law(FieldFrame::Lowered, [1.0, 0.5, 0.02]);
    published.components = Components::Coordinate;
    published.field.radial_sine_power = 1.0;
    let gas = Gas::keplerian(&hole, &frame).unwrap();
    let found = published.field_of_gas(&frame, gas).unwrap();
    let rate = r.powf(-1.5);
    let (g_tt, g_pp) = (-(1.0 - 2.0 / r), r * r * s * s);
    let time = 1.0 / (-(g_tt + rate * rate * g_pp)).sqrt();
    let (u_t, u_p) = (g_tt * time, g_pp * time * rate);
    let (br, bt, bp) = (0.5 * s + u, -s, 0.02);
    let b0 = bp * u_p;
    let b3 = (bp + b0 * u_p) / u_t;
    let (low_t, low_p) = (g_tt * b0, g_pp * b3);
    let n_p = ((r * r - 2.0 * r) * s * s).sqrt();
    let expected =
        [br / u_t / (1.0 - 2.0 / r).sqrt(), r * bt / u_t, (u_p * low_t - u_t * low_p) / n_p];
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-12 * r, "{found} {expected}");
    }
}

fn of_factors(seen: &Observable) -> (ForwardModel<f64>, ForwardModel<f64>) {
    let (hole, lines) = traced(0.6, 40.0);
    let velocity = AngularVelocity::Keplerian { drag: 0.6 };
    let factors = view(law(FieldFrame::Ideal, [0.6, 0.2, 0.5]), 40.0)
        .factors(&lines, &hole, &velocity)
        .unwrap();
    let motion = Motion { velocity, reference: 0.0, injection: None, times: vec![0.0, 20.0, 45.0] };
    let model = || ForwardModel::<f64>::new(&lines, &motion, &hole, None).unwrap();
    let all =
        Observable::StokesImages(vec![StokesParameter::I, StokesParameter::Q, StokesParameter::U]);
    let seen = model().seen(Some(&factors), seen).unwrap();
    (seen, model().seen(Some(&factors), &all).unwrap())
}

/// Fluxes are sums of images, for known fields, representations and rows of the linear problem alike.
#[test]
fn exact_fluxes_are_sums_of_images() {
    let wanted = vec![StokesParameter::U, StokesParameter::I, StokesParameter::Q];
    let (flux, images) = of_factors(&Observable::Fluxes(wanted));
    assert_eq!((flux.pixels(), images.pixels()), (3, 36));
    let axis = Axis::new([0.0, 0.0, 1.0]).unwrap();
    let spot = |x: [f64; 3]| (-0.1 * distance(x, [6.0, 2.0, 0.5]).powi(2)).exp();
    let movie = images.movie_of(axis, &spot, &mut Batch::default());
    let curve = flux.movie_of(axis, &spot, &mut Batch::default());
    let sum =
        |frame: usize, plane: usize| movie[frame * 36 + plane * 12..][..12].iter().sum::<f64>();
    for frame in 0..3 {
        let expected = [sum(frame, 2), sum(frame, 0), sum(frame, 1)];
        for (found, expected) in curve[frame * 3..].iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12 * sum(frame, 0));
        }
    }
    let voxels = Voxels::cube(7, 12.0, Degree::Linear);
    let parameters: Vec<f64> = (0..343).map(|k| (0.37 * f64::from(k)).sin().abs()).collect();
    let movie = movie_about(axis, &flux, &voxels, &parameters);
    // Data of exactly these fluxes are explained by exactly these voxels.
    let term = ImageTerm::new(movie, 3, 1e-3).unwrap();
    let terms = [Weighted { weight: 1.0, term: &term as &dyn FrameTerm<f64> }];
    let of_images = of_images(&flux, &terms, voxels);
    let problem = LinearProblem { axis, frames: &[0, 1, 2], upper: 1.0, ..of_images };
    let settings = LinearSettings {
        coarse: None,
        iterations: 400,
        tolerance: 0.0,
        ..LinearSettings::default()
    };
    let certificate = solved(&problem, settings).certificate.unwrap();
    assert!(certificate.value < 1e-6 * certificate.dark, "{certificate:?}");
}

/// Gradients of a loss of Q and U against central differences.
#[test]
fn exact_gradients_of_polarised_fluxes() {
    let (model, _) = of_factors(&Observable::Fluxes(vec![StokesParameter::Q, StokesParameter::U]));
    let axis = Axis::new([0.0, 0.0, 1.0]).unwrap();
    let term = ImageTerm::new(vec![3.0, -2.0, 1.0, 0.5, -1.0, 4.0], 2, 0.5).unwrap();
    let others: Vec<crate::fit::Weighted<dyn FrameTerm<f64>>> =
        vec![crate::fit::Weighted { weight: 0.7, term: Box::new(term) }];
    let objective = Objective { model, data: Data { image: None, others } };
    let grid = Voxels::cube(5, 12.0, Degree::Linear).field().unwrap();
    let parameters: Vec<f64> = (0..125).map(|k| (0.61 * f64::from(k)).cos().abs()).collect();
    let loss = |parameters: &[f64], gradient: &mut [f64]| {
        let field = Field { representation: &grid, parameters, axis, occupancy: None };
        let gradients = Gradients { parameters: gradient, axis: None };
        let drawn = Drawn::Frames(vec![0, 1, 2]);
        objective.value_and_gradient(field, &drawn, gradients, &mut Buffers::default()).total
    };
    let mut gradient = vec![0.0; 125];
    loss(&parameters, &mut gradient);
    let largest = gradient.iter().fold(0.0f64, |most, g| most.max(g.abs()));
    for (k, found) in gradient.iter().enumerate() {
        let difference = slope(1e-4, |h| loss(&beside(&parameters, k, h), &mut vec![0.0; 125]));
        assert!((found - difference).abs() < 1e-7 * largest, "{k}");
    }
}

/// The position angle of the spin turns the electric vector, and nothing else changes; gas where no circular orbit is
/// slower than light is dark.
#[test]
fn exact_turns_and_dark_gas() {
    let (hole, lines) = traced(0.6, 40.0);
    let plain = view(law(FieldFrame::Ideal, [1.0, 0.0, 0.3]), 40.0);
    let turned = PolarizedView { position_angle: 0.4, ..plain.clone() };
    let gas = AngularVelocity::Keplerian { drag: 0.6 };
    let [a, b] = [plain.clone(), turned].map(|view| view.factors(&lines, &hole, &gas).unwrap());
    for (a, b) in a.iter().zip(&b) {
        assert_eq!(a.i, b.i);
        assert!(apart(b.evpa(), a.evpa() + 0.4).abs() < 1e-12);
        assert!((a.linear() / a.i - 0.75).abs() < 1e-12);
    }
    let fast = AngularVelocity::PowerLaw { radius: 8.0, rate: 0.2, exponent: 0.0 };
    let dark = plain.factors(&lines, &hole, &fast).unwrap();
    let far = |k: usize| lines.position[0][k].hypot(lines.position[1][k]) > 6.0;
    assert!((0..lines.points()).filter(|k| far(*k)).all(|k| dark[k] == Stokes::default()));
    assert!(dark.iter().any(|stokes| stokes.i > 0.0));
}

/// A part of the rays has the factors that it has among all of them, with the unit of all.
#[test]
fn exact_a_part_of_the_rays_has_the_mean_field_of_all() {
    let gas = AngularVelocity::Keplerian { drag: 0.6 };
    let law = PolarizationLaw {
        normalisation: Normalisation::MeanField,
        ..law(FieldFrame::Ideal, [1.0, 0.0, 0.3])
    };
    let factors = |count: usize, unit: Option<f64>| {
        let (hole, lines) = some_traced(0.6, 40.0, count);
        let view = PolarizedView { unit, ..view(law, 40.0) };
        (view.factors(&lines, &hole, &gas).unwrap(), view.unit_along(&lines, &hole, &gas))
    };
    let (all, unit) = factors(12, None);
    let part = factors(7, Some(unit)).0;
    assert!(part.len() > 20 && part == all[..part.len()]);
    assert_ne!(factors(7, None).0, part);
}

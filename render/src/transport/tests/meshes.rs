use super::*;
use crate::emission::mesh::{MeshFile, RawTriangle};
use crate::scene::{Disc, Mesh, MeshVelocity};
use core::f64::consts::{FRAC_PI_2, PI, TAU};
use kerrlight_geodesic::Outcome;

fn file(triangles: impl IntoIterator<Item = [[f64; 3]; 3]>) -> MeshFile {
    let raw = |corners| RawTriangle { corners, texture: [[0.0; 2]; 3], material: u32::MAX };
    MeshFile { triangles: triangles.into_iter().map(raw).collect(), ..MeshFile::default() }
}

fn quad([a, b, c, d]: [[f64; 3]; 4]) -> [[[f64; 3]; 3]; 2] {
    [[a, b, c], [a, c, d]]
}

/// A flat ring in the equatorial plane.
fn annulus(inner: f64, outer: f64, sides: u32) -> MeshFile {
    let at = |r: f64, k: u32| {
        let angle = TAU * f64::from(k) / f64::from(sides);
        [r * angle.cos(), r * angle.sin(), 0.0]
    };
    let side = |k| quad([at(inner, k), at(outer, k), at(outer, k + 1), at(inner, k + 1)]);
    file((0..sides).flat_map(side))
}

/// A sphere about the hole with corners at radius r, `rings` from pole to pole.
fn sphere(r: f64, rings: u32) -> MeshFile {
    let at = |i: u32, j: u32| {
        let (theta, phi) =
            (PI * f64::from(i) / f64::from(rings), PI * f64::from(j) / f64::from(rings));
        [r * theta.sin() * phi.cos(), r * theta.sin() * phi.sin(), r * theta.cos()]
    };
    let patch = move |i, j| quad([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
    file((0..rings).flat_map(|i| (0..2 * rings).flat_map(move |j| patch(i, j))))
}

fn mesh(opaque: bool, velocity: MeshVelocity) -> Mesh {
    Mesh {
        path: "made here".to_owned(),
        scale: 1.0,
        position: [0.0; 3],
        rotation_axis: [0.0, 0.0, 1.0],
        rotation_deg: 0.0,
        opaque,
        brightness: 1.0,
        color: None,
        velocity: Some(velocity),
    }
}

fn prepared(mut scene: Scene, meshes: Vec<(Mesh, MeshFile)>) -> PreparedScene {
    let (meshes, files) = meshes.into_iter().unzip();
    scene.mesh = meshes;
    PreparedScene::new(&scene, Assets { meshes: files, ..Assets::default() }).unwrap()
}

/// A ring of triangles in the plane of the disc is met where the disc is, with its redshift.
#[test]
fn exact_annulus_against_the_disc() {
    let sides = 96;
    let mut compared = 0;
    for spin in ["0.0", "0.9", "-0.9"] {
        let mut base = scene(&[&format!("hole.spin={spin}")]);
        let ring = mesh(true, MeshVelocity::Keplerian);
        let with_mesh = prepared(base.clone(), vec![(ring, annulus(9.0, 15.0, sides))]);
        base.disc = Some(Disc { inner_edge: Some(9.0), outer_edge: 15.0, ..discs::disc(None) });
        let with_disc = PreparedScene::new(&base, None).unwrap();
        // Chords of the rings cut off this much.
        let flat = (PI / f64::from(sides)).cos();
        let seen = observe(&with_mesh, &[0.0]).into_iter().zip(observe(&with_disc, &[0.0]));
        for (mesh, disc) in seen {
            let near_edge =
                |r: f64| (9.0 * flat..9.0).contains(&r) || (15.0 * flat..=15.0).contains(&r);
            if near_edge(mesh.radius) || near_edge(disc.radius) {
                continue;
            }
            assert_eq!(mesh.outcome, disc.outcome);
            assert!((mesh.radius - disc.radius).abs() < 1e-8, "{} {}", mesh.radius, disc.radius);
            assert!((mesh.azimuth - disc.azimuth).abs() < 1e-8);
            assert!((mesh.redshift - disc.redshift).abs() < 1e-8);
            compared += u32::from(mesh.radius > 0.0);
        }
    }
    assert!(compared > 400, "{compared}");
}

/// Gas in front of a mesh dims it by e^{−D}: D is the depth of a ray that ends there.
#[test]
fn exact_gas_dims_what_is_behind_it() {
    let gas = "gas={profile=\"gaussian\",scale_radius=10.0,flatness=1.0,motion=\"keplerian\",\
               emissivity=1e-30,absorptivity=3e17,outer_radius=60.0}";
    let seen = |absorption: &str| {
        let base = scene(&[gas, &format!("effects.absorption={absorption}")]);
        let ball = (mesh(true, MeshVelocity::Static), sphere(6.0, 12));
        observe(&prepared(base, vec![ball]), &[0.0])
    };
    let mut dimmed = 0;
    for (dim, bright) in seen("true").into_iter().zip(seen("false")) {
        if bright.outcome != Outcome::Surface {
            continue;
        }
        let expected = bright.intensity * (-dim.optical_depth).exp();
        let apart = (dim.intensity - expected).abs();
        assert!(
            apart <= 1e-9 * bright.intensity,
            "{} {expected} {}",
            dim.intensity,
            dim.optical_depth
        );
        dimmed += u32::from(dim.optical_depth > 0.1);
    }
    assert!(dimmed > 20, "{dimmed}");
}

/// The silhouette of a sphere of radius R > 3 around a hole without spin: rays whose turning
/// point is R, b = R/√(1 − 2/R). Flat triangles are at most 1 − cos² (half a patch) inside of it.
#[test]
fn exact_silhouette_of_a_sphere() {
    let rings = 48;
    for radius in [4.0, 6.0, 30.0] {
        let scene = scene(&["hole.spin=0.0"]);
        let prepared =
            prepared(scene, vec![(mesh(true, MeshVelocity::Static), sphere(radius, rings))]);
        let edge = |r: f64| r / (1.0f64 - 2.0 / r).sqrt();
        let inside = radius * (0.5 * PI / f64::from(rings)).cos().powi(2);
        for k in 0..12 {
            let (sin, cos) = (0.4 + f64::from(k)).sin_cos();
            let hit = |b: f64| {
                let seen = prepared.observe(b * cos, b * sin, &mut Scratch::default()).unwrap();
                if seen.outcome == Outcome::Surface {
                    let g = (1.0 - 2.0 / seen.radius).sqrt();
                    assert!((seen.redshift - g).abs() < 1e-9, "{} {g}", seen.redshift);
                    assert!(seen.radius > inside * 0.999_999 && seen.radius < radius * 1.000_001);
                }
                seen.outcome == Outcome::Surface
            };
            let (mut low, mut high) = (0.5 * radius, 2.0 * edge(radius));
            assert!(hit(low) && !hit(high));
            for _ in 0..40 {
                let middle = 0.5 * (low + high);
                if hit(middle) { low = middle } else { high = middle }
            }
            assert!(low <= edge(radius) * (1.0 + 1e-9), "R = {radius}: {low} {}", edge(radius));
            assert!(low >= edge(inside) * (1.0 - 1e-9), "R = {radius}: {low} {}", edge(inside));
        }
    }
}

/// Far from the hole rays are straight: a wall through its place across the line of traced is met
/// at (α, β), but for the deflection of about 4 M / b.
#[test]
fn exact_straight_rays_far_out() {
    let size = 3e6;
    let corner = |y: f64, z: f64| [0.0, size * y, size * z];
    let wall = quad([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
    let scene = scene(&["observer.inclination_deg=90"]);
    let prepared = prepared(scene, vec![(mesh(true, MeshVelocity::Static), file(wall))]);
    for (alpha, beta) in [(1e6, 3e5), (-2e6, -1e6), (4e5, -2e6)] {
        let seen = prepared.observe(alpha, beta, &mut Scratch::default()).unwrap();
        let b = f64::hypot(alpha, beta);
        assert!((seen.radius / b - 1.0).abs() < 10.0 / b, "{} {b}", seen.radius);
        assert!((seen.azimuth.abs() - FRAC_PI_2).abs() < 1e-9);
        assert!((seen.redshift - 1.0).abs() < 10.0 / b && seen.outcome == Outcome::Surface);
    }
    let past = prepared.observe(3.01e6, 0.0, &mut Scratch::default()).unwrap();
    assert_eq!(past.outcome, Outcome::Escaped);
}

/// Triangles of many sizes, some of which hide: the hierarchy finds what one finds one by one.
#[test]
fn exact_tree_against_every_triangle() {
    let part = |k: u32, number: f64| (f64::from(k) * number.sqrt() + 0.3).fract() - 0.5;
    let soup = |first: u32, count: u32, reach: f64| {
        file((first..first + count).map(|k| {
            let size = 0.05 + 3.0 * (part(k, 2.0) + 0.5).powi(4);
            let center = [part(k, 3.0), part(k, 5.0), part(k, 7.0)].map(|x| reach * x);
            [11.0, 13.0, 17.0].map(|n| {
                core::array::from_fn(|axis| center[axis] + size * part(k * 3 + axis as u32, n))
            })
        }))
    };
    let mut lit = 0;
    for spin in ["0.0", "0.9", "-0.9"] {
        let scene = scene(&[&format!("hole.spin={spin}")]);
        let (thin, solid) =
            (mesh(false, MeshVelocity::Static), mesh(true, MeshVelocity::Keplerian));
        let prepared =
            prepared(scene, vec![(thin, soup(0, 300, 20.0)), (solid, soup(300, 300, 16.0))]);
        let found = observe(&prepared, &[0.0]);
        for (a, b) in found.iter().zip(observe(&prepared.one_by_one(), &[0.0])) {
            let same = |x: f64, y: f64| (x - y).abs() < 1e-7 * (1.0 + y.abs());
            assert_eq!(a.outcome, b.outcome);
            assert!(same(a.intensity, b.intensity) && same(a.radius, b.radius), "{a:?} {b:?}");
            lit += u32::from(a.intensity > 0.0);
        }
    }
    assert!(lit > 150, "{lit}");
}

/// A ray that runs in the plane of a ring's triangles from end to end does not meet them, and
/// finds out soon; a hair above it does.
#[test]
fn exact_ray_in_the_plane_of_a_mesh() {
    for spin in ["0.0", "0.9"] {
        let scene = scene(&["observer.inclination_deg=90", &format!("hole.spin={spin}")]);
        let ring = (mesh(true, MeshVelocity::Static), annulus(5.0, 60.0, 64));
        let prepared = prepared(scene, vec![ring]);
        let observe = |beta| prepared.observe(10.0, beta, &mut Scratch::default()).unwrap();
        assert_ne!(observe(0.0).outcome, Outcome::Surface);
        assert_eq!(observe(0.1).outcome, Outcome::Surface);
    }
}

/// A dark sphere around everything lets no light through; in its absence there is some.
#[test]
fn exact_dark_surfaces_hide() {
    let mut base = scene(&[]);
    base.spot = spots(40, None);
    let dark = Mesh { brightness: 0.0, ..mesh(true, MeshVelocity::Static) };
    let hidden = prepared(base.clone(), vec![(dark, sphere(18.0, 16))]);
    assert!(
        observe(&hidden, &[30.0])
            .iter()
            .all(|s| s.intensity == 0.0 && s.outcome == Outcome::Surface)
    );
    let open = PreparedScene::new(&base, None).unwrap();
    assert!(observe(&open, &[30.0]).iter().any(|seen| seen.intensity > 0.0));
}

/// Files and scene must fit.
#[test]
fn exact_misfits_are_errors() {
    let mut scene = scene(&[]);
    scene.mesh = vec![mesh(true, MeshVelocity::Static)];
    let error = PreparedScene::new(&scene, None).unwrap_err().to_string();
    assert!(error.contains("one file for each"), "{error}");
    scene.mesh[0].scale = 1e7;
    let assets = Assets { meshes: vec![annulus(5.0, 6.0, 8)], ..Assets::default() };
    let error = PreparedScene::new(&scene, assets).unwrap_err().to_string();
    assert!(error.contains("within 1e7 M"), "{error}");
}

//! Error estimates and hard rays, against numbers of twice the precision.

use crate::support::{fail, new_folder, succeed};
use kerrlight_geodesic::Integrator;
use kerrlight_validation::accuracy::estimates;
use kerrlight_validation::accuracy::hard;
use kerrlight_validation::accuracy::rays::Class;
use kerrlight_validation::accuracy::sweep::{self, Sweep};

/// Special spins and inclinations and their neighbours, all scales, down to 1e-14 from the
/// critical curve: no wrong fate or number of crossings, no NaN, no error beyond ten times its
/// estimate. `kerrlight accuracy --hard` does the same with millions.
#[test]
fn code_hard_rays_come_out_right() {
    for (integrator, rays) in [
        (Integrator::TaylorMino, 3000),
        (Integrator::Dop853Mino, 1000),
        (Integrator::Rk45Mino, 500),
    ] {
        for tally in hard::run(integrator, 1e-12, rays, 7, |_| true).expect("a sweep") {
            assert!(tally.passes(), "{}: {tally:?}", integrator.name());
            assert!(tally.bounded as f64 > 0.99 * tally.rays as f64, "{tally:?}");
            assert!(tally.unresolved[0] * 200 <= tally.rays, "{tally:?}");
        }
    }
}

/// Every estimate bounds the error for 99 % of rays, and is not more than a hundred times too
/// large for the median of rays anywhere.
#[test]
fn code_estimates_bound_errors() {
    let settings = [
        (Integrator::Rk45Mino, 1e-8),
        (Integrator::Dop853Mino, 1e-9),
        (Integrator::TaylorMino, 1e-6),
        (Integrator::TaylorMino, 1e-12),
        (Integrator::Elliptic, 1e-14),
    ];
    let sweep = Sweep {
        settings: settings.to_vec(),
        spins: vec![0.0, 0.94, -0.998, 1.0],
        observers: 5,
        rays: 5,
        seed: 3,
    };
    let rows = sweep::run(&sweep, |_, _| true).expect("a sweep");
    for row in rows.iter().filter(|row| row.spin.is_none()) {
        assert_eq!(row.wrong_fates, 0, "{row:?}");
        assert!(row.bounded >= 0.97, "{row:?}");
        if row.class == Class::Generic && row.integrator != Integrator::Elliptic {
            assert!(row.overestimate < 100.0, "{row:?}");
        }
    }
}

/// Where estimates were too small: crossings, whose own Mino time has an error, next to the critical
/// curve and elsewhere; observers close to the hole; rays that turn next to their observer; the
/// delay of the closed form.
#[test]
fn code_estimates_bound_errors_of_every_class() {
    use estimates::Class as Every;
    let all = [
        (Integrator::TaylorMino, 1e-6),
        (Integrator::TaylorMino, 1e-12),
        (Integrator::Dop853Mino, 1e-9),
        (Integrator::Rk45Mino, 1e-6),
        (Integrator::Elliptic, 1e-14),
    ];
    for class in Every::ALL {
        for row in estimates::run(class, &all, 120, 11).expect("rays") {
            assert!(row.holds(), "{}", row.line());
            let [radius, ..] = row.held;
            let loose = matches!(class, Every::Far | Every::Tangential)
                || row.integrator == Integrator::Elliptic;
            assert!(row.wrong == 0 && (loose || radius.overestimate < 250.0), "{}", row.line());
        }
    }
    // Ten times slower than the others.
    for class in [Every::From6, Every::From20] {
        for row in estimates::run(class, &[(Integrator::Rk45Affine, 1e-6)], 100, 11).expect("rays")
        {
            assert!(row.holds(), "{}", row.line());
        }
    }
}

#[test]
fn hard_rays_as_a_command() {
    let path = &new_folder();
    succeed(path, &["accuracy", "--hard", "400", "-o", "results"]);
    for name in ["hard.csv", "hard.json"] {
        let text = std::fs::read_to_string(path.join("results").join(name)).expect("results");
        assert!(text.contains("near-critical"), "{text}");
    }
    assert!(fail(path, &["accuracy", "--hard", "0", "-o", "results"]).contains("--hard"));
    let message = fail(path, &["accuracy", "--hard", "1", "--tolerance", "2", "-o", "results"]);
    assert!(message.contains("--tolerance") && message.contains("[1e-14, 1e-2]"), "{message}");
    std::fs::write(path.join("file"), "").expect("a file");
    assert!(fail(path, &["accuracy", "-o", "file"]).contains("file"));
}

//! throwaway
use kerrlight_tomo::{scene::Scene, transport::*};
fn main() {
    for path in std::env::args().skip(1) {
        let scene = Scene::parse(&std::fs::read_to_string(&path).unwrap()).unwrap();
        let stage = Stage::new(&scene, None).unwrap();
        let n = scene.screen.width as usize;
        let p = scene.pixel_size();
        let pts: Vec<(f64, f64)> = (0..n * n)
            .map(|k| {
                (
                    ((k % n) as f64 + 0.5) * p - 0.5 * n as f64 * p,
                    -(((k / n) as f64 + 0.5) * p - 0.5 * n as f64 * p),
                )
            })
            .collect();
        let (a, b): (Vec<f64>, Vec<f64>) = pts.into_iter().unzip();
        let mut scratch = Scratch::default();
        for _ in 0..3 {
            let t = cpu();
            let (mut sum, mut left) = (0.0, 0.0);
            let mut seen = vec![Glimpse::default(); 512];
            for k in (0..n * n).step_by(512) {
                let e = (k + 512).min(n * n);
                stage
                    .look_many(
                        &a[k..e],
                        &b[k..e],
                        &[stage.time()],
                        &mut scratch,
                        &mut seen[..e - k],
                    )
                    .unwrap();
                sum += seen[..e - k].iter().map(|g| g.intensity).sum::<f64>();
                left += seen[..e - k]
                    .iter()
                    .zip(&a[k..e])
                    .filter(|(_, a)| **a < 0.)
                    .map(|(g, _)| g.intensity)
                    .sum::<f64>();
            }
            let s = cpu() - t;
            let uas = kerrlight_tomo::units::gravitational_angle(
                scene.hole.mass_msun,
                scene.hole.distance_kpc,
            );
            println!(
                "{path}: {:.9} Jy, l/r {:.3}, {:.0} rays/s",
                sum * kerrlight_tomo::units::JY_PER_SQUARE_UAS * (p * uas).powi(2),
                left / (sum - left),
                (n * n) as f64 / s
            );
        }
    }
}

fn cpu() -> f64 {
    let t = std::fs::read_to_string("/proc/self/schedstat").unwrap();
    t.split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-9
}

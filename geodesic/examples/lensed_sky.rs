//! Footprint of a pixel's beam on the sky behind a hole, from a camera nearby. Between images of
//! the sky, where the footprint grows, textures need filtering.
//!
//! `cargo run --release -p kerrlight-geodesic --example lensed_sky`

use kerrlight_geodesic::{Camera, Error, Inclination, Kerr, Motion, footprint};

fn main() -> Result<(), Error> {
    let hole = Kerr::new(0.9)?;
    let camera = Camera::new(&hole, Inclination::from_degrees(80.0)?, 20.0, Motion::Static)?;
    let x: Vec<f64> = (0..13).map(|k| 0.1 * f64::from(k) + 0.2).collect();
    let y = vec![0.01; x.len()];
    let beams = footprint::of_camera(&camera, &x, &y, 1e-10, 0)?;

    println!("   x       θ        φ      stretched  squeezed  magnification");
    for (k, (x, y)) in x.iter().zip(&y).enumerate() {
        let Some(sky) = beams.sky[k] else {
            println!("{x:.3}  in the shadow");
            continue;
        };
        let ellipse = sky.ellipse();
        // How much more of the camera's sky an image covers than its source of the true sky.
        let solid_angle = (1.0 + x * x + y * y).powf(-1.5);
        let (theta, phi) = (sky.theta().to_degrees(), sky.azimuth().to_degrees());
        let (long, short) = (ellipse.semi_major, ellipse.semi_minor);
        let gain = solid_angle / ellipse.magnification;
        println!("{x:.3}  {theta:>6.2}°  {phi:>+7.2}°  {long:>8.3}  {short:>8.3}  {gain:>+8.4}");
    }
    Ok(())
}

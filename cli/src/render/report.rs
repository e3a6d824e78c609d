//! What is told about a picture: in the file and on the terminal.

use kerrlight_tomo::image::exr;
use kerrlight_tomo::render::Rendered;
use kerrlight_tomo::scene::Scene;

/// What decided the picture.
pub fn attributes(scene: &Scene, text: &str, rendered: &Rendered) -> exr::Attributes {
    let entry = |name: &str, value: String| (name.to_owned(), value);
    [
        entry("version", env!("CARGO_PKG_VERSION").to_owned()),
        entry("scene", text.to_owned()),
        entry("scene_resolved", scene.to_toml()),
        entry("intensity_unit", rendered.intensity_unit.to_owned()),
        entry("intensity_per_scene_unit", rendered.unit_factor.to_string()),
        entry(pixel_unit(scene), scene.pixel_size().to_string()),
        entry("unresolved_rays", rendered.unresolved.to_string()),
        entry("channels", CHANNELS.to_owned()),
    ]
    .into()
}

/// What the size of a pixel is called: in M, or on the picture plane of a camera.
pub fn pixel_unit(scene: &Scene) -> &'static str {
    if scene.camera.is_some() { "pixel_size_plane" } else { "pixel_size_m" }
}

/// The legend of the channels, for whoever opens the file.
pub const CHANNELS: &str = "R, G, B: linear light, emission in scene units and sky. \
intensity: mean over the pixel, without the sky. \
Of the pixel's central ray: redshift: intensity-weighted g = nu_obs/nu_em (0: no emission); \
crossings: of the equatorial plane outside the horizon; \
radius (M), azimuth (rad), delay (M): of the brightest contribution (radius 0: none); \
outcome: 0 captured, 1 escaped, 2 opaque surface, 3 unresolved.";

/// What a user is told when the picture is there.
pub fn print(scene: &Scene, rendered: &Rendered, seconds: f64) {
    let screen = &scene.screen;
    let rays =
        f64::from(screen.width) * f64::from(screen.height) * f64::from(screen.samples_per_pixel);
    eprintln!(
        "{} x {} pixels, {rays} rays in {seconds:.2} s ({:.0} rays/s)",
        screen.width,
        screen.height,
        rays / seconds.max(1e-9)
    );
    if rendered.unresolved > 0 {
        eprintln!(
            "warning: {} rays unresolved (on the critical curve within rounding), shown as dark",
            rendered.unresolved
        );
    }
}

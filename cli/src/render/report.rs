//! Attributes of a picture: in the file and on the terminal.

use kerrlight_render::image::exr::Attributes;
use kerrlight_render::picture::{Raster, Summary};
use kerrlight_render::scene::Scene;
use serde_json::{Value, json};

/// Returns the settings of the picture and its totals: `text` is the scene as it was given,
/// `files` the identity of the files that it names.
pub fn attributes(
    scene: &Scene,
    text: &str,
    files: &str,
    raster: &Raster,
    summary: &Summary,
) -> Attributes {
    let entry = |name: &str, value: String| (name.to_owned(), value);
    // In M, or in the picture plane of a camera.
    let pixel = if scene.camera.is_some() { "pixel_size_plane" } else { "pixel_size_m" };
    let mut all = Attributes::from([
        entry("version", env!("CARGO_PKG_VERSION").to_owned()),
        entry("scene", text.to_owned()),
        entry("scene_resolved", scene.to_toml()),
        entry("intensity_unit", summary.intensity_unit.to_owned()),
        entry("intensity_per_scene_unit", summary.unit_factor.to_string()),
        entry(pixel, scene.pixel_size().to_string()),
        entry("flux", summary.flux.to_string()),
        entry("flux_error", summary.flux_error.to_string()),
        entry("flux_unit", summary.flux_unit.to_owned()),
        entry("image_error", summary.image_error.to_string()),
        entry("rays", summary.rays.to_string()),
        entry("unresolved_rays", summary.unresolved.to_string()),
        entry("channels", raster.legend()),
    ]);
    all.extend(raster.identifiers().map(|ids| entry("ids", ids)));
    all.extend(raster.device().map(|device| entry("device", device.name().to_owned())));
    if !files.is_empty() {
        all.extend([entry("files", files.to_owned())]);
    }
    all
}

/// Summary of a picture in one line: flux, size and time.
pub fn worth(scene: &Scene, summary: &Summary, seconds: f64) -> String {
    let (screen, rays) = (&scene.screen, summary.rays);
    let Summary { flux, flux_error, flux_unit, .. } = summary;
    let flux = match flux {
        flux if *flux > 0.0 => format!("flux {} ± {flux_error:.1e} {flux_unit}", shown(*flux)),
        _ => format!("flux 0 {flux_unit}"),
    };
    format!(
        "{flux}; {} x {} pixels, {rays} rays in {seconds:.2} s ({:.0} rays/s)",
        screen.width,
        screen.rows(),
        rays as f64 / seconds.max(1e-9)
    )
}

/// A flux with seven digits or so.
pub fn shown(flux: f64) -> String {
    if (1e-4..1e7).contains(&flux) { format!("{flux:.6}") } else { format!("{flux:.6e}") }
}

/// The same for other programs.
pub fn figures(scene: &Scene, summary: &Summary, seconds: f64) -> Value {
    json!({
        "width": scene.screen.width,
        "height": scene.screen.rows(),
        "flux": summary.flux,
        "flux_error": summary.flux_error,
        "flux_unit": summary.flux_unit,
        "intensity_unit": summary.intensity_unit,
        "image_error": summary.image_error,
        "rays": summary.rays,
        "unresolved_rays": summary.unresolved,
        "seconds": seconds,
    })
}

/// Tells of what a user may not expect of a picture.
pub fn warn(scene: &Scene, summary: &Summary) {
    let (screen, rays) = (&scene.screen, summary.rays);
    let pixels = f64::from(screen.width) * f64::from(screen.rows());
    if summary.flux <= 0.0 && scene.has_emission() {
        eprintln!(
            "warning: no light of the scene's disc, gas, spots, volumes or meshes reaches the picture: flux 0 {}",
            summary.flux_unit
        );
    }
    if let Some(asked) = screen.image_error {
        let error = summary.image_error;
        eprintln!("image error {error:.1e}, {:.2} rays a pixel", rays as f64 / pixels);
        if error > asked {
            eprintln!("warning: the image error {error:.1e} exceeds the requested {asked:e}");
        }
    }
    if summary.unresolved > 0 {
        eprintln!(
            "warning: {} rays unresolved (on the critical curve within rounding), shown as dark",
            summary.unresolved
        );
    }
}

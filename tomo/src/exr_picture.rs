//! Pictures in EXR as images of the sky.

use kerrlight_render::image::exr;
use kerrlight_render::scene::Scene;
use kerrlight_vlbi::files::FileError;
use kerrlight_vlbi::files::images::{OwnTimes, Pixels};

/// The channel `intensity` of a picture in EXR. One of kerrlight in Jy/µas² knows its field and its scale; one that is
/// not of kerrlight knows no field and is taken as Jy/pixel.
///
/// # Errors
/// If there is no such channel, or its unit is none of the sky.
pub fn read(bytes: &[u8]) -> Result<Pixels, FileError> {
    let (picture, attributes) = exr::decode(bytes)
        .map_err(|error| FileError::whole(format!("damaged or unusual EXR: {error}")))?;
    let lacks = |what: &str| FileError::whole(what.to_owned());
    let channel = picture.channel("intensity");
    let channel = channel.ok_or_else(|| lacks("has no channel named intensity"))?;
    let (width, height) = (picture.width, picture.height);
    let attribute = |name: &str| attributes.get(name).map(String::as_str);
    let in_pixels = |factor: f64| Pixels {
        width,
        height,
        values: channel.iter().map(|value| f64::from(*value) * factor).collect(),
        ..Pixels::default()
    };
    match attribute("intensity_unit") {
        Some("Jy/uas^2") => {
            let scene = attribute("scene_resolved").ok_or_else(|| lacks("holds no scene"))?;
            let scene = Scene::parse(scene)
                .map_err(|error| FileError::whole(format!("scene in the EXR: {error}")))?;
            let angle = scene.hole.angle_uas();
            let angle = angle.ok_or_else(|| lacks("its scene has no mass or distance"))?;
            let seconds = scene.hole.seconds().ok_or_else(|| lacks("its scene has no mass"))?;
            let pixel_uas = scene.pixel_size() * angle;
            let hours = scene.observer.time * seconds / 3600.0;
            let field_uas = Some(pixel_uas * width as f64);
            let times = OwnTimes::Since(vec![hours]);
            Ok(Pixels { field_uas, times, ..in_pixels(pixel_uas * pixel_uas) })
        }
        Some(_) => {
            Err(lacks("its intensity has no unit of the sky: render it with screen.total_flux_jy"))
        }
        None => Ok(in_pixels(1.0)),
    }
}

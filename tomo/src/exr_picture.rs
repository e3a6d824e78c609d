//! Pictures in EXR as images of the sky.

use kerrlight_render::image::exr;
use kerrlight_render::scene::Scene;
use kerrlight_vlbi::files::FileError;
use kerrlight_vlbi::files::images::{OwnTimes, Pixels};

/// The channels `intensity`, `Q`, `U` and `V` of a picture in EXR, which is its display window: pixels outside its data
/// window are dark. One of kerrlight in Jy/µas² knows its field and its scale; one that is not of kerrlight knows no field
/// and is taken as Jy/pixel.
///
/// # Errors
/// If there is no such channel, its unit is none of the sky, pixels are not square, or some lie outside the display
/// window.
pub fn read(bytes: &[u8]) -> Result<Pixels, FileError> {
    let unusual = |error| FileError::whole(format!("damaged or unusual EXR: {error}"));
    let window = exr::window(bytes).map_err(unusual)?;
    let (picture, attributes) = exr::decode(bytes).map_err(unusual)?;
    let lacks = |what: &str| FileError::whole(what.to_owned());
    let [width, height] = window.display;
    let plane = |name: &str, factor: f64| {
        let channel = picture.channel(name)?;
        let mut values = vec![0.0; width * height];
        let rows = values.chunks_exact_mut(width).skip(window.top);
        for (row, from) in rows.zip(channel.chunks_exact(picture.width)) {
            let row = &mut row[window.left..][..picture.width];
            row.iter_mut().zip(from).for_each(|(to, value)| *to = f64::from(*value) * factor);
        }
        Some(values)
    };
    let attribute = |name: &str| attributes.get(name).map(String::as_str);
    let in_pixels = |factor: f64| {
        let values = plane("intensity", factor);
        Ok(Pixels {
            width,
            height,
            values: values.ok_or_else(|| lacks("has no channel named intensity"))?,
            polarized: ["Q", "U", "V"].map(|name| plane(name, factor)),
            ..Pixels::default()
        })
    };
    match attribute("intensity_unit") {
        Some("Jy/uas^2") => {
            let scene = attribute("scene_resolved").ok_or_else(|| lacks("holds no scene"))?;
            let scene = Scene::parse(scene)
                .map_err(|error| FileError::whole(format!("scene in the EXR: {error}")))?;
            let angle = scene.hole.angle_uas();
            let angle = angle.ok_or_else(|| lacks("its scene has no mass or distance"))?;
            let seconds = scene.hole.seconds().ok_or_else(|| lacks("its scene has no mass"))?;
            if (scene.screen.width as usize, scene.screen.rows() as usize) != (width, height) {
                return Err(FileError::whole(format!(
                    "is {width} x {height} pixels large, its scene {} x {}: give the picture as it was rendered",
                    scene.screen.width,
                    scene.screen.rows()
                )));
            }
            let pixel_uas = scene.pixel_size() * angle;
            let hours = scene.observer.time * seconds / 3600.0;
            let field_uas = Some(pixel_uas * width as f64);
            let times = OwnTimes::Since(vec![hours]);
            Ok(Pixels { field_uas, times, ..in_pixels(pixel_uas * pixel_uas)? })
        }
        Some(_) => {
            Err(lacks("its intensity has no unit of the sky: render it with screen.total_flux_jy"))
        }
        None => in_pixels(1.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_render::image::{Channel, Picture};

    /// An EXR of 2 x 1 pixels, 1 and 2, with the same in Q and U, whose attribute holds other numbers.
    fn exr_with(attribute: &str, numbers: &[[u8; 4]]) -> Result<Pixels, FileError> {
        let channel = |name: &str| Channel { name: name.to_owned(), values: vec![1.0, 2.0] };
        let channels = ["intensity", "Q", "U"].map(channel).to_vec();
        let picture = Picture { width: 2, height: 1, channels };
        let mut bytes =
            exr::encode(&picture, &exr::Attributes::new(), exr::Style::default()).unwrap();
        let name = format!("{attribute}\0");
        let at = bytes.windows(name.len()).position(|w| w == name.as_bytes()).unwrap();
        // The name, the name of its type, and the size of the value in four bytes.
        let kind = bytes[at + name.len()..].iter().position(|b| *b == 0).unwrap() + 1;
        let value = at + name.len() + kind + 4;
        bytes[value..value + 4 * numbers.len()].copy_from_slice(numbers.as_flattened());
        read(&bytes)
    }

    /// The picture is the display window, in which pixels lie where the data window is.
    #[test]
    fn exact_exr_data_window_inside_its_display_window() {
        let display = |window: [i32; 4]| exr_with("displayWindow", &window.map(i32::to_le_bytes));
        let pixels = display([-1, -2, 2, 0]).unwrap();
        assert_eq!((pixels.width, pixels.height), (4, 3));
        let values = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 0.0];
        assert_eq!(pixels.values, values);
        assert_eq!(pixels.polarized, [Some(values.to_vec()), Some(values.to_vec()), None]);
        assert_eq!(display([0, 0, 1, 0]).unwrap().values, [1.0, 2.0]);
        for beyond in [[0, 0, 0, 0], [1, 0, 4, 4], [0, 1, 4, 4]] {
            let message = display(beyond).unwrap_err().to_string();
            assert!(message.contains("display window"), "{message}");
        }
        let message = exr_with("pixelAspectRatio", &[2.0f32.to_le_bytes()]).unwrap_err();
        assert!(message.to_string().contains("pixelAspectRatio = 2"), "{message}");
    }
}

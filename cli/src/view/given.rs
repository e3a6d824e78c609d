//! Subject of the page, as one object.

use super::matter::{self, SPOTS, Volumes};
use super::subject::{Measured, Subject};
use super::{sky, still};
use crate::render::preview::PreviewOptions;
use anyhow::Context;
use kerrlight_common::units::SPEED_OF_LIGHT;
use kerrlight_render::emission::black_body::BlackBody;
use kerrlight_render::image::colormap::Colormap;
use kerrlight_render::image::preview::Look;
use kerrlight_render::scene::{CameraMotion, Scene};
use serde_json::{Value, json};

/// The object.
pub fn of(subject: &Subject, volumes: &Volumes) -> anyhow::Result<Value> {
    let scene = &subject.scene;
    let [reach, piece, most] = matter::extent(subject, volumes);
    let panorama = sky::panorama(subject)?;
    let distance = scene.observer.radius;
    Ok(json!({
        "scene": scene,
        "title": subject.title,
        "words": subject.words,
        "keys": keys(&subject.text)?,
        "pose": scene.camera.as_ref().map(|camera| camera.pose(scene.observer.time).values),
        "motion": motion(scene),
        "distance": distance.is_finite().then_some(distance),
        "field": scene.camera.is_none().then(|| scene.field_of_view_m()),
        "times": times(subject, reach),
        "index": scene.effects.index().unwrap_or(0.0),
        "white": still::white(subject)?,
        "colored": PreviewOptions::default().look(scene) == Look::Color,
        "colors": base64::encode(colors()),
        "gas": scene.gas.as_ref().map(|gas| gas.emissivity * centimetres(scene)),
        "shades": shades(scene).map(base64::encode),
        "sky": panorama.as_ref().map(|(png, _)| base64::encode(png)),
        "sky_brightness": panorama.as_ref().map_or(0.0, |(_, brightness)| *brightness),
        "volumes": volumes.described(),
        "law": volumes.law,
        "spots": matter::spots(subject)?,
        "reach": reach,
        "piece": piece,
        "most": most,
        "data": subject.measured.as_ref().map(data),
        "left_out": left_out(subject, volumes.falls),
    }))
}

/// Names of what is left out, as scene files have them.
fn left_out(subject: &Subject, falls: bool) -> Vec<String> {
    let Scene { mesh, volume, spot, effects, .. } = &subject.scene;
    let moves = subject.scene.camera.as_ref().map(|camera| camera.motion);
    let on_path = moves == Some(CameraMotion::Path);
    let parts = [
        (!mesh.is_empty(), "[[mesh]]".to_owned()),
        (falls, "[[volume]] number 0, whose matter falls".to_owned()),
        (volume.len() > 1, format!("[[volume]] but the first of {}", volume.len())),
        (spot.len() > SPOTS, format!("[[spot]] but the first {SPOTS} of {}", spot.len())),
        (effects.half_orbits.is_some(), "effects.half_orbits: all images are there".to_owned()),
        (effects.polarization, "effects.polarization: light is that without it".to_owned()),
        (on_path, "camera.motion = \"path\": the camera is at rest where it is".to_owned()),
    ];
    parts.into_iter().filter_map(|(is, name)| is.then_some(name)).collect()
}

/// The keys of a scene's text, with the tables that they stand in.
fn keys(text: &str) -> anyhow::Result<Vec<String>> {
    let table: toml::Table = text.parse().context("the scene")?;
    let mut keys: Vec<String> = table.keys().cloned().collect();
    for (name, value) in &table {
        let within = value.as_table().into_iter().flat_map(toml::Table::keys);
        keys.extend(within.map(|key| format!("{name}.{key}")));
    }
    Ok(keys)
}

/// Names the motion of a camera, as scenes write it; one on a path stands still where it is.
fn motion(scene: &Scene) -> &'static str {
    match scene.camera.as_ref().map(|camera| camera.motion) {
        Some(CameraMotion::Zamo) => "zamo",
        Some(CameraMotion::Keplerian) => "keplerian",
        Some(CameraMotion::FreeFall) => "free-fall",
        _ => "static",
    }
}

/// First and last time of observation: of a fit's pictures, or one turn of the outermost spot, or at half the volume's
/// radius; none where nothing changes.
fn times(subject: &Subject, reach: f64) -> Option<[f64; 2]> {
    let scene = &subject.scene;
    if let Some(Measured { times, .. }) = &subject.measured
        && times.len() > 1
    {
        return Some([times[0], times[times.len() - 1]]);
    }
    let orbits = scene.spot.iter().map(|spot| spot.radius);
    let radius = orbits.fold(0.5 * reach * f64::from(u8::from(!scene.volume.is_empty())), f64::max);
    let start = scene.observer.time;
    // The Keplerian period 2π r^(3/2), without the spin.
    scene.changes().then(|| [start, start + core::f64::consts::TAU * radius.powf(1.5)])
}

fn data(measured: &Measured) -> Value {
    json!({ "times": measured.times, "side": measured.side, "field": measured.field, "scale": brightest(measured) })
}

/// The largest value of a fit's pictures.
pub fn brightest(measured: &Measured) -> f32 {
    measured.pixels.iter().copied().fold(f32::MIN_POSITIVE, f32::max)
}

/// M in centimetres; gas needs a mass.
fn centimetres(scene: &Scene) -> f64 {
    100.0 * SPEED_OF_LIGHT * scene.hole.seconds().unwrap_or(f64::NAN)
}

/// Logarithms of red, green and blue of black bodies of intensity 1 whose temperatures are e⁻⁶ to e³ of that of the disc's
/// peak, 512 each, as floats; none where the disc has one colour.
fn shades(scene: &Scene) -> Option<Vec<u8>> {
    let peak = scene.disc.as_ref()?.peak_temperature_k?;
    let body = BlackBody::new(peak);
    let temperature = |k: usize| peak * (9.0 * k as f64 / 511.0 - 6.0).exp();
    let colors: Vec<[f32; 3]> = (0..512).map(|k| body.color(temperature(k))).collect();
    let channels = (0..3).flat_map(|channel| colors.iter().map(move |color| color[channel]));
    // A component that is 0 has a logarithm, too.
    Some(channels.flat_map(|x| x.max(1e-30).ln().to_le_bytes()).collect())
}

/// 256 colours of the map that shows intensities.
fn colors() -> Vec<u8> {
    let table = Colormap::AfmhotUs.table();
    (0..256).flat_map(|k| table[k * (table.len() - 1) / 255]).collect()
}

//! Parts of a scene that the page does not show.

use super::subject::Subject;
use kerrlight_render::scene::Scene;

/// Spots that the page has room for.
pub const SPOTS: usize = 8;

/// Names of what is left out, as scene files have them.
pub fn of(subject: &Subject, falls: bool) -> Vec<String> {
    let Scene { mesh, volume, spot, effects, .. } = &subject.scene;
    let parts = [
        (!mesh.is_empty(), "[[mesh]]".to_owned()),
        (falls, "[[volume]] number 0, whose matter falls".to_owned()),
        (volume.len() > 1, format!("[[volume]] but the first of {}", volume.len())),
        (spot.len() > SPOTS, format!("[[spot]] but the first {SPOTS} of {}", spot.len())),
        (effects.half_orbits.is_some(), "effects.half_orbits: all images are there".to_owned()),
        (effects.polarization, "effects.polarization: light is that without it".to_owned()),
    ];
    parts.into_iter().filter_map(|(is, name)| is.then_some(name)).collect()
}

//! The sky behind everything, as a function of direction.
//!
//! Directions are unit vectors with z along the spin axis and the observer at azimuth 0
//! unless the scene turns it.

mod beam;
mod catalogue;
mod cells;
mod exr_sky;
mod panorama;
mod stars;

pub use beam::Beam;
pub use catalogue::{Catalogue, CatalogueError, CatalogueSky, CatalogueStar};
pub use panorama::{Panorama, PanoramaError};
pub use stars::StarField;

use crate::scene::{Checker, Sky};

/// A sky prepared for evaluation.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum SkyModel {
    /// A checkered sphere.
    Checker(Checker),
    /// Stars in cells of equal area.
    Stars(StarField),
    /// Stars of a catalogue.
    Catalogue(CatalogueSky),
    /// A picture and its brightness.
    Picture(Panorama, f32),
}

impl SkyModel {
    /// The sky of a scene; `picture` is the decoded file of a `[sky.image]`, `stars` that of a `[sky.catalogue]`.
    pub fn new(sky: &Sky, picture: Option<Panorama>, stars: Option<Catalogue>) -> Option<Self> {
        match sky {
            Sky::Checker(checker) => Some(SkyModel::Checker(checker.clone())),
            Sky::Stars(stars) => Some(SkyModel::Stars(StarField::new(stars))),
            Sky::Catalogue(settings) => {
                stars.map(|stars| SkyModel::Catalogue(CatalogueSky::new(settings, stars)))
            }
            Sky::Image(image) => {
                picture.map(|picture| SkyModel::Picture(picture, image.brightness as f32))
            }
        }
    }

    /// The same, ready for [`mean_color`](Self::mean_color).
    pub fn for_beams(self) -> Self {
        match self {
            SkyModel::Picture(picture, brightness) => {
                SkyModel::Picture(picture.with_pyramid(), brightness)
            }
            other => other,
        }
    }

    /// Mean linear colour over a beam.
    pub fn mean_color(&self, beam: &Beam) -> [f32; 3] {
        match self {
            SkyModel::Checker(checker) => beam.mean(|n| checker_color(checker, n)),
            SkyModel::Stars(stars) => stars.mean_color(beam),
            SkyModel::Catalogue(stars) => stars.mean_color(beam),
            SkyModel::Picture(picture, brightness) => {
                picture.mean_color(beam).map(|c| c * brightness)
            }
        }
    }

    /// Linear colour in a direction; points have none.
    pub fn color(&self, direction: [f64; 3]) -> [f32; 3] {
        match self {
            SkyModel::Checker(checker) => checker_color(checker, direction),
            SkyModel::Stars(stars) => stars.color(direction),
            SkyModel::Catalogue(_) => [0.0; 3],
            SkyModel::Picture(picture, brightness) => {
                picture.color(direction).map(|c| c * brightness)
            }
        }
    }
}

/// Light and dark fields; a colour for each quadrant of azimuth, paler below the equator.
fn checker_color(checker: &Checker, [x, y, z]: [f64; 3]) -> [f32; 3] {
    let azimuth = y.atan2(x).to_degrees().rem_euclid(360.0);
    let polar = x.hypot(y).atan2(z).to_degrees();
    let field = |angle: f64| (angle / checker.field_deg).floor() as i64;
    let light = (field(azimuth) + field(polar)).rem_euclid(2) == 0;
    let colors = [[0.9, 0.25, 0.2], [0.95, 0.75, 0.15], [0.2, 0.65, 0.35], [0.2, 0.4, 0.9]];
    let color: [f32; 3] = colors[((azimuth / 90.0) as usize).min(3)];
    let factor = if light { 1.0 } else { 0.12 } * checker.brightness as f32;
    let pale = if polar > 90.0 { 0.35 } else { 0.0 };
    color.map(|c| (c + (1.0 - c) * pale) * factor)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Stars;

    fn checker() -> Checker {
        Checker { field_deg: 15.0, brightness: 1.0 }
    }

    #[test]
    fn exact_poles_and_axes_have_colours() {
        let stars = Stars { count: 2000, radius_deg: 0.5, brightness: 1.0, seed: 7 };
        let skies = [SkyModel::Checker(checker()), SkyModel::Stars(StarField::new(&stars))];
        for sky in &skies {
            for d in [
                [0.0, 0.0, 1.0],
                [0.0, 0.0, -1.0],
                [1.0, 0.0, 0.0],
                [-1.0, 0.0, 0.0],
                [-1.0, -0.0, 0.0],
            ] {
                assert!(sky.color(d).iter().all(|c| c.is_finite() && *c >= 0.0), "{d:?}");
            }
        }
    }
}

//! A geometry that was weighed, as the numbers that a journal keeps.

use super::BandGeometry;
use crate::fit::band::{Background, Band};
use crate::fit::linear::Roughness;

impl BandGeometry {
    /// All that it is made of.
    pub(super) fn numbers(geometries: &[Self]) -> Vec<f64> {
        let mut all = vec![geometries.len() as f64];
        for geometry in geometries {
            all.extend([
                geometry.inclination_deg,
                geometry.rotation_factor,
                geometry.position_angle_deg,
            ]);
            all.extend([geometry.ln_posterior, geometry.by_radius.len() as f64]);
            all.extend_from_slice(&geometry.by_radius);
            all.extend(of_band(&geometry.band));
            all.push(geometry.likely.len() as f64);
            for (band, ln) in &geometry.likely {
                all.extend(of_band(band));
                all.push(*ln);
            }
        }
        all
    }

    /// Reads such numbers; none of others.
    pub(super) fn of_numbers(numbers: &[f64]) -> Option<Vec<Self>> {
        let mut next = numbers.iter().copied();
        let count = next.next()?;
        let geometries = (0..count as usize).map(|_| geometry(&mut next)).collect::<Option<_>>()?;
        next.next().is_none().then_some(geometries)
    }
}

fn geometry(next: &mut impl Iterator<Item = f64>) -> Option<BandGeometry> {
    let [inclination_deg, rotation_factor, position_angle_deg, ln_posterior] =
        [next.next()?, next.next()?, next.next()?, next.next()?];
    let radii = next.next()? as usize;
    let by_radius: Vec<f64> = next.by_ref().take(radii).collect();
    let band = band(next)?;
    let likely = next.next()? as usize;
    let likely =
        (0..likely).map(|_| Some((self::band(next)?, next.next()?))).collect::<Option<_>>()?;
    Some(BandGeometry {
        inclination_deg,
        rotation_factor,
        position_angle_deg,
        ln_posterior,
        by_radius,
        band,
        likely,
    })
}

fn of_band(band: &Band) -> [f64; 10] {
    let Band { radius, width, height, length, power, mean, background } = *band;
    let Background { constant, variation, minutes, roughness } = background;
    [radius, width, height, length, power, mean, constant, variation, minutes, roughness.nu()]
}

fn band(next: &mut impl Iterator<Item = f64>) -> Option<Band> {
    let numbers: Vec<f64> = next.by_ref().take(10).collect();
    let [radius, width, height, length, power, mean, constant, variation, minutes, smooth] =
        numbers.try_into().ok()?;
    let roughness = if smooth == 0.5 { Roughness::Half } else { Roughness::FiveHalves };
    let background = Background { constant, variation, minutes, roughness };
    Some(Band { radius, width, height, length, power, mean, background })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_geometries_come_back() {
        let background = Background {
            constant: 0.1,
            variation: 0.2,
            minutes: 30.0,
            roughness: Roughness::FiveHalves,
        };
        let band = Band { radius: 9.5, power: 1e-3, background, ..Band::DARK };
        let geometry = BandGeometry {
            inclination_deg: 12.0,
            rotation_factor: -0.8,
            position_angle_deg: 30.0,
            ln_posterior: -123.4,
            by_radius: vec![-1.0, f64::NEG_INFINITY],
            band,
            likely: vec![(Band::DARK, -3.0), (band, -0.5)],
        };
        let geometries = vec![geometry.clone(), BandGeometry { likely: Vec::new(), ..geometry }];
        let numbers = BandGeometry::numbers(&geometries);
        assert_eq!(BandGeometry::of_numbers(&numbers), Some(geometries));
        assert_eq!(BandGeometry::of_numbers(&numbers[..numbers.len() - 1]), None);
        assert_eq!(BandGeometry::of_numbers(&[]), None);
    }
}

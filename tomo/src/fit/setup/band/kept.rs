//! A world that was weighed, as the numbers that a journal keeps.

use super::BandWorld;
use crate::fit::band::{Background, Band};
use crate::fit::linear::Roughness;

impl BandWorld {
    /// All that it is made of.
    pub(super) fn numbers(worlds: &[Self]) -> Vec<f64> {
        let mut all = vec![worlds.len() as f64];
        for world in worlds {
            all.extend([world.inclination_deg, world.rotation_factor, world.position_angle_deg]);
            all.extend([world.ln_posterior, world.by_radius.len() as f64]);
            all.extend_from_slice(&world.by_radius);
            all.extend(of_band(&world.band));
            all.push(world.likely.len() as f64);
            for (band, ln) in &world.likely {
                all.extend(of_band(band));
                all.push(*ln);
            }
        }
        all
    }

    /// From such numbers; none of others.
    pub(super) fn of_numbers(numbers: &[f64]) -> Option<Vec<Self>> {
        let mut next = numbers.iter().copied();
        let count = next.next()?;
        let worlds = (0..count as usize).map(|_| world(&mut next)).collect::<Option<_>>()?;
        next.next().is_none().then_some(worlds)
    }
}

fn world(next: &mut impl Iterator<Item = f64>) -> Option<BandWorld> {
    let [inclination_deg, rotation_factor, position_angle_deg, ln_posterior] =
        [next.next()?, next.next()?, next.next()?, next.next()?];
    let radii = next.next()? as usize;
    let by_radius: Vec<f64> = next.by_ref().take(radii).collect();
    let band = band(next)?;
    let likely = next.next()? as usize;
    let likely =
        (0..likely).map(|_| Some((self::band(next)?, next.next()?))).collect::<Option<_>>()?;
    Some(BandWorld {
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
    let smooth = match roughness {
        Roughness::Half => 0.5,
        Roughness::FiveHalves => 2.5,
    };
    [radius, width, height, length, power, mean, constant, variation, minutes, smooth]
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
    fn exact_worlds_come_back() {
        let background = Background {
            constant: 0.1,
            variation: 0.2,
            minutes: 30.0,
            roughness: Roughness::FiveHalves,
        };
        let band = Band { radius: 9.5, power: 1e-3, background, ..Band::DARK };
        let world = BandWorld {
            inclination_deg: 12.0,
            rotation_factor: -0.8,
            position_angle_deg: 30.0,
            ln_posterior: -123.4,
            by_radius: vec![-1.0, f64::NEG_INFINITY],
            band,
            likely: vec![(Band::DARK, -3.0), (band, -0.5)],
        };
        let worlds = vec![world.clone(), BandWorld { likely: Vec::new(), ..world }];
        let numbers = BandWorld::numbers(&worlds);
        assert_eq!(BandWorld::of_numbers(&numbers), Some(worlds));
        assert_eq!(BandWorld::of_numbers(&numbers[..numbers.len() - 1]), None);
        assert_eq!(BandWorld::of_numbers(&[]), None);
    }
}

//! The image that a survey has found, with its errors.

use crate::envelope::Envelope;
use crate::ring::Ring;
use crate::solve::Solution;
use kerrlight_common::units::MICROARCSECOND;
use kerrlight_tomo::fit::setup::Held;
use kerrlight_vlbi::operator::ImageGrid;

/// An image with what it was made of.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Index of its start.
    pub start: usize,
    /// Factor on the penalties.
    pub strength: f64,
    /// The image.
    pub solution: Solution,
    /// χ² per datum of each kind.
    pub chi2: Vec<f64>,
    /// Its ring, where one is wanted and there is one.
    pub ring: Option<Ring>,
}

/// The image that was found, with others that tell its errors.
#[derive(Clone, Debug, PartialEq)]
pub struct Survey {
    /// The envelope, if there is one.
    pub envelope: Option<Envelope>,
    /// Strengths with the loss of frames that were held out, of fits that came to a minimum.
    pub held: Vec<Held>,
    /// The strength: the largest that predicts held-out frames as well as the best within a standard error.
    pub strength: f64,
    /// Images from all starts, in their order.
    pub starts: Vec<Candidate>,
    /// The start with the least loss.
    pub best: usize,
    /// Images with the other strengths that predict held-out frames as well, from the best start.
    pub strengths: Vec<Candidate>,
    /// Images of the measurement of the image with other noise.
    pub draws: Vec<Candidate>,
    /// Images of a known sky; none without simple shapes.
    pub known_sky: Option<Calibration>,
}

/// The simple shape that fits the same data best, and images of measurements of that shape: what the method makes of a known sky.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// Pixels of the shape, Jy.
    pub shape: Vec<f64>,
    /// True if the shape explains the data.
    pub explains: bool,
    /// Ring of the shape, where it has one.
    pub ring: Option<Ring>,
    /// The images.
    pub images: Vec<Candidate>,
    /// Fluxes of the shape in measurements of itself, Jy; none where it does not explain the data.
    pub fluxes: Vec<f64>,
}

impl Calibration {
    /// Images at a minimum: others say nothing of the method.
    pub fn at_minimum(&self) -> impl Iterator<Item = &Candidate> {
        self.images.iter().filter(|image| image.solution.has_converged)
    }

    /// Error of the shape's own flux, Jy: the scatter of what measurements of it say; 0 with fewer than two.
    fn flux_error(&self) -> f64 {
        scatter(&self.fluxes).unwrap_or(0.0)
    }

    /// What the method adds to a number of the shape, with the standard error, over the images that have it; none if fewer than two do.
    fn added(&self, number: &Number<'_>) -> Option<(f64, f64)> {
        let of_shape = number(&self.shape, self.ring.as_ref())?;
        let all: Vec<f64> = self.at_minimum().filter_map(|image| image.number(number)).collect();
        let (mean, of_mean) = mean_with_error(&all)?;
        Some((mean - of_shape, of_mean))
    }
}

/// Mean of values with its standard error; none of fewer than two.
pub fn mean_with_error(values: &[f64]) -> Option<(f64, f64)> {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (values.len() >= 2).then(|| (mean, (square / (count * (count - 1.0))).sqrt()))
}

/// Standard deviation of values; none of fewer than two.
fn scatter(values: &[f64]) -> Option<f64> {
    mean_with_error(values).map(|(_, error)| error * (values.len() as f64).sqrt())
}

/// Standard deviation of a direction of which nothing is known, degrees.
const UNKNOWN_DEG: f64 = 180.0 / 1.732_050_807_568_877_2;
/// Part of a diameter by which rings of one size differ at most.
const ALIKE: f64 = 0.25;
/// Error of a mean direction that says something of it, degrees.
const SURE_DEG: f64 = 15.0;

/// A number of the pixels of an image, Jy, and of its ring, where it has one.
type Number<'a> = dyn Fn(&[f64], Option<&Ring>) -> Option<f64> + 'a;

impl Candidate {
    fn number(&self, number: &Number<'_>) -> Option<f64> {
        number(&self.solution.image, self.ring.as_ref())
    }
}

impl Survey {
    /// The image.
    pub fn found(&self) -> &Candidate {
        &self.starts[self.best]
    }

    /// The centre of its ring, to the east and north of the middle of the field, µas; that of its light where it has no ring.
    pub fn centre_uas(&self, grid: ImageGrid) -> [f64; 2] {
        let found = self.found();
        if let Some(ring) = &found.ring {
            return ring.centre_uas;
        }
        let image = &found.solution.image;
        let mean = |place: &dyn Fn(usize) -> f64| {
            let moment: f64 = image.iter().enumerate().map(|(k, light)| light * place(k)).sum();
            moment / image.iter().sum::<f64>() / MICROARCSECOND
        };
        [mean(&|k| grid.east(k % grid.width)), mean(&|k| grid.north(k / grid.width))]
    }

    /// Images that data do not tell from the best: those of other starts with a loss within 1 %, and of other strengths.
    pub fn alternatives(&self) -> impl Iterator<Item = &Candidate> {
        let least = self.found().solution.loss;
        let as_good = move |start: &&Candidate| start.solution.loss <= 1.01 * least;
        self.starts.iter().filter(as_good).chain(&self.strengths)
    }

    /// Returns how many of the draws, and of the images that data do not tell from the best, have a ring, of a size that is within a
    /// quarter of this one's where this one has a ring; and how many these are.
    pub fn with_ring(&self) -> [usize; 2] {
        let all = || self.draws.iter().chain(self.alternatives());
        let here = self.found().ring.as_ref();
        let is_like = |ring: &Ring| {
            here.is_none_or(|here| (ring.diameter_uas / here.diameter_uas - 1.0).abs() < ALIKE)
        };
        [all().filter(|image| image.ring.as_ref().is_some_and(is_like)).count(), all().count()]
    }

    /// A number of the ring, less what the method adds to that of the best simple shape where it explains the data, and its error where
    /// that is known: a blurred ring is smaller and more even. An image that is not at a minimum is taken as it is.
    pub fn ring_number(&self, number: impl Fn(&Ring) -> f64) -> Option<(f64, Option<f64>)> {
        self.calibrated(&|_, ring| ring.map(&number))
    }

    /// Diameter of the ring in µas, likewise. Blurred by a beam of b, a ring of the diameter d has lost b²/(4 d ln 2) of it (EHT
    /// Collaboration 2019, ApJL 875, L4, appendix G): where no shape explains the data, that of a beam as wide as the ring is part of
    /// the error, since nothing says how much of its width is the array's.
    pub fn ring_diameter(&self) -> Option<(f64, Option<f64>)> {
        let (diameter, error) = self.ring_number(|ring| ring.diameter_uas)?;
        let ring = self.found().ring.as_ref()?;
        let blurred = match self.calibration().is_some_and(|known| known.explains) {
            true => 0.0,
            false => ring.width_uas.powi(2) / (4.0 * core::f64::consts::LN_2 * ring.diameter_uas),
        };
        Some((diameter, error.map(|error| error.hypot(blurred))))
    }

    /// Direction in which its ring is brightest, degrees east of north, likewise: bright parts draw light to them that belongs elsewhere.
    /// Images of an even ring have any direction, and say nothing of that.
    pub fn ring_direction(&self) -> Option<(f64, Option<f64>)> {
        let here = self.found().ring.as_ref()?.position_angle_deg;
        // As turns from the image's own direction: means of angles would jump at north.
        let turned: &Number<'_> =
            &|_, ring| Some((ring?.position_angle_deg - here + 540.0).rem_euclid(360.0) - 180.0);
        let is_known = self.calibration().and_then(|known| known.added(turned));
        let is_known = is_known.is_some_and(|(_, of_mean)| of_mean < SURE_DEG);
        let (turn, error) = match is_known {
            true => self.calibrated(turned)?,
            false => (0.0, self.error(|image| image.number(turned))),
        };
        Some(((here + turn).rem_euclid(360.0), error.map(|error| error.min(UNKNOWN_DEG))))
    }

    /// Flux in Jy, likewise: brightness that no baseline sees costs an image little, so that it has more of it than the sky.
    pub fn flux(&self) -> (f64, Option<f64>) {
        let number: &Number<'_> = &|image, _| Some(image.iter().sum());
        let here = self.found().solution.image.iter().sum();
        let (flux, error) = self.calibrated(number).unwrap_or((here, None));
        let of_shape = self.calibration().map_or(0.0, Calibration::flux_error);
        // The more the image's flux is that of the shape, the less it scatters, and the more the shape's error counts.
        (flux, error.map(|error| error.max(of_shape)))
    }

    /// A number less what the method adds to that of the best simple shape where it explains the data. Its error is then the standard
    /// deviation of the draws, the distance of images that data do not tell from the best, and the error of what is taken off, in
    /// quadrature; otherwise that of the image, with what the method adds to the shape's.
    fn calibrated(&self, number: &Number<'_>) -> Option<(f64, Option<f64>)> {
        let here = self.found().number(number)?;
        let of = |image: &Candidate| image.number(number);
        let known = self.calibration();
        let Some((added, of_added)) = known.and_then(|known| known.added(number)) else {
            return Some((here, self.error(of)));
        };
        // To a sky that is not like the shape the method adds something else: no more than its size is known.
        if known.is_some_and(|known| !known.explains) {
            return Some((here, self.error(of).map(|error| error.hypot(of_added).hypot(added))));
        }
        // The method adds to images of the image as well: what is taken off is no error of the rest.
        let draws: Vec<f64> = self.draws_that_count().into_iter().filter_map(of).collect();
        let others = self.apart(&mut self.alternatives(), of)?;
        let error = scatter(&draws).map(|scatter| (scatter.powi(2) + others).sqrt());
        Some((here - added, error.map(|error| error.hypot(of_added))))
    }

    /// Draws that have come to a minimum, if half of all have: those that stopped on their way stay near where they started, and
    /// near each other. Otherwise all of them, which tell too little of errors.
    pub fn draws_that_count(&self) -> Vec<&Candidate> {
        let there = self.draws.iter().filter(|draw| draw.solution.has_converged);
        let there: Vec<&Candidate> = there.collect();
        let are_few = there.len() < 2 || 2 * there.len() < self.draws.len();
        if are_few { self.draws.iter().collect() } else { there }
    }

    /// Images of a known sky, if they say what the method has done to the image: it came to a minimum.
    pub fn calibration(&self) -> Option<&Calibration> {
        self.known_sky.as_ref().filter(|_| self.found().solution.has_converged)
    }

    /// Error of a number of the ring: as [`error`](Self::error), over images that have a ring.
    pub fn ring_error(&self, number: impl Fn(&Ring) -> f64) -> Option<f64> {
        self.error(|image| image.ring.as_ref().map(&number))
    }

    /// Error of a number of the image: root mean square distance of the [draws](Self::draws_that_count) from it, and of the images
    /// that data do not tell from it, added in quadrature, over those that have the number; none with less than two such draws.
    pub fn error(&self, number: impl Fn(&Candidate) -> Option<f64>) -> Option<f64> {
        let draws = self.draws_that_count();
        let count = draws.iter().filter_map(|draw| number(draw)).count();
        let square = self.apart(&mut draws.into_iter(), &number)?
            + self.apart(&mut self.alternatives(), &number)?;
        (count >= 2).then(|| square.sqrt())
    }

    /// Mean square distance of a number of images from that of the best, over those that have it.
    fn apart(
        &self,
        images: &mut dyn Iterator<Item = &Candidate>,
        number: impl Fn(&Candidate) -> Option<f64>,
    ) -> Option<f64> {
        let here = number(self.found())?;
        let apart: Vec<f64> =
            images.filter_map(number).map(|there| (there - here).powi(2)).collect();
        Some(apart.iter().sum::<f64>() / apart.len().max(1) as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(flux: f64) -> Candidate {
        let solution = Solution {
            parameters: Vec::new(),
            image: vec![0.25 * flux, 0.75 * flux],
            loss: 1.0,
            iterations: 1,
            has_converged: true,
        };
        Candidate { start: 0, strength: 1.0, solution, chi2: Vec::new(), ring: None }
    }

    /// An image of 1.1 Jy, draws of 1.12 and 1.18 Jy, and images of a shape of 1 Jy which have 1.05 and 1.07. Where it explains the data,
    /// its own flux scatters by 0.03.
    fn survey(explains: bool) -> Survey {
        let images = vec![image(1.05), image(1.07)];
        let fluxes = if explains { vec![0.97, 1.0, 1.03] } else { Vec::new() };
        Survey {
            envelope: None,
            held: Vec::new(),
            strength: 1.0,
            starts: vec![image(1.1)],
            best: 0,
            strengths: Vec::new(),
            draws: vec![image(1.12), image(1.18)],
            known_sky: Some(Calibration {
                shape: vec![0.4, 0.6],
                explains,
                ring: None,
                images,
                fluxes,
            }),
        }
    }

    #[test]
    fn exact_flux_that_the_method_adds_is_taken_off_where_the_shape_explains() {
        let near = |(flux, error): (f64, Option<f64>), expected: [f64; 2]| {
            let off = [flux - expected[0], error.expect("an error") - expected[1]];
            assert!(off.iter().all(|off| off.abs() < 1e-12), "{flux} {error:?}");
        };
        // Draws have 0.05 Jy too much as well: they scatter by 0.06/√2 about their mean.
        let scatter = 0.06 / 2f64.sqrt();
        near(survey(true).flux(), [1.04, scatter.hypot(0.01)]);
        let mut hardly_seen = survey(true);
        hardly_seen.draws = vec![image(1.12), image(1.12)];
        near(hardly_seen.flux(), [1.04, 0.03]);
        let off = (0.02f64.powi(2) + 0.08f64.powi(2)) / 2.0;
        near(survey(false).flux(), [1.1, off.sqrt().hypot(0.06).hypot(0.01)]);
        let mut stopped = survey(true);
        stopped.starts[0].solution.has_converged = false;
        near(stopped.flux(), [1.1, off.sqrt()]);
        // A draw that stopped near its start says nothing beside others that did not.
        stopped.draws.push(image(9.0));
        stopped.draws[2].solution.has_converged = false;
        near(stopped.flux(), [1.1, off.sqrt()]);
    }

    /// The same image with a ring that is brightest in a direction.
    fn ring(of: Candidate, position_angle_deg: f64) -> Candidate {
        Candidate { ring: Some(towards(position_angle_deg)), ..of }
    }

    fn towards(position_angle_deg: f64) -> Ring {
        Ring {
            centre_uas: [0.0; 2],
            diameter_uas: 42.0,
            diameter_scatter_uas: 0.0,
            width_uas: 10.0,
            position_angle_deg,
            asymmetry: 0.3,
            central_brightness: 0.0,
            coverage: 1.0,
        }
    }

    /// An image at 350°, its draws 20° from each other, and images of a crescent at 10° which are at 5° and 7°. With images in all directions
    /// the crescent says nothing.
    #[test]
    fn exact_directions_that_the_method_turns_are_turned_back() {
        let with = |images: [f64; 2]| {
            let plain = survey(true);
            let known = plain.known_sky.clone().expect("a sky");
            let known = Calibration {
                ring: Some(towards(10.0)),
                images: images.map(|angle| ring(image(1.0), angle)).to_vec(),
                ..known
            };
            Survey {
                starts: vec![ring(image(1.0), 350.0)],
                draws: vec![ring(image(1.0), 340.0), ring(image(1.0), 0.0)],
                known_sky: Some(known),
                ..plain
            }
        };
        let near = |images, expected: [f64; 2]| {
            let (angle, error) = with(images).ring_direction().expect("a direction");
            let off = [angle - expected[0], error.expect("an error") - expected[1]];
            assert!(off.iter().all(|off| off.abs() < 1e-9), "{angle} {error:?}");
        };
        near([5.0, 7.0], [354.0, 200f64.sqrt().hypot(1.0)]);
        near([100.0, 220.0], [350.0, 10.0]);
    }
}

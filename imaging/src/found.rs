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
    pub calibration: Option<Calibration>,
}

/// A simple shape that fits the same data, and images of measurements of that shape: what the method makes of a known sky. The shape
/// is the best one with a hole where the image has a ring, and the best of all otherwise.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// Flux of the shape, Jy.
    pub flux_jy: f64,
    /// Ring of the shape, where it has one.
    pub ring: Option<Ring>,
    /// The images.
    pub images: Vec<Candidate>,
}

impl Calibration {
    /// Mean of a number of the images that have it and came to a minimum, with its standard error; none if fewer than two do.
    fn mean(&self, number: impl Fn(&Candidate) -> Option<f64>) -> Option<(f64, f64)> {
        let at_minimum = self.images.iter().filter(|image| image.solution.has_converged);
        let all: Vec<f64> = at_minimum.filter_map(number).collect();
        let count = all.len() as f64;
        let mean = all.iter().sum::<f64>() / count;
        let square: f64 = all.iter().map(|one| (one - mean).powi(2)).sum();
        (all.len() >= 2).then(|| (mean, (square / (count * (count - 1.0))).sqrt()))
    }

    /// Diameter that the method adds to a ring, µas, with its standard error.
    fn added_diameter(&self) -> Option<(f64, f64)> {
        let (found, error) = self.mean(|image| image.ring.map(|ring| ring.diameter_uas))?;
        Some((found - self.ring?.diameter_uas, error))
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

    /// Returns how many of the draws, and of the images that data do not tell from the best, have a ring, and how many these
    /// are.
    pub fn with_ring(&self) -> [usize; 2] {
        let all = || self.draws.iter().chain(self.alternatives());
        [all().filter(|image| image.ring.is_some()).count(), all().count()]
    }

    /// Diameter of the ring in µas, less what the method adds to that of the best simple shape, and its error where that is known:
    /// a blurred ring is smaller. An image that is not at a minimum is taken as it is.
    pub fn ring_diameter(&self) -> Option<(f64, Option<f64>)> {
        let here = self.found().ring?.diameter_uas;
        let error = self.ring_error(|ring| ring.diameter_uas);
        let added = self.calibration().and_then(Calibration::added_diameter);
        let (added, of_added) = added.unwrap_or((0.0, 0.0));
        // To another ring it may add anything from half to one and a half times that.
        let of_added = of_added.hypot(added / 12f64.sqrt());
        Some((here - added, error.map(|error| error.hypot(of_added))))
    }

    /// Images of a known sky, if they say what the method has done to the image: it came to a minimum.
    fn calibration(&self) -> Option<&Calibration> {
        self.calibration.as_ref().filter(|_| self.found().solution.has_converged)
    }

    /// Error of the flux, Jy: as [`error`](Self::error), and what the method adds to the flux of the best simple shape.
    pub fn flux_error(&self) -> Option<f64> {
        let flux = |image: &Candidate| Some(image.solution.image.iter().sum::<f64>());
        let of_shape = self.calibration();
        let added = of_shape.and_then(|of_shape| Some(of_shape.mean(flux)?.0 - of_shape.flux_jy));
        Some(self.error(flux)?.hypot(added.unwrap_or(0.0)))
    }

    /// Error of a number of the ring: as [`error`](Self::error), over images that have a ring.
    pub fn ring_error(&self, number: impl Fn(&Ring) -> f64) -> Option<f64> {
        self.error(|image| image.ring.as_ref().map(&number))
    }

    /// Error of a number of the image: root mean square distance of the draws from it, and of the images that data do not tell
    /// from it, added in quadrature, over those that have the number; none with less than two such draws.
    pub fn error(&self, number: impl Fn(&Candidate) -> Option<f64>) -> Option<f64> {
        let here = number(self.found())?;
        let square = |images: &mut dyn Iterator<Item = &Candidate>| -> (f64, usize) {
            let apart: Vec<f64> =
                images.filter_map(&number).map(|there| (there - here).powi(2)).collect();
            (apart.iter().sum::<f64>() / apart.len().max(1) as f64, apart.len())
        };
        let (draws, count) = square(&mut self.draws.iter());
        let (others, _) = square(&mut self.alternatives());
        (count >= 2).then(|| (draws + others).sqrt())
    }
}

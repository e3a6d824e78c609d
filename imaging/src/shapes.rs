//! Simple shapes that are fitted to the data of an image, with the same gains: what the image has to do better than.

use crate::Error;
use crate::envelope::{Envelope, Profile};
use crate::problem::{FluxPrior, ImageProblem};
use crate::settings::StaticImageFile;
use crate::solve::{Minimum, minimum};
use core::f64::consts::{LN_2, TAU};
use kerrlight_common::units::MICROARCSECOND;
use kerrlight_tomo::fit::settings::LossKind;
use kerrlight_tomo::fit::setup::FitData;
use kerrlight_tomo::fit::verdict::is_chance;
use kerrlight_vlbi::operator::ImageGrid;
use rayon::prelude::*;

/// A shape with a few parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// An elliptical Gaussian.
    Gaussian,
    /// A round disc of even brightness.
    Disc,
    /// A round ring of even brightness with a Gaussian cross-section.
    Ring,
    /// The same, brighter on one side: 1 + b cos φ along the ring (Johnson et al. 2020, Science Advances 6, eaaz1310).
    Crescent,
    /// Two round Gaussians.
    Double,
}

/// A shape with the parameters for which it fits best.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeFit {
    /// Kind of shape.
    pub shape: Shape,
    /// Its sizes: name, value, and unit.
    pub sizes: Vec<(&'static str, f64, &'static str)>,
    /// Shares of the flux in the pixels.
    pub shares: Vec<f64>,
    /// Its flux, Jy.
    pub flux_jy: f64,
    /// The logarithm of its flux over the expected one, and the parameters of its shares.
    pub(crate) parameters: Vec<f64>,
    /// χ² per datum of each kind.
    pub chi2: Vec<f64>,
    /// χ² of all independent data, plus the number of parameters times the logarithm of that of the data (Schwarz 1978, Annals
    /// of Statistics 6, 461): the less, the better.
    pub criterion: f64,
    /// True if χ² of each kind is what chance allows; false where errors stand for what the source varies, which any shape may
    /// explain.
    pub explains: bool,
}

impl ShapeFit {
    /// Light of about this extent: flat where the shape is even to an edge, a Gaussian where it has wings.
    pub fn envelope(&self, grid: ImageGrid) -> Envelope {
        let profile = match self.shape {
            Shape::Gaussian | Shape::Double => Profile::Gaussian,
            Shape::Disc | Shape::Ring | Shape::Crescent => Profile::Flat,
        };
        Envelope { profile, fwhm_uas: self.width_uas(grid) }
    }

    /// Full width at half maximum of the round Gaussian with the same second moment about the centroid, µas.
    fn width_uas(&self, grid: ImageGrid) -> f64 {
        let places = (0..grid.pixels()).map(|k| grid.place_uas(k));
        let mut moments = [0.0; 3];
        for (share, [east, north]) in self.shares.iter().zip(places) {
            moments[0] += share * east;
            moments[1] += share * north;
            moments[2] += share * (east * east + north * north);
        }
        let [east, north, square] = moments;
        (4.0 * LN_2 * (square - east * east - north * north)).sqrt()
    }
}

impl Shape {
    /// All of them.
    pub const ALL: [Self; 5] =
        [Self::Gaussian, Self::Disc, Self::Ring, Self::Crescent, Self::Double];

    /// Returns its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Gaussian => "Gaussian",
            Self::Disc => "disc",
            Self::Ring => "ring",
            Self::Crescent => "crescent",
            Self::Double => "double",
        }
    }

    /// Returns whether it is dark inside.
    pub fn is_ring(self) -> bool {
        matches!(self, Self::Ring | Self::Crescent)
    }

    /// Parameters to start from for a source of this size, µas. Lengths are logarithms of µas, offsets are in sizes; b is the
    /// hyperbolic tangent of its parameter.
    fn starts(self, size: f64) -> Vec<Vec<f64>> {
        let l = size.ln();
        let turns =
            |count: usize| (0..count).map(move |k| (TAU * k as f64 / count as f64).sin_cos());
        let around = [0.75f64, 1.0, 1.35];
        match self {
            Self::Gaussian => vec![vec![l, 0.0, 0.0], vec![l - 0.5, 0.0, 0.0]],
            Self::Disc => [1.2f64, 1.6, 2.1].iter().map(|f| vec![l + f.ln()]).collect(),
            Self::Ring => around.iter().map(|f| vec![l + f.ln(), l - 1.0]).collect(),
            Self::Crescent => turns(4)
                .flat_map(|(s, c)| around.iter().map(move |f| vec![l + f.ln(), l - 1.0, s, c]))
                .collect(),
            // From one separation alone fits can stick far from the data.
            Self::Double => turns(12)
                .flat_map(|(s, c)| {
                    [0.4, 0.9].map(|apart| vec![l - 0.7, l - 0.7, apart * s, apart * c, 0.2])
                })
                .collect(),
        }
    }

    /// Shares of the flux in the pixels of a grid.
    fn shares(self, x: &[f64], size: f64, grid: ImageGrid) -> Vec<f64> {
        let pixel = grid.pixel_rad / MICROARCSECOND;
        let width = |ln: f64| drawn(ln, pixel);
        let bell = |square: f64, ln: f64| (-4.0 * LN_2 * square / width(ln).powi(2)).exp();
        let light = |east: f64, north: f64| match self {
            Self::Gaussian => {
                // The exponential of [[x₁, x₂], [x₂, −x₁]], of determinant 1: x₀ sets the area.
                // A round Gaussian, whose angle means nothing, is a point like others.
                let size = x[1].hypot(x[2]);
                let h = size.min(MOST_STRETCHED);
                let part = if size > 0.0 { h.sinh() / size } else { 1.0 };
                let round = h.cosh() * (east * east + north * north);
                let long = x[1] * (east * east - north * north) + 2.0 * x[2] * east * north;
                bell((round + part * long).max(0.0), x[0])
            }
            Self::Disc => {
                // About a pixel wide: differences of pixels see no slope of a sharp edge.
                let inside = (0.5 * width(x[0]) - east.hypot(north)) / pixel;
                1.0 / (1.0 + (-4.0 * inside).exp())
            }
            Self::Ring => bell((east.hypot(north) - 0.5 * width(x[0])).powi(2), x[1]),
            Self::Crescent => {
                // Against 0/0: in the middle of the ring, and below at b = 0.
                let r = east.hypot(north).max(1e-9);
                let size = x[2].hypot(x[3]).max(1e-9);
                let side = size.tanh() / size * (x[2] * east + x[3] * north) / r;
                bell((r - 0.5 * width(x[0])).powi(2), x[1]) * (1.0 + side)
            }
            Self::Double => {
                let off = [0.5 * size * x[2], 0.5 * size * x[3]];
                let one = |sign: f64, ln: f64| {
                    let square = (east - sign * off[0]).powi(2) + (north - sign * off[1]).powi(2);
                    // Over its area: the weights of both are then parts of the flux.
                    bell(square, ln) / width(ln).powi(2)
                };
                let first = 1.0 / (1.0 + (-x[4]).exp());
                first * one(1.0, x[0]) + (1.0 - first) * one(-1.0, x[1])
            }
        };
        let of = |k: usize| {
            let [east, north] = grid.place_uas(k);
            light(east, north)
        };
        let all: Vec<f64> = (0..grid.pixels()).map(of).collect();
        // A ring that a step has put beyond the field lights no pixel: 0, not 0/0.
        let sum: f64 = all.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        all.into_iter().map(|x| x / sum).collect()
    }

    /// Names, values and units of its sizes, as pixels of this width show them.
    fn sizes(self, x: &[f64], size: f64, pixel: f64) -> Vec<(&'static str, f64, &'static str)> {
        let width = |ln: f64| drawn(ln, pixel);
        let turn = |east: f64, north: f64| east.atan2(north).to_degrees().rem_euclid(360.0);
        match self {
            Self::Gaussian => {
                let h = x[1].hypot(x[2]).min(MOST_STRETCHED);
                // The longer axis is where the form is least.
                let angle = 0.5 * (-x[2]).atan2(x[1]).to_degrees();
                vec![
                    ("major axis", width(x[0]) * (0.5 * h).exp(), "µas"),
                    ("minor axis", width(x[0]) * (-0.5 * h).exp(), "µas"),
                    ("position angle", angle.rem_euclid(180.0), "°"),
                ]
            }
            Self::Disc => vec![("diameter", width(x[0]), "µas")],
            Self::Ring => vec![("diameter", width(x[0]), "µas"), ("width", width(x[1]), "µas")],
            Self::Crescent => vec![
                ("diameter", width(x[0]), "µas"),
                ("width", width(x[1]), "µas"),
                ("brightest direction", turn(x[2], x[3]), "°"),
            ],
            Self::Double => vec![
                ("distance", size * x[2].hypot(x[3]), "µas"),
                ("direction", turn(x[2], x[3]), "°"),
                ("width of one", width(x[0]), "µas"),
                ("width of the other", width(x[1]), "µas"),
            ],
        }
    }
}

/// Logarithm of the largest ratio of a Gaussian's axes, 20.
const MOST_STRETCHED: f64 = 3.0;

/// The shape that fits best by its criterion.
pub fn best_shape<'a>(shapes: impl Iterator<Item = &'a ShapeFit>) -> Option<&'a ShapeFit> {
    shapes.min_by(|a, b| a.criterion.total_cmp(&b.criterion))
}

/// A width of this logarithm in a picture: nothing is narrower than its pixels tell.
fn drawn(ln: f64, pixel: f64) -> f64 {
    // Line searches may try any length: its exponential stays finite, and far beyond the field.
    ln.clamp((pixel.ln() - 8.0).min(-5.0), (pixel.ln() + 8.0).max(9.0)).exp().hypot(pixel)
}

/// Fits all shapes; none if `go_on` said no.
///
/// # Errors
/// If a loss has no data.
pub fn fit_shapes(
    file: &StaticImageFile,
    measured: &FitData,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Result<Option<Vec<ShapeFit>>, Error> {
    let grid = file.image.grid()?;
    let terms = measured.visibility_terms(&file.loss, grid.pixels())?;
    let problem = ImageProblem {
        terms: &terms,
        frames: (0..measured.times.len()).collect(),
        priors: &[],
        envelope: None,
        strength: 1.0,
        flux: FluxPrior { jy: file.image.flux_jy, sigma_jy: file.image.flux_sigma_jy },
        side: file.image.pixels,
    };
    let one = |shape: &Shape| best(*shape, &problem, file, grid, go_on);
    Ok(Shape::ALL.par_iter().map(one).collect())
}

/// Iterations from one start, at most.
const ITERATIONS: usize = 60;

/// A shape and the data that it is fitted to.
struct Fitting<'a> {
    shape: Shape,
    problem: &'a ImageProblem<'a>,
    grid: ImageGrid,
    /// Size of a source in this field, µas.
    size: f64,
}

impl Fitting<'_> {
    fn image(&self, x: &[f64]) -> Vec<f64> {
        let (flux, sizes) = x.split_first().unwrap_or((&0.0, &[]));
        let shares = self.shape.shares(sizes, self.size, self.grid);
        shares.into_iter().map(|share| share * self.problem.flux.jy * flux.exp()).collect()
    }

    /// The minimum from parameters, by derivatives of the pixels from differences; none if `go_on` said no.
    fn solved(&self, begin: &[f64], go_on: &(dyn Fn() -> bool + Sync)) -> Option<Minimum> {
        let mut objective = |x: &[f64], g: &mut [f64]| {
            // Only pixels are differenced: data and their gains are solved once for a gradient.
            let flux = self.problem.flux.jy * x[0].exp();
            let (value, of_image, slope) = self.problem.data_and_gradient(&self.image(x), flux);
            for (k, g) in g.iter_mut().enumerate() {
                const STEP: f64 = 1e-4;
                let moved = |step: f64| {
                    let mut x = x.to_vec();
                    x[k] += step;
                    self.image(&x)
                };
                let ends = moved(STEP).into_iter().zip(moved(-STEP));
                *g = ends.zip(&of_image).map(|((a, b), g)| (a - b) * g).sum::<f64>() / (2.0 * STEP);
            }
            g[0] += slope;
            value
        };
        minimum(&mut objective, begin, ITERATIONS, go_on)
    }
}

/// Size of a source in the field of these settings, µas.
fn size(file: &StaticImageFile) -> f64 {
    0.32 * file.image.field_uas
}

/// Flux in Jy of a shape that is fitted to other data, from where it fits the first ones best; none if `go_on` said no.
pub(crate) fn refitted_flux(
    fit: &ShapeFit,
    problem: &ImageProblem<'_>,
    file: &StaticImageFile,
    grid: ImageGrid,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Option<f64> {
    let fitting = Fitting { shape: fit.shape, problem, grid, size: size(file) };
    let mut begin = fit.parameters.clone();
    // The flux counts from the mean of its prior, which is another one here: it stays the same.
    begin[0] += (file.image.flux_jy / problem.flux.jy).ln();
    let found = fitting.solved(&begin, go_on)?;
    Some(problem.flux.jy * found.parameters[0].exp())
}

fn best(
    shape: Shape,
    problem: &ImageProblem<'_>,
    file: &StaticImageFile,
    grid: ImageGrid,
    go_on: &(dyn Fn() -> bool + Sync),
) -> Option<ShapeFit> {
    let size = size(file);
    let fitting = Fitting { shape, problem, grid, size };
    let solved = |start: Vec<f64>| {
        let begin: Vec<f64> = [0.0].into_iter().chain(start).collect();
        fitting.solved(&begin, go_on)
    };
    let all: Option<Vec<_>> = shape.starts(size).into_par_iter().map(solved).collect();
    let key = |loss: f64| if loss.is_nan() { f64::INFINITY } else { loss };
    let found = all?.into_iter().min_by(|a, b| key(a.loss).total_cmp(&key(b.loss)))?;
    let here = fitting.image(&found.parameters);
    let chi2 = problem.chi2(&here);
    let is_still = file.data.visibilities.variability.is_none();
    let mut kinds = chi2.iter().zip(problem.counts());
    let explains = is_still && kinds.all(|(chi2, count)| is_chance(*chi2, count));
    let (total, count) = independent(problem, file, &chi2);
    let shares = shape.shares(&found.parameters[1..], size, grid);
    let criterion = total + found.parameters.len() as f64 * count.max(1.0).ln();
    // One that a step has put beyond the field explains nothing.
    let is_seen = criterion.is_finite() && shares.iter().any(|share| *share > 0.0);
    Some(ShapeFit {
        shape,
        sizes: shape.sizes(&found.parameters[1..], size, grid.pixel_rad / MICROARCSECOND),
        shares,
        flux_jy: here.iter().sum(),
        chi2,
        criterion: if is_seen { criterion } else { f64::INFINITY },
        explains: explains && is_seen,
        parameters: found.parameters,
    })
}

/// χ² and number of the data that are not made of each other: log closure amplitudes repeat what amplitudes with gains say.
fn independent(problem: &ImageProblem<'_>, file: &StaticImageFile, chi2: &[f64]) -> (f64, f64) {
    let has_amplitudes = file
        .loss
        .iter()
        .any(|loss| matches!(loss.data, LossKind::Amplitudes | LossKind::Visibilities));
    let repeats = |kind: LossKind| kind == LossKind::LogClosureAmplitudes && has_amplitudes;
    let kinds = file.loss.iter().zip(problem.counts()).zip(chi2);
    kinds
        .filter(|((loss, _), _)| !repeats(loss.data))
        .fold((0.0, 0.0), |sum, ((_, n), chi2)| (sum.0 + chi2 * n as f64, sum.1 + n as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A Gaussian of 20 mas in a field of 100 mas keeps its width, whatever number of µas that is.
    #[test]
    fn exact_widths_have_no_unit() {
        let shares = |field_uas: f64| {
            let grid = ImageGrid::new(24, 24, field_uas * MICROARCSECOND).unwrap();
            Shape::Gaussian.shares(&[(0.2 * field_uas).ln(), 0.0, 0.0], 0.32 * field_uas, grid)
        };
        for (large, small) in shares(1e5).iter().zip(shares(100.0)) {
            assert!((large - small).abs() < 1e-12);
        }
    }

    /// Beyond the largest ratio of axes a Gaussian stays the one of that ratio: an ellipse, not a strip across the field.
    #[test]
    fn exact_gaussians_are_no_narrower_than_the_largest_ratio() {
        let grid = ImageGrid::new(60, 60, 120.0 * MICROARCSECOND).unwrap();
        let shares = |x: [f64; 3]| Shape::Gaussian.shares(&x, 30.0, grid);
        for [a, b] in [[1.0, 0.0], [0.0, 1.0], [-0.6, 0.8]] {
            let at = |h: f64| shares([20f64.ln(), a * h, b * h]);
            let most = at(MOST_STRETCHED);
            for (found, expected) in at(4.5).iter().zip(&most) {
                assert!((found - expected).abs() < 1e-12);
            }
            assert!(at(1.0).iter().zip(&most).any(|(x, y)| (x - y).abs() > 1e-4));
        }
    }
}

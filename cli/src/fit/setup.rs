//! From settings to the pieces of a fit.

use super::config::{self, AxisSearch, FitFile, Nodes, Scan, Velocity, WidthOf};
use anyhow::{Context, anyhow, bail};
use kerrlight_geodesic::{Inclination, Kerr, Observer};
use kerrlight_tomo::dynamics::{Axis, Injection};
use kerrlight_tomo::fit::linear::Prior;
use kerrlight_tomo::fit::{
    Motion, Redshift, Region, Regulariser, Sampling, SightlineRequest, Sightlines,
};
use kerrlight_tomo::interferometry::operator::ImageGrid;
use kerrlight_tomo::memory;
use kerrlight_tomo::optimise::Polynomial;
use kerrlight_tomo::scene;
use kerrlight_tomo::units::{MICROARCSECOND, gravitational_angle, gravitational_time};

/// What a fit looks through: the same for all data and representations.
pub struct Instrument {
    /// The hole.
    pub hole: Kerr,
    /// Nodes on rays; weights in Jy a pixel for emission 1.
    pub lines: Sightlines,
    /// Emission goes like g to this power.
    pub redshift: Option<Redshift>,
}

/// Rays of the trial by which the nodes of all are estimated.
const TRIAL: usize = 512;

impl Instrument {
    /// Traces the rays of all pixels.
    pub fn new(file: &FitFile) -> anyhow::Result<Self> {
        let n = file.screen.pixels;
        Self::afford(file, n.saturating_mul(n))?;
        Self::of(file, &(0..n * n).collect::<Vec<_>>())
    }

    /// Refuses rays that there is no memory for, as estimated from a few of them.
    fn afford(file: &FitFile, pixels: usize) -> anyhow::Result<()> {
        spacing(&file.screen)?;
        let each = match file.region.nodes {
            Nodes::Gauss { order, split } => order as f64 * f64::from(split),
            Nodes::EqualMinoTime { per_ray } => per_ray as f64,
        };
        let block = || format!("region.nodes: {each} nodes or more on each ray of a block");
        memory::afford(block, memory::nodes(each * TRIAL.min(pixels) as f64, 0.0))?;
        let chosen: Vec<usize> = (0..pixels).step_by(pixels.div_ceil(TRIAL).max(1)).collect();
        // What is wrong with them is told by those of all pixels.
        let Ok(few) = Self::of(file, &chosen) else { return Ok(()) };
        let nodes = few.lines.points() as f64 * pixels as f64 / chosen.len() as f64;
        let (momenta, delays) = (few.lines.momentum[0].len(), few.lines.delay.len());
        let columns = [(momenta, 3.0), (delays, 2.0)];
        let columns = columns.iter().map(|(count, n)| if *count > 0 { *n } else { 0.0 }).sum();
        let n = file.screen.pixels;
        let what = || {
            format!("screen.pixels = {n}: about {nodes:.0} nodes on the rays of {pixels} pixels")
        };
        Ok(memory::afford(what, memory::nodes(nodes, columns))?)
    }

    /// Traces the rays of some pixels, rows from the top, each from the left.
    pub fn of(file: &FitFile, chosen: &[usize]) -> anyhow::Result<Self> {
        let hole = Kerr::new(file.hole.spin).context("hole")?;
        let region = region(&file.region);
        let request = SightlineRequest {
            region,
            sampling: match file.region.nodes {
                Nodes::Gauss { order, split } => {
                    if !(1..=16).contains(&order) || split == 0 {
                        bail!(
                            "region.nodes: order = {order}, split = {split} are not allowed: 1 to 16, 1 or more"
                        );
                    }
                    Sampling::Gauss { order, split }
                }
                Nodes::EqualMinoTime { per_ray } => {
                    if !(2..=100_000).contains(&per_ray) {
                        bail!("region.nodes: per_ray = {per_ray} is not allowed: 2 to 100000");
                    }
                    Sampling::EqualMinoTime { per_ray }
                }
            },
            delay: file.effects.slow_light,
            momentum: file.effects.redshift_power.is_some(),
        };
        let (alpha, beta) = pixels(&file.screen, chosen)?;
        let observer = observer(&file.observer)?;
        let mut lines = Sightlines::trace(&hole, &observer, &alpha, &beta, &request)
            .context("region and screen")?;
        if lines.rays() == 0 {
            bail!("no ray meets the region: region.r_min to r_max lies outside the screen");
        }
        let jy = file.screen.jy_per_pixel;
        if !(jy > 0.0 && jy.is_finite()) {
            bail!("screen.jy_per_pixel = {jy} is not allowed: above 0");
        }
        if let Some(medium) = file.effects.absorption {
            lines.absorb(opacity(medium)?);
        }
        lines.weight.iter_mut().for_each(|weight| *weight *= jy);
        let redshift = file.effects.redshift_power.map(|power| Redshift { power });
        Ok(Self { hole, lines, redshift })
    }
}

/// κ(x) of the medium.
fn opacity(medium: config::Absorption) -> anyhow::Result<impl Fn([f64; 3]) -> f64> {
    let config::Absorption { coefficient, radius, height } = medium;
    if !(coefficient >= 0.0 && coefficient.is_finite()) {
        bail!("effects.absorption.coefficient = {coefficient} is not allowed: 0 or above");
    }
    for (name, value) in [("radius", radius), ("height", height)] {
        if !(value > 0.0 && value.is_finite()) {
            bail!("effects.absorption.{name} = {value} is not allowed: above 0");
        }
    }
    Ok(move |[x, y, z]: [f64; 3]| {
        let square = (x * x + y * y + z * z) / (radius * radius) + z * z / (height * height);
        coefficient * (-0.5 * square).exp()
    })
}

/// The region of recovery.
pub fn region(region: &config::Region) -> Region {
    let z_width = region.z_width.unwrap_or(f64::INFINITY);
    Region { r_min: region.r_min, r_max: region.r_max, z_width }
}

/// The observer.
pub fn observer(observer: &config::Observer) -> anyhow::Result<Observer> {
    let inclination = Inclination::from_degrees(observer.inclination_deg).context("observer")?;
    match observer.radius {
        None => Ok(Observer::at_infinity(inclination)),
        Some(radius) => Observer::at_radius(inclination, radius).context("observer"),
    }
}

/// (α, β) of pixels, rows from the top, each from the left.
fn pixels(screen: &config::Screen, chosen: &[usize]) -> anyhow::Result<(Vec<f64>, Vec<f64>)> {
    let (n, step) = (screen.pixels, spacing(screen)?);
    let at = |k: usize| (k as f64 - 0.5 * (n as f64 - 1.0)) * step;
    Ok(chosen.iter().map(|k| (at(k % n), -at(k / n))).unzip())
}

/// M from one pixel to the next.
pub fn spacing(screen: &config::Screen) -> anyhow::Result<f64> {
    let config::Screen { pixels, width, width_of, .. } = *screen;
    if !(2..=4096).contains(&pixels) {
        bail!("screen.pixels = {pixels} is not allowed: 2 to 4096");
    }
    if !(width > 0.0 && width.is_finite()) {
        bail!("screen.width = {width} is not allowed: M above 0");
    }
    Ok(match width_of {
        WidthOf::Edges => width / pixels as f64,
        WidthOf::Centers => width / (pixels - 1) as f64,
    })
}

/// Where the model's pixels are on the sky.
pub fn sky(file: &FitFile) -> anyhow::Result<ImageGrid> {
    let n = file.screen.pixels;
    let field_uas = match (file.screen.field_uas, file.hole.mass_msun, file.hole.distance_kpc) {
        (Some(field), ..) => field,
        (None, Some(mass), Some(distance)) => {
            spacing(&file.screen)? * n as f64 * gravitational_angle(mass, distance)
        }
        (None, None, _) => bail!("hole.mass_msun is missing: visibilities need angles; {MASS}"),
        _ => bail!(
            "hole.distance_kpc is missing: visibilities need angles; give `distance_kpc = …` in [hole], e.g. 8.178 for \
             Sgr A*, 16800.0 for M87*, or `field_uas = …`, the width of the field on the sky, in [screen]"
        ),
    };
    Ok(ImageGrid::new(n, n, field_uas * MICROARCSECOND)?)
}

/// What to write where the mass is missing.
const MASS: &str =
    "give `mass_msun = …`, in solar masses, in [hole], e.g. 4.154e6 for Sgr A*, 6.5e9 for M87*";

/// What to write where the axis is missing.
pub const AXIS: &str = "give `axis = [0.0, 0.0, 1.0]`, the direction that matter turns about right-handed (this one: \
     the hole's), in [motion]";

/// What to write where the linear problem is missing.
const LINEAR: &str = "add a table [linear] with `upper = 3.0` (the largest emission that is allowed: a few times what \
     you expect), `rounds = 4` and `iterations = 40`";

/// Hours of one M.
pub fn hours_per_m(file: &FitFile) -> anyhow::Result<f64> {
    let missing =
        || anyhow!("hole.mass_msun is missing: times of an observation are hours; {MASS}");
    let mass = file.hole.mass_msun.ok_or_else(missing)?;
    if !(mass > 0.0 && mass.is_finite()) {
        bail!("hole.mass_msun = {mass} is not allowed: above 0");
    }
    Ok(gravitational_time(mass) / 3600.0)
}

/// The linear problem's settings.
pub fn linear(file: &FitFile) -> anyhow::Result<&config::Linear> {
    let missing = || {
        anyhow!(
            "linear is missing: linear-grid, a linear start and a scan of axes need it; {LINEAR}"
        )
    };
    let linear = file.linear.as_ref().ok_or_else(missing)?;
    if !(linear.upper > 0.0 && linear.upper.is_finite()) {
        bail!("linear.upper = {} is not allowed: above 0", linear.upper);
    }
    Ok(linear)
}

/// Penalties of the linear problem.
pub fn priors(linear: &config::Linear) -> Vec<Prior> {
    let of =
        [(Regulariser::Smoothness, linear.smoothness), (Regulariser::Sparsity, linear.sparsity)];
    let asked = of.into_iter().filter(|(_, weight)| *weight > 0.0);
    asked.map(|(regulariser, weight)| Prior { regulariser, weight }).collect()
}

/// How matter turns, with the times of the frames in M.
pub fn motion(file: &FitFile, times: Vec<f64>) -> anyhow::Result<Motion> {
    let velocity = law(&file.motion.velocity, file.seed).angular().context("motion.velocity")?;
    Ok(Motion {
        velocity,
        reference: file.motion.reference_time,
        injection: file.motion.injection_time.map(|time| Injection { time }),
        times,
    })
}

/// The law of the velocity, as scenes have it; what is drawn is drawn from `seed`.
pub fn law(chosen: &Velocity, seed: u64) -> scene::Velocity {
    match chosen.clone() {
        Velocity::Keplerian { drag } => scene::Velocity::Keplerian { drag },
        Velocity::PowerLaw { radius, rate, exponent } => {
            scene::Velocity::PowerLaw { radius, rate, exponent }
        }
        Velocity::Table { radii, rates } => scene::Velocity::Table { radii, rates },
        Velocity::Perturbed { of, deviation, correlation_length, radii } => {
            let of = Box::new(law(&of, seed));
            let by = scene::Perturbed { of, deviation, correlation_length, radii, seed };
            scene::Velocity::Perturbed(by)
        }
    }
}

/// The true or known axis.
pub fn known_axis(file: &FitFile) -> anyhow::Result<Option<Axis>> {
    file.motion.axis.map(Axis::new).transpose().context("motion")
}

/// Where the axis starts, and its rates if it is learnt.
pub fn axis(file: &FitFile) -> anyhow::Result<(Axis, Option<Polynomial>)> {
    match &file.axis {
        AxisSearch::Known {} => {
            let missing =
                || anyhow!("motion.axis is missing: [axis.known] says that it is known; {AXIS}");
            Ok((known_axis(file)?.ok_or_else(missing)?, None))
        }
        AxisSearch::From { start, rate, last_rate } => {
            let steps = file.training.steps;
            let rate = Polynomial { from: *rate, to: *last_rate, steps, power: 1.0 };
            let rate = rate.checked().context("axis.from")?;
            Ok((Axis::new(*start).context("axis.from.start")?, Some(rate)))
        }
        AxisSearch::Scan(Scan { directions, frames, pixels, refine, rate, last_rate }) => {
            if !(12..=100_000).contains(directions) || *frames < 2 || *pixels < 8 {
                bail!(
                    "axis.scan: directions = {directions}, frames = {frames}, pixels = {pixels} are not allowed: 12 to 100000, 2 or more, 8 or more"
                );
            }
            if refine.is_some_and(|nodes| !(8..=128).contains(&nodes)) {
                bail!("axis.scan.refine = {} is not allowed: 8 to 128", refine.unwrap_or(0));
            }
            linear(file)?;
            let (from, to, steps) = (*rate, *last_rate, file.training.steps);
            let rate = Polynomial { from, to, steps, power: 1.0 };
            let rate = (from != 0.0).then(|| rate.checked()).transpose().context("axis.scan")?;
            // Until the scan has found a better one.
            Ok((Axis::new([0.0, 0.0, 1.0])?, rate))
        }
    }
}

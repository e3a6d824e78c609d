//! `kerrlight trace`: single rays, from a table to a table.

use crate::columns::{self, Column};
use crate::output::{self, Output};
use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use kerrlight_geodesic::{
    AffineTracer, Inclination, Kerr, Observer, OutOfRange, Outcome, Path, PathPoint, Tracer, Want,
    quadrature,
};
use rayon::prelude::*;
use std::path::PathBuf;

/// Arguments of `kerrlight trace`.
#[derive(Debug, Args)]
pub struct Trace {
    /// CSV table of rays with columns spin, inclination_rad or inclination_deg, alpha, beta
    /// in any order; `-` is standard input. Lines that start with # and other columns are
    /// skipped
    #[arg(long, value_name = "FILE.csv")]
    rays: PathBuf,
    /// How rays are traced
    #[arg(long, default_value = "rk45-mino")]
    integrator: Integrator,
    /// Largest local error of a step, in [1e-14, 1e-2]
    #[arg(long, default_value_t = 1e-12)]
    tolerance: f64,
    /// Where the observer is: `infinity`, or a Boyer–Lindquist radius above 2 M
    #[arg(long, default_value = "infinity", value_parser = parse_radius, value_name = "RADIUS")]
    observer: f64,
    /// How many equatorial crossings to write for each ray
    #[arg(long, default_value_t = 3, value_name = "N", value_parser = clap::value_parser!(u16).range(0..=1000))]
    crossings: u16,
    /// How many points equidistant in Mino time to write for each ray, from the observer to
    /// the end (from infinity: without the points at infinity)
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=100_000))]
    samples: u32,
    /// Where to write the table, as .csv or .npz [default: CSV to standard output]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// How rays are traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Integrator {
    /// Adaptive Runge–Kutta 5(4) in Mino time
    Rk45Mino,
    /// Adaptive Runge–Kutta 5(4) in the affine parameter on Kerr–Schild coordinates: an
    /// independent referee, for an observer at a finite radius; azimuths in [−π, π]
    Rk45Affine,
}

fn parse_radius(text: &str) -> Result<f64, String> {
    if text == "infinity" {
        return Ok(f64::INFINITY);
    }
    text.parse().map_err(|_| "give `infinity` or a number".to_owned())
}

/// One line of the input.
struct RayLine {
    line: u64,
    spin: f64,
    inclination: f64,
    alpha: f64,
    beta: f64,
}

/// The input table.
struct Table {
    in_degrees: bool,
    rays: Vec<RayLine>,
}

/// What is written about a ray.
struct Traced {
    outcome: Outcome,
    count: usize,
    mino_total: f64,
    r_min: f64,
    crossings: Vec<PathPoint>,
    samples: Vec<PathPoint>,
}

const NAMES: [&str; 5] = ["spin", RADIANS, DEGREES, "alpha", "beta"];
const RADIANS: &str = "inclination_rad";
const DEGREES: &str = "inclination_deg";

impl Trace {
    /// Traces all rays of the table.
    pub fn run(&self) -> anyhow::Result<()> {
        // Names the argument now, rather than a line of the table later.
        Tracer::new(self.tolerance).context("--tolerance")?;
        if self.integrator == Integrator::Rk45Affine && self.observer.is_infinite() {
            bail!(
                "--integrator rk45-affine needs an observer at a finite radius: --observer RADIUS"
            );
        }
        if self.observer.is_nan() || self.observer <= 2.0 {
            bail!(
                "--observer {} is not allowed: `infinity` or a radius above 2 (M)",
                self.observer
            );
        }
        let npz = self.output.as_deref().and_then(|p| p.extension()).is_some_and(|e| e == "npz");
        let extension = if npz { "npz" } else { "csv" };
        let output = self.output.as_deref().map(|path| Output::new(path, extension)).transpose()?;
        if let Some(output) = &output {
            output.spares(&self.rays)?;
        }
        let name = self.rays.display().to_string();
        let table = Table::parse(&self.read()?).with_context(|| name.clone())?;
        let traced = table
            .rays
            .par_iter()
            .map_init(Path::new, |path, ray| {
                self.trace(&table, ray, path).with_context(|| format!("line {}", ray.line))
            })
            .collect::<anyhow::Result<Vec<_>>>()
            .with_context(|| name.clone())?;
        let groups = self.columns(&table, &traced);
        let bytes = if npz { columns::npz(&groups)? } else { columns::csv(&groups, traced.len())? };
        match output {
            Some(output) => output.write(&bytes),
            None => output::print(core::str::from_utf8(&bytes)?),
        }
    }

    fn read(&self) -> anyhow::Result<Vec<u8>> {
        if self.rays.as_os_str() != "-" {
            return output::read(&self.rays);
        }
        let mut bytes = Vec::new();
        std::io::Read::read_to_end(&mut std::io::stdin(), &mut bytes)?;
        Ok(bytes)
    }

    fn trace(&self, table: &Table, ray: &RayLine, path: &mut Path) -> anyhow::Result<Traced> {
        let hole = Kerr::new(ray.spin)?;
        let inclination = if table.in_degrees {
            Inclination::from_degrees(ray.inclination)?
        } else {
            Inclination::from_radians(ray.inclination)?
        };
        let observer = if self.observer.is_finite() {
            Observer::at_radius(inclination, self.observer)?
        } else {
            Observer::at_infinity(inclination)
        };
        Ok(match self.integrator {
            Integrator::Rk45Mino => self.by_mino_time(&hole, &observer, ray, path)?,
            Integrator::Rk45Affine => self.by_affine_parameter(&hole, &observer, ray)?,
        })
    }

    fn by_mino_time(
        &self,
        hole: &Kerr,
        observer: &Observer,
        line: &RayLine,
        path: &mut Path,
    ) -> Result<Traced, OutOfRange> {
        let ray = observer.ray(hole, line.alpha, line.beta)?;
        Tracer::new(self.tolerance)?.trace(hole, &ray, Want::ALL, path);
        // A finite observer's ray ends where it is back at the observer's radius.
        let total = match path.turning_point() {
            Some((turning, _)) if !observer.is_at_infinity() => 2.0 * turning,
            _ => path.mino_total(),
        };
        let crossings: Vec<f64> = path.equatorial_crossings().filter(|t| *t <= total).collect();
        let r_min = path.turning_point().map_or(f64::NAN, |(_, r)| r);
        Ok(self.collect(path.outcome(), total, r_min, &crossings, |t| path.at(t)))
    }

    fn by_affine_parameter(
        &self,
        hole: &Kerr,
        observer: &Observer,
        line: &RayLine,
    ) -> Result<Traced, OutOfRange> {
        let tracer = AffineTracer::new(self.tolerance)?;
        let path = tracer.trace(hole, observer, line.alpha, line.beta)?;
        let crossings = path.equatorial_crossings();
        let total = path.mino_total();
        let r_min = path.closest_approach().unwrap_or(f64::NAN);
        Ok(self.collect(path.outcome(), total, r_min, &crossings, |t| path.at(t)))
    }

    /// What is written about a ray whose position at any Mino time is `at`.
    fn collect(
        &self,
        outcome: Outcome,
        total: f64,
        r_min: f64,
        crossings: &[f64],
        at: impl Fn(f64) -> PathPoint,
    ) -> Traced {
        let wanted = crossings.iter().take(usize::from(self.crossings));
        Traced {
            outcome,
            count: crossings.len(),
            mino_total: if is_resolved(outcome) { total } else { f64::NAN },
            r_min,
            crossings: wanted.map(|t| at(*t)).collect(),
            samples: self.times(total, outcome).map(at).collect(),
        }
    }

    /// Mino times of the samples.
    fn times(&self, total: f64, outcome: Outcome) -> impl Iterator<Item = f64> {
        let n = if is_resolved(outcome) { self.samples as usize } else { 0 };
        let at_infinity = self.observer.is_infinite();
        let step = total / (n.max(1) + 1) as f64;
        let to = match outcome {
            Outcome::Captured => total,
            _ if at_infinity => total - step,
            _ => total,
        };
        quadrature::equidistant(if at_infinity { step } else { 0.0 }, to, n)
    }

    fn columns(&self, table: &Table, traced: &[Traced]) -> Vec<Vec<Column>> {
        let number = |name: &str, value: &dyn Fn(usize) -> f64| {
            Column::Numbers(name.to_owned(), (0..traced.len()).map(value).collect())
        };
        let rays = &table.rays;
        let inclination_name = if table.in_degrees { DEGREES } else { RADIANS };
        let outcomes = traced.iter().map(|t| t.outcome.name().to_owned()).collect();
        let mut groups: Vec<Vec<Column>> = vec![
            vec![number("spin", &|k| rays[k].spin)],
            vec![number(inclination_name, &|k| rays[k].inclination)],
            vec![number("alpha", &|k| rays[k].alpha)],
            vec![number("beta", &|k| rays[k].beta)],
            vec![Column::Words("outcome".to_owned(), outcomes)],
            vec![Column::Counts(
                "crossings".to_owned(),
                traced.iter().map(|t| t.count as u64).collect(),
            )],
            vec![number("mino_total", &|k| traced[k].mino_total)],
            vec![number("r_min", &|k| traced[k].r_min)],
        ];
        let block = |name: &str,
                     points: &dyn Fn(&Traced) -> &[PathPoint],
                     width: usize,
                     value: &dyn Fn(&PathPoint) -> f64| {
            let row = |t: &Traced| {
                let mut row: Vec<f64> = points(t).iter().map(value).collect();
                row.resize(width, f64::NAN);
                row
            };
            Column::Blocks(name.to_owned(), traced.iter().map(row).collect())
        };
        let crossing = |name: &str, value: &dyn Fn(&PathPoint) -> f64| {
            block(name, &|t| &t.crossings, usize::from(self.crossings), value)
        };
        groups.push(vec![
            crossing("mino", &|p| p.mino_time),
            crossing("r", &PathPoint::radius),
            crossing("phi", &|p| p.azimuth),
            crossing("delay", &|p| p.delay),
        ]);
        if self.samples > 0 {
            let sample = |name: &str, value: &dyn Fn(&PathPoint) -> f64| {
                block(name, &|t| &t.samples, self.samples as usize, value)
            };
            groups.push(vec![
                sample("sample_mino", &|p| p.mino_time),
                sample("sample_r", &PathPoint::radius),
                sample("sample_theta", &PathPoint::theta),
                sample("sample_phi", &|p| p.azimuth),
                sample("sample_delay", &|p| p.delay),
            ]);
        }
        let integrator = self.integrator.to_possible_value();
        let integrator = integrator.map_or(String::new(), |v| v.get_name().to_owned());
        groups.push(vec![Column::Words("integrator".to_owned(), vec![integrator; traced.len()])]);
        groups.push(vec![number("tolerance", &|_| self.tolerance)]);
        groups
    }
}

fn is_resolved(outcome: Outcome) -> bool {
    !matches!(outcome, Outcome::Unresolved(_))
}

/// Counts the lines up to each record, skipped ones included, which the reader's own count
/// leaves out.
struct LineCounter<'a> {
    bytes: &'a [u8],
    at: usize,
    line: u64,
}

impl LineCounter<'_> {
    /// The line of a record, counted from 1; records must come in order.
    fn line_of(&mut self, record: &csv::StringRecord) -> u64 {
        let start = record.position().map_or(0, |p| p.byte() as usize).min(self.bytes.len());
        let lines = |bytes: &[u8]| bytes.iter().filter(|b| **b == b'\n').count() as u64;
        self.line += lines(&self.bytes[self.at.min(start)..start]);
        self.at = start;
        let skipped = self.bytes[start..]
            .split(|b| *b == b'\n')
            .take_while(|text| text.starts_with(b"#") || text.trim_ascii().is_empty())
            .count();
        self.line + skipped as u64
    }
}

impl Table {
    fn parse(bytes: &[u8]) -> anyhow::Result<Self> {
        let mut reader = csv::ReaderBuilder::new()
            .flexible(true)
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_reader(bytes);
        let header = reader.headers().context("the header line cannot be read")?.clone();
        for (k, name) in header.iter().enumerate() {
            if NAMES.contains(&name) && header.iter().skip(k + 1).any(|other| other == name) {
                bail!("there are two columns `{name}`");
            }
        }
        let find = |name: &str| header.iter().position(|column| column == name);
        let need = |name: &str| find(name).with_context(|| format!("there is no column `{name}`"));
        let (in_degrees, inclination) = match (find(RADIANS), find(DEGREES)) {
            (Some(column), None) => (false, column),
            (None, Some(column)) => (true, column),
            (None, None) => bail!("there is no column `{RADIANS}` or `{DEGREES}`"),
            (Some(_), Some(_)) => bail!("there are both `{RADIANS}` and `{DEGREES}`: give one"),
        };
        let columns = [need("spin")?, inclination, need("alpha")?, need("beta")?];
        let mut rays = Vec::new();
        let mut counter = LineCounter { bytes, at: 0, line: 1 };
        for record in reader.records() {
            let record = record?;
            let line = counter.line_of(&record);
            if record.len() != header.len() {
                bail!("line {line}: {} fields, but {} in the header", record.len(), header.len());
            }
            let value = |column: usize| {
                let text = record.get(column).unwrap_or_default();
                text.parse::<f64>().with_context(|| {
                    format!("line {line}: `{}` = \"{text}\" is not a number", &header[column])
                })
            };
            let [spin, inclination, alpha, beta] = columns;
            rays.push(RayLine {
                line,
                spin: value(spin)?,
                inclination: value(inclination)?,
                alpha: value(alpha)?,
                beta: value(beta)?,
            });
        }
        Ok(Table { in_degrees, rays })
    }
}

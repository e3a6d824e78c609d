//! `kerrlight trace`: single rays, from a table to a table.

use crate::answer::Answer;
use crate::columns::{self, Column};
use crate::output::{self, Output};
use anyhow::{Context, bail};
use clap::Args;
use clap::builder::PossibleValuesParser;
use clap::builder::TypedValueParser;
use kerrlight_common::memory;
use kerrlight_geodesic::{
    Inclination, Integrator, Kerr, Observer, Placement, Points, RayTable, Request, Tracer,
    Uncertainty,
};
use rayon::prelude::*;
use std::ops::Range;
use std::path::PathBuf;

/// Arguments of `kerrlight trace`.
#[derive(Debug, Args)]
pub struct Trace {
    /// CSV table of rays with columns spin, inclination_rad or inclination_deg, alpha, beta
    /// in any order; `-` is standard input. Lines that start with # and other columns are
    /// skipped
    #[arg(long, value_name = "FILE.csv")]
    rays: PathBuf,
    /// Integrator of the rays
    #[arg(long, default_value = "taylor-mino", value_parser = integrators())]
    integrator: Integrator,
    /// Largest local error of a step, in [1e-14, 1e-2]
    #[arg(long, default_value_t = 1e-12)]
    tolerance: f64,
    /// Radius of the observer: `infinity`, or a Boyer–Lindquist radius above 2 M
    #[arg(long, default_value = "infinity", value_parser = parse_radius, value_name = "RADIUS")]
    observer: f64,
    /// Number of equatorial crossings to write for each ray
    #[arg(long, default_value_t = 3, value_name = "N", value_parser = clap::value_parser!(u16).range(0..=1000))]
    crossings: u16,
    /// Number of points equidistant in Mino time to write for each ray, from the observer to the end (from
    /// infinity: without the points at infinity)
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=100_000))]
    samples: u32,
    /// Place the samples at equal path lengths inside a sphere of this radius instead
    #[arg(long, value_name = "RADIUS", requires = "samples", conflicts_with = "between")]
    within: Option<f64>,
    /// Place the samples at Gauss-Legendre nodes in Mino time on each piece of the ray
    /// between two radii instead
    #[arg(long, num_args = 2, value_names = ["FROM", "TO"], requires = "samples")]
    between: Option<Vec<f64>>,
    /// Also write covariant momenta (p_r, p_theta; p_t = -1 and p_phi = lambda never change)
    #[arg(long)]
    momentum: bool,
    /// Also write each sample's weight in an integral over the affine parameter
    #[arg(long)]
    weights: bool,
    /// Also write each ray's largest estimated errors: of r (relative), theta, phi and delay
    #[arg(long)]
    errors: bool,
    /// Output table, as .csv or .npz; `-` is CSV on standard output [default: -]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
}

/// The names of all integrators, as an argument.
pub fn integrators() -> impl TypedValueParser<Value = Integrator> {
    PossibleValuesParser::new(Integrator::ALL.iter().map(|integrator| integrator.name()))
        .map(|name| Integrator::named(&name).expect("one of the names above"))
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

const NAMES: [&str; 5] = ["spin", RADIANS, DEGREES, "alpha", "beta"];
const RADIANS: &str = "inclination_rad";
const DEGREES: &str = "inclination_deg";

/// Spheres beyond have path lengths in which steps near the hole are lost, M.
const FARTHEST: f64 = 1e9;

impl Trace {
    /// Traces all rays of the table.
    pub fn run(&self) -> anyhow::Result<Answer> {
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
        if let Some(radius) = self.within.filter(|radius| !(1.0..=FARTHEST).contains(radius)) {
            bail!("--within {radius} is not allowed: 1 to {FARTHEST:e} (M)");
        }
        let ending = self.output.as_deref().and_then(|path| path.extension());
        let npz = ending.is_some_and(|ending| ending.eq_ignore_ascii_case("npz"));
        let place = |path| Output::or_pipe(path, &["csv", "npz"]);
        let output = self.output.as_deref().map(place).transpose()?;
        if let Some(output) = &output {
            output.must_differ_from(&self.rays)?;
        }
        let name = self.rays.display().to_string();
        let table = Table::parse(&self.read()?).with_context(|| name.clone())?;
        let request = self.request();
        let momentum = 2 * u32::from(self.momentum);
        let numbers = 5 + momentum + u32::from(self.weights);
        let samples = numbers.saturating_mul(self.samples).saturating_mul(self.pieces());
        let each = samples.saturating_add((4 + momentum) * u32::from(self.crossings));
        let what = || format!("{} rays with {each} numbers each", table.rays.len());
        memory::afford(what, memory::table(table.rays.len() as f64, f64::from(each)))?;
        let blocks = table.blocks();
        let traced = blocks.par_iter().map(|rays| self.trace(table.in_degrees, rays, &request));
        let traced: anyhow::Result<Vec<RayTable>> = traced.collect();
        let traced = traced.with_context(|| name.clone())?;
        let groups = self.columns(&table, &traced);
        let rows = table.rays.len();
        let Some(output) = output else { return Ok(Answer::table("rays", groups, rows)) };
        let bytes = if npz { columns::npz(&groups)? } else { columns::csv(&groups, rows)? };
        output.write(&bytes)?;
        let answer = Answer::default().with("count", rows).outputs([&output]);
        Ok(answer.with("integrator", self.integrator.name()).with("tolerance", self.tolerance))
    }

    /// Pieces of a ray on which its samples lie: one that turns round passes between two radii twice.
    fn pieces(&self) -> u32 {
        if self.between.is_some() { 2 } else { 1 }
    }

    fn request(&self) -> Request {
        let points = self.samples as usize;
        let samples = match (&self.between, self.within) {
            _ if points == 0 => Placement::None,
            (Some(radii), _) => Placement::GaussLegendre { points, from: radii[0], to: radii[1] },
            (None, Some(radius)) => Placement::PathLength { points, radius },
            (None, None) => Placement::MinoTime(points),
        };
        Request {
            crossings: usize::from(self.crossings),
            samples,
            azimuth: true,
            time: true,
            momentum: self.momentum,
            weight: self.weights,
            uncertainty: self.errors,
        }
    }

    fn read(&self) -> anyhow::Result<Vec<u8>> {
        if !output::is_pipe(&self.rays) {
            return output::read(&self.rays);
        }
        let mut bytes = Vec::new();
        std::io::Read::read_to_end(&mut std::io::stdin(), &mut bytes)?;
        if bytes.is_empty() {
            bail!("standard input is empty (0 bytes): a table of rays is expected");
        }
        Ok(bytes)
    }

    /// Traces rays of one hole and one observer; an error names the line of the first ray that cannot be traced.
    fn trace(
        &self,
        in_degrees: bool,
        rays: &[RayLine],
        request: &Request,
    ) -> anyhow::Result<RayTable> {
        self.trace_block(in_degrees, rays, request).or_else(|error| {
            for ray in rays {
                let alone = self.trace_block(in_degrees, std::slice::from_ref(ray), request);
                alone.with_context(|| format!("line {}", ray.line))?;
            }
            Err(error)
        })
    }

    fn trace_block(
        &self,
        in_degrees: bool,
        rays: &[RayLine],
        request: &Request,
    ) -> anyhow::Result<RayTable> {
        let Some(first) = rays.first() else { return Ok(RayTable::default()) };
        let hole = Kerr::new(first.spin)?;
        let inclination = if in_degrees {
            Inclination::from_degrees(first.inclination)?
        } else {
            Inclination::from_radians(first.inclination)?
        };
        let observer = if self.observer.is_finite() {
            Observer::at_radius(inclination, self.observer)?
        } else {
            Observer::at_infinity(inclination)
        };
        let alpha: Vec<f64> = rays.iter().map(|ray| ray.alpha).collect();
        let beta: Vec<f64> = rays.iter().map(|ray| ray.beta).collect();
        Ok(self.integrator.trace(&hole, &observer, &alpha, &beta, self.tolerance, request)?)
    }

    fn columns(&self, table: &Table, traced: &[RayTable]) -> Vec<Vec<Column>> {
        let rays = &table.rays;
        let number = |name: &str, value: &dyn Fn(usize) -> f64| {
            Column::Numbers(name.to_owned(), (0..rays.len()).map(value).collect())
        };
        let result = |name: &str, value: &dyn Fn(&RayTable, usize) -> f64| {
            Column::Numbers(name.to_owned(), each(traced).map(|(t, k)| value(t, k)).collect())
        };
        let inclination_name = if table.in_degrees { DEGREES } else { RADIANS };
        let outcomes = each(traced).map(|(t, k)| t.outcome[k].name().to_owned()).collect();
        let counts = each(traced).map(|(t, k)| u64::from(t.crossing_count[k])).collect();
        let mut groups: Vec<Vec<Column>> = vec![
            vec![number("spin", &|k| rays[k].spin)],
            vec![number(inclination_name, &|k| rays[k].inclination)],
            vec![number("alpha", &|k| rays[k].alpha)],
            vec![number("beta", &|k| rays[k].beta)],
            vec![Column::Words("outcome".to_owned(), outcomes)],
            vec![Column::Counts("crossings".to_owned(), counts)],
            vec![result("mino_total", &|t, k| t.mino_total[k])],
            vec![result("r_min", &|t, k| t.turning_radius[k])],
        ];
        let crossings = points(traced, usize::from(self.crossings), "", |b| &b.crossings);
        // θ is π/2 at every crossing.
        groups.push(crossings.into_iter().filter(|column| column.name() != "theta").collect());
        if self.samples > 0 {
            let width = self.samples as usize * self.pieces() as usize;
            groups.push(points(traced, width, "sample_", |b| &b.samples));
        }
        if self.errors {
            let error = |name: &str, value: &dyn Fn(&Uncertainty) -> f64| {
                vec![result(name, &|t, k| value(&t.uncertainty[k]))]
            };
            groups.push(error("error_r", &|u| u.radius));
            groups.push(error("error_theta", &|u| u.theta));
            groups.push(error("error_phi", &|u| u.azimuth));
            groups.push(error("error_delay", &|u| u.delay));
        }
        let integrator = self.integrator.name().to_owned();
        groups.push(vec![Column::Words("integrator".to_owned(), vec![integrator; rays.len()])]);
        groups.push(vec![number("tolerance", &|_| self.tolerance)]);
        groups
    }
}

/// Each ray of tables of blocks: the table that it is in, and its number there.
fn each(traced: &[RayTable]) -> impl Iterator<Item = (&RayTable, usize)> {
    traced.iter().flat_map(|table| (0..table.len()).map(move |k| (table, k)))
}

/// The columns of each ray's first `width` points, filled up with NaN; those that were not
/// requested are left out.
fn points(
    traced: &[RayTable],
    width: usize,
    prefix: &str,
    of: impl Fn(&RayTable) -> &Points,
) -> Vec<Column> {
    let block = |name: &str, row: &dyn Fn(&Points, Range<usize>) -> Vec<f64>| {
        let rows = each(traced).map(|(table, k)| {
            let points = of(table);
            let mut row = row(points, points.of(k));
            row.resize(width, f64::NAN);
            row
        });
        Column::Blocks(format!("{prefix}{name}"), rows.collect())
    };
    let mut columns = vec![
        block("mino", &|p, at| p.mino_time[at].to_vec()),
        block("r", &|p, at| p.radius[at].to_vec()),
        block("theta", &|p, at| p.theta[at].to_vec()),
        block("phi", &|p, at| p.azimuth[at].to_vec()),
        block("delay", &|p, at| p.delay[at].to_vec()),
    ];
    let has = |wanted: &dyn Fn(&Points) -> bool| traced.iter().any(|t| wanted(of(t)));
    if has(&|p| !p.momentum.is_empty()) {
        columns.push(block("p_r", &|p, at| p.momentum[at].iter().map(|m| m[1]).collect()));
        columns.push(block("p_theta", &|p, at| p.momentum[at].iter().map(|m| m[2]).collect()));
    }
    if has(&|p| !p.weight.is_empty()) {
        columns.push(block("weight", &|p, at| p.weight[at].to_vec()));
    }
    columns
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
        // A record begins where the one before ended: skipped lines lie between.
        let skipped = self.bytes[start..]
            .split(|b| *b == b'\n')
            .take_while(|text| text.starts_with(b"#") || text.trim_ascii().is_empty())
            .count();
        self.line + skipped as u64
    }
}

/// Rays that a task traces at most.
const TOGETHER: usize = 1024;

impl Table {
    /// Rays of the same hole and observer that follow each other.
    fn blocks(&self) -> Vec<&[RayLine]> {
        let place = |ray: &RayLine| [ray.spin, ray.inclination].map(f64::to_bits);
        let same = self.rays.chunk_by(|one, other| place(one) == place(other));
        same.flat_map(|rays| rays.chunks(TOGETHER)).collect()
    }

    fn parse(bytes: &[u8]) -> anyhow::Result<Self> {
        let mut reader = csv::ReaderBuilder::new()
            .flexible(true)
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_reader(bytes);
        let header = reader.headers().context("the header line cannot be read")?.clone();
        for (k, name) in header.iter().enumerate() {
            if NAMES.contains(&name) && header.iter().skip(k + 1).any(|other| other == name) {
                bail!("column `{name}` appears twice");
            }
        }
        let find = |name: &str| header.iter().position(|column| column == name);
        let need = |name: &str| find(name).with_context(|| format!("column `{name}` is missing"));
        let (in_degrees, inclination) = match (find(RADIANS), find(DEGREES)) {
            (Some(column), None) => (false, column),
            (None, Some(column)) => (true, column),
            (None, None) => bail!("column `{RADIANS}` or `{DEGREES}` is missing"),
            (Some(_), Some(_)) => bail!("there are both `{RADIANS}` and `{DEGREES}`: give one"),
        };
        let columns = [need("spin")?, inclination, need("alpha")?, need("beta")?];
        let mut rays = Vec::new();
        let mut counter = LineCounter { bytes, at: 0, line: 1 };
        let mut record = csv::StringRecord::new();
        while reader.read_record(&mut record)? {
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

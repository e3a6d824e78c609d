//! `kerrlight trace`: single rays, from a table to a table.

use crate::output::{self, Output};
use anyhow::{Context, bail};
use clap::Args;
use kerrlight_geodesic::{Inclination, Kerr, Observer, Outcome, Path, Tracer, Want};
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
    /// How many equatorial crossings to write for each ray
    #[arg(long, default_value_t = 3, value_name = "N", value_parser = clap::value_parser!(u16).range(0..=1000))]
    crossings: u16,
    /// Largest local error of a step, in [1e-14, 1e-2]
    #[arg(long, default_value_t = 1e-12)]
    tolerance: f64,
    /// Where to write the table [default: standard output]
    #[arg(short, long, value_name = "FILE.csv")]
    output: Option<PathBuf>,
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
    inclination_name: &'static str,
    rays: Vec<RayLine>,
}

const RADIANS: &str = "inclination_rad";
const DEGREES: &str = "inclination_deg";

impl Trace {
    /// Traces all rays of the table.
    pub fn run(&self) -> anyhow::Result<()> {
        let tracer = Tracer::new(self.tolerance).context("--tolerance")?;
        let output = self.output.as_deref().map(|path| Output::new(path, "csv")).transpose()?;
        let name = self.rays.display().to_string();
        let bytes = if self.rays.as_os_str() == "-" {
            let mut bytes = Vec::new();
            std::io::Read::read_to_end(&mut std::io::stdin(), &mut bytes)?;
            bytes
        } else {
            output::read(&self.rays)?
        };
        let table = Table::parse(&bytes).with_context(|| name.clone())?;
        let rows = table
            .rays
            .par_iter()
            .map_init(Path::new, |path, ray| {
                self.row(&tracer, &table, ray, path).with_context(|| format!("line {}", ray.line))
            })
            .collect::<anyhow::Result<Vec<_>>>()
            .with_context(|| name.clone())?;
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(self.header(&table))?;
        for row in rows {
            writer.write_record(row)?;
        }
        let bytes = writer.into_inner().map_err(|e| e.into_error())?;
        match output {
            Some(output) => output.write(&bytes),
            None => output::print(core::str::from_utf8(&bytes)?),
        }
    }

    fn header(&self, table: &Table) -> Vec<String> {
        let fixed = [
            "spin",
            table.inclination_name,
            "alpha",
            "beta",
            "outcome",
            "crossings",
            "mino_total",
            "r_min",
        ];
        let mut header: Vec<String> = fixed.map(str::to_owned).into();
        for k in 1..=self.crossings {
            header.extend(["mino", "r", "phi", "delay"].map(|name| format!("{name}_{k}")));
        }
        header.push("tolerance".to_owned());
        header
    }

    fn row(
        &self,
        tracer: &Tracer,
        table: &Table,
        ray: &RayLine,
        path: &mut Path,
    ) -> anyhow::Result<Vec<String>> {
        let hole = Kerr::new(ray.spin)?;
        let inclination = if table.inclination_name == DEGREES {
            Inclination::from_degrees(ray.inclination)?
        } else {
            Inclination::from_radians(ray.inclination)?
        };
        let observer = Observer::at_infinity(inclination);
        tracer.trace(&hole, &observer.ray(&hole, ray.alpha, ray.beta)?, Want::ALL, path);
        let mut row: Vec<String> =
            [ray.spin, ray.inclination, ray.alpha, ray.beta].map(digits).into();
        row.push(path.outcome().name().to_owned());
        row.push(path.equatorial_crossings().len().to_string());
        let resolved = !matches!(path.outcome(), Outcome::Unresolved(_));
        row.push(if resolved { digits(path.mino_total()) } else { String::new() });
        row.push(path.turning_point().map_or_else(String::new, |(_, r)| digits(r)));
        let mut crossings = path.equatorial_crossings();
        for _ in 0..self.crossings {
            match crossings.next() {
                Some(mino_time) => {
                    let point = path.at(mino_time);
                    row.extend([mino_time, point.radius(), point.azimuth, point.delay].map(digits));
                }
                None => row.extend([const { String::new() }; 4]),
            }
        }
        row.push(format!("{:e}", self.tolerance));
        Ok(row)
    }
}

/// 17 significant digits: every double has its own.
fn digits(x: f64) -> String {
    format!("{x:.16e}")
}

/// The line of a record, counted from 1; the reader's own count leaves out skipped lines.
fn line_of(bytes: &[u8], record: &csv::StringRecord) -> u64 {
    let start = record.position().map_or(0, |p| p.byte() as usize).min(bytes.len());
    let mut line = bytes[..start].iter().filter(|b| **b == b'\n').count();
    for text in bytes[start..].split(|b| *b == b'\n') {
        if !(text.starts_with(b"#") || text.trim_ascii().is_empty()) {
            break;
        }
        line += 1;
    }
    line as u64 + 1
}

impl Table {
    fn parse(bytes: &[u8]) -> anyhow::Result<Self> {
        let mut reader = csv::ReaderBuilder::new()
            .flexible(true)
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_reader(bytes);
        let header = reader.headers().context("no header line")?.clone();
        let find = |name: &str| header.iter().position(|column| column == name);
        let need = |name: &str| find(name).with_context(|| format!("there is no column `{name}`"));
        let (inclination_name, inclination) = match (find(RADIANS), find(DEGREES)) {
            (Some(column), None) => (RADIANS, column),
            (None, Some(column)) => (DEGREES, column),
            (None, None) => bail!("there is no column `{RADIANS}` or `{DEGREES}`"),
            (Some(_), Some(_)) => bail!("there are both `{RADIANS}` and `{DEGREES}`: give one"),
        };
        let columns = [need("spin")?, inclination, need("alpha")?, need("beta")?];
        let mut rays = Vec::new();
        for record in reader.records() {
            let record = record?;
            let line = line_of(bytes, &record);
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
        Ok(Table { inclination_name, rays })
    }
}

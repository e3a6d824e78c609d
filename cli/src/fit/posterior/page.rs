//! The page of a posterior, its volumes and tables.

use super::PAGE;
use super::predictive;
use super::summary::{Interval, Summary};
use crate::output::Output;
use crate::report::{self, Drawing, Report, Variable};
use kerrlight_render::volume::ranks::Ranks;
use kerrlight_render::volume::slices::{Outlines, Through};
use kerrlight_render::volume::{Shown, Volume, VolumeFile, vti};
use kerrlight_tomo::recovery::Problem;
use std::path::Path;

/// Writes mean.npz, deviation.npz, posterior.vti, geometries.csv, triangle.svg and the page of draws.
pub fn write(found: &Summary, prepared: &Problem, folder: &Path) -> anyhow::Result<()> {
    let file = |name: &str| Output::new(&folder.join(name), "");
    let noise = found.ensemble.signal_to_noise()?;
    let mut volumes = vec![
        ("mean", &found.ensemble.mean),
        ("deviation", &found.ensemble.deviation),
        ("signal_to_noise", &noise),
    ];
    volumes.extend(found.open.as_ref().map(|open| ("deviation_over_prior", open)));
    for (name, volume) in &volumes[..2] {
        let bytes = VolumeFile { volume: (*volume).clone(), axis: None }.to_npz();
        file(&format!("{name}.npz"))?.write(&bytes)?;
    }
    let fields: Vec<Shown<'_>> =
        volumes.into_iter().map(|(name, volume)| Shown { name, volume }).collect();
    let write = |out: &mut std::io::BufWriter<&std::fs::File>| Ok(vti::write(out, &fields)?);
    file("posterior.vti")?.write_with(write)?;
    let triangle = triangle(found);
    if let Some(triangle) = &triangle {
        file("geometries.csv")?.write(table(&found.geometry).as_bytes())?;
        file("triangle.svg")?.write(triangle.svg.as_bytes())?;
    }
    let hole_radius = prepared.instrument.hole.horizon();
    let report = Report {
        title: format!("{}: how sure", prepared.settings.title),
        summary: found.sentences(),
        details: details(found),
        figures: figures(found, &noise, hole_radius)?,
        drawings: triangle.into_iter().collect(),
        ..Report::default()
    };
    report.write(&file(PAGE)?)
}

/// Standard deviations that the outlines of slices show.
const SIGMAS: [f32; 2] = [3.0, 10.0];

fn figures(
    found: &Summary,
    noise: &Volume,
    hole_radius: f64,
) -> anyhow::Result<Vec<report::Figure>> {
    let shown = [
        Shown { name: "standard deviation", volume: &found.ensemble.deviation },
        Shown { name: "mean", volume: &found.ensemble.mean },
    ];
    // Where the mean is bright, not where a single dark node is sure to be dark.
    let at = Through::Point(Through::Maximum.point(&found.ensemble.mean));
    let outlines = Some(Outlines { volume: noise, levels: SIGMAS });
    let mut first = report::slices(&shown, Through::Maximum, hole_radius, outlines, "model units")?;
    let [white, blue] = SIGMAS;
    first.caption = format!(
        "{} The mean is above {white} standard deviations inside the white line, above {blue} inside the blue one.",
        first.caption
    );
    let mut all = vec![first];
    let mut more = |name, volume, unit, what| -> anyhow::Result<()> {
        let mut next = report::slices(&[Shown { name, volume }], at, hole_radius, None, unit)?;
        next.caption = format!("{what} {}", next.caption);
        all.push(next);
        Ok(())
    };
    more("mean over standard deviation", noise, "standard deviations", "Signal over noise.")?;
    if let Some(open) = &found.open {
        let what = "What the data leave open: near 1 the draws are as far apart as the prior's, and the data say nothing \
                    about that place; near 0 they decide.";
        more("standard deviation over that of the prior", open, "ratio", what)?;
    }
    Ok(all)
}

fn triangle(found: &Summary) -> Option<Drawing> {
    let one = |interval: &Interval| Variable {
        name: interval.parameter.name().replace("_deg", " (°)").replace('_', " "),
        values: interval.values.clone(),
        truth: interval.truth,
    };
    let variables: Vec<Variable> = found.geometry.iter().map(one).collect();
    (!variables.is_empty()).then(|| Drawing {
        svg: report::triangle(&variables),
        caption: "Draws of the geometry: each parameter's distribution on the diagonal, each pair's below it. Orange: what was \
                  simulated, where the data are a simulation."
            .to_owned(),
        alt: "Triangle of the marginal distributions of all unknown parameters.".to_owned(),
    })
}

fn table(geometry: &[Interval]) -> String {
    let names: Vec<&str> = geometry.iter().map(|interval| interval.parameter.name()).collect();
    let count = geometry.first().map_or(0, |interval| interval.values.len());
    let row = |k: usize| {
        let values: Vec<String> =
            geometry.iter().map(|interval| format!("{:?}", interval.values[k])).collect();
        format!("{}\n", values.join(","))
    };
    format!("{}\n{}", names.join(","), (0..count).map(row).collect::<String>())
}

/// Returns the tables: whether the draws predict the data, and how often the truth lies inside, where
/// it is known.
fn details(found: &Summary) -> Vec<report::Table> {
    let mut all: Vec<report::Table> = predictive::table(&found.predicted).into_iter().collect();
    all.extend(of_nodes(found));
    all.extend(found.ranks.as_ref().map(ranks));
    all
}

/// Ranks of the truth among the draws.
fn ranks(found: &[Ranks; 3]) -> report::Table {
    let row = |(name, ranks): (&str, &Ranks)| {
        let percent = |part: f64| format!("{:.0} %", 100.0 * part);
        let tenths: Vec<String> = ranks.histogram.iter().map(usize::to_string).collect();
        let [one, two] = [ranks.within_68, ranks.within_95].map(percent);
        vec![name.to_owned(), ranks.count.to_string(), one, two, tenths.join(" ")]
    };
    let names =
        ["random nodes of the region", "nodes where the mean is bright", "radius of feature 1"];
    report::Table::new(
        "Where the truth lies among the draws",
        "Part of the nodes at which the simulated emission lies within the middle 68 % and 95 % of the draws, \
         and how many have their rank in each tenth, the lowest first: equally many, over many simulations, if the \
         draws are those of the posterior. Equal numbers, as dark nodes have, are in random order.",
        ["", "number", "middle 68 %", "middle 95 %", "ranks by tenths"],
        names.into_iter().zip(found).map(row).collect(),
    )
}

fn of_nodes(found: &Summary) -> Vec<report::Table> {
    let Some(coverage) = &found.coverage else { return Vec::new() };
    let row = |(name, c): (&str, &kerrlight_render::volume::Coverage)| {
        let percent = |part: f64| format!("{:.0} %", 100.0 * part);
        vec![name.to_owned(), c.nodes.to_string(), percent(c.one), percent(c.two)]
    };
    let names = ["random nodes of the region", "nodes that shine"];
    vec![report::Table::new(
        "How often the truth lies inside",
        "Part of the nodes at which the simulated emission lies within 1 and 1.96 standard deviations of the \
         mean: 68 % and 95 % for independent normal errors. Nodes in the dark are inside more often: emission \
         is not negative.",
        ["nodes", "number", "within 1 σ", "within 1.96 σ"],
        names.into_iter().zip(coverage).map(row).collect(),
    )]
}

//! Finds the axis that hot spots turn about, from the whole sphere: scenes "1", "4" and "8" of BH-NeRF
//! (Levis et al. 2022), from images or from visibilities with thermal noise.
//!
//! `cargo run --release -p kerrlight-tomo --example axis_scan -- 1 ngEHT map.png`
//!
//! Arguments, all optional: scene (1, 4 or 8); `images`, `ngEHT` or `EHT2017`; where to write a picture of
//! the losses; directions; every how many-eth frame counts.

mod paper;

use kerrlight_render::dynamics::Axis;
use kerrlight_render::image::colormap::Colormap;
use kerrlight_tomo::fit::linear::Weighted;
use kerrlight_tomo::fit::scan::{AxisLoss, AxisProblem, AxisSettings, scan_axis};
use kerrlight_tomo::fit::{ForwardModel, FrameTerm, ImageTerm, Scan, ScanTerm};
use kerrlight_vlbi::array::built_in;
use kerrlight_vlbi::data_terms::VisibilityTerm;
use kerrlight_vlbi::earth::{Frame, SourcePosition, Ut1};
use kerrlight_vlbi::noise::add_thermal_noise;
use kerrlight_vlbi::observation::Observation;
use kerrlight_vlbi::operator::{ImageGrid, Method, Pulse, Transform};
use kerrlight_vlbi::schedule::{Clock, Schedule, Setup, observe};
use kerrlight_vlbi::simulate::{Movie, fill};
use paper::{FRAMES, Truth, forward_model, lines, processor_time, screen};
use std::error::Error;
use std::time::Instant;

const SCHEDULE: Schedule =
    Schedule { mjd: 57850, clock: Clock::Utc, start_h: 4.0, stop_h: 15.5, scans: FRAMES as u32 };
const SETUP: Setup = Setup {
    frequency_hz: 226_191_789_062.5,
    bandwidth_hz: 1.856e9,
    integration_s: 60.0,
    elevation_deg: [10.0, 85.0],
    ut1: Ut1::Table,
    frame: Frame::Catalogue,
};
/// Side of the picture of 64 pixels, rad: 85 µas.
const FIELD: f64 = 85.0e-6 / 3600.0 * std::f64::consts::PI / 180.0;
/// Peak of the truth, Jy a pixel and M.
const PEAK: f64 = 0.03;

/// What the scan sees: rays and data.
type Seen = (ForwardModel<f32>, Box<dyn FrameTerm<f32>>);

/// Pixels of the scan's images along each axis.
const SIDE: usize = 22;
/// Nodes of a ray.
const PER_RAY: usize = 32;

/// Every third pixel of the movie's rows and columns.
fn images(movie: &[f32]) -> Result<Seen, Box<dyn Error>> {
    let places: Vec<f64> = screen(64).into_iter().step_by(3).collect();
    let model = forward_model(&lines(&places, PER_RAY)?, FRAMES)?;
    let count = SIDE * SIDE;
    let kept = |k: usize| {
        let (frame, pixel) = (k / count, k % count);
        movie[frame * 4096 + pixel / SIDE * 3 * 64 + pixel % SIDE * 3]
    };
    let pixels = (0..FRAMES * count).map(kept).collect();
    Ok((model, Box::new(ImageTerm::new(pixels, count, 1.0)?)))
}

/// Visibilities of the movie with thermal noise, and rays of few pixels that are to explain them.
fn visibilities(movie: &[f32], array: &str) -> Result<Seen, Box<dyn Error>> {
    let array = built_in(array).ok_or_else(|| format!("{array}: images, ngEHT or EHT2017"))?;
    let mut observed = observe(&array, SourcePosition::SGR_A, &SCHEDULE, &SETUP)?;
    let times = SCHEDULE.hours_utc(SETUP.ut1)?;
    let grid = ImageGrid::new(64, 64, FIELD)?;
    let pixels = movie.iter().map(|x| f64::from(*x)).collect();
    fill(&mut observed, &Movie { grid, pixels }, Pulse::Triangle, &times, Method::Direct)?;
    add_thermal_noise(&mut observed, 1);
    let observed = observed.total_intensity();
    println!("{} visibilities", observed.rows.len());
    // As far from the first to the last pixel as in the picture of 64.
    let side = SIDE as f64;
    let grid = ImageGrid::new(SIDE, SIDE, FIELD / 64.0 * 63.0 / (side - 1.0) * side)?;
    let empty = Observation { rows: Vec::new(), ..observed.clone() };
    let mut scans = Vec::new();
    for time in times {
        let near = |row: &&_| -> bool { same_time(row, time) };
        let rows: Vec<_> = observed.rows.iter().filter(near).copied().collect();
        if rows.is_empty() {
            scans.push(None);
            continue;
        }
        let uv = [rows.iter().map(|row| row.uv).collect()];
        let term = VisibilityTerm::new(&Observation { rows, ..empty.clone() })?;
        let transform = Transform::new(grid, Pulse::Triangle, &uv, Method::Direct, 1 << 24)?;
        scans.push(Some(Scan { transform, term: Box::new(term) }));
    }
    let model = forward_model(&lines(&screen(SIDE), PER_RAY)?, FRAMES)?;
    Ok((model, Box::new(ScanTerm::new("visibilities", SIDE * SIDE, true, scans))))
}

fn same_time(row: &kerrlight_vlbi::observation::Row, time: f64) -> bool {
    (row.time_h - time).abs() < 1e-6
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let scene = words.next().unwrap_or_else(|| "1".to_owned());
    let kind = words.next().unwrap_or_else(|| "images".to_owned());
    let file = words.next();
    let mut settings = AxisSettings::default();
    settings.directions = words.next().map_or(Ok(settings.directions), |word| word.parse())?;
    let stride = words.next().map_or(Ok(8), |word| word.parse())?;
    let axis = Axis::new([0.5, 0.0, -0.75f64.sqrt()])?;
    let truth = Truth::scene(&scene, axis)?;
    let mut movie = truth.movie(&forward_model(&lines(&screen(64), 100)?, FRAMES)?);
    let (model, term) = if kind == "images" {
        images(&movie)?
    } else {
        movie.iter_mut().for_each(|x| *x *= PEAK as f32);
        visibilities(&movie, &kind)?
    };
    let frames: Vec<usize> = (0..FRAMES).step_by(stride).collect();
    println!("{}: {} points, {} frames", term.name(), model.points(), frames.len());
    let problem = AxisProblem {
        model: &model,
        frames: &frames,
        terms: &[Weighted { weight: 1.0, term: term.as_ref() }],
        half_width: 5.0,
        upper: 2.0,
        flux: None,
        priors: &[],
    };
    let (start, cpu) = (Instant::now(), processor_time());
    let Some(scan) = scan_axis(&problem, &settings, &|_, _| true)? else { return Ok(()) };
    let said = |AxisLoss { axis: found, loss }: AxisLoss| {
        format!("{:.4?}, dot {:.5}, loss {loss:.5e}", found.vector(), found.dot(axis))
    };
    println!("{:.2} s, processor {:.2} s", start.elapsed().as_secs_f64(), processor_time() - cpu);
    let best = scan.map.iter().min_by(|a, b| a.loss.total_cmp(&b.loss)).copied();
    println!("lattice:   {}", best.map_or_else(String::new, said));
    println!("best:      {}", said(scan.best));
    println!("runner-up: {}", said(scan.runner_up));
    println!("{} problems on the lattice, {} beside", scan.map.len(), scan.refinements);
    if let Some(file) = file {
        scan.picture(1024, Colormap::AfmhotUs)?.save(file)?;
    }
    Ok(())
}

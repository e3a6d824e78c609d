//! Equatorial crossings of 268 easy and hard rays to 25 digits, from the separated
//! Boyer–Lindquist integrals with mpmath (tests/reference/kerr_crossings.py).

use crate::report::Case;
use kerrlight_geodesic::{Error, Inclination, Kerr, Observer, Path, Quantities, Tracer};
use std::collections::HashMap;

const AUTHORITY: &str = "mpmath, 25 digits";
const TABLE: &str = include_str!("../../tests/reference/kerr_crossings.csv");

type Row = HashMap<String, String>;

fn number(row: &Row, column: &str) -> Option<f64> {
    row.get(column)?.parse().ok()
}

fn trace(row: &Row) -> Option<Path> {
    let [spin, inclination, alpha, beta] =
        ["spin", "inclination_rad", "alpha", "beta"].map(|column| number(row, column));
    let (spin, inclination, alpha, beta) = (spin?, inclination?, alpha?, beta?);
    let mut path = Path::new();
    let mut traced = || -> Result<(), Error> {
        let hole = Kerr::new(spin)?;
        let observer = Observer::at_infinity(Inclination::from_radians(inclination)?);
        let ray = observer.ray(&hole, alpha, beta)?;
        Tracer::new(1e-12)?.trace(&hole, &ray, Quantities::ALL, &mut path);
        Ok(())
    };
    traced().ok()?;
    Some(path)
}

/// All cases of this file.
pub fn cases() -> Vec<Case> {
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(TABLE.as_bytes());
    let rows: Vec<Row> = reader.deserialize().filter_map(Result::ok).collect();
    let mut wrong = Vec::new();
    let [mut radius, mut time, mut azimuth, mut delay] = [const { Vec::new() }; 4];
    for row in &rows {
        let Some(path) = trace(row) else {
            wrong.push(1.0);
            continue;
        };
        let same = path.outcome().name() == row["outcome"]
            && Some(path.equatorial_crossings().len() as f64) == number(row, "crossings");
        wrong.push(if same { 0.0 } else { 1.0 });
        // Beyond 30 times the input's own rounding.
        let rounding = 30.0 * number(row, "cond").unwrap_or(0.0);
        for (k, mino_time) in (1..=3).zip(path.equatorial_crossings()) {
            let at = |name: &str| number(row, &format!("{name}_{k}")).unwrap_or(f64::NAN);
            let point = path.at(mino_time);
            let turn = (point.azimuth - at("phi")) / std::f64::consts::TAU;
            let excess = |error: f64| (error - rounding).max(0.0);
            radius.push(excess((point.radius() / at("r") - 1.0).abs()));
            time.push(excess((mino_time / at("mino") - 1.0).abs()));
            azimuth.push(excess((turn - turn.round()).abs() * std::f64::consts::TAU));
            delay.push(excess((point.delay - at("delay")).abs() / at("delay").abs().max(1.0)));
        }
    }
    let sample =
        |name: &str, errors, allowed| Case::sample(AUTHORITY, name, "crossings", errors, allowed);
    vec![
        Case::sample(AUTHORITY, "wrong outcome or number of crossings", "rays", wrong, 0.0),
        sample("radius", radius, 1e-11),
        sample("Mino time", time, 2e-13),
        sample("azimuth (radians)", azimuth, 1e-11),
        sample("delay (relative where above 1)", delay, 1e-11),
    ]
}

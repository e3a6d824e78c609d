//! Prints the table of docs/measurements/geodesics.md: whether estimates bound errors, for every integrator,
//! tolerance and class of rays. The argument is the number of rays of each class.

use anyhow::{Context, bail};
use kerrlight_validation::accuracy::estimates::{Class, Row, run};
use kerrlight_validation::accuracy::settings;

fn main() -> anyhow::Result<()> {
    let rays = std::env::args().nth(1).map_or(Ok(400), |text| text.parse());
    let rays = rays.context("give the number of rays of each class")?;
    println!("| class | at | integrator | rays | wrong | r | θ | φ | delay |");
    println!("|---|---|---|---|---|---|---|---|---|");
    let mut failed = 0;
    for class in Class::ALL {
        let rows = run(class, &settings(&[6, 9, 12]), rays, 1)?;
        for row in rows.iter().filter(|row| row.rays > 0) {
            println!("{}", row.line());
        }
        failed += rows.iter().filter(|row| !Row::holds(row)).count();
    }
    if failed > 0 {
        bail!("{failed} rows have estimates that bound less than 99 % of the errors");
    }
    Ok(())
}

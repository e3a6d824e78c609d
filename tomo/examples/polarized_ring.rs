//! A synchrotron ring in the equatorial plane, as in Narayan et al. 2021 (arXiv:2105.01804) and
//! Gelles et al. 2021 (arXiv:2105.09440): Stokes parameters of 64 × 64 rays as a table.
//!
//! `cargo run --release -p kerrlight-tomo --example polarized_ring -- SPIN INCLINATION SPEED CHI
//! VERTICAL RADIAL TOROIDAL > ring.csv`: inclination and chi in degrees, SPEED and CHI of the gas in the
//! frame of zero angular momentum (`boosted`), the field as the gas has it.

use kerrlight_geodesic::{
    Inclination, Kerr, Observer, Path, Quantities, ScreenPoint, Tracer, ZamoFrame,
};
use kerrlight_render::polarization::{Gas, MagneticField, PowerLaw, Stokes, view};
use std::error::Error;

const SIDE: u32 = 64;
const FIELD_OF_VIEW: f64 = 24.0;
const INNER: f64 = 5.0;
const OUTER: f64 = 7.0;

fn main() -> Result<(), Box<dyn Error>> {
    let numbers: Result<Vec<f64>, _> = std::env::args().skip(1).map(|x| x.parse()).collect();
    let [spin, degrees, speed, chi, vertical, radial, toroidal] = numbers?[..] else {
        return Err("seven numbers: spin inclination speed chi vertical radial toroidal".into());
    };
    let hole = Kerr::new(spin)?;
    let inclination = Inclination::from_degrees(degrees)?;
    let observer = Observer::at_infinity(inclination);
    let gas = Gas::boosted(speed, chi.to_radians()).ok_or("the gas is not slower than light")?;
    let field = MagneticField { vertical, radial, toroidal };
    field.check()?;
    let law = PowerLaw::new(1.0, Some(300.0))?;
    let tracer = Tracer::new(1e-11)?;
    let mut path = Path::new();
    println!("alpha,beta,I,Q,U,V,layers,radius,outward");
    for k in 0..SIDE * SIDE {
        let at = |k: u32| FIELD_OF_VIEW * ((f64::from(k) + 0.5) / f64::from(SIDE) - 0.5);
        let (alpha, beta) = (at(k % SIDE), -at(k / SIDE));
        let ray = observer.ray(&hole, alpha, beta)?;
        tracer.trace(&hole, &ray, Quantities::ALL, &mut path);
        let screen = ScreenPoint::new(&hole, inclination.sin(), alpha, beta);
        let mut light = Stokes::default();
        let (mut layers, mut radius, mut outward) = (0, 0.0, false);
        for time in path.equatorial_crossings() {
            let point = path.at(time);
            if !(INNER..=OUTER).contains(&point.radius()) {
                continue;
            }
            let Some(frame) = ZamoFrame::of(&hole, &point) else { continue };
            let photon = frame.covariant(point.momentum(&hole, ray.lambda));
            let seen = view(&frame, &screen, photon, gas, field.at(&frame));
            if let Some(layer) = seen.and_then(|seen| law.of_layer(&seen)) {
                layers += 1;
                if layers == 1 {
                    (radius, outward) = (point.radius(), photon[1] > 0.0);
                }
                light += layer;
            }
        }
        let Stokes { i, q, u, v } = light;
        println!("{alpha},{beta},{i},{q},{u},{v},{layers},{radius},{outward}");
    }
    Ok(())
}

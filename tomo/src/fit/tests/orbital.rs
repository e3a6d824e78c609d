//! Light curves as data, simulated and measured, and geometries weighed by them.

use super::{changed, simulated};
use crate::Error;
use crate::fit::Observable;
use crate::fit::journal::Forgetful;
use crate::fit::settings::{DataFiles, FitFile, Steps};
use crate::fit::setup::{self, BandScan, FitData, Instrument};
use kerrlight_render::polarization::StokesParameter;
use kerrlight_vlbi::files::{light_curve_to_csv, parse_light_curve};
use kerrlight_vlbi::light_curve::{Flux, LightCurve, Sample};

const PUBLISHED: &str = include_str!("../../../../scenes/fits/orbital_polarimetry.toml");
const TEXTBOOK: &str = include_str!("../../../../scenes/fits/orbital_polarimetry_textbook.toml");

fn file(text: &str, set: &[&str]) -> FitFile {
    FitFile::parse(&changed(text, set)).unwrap()
}

fn scan(file: &FitFile, measured: &FitData, goes_on: bool) -> Result<Option<BandScan>, Error> {
    let settings = file.band.as_ref().unwrap();
    setup::scan_band(file, measured, settings, &Forgetful, &|_| goes_on)
}

/// What settings simulate, and the band in it.
fn scanned(file: &FitFile) -> Result<(FitData, BandScan), Error> {
    let measured = FitData::simulated(file, &Instrument::new(file)?, None)?;
    let found = scan(file, &measured, true)?.unwrap();
    Ok((measured, found))
}

/// I has the mean that is asked for, Q and U the errors, and both laws are polarised as they say.
#[test]
fn exact_simulated_light_curves() {
    for (text, fraction) in [(PUBLISHED, 0.85), (TEXTBOOK, 0.75)] {
        let set = [
            "screen.pixels=24",
            "loss.0.stokes=[\"I\", \"Q\", \"U\"]",
            "simulation.light_curve.noise=\"none\"",
        ];
        let (instrument, measured) = simulated(&file(text, &set));
        assert!(
            matches!(&instrument.seen, Observable::Fluxes(parameters) if parameters.len() == 3)
        );
        let curve = measured.curve.unwrap();
        assert_eq!((curve.hours.len(), curve.data.len()), (98, 294));
        let first = curve.hours.iter().filter(|h| (*h - curve.hours[0]) * 60.0 <= 100.0).count();
        let fluxes: Vec<[f64; 3]> =
            curve.data.chunks(3).map(|c| [0, 1, 2].map(|k| c[k].unwrap()[0])).collect();
        let mean = fluxes[..first].iter().map(|f| f[0]).sum::<f64>() / first as f64;
        assert!((mean - 0.3).abs() < 1e-12, "{mean}");
        let parts: Vec<f64> = fluxes.iter().map(|[i, q, u]| q.hypot(*u) / i).collect();
        let most = parts.iter().fold(0.0f64, |most, part| most.max(*part));
        assert!(most < fraction && most > 0.1, "{most}");
        let later = curve.fitted.iter().filter(|fitted| !**fitted).count();
        assert!((5..20).contains(&later), "{later}");
        // The movie of the report has the same flux.
        let movie = measured.movie.unwrap();
        let pictured = movie.sums().unwrap()[0];
        assert!((pictured - curve.data[0].unwrap()[0]).abs() < 1e-9);
    }
}

/// The inclination, the sense of rotation, the radius and the azimuth of the tube are found.
#[test]
fn exact_geometries_of_the_published_test() {
    let set = ["screen.pixels=48", "band.nodes=41", "band.widths=[1.0]", "band.lengths=[4.0]"];
    let mut file = file(PUBLISHED, &set);
    let band = file.band.as_mut().unwrap();
    band.inclinations_deg = Steps { from: 12.0, to: 40.0, step: 28.0 };
    band.radii = Steps { from: 8.0, to: 12.0, step: 2.0 };
    let (measured, found) = scanned(&file).unwrap();
    assert_eq!(found.geometries.len(), 4);
    let best = &found.geometries[found.best];
    assert_eq!((best.inclination_deg, best.rotation_factor), (12.0, 1.0));
    for geometry in &found.geometries {
        let worse = best.ln_posterior - geometry.ln_posterior;
        assert!(geometry == best || worse > 8.0, "{geometry:?}: {worse}");
    }
    assert!((found.radius.median - 10.0).abs() < 0.3, "{:?}", found.radius);
    let azimuth = found.azimuth.median.to_degrees().rem_euclid(360.0);
    assert!((azimuth - 230.0).abs() < 8.0, "{azimuth}");
    let degrees = [found.azimuth.low, found.azimuth.high].map(f64::to_degrees);
    assert!((1.0..40.0).contains(&(degrees[1] - degrees[0])), "{degrees:?}");
    assert!(scan(&file, &measured, false).unwrap().is_none());
}

/// Data whose position angles are turned are those of a spin whose position angle is.
#[test]
fn exact_position_angles_of_the_spin() {
    let set = [
        "screen.pixels=24",
        "band.nodes=20",
        "band.widths=[2.0]",
        "band.lengths=[4.0]",
        "band.position_angles_deg=[0.0, 40.0, 80.0]",
        "polarization.turn_deg=40.0",
    ];
    let mut file = file(PUBLISHED, &set);
    let band = file.band.as_mut().unwrap();
    band.inclinations_deg = Steps { from: 12.0, to: 12.0, step: 1.0 };
    band.radii = Steps { from: 10.0, to: 10.0, step: 1.0 };
    band.rotation_factors = vec![1.0];
    let (_, measured) = simulated(&file);
    if let Some(law) = &mut file.polarization {
        law.turn_deg = 0.0;
    }
    let found = scan(&file, &measured, true).unwrap().unwrap();
    assert_eq!(found.geometries[found.best].position_angle_deg, 40.0, "{:?}", found.geometries);
    // The fit that follows turns its images as well.
    let turned = setup::in_band_geometry(&file, 12.0, 40.0);
    assert_eq!(turned.observer.position_angle_deg.value(), 40.0);
    let settings = file.band.as_ref().unwrap();
    let refused = setup::check_band(&turned, &measured, settings).unwrap_err().to_string();
    assert!(refused.starts_with("observer.position_angle_deg = 40"), "{refused}");
}

fn measured_file(more: &str) -> FitFile {
    let start = PUBLISHED.find("[[simulation.truth.tube]]").unwrap();
    let end = PUBLISHED.find("[[loss]]").unwrap();
    let data = format!("[data.light-curve]\npath = \"curve.csv\"\nfirst_time = 5.0\n{more}\n\n");
    FitFile::parse(&format!("{}{data}{}", &PUBLISHED[..start], &PUBLISHED[end..])).unwrap()
}

fn curve(count: usize) -> LightCurve {
    let flux = |jy: f64| Some(Flux { jy, sigma_jy: Some(0.02) });
    let sample = |k: usize| Sample {
        time_h: 9.0 + k as f64 / 60.0,
        stokes: [flux(2.5), flux(0.1 + 0.01 * k as f64), flux(-0.2), None],
        by: String::new(),
    };
    LightCurve { samples: (0..count).map(sample).collect() }
}

/// Cropped, averaged, less what is steady, derotated, with errors of their own, and divided into spans.
#[test]
fn exact_measured_light_curves() {
    let more = "utc_h = [9.0, 9.66]\naverage = 4\nsteady = { Q = 0.1, U = -0.2 }\nderotation_deg = 45.0\n\
         sigma = { Q = 0.03, U = 0.03 }\nvalidate_after_min = 21.0";
    let file = measured_file(more);
    let text = light_curve_to_csv(&curve(60));
    let found =
        FitData::of_light_curve(&file, parse_light_curve(&text).unwrap(), "curve.csv").unwrap();
    let curve = found.curve.unwrap();
    assert_eq!(
        (curve.parameters.as_slice(), curve.hours.len()),
        (&[StokesParameter::Q, StokesParameter::U][..], 10)
    );
    assert!((curve.hours[0] - 9.025).abs() < 1e-9 && found.times[0] == 5.0);
    let per_m = setup::hours_per_m(&file).unwrap();
    assert!((found.times[1] - 5.0 - 4.0 / 60.0 / per_m).abs() < 1e-9);
    // Q = 0.015, U = 0 before they are turned by 90° of 2χ.
    let [q, u] = [0, 1].map(|k| curve.data[k].unwrap());
    assert!(q[0].abs() < 1e-12 && (u[0] - 0.015).abs() < 1e-12 && u[1] == 0.03, "{q:?} {u:?}");
    assert_eq!(curve.fitted, [true, true, true, true, true, true, false, false, false, false]);
    assert!(matches!(file.data, Some(DataFiles::LightCurve(_))));
}

#[test]
fn regress_light_curves_that_mean_nothing_are_refused() {
    let says = |more: &str, curve: LightCurve| {
        FitData::of_light_curve(&measured_file(more), curve, "c.csv").err().unwrap().to_string()
    };
    let text = says("utc_h = [1.0, 2.0]", curve(9));
    assert!(text.contains("c.csv") && text.contains("no samples are left"), "{text}");
    let mut bare = curve(9);
    bare.samples[3].stokes[2] = Some(Flux { jy: 0.1, sigma_jy: None });
    let text = says("", bare);
    assert!(text.contains("U at 9.05 h has no error: give a column sigma_U"), "{text}");
    let text = says("sigma = { Q = -1.0 }", curve(9));
    assert!(text.contains("data.light-curve.sigma.Q = -1 is not allowed"), "{text}");
    let refused = |set: &[&str]| Instrument::new(&file(PUBLISHED, set)).err().unwrap().to_string();
    let text = refused(&["loss.0.stokes=[\"Q\", \"V\"]"]);
    assert!(text.contains("V is not modelled"), "{text}");
    let text = refused(&["effects.redshift_power=2.0"]);
    assert!(text.contains("effects.redshift_power = 2 is not allowed together with"), "{text}");
    let text = refused(&["polarization.frame=\"gas\""]);
    assert!(text.contains("polarization.components"), "{text}");
    let mut plain = file(PUBLISHED, &[]);
    plain.polarization = None;
    let text = Instrument::new(&plain).err().unwrap().to_string();
    assert!(text.contains("polarization is missing: Q and U need the field"), "{text}");
}

/// A tube before a background that is drawn: the geometry is found, and data without a flare to speak of ask for none.
#[test]
fn exact_a_flare_before_a_background() {
    let set = [
        "screen.pixels=32",
        "band.nodes=24",
        "band.widths=[2.0]",
        "band.lengths=[4.0]",
        "simulation.light_curve.sigma={I=0.15, Q=0.004, U=0.004}",
        "simulation.light_curve.background={constant_jy=0.2, variation_jy=0.02, correlation_min=60.0, matern=\"1/2\"}",
        "band.background={constant_jy=0.2, variation_jy=[0.0, 0.02, 0.05], correlation_min=[20.0, 60.0], matern=[\"1/2\", \"5/2\"]}",
    ];
    let scan = |jy: f64| {
        let flux = format!("simulation.light_curve.mean_flux.jy={jy}");
        let mut file = file(PUBLISHED, &[&set[..], &[&flux]].concat());
        let band = file.band.as_mut().unwrap();
        band.inclinations_deg = Steps { from: 12.0, to: 52.0, step: 20.0 };
        band.radii = Steps { from: 8.0, to: 12.0, step: 2.0 };
        scanned(&file).unwrap()
    };
    let (measured, found) = scan(0.3);
    let best = &found.geometries[found.best];
    assert_eq!((best.inclination_deg, best.rotation_factor), (12.0, 1.0));
    assert!(found.ln_bayes_factor.unwrap() > 20.0, "{:?}", found.ln_bayes_factor);
    assert!((found.radius.low..found.radius.high).contains(&10.0), "{:?}", found.radius);
    assert!(found.radius.high - found.radius.low < 5.0, "{:?}", found.radius);
    // 2π 10^1.5 GM/c³, 20.46 s.
    let of_ten = found.periods_min[found.best][1];
    assert!((of_ten - 67.75).abs() < 0.1, "{of_ten}");
    // Most of the light is the background's constant.
    let background = found.background.unwrap();
    let off = |k: usize| background[k][0] - measured.curve.as_ref().unwrap().data[k].unwrap()[0];
    let spread = (0..background.len()).map(|k| off(k).powi(2)).sum::<f64>().sqrt();
    let all = (background.len() as f64).sqrt();
    assert!(spread / all < 0.2, "{}", spread / all);
    let (_, none) = scan(0.001);
    assert!(none.ln_bayes_factor.unwrap() < 3.0, "{:?}", none.ln_bayes_factor);
}

#[test]
fn regress_backgrounds_that_mean_nothing_are_refused() {
    let says = |set: &str| {
        let file = FitFile::parse(&changed(PUBLISHED, &["screen.pixels=8", "band.nodes=8", set]));
        file.and_then(|file| scanned(&file)).err().unwrap().to_string()
    };
    let of = |constant: &str, variation: &str, minutes: &str| {
        says(&format!(
            "band.background={{constant_jy={constant}, variation_jy={variation}, correlation_min={minutes}, matern=[\"1/2\"]}}"
        ))
    };
    for (message, key) in [
        (of("-1.0", "[0.1]", "[20.0]"), "band.background.constant_jy"),
        (of("0.1", "[0.1, -0.1]", "[20.0]"), "band.background.variation_jy"),
        (of("0.1", "[0.1]", "[0.0]"), "band.background.correlation_min"),
        (of("0.1", "[]", "[20.0]"), "one value or more"),
        (
            says(
                "simulation.light_curve.background={constant_jy=0.1, variation_jy=0.1, correlation_min=-1.0, matern=\"1/2\"}",
            ),
            "simulation.light_curve.background",
        ),
    ] {
        assert!(message.contains(key), "{key}: {message}");
    }
}

//! Words on a light curve and on a flare in a band: data, model, priors, and what may not be concluded.

use crate::report::Part;
use kerrlight_render::polarization::PolarizationLaw;
use kerrlight_tomo::fit::settings::{BackgroundSettings, BandSettings, DataFiles, FitFile, Steps};
use kerrlight_tomo::fit::setup::FitData;

/// Paragraphs under headings, of a fit that compares geometries.
pub fn parts(file: &FitFile, measured: &FitData) -> Vec<Part> {
    let Some(band) = &file.band else { return Vec::new() };
    vec![
        Part { heading: "Data", text: data(file, measured) },
        Part { heading: "Model", text: model(file, band) },
        Part { heading: "Priors", text: priors(band) },
        Part { heading: "What is not concluded", text: not_concluded(file, band) },
    ]
}

fn data(file: &FitFile, measured: &FitData) -> Vec<String> {
    let Some(curve) = &measured.curve else { return Vec::new() };
    let fitted = curve.fitted.iter().filter(|fitted| **fitted).count();
    let names: Vec<&str> = curve.parameters.iter().map(|parameter| parameter.name()).collect();
    let ends = [curve.hours.first(), curve.hours.last()].map(|h| h.copied().unwrap_or(f64::NAN));
    let (count, rest) = (curve.hours.len(), curve.hours.len() - fitted);
    let mut text = vec![format!(
        "{count} samples of {} between {:.3} h and {:.3} h UTC, of which {fitted} are fitted; the last {rest} judge the fit.",
        names.join(" and "),
        ends[0],
        ends[1]
    )];
    match &file.data {
        Some(DataFiles::LightCurve(settings)) => {
            text.push(format!("File: {}.", settings.path.display()));
            text.extend(settings.average.map(|n| format!("Samples are means of {n}.")));
            text.extend(settings.average_s.map(|s| format!("Samples are means over {s} s.")));
            let steady = settings.steady.map(|steady| steady.all());
            if let Some([_, q, u, _]) = steady {
                let [q, u] = [q, u].map(|jy| jy.unwrap_or(0.0));
                text.push(format!(
                    "A steady part was subtracted: Q = {q} Jy and U = {u} Jy, {:.0}° east of north.",
                    (0.5 * u.atan2(q).to_degrees()).rem_euclid(180.0)
                ));
            }
            text.extend(settings.derotation_deg.map(|turn| {
                format!("Position angles were turned by {turn}°, to take Faraday rotation back.")
            }));
        }
        _ => text.push("The data are simulated.".to_owned()),
    }
    text
}

fn model(file: &FitFile, band: &BandSettings) -> Vec<String> {
    let mut text = vec![format!(
        "A hole of spin {}. In each geometry the emission is a Gaussian random field in a band about a circle; gas carries it round \
         with an angular velocity that is a multiple of the one in motion.velocity. No volume is fitted to compare geometries: \
         the field is integrated out. The volume that is shown is that of the most probable geometry.",
        file.hole.spin.value()
    )];
    text.extend(file.polarization.as_ref().map(law));
    text.push(match &band.background {
        Some(background) => beside(background),
        None => {
            "Nothing shines beside the flare but the steady part: all that varies has to orbit."
                .to_owned()
        }
    });
    text
}

fn law(law: &PolarizationLaw) -> String {
    let field = &law.field;
    format!(
        "Magnetic field: vertical {}, radial {}, toroidal {}. Light goes like g^{} |b|^{} sin^{} of the angle between field and \
         ray; {:.0} % of it is linearly polarised.",
        field.vertical,
        field.radial,
        field.toroidal,
        law.redshift_power,
        law.field_power,
        law.sine_power,
        100.0 * law.fraction
    )
}

fn beside(background: &BackgroundSettings) -> String {
    format!(
        "Beside the flare, Q and U have a constant ({} Jy) and a Gaussian process with a standard deviation of {} Jy and a \
         correlation time of {} minutes.",
        background.constant_jy,
        list(&background.variation_jy),
        list(&background.correlation_min)
    )
}

fn priors(band: &BandSettings) -> Vec<String> {
    vec![
        format!(
            "Inclination: that of axes in any direction, {}. Position angle of the axis: {}. Angular velocity: {} times that of \
             the law, below 0 the other way round. All listed values are equally probable.",
            steps(&band.inclinations_deg, "°"),
            degrees(&band.position_angles_deg),
            list(&band.rotation_factors)
        ),
        format!(
            "Band: radii of {}, widths of {} M, a height of {} M, correlation lengths of {} M, all equally probable; a brightness \
             within three orders of magnitude.",
            steps(&band.radii, " M"),
            list(&band.widths),
            band.height,
            list(&band.lengths)
        ),
    ]
}

fn not_concluded(file: &FitFile, band: &BandSettings) -> Vec<String> {
    let mut text = vec![
        "The magnetic field and the law of emission: they are assumed, and with others the result may lie outside of these \
         intervals. The shape of the emission: one curve tells where light turns, not what it looks like."
            .to_owned(),
        "Flares that appear or fade within the data, that leave their circle, or that are several at different radii: these are \
         outside of the model, and show only as samples that are predicted badly."
            .to_owned(),
    ];
    let known = |count: usize, what: &str| {
        (count == 1).then(|| {
            format!("{what}: a single value was given, and no interval contains its error.")
        })
    };
    text.extend(known(band.position_angles_deg.len(), "The position angle of the axis"));
    let mut speeds: Vec<f64> = band.rotation_factors.iter().map(|x| x.abs()).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.dedup();
    text.extend(known(speeds.len(), "The speed of the orbit at a given radius"));
    if file.hole.mass_msun.is_some() {
        text.push(
            "Mass and spin of the hole: they are given. A radius in M follows from the period by the law of motion."
                .to_owned(),
        );
    }
    text
}

fn list(values: &[f64]) -> String {
    match values {
        [rest @ .., last] if !rest.is_empty() => {
            let rest: Vec<String> = rest.iter().map(f64::to_string).collect();
            format!("{} or {last}", rest.join(", "))
        }
        values => values.iter().map(f64::to_string).collect(),
    }
}

fn steps(steps: &Steps, unit: &str) -> String {
    let Steps { from, to, step } = steps;
    format!("{from} to {to}{unit} in steps of {step}")
}

/// Position angles, of which all directions are one.
fn degrees(values: &[f64]) -> String {
    match values {
        [first, .., last] if values.len() > 3 => {
            format!("{} values from {first}° to {last}°", values.len())
        }
        values => list(values) + "°",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_lists_are_read_as_sentences() {
        assert_eq!(list(&[1.0]), "1");
        assert_eq!(list(&[-1.0, 0.5, 1.0]), "-1, 0.5 or 1");
        assert_eq!(degrees(&[0.0, 90.0]), "0 or 90°");
        assert_eq!(degrees(&[0.0, 20.0, 40.0, 60.0]), "4 values from 0° to 60°");
        let radii = Steps { from: 7.0, to: 18.0, step: 0.5 };
        assert_eq!(steps(&radii, " M"), "7 to 18 M in steps of 0.5");
    }
}

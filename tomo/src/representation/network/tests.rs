use super::*;
use crate::representation::Activation;
use crate::representation::conformance::{Subject, check};
use crate::representation::features::tests::layer;
use crate::representation::grid::tests::{Number, activated, number, numbers};
use kerrlight_geodesic::Elementary;

/// The network and its derivative along a direction, layer by layer with plain loops.
fn plain(settings: &NetworkSettings, p: &[f64], dp: &[f64], at: &[f64], dat: &[f64]) -> (f64, f64) {
    let (x, mut p) = (encode(settings, at, dat), numbers(p, dp));
    let mut h = x.clone();
    for k in 1..=settings.hidden_layers {
        h = layer(&mut p, &h, settings.width, false);
        if settings.skip_after == Some(k) {
            h.extend(&x);
        }
    }
    let last = layer(&mut p, &h, 1, true)[0];
    activated(settings.activation, last + number(settings.shift, 0.0))
}

fn encode(settings: &NetworkSettings, at: &[f64], dat: &[f64]) -> Vec<Number> {
    let scale = |k: usize| match (settings.dimension, k) {
        (4, 0) => settings.time_scale,
        _ => settings.length_scale,
    };
    let scaled = |(k, x): (usize, Number)| x / number(scale(k), 0.0);
    let x: Vec<Number> = numbers(at, dat).enumerate().map(scaled).collect();
    let mut gamma = x.clone();
    if let (4, Some(span)) = (settings.dimension, settings.time_span) {
        gamma[0] = number(at[0] / span, dat[0] / span);
    }
    for shift in [0.0, core::f64::consts::FRAC_PI_2] {
        for j in 0..settings.degree {
            let [factor, shift] = [f64::from(1 << j), shift].map(|x| number(x, 0.0));
            gamma.extend(x.iter().map(|x| (factor * *x + shift).sin_cos().0));
        }
    }
    gamma
}

fn conforms(settings: NetworkSettings) {
    for set in InstructionSet::ALL.into_iter().filter(|set| set.available()) {
        let network = Network::new(settings.clone()).unwrap().on(set);
        let tangent =
            |p: &[f64], dp: &[f64], at: &[f64], dat: &[f64]| plain(&settings, p, dp, at, dat);
        let (representation, within) = (&network, 5.0);
        check(&Subject { representation, within, parameter_noise: 0.05, tangent: &tangent });
    }
}

#[test]
fn exact_bhnerf_conforms() {
    conforms(NetworkSettings::bhnerf());
}

#[test]
fn exact_mlp4d_conforms() {
    conforms(NetworkSettings { time_scale: 2.5, ..NetworkSettings::mlp4d() });
    conforms(NetworkSettings::changing([1.5, 30.0]));
}

#[test]
fn exact_other_sizes_conform() {
    let odd = NetworkSettings { width: 37, length_scale: 3.0, ..NetworkSettings::bhnerf() };
    let last = NetworkSettings { skip_after: Some(4), shift: 0.5, ..odd.clone() };
    conforms(NetworkSettings { activation: Activation::Softplus, degree: 5, ..odd.clone() });
    conforms(NetworkSettings { activation: Activation::Linear, ..last });
    let flat = NetworkSettings { hidden_layers: 1, skip_after: None, degree: 0, ..odd };
    conforms(NetworkSettings { width: 3, shift: 0.0, ..flat });
}

#[test]
fn exact_sizes() {
    let of = |settings| Network::new(settings).unwrap();
    let parameters = |network: &Network| Representation::<f32>::parameters(network);
    assert_eq!(parameters(&of(NetworkSettings::bhnerf())), 55_169);
    assert_eq!(parameters(&of(NetworkSettings::mlp4d())), 56_961);
    assert_eq!(of(NetworkSettings::bhnerf()).operations(), [109_312, 317_184]);
}

#[test]
fn exact_single_precision_is_double_precision_rounded() {
    let network = Network::new(NetworkSettings::bhnerf()).unwrap();
    let mut parameters = vec![0.0; Representation::<f64>::parameters(&network)];
    Representation::<f64>::initialise(&network, 3, &mut parameters);
    let single: Vec<f32> = parameters.iter().map(|x| *x as f32).collect();
    let double: Vec<f64> = single.iter().map(|x| f64::from(*x)).collect();
    let column =
        |k: usize| (0..999).map(|i| ((i * k) % 257) as f32 / 25.7 - 5.0).collect::<Vec<_>>();
    let columns = [column(3), column(7), column(11)];
    let exact = columns.clone().map(|c| c.iter().map(|x| f64::from(*x)).collect::<Vec<_>>());
    let at = Coordinates::xyz(&exact[0], &exact[1], &exact[2]);
    let mut reference = vec![0.0; 999];
    network.eval(&double, at, &mut reference, &mut Workspace::new());
    for set in InstructionSet::ALL {
        let at = Coordinates::xyz(&columns[0], &columns[1], &columns[2]);
        let mut values = vec![0.0f32; 999];
        network.clone().on(set).eval(&single, at, &mut values, &mut Workspace::new());
        for (value, reference) in values.iter().zip(&reference) {
            assert!((f64::from(*value) / reference - 1.0).abs() < 3e-5, "{value:e} {reference:e}");
        }
    }
}

#[test]
fn exact_kernels_have_the_variance_of_their_scheme() {
    let network = Network::new(NetworkSettings::bhnerf()).unwrap();
    let mut parameters = vec![f64::NAN; 55_169];
    network.initialise(7, &mut parameters);
    for layer in network.layout.hidden() {
        let (kernel, bias) = parameters[layer.offset..layer.offset + layer.size()]
            .split_at(layer.inputs * layer.outputs);
        let variance = kernel.iter().map(|x| x * x).sum::<f64>() / kernel.len() as f64;
        let expected = 2.0 / layer.inputs as f64;
        // Five standard deviations of the mean of squares, at most (of a normal distribution).
        let spread = 5.0 * (2.0 / kernel.len() as f64).sqrt();
        assert!((variance / expected - 1.0).abs() < spread, "{variance} {expected}");
        assert!(bias.iter().all(|x| *x == 0.0));
    }
    let mut again = vec![0.0; 55_169];
    network.initialise(7, &mut again);
    assert_eq!(parameters, again);
}

#[test]
fn a_nan_stays_one() {
    let network = Network::new(NetworkSettings::bhnerf()).unwrap();
    let mut parameters = vec![0.0f32; 55_169];
    network.initialise(1, &mut parameters);
    parameters[30_000] = f32::NAN;
    let (at, mut values) = ([1.0f32; 5], [0.0; 5]);
    let at = Coordinates::xyz(&at, &at, &at);
    network.eval(&parameters, at, &mut values, &mut Workspace::new());
    assert!(values.iter().all(|x| x.is_nan()));
}

#[test]
fn sizes_out_of_range_are_named() {
    let of = |settings| Network::new(settings).unwrap_err().to_string();
    let text = of(NetworkSettings { width: 0, ..NetworkSettings::bhnerf() });
    assert_eq!(text, "width = 0 is not allowed: 1 to 4096");
    let text = of(NetworkSettings { skip_after: Some(5), ..NetworkSettings::bhnerf() });
    assert_eq!(text, "skip_after = 5 is not allowed: 1 to hidden_layers");
}

/// More points than a recording holds: the rest passes forward again, and no bit changes.
#[test]
fn regress_points_beyond_a_recording() {
    let network = Network::new(NetworkSettings::bhnerf()).unwrap();
    let field: &dyn Representation<f32> = &network;
    let mut parameters = vec![0.0; field.parameters()];
    field.initialise(3, &mut parameters);
    let count = 120_000;
    assert!(tile::Activations::<f32>::bytes(&network, count) > 300 << 20);
    let column = |step: f32| -> Vec<f32> { (0..count).map(|k| (k as f32 * step).sin()).collect() };
    let (x, y, z) = (column(0.1), column(0.37), column(0.73));
    let at = || Coordinates::xyz(&x, &y, &z);
    let workspace = &mut Workspace::new();
    let (mut values, mut expected) = (vec![0.0; count], vec![0.0; field.parameters()]);
    let into = Gradient { parameters: &mut expected, coordinates: None };
    field.vjp(&parameters, at(), &x, into, workspace);
    field.eval_recorded(&parameters, at(), &mut values, workspace);
    let mut found = vec![0.0; field.parameters()];
    let into = Gradient { parameters: &mut found, coordinates: None };
    field.vjp_recorded(&parameters, at(), &x, into, workspace);
    assert!(found.iter().any(|slope| *slope != 0.0));
    assert_eq!(found, expected);
}

use super::*;
use kerrlight_common::simd::Array;

const POINTS: usize = 24;

/// Numbers that sums of products of are exact.
fn numbers(count: usize, seed: usize) -> Vec<f64> {
    (0..count).map(|k| ((k * 37 + seed * 11) % 23) as f64 - 11.0).collect()
}

/// The three products against plain sums, on registers as wide as those of AVX-512 (f32) and others.
fn products<V: Lanes<f64>, const ROWS: usize>(inputs: usize, outputs: usize) {
    let (width, stride) = (2 * V::LANES, 80);
    let (x, w) = (numbers(POINTS * stride, 1), numbers((inputs + 1) * outputs, 2));
    let input = Matrix { numbers: &x, stride };
    let mut panels = vec![f64::NAN; packed_kernel(inputs, outputs, width)];
    pack_kernel(&w, outputs, width, &mut panels);
    let mut y = vec![f64::NAN; POINTS * stride];
    let output = MatrixMut { numbers: &mut y, stride };
    let points = 13;
    let task = Forward { points, input, inputs, panels: &panels, outputs, output };
    task.by_rows::<V, ROWS>();
    for p in 0..points {
        for o in 0..outputs {
            let sum: f64 = (0..inputs).map(|k| x[p * stride + k] * w[k * outputs + o]).sum();
            assert_eq!(y[p * stride + o], (sum + w[inputs * outputs + o]).max(0.0));
        }
    }
    let d = numbers(POINTS * stride, 3);
    let cotangent = Matrix { numbers: &d, stride };
    let mut panels = vec![f64::NAN; inputs.div_ceil(width) * width * outputs];
    pack_transposed(&w[..inputs * outputs], outputs, width, &mut panels);
    for masked in [true, false] {
        let mut y = vec![1.0; POINTS * stride];
        let output = MatrixMut { numbers: &mut y, stride };
        let (activations, panels) = (masked.then_some(input), &panels[..]);
        let (units, outputs) = (outputs, inputs);
        Backward { points, cotangent, units, panels, activations, outputs, output }
            .by_rows::<V, ROWS>();
        for p in 0..points {
            for k in 0..inputs {
                let sum: f64 = (0..units).map(|o| d[p * stride + o] * w[k * units + o]).sum();
                let passes = if x[p * stride + k] > 0.0 { sum } else { 0.0 };
                assert_eq!(y[p * stride + k], if masked { passes } else { 1.0 + sum });
            }
        }
    }
    let mut g = vec![2.0; (inputs + 1) * outputs];
    for (overwrite, start) in [(false, 2.0), (true, 0.0)] {
        let gradient = &mut g[..];
        let task = Weights { points, input, inputs, cotangent, outputs, gradient, overwrite };
        task.by_rows::<V, ROWS>();
        for k in 0..=inputs {
            for o in 0..outputs {
                let product = |p: usize| x[p * stride + k] * d[p * stride + o];
                let sum: f64 = (0..points).map(product).sum();
                assert_eq!(g[k * outputs + o], start + sum);
            }
        }
    }
}

#[test]
fn exact_products_on_every_width() {
    for (inputs, outputs) in [(1, 1), (21, 37), (32, 32), (37, 21), (64, 64)] {
        products::<Array<f64, 16>, 12>(inputs, outputs);
        products::<Array<f64, 8>, 12>(inputs, outputs);
        products::<Array<f64, 4>, 6>(inputs, outputs);
        products::<Array<f64, 1>, 6>(inputs, outputs);
    }
}

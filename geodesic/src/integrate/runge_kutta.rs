//! One step of an embedded Runge–Kutta method. The method is data; the loop over its
//! stages is written once.

use crate::integrate::mino::System;

/// Butcher tableau of an explicit embedded method whose last stage is the first of the
/// next step (FSAL).
pub(crate) struct Tableau<const S: usize> {
    /// Order p of the propagated solution; the embedded one has p − 1.
    pub order: u8,
    /// a_ij below the diagonal; the last row holds the weights of the solution.
    pub stages: [[f64; S]; S],
    /// Weights of the solution less those of the embedded one.
    pub error: [f64; S],
    /// The same for a second embedded solution, of much lower order, if there is one; the
    /// error is then e²/√(e² + 0.01 e₂²) (Hairer, Nørsett & Wanner, Solving ODEs I, II.10).
    pub second_error: Option<[f64; S]>,
}

/// A method whose coefficients the compiler knows, so that the loops over its stages unroll.
pub(crate) trait Method<const S: usize> {
    const TABLEAU: Tableau<S>;
    /// Largest ratio of the true local error to h times its estimate: measured
    /// (docs/measurements/geodesics.md of the repository).
    const CAUTION: f64;
}

/// Dormand & Prince 1980, J. Comp. Appl. Math. 6, 19: order 5(4), seven stages.
pub(crate) struct DormandPrince5;

impl Method<7> for DormandPrince5 {
    const TABLEAU: Tableau<7> = DORMAND_PRINCE_5;
    const CAUTION: f64 = 2.0;
}

const DORMAND_PRINCE_5: Tableau<7> = Tableau {
    order: 5,
    stages: [
        [0.0; 7],
        [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0, 0.0],
        [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0, 0.0],
        [
            9017.0 / 3168.0,
            -355.0 / 33.0,
            46732.0 / 5247.0,
            49.0 / 176.0,
            -5103.0 / 18656.0,
            0.0,
            0.0,
        ],
        [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0, 0.0],
    ],
    error: [
        71.0 / 57600.0,
        0.0,
        -71.0 / 16695.0,
        71.0 / 1920.0,
        -17253.0 / 339200.0,
        22.0 / 525.0,
        -1.0 / 40.0,
    ],
    second_error: None,
};

/// Hairer, Nørsett & Wanner, Solving ODEs I (2nd edition, 1993), II.5 and II.10: order
/// 8(5,3), twelve stages and the slope at the end.
pub(crate) struct DormandPrince8;

impl Method<13> for DormandPrince8 {
    const TABLEAU: Tableau<13> = DORMAND_PRINCE_8;
    const CAUTION: f64 = 5.0;
}

#[rustfmt::skip]
const DORMAND_PRINCE_8: Tableau<13> = Tableau {
    order: 8,
    stages: [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.052_600_151_958_767_73, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.019_725_056_984_537_9, 0.059_175_170_953_613_7, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.029_587_585_476_806_85, 0.0, 0.088_762_756_430_420_54, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.241_365_134_159_266_7, 0.0, -0.884_549_479_328_286_1, 0.924_834_003_261_792, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.037_037_037_037_037_035, 0.0, 0.0, 0.170_828_608_729_473_86, 0.125_467_687_566_822_42, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.037109375, 0.0, 0.0, 0.170_252_211_019_544_05, 0.060_216_538_980_455_96, -0.017_578_125, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.037_092_000_118_504_79, 0.0, 0.0, 0.170_383_925_712_239_98, 0.107_262_030_446_373_28, -0.015_319_437_748_624_402, 0.008_273_789_163_814_023, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.624_110_958_716_075_7, 0.0, 0.0, -3.360_892_629_446_941_4, -0.868_219_346_841_726, 27.592_099_699_446_71, 20.154_067_550_477_894, -43.489_884_181_069_96, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.477_662_536_438_264_34, 0.0, 0.0, -2.488_114_619_971_667_7, -0.590_290_826_836_843, 21.230_051_448_181_193, 15.279_233_632_882_423, -33.288_210_968_984_86, -0.020_331_201_708_508_627, 0.0, 0.0, 0.0, 0.0],
        [-0.937_142_430_085_987_3, 0.0, 0.0, 5.186_372_428_844_064, 1.091_437_348_996_729_5, -8.149_787_010_746_927, -18.520_065_659_996_96, 22.739_487_099_350_505, 2.493_605_552_679_652_3, -3.046_764_471_898_219_6, 0.0, 0.0, 0.0],
        [2.273_310_147_516_538, 0.0, 0.0, -10.534_495_466_737_25, -2.000_872_058_224_862_5, -17.958_931_863_118_8, 27.948_884_529_419_96, -2.858_998_277_135_023_5, -8.872_856_933_530_63, 12.360_567_175_794_303, 0.643_392_746_015_763_6, 0.0, 0.0],
        [0.054_293_734_116_568_765, 0.0, 0.0, 0.0, 0.0, 4.450_312_892_752_409, 1.891_517_899_314_500_3, -5.801_203_960_010_585, 0.311_164_366_957_819_9, -0.152_160_949_662_516_1, 0.201_365_400_804_030_34, 0.044_710_615_727_772_59, 0.0],
    ],
    error: [0.013_120_044_994_194_88, 0.0, 0.0, 0.0, 0.0, -1.225_156_446_376_204_4, -0.495_758_949_657_250_2, 1.664_377_182_454_986_4, -0.350_328_848_749_973_66, 0.334_179_118_713_017_5, 0.081_923_206_485_115_71, -0.022_355_307_863_886_294, 0.0],
    second_error: Some([-0.189_800_754_072_407_62, 0.0, 0.0, 0.0, 0.0, 4.450_312_892_752_409, 1.891_517_899_314_500_3, -5.801_203_960_010_585, -0.422_682_321_323_791_97, -0.152_160_949_662_516_1, 0.201_365_400_804_030_34, 0.022_651_792_198_360_825, 0.0]),
};

/// Result of a trial step.
pub(crate) struct Trial<const N: usize> {
    /// State at the end.
    pub y: [f64; N],
    /// Its derivative.
    pub f: [f64; N],
    /// Estimate of the local error.
    pub error: [f64; N],
    /// The same from the second embedded solution.
    pub second_error: Option<[f64; N]>,
}

/// `h` times the slopes, weighted.
#[inline(always)]
fn weighted<const N: usize, const S: usize>(
    k: &[[f64; N]; S],
    weights: &[f64; S],
    stages: usize,
    h: f64,
) -> [f64; N] {
    let mut sum = [0.0; N];
    for (k, weight) in k.iter().zip(weights).take(stages) {
        if *weight != 0.0 {
            for (sum, k) in sum.iter_mut().zip(k) {
                *sum += weight * k;
            }
        }
    }
    sum.map(|sum| h * sum)
}

/// One step of length `h` from `y` with derivative `f`.
#[inline(always)]
pub(crate) fn step<M: Method<S>, const N: usize, const S: usize>(
    system: &System<f64>,
    y: &[f64; N],
    f: &[f64; N],
    leg: f64,
    h: f64,
) -> Trial<N> {
    let mut k = [[0.0; N]; S];
    k[0] = *f;
    let mut end = *y;
    // Written out, so that each stage is compiled with its own coefficients.
    macro_rules! stages {
        ($($i:literal)*) => {$(
            if $i < S {
                let rise = weighted(&k, &M::TABLEAU.stages[$i], $i, h);
                end = core::array::from_fn(|n| y[n] + rise[n]);
                k[$i] = system.derivative(&end, leg);
            }
        )*};
    }
    stages!(1 2 3 4 5 6 7 8 9 10 11 12);
    let error = weighted(&k, &M::TABLEAU.error, S, h);
    let second_error = M::TABLEAU.second_error.map(|weights| weighted(&k, &weights, S, h));
    Trial { y: end, f: k[S - 1], error, second_error }
}

/// Step-size control with memory of the last error (Gustafsson's PI controller with the
/// constants of Hairer, Nørsett & Wanner, Solving ODEs I, II.4).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Control {
    exponent: f64,
    /// Logarithm of the last accepted error.
    last: f64,
}

impl Control {
    const BETA: f64 = 0.04;

    pub fn new(order: u8) -> Self {
        Control { exponent: 1.0 / f64::from(order) - 0.75 * Self::BETA, last: 1e-4f64.ln() }
    }

    /// Factor for the next step after one whose error, in units of the tolerance, was
    /// `error`; at most 1 after a rejected one.
    pub fn factor(&mut self, error: f64) -> f64 {
        let logarithm = error.max(1e-10).ln();
        if error > 1.0 {
            return (0.9 * (-self.exponent * logarithm).exp()).max(0.2);
        }
        let factor = 0.9 * (Self::BETA * self.last - self.exponent * logarithm).exp();
        self.last = logarithm.max(-9.2);
        factor.clamp(0.2, 6.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The conditions for order p of the quadrature part: Σ b c^(q−1) = 1/q for q ≤ p, and
    /// row sums that are the nodes; the embedded weights sum to 0.
    fn check<M: Method<S>, const S: usize>() {
        let table = M::TABLEAU;
        let nodes = table.stages.map(|row| row.iter().sum::<f64>());
        let weights = table.stages[S - 1];
        assert!((nodes[S - 1] - 1.0).abs() < 1e-14);
        for q in 1..=i32::from(table.order) {
            let sum: f64 = weights.iter().zip(nodes).map(|(b, c)| b * c.powi(q - 1)).sum();
            assert!((sum - 1.0 / f64::from(q)).abs() < 1e-14, "q = {q}: {sum}");
        }
        for error in [Some(table.error), table.second_error].into_iter().flatten() {
            assert!(error.iter().sum::<f64>().abs() < 1e-14);
        }
        // Of the tree conditions: Σ b_i a_ij c_j^q = 1/((q + 1)(q + 2)).
        for q in 1..i32::from(table.order) - 1 {
            let inner = |row: &[f64; S]| row.iter().zip(nodes).map(|(a, c)| a * c.powi(q)).sum();
            let sums = table.stages.map(|row| -> f64 { inner(&row) });
            let sum: f64 = weights.iter().zip(sums).map(|(b, s)| b * s).sum();
            let exact = 1.0 / f64::from((q + 1) * (q + 2));
            assert!((sum - exact).abs() < 1e-14, "q = {q}: {sum}");
        }
    }

    #[test]
    fn exact_order_conditions() {
        check::<DormandPrince5, 7>();
        check::<DormandPrince8, 13>();
    }
}

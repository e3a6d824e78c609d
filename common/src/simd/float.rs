//! The numbers that kernels compute with.

#![allow(clippy::excessive_precision, reason = "coefficients as the fit printed them")]

use kerrlight_geodesic::simd::lanes::Element;

/// f32 (to run) or f64 (to test and to measure), with the constants that the elementary functions of [`math`](super::math)
/// need.
pub trait Float:
    num_traits::Float
    + num_traits::FromPrimitive
    + num_traits::NumAssign
    + core::iter::Sum
    + core::fmt::Debug
    + Default
    + Send
    + Sync
    + Element
{
    /// (sin √z/√z − 1)/z on 0 ≤ z ≤ (π/4)².
    const SIN: &'static [Self];
    /// ((cos √z − 1)/z + ½)/z on 0 ≤ z ≤ (π/4)².
    const COS: &'static [Self];
    /// (eʳ − 1 − r)/r² on |r| ≤ ½ ln 2.
    const EXP: &'static [Self];
    /// (2 atanh √z/√z − 2)/z on 0 ≤ z ≤ 1/9.
    const LOG: &'static [Self];
    /// π/2 in three pieces, of which the multiples up to `FAR` are exact.
    const HALF_PI: [Self; 3];
    /// ln 2 in two pieces, of which the multiples in use are exact.
    const LN_2: [Self; 2];
    /// 2/π.
    const TWO_OVER_PI: Self;
    /// 1/ln 2.
    const LOG2_E: Self;
    /// Argument beyond which the standard library takes the sine.
    const FAR: Self;
    /// Largest |x| of eˣ; beyond it is held.
    const HELD: Self;
    /// The nearest number of this kind.
    fn of(x: f64) -> Self;
    /// Converts to double precision.
    fn double(self) -> f64;
}

impl Float for f32 {
    const SIN: &'static [f32] =
        &[-0.166666646563107068, 0.00833274710437289478, -0.00019587639035792598];
    const COS: &'static [f32] =
        &[0.0416666646534872881, -0.00138883018672701415, 0.0000245476897093822079];
    const EXP: &'static [f32] = &[
        0.5,
        0.166665768459939763,
        0.0416665544376859389,
        0.00836320297157585495,
        0.0013926213466332443,
    ];
    const LOG: &'static [f32] = &[
        0.666666673239750094,
        0.399997050790086544,
        0.285924260746682632,
        0.217054270728385662,
        0.232302556068963591,
    ];
    const HALF_PI: [f32; 3] = [1.5703125, 0.0004837512969970703125, 7.549789954891882169163975e-8];
    const LN_2: [f32; 2] = [0.693115234375, 0.00003194618494530941723212146];
    const TWO_OVER_PI: f32 = core::f32::consts::FRAC_2_PI;
    const LOG2_E: f32 = core::f32::consts::LOG2_E;
    const FAR: f32 = 8192.0;
    const HELD: f32 = 87.0;

    #[inline]
    fn of(x: f64) -> Self {
        x as f32
    }

    #[inline]
    fn double(self) -> f64 {
        self.into()
    }
}

impl Float for f64 {
    const SIN: &'static [f64] = &[
        -0.166666666666666667,
        0.00833333333333333148,
        -0.00019841269841265041,
        2.75573192193205751e-6,
        -2.50521062259927858e-8,
        1.60585305963902429e-10,
        -7.58663686776649696e-13,
    ];
    const COS: &'static [f64] = &[
        0.0416666666666666654,
        -0.00138888888888873898,
        0.0000248015872987543983,
        -2.75573172658766157e-7,
        2.08761450491082804e-9,
        -1.13825446234042903e-11,
    ];
    const EXP: &'static [f64] = &[
        0.5,
        0.16666666666666671,
        0.0416666666666666698,
        0.00833333333332611205,
        0.00138888888888837318,
        0.000198412698749012592,
        0.0000248015873256053228,
        2.75572552979696444e-6,
        2.75572735701021397e-7,
        2.51052595384484934e-8,
        2.0914717341716376e-9,
    ];
    const LOG: &'static [f64] = &[
        0.666666666666666667,
        0.4,
        0.28571428571428562,
        0.222222222222243801,
        0.181818181815600066,
        0.153846154030884387,
        0.133333324787485619,
        0.117647326467196465,
        0.105257337027579158,
        0.095326828034928533,
        0.0860146667427542827,
        0.0867760619972483971,
        0.0430097656468831377,
        0.147453895986446899,
    ];
    const HALF_PI: [f64; 3] = [
        1.57079632673412561416625976563,
        6.07710050630396597659554913662e-11,
        2.02226624879595073239947791688e-21,
    ];
    const LN_2: [f64; 2] = [0.69314718055829871445894241333, 1.6465949582897081280984430755e-12];
    const TWO_OVER_PI: f64 = core::f64::consts::FRAC_2_PI;
    const LOG2_E: f64 = core::f64::consts::LOG2_E;
    const FAR: f64 = 1_000_000.0;
    const HELD: f64 = 708.0;

    #[inline]
    fn of(x: f64) -> Self {
        x
    }

    #[inline]
    fn double(self) -> f64 {
        self
    }
}

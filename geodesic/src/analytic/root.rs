//! Roots of a function of one variable between two points.

/// The root of `f` between `a` and `b`, to the last bits: inverse quadratic interpolation
/// where it is safe, else bisection (Chandrupatla 1997, Adv. Eng. Softw. 28, 145). Where f
/// has no change of sign, the end at which it is smaller: a root at an end, but
/// for rounding.
pub(crate) fn find_root(mut a: f64, mut b: f64, f: impl Fn(f64) -> f64) -> f64 {
    let (mut fa, mut fb) = (f(a), f(b));
    if fa * fb >= 0.0 {
        return if fa.abs() < fb.abs() { a } else { b };
    }
    let (mut c, mut fc);
    let mut t = 0.5;
    for _ in 0..200 {
        let x = a + t * (b - a);
        let fx = f(x);
        if (fx > 0.0) == (fa > 0.0) {
            (c, fc) = (a, fa);
        } else {
            (c, b, fc, fb) = (b, a, fb, fa);
        }
        (a, fa) = (x, fx);
        let (best, value) = if fa.abs() < fb.abs() { (a, fa) } else { (b, fb) };
        let width = (b - a).abs();
        if value == 0.0 || width <= 2.0 * f64::EPSILON * best.abs() {
            return best;
        }
        let least = (f64::EPSILON * best.abs() / width).min(0.5);
        t = next_fraction([a, b, c], [fa, fb, fc]).clamp(least, 1.0 - least);
    }
    if fa.abs() < fb.abs() { a } else { b }
}

/// Returns the next place between a (0) and b (1).
fn next_fraction([a, b, c]: [f64; 3], [fa, fb, fc]: [f64; 3]) -> f64 {
    let xi = (a - b) / (c - b);
    let phi = (fa - fb) / (fc - fb);
    let inverse_is_monotonic = phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi;
    if !inverse_is_monotonic {
        return 0.5;
    }
    let t = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb);
    if t.is_finite() { t } else { 0.5 }
}

#[cfg(test)]
mod tests {
    use super::find_root;

    #[test]
    fn exact_roots() {
        assert_eq!(find_root(0.0, 2.0, |x| x * x - 2.0), 2f64.sqrt());
        assert!(find_root(5.0, -1.0, |x| x * x * x).abs() < 1e-50);
        let steep = find_root(0.0, 1.0, |x| (x - 0.3) * (1e-6 + (x - 0.3).abs()));
        assert!((steep - 0.3).abs() < 1e-15);
    }

    #[test]
    fn a_root_at_an_end_may_be_missed_by_rounding() {
        assert_eq!(find_root(1.0, 2.0, |x| 1.0 - x), 1.0);
        assert_eq!(find_root(1.0, 2.0, |x| x - 1.0 + 1e-16), 1.0);
    }
}

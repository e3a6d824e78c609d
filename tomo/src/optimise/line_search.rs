//! A step length that meets the strong Wolfe conditions (Nocedal & Wright 2006, algorithms 3.5, 3.6).

/// Value and slope of the objective along the direction.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    pub length: f64,
    pub value: f64,
    pub slope: f64,
}

/// Part of the linear decrease that is enough: this and the next number are those for quasi-Newton steps (Nocedal & Wright
/// 2006, section 3.1).
const DECREASE: f64 = 1e-4;
/// Part of the first slope that may be left.
const CURVATURE: f64 = 0.9;
/// Evaluations that a step may take.
const EVALUATIONS: usize = 20;

fn decreases(start: Point, at: Point) -> bool {
    at.value <= start.value + DECREASE * at.length * start.slope
}

fn flat(start: Point, at: Point) -> bool {
    at.slope.abs() <= CURVATURE * start.slope.abs()
}

/// Searches from `start` (length 0, negative slope), trying `first` first. The last point that was
/// evaluated is the one returned.
pub fn search(start: Point, first: f64, mut evaluate: impl FnMut(f64) -> Point) -> Option<Point> {
    let (mut before, mut length) = (start, first);
    for used in 1..=EVALUATIONS {
        let at = evaluate(length);
        let left = EVALUATIONS - used;
        // The loss is not defined so far out: back towards a point where it is.
        if !at.value.is_finite() || !at.slope.is_finite() {
            length = 0.5 * (before.length + at.length);
            continue;
        }
        if !decreases(start, at) || (used > 1 && at.value >= before.value) {
            return zoom(start, before, at, left, evaluate);
        }
        if flat(start, at) {
            return Some(at);
        }
        if at.slope >= 0.0 {
            // Beyond a minimum, and lower than the point before: the better end comes first.
            return zoom(start, at, before, left, evaluate);
        }
        (before, length) = (at, 2.5 * at.length);
    }
    None
}

/// Searches between `low`, the better end, and `high`.
fn zoom(
    start: Point,
    mut low: Point,
    mut high: Point,
    evaluations: usize,
    mut evaluate: impl FnMut(f64) -> Point,
) -> Option<Point> {
    for _ in 0..evaluations {
        let at = evaluate(between(low, high));
        // A loss that is not a number decreases nothing, and becomes the far end.
        if !decreases(start, at) || at.value >= low.value {
            high = at;
        } else {
            if flat(start, at) {
                return Some(at);
            }
            if at.slope * (high.length - low.length) >= 0.0 {
                high = low;
            }
            low = at;
        }
    }
    // Enough of a decrease will do. It is evaluated again, since the caller takes the gradient
    // of the last point.
    let last = evaluate(low.length);
    (low.length > 0.0 && decreases(start, last)).then_some(last)
}

/// Minimum of the cubic through both ends, kept a tenth away from them.
fn between(a: Point, b: Point) -> f64 {
    let width = b.length - a.length;
    // Nocedal & Wright 2006, equation 3.59.
    let d1 = a.slope + b.slope - 3.0 * (a.value - b.value) / (a.length - b.length);
    let d2 = (d1 * d1 - a.slope * b.slope).sqrt() * width.signum();
    let part = 1.0 - (b.slope + d2 - d1) / (b.slope - a.slope + 2.0 * d2);
    // In the middle where an end is not finite or the cubic has no minimum; elsewhere away from
    // both ends, so that the interval always shrinks.
    let part = if part.is_finite() { part.clamp(0.1, 0.9) } else { 0.5 };
    a.length + part * width
}

//! One fall from far away: radius and azimuth as functions of time. All matter of a steady flow has the same, but for
//! when and where it began, so that to carry matter along is to read this table twice.

use kerrlight_geodesic::{Dual, quadrature::gauss_legendre};

/// Radius, dr/dt and Ω somewhere on the way.
pub(super) type Point<N> = [N; 3];

/// A number with its derivative along a way.
pub(super) type Along = Dual<f64, 1>;

/// A way from the first to the last of some marks; where it is between them comes from a smooth function.
pub(super) struct Way<'a> {
    /// Growing or falling.
    pub marks: Vec<f64>,
    /// The point at a mark, with its derivative along the way.
    pub at: Box<dyn Fn(Along) -> Point<Along> + 'a>,
    /// True if rates have no derivative at the first mark, where dr/dt grows like a root.
    pub rough: bool,
}

/// A mark with what is known there.
#[derive(Clone, Copy)]
struct Knot {
    radius: f64,
    /// First and second derivative of the radius with respect to time.
    motion: [f64; 2],
    /// The same of the azimuth.
    turn: [f64; 2],
}

/// Interval between two marks: quintic polynomials of the part of the time that has passed.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cell {
    start: f64,
    per_time: f64,
    radius: [f64; 6],
    azimuth: [f64; 6],
}

/// Radius (M) and azimuth (radians) of falling or rising matter by time (M).
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// Begin of each cell, and end of the last one.
    times: Vec<f64>,
    /// Radii then.
    radii: Vec<f64>,
    cells: Vec<Cell>,
    /// Radius, azimuth and angular velocity at both ends.
    ends: [Point<f64>; 2],
}

impl Trajectory {
    /// Joins ways that follow each other in time; time and azimuth are 0 where way number `origin` begins.
    pub(super) fn new(ways: &[Way<'_>], origin: usize) -> Self {
        let rule = gauss_legendre(8);
        let (mut spans, mut first) = (Vec::new(), 0);
        for (k, way) in ways.iter().enumerate() {
            if k == origin {
                first = spans.len();
            }
            spans.extend(way.marks.windows(2).enumerate().map(|(k, marks)| {
                let steps = way.steps([marks[0], marks[1]], &rule);
                let ends = [way.knot(marks[0]), way.knot(marks[1])];
                Span { steps, ends, rough: way.rough && k == 0 }
            }));
        }
        Self::of(&spans, first)
    }

    fn of(spans: &[Span], first: usize) -> Self {
        let mut starts = vec![[0.0; 2]; spans.len() + 1];
        // Sums from the origin on: times are exact where they are short.
        for k in first..spans.len() {
            starts[k + 1] = [0, 1].map(|c| starts[k][c] + spans[k].steps[c]);
        }
        for k in (0..first).rev() {
            starts[k] = [0, 1].map(|c| starts[k + 1][c] - spans[k].steps[c]);
        }
        let cells: Vec<Cell> =
            spans.iter().zip(&starts).map(|(span, start)| span.cell(*start)).collect();
        let radii = spans.iter().map(|span| span.ends[0].radius);
        let last = spans.last().map(|span| span.ends[1].radius);
        let end = |start: [f64; 2], knot: &Knot| [knot.radius, start[1], knot.turn[0]];
        let ends = [
            end(starts[0], &spans[0].ends[0]),
            end(starts[spans.len()], &spans[spans.len() - 1].ends[1]),
        ];
        Self {
            times: starts.iter().map(|start| start[0]).collect(),
            radii: radii.chain(last).collect(),
            cells,
            ends,
        }
    }

    /// Radius and azimuth at a time. Before the first and after the last time matter stays at its radius and turns.
    pub fn at(&self, time: f64) -> [f64; 2] {
        let number = self.times.partition_point(|start| *start <= time);
        let beyond = |[radius, azimuth, rate]: Point<f64>, since: f64| {
            [radius, azimuth + rate * (time - since)]
        };
        match (number.checked_sub(1), self.times.last()) {
            (None, _) => beyond(self.ends[0], self.times[0]),
            (Some(_), Some(last)) if number > self.cells.len() => beyond(self.ends[1], *last),
            (Some(k), _) => self.cells[k].at(time),
        }
    }

    /// Returns the time at which matter is at a radius; none if it never is.
    pub fn time_at(&self, radius: f64) -> Option<f64> {
        let falls = self.radii.first() > self.radii.last();
        let passed = |start: &f64| if falls { *start >= radius } else { *start <= radius };
        let k = self.radii.partition_point(passed).checked_sub(1)?;
        let cell = self.cells.get(k)?;
        Some(cell.time_at(radius, [self.times[k], self.times[k + 1]]))
    }
}

/// The numbers of a [`Trajectory`], for devices.
pub struct Table {
    /// Cells: begin, cells per time, and coefficients of radius and azimuth.
    pub cells: Vec<(f64, f64, [[f64; 6]; 2])>,
    /// End of the last cell.
    pub last: f64,
    /// Radius, azimuth and angular velocity at both ends.
    pub ends: [[f64; 3]; 2],
}

impl Trajectory {
    /// Its numbers.
    pub fn numbers(&self) -> Table {
        let numbers = |cell: &Cell| (cell.start, cell.per_time, [cell.radius, cell.azimuth]);
        Table {
            cells: self.cells.iter().map(numbers).collect(),
            last: self.times.last().copied().unwrap_or(0.0),
            ends: self.ends,
        }
    }

    /// The same with all angular velocities multiplied by a factor.
    pub fn turned(&self, factor: f64) -> Self {
        let cell = |cell: &Cell| Cell { azimuth: cell.azimuth.map(|x| factor * x), ..*cell };
        let end = |[radius, azimuth, rate]: Point<f64>| [radius, factor * azimuth, factor * rate];
        Self {
            cells: self.cells.iter().map(cell).collect(),
            ends: self.ends.map(end),
            ..self.clone()
        }
    }
}

impl Way<'_> {
    /// Time and azimuth between two marks.
    fn steps(&self, [from, to]: [f64; 2], rule: &[(f64, f64)]) -> [f64; 2] {
        rule.iter().fold([0.0; 2], |[time, azimuth], (place, weight)| {
            let mark = from + (to - from) * place;
            let [radius, fall, turn] = (self.at)(Along::parameter(mark, 0));
            // dt = dr/v.
            let step = radius.slope[0] * (weight * (to - from)) / fall.value;
            [time + step, azimuth + turn.value * step]
        })
    }

    fn knot(&self, mark: f64) -> Knot {
        let [radius, fall, turn] = (self.at)(Along::parameter(mark, 0));
        // d/dt = v/(dr/dmark) d/dmark.
        let per_mark = fall.value / radius.slope[0];
        Knot {
            radius: radius.value,
            motion: [fall.value, fall.slope[0] * per_mark],
            turn: [turn.value, turn.slope[0] * per_mark],
        }
    }
}

/// Interval between two marks.
struct Span {
    steps: [f64; 2],
    ends: [Knot; 2],
    rough: bool,
}

impl Span {
    fn cell(&self, [start, azimuth]: [f64; 2]) -> Cell {
        let ([time, turned], [a, b]) = (self.steps, self.ends);
        let azimuths = [azimuth, azimuth + turned];
        let (radius, azimuth) = if self.rough {
            // Too short for anything but a straight line to be seen.
            (line([a.radius, b.radius]), line(azimuths))
        } else {
            (
                quintic([a.radius, b.radius], [a.motion, b.motion], time),
                quintic(azimuths, [a.turn, b.turn], time),
            )
        };
        Cell { start, per_time: 1.0 / time, radius, azimuth }
    }
}

impl Cell {
    #[inline(always)]
    fn at(&self, time: f64) -> [f64; 2] {
        let part = (time - self.start) * self.per_time;
        let sum = |[a, b, c, d, e, f]: [f64; 6]| {
            a + part * (b + part * (c + part * (d + part * (e + part * f))))
        };
        [sum(self.radius), sum(self.azimuth)]
    }

    fn speed(&self, time: f64) -> f64 {
        let per_time = self.per_time;
        let part = (time - self.start) * per_time;
        let [_, b, c, d, e, f] = self.radius;
        per_time * (b + part * (2.0 * c + part * (3.0 * d + part * (4.0 * e + part * 5.0 * f))))
    }

    /// Solves by Newton's steps, halved where they would leave what is left of the cell.
    fn time_at(&self, radius: f64, [mut from, mut to]: [f64; 2]) -> f64 {
        let at = |time: f64| self.at(time)[0] - radius;
        let falls = at(from) > at(to);
        let mut time = 0.5 * (from + to);
        for _ in 0..60 {
            let miss = at(time);
            if (miss > 0.0) == falls {
                from = time
            } else {
                to = time
            }
            let speed = self.speed(time);
            let next = time - miss / speed;
            let next = if next > from && next < to { next } else { 0.5 * (from + to) };
            // To the rounding of the time, or of the radius.
            let of_radius = if speed == 0.0 { 0.0 } else { radius / speed.abs() };
            let rounding = f64::EPSILON * time.abs().max(of_radius);
            if (next - time).abs() <= rounding {
                return next;
            }
            time = next;
        }
        time
    }
}

fn line([a, b]: [f64; 2]) -> [f64; 6] {
    [a, b - a, 0.0, 0.0, 0.0, 0.0]
}

/// Coefficients of the polynomial with these values, slopes and curvatures at the ends of a time.
fn quintic(values: [f64; 2], slopes: [[f64; 2]; 2], time: f64) -> [f64; 6] {
    let [[v0, a0], [v1, a1]] = slopes.map(|[v, a]| [v * time, a * time * time * 0.5]);
    let rise = values[1] - values[0] - v0 - a0;
    let slope = v1 - v0 - 2.0 * a0;
    let bend = a1 - a0;
    [
        values[0],
        v0,
        a0,
        10.0 * rise - 4.0 * slope + bend,
        7.0 * slope - 15.0 * rise - 2.0 * bend,
        6.0 * rise - 3.0 * slope + bend,
    ]
}

//! Largest distance of a piece of a curved ray from its chord: a proven bound.
//!
//! With w = 1/r, the direction n on the unit sphere less its frame dragging, and Mino time τ,
//! the backward ray obeys
//!
//! n″ = −(K + 2a²u²) n + a²u ẑ,  w″ = A w + (3/2) B w² + 2C w³,  K = η + λ²,  A = a² − K,
//!
//! |n′|² = K + a²u², n·n′ = 0 and w′² = W = 1 + A w² + B w³ + C w⁴, u = cos θ.
//! In Mino time a straight ray is run through very unevenly; in σ with dσ = r² dτ it is not. For
//! y = r n
//!
//! dy/dσ = w n′ − w′ n,
//! d²y/dσ² = w² (w n″ − w″ n) = w³ {a²u ẑ − \[a²(1 + 2u²) + (3/2) B w + 2C w²\] n},
//!
//! since K and A leave nothing but a² behind: without hole and spin the ray is straight and run
//! through evenly. The braces are at most 5a²/2 + |(3/2) B w + 2C w²| (the part of a²u ẑ along n is
//! a²u², that across it at most a²/2), and
//! S² = |dy/dσ|² = 1 + a²(1 + u²) w² + B w³ + C w⁴.
//!
//! Frame dragging turns y about the axis by an angle D with dD/dσ = −f,
//! f(w) = a w³ (2 − aλw)/(1 − 2w + a²w²), which is what is left of dφ/dτ
//! ([`PathPoint::rates`]) without the orbital part. For x = R(D) y
//!
//! |d²x/dσ²| ≤ |d²y/dσ²| + 2|f| S + |df/dw| w² |w′| r + f² r ≤ M,   |w′| ≤ S.
//!
//! Every term, with absolute values of its coefficients, grows with w: M is taken at the largest
//! w of the piece. A curve with |d²x/dσ²| ≤ M stays within M (Δσ)²/8 of its chord (the
//! error of linear interpolation), and Δσ = ∫ r² dτ ≤ r_max² Δτ.

use kerrlight_geodesic::{Kerr, Path, PathPoint, Ray};

/// The bound for one ray.
#[derive(Debug, Clone, Copy)]
pub struct ChordBound {
    spin: f64,
    /// |aλ|.
    drag: f64,
    /// |B| and |C|.
    cubic: f64,
    quartic: f64,
    /// Mino time and w of the radial turning point.
    turning: Option<[f64; 2]>,
    /// Largest contribution of the tracer's own error: times r (1 + r/b).
    slack: f64,
    /// 1/b.
    inverse_impact: f64,
}

/// Least Δ/r²: below it a piece winds around the hole so much that its chord says nothing.
const NEXT_TO_HORIZON: f64 = 0.02;

/// Errors of positions on a path, in units of the tracer's tolerance for a local error.
const ERRORS: f64 = 4.0;

impl ChordBound {
    /// The bound for a ray that was traced into `path` with local errors below `tolerance`.
    pub fn new(hole: &Kerr, ray: &Ray, path: &Path, tolerance: f64) -> Self {
        let [_, cubic, quartic] = ray.potential.coefficients;
        ChordBound {
            spin: hole.spin().abs(),
            drag: (hole.spin() * ray.lambda).abs(),
            cubic: cubic.abs(),
            quartic: quartic.abs(),
            turning: path.turning_point().map(|(time, r)| [time, 1.0 / r]),
            slack: ERRORS * tolerance,
            inverse_impact: 1.0 / ray.angular.abs().sqrt().max(1.0),
        }
    }

    /// The least and the largest w between two points: at its ends or where the ray turns.
    fn extent(&self, [start, end]: [&PathPoint; 2]) -> [f64; 2] {
        let (a, b) = (start.inverse_radius, end.inverse_radius);
        let (least, most) = (a.min(b), a.max(b));
        match self.turning {
            Some([time, w]) if start.mino_time < time && time < end.mino_time => {
                [least.min(w), most.max(w)]
            }
            _ => [least, most],
        }
    }

    /// Largest distance from the chord between two points of the ray; infinite next to the
    /// horizon of a spinning hole and at infinity.
    pub fn distance(&self, ends: [&PathPoint; 2]) -> f64 {
        self.sagitta(ends) + self.error(self.reach(ends))
    }

    /// The same without what the tracer's error adds.
    pub fn sagitta(&self, ends: [&PathPoint; 2]) -> f64 {
        let [least, most] = self.extent(ends);
        let step = (ends[1].mino_time - ends[0].mino_time) / (least * least);
        0.125 * self.curvature(most) * step * step
    }

    /// Returns the largest contribution of the tracer's own error at radius r.
    pub fn error(&self, r: f64) -> f64 {
        self.slack * r * (1.0 + r * self.inverse_impact)
    }

    /// Returns whether part of the piece is so close to the horizon that chords say nothing.
    pub fn winds(&self, ends: [&PathPoint; 2]) -> bool {
        self.spin > 0.0 && self.gap(self.extent(ends)[1]) < NEXT_TO_HORIZON
    }

    /// Largest radius between two points.
    pub fn reach(&self, ends: [&PathPoint; 2]) -> f64 {
        1.0 / self.extent(ends)[0]
    }

    /// Δ/r².
    fn gap(&self, w: f64) -> f64 {
        1.0 - w * (2.0 - self.spin * self.spin * w)
    }

    /// M: a bound of |d²x/dσ²| for all points at or below w.
    fn curvature(&self, w: f64) -> f64 {
        let (a2, w2) = (self.spin * self.spin, w * w);
        let bend = 1.5 * self.cubic * w + 2.0 * self.quartic * w2;
        let flat = w2 * w * (2.5 * a2 + bend);
        if self.spin == 0.0 {
            return flat;
        }
        let gap = self.gap(w);
        if gap <= 0.0 {
            return f64::INFINITY;
        }
        // cos²θ ≤ 1 in S².
        let speed = (1.0 + w2 * (2.0 * a2 + w * (self.cubic + w * self.quartic))).sqrt();
        let pull = 2.0 + self.drag * w;
        let f = self.spin * w2 * w * pull / gap;
        // |d(Δ/r²)/dw| = 2 (1 − a²w) ≤ 2.
        let slope =
            self.spin * w2 * ((6.0 + 4.0 * self.drag * w) / gap + 2.0 * w * pull / (gap * gap));
        flat + speed * (2.0 * f + w * slope) + f * f / w.max(f64::MIN_POSITIVE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kerrlight_geodesic::vector::{difference, dot, norm};
    use kerrlight_geodesic::{Inclination, Observer, Quantities, Tracer};

    fn distance_to_chord(x: [f64; 3], [a, b]: [[f64; 3]; 2]) -> f64 {
        let (d, s) = (difference(b, a), difference(x, a));
        let t = (dot(s, d) / dot(d, d)).clamp(0.0, 1.0);
        let miss: [f64; 3] = core::array::from_fn(|k| s[k] - t * d[k]);
        norm(miss)
    }

    /// Sampled distances of pieces of many sizes stay below the bound, which is no idle one:
    /// on the average piece it is not far above.
    #[test]
    fn exact_bound_holds_on_pieces_of_every_size() {
        let (mut ratios, mut count) = (0.0, 0.0);
        for spin in [0.0, 0.5, 0.9, -0.9, 1.0] {
            let hole = Kerr::new(spin).unwrap();
            for degrees in [1.0, 60.0, 90.0] {
                let observer = Observer::at_infinity(Inclination::from_degrees(degrees).unwrap());
                for (alpha, beta) in
                    [(3.0, 1.0), (-5.5, 0.5), (7.0, -2.0), (-2.0, 12.0), (0.1, 4.9)]
                {
                    let ray = observer.ray(&hole, alpha, beta).unwrap();
                    let mut path = Path::new();
                    Tracer::new(1e-12).unwrap().trace(&hole, &ray, Quantities::ALL, &mut path);
                    let bound = ChordBound::new(&hole, &ray, &path, 0.0);
                    let total = path.mino_total();
                    for pieces in [7u32, 25, 100, 400] {
                        for k in 1..pieces - 1 {
                            let at =
                                |x: f64| path.at(total * (f64::from(k) + x) / f64::from(pieces));
                            let (start, end) = (at(0.0), at(1.0));
                            let limit = bound.distance([&start, &end]);
                            let chord = [start.cartesian(), end.cartesian()];
                            let worst = (1..16)
                                .map(|j| {
                                    distance_to_chord(at(f64::from(j) / 16.0).cartesian(), chord)
                                })
                                .fold(0.0, f64::max);
                            let rounding = 1e-11 * bound.reach([&start, &end]).powi(2);
                            assert!(
                                worst <= limit + rounding,
                                "a = {spin}, i = {degrees}, ({alpha}, {beta}): {worst:e} {limit:e}"
                            );
                            if spin == 0.0 && worst > 1e-6 {
                                ratios += (limit / worst).ln();
                                count += 1.0;
                            }
                        }
                    }
                }
            }
        }
        let typical = f64::exp(ratios / count);
        assert!(typical < 5.0, "{typical}");
    }
}

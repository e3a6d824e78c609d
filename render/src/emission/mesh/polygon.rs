//! Polygons cut into triangles.

use core::f64::consts::TAU;
use kerrlight_geodesic::vector::{cross, difference, dot, norm};

/// Reason why a polygon cannot be cut.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(super) enum Uncut {
    /// Its outline crosses itself.
    #[error("the outline of the polygon crosses itself")]
    Crosses,
    /// It is not convex and has too many corners.
    #[error("the polygon is not convex and has more than {MOST_CORNERS} corners")]
    Corners,
}

/// Triangles of a polygon, as numbers of its corners.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Cut {
    pub triangles: Vec<[usize; 3]>,
    /// True if its corners lie in one plane within [`FLAT`] of its size.
    pub flat: bool,
}

/// Corners of a polygon that is not convex, at most: the work grows with their square.
const MOST_CORNERS: usize = 4096;

/// Largest distance of a corner from the mean plane of a flat polygon, in units of its size.
const FLAT: f64 = 0.01;

/// Doubled areas below this part of the polygon's are those of corners on one line.
const NO_AREA: f64 = 1e-13;

type Point = [f64; 2];

/// Cuts a polygon: a fan from its first corner where that is right, as for convex ones, ears elsewhere (Meisters 1975, Am.
/// Math. Mon. 82, 648). One that is not flat is cut as its projection along its mean normal (Newell's); without an area
/// there is nothing to cut.
pub(super) fn cut(corners: &[[f64; 3]]) -> Result<Cut, Uncut> {
    if corners.len() == 3 {
        return Ok(Cut { triangles: vec![[0, 1, 2]], flat: true });
    }
    // From the first corner: far from the origin areas would lose their digits.
    let edges: Vec<[f64; 3]> = corners.iter().map(|x| difference(*x, corners[0])).collect();
    let size2 = edges.iter().map(|x| dot(*x, *x)).fold(0.0, f64::max);
    let normal = (1..edges.len() - 1).map(|k| cross(edges[k], edges[k + 1]));
    let normal = normal.fold([0.0; 3], |sum, x| [sum[0] + x[0], sum[1] + x[1], sum[2] + x[2]]);
    let length = norm(normal);
    // Coordinates that are no numbers are refused with the finished mesh.
    if !(size2 * length).is_finite() {
        return Ok(Cut { triangles: fan(corners.len()), flat: true });
    }
    if length <= NO_AREA * size2 {
        let on_a_line = |k: usize| norm(cross(edges[k], edges[k + 1])) <= NO_AREA * size2;
        let nothing = (1..edges.len() - 1).all(on_a_line);
        // Without an area either all corners lie on one line, or parts of both signs cancel.
        return if nothing {
            Ok(Cut { triangles: vec![], flat: true })
        } else {
            Err(Uncut::Crosses)
        };
    }
    let height = edges.iter().map(|x| (dot(*x, normal) / length).abs()).fold(0.0, f64::max);
    let flat = height <= FLAT * size2.sqrt();
    let points = projected(&edges, normal);
    Ok(Cut { triangles: plane(&points)?, flat })
}

/// The polygon along its largest axis, counterclockwise.
fn projected(corners: &[[f64; 3]], normal: [f64; 3]) -> Vec<Point> {
    let axis = (0..3).max_by(|i, j| normal[*i].abs().total_cmp(&normal[*j].abs())).unwrap_or(2);
    let (mut u, mut v) = ((axis + 1) % 3, (axis + 2) % 3);
    if normal[axis] < 0.0 {
        core::mem::swap(&mut u, &mut v);
    }
    corners.iter().map(|x| [x[u], x[v]]).collect()
}

fn fan(corners: usize) -> Vec<[usize; 3]> {
    (1..corners - 1).map(|k| [0, k, k + 1]).collect()
}

/// Twice the area of a triangle, above 0 if it is counterclockwise.
fn area(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

fn plane(points: &[Point]) -> Result<Vec<[usize; 3]>, Uncut> {
    let parts = || (1..points.len() - 1).map(|k| (k, area(points[0], points[k], points[k + 1])));
    let nothing = NO_AREA * parts().map(|(_, part)| part).sum::<f64>();
    if parts().all(|(_, part)| part >= -nothing) {
        // Parts of one sign that sweep a whole turn wind around the first corner.
        let angle = |k: usize, part: f64| {
            let [p, q] = [k, k + 1].map(|k| [0, 1].map(|c: usize| points[k][c] - points[0][c]));
            part.max(0.0).atan2(p[0] * q[0] + p[1] * q[1])
        };
        let swept: f64 = parts().map(|(k, part)| angle(k, part)).sum();
        return if swept < TAU { Ok(fan(points.len())) } else { Err(Uncut::Crosses) };
    }
    if points.len() > MOST_CORNERS {
        return Err(Uncut::Corners);
    }
    if crosses(points) {
        return Err(Uncut::Crosses);
    }
    ears(points, nothing).ok_or(Uncut::Crosses)
}

/// Returns whether two sides cross between their ends.
fn crosses(points: &[Point]) -> bool {
    let count = points.len();
    let side = |k: usize| [points[k], points[(k + 1) % count]];
    let apart = |[a, b]: [Point; 2], [p, q]: [Point; 2]| area(a, b, p) * area(a, b, q) >= 0.0;
    (0..count).any(|i| (0..i).any(|j| !apart(side(i), side(j)) && !apart(side(j), side(i))))
}

/// Cuts off one corner after the other whose triangle holds no other corner; `None` if there is no such corner.
fn ears(points: &[Point], nothing: f64) -> Option<Vec<[usize; 3]>> {
    let mut rest: Vec<usize> = (0..points.len()).collect();
    let mut triangles = Vec::with_capacity(points.len() - 2);
    let (mut at, mut tried) = (0, 0);
    while rest.len() > 3 {
        let count = rest.len();
        let ear = [rest[(at + count - 1) % count], rest[at], rest[(at + 1) % count]];
        if is_ear(ear, &rest, points, nothing) {
            triangles.push(ear);
            rest.remove(at);
            (at, tried) = (at % rest.len(), 0);
        } else {
            (at, tried) = ((at + 1) % count, tried + 1);
            if tried == count {
                return None;
            }
        }
    }
    triangles.push([rest[0], rest[1], rest[2]]);
    Some(triangles)
}

fn is_ear(ear: [usize; 3], rest: &[usize], points: &[Point], nothing: f64) -> bool {
    let [a, b, c] = ear.map(|k| points[k]);
    let own = area(a, b, c);
    if own <= nothing {
        // A corner of a straight side may go at once; one that turns inward may not.
        return own >= -nothing;
    }
    let inside = |k: &usize| {
        let p = points[*k];
        // By place, since an outline may pass through a corner twice.
        let corner = p == a || p == b || p == c;
        !corner && area(a, b, p) >= 0.0 && area(b, c, p) >= 0.0 && area(c, a, p) >= 0.0
    };
    !rest.iter().any(inside)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(points: &[Point]) -> Vec<[f64; 3]> {
        // In a tilted plane, turned about no axis of the coordinates.
        points.iter().map(|[u, v]| [3.0 + 0.6 * u, 0.8 * u - 0.6 * v, 0.48 * u + 0.8 * v]).collect()
    }

    fn covers(triangles: &[[usize; 3]], points: &[Point], p: Point) -> usize {
        let holds = |t: &&[usize; 3]| {
            let [a, b, c] = t.map(|k| points[k]);
            let signs = [area(a, b, p), area(b, c, p), area(c, a, p)].map(f64::signum);
            area(a, b, c) != 0.0 && signs[0] == signs[1] && signs[1] == signs[2]
        };
        triangles.iter().filter(holds).count()
    }

    /// Even–odd rule.
    fn inside(points: &[Point], [x, y]: Point) -> bool {
        let count = points.len();
        let crossed = |k: &usize| {
            let ([x0, y0], [x1, y1]) = (points[*k], points[(k + 1) % count]);
            (y0 > y) != (y1 > y) && x < x0 + (y - y0) / (y1 - y0) * (x1 - x0)
        };
        (0..count).filter(crossed).count() % 2 == 1
    }

    /// Every point of a polygon lies in one triangle, every other point in none, whichever corner is the first and
    /// whichever way the polygon is run through.
    #[test]
    fn exact_triangles_cover_the_polygon_once() {
        let comb = (0..40)
            .map(|k| [f64::from(k), if k % 2 == 0 { 8.0 } else { 1.0 + 0.1 * f64::from(k) }]);
        let comb: Vec<Point> = comb.chain([[39.0, -3.0], [0.0, -3.0]]).collect();
        let star = |k: u32| {
            let (r, phi) = ([10.0, 3.0][k as usize % 2], TAU * f64::from(k) / 18.0);
            [r * phi.cos(), r * phi.sin()]
        };
        let spiral = |k: i32| {
            let turn = if k < 30 { k } else { 59 - k };
            let (r, phi) =
                (f64::from(turn) + if k < 30 { 2.0 } else { 4.0 }, 0.35 * f64::from(turn));
            [r * phi.cos(), r * phi.sin()]
        };
        let polygons: [Vec<Point>; 6] = [
            vec![
                [-10.0, -10.0],
                [10.0, -10.0],
                [10.0, 10.0],
                [8.0, 10.0],
                [8.0, -8.0],
                [-8.0, -8.0],
                [-8.0, 10.0],
                [-10.0, 10.0],
            ],
            // A notch, corners on one line, a corner twice.
            vec![[0.0, 0.0], [9.0, 3.0], [12.0, 0.0], [10.0, 10.0]],
            vec![
                [0.0, 0.0],
                [4.0, 0.0],
                [8.0, 0.0],
                [8.0, 8.0],
                [4.0, 8.0],
                [4.0, 3.0],
                [4.0, 3.0],
                [3.0, 8.0],
                [0.0, 8.0],
            ],
            comb,
            (0..18).map(star).collect(),
            (0..60).map(spiral).collect(),
        ];
        for mut polygon in polygons {
            for turn in 0..2 * polygon.len() {
                polygon.rotate_left(1);
                if turn == polygon.len() {
                    polygon.reverse();
                }
                let cut = cut(&flat(&polygon)).unwrap();
                assert!(cut.flat && cut.triangles.len() == polygon.len() - 2);
                for k in 0..200u32 {
                    let p = [0.7548776662, 0.5698402910]
                        .map(|x: f64| 90.0 * ((f64::from(k) * x).fract() - 0.4) + 0.013);
                    let p = if k % 2 == 0 { p } else { p.map(|x| 0.25 * x) };
                    let expected = usize::from(inside(&polygon, p));
                    assert_eq!(covers(&cut.triangles, &polygon, p), expected, "{polygon:?} {p:?}");
                }
            }
        }
    }

    #[test]
    fn exact_convex_polygons_are_fans() {
        let circle = |k: u32| [(0.3 * f64::from(k)).cos(), (0.3 * f64::from(k)).sin()];
        let circle: Vec<Point> = (0..20).map(circle).collect();
        assert_eq!(cut(&flat(&circle)).unwrap().triangles, fan(20));
    }

    #[test]
    fn exact_outlines_that_cross_are_refused() {
        let star = |k: u32| {
            [(2.4 * f64::from(k) * TAU / 6.0).cos(), (2.4 * f64::from(k) * TAU / 6.0).sin()]
        };
        let pentagram: Vec<Point> = (0..5).map(star).collect();
        assert_eq!(cut(&flat(&pentagram)), Err(Uncut::Crosses));
        let bows = [
            [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]],
            [[0.0, 0.0], [3.0, 3.0], [3.0, 0.0], [0.0, 1.0]],
        ];
        for bow in bows {
            assert_eq!(cut(&flat(&bow)), Err(Uncut::Crosses));
        }
        let line: Vec<Point> = (0..5).map(|k| [f64::from(k), 2.0 * f64::from(k)]).collect();
        assert_eq!(cut(&flat(&line)).unwrap().triangles, Vec::<[usize; 3]>::new());
        let bent = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.3], [1.0, 1.0, 0.0], [0.0, 1.0, 0.3]];
        let cut = cut(&bent).unwrap();
        assert!(!cut.flat && cut.triangles == fan(4));
    }
}

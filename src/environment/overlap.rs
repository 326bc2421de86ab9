//! Where the edges of a cube map's texels cross the texels of a panorama: what both directions of exact resampling share
//! ([`super::area_average`] and [`super::from_cube`]).
//!
//! A cube texel's edges are great circles, on which y = a cos ψ / √(b² + a² cos² ψ), ψ = φ − φ₀: where they cross the rows
//! and columns of a panorama, and ∫ y dψ in between, are closed forms.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

use super::cube::edge;

/// Azimuth of the middle of each face beside the equator, in storage order (the faces at the poles have none).
pub(super) const CENTRES: [f64; 6] = [0.0, PI, 0.0, 0.0, FRAC_PI_2, -FRAC_PI_2];

/// Rows that the face at a pole reaches into, its corners being 54.7° away from it.
pub(super) fn cap_rows(height: usize) -> usize {
    let rows = (height as f64 * (1.0 / 3f64.sqrt()).acos() / PI) as usize + 2;
    rows.min(height)
}

/// A great circle that is no meridian: tan(elevation) = (a / b) cos(φ − centre), b > 0.
pub(super) struct Circle {
    a: f64,
    b: f64,
    /// 1/√(a² + b²).
    scale: f64,
    centre: f64,
}

/// The circle of the line at distance `t` from the middle of the +Y face, running along v (or along u), and the sign with
/// which φ runs along it; through the middle it is a meridian, and none.
pub(super) fn top_circle(t: f64, along_v: bool) -> Option<(Circle, f64)> {
    let (centres, turn) = if along_v { ([0.0, PI], 1.0) } else { ([FRAC_PI_2, -FRAC_PI_2], -1.0) };
    match t {
        0.0 => None,
        _ if t > 0.0 => Some((Circle::new(1.0, t, centres[0]), turn)),
        _ => Some((Circle::new(1.0, -t, centres[1]), -turn)),
    }
}

/// A place on a circle: ψ, sin ψ and cos ψ.
#[derive(Debug, Clone, Copy)]
struct Place {
    psi: f64,
    sin: f64,
    cos: f64,
}

impl Place {
    fn at(psi: f64) -> Self {
        let (sin, cos) = psi.sin_cos();
        Self { psi, sin, cos }
    }

    /// At tan ψ = t / b, b > 0.
    fn at_tangent(t: f64, b: f64) -> Self {
        let r = (t * t + b * b).sqrt();
        Self { psi: (t / b).atan(), sin: t / r, cos: b / r }
    }
}

impl Circle {
    pub(super) fn new(a: f64, b: f64, centre: f64) -> Self {
        Self { a, b, scale: 1.0 / (a * a + b * b).sqrt(), centre }
    }

    /// sin and cos of ∫₀^ψ y dψ, that is asin(a sin ψ / √(a² + b²)).
    #[inline(always)]
    fn height(&self, place: Place) -> [f64; 2] {
        let (a, b) = (self.a, self.b);
        [a * place.sin * self.scale, (b * b + a * a * place.cos * place.cos).sqrt() * self.scale]
    }
}

/// asin: most arcs within a texel are short.
fn arcsine(x: f64) -> f64 {
    /// Where the next term, 231/13312 x¹³, is below half an ulp.
    const SHORT: f64 = 0.06;
    if x.abs() > SHORT {
        return x.clamp(-1.0, 1.0).asin();
    }
    let x2 = x * x;
    let tail = 35.0 / 1152.0 + x2 * (63.0 / 2816.0);
    x + x * x2 * (1.0 / 6.0 + x2 * (3.0 / 40.0 + x2 * (5.0 / 112.0 + x2 * tail)))
}

/// What one panorama texel holds of an arc.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part {
    pub column: usize,
    pub row: usize,
    /// ∫ dφ, signed.
    pub length: f64,
    /// ∫ (y_top − y) dφ in parts of the row's height, signed: how much of the texel lies between the arc and its upper edge.
    pub depth: f64,
}

/// Rows and columns of a panorama, counted from a pole.
pub(super) struct Grid {
    width: usize,
    rows: usize,
    /// y of the edges between rows, measured towards the pole.
    y: Vec<f64>,
    /// tan(elevation) of the same edges.
    slope: Vec<f64>,
    /// Rows of the panorama that `rows` counts a part of.
    height: usize,
    /// The edges of the columns of a quarter of a turn and one more.
    quarter: Vec<Place>,
}

impl Grid {
    /// The first `rows` rows of a panorama of that many columns; `row_edges` mirror each other, so that the grid serves
    /// both poles.
    pub(super) fn new(width: usize, row_edges: &[f64], rows: usize) -> Self {
        let y = row_edges[..=rows].to_vec();
        let slope = y.iter().map(|y| y / (1.0 - y * y).sqrt()).collect();
        let quarter = (0..=width / 4 + 1).map(|k| Place::at(TAU * k as f64 / width as f64)).collect();
        Self { width, rows, y, slope, height: row_edges.len() - 1, quarter }
    }

    pub(super) fn width(&self) -> usize {
        self.width
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    /// Height of a row in y.
    pub(super) fn row_height(&self, row: usize) -> f64 {
        self.y[row] - self.y[row + 1]
    }

    /// Walks along the `size` pieces of a grid line, ψ = turn · atan(t / b), t from −1 to 1: every texel that each of them
    /// crosses.
    pub(super) fn along_line(&self, circle: &Circle, turn: f64, size: usize, mut visit: impl FnMut(usize, Part)) {
        let angle = |t: f64| Place::at_tangent(t.abs(), circle.b);
        for i in 0..size {
            let (t0, t1) = (edge(size, i), edge(size, i + 1));
            // Split where the circle is highest; each part is walked away from there, and counted as t grows.
            if t0 < 0.0 {
                self.walk(circle, -turn, [angle(t1.min(0.0)), angle(t0)], turn, |part| visit(i, part));
            }
            if t1 > 0.0 {
                self.walk(circle, turn, [angle(t0.max(0.0)), angle(t1)], turn, |part| visit(i, part));
            }
        }
    }

    /// The pieces beyond the middle of a grid line, ψ = atan(t / b), t from 0 to 1.
    pub(super) fn along_half(&self, circle: &Circle, size: usize, mut visit: impl FnMut(usize, Part)) {
        let angle = |t: f64| Place::at_tangent(t, circle.b);
        let mut walk = Walk::new(self, circle, 1.0, angle(0.0));
        for i in size / 2..size {
            walk.to(angle(edge(size, i + 1)), 1.0, |part| visit(i, part));
        }
    }

    /// The texels along the shorter arc of a great circle between two points (of any length) that both lie on the pole's side, y ≥ 0;
    /// lengths are positive where φ grows.
    pub(super) fn along_arc(&self, from: DVec3, to: DVec3, mut visit: impl FnMut(Part)) {
        /// A tilt of the circle's plane that is rounding: points on the equator are known to 1e-14.
        const FLAT: f64 = 1e-11;
        let normal = from.cross(to);
        let (tilt, up) = (normal.x.hypot(normal.z), normal.y.abs());
        if up == 0.0 {
            return; // a meridian: φ stays
        }
        let azimuth = |point: DVec3| point.z.atan2(point.x);
        let (a, centre) = if tilt <= FLAT * up {
            (0.0, azimuth(from))
        } else {
            (tilt, (-normal.z * normal.y.signum()).atan2(-normal.x * normal.y.signum()))
        };
        let circle = Circle::new(a, up, centre);
        let turn = |point: DVec3| {
            let psi = azimuth(point) - centre;
            psi - TAU * (psi / TAU).round()
        };
        // The half of a tilted circle above the equator ends a quarter of a turn from its highest point, but for rounding.
        let most = if a > 0.0 { FRAC_PI_2 } else { PI };
        let [start, end] = [from, to].map(|point| turn(point).clamp(-most, most));
        let (low, high, sign) = if start < end { (start, end, 1.0) } else { (end, start, -1.0) };
        if low < 0.0 {
            self.walk(&circle, -1.0, [(-high).max(0.0), -low].map(Place::at), sign, &mut visit);
        }
        if high > 0.0 {
            self.walk(&circle, 1.0, [low.max(0.0), high].map(Place::at), sign, &mut visit);
        }
    }

    /// The texels along the arc φ = centre + side · ψ, ψ from `from` to `to`, both ≥ 0, lengths multiplied by `sign`.
    fn walk(&self, circle: &Circle, side: f64, [from, to]: [Place; 2], sign: f64, visit: impl FnMut(Part)) {
        Walk::new(self, circle, side, from).to(to, sign, visit);
    }

    /// The row that holds a height, clamped to the rows there are (rounding may put an end point just outside).
    fn row_at(&self, y: f64) -> usize {
        let theta = (1.0 - y * y).max(0.0).sqrt().atan2(y);
        ((theta / PI * self.height as f64) as usize).min(self.rows - 1)
    }

    /// Where, going outwards, the arc leaves a column.
    fn column_crossing(&self, circle: &Circle, side: f64, column: f64) -> Place {
        let edge = if side > 0.0 { column + 1.0 } else { column };
        if circle.centre == -PI && edge >= 0.0 && (edge as usize) < self.quarter.len() && side > 0.0 {
            return self.quarter[edge as usize];
        }
        Place::at(side * (TAU * edge / self.width as f64 - PI - circle.centre))
    }

    /// Where, going outwards and so towards the equator, the arc leaves a row; infinitely far away if it does not.
    fn row_crossing(&self, circle: &Circle, row: usize) -> Place {
        let never = Place { psi: f64::INFINITY, sin: 0.0, cos: 0.0 };
        let edge = if circle.a > 0.0 { row + 1 } else { row };
        if circle.a == 0.0 || edge == 0 || edge >= self.rows {
            return never;
        }
        // Above one, rounding has put the arc's highest point in the row beyond: it leaves that at once.
        let cos = (circle.b * self.slope[edge] / circle.a).min(1.0);
        if cos > 0.0 { Place { psi: cos.acos(), sin: ((1.0 - cos) * (1.0 + cos)).sqrt(), cos } } else { never }
    }
}

/// The way along a circle, away from where it is highest: φ = centre + side · ψ, ψ growing.
struct Walk<'a> {
    grid: &'a Grid,
    circle: &'a Circle,
    side: f64,
    psi: f64,
    /// As [`Circle::height`] says.
    height: [f64; 2],
    column: f64,
    row: usize,
    /// Where the column ends, and the row.
    next: [Place; 2],
}

impl<'a> Walk<'a> {
    fn new(grid: &'a Grid, circle: &'a Circle, side: f64, from: Place) -> Self {
        let column_position = (circle.centre + side * from.psi + PI) / TAU * grid.width as f64;
        let column = if side > 0.0 { column_position.floor() } else { column_position.ceil() - 1.0 };
        let row = grid.row_at(circle.a * from.cos / (circle.b * circle.b + (circle.a * from.cos).powi(2)).sqrt());
        let next = [grid.column_crossing(circle, side, column), grid.row_crossing(circle, row)];
        Self { grid, circle, side, psi: from.psi, height: circle.height(from), column, row, next }
    }

    /// The texels on the way to a place further on, lengths multiplied by `sign`.
    fn to(&mut self, to: Place, sign: f64, mut visit: impl FnMut(Part)) {
        let (grid, circle) = (self.grid, self.circle);
        while self.psi < to.psi {
            let by_column = self.next[0].psi <= self.next[1].psi;
            let next = self.next[usize::from(!by_column)];
            let end = if next.psi < to.psi { next } else { to };
            // ∫ y dψ as one angle: short arcs take no arctangent.
            let [from_sin, from_cos] = self.height;
            self.height = circle.height(end);
            let area = arcsine(self.height[0] * from_cos - from_sin * self.height[1]);
            // P = P at the row's upper edge × length + L × ∫ (y_edge − y).
            let psi = end.psi.max(self.psi);
            let length = psi - self.psi;
            self.psi = psi;
            let depth = (grid.y[self.row] * length - area) / grid.row_height(self.row);
            let column = (self.column as i64).rem_euclid(grid.width as i64) as usize;
            visit(Part { column, row: self.row, length: sign * length, depth: sign * depth });
            if next.psi > to.psi {
                break;
            }
            if by_column {
                self.column += self.side;
                self.next[0] = grid.column_crossing(circle, self.side, self.column);
            } else {
                self.row = if circle.a > 0.0 { self.row + 1 } else { self.row - 1 };
                self.next[1] = grid.row_crossing(circle, self.row);
            }
        }
    }
}

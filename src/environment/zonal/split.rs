//! Kernels narrower than harmonics resolve, in two parts: one near the axis, summed over the texels there, and a smooth rest.
//!
//! As Ewald split the forces in a crystal: K = K Q + K P, with u = w/w₀ (w = 1 − c), Q = e⁻ᵘ (1 + u + u²/2 + u³/6 + u⁴/24) and P = 1 − Q. P rises as
//! u⁵, which takes the peak of K away whatever its width, and its harmonics fall off like those of a Gaussian, at l ≈ 7/√w₀; Q is 3e-6 of K at
//! u = 22. So w₀ follows from the number of degrees one wants to spend, and 6.6 √w₀ radians from the number of texels.
//!
//! Texels near the axis are larger than the peak. Each is a box of constant radiance, and the integral of a zonal function over it is one
//! over its boundary (Green): with F(w) = ∫₀ʷ S dw and ψ the azimuth about R, ∫ S dω = ∮ F dψ = ∮ F/(w (2 − w)) R·(l × dl). That has no
//! singularity on the boundary, however near R is to it, and Gauss points along the edges, close to each other where R is close, give it
//! to 1e-7. Farther away a product rule in the two angles does. The weights of all texels are made to sum to ∫ K Q exactly: a
//! constant stays what it is.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use crate::environment::kernel::Kernel;
use crate::environment::kernel::power::exp_of_negative;
use crate::environment::panorama::Panorama;
use crate::math::quadrature::{Rule, gauss_legendre};

/// u beyond which Q counts as nothing.
const CUT: f64 = 22.0;
/// Points of product rules; how many extents h away the texel must at least be for each, where (h/4δ)^2n is below 2e-5; and how much e⁻ᵘ
/// may fall over it: n points on e^(−x) leave x^2n n!⁴/((2n + 1) (2n)!³), 1e-5.
const RULES: [(usize, f64, f64); N_RULES] =
    [(2, 5.0, 0.45), (3, 2.0, 1.6), (4, 1.0, 3.4), (6, 1.0, 7.9), (8, 1.0, 12.9)];
const N_RULES: usize = 5;
/// Points on a part of an edge that is no longer than its distance, where (1/4)^12 is 6e-8, nor than √w₀.
const EDGE_POINTS: usize = 6;
/// Intervals of the table of F.
const INTERVALS: usize = 1024;

/// The two parts of a kernel.
#[derive(Debug, Clone)]
pub(super) struct Split {
    kernel: Kernel,
    w0: f64,
    /// Where F/w stands: in ln(1 + w/scale).
    scale: f64,
    per_interval: f64,
    /// F/w at the ends of the intervals, and one more on either side.
    table: Vec<f64>,
    /// F beyond the cut.
    whole: f64,
}

/// Places in a panorama for the product rules, and the rule for edges.
#[derive(Debug)]
pub(super) struct Places {
    /// Of each of [`RULES`]: sin θ, cos θ and weight of every row's points, and cos φ, sin φ of every column's.
    rows: [Vec<[f64; 3]>; N_RULES],
    columns: [Vec<[f64; 2]>; N_RULES],
    /// Weights of the points of each.
    weights: [Vec<f64>; N_RULES],
    edge: Rule,
}

impl Split {
    /// The parts of a kernel whose rest is to take about `degree` degrees.
    pub fn new(kernel: Kernel, degree: usize) -> Self {
        let w0 = (7.2 / degree as f64).powi(2);
        let scale = 2.0 * kernel.alpha().powi(2);
        let cut = CUT * w0;
        let per_interval = (cut / scale).ln_1p() / INTERVALS as f64;
        let mut split = Self { kernel, w0, scale, per_interval, table: vec![], whole: 0.0 };
        let rule = gauss_legendre(6);
        let at = |x: f64| scale * x.exp_m1();
        let mut sum = 0.0;
        let mut table = vec![kernel.eval(0.0)];
        for i in 0..=INTERVALS {
            let x = i as f64 * per_interval;
            sum += per_interval
                * rule.integrate(|t| {
                    let x = x + t * per_interval;
                    split.near(at(x)) * scale * x.exp()
                });
            table.push(sum / at(x + per_interval));
        }
        // Before the first: F/w is smooth, so its mirror image by a cubic through the first four.
        let before = 4.0 * table[0] - 6.0 * table[1] + 4.0 * table[2] - table[3];
        table.insert(0, before);
        split.whole = table[INTERVALS + 1] * cut;
        split.table = table;
        split
    }

    /// The part near the axis, K Q.
    #[inline(always)]
    fn near(&self, w: f64) -> f64 {
        let u = w / self.w0;
        let series = 1.0 + u * (1.0 + u * (0.5 + u * (1.0 / 6.0 + u / 24.0)));
        self.kernel.eval(w) * exp_of_negative(-u) * series
    }

    /// The rest, K P, without cancellation.
    pub fn rest(&self, w: f64) -> f64 {
        let u = w / self.w0;
        if u > 2.0 {
            return self.kernel.eval(w) - self.near(w);
        }
        // P = e⁻ᵘ Σ_(j ≥ 5) uʲ/j!: below 1e-17 after 20 more terms.
        let series = (5..26).rev().fold(0.0, |sum, j| (sum * u) / f64::from(j + 1) + 1.0);
        self.kernel.eval(w) * exp_of_negative(-u) * series * u.powi(5) / 120.0
    }

    /// How far from the axis the near part reaches, as 1 − c.
    fn cut(&self) -> f64 {
        CUT * self.w0
    }

    /// F(w)/(w (2 − w)), by a cubic through four places of the table.
    fn flux(&self, w: f64) -> f64 {
        if w >= self.cut() {
            return self.whole / (w * (2.0 - w));
        }
        let at = libm::log1p(w / self.scale) / self.per_interval;
        let i = (at as usize).min(INTERVALS - 1);
        let t = at - i as f64;
        let v = &self.table[i..i + 4];
        let (a, b, c) = (t + 1.0, t - 1.0, t - 2.0);
        let value = (v[3] * a * t * b - v[0] * t * b * c) / 6.0 + (v[1] * a * b * c - v[2] * a * t * c) / 2.0;
        value / (2.0 - w)
    }

    /// The mean of a panorama under the near part, with its weights normalised to one; `None` where no texel has any.
    pub fn mean(&self, axis: DVec3, panorama: &Panorama, places: &Places) -> Option<[f64; 3]> {
        let (width, height) = (panorama.width(), panorama.height());
        let (dtheta, dphi) = (PI / height as f64, TAU / width as f64);
        let horizontal = axis.x.hypot(axis.z);
        let theta = libm::atan2(horizontal, axis.y);
        let azimuth = libm::atan2(axis.z, axis.x);
        let least = 1.0 - self.cut();
        let reach = 2.0 * libm::asin((0.5 * self.cut()).sqrt());
        let first = ((theta - reach) / dtheta).floor().max(0.0) as usize;
        let last = (((theta + reach) / dtheta) as usize).min(height - 1);
        let (mut sum, mut weights) = ([0.0; 3], 0.0);
        for row in first..=last {
            let edges = [row, row + 1].map(|r| libm::sincos(PI * r as f64 / height as f64));
            let (sin, cos) = libm::sincos(dtheta * (row as f64 + 0.5));
            let widest = (sin + 0.5 * dtheta).min(1.0) * dphi;
            let extent = dtheta.max(widest);
            let diagonal = 0.5 * dtheta.hypot(widest);
            // Columns whose azimuth from the axis is at most this; one more on either side.
            let half = columns_within(edges, [horizontal, axis.y], least).map(|half| half / dphi + 1.5);
            let Some(half) = half else { continue };
            let middle = (azimuth + PI) / dphi - 0.5;
            let (from, count) = if 2.0 * half >= width as f64 {
                (0, width)
            } else {
                let from = (middle - half).ceil();
                (from.rem_euclid(width as f64) as usize % width, ((middle + half).floor() - from) as usize + 1)
            };
            let texels = panorama.row(row);
            let mut shared: Option<f64> = None;
            for column in (from..from + count.min(width)).map(|c| c % width) {
                let (sin_phi, cos_phi) = libm::sincos(dphi * (column as f64 + 0.5) - PI);
                let centre = DVec3::new(sin * cos_phi, cos, sin * sin_phi);
                let distance = ((axis - centre).length() - diagonal).max(0.0);
                if 0.5 * distance * distance >= self.cut() {
                    shared = None;
                    continue;
                }
                let fall = (distance + 2.0 * diagonal) * extent / self.w0;
                let rule = RULES.iter().position(|&(_, extents, most)| distance >= extents * extent && fall <= most);
                let weight = match rule {
                    Some(rule) => {
                        shared = None;
                        let n = RULES[rule].0;
                        let mut weight = 0.0;
                        for &[sin, cos, row_weight] in &places.rows[rule][n * row..n * row + n] {
                            let (up, across) = (1.0 - axis.y * cos, sin);
                            let mut line = 0.0;
                            let columns = &places.columns[rule][n * column..n * column + n];
                            for (&[cos_phi, sin_phi], weight) in columns.iter().zip(&places.weights[rule]) {
                                let w = up - across * (axis.x * cos_phi + axis.z * sin_phi);
                                line += weight * self.near(w);
                            }
                            weight += row_weight * line;
                        }
                        weight * dphi
                    }
                    None => {
                        let phi = [column, column + 1].map(|c| dphi * c as f64 - PI);
                        let thetas = [row, row + 1].map(|r| dtheta * r as f64);
                        let left = shared.unwrap_or_else(|| self.meridian(axis, phi[0], thetas, &places.edge));
                        let right = self.meridian(axis, phi[1], thetas, &places.edge);
                        shared = Some(right);
                        let [top, bottom] = edges.map(|edge| self.parallel(axis, edge, phi, &places.edge));
                        top - bottom + right - left
                    }
                };
                weights += weight;
                for (sum, value) in sum.iter_mut().zip(texels[column]) {
                    *sum += weight * f64::from(value);
                }
            }
        }
        (weights > 0.0).then(|| sum.map(|s| s / weights))
    }

    /// ∫ F dψ along a meridian, from the first θ to the second.
    fn meridian(&self, axis: DVec3, phi: f64, theta: [f64; 2], rule: &Rule) -> f64 {
        let (sin_phi, cos_phi) = libm::sincos(phi);
        let at = |theta: f64| {
            let (sin, cos) = libm::sincos(theta);
            (DVec3::new(sin * cos_phi, cos, sin * sin_phi), DVec3::new(cos * cos_phi, -sin, cos * sin_phi))
        };
        self.along(axis, theta, 1.0, rule, &at)
    }

    /// ∫ F dψ along a parallel of that sine and cosine of θ, from the first φ to the second.
    fn parallel(&self, axis: DVec3, (sin, cos): (f64, f64), phi: [f64; 2], rule: &Rule) -> f64 {
        let at = |phi: f64| {
            let (sin_phi, cos_phi) = libm::sincos(phi);
            (DVec3::new(sin * cos_phi, cos, sin * sin_phi), DVec3::new(-sin * sin_phi, 0.0, sin * cos_phi))
        };
        self.along(axis, phi, sin, rule, &at)
    }

    /// The same along any curve of constant `speed`, in parts no longer than their distance from the kernel's singularities.
    fn along(
        &self,
        axis: DVec3,
        [from, to]: [f64; 2],
        speed: f64,
        rule: &Rule,
        at: &dyn Fn(f64) -> (DVec3, DVec3),
    ) -> f64 {
        let width = self.kernel.width();
        let mut sum = 0.0;
        let mut start = from;
        let mut length = to - from;
        // In steps: halved until they are short enough, doubled again after each, so that they follow the distance.
        while start < to {
            length = length.min(to - start);
            let (middle, _) = at(start + 0.5 * length);
            let chord = speed * length;
            let distance = ((axis - middle).length() - 0.5 * chord).max(0.0);
            // F follows e⁻ᵘ, which falls by at most e⁶·⁶ over √w₀ before it counts for nothing.
            let near = 0.5 * distance * distance < self.cut() && chord * chord > self.w0;
            // (dψ is as singular opposite to the axis.)
            let from_opposite = ((axis + middle).length() - 0.5 * chord).max(0.0);
            if near || chord > distance.min(from_opposite).hypot(width) {
                length *= 0.5;
                continue;
            }
            for (t, weight) in rule.iter() {
                let (l, dl) = at(start + t * length);
                let away = axis - l;
                sum += weight * length * self.flux(0.5 * away.length_squared()) * away.dot(l.cross(dl));
            }
            // (So short a rest is rounding.)
            start = if to - start - length < 1e-9 * (to - from) { to } else { start + length };
            length *= 2.0;
        }
        sum
    }
}

impl Places {
    pub fn new(panorama: &Panorama) -> Self {
        let (width, height) = (panorama.width(), panorama.height());
        let (dtheta, dphi) = (PI / height as f64, TAU / width as f64);
        let rules = RULES.map(|(n, ..)| gauss_legendre(n));
        let rows = rules.each_ref().map(|rule| {
            let row = |row: usize| {
                rule.iter().map(move |(t, weight)| {
                    let (sin, cos) = libm::sincos(dtheta * (row as f64 + t));
                    [sin, cos, weight * dtheta * sin]
                })
            };
            (0..height).flat_map(row).collect()
        });
        let columns = rules.each_ref().map(|rule| {
            let column = |column: usize| {
                rule.nodes.iter().map(move |t| {
                    let (sin, cos) = libm::sincos(dphi * (column as f64 + t) - PI);
                    [cos, sin]
                })
            };
            (0..width).flat_map(column).collect()
        });
        Self { rows, columns, weights: rules.map(|rule| rule.weights), edge: gauss_legendre(EDGE_POINTS) }
    }
}

/// The largest azimuth from the axis at which a row comes as near to it as a cosine of `least`; `None` if it never does.
fn columns_within(edges: [(f64, f64); 2], [horizontal, up]: [f64; 2], least: f64) -> Option<f64> {
    // c = up cos θ + horizontal sin θ cos ψ is largest at the row's edges or between, where the cap is widest: at θ of the cap's tangent.
    let half = |(sin, cos): (f64, f64)| {
        let (rest, across) = (least - up * cos, horizontal * sin);
        if rest <= -across {
            Some(PI)
        } else if rest < across {
            Some(libm::acos(rest / across))
        } else {
            None
        }
    };
    let at_edges = edges.into_iter().filter_map(half).fold(None, |m: Option<f64>, h| Some(m.map_or(h, |m| m.max(h))));
    // sin of the half-width of a cap, sin r / sin θ_R, is reached at cos θ = up/least.
    let tangent = up / least;
    let inside = tangent < edges[0].1 && tangent > edges[1].1 && horizontal > 0.0;
    let widest = inside.then(|| {
        let ratio = ((1.0 - least * least).max(0.0)).sqrt() / horizontal;
        if ratio < 1.0 { libm::asin(ratio) } else { PI }
    });
    match (at_edges, widest) {
        (None, None) => {
            // The axis itself lies in the row, and the cap within it.
            let between = up <= edges[0].1 && up >= edges[1].1;
            between.then_some(0.0)
        }
        (a, b) => Some(a.unwrap_or(0.0).max(b.unwrap_or(0.0))),
    }
}

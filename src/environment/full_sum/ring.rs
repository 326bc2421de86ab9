//! A sheen over a box, along the box's boundary.
//!
//! A sheen is a ring above the horizon, as thin as 1/p radians, with a singularity at its axis: a large box would have to be cut into as many small ones
//! as lie along the one and about the other. But with
//! F(w) = ∫₀ʷ K dw, which a sheen has in closed form, and ψ the azimuth about the axis, ∫ K dω = ∮ F dψ (Green) round the part of the box that is above
//! the horizon. Within the ring F is nothing, so that what counts is where the box's sides cross the ring, and what they leave of the
//! horizon, where F is 1/2π. Both kinds of side, c(t) = u + a cos(t − t₀) along each, meet c = 0 and the ring's upper end where arc cosines
//! tell. What is integrated between is analytic, and falls like e^(−pc).

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::{Lobe, Patch};
use crate::math::quadrature::Rule;

/// A panel is no longer than that many 1/p in c, where ten points on e⁻ˣ leave 1e-12, and than that in its own parameter.
const FALL: f64 = 8.0;
const LONGEST: f64 = 0.5;
/// Nor is it longer than its distance from the axis, where a sheen has a singularity, until that holds no more than this part of it.
const NOTHING: f64 = 1e-13;
/// A side whose cosines are all below this lies along the horizon: rounding would tell which side of it is lit. The axis is moved by a little more
/// than that, to where it can be told.
const LEVEL: f64 = 1e-14;
const NUDGE: DVec3 = DVec3::new(6e-13, 7e-13, 5e-13);

/// c(t) = u + a cos(t − t₀) along a side, in its interval, and what dψ/dt (1 − c²) is: constant on a meridian.
struct Side {
    u: f64,
    a: f64,
    t0: f64,
    interval: [f64; 2],
    /// dψ/dt (1 − c²) = these of 1 and of cos(t − t₀).
    turn: [f64; 2],
}

/// ∫ K over a box.
pub(super) fn over_box(patch: Patch, lobe: &Lobe, rule: &Rule) -> f64 {
    let meridian = |phi: f64| {
        let across = lobe.horizontal * (phi - lobe.azimuth).cos();
        Side {
            u: 0.0,
            a: lobe.axis.y.hypot(across),
            t0: across.atan2(lobe.axis.y),
            interval: patch.theta,
            turn: [lobe.horizontal * (phi - lobe.azimuth).sin(), 0.0],
        }
    };
    let parallel = |theta: f64| {
        let (sin, cos) = theta.sin_cos();
        Side {
            u: lobe.axis.y * cos,
            a: lobe.horizontal * sin,
            t0: lobe.azimuth,
            interval: patch.phi,
            turn: [-lobe.axis.y * sin * sin, lobe.horizontal * sin * cos],
        }
    };
    let [left, right] = patch.phi.map(meridian);
    let [top, bottom] = patch.theta.map(parallel);
    let sides = [(&top, 1.0), (&bottom, -1.0), (&right, 1.0), (&left, -1.0)];
    // (Of a box all round, both meridians are one.)
    let counted = &sides[..if patch.phi[1] - patch.phi[0] < TAU { 4 } else { 2 }];
    if counted.iter().any(|(side, _)| side.is_level()) {
        return over_box(patch, &Lobe::new((lobe.axis + NUDGE).normalize(), lobe.kernel), rule);
    }
    let edges: f64 = counted.iter().map(|(side, sign)| sign * side.integral(lobe, rule)).sum();
    edges + horizon_within(patch, lobe, &sides.map(|(side, _)| side)) / TAU
}

impl Side {
    /// Whether all of it lies along the horizon. (At a pole sides have no length.)
    fn is_level(&self) -> bool {
        self.u.abs() + self.a < LEVEL && self.turn[0].abs() > 0.5
    }

    fn cosine(&self, t: f64) -> f64 {
        self.u + self.a * (t - self.t0).cos()
    }

    /// Where it has that cosine: twice in a turn, if at all.
    fn meets(&self, c: f64) -> impl Iterator<Item = f64> {
        let ratio = (c - self.u) / self.a;
        let from_middle = (ratio.abs() < 1.0).then(|| ratio.acos());
        let both = from_middle.into_iter().flat_map(|angle| [-angle, angle]);
        let t0 = self.t0;
        both.flat_map(move |angle| [-TAU, 0.0, TAU].map(|turn| t0 + angle + turn))
    }

    /// ∫ F dψ along what of it is within the ring.
    fn integral(&self, lobe: &Lobe, rule: &Rule) -> f64 {
        let [from, to] = self.interval;
        let ([power, top], [constant, cosine]) = (lobe.kernel.ring(), self.turn);
        // Where c has an extremum as well: in between it rises or falls.
        let extrema = (-3..=3).map(|k| self.t0 + f64::from(k) * PI);
        let meets = self.meets(0.0).chain(self.meets(top)).chain(extrema);
        let mut cuts: Vec<f64> = meets.filter(|t| from < *t && *t < to).chain([from, to]).collect();
        cuts.sort_by(f64::total_cmp);
        let nothing = NOTHING.powf(0.5 / (power + 1.0));
        let mut sum = 0.0;
        for ends in cuts.windows(2) {
            let middle = self.cosine(0.5 * (ends[0] + ends[1]));
            if middle <= 0.0 || middle >= top {
                continue;
            }
            // In halves, until they are short enough.
            let mut parts = vec![[ends[0], ends[1]]];
            while let Some([start, end]) = parts.pop() {
                let ([low, high], length) = ([start, end].map(|t| self.cosine(t)), end - start);
                let from_axis = (2.0 * (1.0 - low.max(high)).max(0.0)).sqrt().max(nothing);
                if length > LONGEST.min(from_axis) || power * (high - low).abs() > FALL {
                    let middle = 0.5 * (start + end);
                    parts.extend([[start, middle], [middle, end]]);
                    continue;
                }
                sum += length
                    * rule.integrate(|s| {
                        let cos = (start + s * length - self.t0).cos();
                        let w = (1.0 - self.u - self.a * cos).clamp(f64::MIN_POSITIVE, 1.0);
                        lobe.kernel.within(w) * (constant + cosine * cos) / (w * (2.0 - w))
                    });
            }
        }
        sum
    }
}

/// How much of the horizon lies within a box, in radians.
fn horizon_within(Patch { phi, theta }: Patch, lobe: &Lobe, [top, bottom, right, left]: &[&Side; 4]) -> f64 {
    let (along, across) = lobe.axis.any_orthonormal_pair();
    let azimuth = |theta: f64, phi: f64| {
        let (sin, cos) = theta.sin_cos();
        let l = DVec3::new(sin * phi.cos(), cos, sin * phi.sin());
        l.dot(across).atan2(l.dot(along))
    };
    // Wherever it meets the great and small circles of the sides: it is within, or not, from one of these places to the next.
    let on_parallels = [(top, theta[0]), (bottom, theta[1])];
    let on_parallels = on_parallels.into_iter().flat_map(|(side, theta)| side.meets(0.0).map(move |phi| (theta, phi)));
    let on_meridians = [(right, phi[1]), (left, phi[0])];
    let on_meridians = on_meridians.into_iter().flat_map(|(side, phi)| side.meets(0.0).map(move |theta| (theta, phi)));
    let mut places: Vec<f64> = on_parallels.chain(on_meridians).map(|(theta, phi)| azimuth(theta, phi)).collect();
    places.sort_by(f64::total_cmp);
    let Some(first) = places.first() else { return 0.0 };
    places.push(first + TAU);
    let (highest, lowest) = (theta[0].cos(), theta[1].cos());
    let is_within = |psi: f64| {
        let (sin, cos) = psi.sin_cos();
        let l = along * cos + across * sin;
        lowest < l.y && l.y < highest && (l.z.atan2(l.x) - phi[0]).rem_euclid(TAU) < phi[1] - phi[0]
    };
    // (Asked anywhere but in the middle, where the horizon of a texel's middle touches parallels.)
    let asked = |ends: &[f64]| ends[0] + 0.382 * (ends[1] - ends[0]);
    places.windows(2).filter(|ends| is_within(asked(ends))).map(|ends| ends[1] - ends[0]).sum()
}

#[cfg(test)]
mod tests {
    use super::super::FullSum;
    use super::*;
    use crate::environment::kernel::{Kernel, KernelKind};
    use crate::environment::panorama::Panorama;

    fn axes() -> impl Iterator<Item = DVec3> {
        let some = (0..40).map(|i| {
            let (sin, cos) = (f64::from(i) * 0.7).sin_cos();
            DVec3::new(cos, 0.1 * f64::from(i - 20), sin).normalize()
        });
        // Middles of texels, whose horizons touch parallels.
        let middles = (0..5).map(|i| {
            let ((sin, cos), (up, along)) = ((PI * (i as f64 + 0.5) / 5.0).sin_cos(), (PI * i as f64 / 4.0).sin_cos());
            DVec3::new(sin * along, cos, sin * up)
        });
        some.chain(middles)
            .chain([DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z])
            .chain([DVec3::new(1.0, 0.0, 1.0).normalize(), DVec3::new(1e-13, 1.0, -2e-12).normalize()])
            .chain([DVec3::new(1.0, 1e-17, 1e-16).normalize(), DVec3::new(1e-10, -1.0, 1e-10).normalize()])
    }

    fn boxes(width: usize, height: usize) -> impl Iterator<Item = Patch> {
        let side = |i: usize, n: usize, whole: f64| [whole * i as f64 / n as f64, whole * (i + 1) as f64 / n as f64];
        let of = move |i: usize| (side(i % width, width, TAU).map(|phi| phi - PI), side(i / width, height, PI));
        (0..width * height).map(of).map(|(phi, theta)| Patch { phi, theta })
    }

    /// Boxes and their quarters, quarters of these, and so on: down to what product rules hold.
    #[test]
    fn a_boundary_tells_what_is_within() {
        let panorama = Panorama::new(4, 2, vec![[1.0; 3]; 8]).unwrap();
        let sum = FullSum::with_extra_points(&panorama, 2);
        fn by_parts(sum: &FullSum, Patch { phi, theta }: Patch, lobe: &Lobe, times: usize) -> f64 {
            let [x, y] = [phi, theta].map(|[low, high]| [low, 0.5 * (low + high), high]);
            let quarters = [(0, 0), (0, 1), (1, 0), (1, 1)];
            let of = |(i, j)| Patch { phi: [x[i], x[i + 1]], theta: [y[j], y[j + 1]] };
            let each =
                |place| if times > 0 { by_parts(sum, of(place), lobe, times - 1) } else { sum.patch(of(place), lobe) };
            quarters.into_iter().map(each).sum()
        }
        for (alpha, times) in [(1.0, 4), (0.3, 4), (0.0625, 4), (0.02, 5)] {
            let kernel = Kernel::of(KernelKind::Charlie, alpha);
            for axis in axes().step_by(3) {
                let lobe = Lobe::new(axis, &kernel);
                for patch in boxes(4, 2).chain(boxes(7, 3)).step_by(2) {
                    let (got, wanted) = (over_box(patch, &lobe, &sum.sides), by_parts(&sum, patch, &lobe, times));
                    assert!((got - wanted).abs() < 1e-7, "{alpha}, {axis}, {patch:?}: {got} wanted {wanted}");
                }
            }
        }
    }

    /// (Where a side touches the horizon, places are known to the root of rounding.)
    #[test]
    fn boxes_hold_the_whole_ring() {
        const TOUCHING: f64 = 2e-8;
        let panorama = Panorama::new(4, 2, vec![[1.0; 3]; 8]).unwrap();
        let sum = FullSum::new(&panorama);
        for alpha in [1.0, 0.2, 0.0625, 0.02, 0.0049, 0.0025] {
            let kernel = Kernel::of(KernelKind::Charlie, alpha);
            for axis in axes() {
                let lobe = Lobe::new(axis, &kernel);
                for [width, height] in [[1, 1], [4, 2], [5, 2], [8, 5], [3, 16]] {
                    let each: Vec<f64> = boxes(width, height).map(|patch| over_box(patch, &lobe, &sum.sides)).collect();
                    assert!(each.iter().all(|part| *part > -TOUCHING), "{alpha}, {axis}: {each:?}");
                    let whole: f64 = each.iter().sum();
                    assert!((whole - 1.0).abs() < TOUCHING, "{alpha}, {axis}, {width} × {height}: {whole} {each:?}");
                }
            }
        }
    }
}

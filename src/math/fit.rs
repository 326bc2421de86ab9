//! Least squares: the values at nodes whose interpolation comes closest to a function.
//!
//! Interpolation is linear in the nodes' values: at a point it is Σ wₖ xₖ over the few nodes of the cell that the point lies in. What is
//! made small is ∫ ρ (Σ wₖ xₖ − f)², with a weight ρ ≥ 0, over all cells: the L² projection of finite elements. Each cell gives its
//! Gram matrix ∫ ρ wⱼ wₖ and, for each function, its moments ∫ ρ wₖ f; the normal equations are their sum, which is never formed:
//! conjugate gradients only multiply by it, cell by cell, each node gathering from its cells in one order, so that the result is the
//! same for any number of threads.
//!
//! The diagonal scales the equations. So scaled, their condition is no worse than that of the worst cell (A. J. Wathen, "Realistic
//! eigenvalue bounds for the Galerkin mass matrix", 1987): 9 for bilinear cells and 27 for trilinear ones under an even weight. Some
//! 40 steps reach the tolerance however many nodes there are.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// What texels are chosen for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fit {
    /// Each texel is the value at its centre.
    #[default]
    None,
    /// The lookup between texels is closest to the function, in least squares.
    Lookup,
}

impl Fit {
    /// Whether it is [`Fit::None`].
    pub fn is_none(&self) -> bool {
        *self == Self::None
    }
}

/// A cell: its nodes and the Gram matrix of their weights. A node may stand there twice.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell<const N: usize> {
    /// Indices of the nodes.
    pub nodes: [u32; N],
    /// ∫ ρ wⱼ wₖ.
    pub gram: [[f64; N]; N],
}

impl<const N: usize> Cell<N> {
    /// A cell without area.
    pub fn new(nodes: [u32; N]) -> Self {
        Self { nodes, gram: [[0.0; N]; N] }
    }

    /// Adds a point of the cell: the nodes' weights there, and ρ times the area that it stands for.
    pub fn add(&mut self, weights: &[f64; N], area: f64) {
        for j in 0..N {
            for k in 0..N {
                self.gram[j][k] += area * weights[j] * weights[k];
            }
        }
    }
}

/// Cells that share nodes.
#[derive(Debug)]
pub struct LeastSquares<const N: usize> {
    cells: Vec<Cell<N>>,
    /// Of each node, where its places in cells begin.
    starts: Vec<u32>,
    /// Cell × N + place.
    places: Vec<u32>,
    diagonal: Vec<f64>,
}

/// Nodes that a thread answers for at a time, and terms of a partial sum.
const CHUNK: usize = 1024;
/// The residual, in the norm of the scaled equations and in parts of the right-hand side's, at which the solver stops.
pub const TOLERANCE: f64 = 1e-10;
/// Steps at most: four times what the condition of trilinear cells asks for.
const MOST_STEPS: usize = 400;
/// Rounds of holding nodes at their bounds.
const MOST_ROUNDS: usize = 12;

/// What came of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Fitted {
    /// The nodes' values.
    pub values: Vec<f64>,
    /// Steps of the solver, all rounds together.
    pub steps: usize,
    /// The residual that is left, in parts of the right-hand side's; at most [`TOLERANCE`] if it converged.
    pub residual: f64,
    /// Nodes that stand at a bound.
    pub bounded: usize,
}

impl<const N: usize> LeastSquares<N> {
    /// The problem of these cells.
    pub fn new(n_nodes: usize, cells: Vec<Cell<N>>) -> Self {
        let mut starts = vec![0_u32; n_nodes + 1];
        for node in cells.iter().flat_map(|cell| cell.nodes) {
            starts[node as usize + 1] += 1;
        }
        for i in 0..n_nodes {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut places = vec![0_u32; cells.len() * N];
        for (place, node) in cells.iter().flat_map(|cell| cell.nodes).enumerate() {
            places[next[node as usize] as usize] = place as u32;
            next[node as usize] += 1;
        }
        let mut problem = Self { cells, starts, places, diagonal: vec![] };
        problem.diagonal = problem.gather(|cell, place| {
            let same = |k: &usize| cell.nodes[*k] == cell.nodes[place];
            (0..N).filter(same).map(|k| cell.gram[place][k]).sum()
        });
        problem
    }

    /// How many nodes there are.
    pub fn n_nodes(&self) -> usize {
        self.starts.len() - 1
    }

    /// The values that fit best, near `start`, within `bounds`.
    ///
    /// `moments` of each cell are ∫ ρ wₖ (f − interpolation of `start`): where `start` interpolates f exactly they are 0 exactly, and so
    /// is the change. Nodes that no cell weighs keep their start.
    pub fn solve(&self, start: &[f64], moments: &[[f64; N]], bounds: [f64; 2]) -> Fitted {
        let mut right = vec![0.0; self.n_nodes()];
        self.gather_into(&mut right, |cell, place| moments[cell][place]);
        let scaled = |r: f64, d: f64| if d > 0.0 { r * r / d } else { 0.0 };
        let whole = sum(right.len(), |i| scaled(right[i], self.diagonal[i])).sqrt();
        let (mut change, mut held) = (vec![0.0; self.n_nodes()], vec![false; self.n_nodes()]);
        let mut fitted = Fitted { values: vec![], steps: 0, residual: 0.0, bounded: 0 };
        for round in 0..MOST_ROUNDS {
            let (steps, residual) = self.conjugate_gradients(&right, &mut change, &held, whole);
            (fitted.steps, fitted.residual) = (fitted.steps + steps, residual);
            // Nodes beyond a bound are held at it; held ones whose gradient points inwards are let go, but for the last rounds, so
            // that they end.
            let gradient = self.residual(&right, &change);
            let mut any = false;
            for i in 0..change.len() {
                let (low, high) = ((bounds[0] - start[i]).min(0.0), (bounds[1] - start[i]).max(0.0));
                let release = change[i] <= low && gradient[i] > 0.0 || change[i] >= high && gradient[i] < 0.0;
                if held[i] && release && round + 4 < MOST_ROUNDS {
                    (held[i], any) = (false, true);
                } else if !held[i] && !(low..=high).contains(&change[i]) {
                    (change[i], held[i], any) = (change[i].clamp(low, high), true, true);
                }
            }
            if !any {
                break;
            }
        }
        // Whatever round was the last, no value is beyond a bound that its start respects.
        let within =
            |(start, change): (&f64, &f64)| (start + change).clamp(bounds[0].min(*start), bounds[1].max(*start));
        fitted.values = start.iter().zip(&change).map(within).collect();
        fitted.bounded = held.iter().filter(|held| **held).count();
        fitted
    }

    /// Conjugate gradients, scaled by the diagonal; held nodes do not move. Steps, and the residual in parts of `whole`.
    fn conjugate_gradients(&self, right: &[f64], x: &mut [f64], held: &[bool], whole: f64) -> (usize, f64) {
        let free = |i: usize| !held[i] && self.diagonal[i] > 0.0;
        let mut r = self.residual(right, x);
        (0..r.len()).filter(|&i| !free(i)).for_each(|i| r[i] = 0.0);
        let norm2 = |r: &[f64]| sum(r.len(), |i| if r[i] == 0.0 { 0.0 } else { r[i] * r[i] / self.diagonal[i] });
        let mut p: Vec<f64> = (0..r.len()).map(|i| if r[i] == 0.0 { 0.0 } else { r[i] / self.diagonal[i] }).collect();
        let mut ap = vec![0.0; r.len()];
        let (mut rho, mut steps) = (norm2(&r), 0);
        while rho.sqrt() > TOLERANCE * whole && steps < MOST_STEPS {
            self.apply(&p, &mut ap);
            let step = rho / sum(p.len(), |i| p[i] * ap[i]);
            x.par_iter_mut().zip(&p).for_each(|(x, p)| *x += step * p);
            r.par_iter_mut().enumerate().for_each(|(i, r)| *r = if free(i) { *r - step * ap[i] } else { 0.0 });
            let next = norm2(&r);
            let turn = next / rho;
            p.par_iter_mut().enumerate().for_each(|(i, p)| {
                *p = if r[i] == 0.0 { turn * *p } else { r[i] / self.diagonal[i] + turn * *p };
            });
            rho = next;
            steps += 1;
        }
        (steps, if whole > 0.0 { rho.sqrt() / whole } else { 0.0 })
    }

    /// Right-hand side − matrix × x.
    fn residual(&self, right: &[f64], x: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; x.len()];
        self.apply(x, &mut out);
        out.par_iter_mut().zip(right).for_each(|(out, right)| *out = right - *out);
        out
    }

    fn apply(&self, x: &[f64], out: &mut [f64]) {
        self.gather_into(out, |cell, place| {
            let cell = &self.cells[cell];
            (0..N).map(|k| cell.gram[place][k] * x[cell.nodes[k] as usize]).sum()
        });
    }

    fn gather(&self, of: impl Fn(&Cell<N>, usize) -> f64 + Sync) -> Vec<f64> {
        let mut out = vec![0.0; self.n_nodes()];
        self.gather_into(&mut out, |cell, place| of(&self.cells[cell], place));
        out
    }

    /// Σ over a node's places (cell, place within it), always in the same order.
    fn gather_into(&self, out: &mut [f64], of: impl Fn(usize, usize) -> f64 + Sync) {
        out.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
            for (i, out) in out.iter_mut().enumerate() {
                let node = chunk * CHUNK + i;
                let places = &self.places[self.starts[node] as usize..self.starts[node + 1] as usize];
                *out = places.iter().map(|&place| of(place as usize / N, place as usize % N)).sum();
            }
        });
    }
}

/// Σ of n terms, in one order whatever the number of threads.
fn sum(n: usize, term: impl Fn(usize) -> f64 + Sync) -> f64 {
    let part = |chunk: usize| (chunk * CHUNK..((chunk + 1) * CHUNK).min(n)).map(&term).sum::<f64>();
    (0..n.div_ceil(CHUNK)).into_par_iter().map(part).collect::<Vec<f64>>().into_iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::quadrature::gauss_legendre;

    /// Hats on [0, 1] with n + 1 nodes, and the moments of f less the interpolation of `start`.
    fn hats(n: usize, start: &[f64], f: impl Fn(f64) -> f64) -> (LeastSquares<2>, Vec<[f64; 2]>) {
        let rule = gauss_legendre(6);
        let (mut cells, mut moments) = (vec![], vec![]);
        for i in 0..n {
            let mut cell = Cell::new([i as u32, i as u32 + 1]);
            let mut moment = [0.0; 2];
            for (t, weight) in rule.iter() {
                let (weights, area) = ([1.0 - t, t], weight / n as f64);
                cell.add(&weights, area);
                let off = f((i as f64 + t) / n as f64) - (start[i] + t * (start[i + 1] - start[i]));
                (0..2).for_each(|k| moment[k] += area * weights[k] * off);
            }
            cells.push(cell);
            moments.push(moment);
        }
        (LeastSquares::new(n + 1, cells), moments)
    }

    /// x² on one cell: the line x − 1/6 (Legendre), whose error (x² − x + 1/6)² integrates to 1/180.
    #[test]
    fn one_cell_is_the_line_of_least_squares() {
        let (problem, moments) = hats(1, &[0.0, 1.0], |x| x * x);
        let fitted = problem.solve(&[0.0, 1.0], &moments, [f64::NEG_INFINITY, f64::INFINITY]);
        let off = [fitted.values[0] + 1.0 / 6.0, fitted.values[1] - 5.0 / 6.0];
        assert!(off.iter().all(|v| v.abs() < 10.0 * TOLERANCE), "{fitted:?}");
    }

    /// Far inside a parabola h² f″/2 x(1 − x) every node moves by −h² f″/12 (the residual then has no moments), which takes the RMS from
    /// h² f″/√120 to h² f″/√720.
    #[test]
    fn many_cells_move_by_a_twelfth_of_the_second_difference() {
        let n = 2000;
        let start: Vec<f64> = (0..=n).map(|i| (i as f64 / n as f64).powi(2)).collect();
        let (problem, moments) = hats(n, &start, |x| x * x);
        let fitted = problem.solve(&start, &moments, [f64::NEG_INFINITY, f64::INFINITY]);
        let wanted = -2.0 / (12.0 * (n * n) as f64);
        for i in n / 4..3 * n / 4 {
            let change = fitted.values[i] - start[i];
            // Rounding of values near 1 is 1e-16; the change is 4e-8.
            assert!((change / wanted - 1.0).abs() < 1e-6, "node {i}: {change:e}, wanted {wanted:e}");
        }
        assert!(fitted.residual <= TOLERANCE && fitted.steps < 60, "{} steps, {}", fitted.steps, fitted.residual);
    }

    #[test]
    fn what_is_interpolated_exactly_does_not_move_at_all() {
        let start: Vec<f64> = (0..=40).map(|_| 0.1).collect();
        let (problem, moments) = hats(40, &start, |_| 0.1);
        assert_eq!(problem.solve(&start, &moments, [0.0, 1.0]).values, start);
    }

    /// Against every choice of held nodes of a small problem: the best that is within bounds.
    #[test]
    fn bounds_are_kept_at_the_least_cost() {
        let (n, bump) = (5, |x: f64| (-60.0 * (x - 0.45) * (x - 0.45)).exp() - 0.02);
        let start: Vec<f64> = (0..=n).map(|i| bump(i as f64 / n as f64).max(0.0)).collect();
        let (problem, moments) = hats(n, &start, bump);
        let cost = |values: &[f64]| {
            let change: Vec<f64> = values.iter().zip(&start).map(|(v, s)| v - s).collect();
            let mut right = vec![0.0; n + 1];
            problem.gather_into(&mut right, |cell, place| moments[cell][place]);
            let mut image = vec![0.0; n + 1];
            problem.apply(&change, &mut image);
            (0..=n).map(|i| change[i] * (0.5 * image[i] - right[i])).sum::<f64>()
        };
        let fitted = problem.solve(&start, &moments, [0.0, f64::INFINITY]);
        assert!(fitted.bounded > 0 && fitted.values.iter().all(|v| *v >= 0.0), "{fitted:?}");
        let (found, mut best) = (cost(&fitted.values), f64::INFINITY);
        for choice in 0..1_u32 << (n + 1) {
            let held: Vec<bool> = (0..=n).map(|i| choice >> i & 1 == 1).collect();
            let mut change: Vec<f64> = (0..=n).map(|i| if held[i] { -start[i] } else { 0.0 }).collect();
            let mut right = vec![0.0; n + 1];
            problem.gather_into(&mut right, |cell, place| moments[cell][place]);
            problem.conjugate_gradients(&right, &mut change, &held, 1.0);
            let values: Vec<f64> = change.iter().zip(&start).map(|(c, s)| s + c).collect();
            if values.iter().all(|v| *v >= -1e-9) {
                best = best.min(cost(&values));
            }
        }
        assert!(found <= best + 1e-12 * best.abs(), "{found:e}, and {best:e} is possible");
    }
}

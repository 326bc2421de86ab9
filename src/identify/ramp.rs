//! Which parameter the texels along one dimension of an unknown table may stand for, shifted and stretched as it may be.

use crate::math::warp::Warp;
use crate::table::{Axis, Parameter, Sampling};

/// Texel i stands for the parameter whose warp is at the part `first + step · i` of its range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ramp {
    /// The parameter.
    pub parameter: Parameter,
    /// The function of it in which texels are even.
    pub warp: Warp,
    /// The range from part 0 to part 1.
    pub range: (f64, f64),
    /// The parameters beyond which it stays.
    pub domain: (f64, f64),
    /// Texels.
    pub size: usize,
    /// Whether texels are counted from the last.
    pub flip: bool,
    /// The part of the range at texel 0.
    pub first: f64,
    /// The part of the range from one texel to the next.
    pub step: f64,
}

/// Simple places of texels, simplest first: name them to the user, prefer them to any that were fitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Place {
    /// (i + ½ + shift)/n.
    Centre(f64),
    /// (i + shift)/(n − 1).
    Edge(f64),
}

impl Place {
    /// What a table's axis may be, in order of simplicity.
    pub const ALL: [Self; 10] = [
        Self::Centre(0.0),
        Self::Edge(0.0),
        Self::Centre(1.0),
        Self::Centre(-1.0),
        Self::Centre(0.5),
        Self::Centre(-0.5),
        Self::Edge(1.0),
        Self::Edge(-1.0),
        Self::Centre(2.0),
        Self::Centre(-2.0),
    ];

    /// The part at texel 0 and from one texel to the next, of `size` texels.
    pub fn of(self, size: usize) -> (f64, f64) {
        let n = size as f64;
        match self {
            Self::Centre(shift) => ((0.5 + shift) / n, 1.0 / n),
            Self::Edge(shift) => (shift / (n - 1.0).max(1.0), 1.0 / (n - 1.0).max(1.0)),
        }
    }
}

impl Ramp {
    /// The parameter at texel `i`.
    pub fn value(&self, i: usize) -> f64 {
        let i = if self.flip { self.size - 1 - i } else { i };
        self.at(self.first + self.step * i as f64)
    }

    /// The parameter at a part of the range; at the ends of the domain exactly these: a cosine of 6e-17 is not 0 where quantities are steep.
    pub fn at(&self, part: f64) -> f64 {
        /// Parts of the range nearer than that to an end are the end: sums of steps are off by less.
        const AT_THE_END: f64 = 1e-12;
        let ends = |(low, high)| {
            let (a, b) = (self.warp.forward(low), self.warp.forward(high));
            if a < b { ([a, b], [low, high]) } else { ([b, a], [high, low]) }
        };
        let (([a, b], _), ([least, most], [start, end])) = (ends(self.range), ends(self.domain));
        // Beyond the domain there is nothing: bakers clamp there.
        let warped = a + part * (b - a);
        let slack = AT_THE_END * (b - a);
        if warped <= least + slack {
            return start;
        }
        if warped >= most - slack {
            return end;
        }
        let (low, high) = self.domain;
        self.warp.inverse(warped, self.range.0 < 1.0).clamp(low, high)
    }

    /// The same with the texels at a simple place.
    pub fn placed(self, place: Place) -> Self {
        let (first, step) = place.of(self.size);
        Self { first, step, ..self }
    }

    /// The same with the texels at the centres of so many equal parts of a part of the range.
    pub fn covering(self, low: f64, high: f64) -> Self {
        let step = (high - low) / self.size as f64;
        Self { first: low + 0.5 * step, step, ..self }
    }

    /// The same with its texels where those of a larger table are, nothing where none of up to four times as many is near: who cuts a table cuts it
    /// between texels.
    pub fn cut_from_larger(self) -> Option<Self> {
        let whole = (1.0 / self.step).round();
        let place = |first: f64| (first * whole - 0.5).round();
        let cut = Self { first: (place(self.first) + 0.5) / whole, step: 1.0 / whole, ..self };
        let is_cut = whole > self.size as f64 && whole <= 4.0 * self.size as f64;
        let is_within = cut.first > 0.0 && cut.first + cut.step * (self.size as f64 - 1.0) < 1.0;
        let last = |ramp: &Self| ramp.first + ramp.step * (ramp.size as f64 - 1.0);
        // Nearer than a quarter of its texels at both ends.
        let is_near = (cut.first - self.first).abs().max((last(&cut) - last(&self)).abs()) < 0.25 / whole;
        (is_cut && is_within && is_near).then_some(cut)
    }

    /// How many numbers it takes to say where the texels are, beyond where they are in a right table.
    pub fn n_numbers(&self) -> usize {
        let of_place = match self.place() {
            Some(Place::Centre(0.0) | Place::Edge(0.0)) => 0,
            Some(_) => 1,
            None => 2,
        };
        of_place + usize::from(self.is_odd())
    }

    /// Whether its warp has a number that nobody chooses, such as 0.0587.
    pub fn is_odd(&self) -> bool {
        let is_odd = |offset: f64| format!("{offset:.0e}").parse() != Ok(offset);
        matches!(self.warp, Warp::Log { offset } if is_odd(offset))
    }

    /// Whether they are displaced by a part of a texel that nobody would choose.
    pub fn is_oddly_shifted(&self) -> bool {
        self.place().is_none() && self.shift().is_some()
    }

    /// Whether neither the whole of a known range nor a shift of it is what the texels cover.
    pub fn is_fitted(&self) -> bool {
        self.parameter.range().is_some() && self.shift().is_none()
    }

    /// The simple place where the texels are, if they are at one.
    pub fn place(&self) -> Option<Place> {
        Place::ALL.into_iter().find(|place| {
            let (first, step) = place.of(self.size);
            (first, step) == (self.first, self.step)
        })
    }

    /// By how many texels the values are off along the axis, if they are as far apart as texels of the whole range.
    pub fn shift(&self) -> Option<f64> {
        let n = self.size as f64;
        match self.place() {
            Some(Place::Centre(shift) | Place::Edge(shift)) => Some(shift),
            None if self.parameter.range().is_none() => None, // whose range nobody knows
            None => {
                let middle = (self.first + 0.5 * self.step * (n - 1.0) - 0.5) * n;
                // Less than half a texel over the whole length.
                ((self.step * n - 1.0).abs() < 0.5 / n).then(|| (middle * 100.0).round() / 100.0)
            }
        }
    }

    /// The axis that has the texels where they are, displaced as they may be; [`Ramp::axis`] is what it should be.
    pub fn axis_as_it_is(&self) -> Axis {
        let shift = match self.place() {
            Some(Place::Centre(shift) | Place::Edge(shift)) => shift,
            None => 0.0, // measured, not known: nothing reproduces that to the digit
        };
        Axis { shift: if self.flip { -shift } else { shift }, ..self.axis() }
    }

    /// The axis as a recipe has it: shifts by texels are left out, as they are faults; whatever else was fitted becomes a range.
    pub fn axis(&self) -> Axis {
        let axis = Axis { warp: self.warp, flip: self.flip, ..Axis::new(self.parameter, self.size) };
        let own = axis.known_range();
        let range = |low: f64, high: f64| if own == Some((low, high)) { None } else { Some((low, high)) };
        match self.place() {
            Some(Place::Centre(_)) => Axis { range: range(self.range.0, self.range.1), ..axis },
            Some(Place::Edge(_)) => Axis { sampling: Sampling::Edge, range: range(self.range.0, self.range.1), ..axis },
            None if self.shift().is_some() => axis,
            None => {
                let ends = [self.first - 0.5 * self.step, self.first + self.step * (self.size as f64 - 0.5)];
                let is_cut = self.warp == Warp::Linear && self.cut_from_larger() == Some(*self);
                let digits = if is_cut { 1e9 } else { 1e5 };
                let tidy = |v: f64| if v.is_finite() { (v * digits).round() / digits } else { v };
                let [a, b] = ends.map(|part| tidy(self.at(part)));
                if a == b { axis } else { Axis { range: range(a.min(b), a.max(b)), ..axis } }
            }
        }
    }
}

/// What texels along a dimension of `size` may stand for, if it is the parameter of a master's nodes: at centres, not flipped.
pub fn ramps(nodes: &Axis, size: usize) -> Vec<Ramp> {
    use Parameter as P;
    let domain = nodes.ends();
    let log = |offset| Warp::Log { offset };
    let (unit, any) = ((0.0, 1.0), domain);
    // The usual ones first: of equals, the first is taken.
    let rising = [Warp::Linear, Warp::Sqrt, Warp::Square, Warp::Cbrt];
    let over = |parameter: P, range: (f64, f64), others: &[Warp]| -> Vec<(P, Warp, (f64, f64))> {
        let all = rising.iter().chain(others).copied();
        all.filter(|warp| warp.domain_fault(range.0, range.1).is_none()).map(|warp| (parameter, warp, range)).collect()
    };
    let falling = [Warp::Acos, Warp::SqrtOneMinus];
    let list: Vec<(P, Warp, (f64, f64))> = match nodes.parameter {
        P::Mu => {
            [Warp::Linear, Warp::Sqrt, Warp::SqrtOneMinus, Warp::Acos, Warp::Square, Warp::Cbrt, log(0.01), log(0.1)]
                .map(|warp| (P::Mu, warp, unit))
                .into()
        }
        // The square of the roughness is alpha, whose root is the roughness.
        P::Roughness | P::Alpha => vec![
            (P::Roughness, Warp::Linear, unit),
            (P::Alpha, Warp::Linear, unit),
            (P::Roughness, Warp::Sqrt, unit),
            (P::Roughness, log(0.05), unit),
            (P::Alpha, Warp::Square, unit),
            (P::Roughness, Warp::Acos, unit),
            (P::Roughness, Warp::SqrtOneMinus, unit),
            (P::Roughness, Warp::Cbrt, unit),
            (P::Alpha, Warp::Cbrt, unit),
            (P::Alpha, log(0.05), unit),
            (P::Alpha, Warp::Acos, unit),
            (P::Alpha, Warp::SqrtOneMinus, unit),
        ],
        P::Eta if domain.0 >= 1.0 => {
            let roots = [any, (1.0, 3.0)].map(|range| (P::Eta, Warp::F0FourthRoot, range));
            [roots.to_vec(), over(P::Eta, (1.0, 3.0), &[log(0.0)])].concat()
        }
        P::Eta => [vec![(P::Eta, Warp::F0FourthRoot, any)], over(P::Eta, unit, &falling)].concat(),
        P::Exponent => {
            let reciprocal = (P::Exponent, Warp::Reciprocal { half: 5.0 }, any);
            [vec![reciprocal], over(P::Exponent, (0.0, 10.0), &[log(0.05)])].concat()
        }
        P::N => over(P::N, (0.1, 4.0), &[log(0.0)]),
        P::K => over(P::K, (0.0, 8.0), &[log(0.05)]),
        P::AlphaX | P::AlphaY => over(nodes.parameter, unit, &[&falling[..], &[log(0.05)]].concat()),
        p => over(p, any, &[&falling[..], &[log(0.05)]].concat()),
    };
    list.into_iter()
        .map(|(parameter, warp, range)| {
            let domain = if parameter == P::Alpha { unit } else { domain };
            let ramp = Ramp { parameter, warp, range, domain, size, flip: false, first: 0.0, step: 0.0 };
            ramp.placed(Place::Centre(0.0))
        })
        .collect()
}

/// What people add before they take a logarithm: a digit, or half of ten.
const OFFSETS: [f64; 12] = [0.001, 0.002, 0.003, 0.005, 0.01, 0.02, 0.03, 0.05, 0.1, 0.2, 0.3, 0.5];

/// Every ramp of [`ramps`], with every offset before its logarithm that people choose, flipped or not, at these places.
pub fn simple_ramps(nodes: &Axis, size: usize, places: &[Place]) -> Vec<Ramp> {
    let mut all: Vec<Ramp> = vec![];
    for ramp in ramps(nodes, size) {
        match ramp.warp {
            Warp::Log { offset } if offset > 0.0 => {
                all.extend(OFFSETS.map(|offset| Ramp { warp: Warp::Log { offset }, ..ramp }));
            }
            _ => all.push(ramp),
        }
    }
    // One parameter may have several logarithms in the list.
    let mut simple: Vec<Ramp> = vec![];
    all.retain(|ramp| {
        let is_new = !simple.contains(ramp);
        simple.push(*ramp);
        is_new
    });
    all.into_iter()
        .flat_map(|ramp| [false, true].map(|flip| Ramp { flip, ..ramp }))
        .flat_map(|ramp| places.iter().map(move |&place| ramp.placed(place)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_at_a_simple_place_is_the_axis_that_it_becomes() {
        for nodes in ["mu:9", "roughness:9", "eta:9:f0-fourth-root", "eta:9:0..1:f0-fourth-root", "sigma:9"] {
            let nodes: Axis = nodes.parse().unwrap();
            for ramp in ramps(&nodes, 16) {
                for (place, flip) in [
                    (Place::Centre(0.0), false),
                    (Place::Edge(0.0), true),
                    (Place::Centre(0.0), true),
                    (Place::Centre(1.0), false),
                    (Place::Centre(-1.0), true),
                    (Place::Edge(1.0), true),
                ] {
                    let ramp = Ramp { flip, ..ramp.placed(place) };
                    // Beyond a range that nobody knows, values may go on; a right axis ends there.
                    if ramp.shift() != Some(0.0) && ramp.range != ramp.domain {
                        continue;
                    }
                    let axis = ramp.axis_as_it_is();
                    axis.check().unwrap_or_else(|e| panic!("{axis}: {e}"));
                    for i in 0..16 {
                        let (a, b) = (ramp.value(i), axis.value(i));
                        assert!(a == b || (a - b).abs() < 1e-9 * (1.0 + b.abs()), "{axis} at {i}: {a} {b}");
                    }
                }
            }
        }
    }
}

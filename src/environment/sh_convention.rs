//! The nine coefficients as engines want them.
//!
//! The irradiance of nine coefficients is a polynomial of degree 2 in the direction. Every engine's convention is another way to
//! write that polynomial: other basis functions with other factors, and the light, the irradiance E or E/π in them. So the
//! coefficients go once to a [`Polynomial`], which an [`Orientation`] turns exactly, and from there to each convention.

use serde::{Deserialize, Serialize};

use super::orientation::Orientation;
use super::spherical_harmonics::{COSINE_LOBE, Coefficients, normalisation};

/// Whose shader reads the coefficients.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ShConvention {
    /// Kiln's own: `sh.json` alone.
    #[default]
    Kiln,
    /// Filament's `--sh-shader`: E/π of plain polynomials, basis, cosine lobe and 1/π multiplied in.
    Filament,
    /// Babylon.js' spherical polynomial: E/π in powers of x, y, z.
    Babylon,
    /// three.js' `SphericalHarmonics3`: the light itself in the orthonormal basis; the shader multiplies the cosine lobe in.
    Threejs,
    /// PlayCanvas' `ambientSH`: E/π of plain polynomials in another order.
    Playcanvas,
    /// Unity's `SphericalHarmonicsL2`: what Filament's hold, for Unity's left-handed world.
    Unity,
}

/// E/π as a polynomial in the direction, per channel; on the unit sphere x² + y² + z² = 1, so that `constant` is also that much of
/// each square.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Polynomial {
    /// Independent of the direction.
    pub constant: [f64; 3],
    /// Factors of x, y, z.
    pub linear: [[f64; 3]; 3],
    /// Factors of x², y², z².
    pub squares: [[f64; 3]; 3],
    /// Factors of yz, zx, xy: each stands at the component that it leaves out.
    pub products: [[f64; 3]; 3],
}

fn times(a: [f64; 3], s: f64) -> [f64; 3] {
    a.map(|v| v * s)
}

fn plus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|c| a[c] + b[c])
}

impl Polynomial {
    /// The polynomial of coefficients of E/π in Kiln's basis.
    pub fn new(irradiance_over_pi: &Coefficients) -> Self {
        let norm = normalisation();
        let [one, y, z, x, xy, yz, zz, xz, xx_yy] = std::array::from_fn(|i| times(irradiance_over_pi[i], norm[i]));
        Self {
            constant: plus(one, times(zz, -1.0)),
            linear: [x, y, z],
            squares: [xx_yy, times(xx_yy, -1.0), times(zz, 3.0)],
            products: [yz, xz, xy],
        }
    }

    /// The polynomial of the vector that is looked up, from that of the world's direction.
    pub fn turned(&self, orientation: &Orientation) -> Self {
        let mut turned =
            Self { constant: self.constant, linear: [[0.0; 3]; 3], squares: [[0.0; 3]; 3], products: [[0.0; 3]; 3] };
        let components = orientation.components();
        for (i, (axis, sign)) in components.into_iter().enumerate() {
            turned.linear[axis] = times(self.linear[i], sign);
            turned.squares[axis] = self.squares[i];
            // The product of the two others.
            let ((_, a), (_, b)) = (components[(i + 1) % 3], components[(i + 2) % 3]);
            turned.products[axis] = times(self.products[i], a * b);
        }
        turned
    }

    /// Its value in a direction.
    pub fn evaluate(&self, d: glam::DVec3) -> [f64; 3] {
        let products = [d.y * d.z, d.z * d.x, d.x * d.y];
        (0..3).fold(self.constant, |sum, i| {
            let squares = plus(times(self.squares[i], d[i] * d[i]), times(self.products[i], products[i]));
            plus(sum, plus(times(self.linear[i], d[i]), squares))
        })
    }

    /// The factors of 1, 3z² − 1 and x² − y²: on the sphere, what the constant and the three squares come to.
    fn harmonic(&self) -> [[f64; 3]; 3] {
        let [x, y, z] = self.squares;
        let mean = times(plus(plus(x, y), z), 1.0 / 3.0);
        let zz = times(plus(z, times(mean, -1.0)), 0.5);
        [plus(self.constant, mean), zz, times(plus(x, times(y, -1.0)), 0.5)]
    }
}

impl ShConvention {
    /// Every convention.
    pub const ALL: [Self; 6] =
        [Self::Kiln, Self::Filament, Self::Babylon, Self::Threejs, Self::Playcanvas, Self::Unity];

    /// The word that recipes use.
    pub fn name(self) -> &'static str {
        match self {
            Self::Kiln => "kiln",
            Self::Filament => "filament",
            Self::Babylon => "babylon",
            Self::Threejs => "threejs",
            Self::Playcanvas => "playcanvas",
            Self::Unity => "unity",
        }
    }

    /// What each coefficient is the factor of, in the shader.
    pub fn order(self) -> [&'static str; 9] {
        match self {
            Self::Kiln | Self::Threejs => super::spherical_harmonics::ORDER,
            Self::Filament | Self::Unity => ["1", "y", "z", "x", "xy", "yz", "3z^2-1", "xz", "x^2-y^2"],
            Self::Babylon => ["x", "y", "z", "x^2", "y^2", "z^2", "yz", "zx", "xy"],
            Self::Playcanvas => ["1", "x", "y", "z", "xz", "zy", "yx", "3z^2-1", "x^2-y^2"],
        }
    }

    /// What the coefficients hold, in words.
    pub fn holds(self) -> &'static str {
        match self {
            Self::Kiln => "E/pi, orthonormal basis",
            Self::Filament | Self::Babylon | Self::Playcanvas | Self::Unity => {
                "E/pi, factors of the polynomials as they stand"
            }
            Self::Threejs => "radiance, orthonormal basis; the shader gives E",
        }
    }

    /// Whether the shader evaluates them in the world's direction as it is, however it turns the vector that it looks up in a texture. three.js'
    /// and PlayCanvas' shaders do, whose world is Kiln's.
    pub fn is_of_the_world(self) -> bool {
        matches!(self, Self::Threejs | Self::Playcanvas)
    }

    /// The nine coefficients for a shader whose lookup vectors are turned by `orientation`, from those of E/π in Kiln's basis; see
    /// [`ShConvention::is_of_the_world`].
    pub fn coefficients(self, irradiance_over_pi: &Coefficients, orientation: &Orientation) -> Coefficients {
        let of_the_world = Orientation::default();
        let orientation = if self.is_of_the_world() { &of_the_world } else { orientation };
        let p = Polynomial::new(irradiance_over_pi).turned(orientation);
        let ([x, y, z], [yz, zx, xy]) = (p.linear, p.products);
        let [one, zz, xx_yy] = p.harmonic();
        let canonical = [one, y, z, x, xy, yz, zz, zx, xx_yy];
        match self {
            Self::Filament | Self::Unity => canonical,
            Self::Kiln => std::array::from_fn(|i| times(canonical[i], 1.0 / normalisation()[i])),
            Self::Threejs => std::array::from_fn(|i| times(canonical[i], 1.0 / (normalisation()[i] * COSINE_LOBE[i]))),
            Self::Babylon => {
                let square = |i: usize| plus(p.squares[i], p.constant);
                [x, y, z, square(0), square(1), square(2), yz, zx, xy]
            }
            Self::Playcanvas => [one, x, y, z, zx, yz, xy, zz, xx_yy],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::spherical_harmonics::{evaluate, project};
    use super::super::test_maps::random;
    use super::*;
    use glam::DVec3;
    use std::f64::consts::PI;

    fn directions() -> impl Iterator<Item = DVec3> {
        (0..200).map(|i| {
            let (y, phi) = (1.0 - (2.0 * f64::from(i) + 1.0) / 200.0, 2.4 * f64::from(i));
            let r = (1.0 - y * y).sqrt();
            DVec3::new(r * phi.cos(), y, r * phi.sin())
        })
    }

    /// The shaders' formulas as their sources give them (three.js' factors there have six digits), E/π.
    fn shader(convention: ShConvention, c: &Coefficients, n: DVec3) -> ([f64; 3], f64) {
        let DVec3 { x, y, z } = n;
        let sum = |factors: [f64; 9]| std::array::from_fn(|k| (0..9).map(|i| c[i][k] * factors[i]).sum::<f64>());
        match convention {
            ShConvention::Kiln => (evaluate(c, n), 1e-13),
            ShConvention::Filament => {
                (sum([1.0, y, z, x, y * x, y * z, 3.0 * z * z - 1.0, z * x, x * x - y * y]), 1e-13)
            }
            // HDRP's seven vectors, as it packs them: linear and constant, four products, the last.
            ShConvention::Unity => {
                let packed = |k: usize| {
                    let [a, b] =
                        [[c[3][k], c[1][k], c[2][k], c[0][k] - c[6][k]], [c[4][k], c[5][k], 3.0 * c[6][k], c[7][k]]];
                    let linear = a[0] * x + a[1] * y + a[2] * z + a[3];
                    linear + b[0] * x * y + b[1] * y * z + b[2] * z * z + b[3] * z * x + c[8][k] * (x * x - y * y)
                };
                ([0, 1, 2].map(packed), 1e-13)
            }
            ShConvention::Babylon => (sum([x, y, z, x * x, y * y, z * z, y * z, z * x, x * y]), 1e-13),
            ShConvention::Playcanvas => {
                (sum([1.0, x, y, z, x * z, z * y, y * x, 3.0 * z * z - 1.0, x * x - y * y]), 1e-13)
            }
            ShConvention::Threejs => {
                let (band1, band2) = (2.0 * 0.511664, 2.0 * 0.429043);
                let factors = [
                    0.886227,
                    band1 * y,
                    band1 * z,
                    band1 * x,
                    band2 * x * y,
                    band2 * y * z,
                    0.743125 * z * z - 0.247708,
                    band2 * x * z,
                    0.429043 * (x * x - y * y),
                ];
                (sum(factors).map(|e: f64| e / PI), 3e-6)
            }
        }
    }

    #[test]
    fn every_shaders_formula_gives_kilns_irradiance() {
        let exact = project(&random(16, 7, Some((5, 3)))).irradiance_over_pi;
        let scale = directions().flat_map(|d| evaluate(&exact, d)).fold(0.0, |m, v| f64::max(m, v.abs()));
        for convention in ShConvention::ALL {
            for orientation in
                ["x,y,z", "-x,y,z", "x,y,-z", "x,z,y", "-z,x,-y"].map(|o| o.parse::<Orientation>().unwrap())
            {
                let c = convention.coefficients(&exact, &orientation);
                for lookup in directions() {
                    let (got, tolerance) = shader(convention, &c, lookup);
                    let direction = if convention.is_of_the_world() { lookup } else { orientation.world(lookup) };
                    let wanted = evaluate(&exact, direction);
                    for k in 0..3 {
                        let off = (got[k] - wanted[k]).abs() / scale;
                        assert!(off < tolerance, "{convention:?} {orientation} {lookup}: {} {}", got[k], wanted[k]);
                    }
                }
            }
        }
    }

    #[test]
    fn a_white_furnace_is_what_the_engines_say_it_is() {
        let white = super::super::builtin::builtin("white", 16).unwrap();
        let c = project(&white).irradiance_over_pi;
        let identity = Orientation::default();
        let column = |s: ShConvention| s.coefficients(&c, &identity).map(|rgb| (rgb[0] * 1e12).round() / 1e12);
        assert_eq!(column(ShConvention::Babylon), [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
        assert_eq!(column(ShConvention::Unity), column(ShConvention::Filament));
        assert_eq!(column(ShConvention::Filament), [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert!((column(ShConvention::Threejs)[0] - (4.0 * PI).sqrt()).abs() < 1e-11);
    }

    #[test]
    fn kilns_own_convention_is_what_it_was_given() {
        let exact = project(&random(16, 2, None)).irradiance_over_pi;
        let back = ShConvention::Kiln.coefficients(&exact, &Orientation::default());
        for (a, b) in back.iter().flatten().zip(exact.iter().flatten()) {
            assert!((a - b).abs() < 1e-14, "{a} {b}");
        }
    }
}

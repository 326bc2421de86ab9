//! Which way an engine's cube is turned: a signed permutation of the axes.
//!
//! Written `x,y,z` for a cube that is looked up with the world's direction as it is, and otherwise as the world's three
//! components in terms of the vector that the shader looks up: `-x,y,z` says that the texel which a lookup of (x, y, z) finds
//! holds the radiance from (−x, y, z). An engine that negates Z before sampling wants `x,y,-z`.
//!
//! Texel centres go to texel centres, so that turning a cube is exact.

use std::fmt;
use std::str::FromStr;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::cube::{Cube, face_point, nearest_texel, texel_direction};
use crate::error::{Error, Result};

/// What the world's direction is, in terms of the vector that is looked up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Orientation {
    /// For x, y and z of the world: which component of the lookup vector, and whether it is negated.
    world: [(usize, bool); 3],
}

/// One component of a direction on a face: 1, −1, or one of the face's coordinates u and v with its sign.
pub type Term = &'static str;

impl Default for Orientation {
    fn default() -> Self {
        Self { world: [(0, false), (1, false), (2, false)] }
    }
}

impl Orientation {
    /// For x, y and z of the world: which component of the lookup vector, and whether it is negated. Each component once.
    pub(crate) fn new(world: [(usize, bool); 3]) -> Self {
        Self { world }
    }

    /// Whether the cube is looked up with the world's direction as it is.
    pub fn is_identity(&self) -> bool {
        *self == Self::default()
    }

    /// Whether left and right are exchanged (its determinant is −1).
    pub fn is_mirror(&self) -> bool {
        let [a, b, c] = self.world.map(|(axis, _)| axis);
        let odd = (a > b) ^ (a > c) ^ (b > c);
        odd ^ (self.world.iter().filter(|(_, negated)| *negated).count() % 2 == 1)
    }

    /// The world's direction that a lookup of `lookup` ought to find.
    pub fn world(&self, lookup: DVec3) -> DVec3 {
        DVec3::from(self.world.map(|(axis, negated)| if negated { -lookup[axis] } else { lookup[axis] }))
    }

    /// The vector that a shader looks up to see in the direction `world`.
    pub fn lookup(&self, world: DVec3) -> DVec3 {
        let mut lookup = DVec3::ZERO;
        for (component, (axis, negated)) in self.world.into_iter().enumerate() {
            lookup[axis] = if negated { -world[component] } else { world[component] };
        }
        lookup
    }

    /// The orientation that undoes this one: what it calls the world is what this one looks up.
    pub fn inverse(&self) -> Self {
        let mut world = [(0, false); 3];
        for (component, (axis, negated)) in self.world.into_iter().enumerate() {
            world[axis] = (component, negated);
        }
        Self { world }
    }

    /// The components (which of the lookup's, and its sign) of the world's x, y and z.
    pub fn components(&self) -> [(usize, f64); 3] {
        self.world.map(|(axis, negated)| (axis, if negated { -1.0 } else { 1.0 }))
    }

    /// The cube that the engine wants, from one that is looked up with the world's direction as it is.
    pub fn apply(&self, cube: Cube) -> Cube {
        self.gather(cube, |direction| self.world(direction))
    }

    /// The inverse of [`Orientation::apply`].
    pub fn undo(&self, cube: Cube) -> Cube {
        self.gather(cube, |direction| self.lookup(direction))
    }

    fn gather(&self, cube: Cube, from: impl Fn(DVec3) -> DVec3) -> Cube {
        if self.is_identity() {
            return cube;
        }
        let n = cube.texels.len();
        let texel = |i: usize| cube.texels[nearest_texel(cube.size, from(texel_direction(cube.size, i)))];
        Cube { size: cube.size, texels: (0..n).map(texel).collect() }
    }

    /// The world's directions that the six faces hold, in the order +X −X +Y −Y +Z −Z, in terms of u (to the right) and v (down).
    pub fn faces(&self) -> [[Term; 3]; 6] {
        std::array::from_fn(|face| {
            // Each component is a constant or ±u or ±v: three points tell which.
            let [at, along_u, along_v] =
                [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)].map(|(u, v)| self.world(face_point(face, u, v)));
            std::array::from_fn(|i| match (at[i], along_u[i] - at[i], along_v[i] - at[i]) {
                (a, _, _) if a > 0.5 => "1",
                (a, _, _) if a < -0.5 => "-1",
                (_, u, _) if u > 0.5 => "u",
                (_, u, _) if u < -0.5 => "-u",
                (_, _, v) if v > 0.5 => "v",
                _ => "-v",
            })
        })
    }
}

impl fmt::Display for Orientation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let terms =
            self.world.map(|(axis, negated)| format!("{}{}", if negated { "-" } else { "" }, ["x", "y", "z"][axis]));
        f.write_str(&terms.join(","))
    }
}

impl FromStr for Orientation {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let term = |part: &str| {
            let part = part.trim();
            let (negated, name) = part.strip_prefix('-').map_or((false, part), |rest| (true, rest));
            ["x", "y", "z"].iter().position(|axis| *axis == name).map(|axis| (axis, negated))
        };
        let terms: Option<Vec<_>> = text.split(',').map(term).collect();
        let world = terms.and_then(|terms| <[_; 3]>::try_from(terms).ok());
        let once = |world: &[(usize, bool); 3]| (0..3).all(|axis| world.iter().any(|(a, _)| *a == axis));
        world.filter(once).map(|world| Self { world }).ok_or_else(|| {
            Error::usage(
                format!("{text:?} is no orientation"),
                "name x, y and z once each, with a sign, such as x,y,-z; x,y,z is a cube that is looked up as it is",
            )
        })
    }
}

impl TryFrom<String> for Orientation {
    type Error = Error;

    fn try_from(text: String) -> Result<Self> {
        text.parse()
    }
}

impl From<Orientation> for String {
    fn from(orientation: Orientation) -> Self {
        orientation.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn every() -> Vec<Orientation> {
        let axis = |i: usize| ["x", "y", "z", "-x", "-y", "-z"][i];
        let triples = (0..216).map(|i| [i / 36, i / 6 % 6, i % 6].map(axis).join(","));
        triples.filter_map(|text| text.parse().ok()).collect()
    }

    #[test]
    fn there_are_forty_eight_and_half_of_them_are_mirrors() {
        let all = every();
        assert_eq!(all.len(), 48);
        for orientation in &all {
            assert_eq!(orientation.to_string().parse::<Orientation>().unwrap(), *orientation);
            let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| orientation.world(axis));
            assert_eq!(orientation.is_mirror(), x.cross(y).dot(z) < 0.0, "{orientation}");
            let d = DVec3::new(0.3, -0.5, 0.7);
            assert_eq!(orientation.lookup(orientation.world(d)), d, "{orientation}");
        }
        assert_eq!(all.iter().filter(|o| o.is_mirror()).count(), 24);
        for bad in ["", "x,y", "x,y,x", "x,y,z,x", "a,b,c", "--x,y,z"] {
            assert!(bad.parse::<Orientation>().is_err(), "{bad}");
        }
    }

    #[test]
    fn turning_a_cube_is_exact_and_undone() {
        let size = 5;
        let texels = (0..6 * size * size).map(|i| [i as f32; 3]).collect();
        let cube = Cube { size, texels };
        for orientation in every() {
            let turned = orientation.apply(cube.clone());
            assert_eq!(orientation.undo(turned.clone()), cube, "{orientation}");
            for i in 0..turned.texels.len() {
                let d = texel_direction(size, i);
                assert_eq!(turned.nearest(d), cube.nearest(orientation.world(d)), "{orientation} texel {i}");
            }
        }
    }

    #[test]
    fn the_faces_of_a_cube_that_is_looked_up_as_it_is_are_the_documented_ones() {
        let faces = Orientation::default().faces();
        assert_eq!(faces[0], ["1", "-v", "-u"]);
        assert_eq!(faces[3], ["u", "-1", "-v"]);
        let mirrored = "-x,y,z".parse::<Orientation>().unwrap().faces();
        assert_eq!((mirrored[0], mirrored[2]), (["-1", "-v", "-u"], ["-u", "1", "v"]));
        let z_up = "x,z,y".parse::<Orientation>().unwrap().faces();
        assert_eq!(z_up[4], ["u", "1", "-v"]);
    }
}

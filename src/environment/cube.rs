//! Cube maps: where a texel looks, and how large it is on the sphere.
//!
//! Faces come in the order +X −X +Y −Y +Z −Z; with u to the right and v down in [−1, 1] they hold the directions
//! (1, −v, −u), (−1, −v, u), (u, 1, v), (u, −1, −v), (u, −v, 1), (−u, −v, −1).

use glam::DVec3;

/// Names of the faces, in storage order.
pub const FACES: [&str; 6] = ["+X", "-X", "+Y", "-Y", "+Z", "-Z"];

/// A cube map of linear RGB radiance.
#[derive(Debug, Clone, PartialEq)]
pub struct Cube {
    /// Texels along an edge of a face.
    pub size: usize,
    /// `6 × size × size` texels: face slowest, then row from the top, then column.
    pub texels: Vec<[f32; 3]>,
}

impl Cube {
    /// One face, row by row.
    pub fn face(&self, face: usize) -> &[[f32; 3]] {
        let area = self.size * self.size;
        &self.texels[face * area..(face + 1) * area]
    }

    /// The texel in a direction: the nearest one, not filtered.
    pub fn nearest(&self, direction: DVec3) -> [f32; 3] {
        self.texels[nearest_texel(self.size, direction)]
    }

    /// Mean over the sphere of the texels as they are, weighted by their exact solid angles.
    pub fn mean(&self) -> [f64; 3] {
        let weights = solid_angles(self.size);
        let mut sum = [0.0; 3];
        for face in 0..6 {
            for (texel, weight) in self.face(face).iter().zip(&weights) {
                for c in 0..3 {
                    sum[c] += f64::from(texel[c]) * weight;
                }
            }
        }
        let total = 6.0 * weights.iter().sum::<f64>();
        sum.map(|s| s / total)
    }
}

/// Direction of a point of a face, not normalised: its largest component is ±1.
pub fn face_point(face: usize, u: f64, v: f64) -> DVec3 {
    match face {
        0 => DVec3::new(1.0, -v, -u),
        1 => DVec3::new(-1.0, -v, u),
        2 => DVec3::new(u, 1.0, v),
        3 => DVec3::new(u, -1.0, -v),
        4 => DVec3::new(u, -v, 1.0),
        _ => DVec3::new(-u, -v, -1.0),
    }
}

/// Position of an edge between texels, from −1 (edge 0) to 1 (edge `size`), antisymmetric to the last bit.
pub fn edge(size: usize, index: usize) -> f64 {
    (2.0 * index as f64 - size as f64) / size as f64
}

/// Position of the centre of a texel between its edges.
pub(super) fn centre(size: usize, index: usize) -> f64 {
    (2.0 * index as f64 + 1.0 - size as f64) / size as f64
}

/// Unit direction of the centre of texel `index` of a cube of this size, counted as [`Cube::texels`] is.
pub fn texel_direction(size: usize, index: usize) -> DVec3 {
    let (face, row, column) = (index / (size * size), index / size % size, index % size);
    face_point(face, centre(size, column), centre(size, row)).normalize()
}

/// The face that a direction meets, and where (u right, v down). On an edge the first of x, y, z wins.
pub fn locate(direction: DVec3) -> (usize, f64, f64) {
    let DVec3 { x, y, z } = direction;
    let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
    if ax >= ay && ax >= az {
        if x > 0.0 { (0, -z / ax, -y / ax) } else { (1, z / ax, -y / ax) }
    } else if ay >= az {
        if y > 0.0 { (2, x / ay, z / ay) } else { (3, x / ay, -z / ay) }
    } else if z > 0.0 {
        (4, x / az, -y / az)
    } else {
        (5, -x / az, -y / az)
    }
}

/// The texel of a cube of this size that a direction meets, counted as [`Cube::texels`] is.
pub fn nearest_texel(size: usize, direction: DVec3) -> usize {
    let (face, u, v) = locate(direction);
    // The far edge of the last texel belongs to it.
    let index = |t: f64| (((t + 1.0) / 2.0 * size as f64) as usize).min(size - 1);
    (face * size + index(v)) * size + index(u)
}

/// Exact solid angles of the texels of one face (all faces are alike), row by row.
pub fn solid_angles(size: usize) -> Vec<f64> {
    // Corner angles are odd in both coordinates, edges mirror each other to the last bit: one quarter of the face is all of it.
    let half = size / 2 + 1;
    let quarter: Vec<f64> =
        (0..half * half).map(|i| corner_angle(edge(size, size - i / half), edge(size, size - i % half))).collect();
    let corner = |row: usize, column: usize| {
        let index = (row.min(size - row)) * half + column.min(size - column);
        if (2 * row < size) == (2 * column < size) { quarter[index] } else { -quarter[index] }
    };
    (0..size)
        .flat_map(|r| (0..size).map(move |c| (r, c)))
        .map(|(r, c)| (corner(r + 1, c + 1) - corner(r, c + 1)) - (corner(r + 1, c) - corner(r, c)))
        .collect()
}

/// Signed solid angle of the rectangle between the face's centre and (u, v): the antiderivative of
/// (1 + u² + v²)^(−3/2) in both.
fn corner_angle(u: f64, v: f64) -> f64 {
    (u * v).atan2((1.0 + u * u + v * v).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn locating_a_face_point_gives_it_back() {
        for face in 0..6 {
            for (u, v) in [(0.0, 0.0), (0.3, -0.7), (-0.99, 0.98), (0.5, 0.999)] {
                let (f, a, b) = locate(face_point(face, u, v) * 3.0);
                assert!(
                    f == face && (a - u).abs() < 1e-15 && (b - v).abs() < 1e-15,
                    "{face} ({u}, {v}): {f} ({a}, {b})"
                );
            }
        }
    }

    #[test]
    fn the_convention_is_the_documented_one() {
        assert_eq!(face_point(0, 0.25, 0.5), DVec3::new(1.0, -0.5, -0.25));
        assert_eq!(face_point(1, 0.25, 0.5), DVec3::new(-1.0, -0.5, 0.25));
        assert_eq!(face_point(2, 0.25, 0.5), DVec3::new(0.25, 1.0, 0.5));
        assert_eq!(face_point(3, 0.25, 0.5), DVec3::new(0.25, -1.0, -0.5));
        assert_eq!(face_point(4, 0.25, 0.5), DVec3::new(0.25, -0.5, 1.0));
        assert_eq!(face_point(5, 0.25, 0.5), DVec3::new(-0.25, -0.5, -1.0));
    }

    #[test]
    fn solid_angles_sum_to_the_sphere_and_agree_with_the_density() {
        for size in [1, 2, 3, 5, 64, 513] {
            let angles = solid_angles(size);
            let total = 6.0 * angles.iter().sum::<f64>();
            // Each of size² differences is exact to about 4 ulp of π/6; they add up like a random walk, at worst linearly.
            let tolerance = 6.0 * 4.0 * 1.2e-16 * (size * size) as f64;
            assert!((total - 4.0 * PI).abs() <= tolerance.max(4e-15), "size {size}: {total}");
        }
        // A small texel is its area times cos³ of its angle to the axis, up to the square of its size.
        let size = 1024;
        let d = texel_direction(size, 100 * size + 900);
        let wanted = (2.0 / size as f64).powi(2) * d.x.powi(3);
        let got = solid_angles(size)[100 * size + 900];
        assert!((got / wanted - 1.0).abs() < (2.0 / size as f64).powi(2), "{got}, wanted about {wanted}");
    }
}

//! What red, green and blue are: primaries and white points, and the matrices between them.
//!
//! Primaries are CIE 1931 chromaticities (x, y). The matrix to XYZ scales the three so that (1, 1, 1) is the white with Y = 1
//! (SMPTE RP 177's construction); between different whites the eye's adaptation is Bradford's: XYZ is taken to cone-like
//! responses, each scaled by the ratio of the whites, and back. White stays (1, 1, 1) in every conversion.

use std::fmt;

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// Chromaticities (x, y) of red, green, blue and white.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "[[f64; 2]; 4]", into = "[[f64; 2]; 4]")]
pub struct Primaries {
    xy: [[f64; 2]; 4],
}

/// Primaries that have a name.
const NAMED: [(&str, Primaries); 5] = [
    ("Rec. 709", Primaries::REC709),
    ("ACEScg", Primaries::ACESCG),
    ("ACES2065-1", Primaries::ACES2065),
    ("Rec. 2020", Primaries::REC2020),
    ("Display P3", Primaries::DISPLAY_P3),
];

/// Chromaticities this near to those of a name are meant to be them: files round to three digits, or to an f32.
const SAME: f64 = 5e-4;

/// Bradford's cone-like responses of XYZ, by rows: Lam (1985), as CIECAM97s and ICC profiles use them.
const BRADFORD: [[f64; 3]; 3] = [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]];

impl Primaries {
    /// ITU-R BT.709 and sRGB, white D65: what is meant where nothing is said.
    pub const REC709: Self = Self { xy: [[0.64, 0.33], [0.3, 0.6], [0.15, 0.06], [0.3127, 0.329]] };
    /// ACEScg and ACEScc: AP1, white as in ACES (about D60).
    pub const ACESCG: Self = Self { xy: [[0.713, 0.293], [0.165, 0.83], [0.128, 0.044], [0.32168, 0.33767]] };
    /// ACES2065-1: AP0, white as in ACES.
    pub const ACES2065: Self = Self { xy: [[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.077], [0.32168, 0.33767]] };
    /// ITU-R BT.2020, white D65.
    pub const REC2020: Self = Self { xy: [[0.708, 0.292], [0.17, 0.797], [0.131, 0.046], [0.3127, 0.329]] };
    /// Display P3, white D65.
    pub const DISPLAY_P3: Self = Self { xy: [[0.68, 0.32], [0.265, 0.69], [0.15, 0.06], [0.3127, 0.329]] };

    /// The primaries with these chromaticities of red, green, blue and white; those of a name where they differ from it by no
    /// more than files round.
    ///
    /// **Errors**: numbers that are no colour space: not finite, or a white that no positive mixture makes.
    pub fn new(xy: [[f64; 2]; 4]) -> Result<Self> {
        let near = |other: &Self| {
            let pairs = xy.as_flattened().iter().zip(other.xy.as_flattened());
            pairs.fold(0.0_f64, |most, (a, b)| if most.is_nan() { most } else { most.max((a - b).abs()) }) <= SAME
        };
        let finite = xy.as_flattened().iter().all(|v| v.is_finite() && v.abs() <= 10.0);
        if let Some((_, known)) = NAMED.iter().find(|(_, known)| finite && near(known)) {
            return Ok(*known);
        }
        let primaries = Self { xy };
        let sound = finite && xy[3][1] > 0.0 && primaries.amounts().to_array().iter().all(|&a| a > 0.0 && a < 1e6);
        if !sound {
            return Err(Error::invalid(
                format!("primaries {primaries}, whose white no mixture of red, green and blue makes"),
                "correct the file's chromaticities or delete them, which means Rec. 709",
            ));
        }
        Ok(primaries)
    }

    /// What a file's header says: nothing where all eight numbers are zero, as programs write that know of none.
    ///
    /// **Errors**: as [`Primaries::new`].
    pub fn stated(xy: [[f64; 2]; 4]) -> Result<Option<Self>> {
        if xy == [[0.0; 2]; 4] { Ok(None) } else { Self::new(xy).map(Some) }
    }

    /// Chromaticities (x, y) of red, green, blue and white.
    pub fn chromaticities(&self) -> [[f64; 2]; 4] {
        self.xy
    }

    /// The name of the primaries, if they have one.
    pub fn name(&self) -> Option<&'static str> {
        NAMED.iter().find(|(_, known)| known == self).map(|(name, _)| *name)
    }

    /// RGB to CIE XYZ, white with Y = 1.
    pub fn to_xyz(&self) -> DMat3 {
        self.columns() * DMat3::from_diagonal(self.amounts())
    }

    /// What red, green and blue contribute to luminance: the middle row of [`Primaries::to_xyz`], which sums to 1.
    pub fn luminance_weights(&self) -> [f64; 3] {
        self.to_xyz().row(1).to_array()
    }

    /// From these primaries to others; the white of one becomes the white of the other.
    pub fn conversion_to(&self, other: &Self) -> DMat3 {
        if self == other {
            return DMat3::IDENTITY;
        }
        other.to_xyz().inverse() * self.adaptation_to(other) * self.to_xyz()
    }

    /// XYZ under this white to XYZ under another's.
    fn adaptation_to(&self, other: &Self) -> DMat3 {
        if self.xy[3] == other.xy[3] {
            return DMat3::IDENTITY;
        }
        let bradford = DMat3::from_cols_array_2d(&BRADFORD).transpose();
        let gain = (bradford * other.white()) / (bradford * self.white());
        bradford.inverse() * DMat3::from_diagonal(gain) * bradford
    }

    /// XYZ of red, green and blue, each with X + Y + Z = 1 (so that imaginary ones with y = 0 have them too).
    fn columns(&self) -> DMat3 {
        let [red, green, blue] =
            [0, 1, 2].map(|i| DVec3::new(self.xy[i][0], self.xy[i][1], 1.0 - self.xy[i][0] - self.xy[i][1]));
        DMat3::from_cols(red, green, blue)
    }

    fn white(&self) -> DVec3 {
        let [x, y] = self.xy[3];
        DVec3::new(x / y, 1.0, (1.0 - x - y) / y)
    }

    /// How much of each column makes white.
    fn amounts(&self) -> DVec3 {
        self.columns().inverse() * self.white()
    }
}

impl Default for Primaries {
    fn default() -> Self {
        Self::REC709
    }
}

impl fmt::Display for Primaries {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(name) = self.name() {
            return f.write_str(name);
        }
        let [r, g, b, w] = self.xy.map(|[x, y]| format!("({x:.4}, {y:.4})"));
        write!(f, "red {r}, green {g}, blue {b}, white {w}")
    }
}

impl TryFrom<[[f64; 2]; 4]> for Primaries {
    type Error = Error;

    fn try_from(xy: [[f64; 2]; 4]) -> Result<Self> {
        Self::new(xy)
    }
}

impl From<Primaries> for [[f64; 2]; 4] {
    fn from(primaries: Primaries) -> Self {
        primaries.xy
    }
}

/// Which primaries a baked environment has.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TargetColour {
    /// Rec. 709, which shaders expect unless they were told otherwise. Inputs that say nothing are Rec. 709 and stay as they are.
    #[default]
    Rec709,
    /// ACEScg.
    AcesCg,
    /// Those of the input.
    Keep,
}

impl TargetColour {
    /// The primaries that values end in, if they begin in these.
    pub fn primaries(self, from: Primaries) -> Primaries {
        match self {
            Self::Rec709 => Primaries::REC709,
            Self::AcesCg => Primaries::ACESCG,
            Self::Keep => from,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(m: DMat3) -> [[f64; 3]; 3] {
        m.transpose().to_cols_array_2d()
    }

    /// Within half a unit of the last published digit, and a little for the rounding of intermediate results there.
    fn assert_published(what: &str, got: DMat3, published: [[f64; 3]; 3], digits: i32) {
        let got = rows(got);
        for (r, c) in (0..9).map(|i| (i / 3, i % 3)) {
            let off = (got[r][c] - published[r][c]).abs();
            assert!(
                off < 0.6 * 10_f64.powi(-digits),
                "{what} [{r}][{c}]: {}, published {}",
                got[r][c],
                published[r][c]
            );
        }
    }

    #[test]
    fn matrices_are_the_published_ones() {
        // The ACES white is (0.32168, 0.33767); these are the digits of S-2014-004 as colorjs.io 0.5 (acescg.js) carries them.
        let acescg = [
            [0.6624541811085053, 0.13400420645643313, 0.1561876870049078],
            [0.27222871678091454, 0.6740817658111484, 0.05368951740793705],
            [-0.005574649490394108, 0.004060733528982826, 1.0103391003129971],
        ];
        assert_published("ACEScg to XYZ", Primaries::ACESCG.to_xyz(), acescg, 14);
        // Lengyel, Foundations of Game Engine Development 2, as quoted at computergraphics.stackexchange.com/q/9834.
        let srgb = [[3.240970, -1.537383, -0.498611], [-0.969244, 1.875968, 0.041555], [0.055630, -0.203977, 1.056972]];
        assert_published("XYZ to Rec. 709", Primaries::REC709.to_xyz().inverse(), srgb, 6);
        // The same page: Rec. 709 to ACEScg, with Bradford's adaptation.
        let ap1 = [[0.613097, 0.339523, 0.047379], [0.070194, 0.916354, 0.013452], [0.020616, 0.109570, 0.869815]];
        assert_published("Rec. 709 to ACEScg", Primaries::REC709.conversion_to(&Primaries::ACESCG), ap1, 6);
    }

    #[test]
    fn luminance_weights_are_the_published_ones() {
        let weights = Primaries::REC709.luminance_weights();
        for (got, published) in weights.into_iter().zip([0.2126, 0.7152, 0.0722]) {
            assert!((got - published).abs() < 0.5e-4, "{got}, published {published}");
        }
        for (_, primaries) in NAMED {
            assert!((primaries.luminance_weights().iter().sum::<f64>() - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn white_stays_white_and_conversions_undo_each_other() {
        for (a, from) in NAMED {
            for (b, to) in NAMED {
                let white = from.conversion_to(&to) * DVec3::ONE;
                assert!((white - DVec3::ONE).abs().max_element() < 1e-14, "{a} to {b}: {white}");
                let back = to.conversion_to(&from) * from.conversion_to(&to);
                assert!((back - DMat3::IDENTITY).abs_diff_eq(DMat3::ZERO, 1e-14), "{a} to {b}: {back}");
            }
        }
    }

    #[test]
    fn rounded_chromaticities_are_known_by_name_and_impossible_ones_refused() {
        let f32s = Primaries::ACESCG.chromaticities().map(|xy| xy.map(|v| f64::from(v as f32)));
        assert_eq!(Primaries::new(f32s).unwrap(), Primaries::ACESCG);
        let mut own = Primaries::REC709.chromaticities();
        own[1] = [0.29, 0.6];
        assert_eq!(Primaries::new(own).unwrap().name(), None);
        assert_eq!(Primaries::stated([[0.0; 2]; 4]).unwrap(), None);
        let mut broken = vec![[[0.0; 2]; 4], [[0.3, 0.3]; 4], [[f64::NAN; 2]; 4], [[f64::INFINITY; 2]; 4]];
        own[3] = [0.7, 0.2];
        broken.push(own);
        own[3] = [0.3, 0.0];
        broken.push(own);
        for xy in broken {
            let message = Primaries::new(xy).unwrap_err().to_string();
            assert!(message.contains("primaries") && message.contains("; correct"), "{message}");
        }
    }
}

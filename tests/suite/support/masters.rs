//! What `identify` cannot name yet.

/// Named tables whose quantities have no master.
pub const WITHOUT_MASTER: [&str; 10] = [
    "ltc-matrix-m00",
    "ltc-lobe",
    "ltc-burley",
    "ltc-charlie",
    "cloth-split",
    "generalized-schlick",
    "generalized-schlick-dielectric",
    "schlick-dielectric",
    "schlick-transmittance",
    "schlick-dielectric-inside",
];

//! A room with labels on its walls, and whether a mirror shows it as they read.

/// Whether a mirror sphere shows `builtin:orientation`, `width` texels wide, the way its labels read: what is seen at a normal (with the
/// colour there) is what lies in the direction of the world that `mirrored` says, and in no other that turns or mirrors of the axes make of it.
pub fn assert_reads(width: usize, pixels: &[([f64; 3], [f64; 3])], mirrored: impl Fn([f64; 3]) -> [f64; 3]) {
    let room = kiln::environment::builtin("orientation", width).expect("an environment");
    let off = |turn: &dyn Fn([f64; 3]) -> [f64; 3]| {
        let squares = pixels.iter().map(|(normal, colour)| {
            let there = room.radiance(glam::DVec3::from(turn(mirrored(*normal))));
            (0..3).map(|c| (colour[c] - f64::from(there[c])).powi(2)).sum::<f64>()
        });
        (squares.sum::<f64>() / pixels.len() as f64).sqrt()
    };
    let right = off(&|d| d);
    for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1], [2, 1, 0]] {
        for signs in 0..8 {
            let turn = |d: [f64; 3]| [0, 1, 2].map(|c| if signs >> c & 1 == 1 { -d[order[c]] } else { d[order[c]] });
            let wrong = off(&turn);
            let same = signs == 0 && order == [0, 1, 2];
            // What filters blur of letters and edges is a third of what walls in the wrong place make out in a sharp mirror, six tenths in
            // Filament's of roughness 0.18; a mirror that hangs the wrong way finds another way that is off by as little.
            assert!(same || right < 0.8 * wrong, "axes {order:?}, signs {signs:03b}: off by {wrong}, as it is {right}");
        }
    }
}

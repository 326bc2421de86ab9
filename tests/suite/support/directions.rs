//! An environment whose filtered levels are known in closed form: linear in the direction.

use kiln::format::{Image, exr};
use kiln::pack::Number;
use std::path::Path;

/// The environment (1 + x/2, 1 + y/2, 1 + z/2): every direction has a colour of its own, and every zonal filter only fades it.
pub fn directions(folder: &Path) {
    let (width, height) = (256, 128);
    let mut texels: Vec<f32> = vec![];
    for i in 0..width * height {
        let phi = ((i % width) as f64 + 0.5) / width as f64 * std::f64::consts::TAU - std::f64::consts::PI;
        let theta = ((i / width) as f64 + 0.5) / height as f64 * std::f64::consts::PI;
        let d = [theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin()];
        texels.extend(d.map(|c| (1.0 + c / 2.0) as f32));
    }
    let image = Image::new(width, height, &["R", "G", "B"], texels).expect("a picture");
    std::fs::write(folder.join("directions.exr"), exr::encode(&image, Number::F32).expect("an OpenEXR").0)
        .expect("a folder");
}

/// How much of what is linear in the direction a level keeps: ∫ K c dω for K ∝ c/(1 − βc)², β = (1 − α²)/(1 + α²).
pub fn kept(roughness: f64) -> f64 {
    let alpha = roughness.powi(2);
    if alpha < 1e-3 {
        return 1.0;
    }
    let beta = (1.0 - alpha * alpha) / (1.0 + alpha * alpha);
    // c = 1 − t³: midpoints crowd where the kernel is narrow.
    let n = 20_000;
    let (mut weighted, mut total) = (0.0, 0.0);
    for i in 0..n {
        let t = (f64::from(i) + 0.5) / f64::from(n);
        let c = 1.0 - t.powi(3);
        let k = c / (1.0 - beta * c).powi(2) * t * t;
        weighted += k * c;
        total += k;
    }
    weighted / total
}

use super::*;
use crate::environment::builtin;
use std::time::Instant;

fn aims(panorama: &Panorama) -> Vec<DVec3> {
    let (column, row, _) = panorama.peak();
    let sun = panorama.texel_box(column, row).middle();
    let (side, up) = sun.any_orthonormal_pair();
    let mut directions = vec![sun, -sun, DVec3::Y, -DVec3::Y, DVec3::ONE.normalize(), DVec3::X, DVec3::Z];
    for angle in [0.005, 0.02, 0.05, 0.1, 0.3, 1.0, 1.56, 1.5657, 1.5708, 1.576, 1.6] {
        for d in [side, up, (side - up) * 0.5f64.sqrt()] {
            directions.push(sun * f64::cos(angle) + d * f64::sin(angle));
        }
    }
    for i in 0..24 {
        let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 24.0;
        let (sin, cos) = (f64::from(i) * 2.4).sin_cos();
        let r = (1.0 - z * z).sqrt();
        directions.push(DVec3::new(r * cos, z, r * sin));
    }
    directions
}

#[test]
#[ignore]
fn experiment() {
    for map in std::env::var("MAP").unwrap_or("sun,sky".into()).split(',') {
        let panorama = if map.ends_with("hdr") {
            super::super::load(map, Default::default(), Default::default()).unwrap().0
        } else {
            builtin(map, 1024).unwrap()
        };
        let (mean, directions, exact) = (panorama.mean(), aims(&panorama), FullSum::new(&panorama));
        let alphas: Vec<f64> =
            std::env::var("ALPHA").unwrap_or("0.0625,0.25,0.5625,1".into()).split(',').map(|a| a.parse().unwrap()).collect();
        let kernels: Vec<Kernel> = alphas.iter().map(|&a| Kernel::new(a)).collect();
        let mut size = 128;
        for instructions in InstructionSet::available() {
            let start = Instant::now();
            let zonal = Zonal::new(&panorama, &kernels, instructions);
            println!("{map} {} new {:?}", instructions.name(), start.elapsed());
            size = 128;
            for kernel in &kernels {
                let start = Instant::now();
                let function = zonal.function(kernel);
                let made = start.elapsed();
                function.cube(size, &|_| {});
                let part = function.rings.as_ref().unwrap().0;
                let plan = part.plans.iter().find(|p| p.kernel == *kernel).unwrap();
                println!(
                    "  alpha {} L {} made {made:?} cube {size} {:?} peeled {} darkest {:.1e} truncation {:.1e} any {:.1e} grid {:?}",
                    kernel.alpha(), function.degree, start.elapsed() - made, part.peel.len(), plan.darkest,
                    function.truncation, plan.any_map, plan.grid
                );
                size /= 2;
            }
        }
        if std::env::var("TIME").is_ok() {
            continue;
        }
        let zonal = Zonal::new(&panorama, &kernels, InstructionSet::detect());
        for kernel in &kernels {
            let function = zonal.function(kernel);
            let mut worst = (0.0, 0.0, 0, 0);
            let start = Instant::now();
            let wanted: Vec<_> = directions.par_iter().map(|d| exact.evaluate(*d, kernel)).collect();
            let full = start.elapsed() / directions.len() as u32;
            for (i, (d, wanted)) in directions.iter().zip(wanted).enumerate() {
                let got = function.at(*d);
                for c in 0..3 {
                    let off = (got[c] - wanted[c]).abs() / wanted[c].max(1e-3 * mean[c]);
                    if off > worst.0 {
                        worst = (off, wanted[c] / mean[c], i, c);
                    }
                }
            }
            println!("  alpha {}: worst {worst:?}; full sum {full:?}", kernel.alpha());
        }
        let _ = size;
    }
}

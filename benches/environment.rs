//! How long the environment filters take, and how much memory: on the built-in sky of 1024 × 512 texels (or on a file of that size that
//! `KILN_BENCH_MAP` names: dark rooms take longer), or on synthetic maps (noise, lamps, one sun of 1e5) of the size that a case names. One
//! thread where a case does not say two; the best instructions that this processor has, or those of the baseline.
//!
//! `cargo bench --bench environment -- --only "1024 ×"`; see the other benchmark for how to read and to count instructions. The largest
//! map (1.6 GB) is only made for `--only 16384`.

mod harness;

use harness::Case;
use kiln::environment::{
    FullSum, InstructionSet, Kernel, MonteCarlo, Panorama, Reading, Zonal, area_average, builtin, load,
};
use rayon::prelude::*;
use std::hint::black_box;
use std::path::PathBuf;
use std::process::Command;
use std::sync::LazyLock;

static SKY: LazyLock<Panorama> = LazyLock::new(|| match map_file() {
    Some(file) => {
        let name = file.to_str().expect("a path in UTF-8");
        let (map, _) = load(name, &Reading::default()).expect("KILN_BENCH_MAP names a panorama");
        assert_eq!((map.width(), map.height()), (1024, 512), "KILN_BENCH_MAP wants 1024 × 512 texels");
        map
    }
    None => builtin("sky", 1024).expect("built in"),
});
static LARGE: LazyLock<Panorama> = LazyLock::new(|| synthetic(4096));
static HUGE: LazyLock<Panorama> = LazyLock::new(|| synthetic(8192));

/// A soft gradient with noise, lamps here and there, and a sun of 2 × 2 texels.
fn synthetic(width: usize) -> Panorama {
    let height = width / 2;
    let (sun_column, sun_row) = (width / 3, height / 4);
    let texel = |i: usize| {
        let (column, row) = (i % width, i / width);
        let noise = (i as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40;
        let lamp = if noise < 20 { 50.0 } else { 1.0 };
        let noise = noise as f32 / (1 << 24) as f32;
        let light = (1.2 - row as f32 / height as f32) * (0.75 + 0.5 * noise) * lamp;
        let sun = column / 2 == sun_column / 2 && row / 2 == sun_row / 2;
        if sun { [1e5, 0.9e5, 0.8e5] } else { [0.6 * light, 0.8 * light, light] }
    };
    Panorama::new(width, height, (0..width * height).map(texel).collect()).expect("a 2:1 map")
}

/// A map of the user's own.
fn map_file() -> Option<PathBuf> {
    std::env::var_os("KILN_BENCH_MAP").map(PathBuf::from)
}

/// The sky as a Radiance file, its rows as run lengths (literals only).
fn sky_file() -> PathBuf {
    let (width, height) = (SKY.width(), SKY.height());
    let mut bytes = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n").into_bytes();
    for row in 0..height {
        bytes.extend([2, 2, (width >> 8) as u8, width as u8]);
        let pixels: Vec<[u8; 4]> = SKY.row(row).iter().map(|&t| rgbe(t)).collect();
        for channel in 0..4 {
            for part in pixels.chunks(128) {
                bytes.push(part.len() as u8);
                bytes.extend(part.iter().map(|p| p[channel]));
            }
        }
    }
    let path = std::env::temp_dir().join(format!("kiln-bench-{}.hdr", std::process::id()));
    std::fs::write(&path, bytes).expect("room for 2 MB");
    path
}

fn rgbe(texel: [f32; 3]) -> [u8; 4] {
    let largest = texel[0].max(texel[1]).max(texel[2]);
    if largest < 1e-32 {
        return [0; 4];
    }
    let exponent = largest.log2().floor() as i32 + 1;
    let scale = 256.0 * 2f32.powi(-exponent);
    let [r, g, b] = texel.map(|v| (v * scale) as u8);
    [r, g, b, (exponent + 128) as u8]
}

/// The whole command, as a user runs it: decoding, filtering, checks against the full sum, certificate, three files.
fn whole_command(threads: usize) {
    static FILE: LazyLock<PathBuf> = LazyLock::new(|| map_file().unwrap_or_else(sky_file));
    let out = std::env::temp_dir().join(format!("kiln-bench-{}", std::process::id()));
    let mut command = Command::new(env!("CARGO_BIN_EXE_kiln"));
    command.arg("env").arg(&*FILE).arg("--out").arg(&out).args(["--threads", &threads.to_string(), "--quiet"]);
    let status = command.status().expect("the command runs");
    assert!(status.success(), "kiln env failed");
    std::fs::remove_dir_all(&out).expect("written by this run");
}

fn monte_carlo(size: usize, alpha: f64, samples: usize) {
    black_box(MonteCarlo::new(&SKY, 0).filter(size, &Kernel::new(alpha), samples, &|_| {}));
}

fn full_sum(size: usize, alpha: f64) {
    black_box(FullSum::new(&SKY).filter(size, &Kernel::new(alpha), &|_| {}));
}

/// Level 0 of a chain from `size` by area average, the others with these alphas, and irradiance at 32²: the filter alone, nothing measured for a
/// certificate, all levels at once as the command does them.
fn chain(panorama: &Panorama, size: usize, alphas: &[f64], instructions: InstructionSet) {
    levels(panorama, size, alphas, instructions, true);
}

fn zonal(panorama: &Panorama, size: usize, alphas: &[f64], instructions: InstructionSet) {
    levels(panorama, size, alphas, instructions, false);
}

fn levels(panorama: &Panorama, size: usize, alphas: &[f64], instructions: InstructionSet, with_first: bool) {
    let kernels: Vec<Kernel> = alphas.iter().map(|&alpha| Kernel::new(alpha)).collect();
    let zonal = Zonal::new(panorama, &kernels, instructions);
    let level = |level: usize| match level.checked_sub(1) {
        Some(i) => zonal.function(&kernels[i]).cube(size >> level, &|_| {}),
        None => area_average(panorama, size),
    };
    (usize::from(!with_first)..kernels.len() + 1).into_par_iter().with_max_len(1).map(level).for_each(|cube| {
        black_box(cube);
    });
    black_box(zonal.function(&Kernel::new(1.0)).cube(32, &|_| {}));
}

/// The default chain from 256², and one that begins at alpha 0.018.
const DEFAULT: [f64; 4] = [0.0625, 0.25, 0.5625, 1.0];
const SHARP: [f64; 4] = [0.018, 0.25, 0.5625, 1.0];
/// The default chain from 1024².
const LONG: [f64; 6] = [1.0 / 36.0, 1.0 / 9.0, 0.25, 4.0 / 9.0, 25.0 / 36.0, 1.0];

static TWO: LazyLock<rayon::ThreadPool> =
    LazyLock::new(|| rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("two threads"));

fn on_two(f: impl Fn() + Send + Sync + 'static) -> Box<dyn Fn()> {
    Box::new(move || TWO.install(&f))
}

fn main() {
    LazyLock::force(&SKY);
    let (plain, best) = (InstructionSet::Baseline, InstructionSet::detect());
    eprintln!("instructions: {} where a row does not say {}", best.name(), plain.name());
    let mut cases: Vec<Case> = vec![
        ("area average, 256²", Box::new(|| drop(black_box(area_average(&SKY, 256))))),
        ("zonal, 1024 × 512 → 256²", Box::new(move || zonal(&SKY, 256, &DEFAULT, best))),
        ("chain, 1024 × 512 → 256²", Box::new(move || chain(&SKY, 256, &DEFAULT, best))),
        ("chain, 1024 × 512 → 256², 2 threads", on_two(move || chain(&SKY, 256, &DEFAULT, best))),
        ("chain, 1024 × 512 → 256², baseline", Box::new(move || chain(&SKY, 256, &DEFAULT, plain))),
        ("chain, 1024 × 512 → 256², baseline, 2 threads", on_two(move || chain(&SKY, 256, &DEFAULT, plain))),
        ("chain from alpha 0.018, 1024 × 512", Box::new(move || chain(&SKY, 256, &SHARP, best))),
        ("chain from alpha 0.018, 1024 × 512, 2 threads", on_two(move || chain(&SKY, 256, &SHARP, best))),
        ("chain from alpha 0.018, 1024 × 512, baseline, 2 threads", on_two(move || chain(&SKY, 256, &SHARP, plain))),
        ("chain, 4096 × 2048 → 1024²", Box::new(move || chain(&LARGE, 1024, &LONG, best))),
        ("chain, 4096 × 2048 → 1024², 2 threads", on_two(move || chain(&LARGE, 1024, &LONG, best))),
        ("chain, 4096 × 2048 → 1024², baseline, 2 threads", on_two(move || chain(&LARGE, 1024, &LONG, plain))),
        ("whole command, 1024 × 512", Box::new(|| whole_command(1))),
        ("whole command, 1024 × 512, 2 threads", Box::new(|| whole_command(2))),
        ("chain, 8192 × 4096 → 1024², 2 threads", on_two(move || chain(&HUGE, 1024, &LONG, best))),
        ("full sum, 16², alpha 1/4", Box::new(|| full_sum(16, 0.25))),
        ("Monte Carlo, 32², alpha 1/16, 1024 samples", Box::new(|| monte_carlo(32, 0.0625, 1024))),
        ("Monte Carlo, 32², alpha 1/4, 1024 samples", Box::new(|| monte_carlo(32, 0.25, 1024))),
        ("Monte Carlo, 32², alpha 1, 1024 samples", Box::new(|| monte_carlo(32, 1.0, 1024))),
    ];
    if std::env::args().any(|argument| argument == "16384") {
        let panorama = synthetic(16384);
        cases.push(("chain, 16384 × 8192 → 1024², 2 threads", on_two(move || chain(&panorama, 1024, &LONG, best))));
    }
    harness::run(&cases);
}

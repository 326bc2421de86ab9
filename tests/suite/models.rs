//! Every lobe: sampling agrees with its density, warps invert, reciprocity and energy hold.

use glam::DVec3;
use kiln::math::frame::{direction_with_cosine, disk_to_square, square_to_disk};
use kiln::math::quadrature::gauss_legendre;
use kiln::math::sobol::PointSet;
use kiln::math::statistics::chi_square_tail;
use kiln::model::Lobe;
use kiln::model::beckmann::Beckmann;
use kiln::model::burley::Burley;
use kiln::model::charlie::{Charlie, Visibility};
use kiln::model::dielectric::Dielectric;
use kiln::model::ggx::{Ggx, Smith};
use kiln::model::lambert::Lambert;
use kiln::model::oren_nayar::{Eon, Fujii, OrenNayar};
use std::f64::consts::TAU;

/// A lobe, and the largest weight that its samples have where that is known.
struct Subject {
    name: String,
    lobe: Box<dyn Lobe>,
    most: f64,
}

/// Every lobe of the crate, at widths from narrow to wide, isotropic or not.
fn lobes() -> Vec<Subject> {
    let mut lobes = vec![Subject { name: "lambert".to_owned(), lobe: Box::new(Lambert { c: 1.0 }), most: 1.0 }];
    for smith in Smith::ALL {
        for (alpha_x, alpha_y) in [(0.05, 0.05), (0.3, 0.3), (1.0, 1.0), (0.1, 0.6)] {
            let name = format!("ggx {} {alpha_x} {alpha_y}", smith.name());
            // The approximations know one width only, and are proved to stay below the exact ones where there is one.
            let exact = matches!(smith, Smith::Correlated | Smith::Separable);
            let most = if exact || alpha_x == alpha_y { 1.0 } else { f64::INFINITY };
            lobes.push(Subject { name, lobe: Box::new(Ggx { alpha_x, alpha_y, smith }), most });
        }
    }
    for smith in [Smith::Correlated, Smith::Separable] {
        for alpha in [0.05, 0.3, 1.0] {
            let name = format!("beckmann {} {alpha}", smith.name());
            lobes.push(Subject { name, lobe: Box::new(Beckmann { alpha, smith }), most: f64::INFINITY });
        }
    }
    for visibility in Visibility::ALL {
        for alpha in [0.05, 0.3, 1.0] {
            let name = format!("charlie {} {alpha}", visibility.name());
            lobes.push(Subject { name, lobe: Box::new(Charlie { alpha, visibility }), most: f64::INFINITY });
        }
    }
    for roughness in [0.2, 1.0] {
        let mut diffuse = |name: String, lobe: Box<dyn Lobe>| lobes.push(Subject { name, lobe, most: f64::INFINITY });
        for renormalised in [false, true] {
            let lobe = Burley { roughness, renormalised };
            diffuse(format!("{lobe:?}"), Box::new(lobe));
        }
        let oren_nayar = OrenNayar { sigma: roughness };
        diffuse(format!("{oren_nayar:?}"), Box::new(oren_nayar));
        let fujii = Fujii { roughness };
        diffuse(format!("{fujii:?}"), Box::new(fujii));
        let eon = Eon { roughness, rho: 0.8 };
        diffuse(format!("{eon:?}"), Box::new(eon));
    }
    lobes
}

/// Independent uniform numbers for tests: the first points of unrelated scrambles would be too even for a chi-square test.
struct Uniform(u64);

impl Uniform {
    fn next(&mut self) -> f64 {
        // SplitMix64.
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn pair(&mut self) -> [f64; 2] {
        [self.next(), self.next()]
    }

    /// Even over the upper hemisphere.
    fn direction(&mut self) -> DVec3 {
        let (z, phi) = (self.next(), TAU * self.next());
        let r = ((1.0 - z) * (1.0 + z)).sqrt();
        DVec3::new(r * phi.cos(), r * phi.sin(), z)
    }
}

#[test]
fn reciprocity_holds_to_1e_12_relative_on_ten_thousand_random_pairs() {
    for Subject { name, lobe, .. } in lobes() {
        let mut random = Uniform(1);
        for _ in 0..10_000 {
            let (wo, wi) = (random.direction(), random.direction());
            let (f, back) = (lobe.f(wo, wi), lobe.f(wi, wo));
            assert!((f - back).abs() <= 1e-12 * f, "{name}: f({wo}, {wi}) = {f}, but {back} the other way round");
        }
    }
}

#[test]
fn sampling_is_undone_by_its_inverse() {
    for Subject { name, lobe, .. } in lobes() {
        let mut random = Uniform(2);
        for _ in 0..2000 {
            let (wo, u) = (random.direction(), random.pair());
            let Some(sample) = lobe.sample(wo, u) else { continue };
            let back = lobe.invert(wo, sample.wi);
            for (a, b) in u.into_iter().zip(back) {
                // The azimuth is a circle: 0 and 1 are the same.
                let off = (a - b).abs().min(1.0 - (a - b).abs());
                assert!(off < 1e-8, "{name} from {wo}: {u:?} came back as {back:?}");
            }
        }
    }
}

#[test]
fn disk_warp_is_undone_by_its_inverse() {
    let mut random = Uniform(3);
    for _ in 0..10_000 {
        let u = random.pair();
        let (x, y) = square_to_disk(u);
        let back = disk_to_square(x, y);
        assert!((u[0] - back[0]).abs() < 1e-14 && (u[1] - back[1]).abs() < 1e-13, "{u:?} came back as {back:?}");
    }
}

#[test]
fn weight_of_a_sample_is_f_cos_over_pdf_and_never_above_one() {
    for Subject { name, lobe, most } in lobes() {
        let mut random = Uniform(4);
        for _ in 0..5000 {
            let (wo, u) = (random.direction(), random.pair());
            let Some(s) = lobe.sample(wo, u) else { continue };
            let pdf = lobe.pdf(wo, s.wi);
            let weight = lobe.f(wo, s.wi) * s.wi.z / pdf;
            // The half-vector is found again from wo + wi, which loses digits by 1/alpha² at most.
            assert!((s.pdf / pdf - 1.0).abs() < 1e-9, "{name}: pdf {} drawn, {pdf} evaluated", s.pdf);
            assert!((s.weight - weight).abs() < 1e-9 * weight.max(1e-3), "{name}: weight {} drawn, {weight}", s.weight);
            assert!(s.weight <= most + 1e-12, "{name}: weight {} reflects more than comes in", s.weight);
        }
    }
}

/// Cells of the chi-square test over a hemisphere: equal areas, so that each needs the same quadrature.
const CELLS_Z: usize = 10;
const CELLS_PHI: usize = 20;
const DRAWS: usize = 200_000;
/// One false alarm in 10⁵ per test, over some two hundred tests: 1 in 500 for the whole; seeds are fixed.
const SIGNIFICANCE: f64 = 1e-5;
/// Cells that expect fewer are pooled: below five the statistic is not chi-square distributed.
const FEWEST_EXPECTED: f64 = 5.0;

#[test]
fn samples_follow_their_density_by_chi_square() {
    for Subject { name, lobe, .. } in lobes() {
        for mu in [1.0, 0.7, 0.15] {
            let wo = direction_with_cosine(mu);
            let draw = |random: &mut Uniform| lobe.sample(wo, random.pair()).map(|s| s.wi);
            chi_square(&format!("{name} at mu {mu}"), draw, |wi| lobe.pdf(wo, wi), false);
        }
    }
}

#[test]
fn light_that_a_dielectric_reflects_and_lets_through_follows_its_density_by_chi_square() {
    for (alpha, eta) in [(0.05, 1.5), (0.3, 1.5), (1.0, 2.5), (0.1, 1.0 / 1.5), (0.5, 0.9), (1.0, 0.4)] {
        for mu in [1.0, 0.7, 0.15] {
            let (interface, wo) =
                (Dielectric { facets: Ggx::isotropic(alpha, Smith::Correlated), eta }, direction_with_cosine(mu));
            let draw = |random: &mut Uniform| interface.sample(wo, [random.next(), random.next(), random.next()]);
            chi_square(&format!("alpha {alpha} eta {eta} mu {mu}"), draw, |w| interface.pdf(wo, w), true);
        }
    }
}

/// Holds draws against their density in cells of the upper hemisphere, or of both; what is `None` is one cell more.
fn chi_square(
    name: &str,
    mut draw: impl FnMut(&mut Uniform) -> Option<DVec3>,
    pdf: impl Fn(DVec3) -> f64,
    both_sides: bool,
) {
    let mut random = Uniform(5);
    let bands = if both_sides { 2 * CELLS_Z } else { CELLS_Z };
    let mut seen = vec![0.0; bands * CELLS_PHI];
    let mut nowhere = DRAWS as f64;
    for _ in 0..DRAWS {
        if let Some(w) = draw(&mut random) {
            let phi = w.y.atan2(w.x).rem_euclid(TAU);
            let z = ((w.z.abs() * CELLS_Z as f64) as usize).min(CELLS_Z - 1) + if w.z < 0.0 { CELLS_Z } else { 0 };
            let p = ((phi / TAU * CELLS_PHI as f64) as usize).min(CELLS_PHI - 1);
            seen[z * CELLS_PHI + p] += 1.0;
            nowhere -= 1.0;
        }
    }
    let expected: Vec<f64> = (0..seen.len()).map(|i| DRAWS as f64 * mass(&pdf, i)).collect();
    let rest = (nowhere, DRAWS as f64 - expected.iter().sum::<f64>());
    let (mut statistic, mut degrees, mut pool) = (0.0, 0, (0.0, 0.0));
    for (o, e) in seen.into_iter().zip(expected).chain([rest]) {
        if e < FEWEST_EXPECTED {
            pool = (pool.0 + o, pool.1 + e);
        } else {
            statistic += (o - e) * (o - e) / e;
            degrees += 1;
        }
    }
    if pool.1 >= FEWEST_EXPECTED {
        statistic += (pool.0 - pool.1) * (pool.0 - pool.1) / pool.1;
        degrees += 1;
    } else {
        assert!(pool.0 < 40.0, "{name}: {} draws where {} were expected", pool.0, pool.1);
    }
    let p = chi_square_tail(statistic, degrees - 1);
    assert!(p > SIGNIFICANCE, "{name}: chi-square {statistic:.1} with {degrees} cells, p = {p:e}");
}

/// The integral of the pdf over a cell, by Gauss–Legendre on quarters of it until quartering changes nothing.
fn mass(pdf: &impl Fn(DVec3) -> f64, cell: usize) -> f64 {
    let (band, phi) = (cell / CELLS_PHI, (cell % CELLS_PHI) as f64 / CELLS_PHI as f64 * TAU);
    let (z, side) = ((band % CELLS_Z) as f64 / CELLS_Z as f64, if band < CELLS_Z { 1.0 } else { -1.0 });
    let rule = gauss_legendre(4);
    let product = |[z, dz, phi, dphi]: [f64; 4]| {
        rule.integrate(|x| {
            rule.integrate(|y| {
                let (z, phi) = (z + x * dz, phi + y * dphi);
                let r = ((1.0 - z) * (1.0 + z)).sqrt();
                pdf(DVec3::new(r * phi.cos(), r * phi.sin(), side * z))
            })
        }) * dz
            * dphi
    };
    // Never fewer than 4³ parts: a peak between the first few nodes would be missed.
    refine([z, 1.0 / CELLS_Z as f64, phi, TAU / CELLS_PHI as f64], &product, 0)
}

fn refine(cell: [f64; 4], product: &impl Fn([f64; 4]) -> f64, depth: usize) -> f64 {
    let [z, dz, phi, dphi] = [cell[0], cell[1] / 2.0, cell[2], cell[3] / 2.0];
    let quarters =
        [[z, dz, phi, dphi], [z + dz, dz, phi, dphi], [z, dz, phi + dphi, dphi], [z + dz, dz, phi + dphi, dphi]];
    if depth >= 2 {
        let (whole, parts) = (product(cell), quarters.iter().map(|&q| product(q)).sum::<f64>());
        // (1e-7 of all draws is a hundredth of one.)
        if (whole - parts).abs() < 1e-7 || depth == 12 {
            return parts;
        }
    }
    quarters.into_iter().map(|q| refine(q, product, depth + 1)).sum()
}

#[test]
fn anisotropic_albedo_is_never_above_one_and_reciprocal_on_average() {
    // Turning the lobe by a quarter and swapping its widths is the same lobe.
    let points = PointSet::<2>::new(9, 0, 1 << 12);
    let albedo = |alpha_x, alpha_y, wo: DVec3| {
        let lobe = Ggx { alpha_x, alpha_y, smith: Smith::Correlated };
        points.points().iter().filter_map(|&u| lobe.sample(wo, u)).map(|s| s.weight).sum::<f64>() / 4096.0
    };
    for mu in [0.1, 0.5, 0.9] {
        let wo = direction_with_cosine(mu);
        let turned = DVec3::new(-wo.y, wo.x, wo.z);
        let (a, b) = (albedo(0.1, 0.7, wo), albedo(0.7, 0.1, turned));
        assert!(a <= 1.0 && (a - b).abs() < 2e-3, "mu {mu}: {a} and {b}");
    }
}

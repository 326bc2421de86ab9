//! Means with honest errors, and the distributions that tests of chance need.

/// The mean of independent `replicates` and its standard error.
///
/// The standard error is that of the mean of R independent, identically distributed values: s/√R with the unbiased
/// sample variance s². One replicate has no spread to learn from: its standard error is infinite.
pub fn mean_and_standard_error(replicates: &[f64]) -> (f64, f64) {
    let n = replicates.len() as f64;
    let mean = replicates.iter().sum::<f64>() / n;
    if replicates.len() < 2 {
        return (mean, f64::INFINITY);
    }
    let squares = replicates.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
    (mean, (squares / (n - 1.0) / n).sqrt())
}

/// The probability that a chi-square variable of `degrees` of freedom exceeds `statistic`.
///
/// Source: the regularised upper incomplete gamma function Q(degrees/2, statistic/2), by its series below the mean and
/// its continued fraction (modified Lentz) above; DLMF 8.7.1 and 8.9.2.
pub fn chi_square_tail(statistic: f64, degrees: usize) -> f64 {
    let (a, x) = (degrees as f64 / 2.0, statistic / 2.0);
    if x <= 0.0 {
        return 1.0;
    }
    let prefactor = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > sum * 1e-16 {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        1.0 - prefactor * sum
    } else {
        const TINY: f64 = 1e-300;
        let mut b = x + 1.0 - a;
        let mut c = 1.0 / TINY;
        let mut d = 1.0 / b;
        let mut h = d;
        for i in 1..10_000 {
            let an = -f64::from(i) * (f64::from(i) - a);
            b += 2.0;
            d = 1.0 / nonzero(an * d + b, TINY);
            c = nonzero(b + an / c, TINY);
            h *= d * c;
            if (d * c - 1.0).abs() < 1e-15 {
                break;
            }
        }
        prefactor * h
    }
}

fn nonzero(x: f64, tiny: f64) -> f64 {
    if x.abs() < tiny { tiny } else { x }
}

/// ln Γ(x) for x > 0 by Stirling's series after shifting x above 10; DLMF 5.11.1.
fn ln_gamma(x: f64) -> f64 {
    let (mut x, mut shift) = (x, 0.0);
    while x < 10.0 {
        shift += x.ln();
        x += 1.0;
    }
    let y = 1.0 / (x * x);
    let series = (1.0 / 12.0 - y * (1.0 / 360.0 - y * (1.0 / 1260.0 - y * (1.0 / 1680.0 - y / 1188.0)))) / x;
    (x - 0.5) * x.ln() - x + 0.5 * std::f64::consts::TAU.ln() + series - shift
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chi_square_tail_of_two_degrees_is_an_exponential() {
        for x in [0.1, 1.0, 2.0, 5.0, 20.0, 60.0] {
            let (got, wanted) = (chi_square_tail(x, 2), (-x / 2.0_f64).exp());
            assert!((got - wanted).abs() <= 1e-12 * wanted.max(1e-3), "x = {x}: got {got}, wanted {wanted}");
        }
    }

    #[test]
    fn chi_square_tail_of_a_hundred_degrees_at_its_tabulated_percentile_is_one_percent() {
        let got = chi_square_tail(135.806_723, 100);
        assert!((got - 0.01).abs() < 1e-8, "got {got}");
    }

    #[test]
    fn standard_error_of_a_known_sample() {
        let (mean, error) = mean_and_standard_error(&[1.0, 2.0, 3.0, 4.0]);
        assert_eq!(mean, 2.5);
        assert!((error - (5.0_f64 / 3.0 / 4.0).sqrt()).abs() < 1e-15);
        assert_eq!(mean_and_standard_error(&[1.0]).1, f64::INFINITY);
    }
}

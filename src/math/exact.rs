//! Sums of squares as if computed in twice the precision.

/// Σ a² − Σ b², correct to about one rounding of the result even where the sums nearly cancel.
///
/// Each square is split without error into its rounded value and the rest (one fused multiply-add), and so is each addition
/// (Knuth's two-sum); the rests are added up beside. `mul_add` is exact on every machine, so the bits do not depend on it.
pub fn difference_of_squares(positive: &[f64], negative: &[f64]) -> f64 {
    let (mut sum, mut rest) = (0.0_f64, 0.0_f64);
    let terms = positive.iter().map(|&a| (a, a)).chain(negative.iter().map(|&b| (b, -b)));
    for (x, y) in terms {
        let product = x * y;
        let product_rest = x.mul_add(y, -product);
        let total = sum + product;
        let part = total - sum;
        rest += (sum - (total - part)) + (product - part) + product_rest;
        sum = total;
    }
    sum + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_that_cancel_to_the_last_digit_leave_an_exact_difference() {
        let a = 1.0 + f64::EPSILON;
        // (1 + ε)² − 1 = 2ε + ε², whose nearest number is 2ε(1 + ε/2).
        assert_eq!(difference_of_squares(&[a], &[1.0]), 2.0 * f64::EPSILON + f64::EPSILON * f64::EPSILON);
        assert_eq!(difference_of_squares(&[3.0, 4.0], &[5.0]), 0.0);
        let (x, y) = (0.8 + 1e-9, 0.6);
        // 0.8, 0.6 and 1e-9 are not exact themselves: wanted is what the stored numbers give, by exact halves.
        let wanted = (x - 0.8) * (x + 0.8) + difference_of_squares(&[0.8, y], &[1.0]);
        let got = difference_of_squares(&[x, y], &[1.0]);
        assert!((got - wanted).abs() <= 4.0 * f64::EPSILON * wanted.abs(), "got {got:e}, wanted {wanted:e}");
    }
}

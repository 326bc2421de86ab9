//! Values of a costly pure function, kept for the next time that it is asked for the same.
//!
//! A table over several axes asks again and again for what depends on some of its parameters only. A memo has a fixed number of
//! slots, and a newer value takes the slot of an older one: it never grows, and what it answers is to the bit what the function
//! would, so that nothing depends on the order of the questions or on the number of threads. Each thread keeps its own.

/// A fixed number of slots for values of a function of `N` numbers.
#[derive(Debug)]
pub struct Memo<const N: usize, V> {
    slots: Vec<Option<([u64; N], V)>>,
}

/// Slots of a memo: a slice of 64² texels.
const SLOTS: usize = 1 << 12;

impl<const N: usize, V: Copy> Memo<N, V> {
    /// An empty one.
    pub const fn new() -> Self {
        Self { slots: vec![] }
    }

    /// The value for `key`: the one that is kept, or else what `make` makes, which is kept from now on.
    pub fn get_or_insert_with(&mut self, key: [u64; N], make: impl FnOnce() -> V) -> V {
        if self.slots.is_empty() {
            self.slots.resize(SLOTS, None);
        }
        // Fibonacci hashing: the product's high bits depend on every bit of the numbers.
        let mixed = key.iter().fold(0_u64, |h, k| (h.rotate_left(23) ^ k).wrapping_mul(0x9E37_79B9_7F4A_7C15));
        let slot = &mut self.slots[(mixed >> (u64::BITS - SLOTS.trailing_zeros())) as usize];
        match slot {
            Some((kept, value)) if *kept == key => *value,
            _ => {
                let value = make();
                *slot = Some((key, value));
                value
            }
        }
    }
}

impl<const N: usize, V: Copy> Default for Memo<N, V> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_asked_for_before_is_not_computed_again() {
        let (mut memo, mut made) = (Memo::<2, f64>::new(), 0);
        for _ in 0..3 {
            for x in 0..40_u64 {
                let value = memo.get_or_insert_with([x, 7], || {
                    made += 1;
                    x as f64
                });
                assert_eq!(value, x as f64);
            }
        }
        assert!((40..60).contains(&made), "{made} values of 40 were computed");
    }

    #[test]
    fn a_slot_that_two_keys_share_answers_both() {
        let mut memo = Memo::<1, u64>::new();
        for key in (0..3 * SLOTS as u64).chain(0..3 * SLOTS as u64) {
            assert_eq!(memo.get_or_insert_with([key], || 2 * key), 2 * key);
        }
    }
}

//! Eight numbers at a time, and the instruction sets that compute them.
//!
//! Everything is written once, over arrays of eight `f64`; the compiler turns them into whatever vectors the enclosing function
//! may use. No multiplication is fused with an addition, and every sum has one order: all instruction sets give the same bits.

/// Numbers in a vector.
pub(super) const LANES: usize = 8;

/// Eight numbers.
pub(super) type V = [f64; LANES];

/// Eight zeros.
pub(super) const ZERO: V = [0.0; LANES];

/// Instructions that the zonal filter is compiled for. All give the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InstructionSet {
    /// What every processor of this architecture has (SSE2 on x86-64).
    Baseline,
    /// AVX2, found at run time.
    Avx2,
}

impl InstructionSet {
    /// The best that this processor has.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if pulp::x86::V3::is_available() {
            return Self::Avx2;
        }
        Self::Baseline
    }

    /// All that this processor has.
    pub fn available() -> Vec<Self> {
        [Self::Baseline, Self::Avx2][..1 + usize::from(Self::detect() == Self::Avx2)].to_vec()
    }

    /// The name that reports use.
    pub fn name(self) -> &'static str {
        match self {
            Self::Baseline if cfg!(target_arch = "x86_64") => "SSE2",
            Self::Baseline if cfg!(target_arch = "aarch64") => "NEON",
            Self::Baseline => "baseline",
            Self::Avx2 => "AVX2",
        }
    }

    /// Runs `f` compiled for these instructions, as far as `f` is inlined; for the baseline where the processor lacks them.
    #[inline(always)]
    pub(in crate::environment) fn run<R>(self, f: impl FnOnce() -> R) -> R {
        #[cfg(target_arch = "x86_64")]
        if self == Self::Avx2
            && let Some(simd) = pulp::x86::V3::try_new()
        {
            return simd.vectorize(f);
        }
        f()
    }
}

#[inline(always)]
pub(super) fn add(a: V, b: V) -> V {
    std::array::from_fn(|i| a[i] + b[i])
}

#[inline(always)]
pub(super) fn sub(a: V, b: V) -> V {
    std::array::from_fn(|i| a[i] - b[i])
}

#[inline(always)]
pub(super) fn mul(a: V, b: V) -> V {
    std::array::from_fn(|i| a[i] * b[i])
}

#[inline(always)]
pub(super) fn scale(a: V, s: f64) -> V {
    std::array::from_fn(|i| a[i] * s)
}

/// The sum of the lanes, in one order.
#[inline(always)]
pub(super) fn total(a: V) -> f64 {
    ((a[0] + a[4]) + (a[2] + a[6])) + ((a[1] + a[5]) + (a[3] + a[7]))
}

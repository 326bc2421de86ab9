//! Eight numbers at a time, and the instruction sets that compute them.
//!
//! Everything is written once, over arrays of eight `f64`; the compiler turns them into whatever vectors the enclosing function
//! may use. Every sum has one order, and multiplication and addition are never fused, so that all instruction sets compute the same
//! bits. (Fused, the filter was no faster: its long sums wait for memory, its recurrences for the operation before.)
//!
//! (Lists of eight rather than closures, which are not compiled for the instructions that their caller chose where they are not inlined.)

/// Numbers in a vector.
pub(in crate::environment) const LANES: usize = 8;

/// Eight numbers.
pub(in crate::environment) type V = [f64; LANES];

/// Eight zeros.
pub(super) const ZERO: V = [0.0; LANES];

/// Instructions that the zonal filter is compiled for: all of them compute the same bits.
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

/// a b + c, eight times.
#[inline(always)]
pub(super) fn mul_add(a: V, b: V, c: V) -> V {
    [
        a[0] * b[0] + c[0],
        a[1] * b[1] + c[1],
        a[2] * b[2] + c[2],
        a[3] * b[3] + c[3],
        a[4] * b[4] + c[4],
        a[5] * b[5] + c[5],
        a[6] * b[6] + c[6],
        a[7] * b[7] + c[7],
    ]
}

/// a s + c, eight times.
#[inline(always)]
pub(super) fn scale_add(a: V, s: f64, c: V) -> V {
    [
        a[0] * s + c[0],
        a[1] * s + c[1],
        a[2] * s + c[2],
        a[3] * s + c[3],
        a[4] * s + c[4],
        a[5] * s + c[5],
        a[6] * s + c[6],
        a[7] * s + c[7],
    ]
}

#[inline(always)]
pub(super) fn add(a: V, b: V) -> V {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5], a[6] + b[6], a[7] + b[7]]
}

#[inline(always)]
pub(super) fn sub(a: V, b: V) -> V {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3], a[4] - b[4], a[5] - b[5], a[6] - b[6], a[7] - b[7]]
}

#[inline(always)]
pub(super) fn mul(a: V, b: V) -> V {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3], a[4] * b[4], a[5] * b[5], a[6] * b[6], a[7] * b[7]]
}

#[inline(always)]
pub(super) fn scale(a: V, s: f64) -> V {
    [a[0] * s, a[1] * s, a[2] * s, a[3] * s, a[4] * s, a[5] * s, a[6] * s, a[7] * s]
}

/// The sum of the lanes, in one order.
#[inline(always)]
pub(super) fn total(a: V) -> f64 {
    ((a[0] + a[4]) + (a[2] + a[6])) + ((a[1] + a[5]) + (a[3] + a[7]))
}

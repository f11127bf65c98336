//! How a device rounds.

/// How a device rounds `a * b + c`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arithmetic {
    /// Once. The CPU's kernels for AVX2, AVX-512 and NEON do the same.
    Fused,
    /// After the product and after the sum. The CPU's portable kernel does the same.
    Separate,
}

impl Arithmetic {
    /// The constant that `arithmetic.wgsl` needs.
    pub(crate) const fn source(self) -> &'static str {
        match self {
            Self::Fused => "const FUSED: bool = true;\n",
            Self::Separate => "const FUSED: bool = false;\n",
        }
    }

    pub(crate) fn multiply_add(self, a: f32, b: f32, c: f32) -> f32 {
        match self {
            Self::Fused => a.mul_add(b, c),
            Self::Separate => a * b + c,
        }
    }
}

//! The instruction sets that lanes can run on, and which of them this machine has.

use crate::{Error, Place, Result};

/// How the CPU runs lanes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Instructions {
    /// One lane at a time.
    Scalar,
    /// x86-64, 256 bits: Haswell (2013), Zen (2017) and later.
    Avx2,
    /// x86-64, 512 bits (F, VL, DQ, BW): Skylake-X (2017), Zen 4 (2022) and later.
    Avx512,
    /// AArch64, 128 bits: every one.
    Neon,
}

impl Instructions {
    /// All, slowest first.
    pub const ALL: [Instructions; 4] =
        [Instructions::Scalar, Instructions::Neon, Instructions::Avx2, Instructions::Avx512];

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Instructions::Scalar => "scalar",
            Instructions::Avx2 => "AVX2",
            Instructions::Avx512 => "AVX-512",
            Instructions::Neon => "NEON",
        }
    }

    /// Does this machine have it?
    pub fn is_available(self) -> bool {
        match self {
            Instructions::Scalar => true,
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => is_x86_feature_detected!("avx2"),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => {
                is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512bw")
            }
            #[cfg(target_arch = "aarch64")]
            Instructions::Neon => true,
            #[allow(unreachable_patterns)] // where every set belongs to the architecture
            _ => false,
        }
    }

    /// Those of this machine, slowest first.
    pub fn available() -> Vec<Instructions> {
        Instructions::ALL.into_iter().filter(|set| set.is_available()).collect()
    }

    /// The fastest of this machine. NEON only where it is asked for: LLVM's cost model leaves the batch's loop
    /// scalar there (Rust 1.95), and then lanes one by one are faster.
    pub fn best() -> Instructions {
        let chosen = |set: &Instructions| set.is_available() && *set != Instructions::Neon;
        Instructions::ALL.into_iter().rev().find(chosen).unwrap_or(Instructions::Scalar)
    }

    /// Itself, where this machine has it.
    ///
    /// # Errors
    /// [`Error::Usage`] where it has not.
    pub fn checked(self) -> Result<Instructions> {
        if self.is_available() {
            return Ok(self);
        }
        let names: Vec<&str> = Instructions::available().into_iter().map(Instructions::name).collect();
        let problem = format!("this machine does not have {}", self.name());
        Err(Error::usage(Place::item("instructions"), problem, format!("it has {}", names.join(", "))))
    }
}

impl std::fmt::Display for Instructions {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

//! Clears the upper halves of the vector registers for scalar code.
//!
//! Assembly kernels, such as those used by faer, may end without `vzeroupper`. The upper halves of the registers then
//! stay in use, and on Zen 5 every scalar operation must preserve them. Single lanes then ran at a third of their speed
//! for the rest of the thread's life.

// One instruction, after checking that the CPU has it.
#![allow(unsafe_code)]

/// Clears the upper halves, on CPUs that have them.
pub fn clear_upper_halves() {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx") {
        #[target_feature(enable = "avx")]
        fn clear() {
            std::arch::x86_64::_mm256_zeroupper();
        }
        // SAFETY: the CPU has AVX.
        unsafe { clear() }
    }
}

/// For tests: whether upper halves of the 256-bit registers are in use. `None` if the CPU does not report it, or always
/// reports true.
#[cfg(target_arch = "x86_64")]
pub fn upper_halves_in_use() -> Option<bool> {
    let in_use = what_the_machine_says()?;
    clear_upper_halves();
    (what_the_machine_says() == Some(false)).then_some(in_use)
}

#[cfg(target_arch = "x86_64")]
fn what_the_machine_says() -> Option<bool> {
    // Leaf 13, subleaf 1, bit 2: XGETBV with 1.
    let says = is_x86_feature_detected!("xsave") && std::arch::x86_64::__cpuid_count(13, 1).eax & 4 != 0;
    #[target_feature(enable = "xsave")]
    fn in_use() -> u64 {
        // SAFETY: the CPU reports that XGETBV with 1 is available.
        unsafe { std::arch::x86_64::_xgetbv(1) }
    }
    // SAFETY: the CPU has XSAVE.
    says.then(|| unsafe { in_use() } & 0b100 != 0)
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;

    #[test]
    fn halves_that_are_in_use_are_cleared() {
        if !is_x86_feature_detected!("avx") || upper_halves_in_use().is_none() {
            eprintln!("SKIPPED: this machine does not say which registers are in use");
            return;
        }
        let values = [1.5_f32; 8];
        // SAFETY: the CPU has AVX; the instruction reads eight values into a register and leaves them there.
        unsafe { std::arch::asm!("vmovups ymm5, [{p}]", out("xmm5") _, p = in(reg) &values) };
        assert_eq!(what_the_machine_says(), Some(true));
        clear_upper_halves();
        assert_eq!(what_the_machine_says(), Some(false));
    }
}

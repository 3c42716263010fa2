//! Arrays of words seen as rows of words.

use bytemuck::Pod;

use crate::engine::cpu::LANES;

/// Arrays of `N` words each, which can be handled without their names.
pub(super) trait Rows<const N: usize>: Pod {
    /// Each of them.
    fn rows(&self) -> &[[u32; N]] {
        bytemuck::cast_slice(std::slice::from_ref(self))
    }

    /// The same, to be changed.
    fn rows_mut(&mut self) -> &mut [[u32; N]] {
        bytemuck::cast_slice_mut(std::slice::from_mut(self))
    }
}

macro_rules! made_of_rows {
    ($($arrays:ident)+) => {
        $(
            // SAFETY: arrays of binary32 or 32-bit words, in the order of the source: 0 is one, and every word is.
            unsafe impl<const N: usize> Zeroable for $arrays<N> {}
            // SAFETY: the same; all have 4 bytes per entry and their alignment, so nothing lies between them.
            unsafe impl<const N: usize> Pod for $arrays<N> {}
            impl<const N: usize> Rows<N> for $arrays<N> {}
        )+
    };
}
pub(super) use made_of_rows;

/// Puts entry `k` of every row into place `to`.
#[inline(always)]
pub(super) fn copy<const N: usize>(rows: &mut [[u32; N]], to: usize, from: &[[u32; LANES]], k: usize) {
    for (row, from) in rows.iter_mut().zip(from) {
        row[to] = from[k];
    }
}

/// Writes a value for [`LANES`] lanes.
#[inline(always)]
pub(super) fn fill<T: Copy, const N: usize>(row: &mut [T; N], from: usize, value: T) {
    row[from..from + LANES].fill(value);
}

//! Four lanes in vector registers with fused multiply-add.

use std::arch::x86_64 as x;

use super::{Lanes, Simd, Twice, Vector, WideWork, Work};

/// AVX2 and FMA. Only [`dispatch`](super::dispatch) enters it, on machines that have both.
#[derive(Clone, Copy)]
pub(crate) struct Avx2;

/// Runs the work compiled with these instructions.
#[target_feature(enable = "avx2,fma")]
pub(super) fn run<W: Work>(work: W) -> W::Output {
    work.run::<Avx2>()
}

/// Runs the work for eight motions side by side, compiled with these instructions.
#[target_feature(enable = "avx2,fma")]
pub(super) fn run_wide<W: WideWork>(work: W) -> W::Output {
    work.run::<Twice<Avx2>>()
}

/// Runs the work as [`run`] does, without inlining it into the caller.
#[target_feature(enable = "avx2,fma")]
#[inline(never)]
fn run_apart<W: Work>(work: W) -> W::Output {
    work.run::<Avx2>()
}

// SAFETY of every block here: these instructions need AVX2 and FMA and nothing else;
// `Avx2` is used only where the machine was found to have them.
impl Lanes for Avx2 {
    type Register = x::__m256d;

    instructions! {
        add(a, b) = _mm256_add_pd;
        sub(a, b) = _mm256_sub_pd;
        mul(a, b) = _mm256_mul_pd;
        div(a, b) = _mm256_div_pd;
        fma(a, b, c) = _mm256_fmadd_pd;
        fnma(a, b, c) = _mm256_fnmadd_pd;
        sqrt(a) = _mm256_sqrt_pd;
        min(a, b) = _mm256_min_pd;
        max(a, b) = _mm256_max_pd;
    }
    #[inline(always)]
    fn splat(a: f64) -> Self::Register {
        unsafe { x::_mm256_set1_pd(a) }
    }
    #[inline(always)]
    fn map(a: Self::Register, function: fn(f64) -> f64) -> Self::Register {
        Self::load(&Self::store(a).map(function))
    }
    #[inline(always)]
    fn below(a: Self::Register, b: Self::Register) -> u32 {
        unsafe { x::_mm256_movemask_pd(x::_mm256_cmp_pd::<{ x::_CMP_NGE_UQ }>(a, b)) as u32 }
    }
    #[inline(always)]
    fn power_of_two(shifted: Self::Register) -> Self::Register {
        unsafe {
            let bits = x::_mm256_slli_epi64::<52>(x::_mm256_castpd_si256(shifted));
            let one = x::_mm256_castpd_si256(x::_mm256_set1_pd(1.0));
            x::_mm256_castsi256_pd(x::_mm256_add_epi64(bits, one))
        }
    }
    #[inline(always)]
    fn turn(
        shifted: Self::Register,
        sine: Self::Register,
        cosine: Self::Register,
    ) -> (Self::Register, Self::Register) {
        unsafe {
            let quadrant = x::_mm256_castpd_si256(shifted);
            // The blend looks at the sign bit: move the lowest bit there.
            let odd = x::_mm256_castsi256_pd(x::_mm256_slli_epi64::<63>(quadrant));
            let two = x::_mm256_set1_epi64x(2);
            let sign =
                |q| x::_mm256_castsi256_pd(x::_mm256_slli_epi64::<62>(x::_mm256_and_si256(q, two)));
            let next = x::_mm256_add_epi64(quadrant, x::_mm256_set1_epi64x(1));
            (
                x::_mm256_xor_pd(x::_mm256_blendv_pd(sine, cosine, odd), sign(quadrant)),
                x::_mm256_xor_pd(x::_mm256_blendv_pd(cosine, sine, odd), sign(next)),
            )
        }
    }
}

impl Simd for Avx2 {
    #[inline(always)]
    fn apart<W: Work>(work: W) -> W::Output {
        // SAFETY: this arithmetic is in use only where the machine has its instructions.
        unsafe { run_apart(work) }
    }
    #[inline(always)]
    fn load(a: &Vector) -> Self::Register {
        unsafe { x::_mm256_loadu_pd(a.as_ptr()) }
    }
    #[inline(always)]
    fn store(a: Self::Register) -> Vector {
        let mut out = [0.0; super::WIDTH];
        unsafe { x::_mm256_storeu_pd(out.as_mut_ptr(), a) };
        out
    }
    #[inline(always)]
    fn sums([a, b, c, d]: [Self::Register; 4]) -> Self::Register {
        unsafe {
            let (ab, cd) = (x::_mm256_hadd_pd(a, b), x::_mm256_hadd_pd(c, d));
            let crossed = x::_mm256_permute2f128_pd::<0x21>(ab, cd);
            x::_mm256_add_pd(crossed, x::_mm256_blend_pd::<0b1100>(ab, cd))
        }
    }
    #[inline(always)]
    fn with_first(a: Self::Register, b: Self::Register) -> Self::Register {
        unsafe { x::_mm256_blend_pd::<0b0001>(a, b) }
    }
    #[inline(always)]
    fn shifted_in(before: Self::Register, a: Self::Register) -> Self::Register {
        unsafe {
            let crossed = x::_mm256_permute2f128_pd::<0x21>(before, a);
            x::_mm256_shuffle_pd::<0b0101>(crossed, a)
        }
    }
    #[inline(always)]
    fn select(mask: u32, a: Self::Register, b: Self::Register) -> Self::Register {
        unsafe {
            let lanes = x::_mm256_set_epi64x(8, 4, 2, 1);
            let set = x::_mm256_and_si256(x::_mm256_set1_epi64x(i64::from(mask)), lanes);
            let chosen = x::_mm256_castsi256_pd(x::_mm256_cmpeq_epi64(set, lanes));
            x::_mm256_blendv_pd(b, a, chosen)
        }
    }
}

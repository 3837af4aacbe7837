//! Eight lanes in one vector register.

use std::arch::x86_64 as x;

use super::avx2::Avx2;
use super::{Lanes, Octet, Wide, WideWork};

/// AVX-512. Only [`dispatch_wide`](super::dispatch_wide) enters it, on machines that have it, and
/// AVX2 and FMA as well.
#[derive(Clone, Copy)]
pub(crate) struct Avx512;

/// Does the work compiled with these instructions.
#[target_feature(enable = "avx2,fma,avx512f")]
pub(super) fn run<W: WideWork>(work: W) -> W::Output {
    work.run::<Avx512>()
}

// SAFETY of every block here: these instructions need AVX-512F and nothing else; `Avx512` is used
// only where the machine was found to have it.
impl Lanes for Avx512 {
    type Register = x::__m512d;

    instructions! {
        add(a, b) = _mm512_add_pd;
        sub(a, b) = _mm512_sub_pd;
        mul(a, b) = _mm512_mul_pd;
        div(a, b) = _mm512_div_pd;
        fma(a, b, c) = _mm512_fmadd_pd;
        fnma(a, b, c) = _mm512_fnmadd_pd;
        sqrt(a) = _mm512_sqrt_pd;
        min(a, b) = _mm512_min_pd;
        max(a, b) = _mm512_max_pd;
    }
    #[inline(always)]
    fn splat(a: f64) -> Self::Register {
        unsafe { x::_mm512_set1_pd(a) }
    }
    #[inline(always)]
    fn below(a: Self::Register, b: Self::Register) -> u32 {
        u32::from(unsafe { x::_mm512_cmp_pd_mask::<{ x::_CMP_NGE_UQ }>(a, b) })
    }
    #[inline(always)]
    fn power_of_two(shifted: Self::Register) -> Self::Register {
        unsafe {
            let bits = x::_mm512_slli_epi64::<52>(x::_mm512_castpd_si512(shifted));
            let one = x::_mm512_castpd_si512(x::_mm512_set1_pd(1.0));
            x::_mm512_castsi512_pd(x::_mm512_add_epi64(bits, one))
        }
    }
    #[inline(always)]
    fn turn(
        shifted: Self::Register,
        sine: Self::Register,
        cosine: Self::Register,
    ) -> (Self::Register, Self::Register) {
        unsafe {
            let quadrant = x::_mm512_castpd_si512(shifted);
            let odd = x::_mm512_test_epi64_mask(quadrant, x::_mm512_set1_epi64(1));
            let signed = |value: Self::Register, quadrant| {
                let two = x::_mm512_and_si512(quadrant, x::_mm512_set1_epi64(2));
                let sign = x::_mm512_slli_epi64::<62>(two);
                let bits = x::_mm512_castpd_si512(value);
                x::_mm512_castsi512_pd(x::_mm512_xor_si512(bits, sign))
            };
            let next = x::_mm512_add_epi64(quadrant, x::_mm512_set1_epi64(1));
            (
                signed(x::_mm512_mask_blend_pd(odd, sine, cosine), quadrant),
                signed(x::_mm512_mask_blend_pd(odd, cosine, sine), next),
            )
        }
    }
    #[inline(always)]
    fn map(a: Self::Register, function: fn(f64) -> f64) -> Self::Register {
        Self::load(&Self::store(a).map(function))
    }
}

impl Wide for Avx512 {
    type One = Avx2;

    #[inline(always)]
    fn load(a: &Octet) -> Self::Register {
        unsafe { x::_mm512_loadu_pd(a.as_ptr()) }
    }
    #[inline(always)]
    fn store(a: Self::Register) -> Octet {
        let mut out = Octet::default();
        unsafe { x::_mm512_storeu_pd(out.as_mut_ptr(), a) };
        out
    }
    #[inline(always)]
    fn select(mask: u32, a: Self::Register, b: Self::Register) -> Self::Register {
        unsafe { x::_mm512_mask_blend_pd(mask as x::__mmask8, b, a) }
    }
}

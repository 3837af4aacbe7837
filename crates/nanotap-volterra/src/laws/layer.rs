//! Elastic contact of an incompressible layer bonded to a rigid support, at any thickness.
//!
//! The force of the half-space times `C(χ)`: sphere `(16/9) E √R δ^{3/2} C`, `χ = √(Rδ)/h`; cone
//! `(8/(3π)) E tan θ δ² C`, `χ = δ tan θ/h`; flat punch `(8/3) E a δ C`, `χ = a/h` (ν = ½).
//!
//! With the layer's compliance `L(u) = (sinh 2u − 2u)/(cosh 2u + 1 + 2u²)` over that of a half-space
//! (R. S. Dhaliwal and I. S. Rau, Int. J. Eng. Sci. 8, 843 (1970)) the contact of radius `a` under an
//! indenter whose profile on a half-space is `δ − g(x)` is a Fredholm equation,
//!
//! `φ(x) − (2/π) ∫₀ᵃ φ(t) ∫₀^∞ (1 − L(kh)) cos kt cos kx dk dt = δ − g(x)`,
//!
//! `φ(a) = 0` where the edge is free, `F = 2E* ∫₀ᵃ φ dx`. It was solved by Gauss–Legendre quadrature
//! with 120 nodes (220 change nothing in the first 12 digits), and `C` expanded in Chebyshev polynomials
//! between 0 and each of `EDGES`.

use crate::law::Remark;
use crate::laws::curve;
use crate::laws::elastic::{Shape, contact_ways};
use crate::laws::entry::{
    CONTACT_DISTANCE, Entry, HALF_ANGLE, MODULUS, ParameterEntry, Part, RADIUS, THICKNESS,
};
use crate::laws::formula::{Formula, Way};
use crate::laws::thin::Thin;
use crate::quadrature::gauss_legendre;
use nanotap_arithmetic::Scalar;

/// Ends of the intervals of `χ` on which `C` is expanded.
const EDGES: [f64; 7] = [0.0, 0.3, 0.75, 1.5, 3.0, 6.0, 12.0];
/// Number of nodes of the quadrature of the energy.
const NODES: usize = 24;

/// Formula of a bonded incompressible layer under a tip of this shape; see the module.
#[derive(Clone, Copy, Debug)]
pub struct Layer(pub Shape);

const fn entry(
    name: &'static str,
    words: &'static str,
    formula: &'static str,
    parameters: &'static [ParameterEntry],
) -> Entry {
    Entry {
        name,
        words,
        formula,
        source: "R. S. Dhaliwal and I. S. Rau, Int. J. Eng. Sci. 8, 843 (1970)",
        parameters,
        parts: &[Part::Elasticity],
        attracts: false,
        conservative: true,
    }
}

/// Table entry `layer-sphere`: a sphere on a bonded layer of any thickness.
pub static SPHERE: Entry = entry(
    "layer-sphere",
    "sphere on an incompressible layer of any thickness, bonded to a rigid support",
    "(16/9) E √R δ^(3/2) C(χ), χ = √(Rδ)/h, C by a Fredholm equation",
    &[MODULUS, RADIUS, THICKNESS, CONTACT_DISTANCE],
);
/// Table entry `layer-cone`: a cone on a bonded layer of any thickness.
pub static CONE: Entry = entry(
    "layer-cone",
    "cone on an incompressible layer of any thickness, bonded to a rigid support",
    "(8/(3π)) E tan θ δ² C(χ), χ = δ tan θ/h, C by a Fredholm equation",
    &[MODULUS, HALF_ANGLE, THICKNESS, CONTACT_DISTANCE],
);
/// Table entry `layer-punch`: a flat punch on a bonded layer of any thickness.
pub static PUNCH: Entry = entry(
    "layer-punch",
    "flat cylinder on an incompressible layer of any thickness, bonded to a rigid support",
    "(8/3) E a δ C(χ), χ = a/h, C by a Fredholm equation",
    &[MODULUS, RADIUS, THICKNESS, CONTACT_DISTANCE],
);

impl Layer {
    /// Returns `C(χ)`; beyond the last edge it continues as `(1 + χ)³`.
    pub(crate) fn correction<S: Scalar>(self, ratio: S) -> S {
        let series = match self.0 {
            Shape::Sphere => &SPHERE_SERIES,
            Shape::Cone => &CONE_SERIES,
            Shape::Punch => &PUNCH_SERIES,
        };
        let largest = EDGES[series.len()];
        if ratio.value() > largest {
            let more = (ratio + 1.0) * (1.0 / (largest + 1.0));
            return more * more * more * curve::series(series[series.len() - 1], 1.0)[0];
        }
        let inner = &EDGES[1..series.len()];
        let k = inner.partition_point(|edge| *edge < ratio.value());
        let half = 0.5 * (EDGES[k + 1] - EDGES[k]);
        let u = (ratio.value() - EDGES[k]) / half - 1.0;
        let [value, slope] = curve::series(series[k], u);
        ratio.chain(value, slope / half)
    }
}

impl Formula for Layer {
    fn entry(&self) -> &'static Entry {
        match self.0 {
            Shape::Sphere => &SPHERE,
            Shape::Cone => &CONE,
            Shape::Punch => &PUNCH,
        }
    }

    /// Computes `a0`, the factor of `δ^p`, and the scale of `χ`.
    fn constants<S: Scalar>(&self, p: &[S]) -> Vec<S> {
        let [contact, stiffness, scale] = Thin(self.0).half_space(p);
        let stiffness = match self.0 {
            Shape::Sphere | Shape::Cone => stiffness,
            Shape::Punch => stiffness * self.correction(scale),
        };
        vec![contact, stiffness, scale]
    }

    fn force<S: Scalar>(&self, c: &[S], branch: usize, gap: S, _rate: S) -> S {
        if branch == 0 {
            return S::constant(0.0);
        }
        let delta = c[0] - gap;
        let elastic = c[1] * self.0.power(delta);
        match self.0 {
            Shape::Sphere | Shape::Cone => {
                elastic * self.correction(Thin(self.0).ratio(c[2], delta))
            }
            Shape::Punch => elastic,
        }
    }

    fn cost(&self) -> u64 {
        match self.0 {
            Shape::Sphere | Shape::Cone => 5,
            Shape::Punch => 1,
        }
    }

    fn ways(&self, branch: usize) -> Vec<Way> {
        contact_ways(branch, self.0.approach())
    }

    /// Computes the energy by quadrature in the square root of the indentation, of which `C` is a
    /// function.
    fn energy(&self, c: &[f64], branch: usize, gap: f64) -> Option<f64> {
        let delta = c[0] - gap;
        if branch == 0 || delta <= 0.0 {
            return Some(0.0);
        }
        let (nodes, weights) = gauss_legendre(NODES);
        let terms = nodes.iter().zip(weights).map(|(v, weight)| {
            let at = c[0] - delta * v * v;
            2.0 * weight * v * self.force(c, 1, at, 0.0)
        });
        Some(delta * terms.sum::<f64>())
    }

    fn vanishes(&self, branch: usize) -> bool {
        branch == 0
    }

    fn remarks(&self, p: &[f64], least_gap: f64) -> Vec<Remark> {
        let delta = p[3] - least_gap;
        if delta <= 0.0 {
            return Vec::new();
        }
        let c = self.constants(p);
        let ratios = [
            ("χ", Thin(self.0).ratio(c[2], delta), EDGES[6]),
            ("δ/thickness", delta / p[2], 1.0),
        ];
        let beyond = ratios.into_iter().filter(|(_, value, limit)| value > limit);
        let remark = |(ratio, value, limit)| Remark {
            ratio,
            value,
            limit,
        };
        beyond.map(remark).collect()
    }
}

/// `C(χ)` on each interval between two `EDGES` in `T_k(u)`, `u` from −1 to 1.
const SPHERE_SERIES: [&[f64]; 6] = [
    &[
        1.233_447_438_178_102,
        0.257_484_951_996_913_7,
        0.025_635_529_200_567_93,
        0.001_630_618_685_164_726,
        2.577_754_914_39e-05,
        -7.539_416_040_3e-06,
        -6.973_357_904e-07,
        2.584_549_73e-08,
        1.013_276_43e-08,
        5.438_824e-10,
        -8.377_35e-11,
        -1.472_94e-11,
        -1.51e-13,
        1.975e-13,
        1.91e-14,
    ],
    &[
        2.354_090_642_910_998,
        0.931_038_790_778_892_8,
        0.096_957_336_280_648_52,
        0.001_416_335_892_218_124,
        -0.000_326_778_793_641_7,
        5.510_414_447_63e-05,
        3.396_176_287_6e-06,
        -1.731_590_131_2e-06,
        6.560_748_9e-08,
        4.265_470_5e-08,
        -5.965_359_8e-09,
        -6.967_228e-10,
        2.532_471e-10,
        -3.998_7e-12,
        -7.718_7e-12,
        9.513e-13,
        1.545e-13,
        -4.89e-14,
    ],
    &[
        6.513_011_215_196_163,
        3.450_089_383_226_814,
        0.330_249_275_886_543_2,
        0.010_622_653_268_315_98,
        0.000_606_520_453_020_7,
        -7.403_628_403_26e-05,
        5.369_006_208_2e-06,
        7.079_601_275e-07,
        -3.790_510_329e-07,
        8.451_079_94e-08,
        -1.119_413_69e-08,
        3.412_539e-10,
        2.676_947e-10,
        -8.478_05e-11,
        1.505_02e-11,
        -1.544_7e-12,
        -3.77e-14,
        6.05e-14,
        -1.96e-14,
    ],
    &[
        26.026_811_415_142_58,
        17.906_487_286_205_59,
        2.301_354_459_049_134,
        0.117_901_228_188_325_9,
        0.000_647_371_743_084_6,
        -7.399_533_177_64e-05,
        1.009_224_732_79e-05,
        -1.618_378_011_3e-06,
        2.838_551_45e-07,
        -5.112_056_04e-08,
        9.137_461_9e-09,
        -1.592_986_7e-09,
        2.660_309e-10,
        -4.095_97e-11,
        5.177_7e-12,
        -3.156e-13,
        -1.184e-13,
    ],
    &[
        148.729_897_430_516_7,
        119.351_848_669_123_7,
        17.959_489_054_967_06,
        0.985_590_314_995_068_1,
        0.001_043_608_183_327_907,
        -0.000_127_695_287_851_9,
        1.551_599_383_8e-05,
        -1.889_353_023_8e-06,
        2.341_215_674e-07,
        -3.018_378_11e-08,
        4.147_296_5e-09,
        -6.189_073e-10,
        9.957_87e-11,
        -1.711_12e-11,
        3.423_2e-12,
        6.075e-13,
        1.588_4e-12,
        1.313_2e-12,
        4.967e-13,
    ],
    &[
        1_053.209_924_560_492,
        901.428_728_271_357_8,
        143.189_911_255_499_5,
        7.944_639_028_393_562,
        0.001_099_492_104_530_823,
        -0.000_160_129_250_089_5,
        2.318_215_292_07e-05,
        -3.339_199_782_8e-06,
        4.783_229_832e-07,
        -6.817_770_46e-08,
        9.657_485e-09,
        -1.377_786_3e-09,
        1.798_836e-10,
        -3.366_42e-11,
        2.139_4e-12,
        1.572_75e-11,
        1.139_84e-11,
        -9.832_6e-12,
        8.837e-13,
        2.347_5e-11,
        9.332_7e-12,
        -8.254_2e-12,
    ],
];
const CONE_SERIES: [&[f64]; 6] = [
    &[
        1.134_165_156_838_729,
        0.143_893_034_448_215_2,
        0.010_284_037_366_468_56,
        0.000_576_966_717_564_6,
        2.065_675_807_32e-05,
        -2.448_599_39e-07,
        -1.015_462_516e-07,
        -6.939_523_7e-09,
        -1.224_5e-11,
        4.233_9e-11,
        3.978_1e-12,
        7.9e-14,
        -2.06e-14,
    ],
    &[
        1.694_039_798_780_443,
        0.448_623_796_612_235_4,
        0.045_643_516_621_594_58,
        0.001_997_411_578_423_632,
        -0.000_140_490_943_132_1,
        -1.621_621_278_49e-05,
        1.996_683_529_6e-06,
        3.072_446_373e-07,
        -2.995_520_44e-08,
        -6.525_912_8e-09,
        4.783_275e-10,
        1.472_893e-10,
        -7.707_4e-12,
        -3.461_2e-12,
        1.15e-13,
        8.32e-14,
    ],
    &[
        3.729_790_633_719_838,
        1.694_850_757_032_168,
        0.156_079_750_973_733_7,
        0.001_086_797_901_417_302,
        0.000_286_698_846_781_3,
        5.135_578_438_3e-05,
        -1.650_180_031_31e-05,
        1.798_171_338_3e-06,
        1.176_788_214e-07,
        -8.027_407_96e-08,
        1.375_351_31e-08,
        -4.227_402e-10,
        -3.714_523e-10,
        1.012_202e-10,
        -1.067_59e-11,
        -1.130_3e-12,
        6.711e-13,
        -1.212e-13,
    ],
    &[
        12.678_945_846_964_45,
        7.977_279_634_976_431,
        0.924_647_523_011_090_5,
        0.045_024_525_524_891_05,
        0.000_684_385_486_398_6,
        -0.000_129_024_598_565_6,
        2.433_226_238_2e-05,
        -3.923_692_790_3e-06,
        4.606_790_848e-07,
        -1.805_445_89e-08,
        -8.839_693e-09,
        3.336_853_7e-09,
        -7.997_815e-10,
        1.580_123e-10,
        -2.658_34e-11,
        3.494e-12,
        -2.283e-13,
        -5.48e-14,
    ],
    &[
        64.126_198_344_454_1,
        49.255_488_804_293_07,
        7.146_138_411_575_143,
        0.391_001_371_039_932_4,
        0.000_546_834_679_426,
        -6.987_614_116_74e-05,
        9.007_026_657_8e-06,
        -1.216_243_801_6e-06,
        1.816_902_691e-07,
        -3.156_301_82e-08,
        6.426_188_6e-09,
        -1.467_190_8e-09,
        3.511_139e-10,
        -8.280_65e-11,
        1.857_7e-11,
        -3.582_4e-12,
        6.936e-13,
        -2.58e-14,
        4.03e-14,
        -4.82e-14,
        -1.961e-13,
    ],
    &[
        429.201_984_110_387_1,
        362.060_522_584_644_1,
        56.935_624_770_928_56,
        3.158_390_735_165_805,
        0.000_523_673_005_965_7,
        -7.881_823_561_66e-05,
        1.175_087_591_19e-05,
        -1.735_523_117_5e-06,
        2.539_145_808e-07,
        -3.681_808_18e-08,
        5.285_360_5e-09,
        -7.687_452e-10,
        9.567_26e-11,
        -2.700_71e-11,
        -4.302e-12,
        8.753e-13,
        5.033_9e-12,
        4.018_4e-12,
        -9.373e-13,
        -4.491_6e-12,
        -4.158_9e-12,
        -2.181_5e-12,
    ],
];
const PUNCH_SERIES: [&[f64]; 6] = [
    &[
        1.216_366_833_324_209,
        0.232_792_924_918_120_9,
        0.016_776_256_169_213_77,
        0.000_319_143_438_990_8,
        -3.230_415_558_57e-05,
        -1.112_530_579_8e-06,
        1.804_181_049e-07,
        8.902_827_2e-09,
        -1.103_125e-09,
        -7.014_17e-11,
        6.973e-12,
        5.338e-13,
        -4.37e-14,
    ],
    &[
        2.038_571_257_578_581,
        0.611_310_671_314_991_4,
        0.038_462_823_787_129_11,
        -0.000_533_530_020_881_1,
        -2.114_085_701_22e-05,
        1.315_845_496_97e-05,
        -8.298_865_851e-07,
        -1.001_052_523e-07,
        1.844_758_14e-08,
        -1.413_524e-10,
        -2.295_233e-10,
        2.001_51e-11,
        1.423_7e-12,
        -3.773e-13,
        1.07e-14,
    ],
    &[
        4.246_718_270_776_586,
        1.656_706_960_582_083,
        0.098_489_502_516_341_9,
        0.000_924_473_246_505_2,
        0.000_198_356_816_354_4,
        -2.628_214_317_42e-05,
        1.657_075_611_3e-06,
        2.143_048_656e-07,
        -8.040_722_23e-08,
        1.184_658_02e-08,
        -7.133_161e-10,
        -9.788_07e-11,
        3.346_57e-11,
        -4.662_8e-12,
        2.615e-13,
        3.86e-14,
    ],
    &[
        11.560_731_984_160_61,
        6.061_637_497_195_524,
        0.519_443_515_434_292_3,
        0.015_565_921_240_32,
        2.809_813_698_72e-05,
        -9.646_589_289_4e-06,
        2.494_831_293_3e-06,
        -5.948_639_015e-07,
        1.342_758_891e-07,
        -2.798_973_03e-08,
        5.141_953_8e-09,
        -7.720_421e-10,
        7.736_8e-11,
        1.185e-12,
        -2.895_6e-12,
        8.39e-13,
        -1.658e-13,
    ],
    &[
        43.321_778_449_856_8,
        28.240_426_306_662_56,
        3.200_653_697_539_704,
        0.124_569_251_843_189,
        -3.387_425_953_25e-05,
        3.167_619_307_9e-06,
        -1.934_578_519e-07,
        -1.437_310_89e-08,
        9.111_153_7e-09,
        -2.518_209_3e-09,
        5.729_129e-10,
        -1.195_217e-10,
        2.366_12e-11,
        -4.601_1e-12,
        7.574e-13,
        -2.354e-13,
    ],
    &[
        216.531_870_328_888_9,
        162.407_662_192_127,
        21.757_593_564_727_93,
        0.994_351_174_028_177,
        -4.627_685_786_77e-05,
        6.426_958_033_9e-06,
        -8.859_363_383e-07,
        1.206_719_573e-07,
        -1.614_405_61e-08,
        2.100_212_5e-09,
        -2.632_432e-10,
        2.911_48e-11,
        -4.205_1e-12,
        -1.417_2e-12,
        -1.144e-12,
        -7.952e-13,
        -8.239e-13,
        -1.137e-13,
        1.005_7e-12,
        1.872_4e-12,
        9.449e-13,
    ],
];

#[cfg(test)]
mod tests {
    use super::*;

    /// `C` with 220 nodes of the quadrature, by a program of its own.
    #[test]
    fn values_of_the_fredholm_equation() {
        for (shape, ratio, expected) in [
            (
                Shape::Sphere,
                0.267_398_591_862_144_6,
                1.440_023_582_389_155,
            ),
            (
                Shape::Sphere,
                0.684_535_345_198_560_4,
                3.014_065_369_290_471_5,
            ),
            (
                Shape::Sphere,
                1.915_021_186_282_904_3,
                16.761_749_872_747_416,
            ),
            (Shape::Sphere, 4.044_329_064_616_663, 98.616_493_734_915_57),
            (
                Shape::Cone,
                0.398_404_769_063_875_4,
                1.426_933_966_366_283_4,
            ),
            (Shape::Cone, 0.963_361_129_888_700_5, 2.902_105_976_757_101),
            (Shape::Cone, 2.606_939_992_055_013_4, 15.924_508_127_304_636),
            (Shape::Cone, 5.436_318_160_240_662, 92.942_504_341_891_69),
            (Shape::Punch, 0.3, 1.466_221_929_319_493_4),
            (Shape::Punch, 0.9, 3.225_814_102_031_363_5),
            (Shape::Punch, 3.0, 18.157_399_380_278_815),
            (Shape::Punch, 7.0, 106.652_845_044_138_93),
        ] {
            let found: f64 = Layer(shape).correction(ratio);
            assert!(
                (found / expected - 1.0).abs() < 1e-12,
                "{shape:?} {ratio}: {found}"
            );
        }
        for shape in [Shape::Sphere, Shape::Cone, Shape::Punch] {
            let thick: f64 = Layer(shape).correction(0.0);
            assert!((thick - 1.0).abs() < 1e-13, "{shape:?}: {thick}");
        }
    }

    /// The series of García and García is off by what its file says.
    #[test]
    fn the_series_is_too_stiff() {
        let value = |law: &dyn Fn(f64) -> f64, ratio: f64| law(ratio);
        let exact = |ratio: f64| Layer(Shape::Sphere).correction(ratio);
        let series = |ratio: f64| Thin(Shape::Sphere).correction(ratio);
        for (ratio, error) in [(0.42, 0.003), (0.55, 0.012), (0.75, 0.049), (1.02, 0.154)] {
            let found = value(&series, ratio) / value(&exact, ratio) - 1.0;
            assert!((found - error).abs() < 6e-4, "{ratio}: {found}");
        }
        // From the limits on by half a percent.
        for (shape, limit) in [
            (Shape::Sphere, 0.463),
            (Shape::Cone, 0.903),
            (Shape::Punch, 0.476),
        ] {
            let off = |ratio: f64| {
                let series: f64 = Thin(shape).correction(ratio);
                (series / Layer(shape).correction(ratio) - 1.0).abs()
            };
            assert!(
                off(0.97 * limit) < 0.005 && off(1.03 * limit) > 0.005,
                "{shape:?}"
            );
        }
    }

    /// The energy is the integral of the force, here by central differences of it.
    #[test]
    fn the_energy_is_that_of_the_force() {
        for (shape, size) in [
            (Shape::Sphere, 10.0),
            (Shape::Cone, 0.4),
            (Shape::Punch, 10.0),
        ] {
            let c = Layer(shape).constants(&[1.0, size, 4.0, 0.2]);
            let energy = |gap: f64| Layer(shape).energy(&c, 1, gap).unwrap();
            for gap in [-0.3, -2.0] {
                let force = (energy(gap - 1e-3) - energy(gap + 1e-3)) / 2e-3;
                let expected: f64 = Layer(shape).force(&c, 1, gap, 0.0);
                assert!(
                    (force / expected - 1.0).abs() < 1e-5,
                    "{shape:?}: {force} {expected}"
                );
            }
        }
    }
}

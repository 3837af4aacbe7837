//! The 95 % intervals contain the truth in 90 to 98 % of 200 synthetic spectra. Of 200 intervals that
//! contain it with probability 0.95, fewer than 180 or more than 197 do with probabilities of 0.0014 and
//! 0.026 (binomial distribution).

use afm_thermal::{
    Average, Calibration, Density, Options, Spectrum, Unit, WelchOptions, Window, calibrate,
    density, welch,
};

const F0: f64 = 70e3;
const M: f64 = 4e-21;

/// Marsaglia's xorshift64*, enough for synthetic noise.
struct Random(u64);

impl Random {
    fn new(seed: u64) -> Self {
        let mut random = Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        for _ in 0..8 {
            random.uniform();
        }
        random
    }

    /// In the open interval from 0 to 1.
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        ((self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    fn exponential(&mut self) -> f64 {
        -nanotap_arithmetic::ln(self.uniform())
    }

    fn normal(&mut self) -> f64 {
        let radius = (2.0 * self.exponential()).sqrt();
        radius * nanotap_arithmetic::cos(std::f64::consts::TAU * self.uniform())
    }

    /// A mean of `n` exponential variables of mean 1.
    fn gamma(&mut self, n: u32) -> f64 {
        (0..n).map(|_| self.exponential()).sum::<f64>() / f64::from(n)
    }
}

/// Floor of the synthetic spectra: 1 % of the peak for low, 0.1 % for high Q.
fn floor(q: f64) -> f64 {
    let fraction = if q < 10.0 { 1e-2 } else { 1e-3 };
    fraction * density(F0, F0, q, M, 0.0)
}

/// How many of the intervals contain f0, Q, m and W.
fn covered(calibrations: &[Calibration], q: f64) -> [usize; 4] {
    let truth = [F0, q, M, floor(q)];
    let mut counts = [0; 4];
    for calibration in calibrations {
        let Calibration {
            frequency,
            quality,
            mean_square,
            floor,
            ..
        } = calibration;
        // A floor that is not found is not covered.
        let all = [Some(*frequency), Some(*quality), Some(*mean_square), *floor];
        for ((count, estimate), truth) in counts.iter_mut().zip(all).zip(truth) {
            let is_covered =
                estimate.is_some_and(|of| of.interval[0] <= truth && truth <= of.interval[1]);
            *count += usize::from(is_covered);
        }
    }
    counts
}

fn check(name: &str, calibrations: &[Calibration], q: f64) {
    let counts = covered(calibrations, q);
    let misfits = calibrations
        .iter()
        .filter(|of| of.scatter.is_misfit)
        .count();
    let foreign: usize = calibrations.iter().map(|of| of.warnings.len()).sum();
    println!(
        "{name}: {counts:?} of {}, {misfits} misfits, {foreign} warnings",
        calibrations.len()
    );
    assert_eq!(calibrations.len(), 200);
    assert!(
        counts.iter().all(|count| (180..=197).contains(count)),
        "{name}: {counts:?}"
    );
    // Four standard deviations.
    assert!(misfits <= 4, "{name}: {misfits} misfits");
}

/// 200 spectra whose ordinates are independent, from 0.2 f0 to 2.5 f0, or 50 widths around f0.
fn spectra(q: f64, averages: u32, step: f64, seed: u64) -> Vec<Calibration> {
    calibrations(q, averages, step, seed, |spectrum| {
        let spectrum = spectrum.with_averages(f64::from(averages), Average::Powers);
        spectrum.expect("a spectrum").with_window(Window::None)
    })
}

/// The same with what is stated about the averages.
fn calibrations(
    q: f64,
    averages: u32,
    step: f64,
    seed: u64,
    stated: impl Fn(Spectrum) -> Spectrum,
) -> Vec<Calibration> {
    let mut random = Random::new(seed);
    let ends = [
        (1.0 - 50.0 / q).max(0.2) * F0,
        (1.0 + 50.0 / q).min(2.5) * F0,
    ];
    let frequency: Vec<f64> = (1..)
        .map(|k| f64::from(k) * step)
        .skip_while(|f| *f < ends[0])
        .take_while(|f| *f < ends[1])
        .collect();
    let one = |_| {
        let power: Vec<f64> = frequency
            .iter()
            .map(|f| density(*f, F0, q, M, floor(q)) * random.gamma(averages))
            .collect();
        let spectrum = Spectrum::new(&frequency, &power, Density::Power, Unit::Metre);
        let spectrum = stated(spectrum.expect("a spectrum"));
        calibrate(&spectrum, &Options::default()).expect("a calibration")
    };
    (0..200).map(one).collect()
}

#[test]
fn in_liquid_one_periodogram() {
    check("Q 2, n 1", &spectra(2.0, 1, 175.0, 1), 2.0);
}

#[test]
fn in_liquid_many_averages() {
    check("Q 2, n 100", &spectra(2.0, 100, 175.0, 2), 2.0);
}

/// The number of averages follows from the scatter.
#[test]
fn in_liquid_without_the_number_of_averages() {
    let calibrations = calibrations(2.0, 100, 175.0, 8, |spectrum| spectrum);
    check("Q 2, n unknown", &calibrations, 2.0);
}

#[test]
fn in_air_one_periodogram() {
    check("Q 100, n 1", &spectra(100.0, 1, 150.0, 3), 100.0);
}

#[test]
fn in_air_many_averages() {
    check("Q 100, n 20", &spectra(100.0, 20, 150.0, 4), 100.0);
}

#[test]
fn narrow_peak_one_periodogram() {
    check("Q 450, n 1", &spectra(450.0, 1, 30.0, 5), 450.0);
}

/// Records of an oscillator, by the exact solution of its stochastic equation over a sample, with
/// white noise; Welch's spectra of 31 overlapping segments. Their ordinates are correlated.
fn records(q: f64, window: Window, seed: u64) -> Vec<Calibration> {
    const RATE: f64 = 1e6;
    const SAMPLES: usize = 16 * 1024;
    let mut random = Random::new(seed);
    let omega = std::f64::consts::TAU * F0;
    let decay = omega / (2.0 * q);
    let damped = (omega * omega - decay * decay).sqrt();
    let dt = 1.0 / RATE;
    let (sin, cos) = nanotap_arithmetic::sin_cos(damped * dt);
    let shrink = nanotap_arithmetic::exp(-decay * dt);
    // The propagator of (x, v), v in units of ω.
    let a = [
        [
            shrink * (cos + decay / damped * sin),
            shrink * omega / damped * sin,
        ],
        [
            -shrink * omega / damped * sin,
            shrink * (cos - decay / damped * sin),
        ],
    ];
    // The covariance of the noise keeps ⟨x²⟩ = ⟨v²⟩ = M stationary: C − A C Aᵀ.
    let product = |i: usize, j: usize| a[i][0] * a[j][0] + a[i][1] * a[j][1];
    let noise = [
        M * (1.0 - product(0, 0)),
        -M * product(0, 1),
        M * (1.0 - product(1, 1)),
    ];
    let l00 = noise[0].sqrt();
    let l10 = noise[1] / l00;
    let l11 = (noise[2] - l10 * l10).max(0.0).sqrt();
    let white = (0.5 * floor(q) * RATE).sqrt();
    let one = |_| {
        let mut state = [M.sqrt() * random.normal(), M.sqrt() * random.normal()];
        let sample = |_| {
            let [x, v] = state;
            let (first, second) = (random.normal(), random.normal());
            state = [
                a[0][0] * x + a[0][1] * v + l00 * first,
                a[1][0] * x + a[1][1] * v + l10 * first + l11 * second,
            ];
            state[0] + white * random.normal()
        };
        let record: Vec<f64> = (0..SAMPLES).map(sample).collect();
        let options = WelchOptions {
            segment: Some(1024),
            window: Some(window),
        };
        let spectrum = welch(&record, RATE, Unit::Metre, &options).expect("a spectrum");
        calibrate(&spectrum, &Options::default()).expect("a calibration")
    };
    (0..200).map(one).collect()
}

#[test]
fn a_record_in_liquid() {
    check("Q 2, record, Hann", &records(2.0, Window::Hann, 6), 2.0);
}

/// Bins of 977 Hz and a peak of 3.5 kHz: the window broadens the peak, which its kernel takes into
/// account.
#[test]
fn a_record_whose_window_broadens_the_peak() {
    check("Q 20, record, Hann", &records(20.0, Window::Hann, 7), 20.0);
}

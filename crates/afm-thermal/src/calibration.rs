//! From a spectrum to spring constant, quality factor, resonance frequency and sensitivity.

use nalgebra::{Matrix4, Vector4};
use nanotap_arithmetic::{cos, ln};
use schemars::JsonSchema;
use serde::Serialize;

use crate::error::{positive, require};
use crate::fit::{Fit, fit, start};
use crate::foreign::foreign_peaks;
use crate::mode_factor::ModeFactor;
use crate::oscillator::Oscillator;
use crate::scatter::{BinScatter, robust_averages};
use crate::spectrum::{Average, Bin, Density, Spectrum, Unit, Window, amplitude_equivalent};
use crate::{Error, Estimate, Fluid, Plan, ReferenceLever, Warning};

/// Boltzmann's constant, J/K; exact in the SI of 2019.
pub const BOLTZMANN: f64 = 1.380_649e-23;

/// Fewest bins of a fit.
const MIN_BINS: usize = 16;
/// Default range relative to f0: above 1/f noise, below the second mode at 6.27 f0.
const RANGE: [f64; 2] = [0.3, 2.2];
/// Widths f0/Q on each side of a narrow peak in the default range.
const RANGE_WIDTHS: f64 = 40.0;
/// Times that foreign peaks are looked for.
const MAX_ROUNDS: usize = 4;
/// Most foreign peaks that warnings name.
const MAX_NAMED_PEAKS: usize = 10;
/// Fractions of the distances from f0 to the ends of the range, whose fits show the spread.
const PARTS: [[f64; 2]; 5] = [
    [0.8, 1.0],
    [1.0, 0.8],
    [0.8, 0.8],
    [0.65, 1.0],
    [0.65, 0.65],
];
/// Standard deviations at which a deviation is reported.
const SIGNIFICANT: f64 = 4.0;
/// Relative difference of the two methods that is reported.
const METHODS_DIFFER: f64 = 0.3;

/// Sensitivity of the optical lever (InvOLS), from a contact curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensitivity {
    /// Deflection per signal, m/V.
    pub value: f64,
    /// Relative standard error.
    pub relative_error: f64,
}

/// Settings of a calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Temperature of the lever, K.
    pub temperature: f64,
    /// Standard error of the temperature, K.
    pub temperature_error: f64,
    /// Range of the fit, Hz; default: 0.3 f0 to 2.2 f0, for narrow peaks 40 widths f0/Q around f0.
    pub range: Option<[f64; 2]>,
    /// Ranges that the fit leaves out, Hz.
    pub exclude: Vec<[f64; 2]>,
    /// Approximate resonance frequency, Hz; default: the highest peak in power per octave.
    pub frequency: Option<f64>,
    /// Factor between mean square and static spring constant.
    pub factor: ModeFactor,
    /// Relative standard error of the factor.
    pub factor_error: f64,
    /// Sensitivity; read for spectra in V only.
    pub sensitivity: Option<Sensitivity>,
    /// Angle between lever and sample, rad.
    pub tilt: f64,
    /// Dimensions of the lever seen from above, for Sader's method.
    pub plan: Option<Plan>,
    /// Relative standard error of the dimensions.
    pub plan_error: f64,
    /// Lever of the same shape with a known k, for Sader's method without dimensions.
    pub reference: Option<ReferenceLever>,
    /// Fluid around the lever; default: air at this temperature.
    pub fluid: Option<Fluid>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            temperature: 298.15,
            temperature_error: 0.0,
            range: None,
            exclude: Vec::new(),
            frequency: None,
            factor: ModeFactor::default(),
            factor_error: 0.0,
            sensitivity: None,
            tilt: 0.0,
            plan: None,
            plan_error: 0.0,
            reference: None,
            fluid: None,
        }
    }
}

impl Options {
    fn validate(&self) -> Result<(), Error> {
        positive("the temperature in K", self.temperature)?;
        let not_negative = |name, value: f64| {
            let is_valid = value.is_finite() && value >= 0.0;
            require(is_valid, name, value, "a finite number, at least 0")
        };
        not_negative("the error of the temperature in K", self.temperature_error)?;
        not_negative("the relative error of the factor", self.factor_error)?;
        not_negative("the relative error of the dimensions", self.plan_error)?;
        positive("the factor β/χ²", self.factor.product)?;
        if let Some(sensitivity) = self.sensitivity {
            positive("the sensitivity in m/V", sensitivity.value)?;
            not_negative(
                "the relative error of the sensitivity",
                sensitivity.relative_error,
            )?;
        }
        if let Some(frequency) = self.frequency {
            positive("the approximate resonance frequency in Hz", frequency)?;
        }
        let is_valid = self.tilt.abs() < 1.0;
        require(is_valid, "the tilt in rad", self.tilt, "-1 to 1")?;
        for [low, high] in self.range.iter().chain(&self.exclude) {
            let is_valid = low.is_finite() && *low >= 0.0;
            require(
                is_valid,
                "the lower end of a range in Hz",
                *low,
                "a number of at least 0",
            )?;
            let is_valid = high > low;
            require(
                is_valid,
                "the upper end of a range in Hz",
                *high,
                "more than the lower end",
            )?;
        }
        Ok(())
    }
}

/// Scatter of the ordinates of a fit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Scatter {
    /// Number of independent averages that the intervals use.
    pub averages: f64,
    /// Number of averages by the scatter around the fit; far fewer than those by neighbours: not an
    /// oscillator.
    pub averages_by_fit: f64,
    /// Number of averages by the scatter of neighbouring bins, which does not depend on the fit.
    pub averages_by_neighbours: f64,
    /// Factor of the variances for correlated neighbours.
    pub inflation: f64,
    /// Relative spread of f0 over the ranges of the fit, as a standard deviation.
    pub frequency_spread: f64,
    /// Relative spread of Q.
    pub quality_spread: f64,
    /// Relative spread of the mean square, hence of k.
    pub mean_square_spread: f64,
    /// Whether the scatter around the fit shows that the spectrum is not that of an oscillator; the
    /// intervals then contain the spread.
    pub is_misfit: bool,
}

/// Result of Sader's method.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Sader {
    /// Static spring constant, N/m.
    #[schemars(extend("x-unit" = "N/m"))]
    pub stiffness: Estimate,
    /// Reynolds number ρωb²/(4η), of the method with plan dimensions.
    pub reynolds: Option<f64>,
    /// The fluid, of the method with plan dimensions.
    pub fluid: Option<Fluid>,
}

/// Calibration of a lever. Intervals are of 95 %.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Calibration {
    /// Resonance frequency of the undamped first mode in its fluid, Hz.
    #[schemars(extend("x-unit" = "Hz"))]
    pub frequency: Estimate,
    /// Quality factor.
    pub quality: Estimate,
    /// Mean square of the first mode, unit², in terms of the static sensitivity.
    pub mean_square: Estimate,
    /// White floor of the one-sided power density, unit²/Hz; none below what the range shows.
    pub floor: Option<Estimate>,
    /// Unit of the spectrum.
    pub unit: Unit,
    /// Static spring constant k of the lever, N/m, normal to the lever: by equipartition; by Sader's
    /// method for a spectrum in V without a sensitivity; `None` without either.
    #[schemars(extend("x-unit" = "N/m"))]
    pub stiffness: Option<Estimate>,
    /// Spring constant along the normal of the sample, k/cos² of the tilt (J. L. Hutter, Langmuir 21,
    /// 2630 (2005)), N/m; of a tilted lever.
    #[schemars(extend("x-unit" = "N/m"))]
    pub stiffness_along_normal: Option<Estimate>,
    /// Spring constant by Sader's method.
    pub sader: Option<Sader>,
    /// Sensitivity without contact, m/V, for which equipartition gives the k of Sader's method; of a
    /// spectrum in V.
    #[schemars(extend("x-unit" = "m/V"))]
    pub sensitivity: Option<Estimate>,
    /// The factor k m/(k_B T).
    pub factor: ModeFactor,
    /// Temperature, K.
    #[schemars(extend("x-unit" = "K"))]
    pub temperature: f64,
    /// Angle between lever and sample, rad.
    #[schemars(extend("x-unit" = "rad"))]
    pub tilt: f64,
    /// Range of the fit, Hz.
    #[schemars(extend("x-unit" = "Hz"))]
    pub range: [f64; 2],
    /// Number of bins in the fit.
    pub bins: usize,
    /// Scatter of the bins.
    pub scatter: Scatter,
    /// What puts the numbers in doubt.
    #[schemars(with = "Vec<String>")]
    pub warnings: Vec<Warning>,
}

impl Calibration {
    /// The fitted one-sided power density at frequency `f` in Hz, unit²/Hz.
    pub fn density(&self, f: f64) -> f64 {
        let floor = self.floor.map_or(0.0, |floor| floor.value);
        crate::density(
            f,
            self.frequency.value,
            self.quality.value,
            self.mean_square.value,
            floor,
        )
    }
}

/// Calibrates a lever from the thermal noise of its first mode.
///
/// # Errors
/// If an option is not valid, the range has too few bins, or no resonance is found.
pub fn calibrate(spectrum: &Spectrum, options: &Options) -> Result<Calibration, Error> {
    options.validate()?;
    let mut warnings = Vec::new();
    let (range, fitted) = fit_spectrum(spectrum, options, &mut warnings)?;
    let Fitted { bins, fit, .. } = &fitted;
    let scatter = BinScatter::new(bins, &fit.ratios, &fit.oscillator);
    let (averages, inflation) = averages(spectrum, bins.len(), scatter, &mut warnings);
    let oscillator = fit.oscillator;
    let spread = spread(spectrum, bins, range, oscillator);
    let is_misfit = is_misfit(bins.len(), scatter.seen, averages, inflation);
    let mut covariance = fit.covariance * (inflation / averages);
    if is_misfit {
        // Quasi-likelihood: the scatter where it matters replaces that of the averages.
        covariance *= (averages * fit.weighted_scatter).max(1.0);
        covariance += spread;
        warnings.push(Warning::Misfit {
            difference: (1.0 / scatter.seen - 1.0 / averages).max(0.0).sqrt(),
            scatter: 1.0 / averages.sqrt(),
            spread: spread[(2, 2)].sqrt(),
        });
        warnings.extend(drift(bins, fit, averages));
    }
    warnings.extend(doubts(bins, fit, range));

    let estimate = |value: f64, direction: [f64; 4], others: &[f64]| {
        let direction = Vector4::from(direction);
        let variance = direction.dot(&(covariance * direction));
        let others: f64 = others.iter().map(|of| of * of).sum();
        Estimate::new(value, (variance.max(0.0) + others).sqrt())
    };
    let parameter = |k: usize, value| {
        let mut direction = [0.0; 4];
        direction[k] = 1.0;
        estimate(value, direction, &[])
    };
    let by_sader = sader(options, oscillator)?;
    let sader = by_sader.as_ref().map(|of| Sader {
        stiffness: estimate(of.stiffness, of.direction, &[of.error]),
        reynolds: of.reynolds,
        fluid: of.fluid,
    });
    // k m/(k_B T) and its errors.
    let energy = options.factor.product * BOLTZMANN * options.temperature;
    let temperature_error = options.temperature_error / options.temperature;
    let energy_error = nanotap_arithmetic::hypot(options.factor_error, temperature_error);
    let scale = match spectrum.unit {
        Unit::Metre => Some((1.0, 0.0)),
        Unit::Volt => options.sensitivity.map(|of| (of.value, of.relative_error)),
    };
    let thermal = scale.map(|(scale, error)| {
        let k = energy / (oscillator.m * scale * scale);
        estimate(k, [0.0, 0.0, -1.0, 0.0], &[energy_error, 2.0 * error])
    });
    let in_volts = spectrum.unit == Unit::Volt;
    let sensitivity = by_sader.filter(|_| in_volts).map(|of| {
        let value = (energy / (of.stiffness * oscillator.m)).sqrt();
        let [f0, q, ..] = of.direction;
        let direction = [-0.5 * f0, -0.5 * q, -0.5, 0.0];
        estimate(value, direction, &[0.5 * energy_error, 0.5 * of.error])
    });
    if let (Some(thermal), Some(sader)) = (&thermal, &sader) {
        let (thermal, sader) = (thermal.value, sader.stiffness.value);
        if ln(thermal / sader).abs() > METHODS_DIFFER {
            warnings.push(Warning::Methods { thermal, sader });
        }
    }
    if thermal.is_none() && sader.is_none() {
        warnings.push(Warning::NoSensitivity);
    }
    let stiffness = thermal.or(sader.map(|of| of.stiffness));
    let cosine = cos(options.tilt);
    let tilted = |k: Estimate| Estimate::new(k.value / (cosine * cosine), k.relative_error);
    Ok(Calibration {
        frequency: parameter(0, oscillator.f0),
        quality: parameter(1, oscillator.q),
        mean_square: parameter(2, oscillator.m),
        floor: fit.has_floor.then(|| parameter(3, oscillator.w)),
        unit: spectrum.unit,
        stiffness,
        stiffness_along_normal: stiffness.filter(|_| options.tilt != 0.0).map(tilted),
        sader,
        sensitivity,
        factor: options.factor,
        temperature: options.temperature,
        tilt: options.tilt,
        range,
        bins: bins.len(),
        scatter: Scatter {
            averages,
            averages_by_fit: scatter.seen,
            averages_by_neighbours: scatter.local,
            inflation,
            frequency_spread: spread[(0, 0)].sqrt(),
            quality_spread: spread[(1, 1)].sqrt(),
            mean_square_spread: spread[(2, 2)].sqrt(),
            is_misfit,
        },
        warnings,
    })
}

/// The bins of a range with their fit.
struct Fitted {
    bins: Vec<Bin>,
    fit: Fit,
    foreign: Vec<Warning>,
}

/// Chooses the range and fits it.
fn fit_spectrum(
    spectrum: &Spectrum,
    options: &Options,
    warnings: &mut Vec<Warning>,
) -> Result<([f64; 2], Fitted), Error> {
    let ends = [spectrum.bins.first(), spectrum.bins.last()];
    let all = options
        .range
        .unwrap_or(ends.map(|bin| bin.map_or(0.0, |bin| bin.frequency)));
    let too_few = |range| {
        let count = selected(spectrum, options, range).len();
        (count < MIN_BINS).then_some(Error::TooFew {
            count,
            min: MIN_BINS,
            range,
        })
    };
    if let Some(error) = too_few(all) {
        return Err(error);
    }
    let none = |range| Error::NoResonance { range };
    let bins = selected(spectrum, options, all);
    if bins.iter().all(|bin| bin.power == 0.0) {
        return Err(none(all));
    }
    let mut oscillator = start(&bins, options.frequency).ok_or(none(all))?;
    let mut range = all;
    for _ in 0..3 {
        if options.range.is_none() {
            range = default_range(oscillator, all);
            // The fit went to a frequency that was not measured.
            if range[0] >= range[1] {
                return Err(none(all));
            }
            if let Some(error) = too_few(range) {
                return Err(error);
            }
        }
        let fitted = fit_range(spectrum, options, range, oscillator).ok_or(none(range))?;
        let change = (fitted.fit.oscillator.f0 / oscillator.f0 - 1.0).abs()
            + 0.1 * (fitted.fit.oscillator.q / oscillator.q - 1.0).abs();
        oscillator = fitted.fit.oscillator;
        if options.range.is_some() || change < 0.01 {
            warnings.extend(fitted.foreign.iter().cloned());
            return Ok((range, fitted));
        }
    }
    let mut fitted = fit_range(spectrum, options, range, oscillator).ok_or(none(range))?;
    warnings.append(&mut fitted.foreign);
    Ok((range, fitted))
}

fn default_range(oscillator: Oscillator, all: [f64; 2]) -> [f64; 2] {
    let Oscillator { f0, q, .. } = oscillator;
    let reach = RANGE_WIDTHS / q;
    let low = f0 * (1.0 - reach).max(RANGE[0]);
    let high = f0 * (1.0 + reach).min(RANGE[1]);
    [low.max(all[0]), high.min(all[1])]
}

/// The bins in the range that no option excludes.
fn selected(spectrum: &Spectrum, options: &Options, range: [f64; 2]) -> Vec<Bin> {
    let inside = |[low, high]: [f64; 2], bin: &Bin| low <= bin.frequency && bin.frequency <= high;
    let is_kept = |bin: &&Bin| {
        let excluded = options.exclude.iter().any(|range| inside(*range, bin));
        inside(range, bin) && !excluded
    };
    spectrum.bins.iter().filter(is_kept).copied().collect()
}

/// Fits a range, without the foreign peaks in it.
fn fit_range(
    spectrum: &Spectrum,
    options: &Options,
    range: [f64; 2],
    start: Oscillator,
) -> Option<Fitted> {
    let mut bins = selected(spectrum, options, range);
    let mut foreign = Vec::new();
    let mut others = 0;
    let mut fitted = fit(&bins, start, spectrum.window)?;
    for _ in 0..MAX_ROUNDS {
        let local = robust_averages(&bins, &fitted.ratios);
        let averages = spectrum
            .effective_averages()
            .map_or(local, |n| n.min(local));
        let peaks = foreign_peaks(&bins, &fitted.ratios, averages, &fitted.oscillator);
        let masked: usize = peaks.iter().map(|[low, high]| high - low).sum();
        // More than a quarter is not a line in a spectrum but another spectrum.
        if peaks.is_empty() || 4 * masked > bins.len() || bins.len() - masked < MIN_BINS {
            break;
        }
        for peak in &peaks {
            let highest = (peak[0]..peak[1])
                .max_by(|a, b| fitted.ratios[*a].total_cmp(&fitted.ratios[*b]))?;
            if foreign.len() < MAX_NAMED_PEAKS {
                foreign.push(Warning::ForeignPeak {
                    frequency: bins[highest].frequency,
                    height: fitted.ratios[highest],
                });
            } else {
                others += 1;
            }
        }
        let mut index = 0;
        bins.retain(|_| {
            let is_kept = !peaks
                .iter()
                .any(|[low, high]| (*low..*high).contains(&index));
            index += 1;
            is_kept
        });
        fitted = fit(&bins, fitted.oscillator, spectrum.window)?;
    }
    if others > 0 {
        foreign.push(Warning::MoreForeignPeaks { count: others });
    }
    (bins.len() >= MIN_BINS).then_some(Fitted {
        bins,
        fit: fitted,
        foreign,
    })
}

/// Number of independent averages of each ordinate, and the factor of the variances for correlated
/// neighbours.
fn averages(
    spectrum: &Spectrum,
    bins: usize,
    scatter: BinScatter,
    warnings: &mut Vec<Warning>,
) -> (f64, f64) {
    let inflation = spectrum.window.map_or(scatter.inflation, Window::inflation);
    if spectrum.window.is_none() && inflation > 1.2 {
        warnings.push(Warning::Correlated { inflation });
    }
    let Some(stated) = spectrum.effective_averages() else {
        return (scatter.local, inflation);
    };
    let found = scatter.local;
    // The differences xₖ₋₃ − 2xₖ + xₖ₊₃ are correlated, which doubles the variance of their mean square.
    let error = ((4.0 * inflation + 6.0 / found) / bins as f64).sqrt();
    let is_far = |n: f64| ln(found / n).abs() > SIGNIFICANT * error;
    let amplitudes = amplitude_equivalent(stated);
    let raw = spectrum.density == Density::Amplitude && spectrum.average == Average::Powers;
    let mut used = stated;
    if raw
        && stated > 20.0
        && ln(found / stated) < -2.0 * error
        && ln(found / amplitudes).abs() < 2.0 * error
    {
        warnings.push(Warning::LooksLikeAmplitudes { stated, found });
        used = found;
    } else if found < stated && is_far(stated) {
        warnings.push(Warning::Averages { stated, found });
        used = found;
    }
    (used, inflation)
}

/// Whether the scatter around the fit is larger than that of the averages.
fn is_misfit(bins: usize, seen: f64, averages: f64, inflation: f64) -> bool {
    let error = ((4.0 * inflation + 6.0 / averages) / bins as f64).sqrt();
    averages / seen > 1.0 + SIGNIFICANT * error
}

/// Covariance of the logarithms of the parameters over fits of parts of the range.
fn spread(
    spectrum: &Spectrum,
    bins: &[Bin],
    [low, high]: [f64; 2],
    whole: Oscillator,
) -> Matrix4<f64> {
    let mut sum = Matrix4::zeros();
    let mut count = 0.0;
    for [below, above] in PARTS {
        let f0 = whole.f0.clamp(low, high);
        let [low, high] = [f0 - below * (f0 - low), f0 + above * (high - f0)];
        let first = bins.partition_point(|bin| bin.frequency < low);
        let last = bins.partition_point(|bin| bin.frequency <= high);
        let part = &bins[first..last.max(first)];
        let Some(of_part) = fit(part, whole, spectrum.window) else {
            continue;
        };
        let Oscillator { f0, q, m, w } = of_part.oscillator;
        let floor = if w > 0.0 && whole.w > 0.0 {
            ln(w / whole.w)
        } else {
            0.0
        };
        let change = Vector4::new(ln(f0 / whole.f0), ln(q / whole.q), ln(m / whole.m), floor);
        sum += change * change.transpose();
        count += 1.0;
    }
    sum / f64::max(count, 1.0)
}

/// A resonance that moved: the peak is lower than the fit or leans to one side.
fn drift(bins: &[Bin], fit: &Fit, averages: f64) -> Option<Warning> {
    let Oscillator { f0, q, .. } = fit.oscillator;
    if q < 20.0 {
        return None;
    }
    let near = bins.iter().zip(&fit.ratios).map(|(bin, ratio)| {
        let position = (bin.frequency - f0) / fit.oscillator.width();
        (position, *ratio)
    });
    let near: Vec<(f64, f64)> = near.filter(|(position, _)| position.abs() < 1.5).collect();
    let mean = |low: f64, high: f64| {
        let inside = near.iter().filter(|(at, _)| low <= *at && *at < high);
        let (sum, count) = inside.fold((0.0, 0.0), |(s, c), (_, u)| (s + u, c + 1.0));
        (sum / count, 1.0 / f64::sqrt(averages * count))
    };
    let parts = [mean(-1.5, -0.3), mean(-0.3, 0.3), mean(0.3, 1.5)];
    let is_seen = parts
        .iter()
        .any(|(level, error)| (level - 1.0).abs() > 2.0 * SIGNIFICANT * error);
    is_seen.then(|| Warning::Drift {
        below: parts[0].0,
        peak: parts[1].0,
        above: parts[2].0,
    })
}

/// Doubts that the fit itself raises.
fn doubts(bins: &[Bin], fit: &Fit, range: [f64; 2]) -> Vec<Warning> {
    let Oscillator { f0, q, .. } = fit.oscillator;
    let mut warnings = Vec::new();
    let peak = fit.oscillator.width();
    let is_near = |bin: &&Bin| (bin.frequency - f0).abs() < peak.max(0.05 * f0);
    let bin = bins
        .iter()
        .filter(is_near)
        .map(|bin| bin.width)
        .fold(0.0, f64::max);
    if 4.0 * bin > peak {
        warnings.push(Warning::WideBins { bin, peak });
    }
    if f0 < range[0] || f0 > range[1] {
        warnings.push(Warning::OutOfRange {
            frequency: f0,
            range,
        });
    }
    if q < std::f64::consts::FRAC_1_SQRT_2 {
        warnings.push(Warning::Overdamped { quality: q });
    }
    if !fit.has_floor {
        warnings.push(Warning::NoFloor);
    }
    warnings
}

/// k by Sader's method, with its derivatives.
struct SaderStiffness {
    stiffness: f64,
    /// Derivatives of ln k with respect to ln f0, ln Q, ln m and ln W.
    direction: [f64; 4],
    /// Relative standard error by the dimensions.
    error: f64,
    reynolds: Option<f64>,
    fluid: Option<Fluid>,
}

fn sader(options: &Options, oscillator: Oscillator) -> Result<Option<SaderStiffness>, Error> {
    let Oscillator { f0, q, .. } = oscillator;
    if let Some(plan) = options.plan {
        let fluid = match options.fluid {
            Some(fluid) => fluid,
            None => Fluid::air(options.temperature)?,
        };
        let stiffness = plan.stiffness(f0, q, &fluid)?;
        let step = 1e-4;
        // Γ at the moved frequency may be outside its fit only at the very end of it.
        let moved = plan.stiffness(f0 * (1.0 - step), q, &fluid)?;
        let by_f0 = ln(stiffness / moved) / step;
        // Re ∝ ωb²: k/L depends on b as Γᵢ(ωb²) b², and on ω as Γᵢ(ωb²) ω².
        let by_width = 2.0 + 2.0 * (by_f0 - 2.0);
        return Ok(Some(SaderStiffness {
            stiffness,
            direction: [by_f0, 1.0, 0.0, 0.0],
            error: options.plan_error * (1.0 + by_width * by_width).sqrt(),
            reynolds: Some(fluid.reynolds(plan.width, f0)?),
            fluid: Some(fluid),
        }));
    }
    let of_reference = |reference: ReferenceLever| {
        Ok(SaderStiffness {
            stiffness: reference.stiffness(f0, q)?,
            direction: [1.3, 1.0, 0.0, 0.0],
            error: 0.0,
            reynolds: None,
            fluid: None,
        })
    };
    options.reference.map(of_reference).transpose()
}

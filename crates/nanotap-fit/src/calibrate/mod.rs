//! Thermal calibration of a lever: k, f0, Q and sensitivity from a spectrum of its thermal noise or a
//! record of its deflection.
//!
//! `afm-thermal` fits; here are the files, tables and units.

mod source;
mod unit;

use std::fmt::Write as _;
use std::path::Path;

pub use afm_thermal::{Calibration, Estimate, Unit, Warning};

use afm_thermal::{
    Average, Fluid, ModeFactor, Options, Plan, ReferenceLever, Sensitivity, Spectrum, WelchOptions,
    Window,
};
use nanotap_case::input::{self, MAX_TABLE_BYTES, Origin};
use nanotap_case::physical::Remark;
use nanotap_case::table::Table;
use nanotap_error::Error;
use nanotap_figures::Figure;
use nanotap_observe as observe;
use nanotap_observe::frame::{Frame, Rows, frame};
use nanotap_quantity::number::significant;
use nanotap_quantity::{Dimension, Display, Kind, KindEntry};
use nanotap_study::request::options;
use nanotap_study::value::Amount;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::figure::calibrate::calibrate_figure;
use source::{CELSIUS, Measurement, Signal, Stated};

/// Temperature in °C above which a number may have been meant in K.
const HOT: f64 = 200.0;

/// Sensitivity of the optical lever, m/V.
pub(crate) const SENSITIVITY: Kind = Kind::new(&KindEntry {
    name: "sensitivity",
    dimension: Dimension::new(-1, -1, 2).charged(1),
    si_unit: "m/V",
    display: Display::Prefixed,
    noun: "a length per voltage",
    example: "40 nm/V",
    model_unit: None,
});
/// Temperature of the lever that is taken where none is stated, °C.
const ROOM_TEMPERATURE: f64 = 25.0;

/// What was averaged in a spectrum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AverageKind {
    /// As the instrument does: amplitudes for Nanosurf, else powers.
    #[default]
    Auto,
    /// Powers.
    Powers,
    /// Amplitudes: the density is low by π/4.
    Amplitudes,
}

/// Window of the periodograms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum WindowKind {
    /// Hann for a record; for a spectrum the correlation of its bins is estimated.
    #[default]
    Auto,
    /// No window.
    None,
    /// Hann.
    Hann,
    /// Blackman.
    Blackman,
}

/// Fluid around the lever.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FluidKind {
    /// As the file states, else air.
    #[default]
    Auto,
    /// Air at 101 kPa.
    Air,
    /// Water.
    Water,
}

options! {
    /// Options of a thermal calibration.
    pub struct CalibrateOptions {
        /// Spectrum of the file, by its name or counted from 0; default: `average`, else the first
        #[schemars(extend("x-value" = "NAME"))]
        pub spectrum: Option<String> = None,
        /// Column of a table with the density or the deflection; default: the first with such a unit
        #[schemars(extend("x-value" = "NAME"))]
        pub column: Option<String> = None,
        /// Unit of the density, as in "pm^2/Hz" or "V/sqrt(Hz)", or of the deflection; default: as the file states
        #[schemars(extend("x-value" = "UNIT"))]
        pub unit: Option<String> = None,
        /// Sampling rate of a record without times, as in "1 MHz"
        #[schemars(extend("x-value" = "RATE"))]
        pub rate: Option<Amount> = None,
        /// The density is two-sided: half as high as a one-sided one
        pub two_sided: bool = false,
        /// Number of averaged periodograms; default: as the file states, else from the scatter
        #[schemars(range(min = 1), extend("x-value" = "N"))]
        pub averages: Option<f64> = None,
        /// What was averaged
        pub average: AverageKind = AverageKind::Auto,
        /// Window of the periodograms
        pub window: WindowKind = WindowKind::Auto,
        /// Samples of a segment of a record, a power of two; default: an eighth of the record
        #[schemars(range(min = 64, max = 4_194_304), extend("x-value" = "SAMPLES"))]
        pub segment: Option<usize> = None,
        /// Lower end of the fit, as in "8 kHz"; default: 0.3 f0, nearer for a narrow peak
        #[schemars(extend("x-value" = "FREQUENCY"))]
        pub from: Option<Amount> = None,
        /// Upper end of the fit; default: 2.2 f0, nearer for a narrow peak
        #[schemars(extend("x-value" = "FREQUENCY"))]
        pub to: Option<Amount> = None,
        /// Range that the fit leaves out, as in "49 kHz:51 kHz"; may be repeated
        #[schemars(extend("x-value" = "LOW:HIGH"))]
        pub exclude: Vec<String> = Vec::new(),
        /// Approximate resonance frequency; default: the highest peak in power per octave
        #[schemars(extend("x-value" = "FREQUENCY"))]
        pub frequency: Option<Amount> = None,
        /// Temperature of the lever, °C; default: as the file states, else 25
        #[schemars(range(min = -273, max = 1500), extend("x-value" = "CELSIUS"))]
        pub temperature: Option<f64> = None,
        /// Standard error of the temperature, K
        #[schemars(range(min = 0), extend("x-value" = "K"))]
        pub temperature_error: f64 = 0.0,
        /// Sensitivity (InvOLS) of a spectrum in V, as in "40 nm/V"; default: as the file states
        #[schemars(extend("x-value" = "SENSITIVITY"))]
        pub sensitivity: Option<Amount> = None,
        /// Relative standard error of the sensitivity, as in "3 %"
        #[schemars(extend("x-value" = "FRACTION"))]
        pub sensitivity_error: Option<Amount> = None,
        /// Factor k m/(kB T) that replaces 0.817, the one of a bare rectangular lever with a small light spot at
        /// its end
        #[schemars(range(min = 0), extend("x-value" = "FACTOR"))]
        pub factor: Option<f64> = None,
        /// Relative standard error of the factor, as in "5 %"
        #[schemars(extend("x-value" = "FRACTION"))]
        pub factor_error: Option<Amount> = None,
        /// Position of the light spot from the clamp, as a fraction of the length
        #[schemars(range(min = 0, max = 1), extend("x-value" = "FRACTION"))]
        pub spot: f64 = 1.0,
        /// Angle between lever and sample, as in "11 deg": k along the sample's normal is reported too
        #[schemars(extend("x-value" = "ANGLE"))]
        pub tilt: Option<Amount> = None,
        /// Length of the rectangular lever for Sader's method, as in "225 um"
        #[schemars(extend("x-value" = "LENGTH"))]
        pub length: Option<Amount> = None,
        /// Width of the rectangular lever for Sader's method
        #[schemars(extend("x-value" = "WIDTH"))]
        pub width: Option<Amount> = None,
        /// Relative standard error of length and width, as in "2 %"
        #[schemars(extend("x-value" = "FRACTION"))]
        pub dimension_error: Option<Amount> = None,
        /// Fluid around the lever for Sader's method
        pub fluid: FluidKind = FluidKind::Auto,
        /// Density of another fluid, as in "785 kg/m^3"
        #[schemars(extend("x-value" = "DENSITY"))]
        pub density: Option<Amount> = None,
        /// Viscosity of another fluid, as in "2 mPa s"
        #[schemars(extend("x-value" = "VISCOSITY"))]
        pub viscosity: Option<Amount> = None,
        /// Calibrated lever of the same shape for Sader's method, k,f0,Q as in "2.8 N/m,75 kHz,180"
        #[schemars(extend("x-value" = "K,F0,Q"))]
        pub reference: Option<String> = None,
    }
}

/// The document of a thermal calibration.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct CalibrateReport {
    /// File or table.
    pub source: String,
    /// Name of the spectrum or channel.
    pub name: String,
    /// The calibration. Estimates have value, relative standard error and the ends of the 95 %
    /// interval, in SI.
    #[serde(flatten)]
    pub calibration: Calibration,
    /// Block of a case file with k, f0, Q and the relative standard error of k.
    pub cantilever: String,
    /// What was read, and what was taken where nothing is stated.
    pub notes: Vec<String>,
    /// The spectrum.
    #[serde(skip)]
    pub spectrum: Spectrum,
}

impl CalibrateReport {
    /// Frequency, density, the density of the fit and their ratio, for all bins of the spectrum.
    pub fn spectrum_table(&self) -> Frame<'_> {
        let bins = self.spectrum.frequencies().zip(self.spectrum.powers());
        let density = observe::Dimension::Unit(match self.calibration.unit {
            Unit::Volt => "V^2/Hz",
            Unit::Metre => "m^2/Hz",
        });
        let fit = |f| self.calibration.density(f);
        frame! { Rows::new("spectrum", bins, None);
            "frequency", "frequency", (Frequency, Digits(5)) => |(f, _)| f;
            "density", "power density", (density, Digits(5)) => |(_, power)| power;
            "fit", "fit", (density, Digits(5)) => move |(f, _)| fit(f);
            "ratio", "density / fit", Digits(5) => move |(f, power)| power / fit(f);
        }
    }

    /// The figure.
    pub fn figure(&self) -> Figure {
        calibrate_figure(self)
    }

    /// What was taken where nothing is stated, and what is doubtful.
    pub fn remarks(&self) -> Vec<Remark> {
        let mut remarks = Remark::notes(&self.notes);
        let warnings = self.calibration.warnings.iter();
        remarks.extend(warnings.map(|warning| Remark::warning(warning.to_string())));
        remarks
    }
}

/// Calibrates a lever from a file of an instrument or a table as text.
///
/// # Errors
/// If the file cannot be read, an option is not valid, or no resonance is found.
pub fn calibrate_file(path: &Path, options: &CalibrateOptions) -> Result<CalibrateReport, Error> {
    let bytes = input::read(path, MAX_TABLE_BYTES, Origin::User)?;
    calibrate_bytes(&path.display().to_string(), bytes, options)
}

impl CalibrateReport {
    /// The tables: the spectrum, which files contain, and the estimates.
    pub fn tables(&self) -> Vec<Frame<'_>> {
        vec![self.spectrum_table(), self.estimate_table()]
    }

    /// The estimates with their relative standard errors and 95 % intervals, each in its own unit.
    pub fn estimate_table(&self) -> Frame<'static> {
        frame! { Rows::new("estimates", self.estimates(), None);
            "quantity", "", Plain => |row| row.name;
            "", "estimate", Plain => |row| (row.shown)(row.estimate.value);
            "", "error", Plain => |row| format!("{} %", significant(100.0 * row.estimate.relative_error, 2));
            .align(Right); .label("relative standard error");
            "", "95 % interval", Plain => |row| row.estimate.interval.map(row.shown).join(" to ");
            "value", "estimate", Digits(5) => |row| row.estimate.value; .only_in_files();
            "relative_error", "relative standard error", Digits(5) => |row| row.estimate.relative_error;
            .only_in_files();
            "low", "lower end of the 95 % interval", Digits(5) => |row| row.estimate.interval[0]; .only_in_files();
            "high", "upper end of the 95 % interval", Digits(5) => |row| row.estimate.interval[1]; .only_in_files();
            "unit", "unit of the numbers", Plain => |row| row.unit; .only_in_files();
        }
    }

    fn estimates(&self) -> Vec<EstimateRow> {
        let calibration = &self.calibration;
        let stiffness: UnitAndText = ("N/m", |value| Kind::Stiffness.format(value));
        let frequency: UnitAndText = ("Hz", |value| Kind::Frequency.format_digits(value, 6));
        let sensitivity: UnitAndText = ("m/V", |value| SENSITIVITY.format_digits(value, 4));
        let [rms, floor]: [UnitAndText; 2] = match calibration.unit {
            Unit::Volt => [
                ("V", |value| Kind::Voltage.format(value)),
                ("V/sqrt(Hz)", |value| {
                    format!("{}/√Hz", Kind::Voltage.format(value))
                }),
            ],
            Unit::Metre => [
                ("m", |value| Kind::Length.format(value)),
                ("m/sqrt(Hz)", |value| {
                    format!("{}/√Hz", Kind::Length.format(value))
                }),
            ],
        };
        // Roots halve the errors.
        let root = |of: Estimate| Estimate::new(of.value.sqrt(), 0.5 * of.relative_error);
        let of_sader = calibration.sader.map(|sader| sader.stiffness);
        let rows = [
            ("spring constant k", calibration.stiffness, stiffness),
            (
                "k along the sample's normal",
                calibration.stiffness_along_normal,
                stiffness,
            ),
            ("k by Sader's method", of_sader, stiffness),
            ("resonance f0", Some(calibration.frequency), frequency),
            (
                "quality factor Q",
                Some(calibration.quality),
                ("", |value| significant(value, 4)),
            ),
            ("sensitivity (InvOLS)", calibration.sensitivity, sensitivity),
            ("rms of the mode", Some(root(calibration.mean_square)), rms),
            ("noise floor", calibration.floor.map(root), floor),
        ];
        let known = rows.into_iter().filter_map(|(name, estimate, of)| {
            Some(EstimateRow {
                name,
                estimate: estimate?,
                unit: of.0,
                shown: of.1,
            })
        });
        known.collect()
    }
}

/// A unit, and how a number in it is shown.
type UnitAndText = (&'static str, fn(f64) -> String);

/// A row of the table of estimates.
#[derive(Clone, Copy)]
struct EstimateRow {
    name: &'static str,
    estimate: Estimate,
    /// The SI unit of its numbers; empty for a pure number.
    unit: &'static str,
    shown: fn(f64) -> String,
}

/// Calibrates a lever from the content of such a file with this name.
///
/// # Errors
/// As [`calibrate_file`].
pub fn calibrate_bytes(
    name: &str,
    bytes: Vec<u8>,
    options: &CalibrateOptions,
) -> Result<CalibrateReport, Error> {
    let measurement = source::of_bytes(name, bytes, options)?;
    calibrate(measurement, name.to_owned(), options)
}

/// Calibrates a lever from a table with frequency and density, or time and deflection.
///
/// # Errors
/// As [`calibrate_file`].
pub fn calibrate_table(
    table: &Table,
    options: &CalibrateOptions,
) -> Result<CalibrateReport, Error> {
    let measurement = source::of_table(table, options)?;
    calibrate(measurement, table.name.clone(), options)
}

fn calibrate(
    measurement: Measurement,
    source: String,
    options: &CalibrateOptions,
) -> Result<CalibrateReport, Error> {
    measurement.refuse_without_effect(options)?;
    let Measurement {
        signal,
        name,
        stated,
        mut notes,
        ..
    } = measurement;
    let spectrum = spectrum(signal, &stated, options)?;
    let settings = settings(&spectrum, &stated, options, &mut notes)?;
    let calibration =
        afm_thermal::calibrate(&spectrum, &settings).map_err(|error| refused(&error))?;
    Ok(CalibrateReport {
        source,
        name,
        cantilever: block(&calibration),
        calibration,
        notes,
        spectrum,
    })
}

fn refused(error: &afm_thermal::Error) -> Error {
    use afm_thermal::Error as Thermal;
    let remedy = match error {
        Thermal::NoResonance { .. } | Thermal::TooFew { .. } => {
            "name the range with {from} and {to}, and the approximate resonance with {frequency}"
        }
        Thermal::Reynolds { .. } => "check {width}, {density} and {viscosity}",
        Thermal::Option { .. } => "correct the option",
        _ => "record or export the spectrum again",
    };
    Error::input(error.to_string(), remedy)
}

/// The spectrum with what is stated of its averages.
fn spectrum(
    signal: Signal,
    stated: &Stated,
    options: &CalibrateOptions,
) -> Result<Spectrum, Error> {
    let refused = |error| refused(&error);
    let window = match options.window {
        WindowKind::Auto => None,
        WindowKind::None => Some(Window::None),
        WindowKind::Hann => Some(Window::Hann),
        WindowKind::Blackman => Some(Window::Blackman),
    };
    let (frequency, values, density, unit) = match signal {
        Signal::Record {
            samples,
            rate,
            unit,
        } => {
            let welch = WelchOptions {
                segment: options.segment,
                window,
            };
            return afm_thermal::welch(&samples, rate, unit, &welch).map_err(refused);
        }
        Signal::Spectrum {
            frequency,
            values,
            density,
            unit,
        } => (frequency, values, density, unit),
    };
    let mut spectrum = Spectrum::new(&frequency, &values, density, unit).map_err(refused)?;
    let average = match options.average {
        AverageKind::Auto => stated.average,
        AverageKind::Powers => Average::Powers,
        AverageKind::Amplitudes => Average::Amplitudes,
    };
    spectrum = match options.averages.or(stated.averages) {
        Some(averages) => spectrum.with_averages(averages, average).map_err(refused)?,
        None => spectrum.with_average(average),
    };
    if let Some(window) = window {
        spectrum = spectrum.with_window(window);
    }
    if options.two_sided {
        spectrum = spectrum.from_two_sided();
    }
    Ok(spectrum)
}

/// The options of the fit.
fn settings(
    spectrum: &Spectrum,
    stated: &Stated,
    options: &CalibrateOptions,
    notes: &mut Vec<String>,
) -> Result<Options, Error> {
    let number =
        |name: &str, amount: &Option<Amount>, kind| self::amount(name, amount.as_ref(), kind);
    let fraction = |name: &str, amount: &Option<Amount>| {
        number(name, amount, Kind::Number).map(|of| of.unwrap_or(0.0))
    };
    let celsius = options.temperature.map(|of| of + CELSIUS);
    if let Some(celsius) = options.temperature.filter(|of| *of > HOT) {
        notes.push(format!(
            "temperature of {celsius} °C, as stated; {celsius} K are {} °C",
            significant(celsius - CELSIUS, 4)
        ));
    }
    let temperature = celsius.or(stated.temperature).unwrap_or_else(|| {
        notes.push(format!("temperature of {ROOM_TEMPERATURE} °C assumed"));
        ROOM_TEMPERATURE + CELSIUS
    });
    let sensitivity =
        number("sensitivity", &options.sensitivity, SENSITIVITY)?.or(stated.sensitivity);
    let sensitivity_error = fraction("sensitivity_error", &options.sensitivity_error)?;
    if spectrum.unit() == Unit::Metre && options.sensitivity.is_some() {
        return Err(Error::option(
            "sensitivity",
            "the spectrum is in m: its sensitivity has been applied",
            "leave the sensitivity out, or state the unit of the spectrum with {unit}",
        ));
    }
    let factor = match options.factor {
        Some(factor) => ModeFactor::of_product(factor),
        None => ModeFactor::at_spot(options.spot),
    };
    let given_plan = number("length", &options.length, Kind::Length)?.zip(number(
        "width",
        &options.width,
        Kind::Length,
    )?);
    if given_plan.is_none() && (options.length.is_some() || options.width.is_some()) {
        return Err(Error::input(
            "only one of {length} and {width} is given",
            "Sader's method needs both",
        ));
    }
    let plan = given_plan.or(stated.plan.map(<(f64, f64)>::from));
    let plan = plan.map(|(length, width)| Plan { length, width });
    let ends = [
        number("from", &options.from, Kind::Frequency)?,
        number("to", &options.to, Kind::Frequency)?,
    ];
    let last = spectrum.frequencies().last().unwrap_or(0.0);
    let range = match ends {
        [None, None] => None,
        [low, high] => Some([low.unwrap_or(0.0), high.unwrap_or(last)]),
    };
    Ok(Options {
        temperature,
        temperature_error: options.temperature_error,
        range,
        exclude: options
            .exclude
            .iter()
            .map(|text| excluded(text))
            .collect::<Result<_, _>>()?,
        frequency: number("frequency", &options.frequency, Kind::Frequency)?,
        factor: factor.map_err(|error| refused(&error))?,
        factor_error: fraction("factor_error", &options.factor_error)?,
        sensitivity: sensitivity.map(|value| Sensitivity {
            value,
            relative_error: sensitivity_error,
        }),
        tilt: number("tilt", &options.tilt, Kind::Angle)?
            .or(stated.tilt)
            .unwrap_or(0.0),
        plan,
        plan_error: fraction("dimension_error", &options.dimension_error)?,
        reference: options.reference.as_deref().map(reference).transpose()?,
        fluid: fluid(stated, options, temperature)?,
    })
}

/// The fluid; `None` for the default.
fn fluid(
    stated: &Stated,
    options: &CalibrateOptions,
    temperature: f64,
) -> Result<Option<Fluid>, Error> {
    let density = amount("density", options.density.as_ref(), Kind::Density)?;
    let viscosity = amount("viscosity", options.viscosity.as_ref(), Kind::Viscosity)?;
    match (density, viscosity) {
        (Some(density), Some(viscosity)) => return Ok(Some(Fluid { density, viscosity })),
        (None, None) => {}
        _ => {
            return Err(Error::input(
                "only one of {density} and {viscosity} is given",
                "a fluid has both",
            ));
        }
    }
    let named = match options.fluid {
        FluidKind::Auto => return Ok(stated.fluid),
        FluidKind::Air => Fluid::air(temperature),
        FluidKind::Water => Fluid::water(temperature),
    };
    named.map(Some).map_err(|error| refused(&error))
}

/// The value of an option in SI.
fn amount(name: &str, amount: Option<&Amount>, kind: Kind) -> Result<Option<f64>, Error> {
    let read = |amount: &Amount| {
        kind.parse(amount.text()).map_err(|error| {
            let remedy = format!("give {} such as \"{}\"", kind.noun(), kind.example());
            Error::option(name, error.to_string(), remedy)
        })
    };
    amount.map(read).transpose()
}

/// A range as in `49 kHz:51 kHz`.
fn excluded(text: &str) -> Result<[f64; 2], Error> {
    let ends = text.split_once(':').and_then(|(low, high)| {
        let parse = |text: &str| Kind::Frequency.parse(text).ok();
        Some([parse(low)?, parse(high)?])
    });
    ends.filter(|[low, high]| low < high).ok_or_else(|| {
        Error::option(
            "exclude",
            format!("expected LOW:HIGH, got `{text}`"),
            "name both ends in ascending order, as in \"49 kHz:51 kHz\"",
        )
    })
}

/// A lever as in `2.8 N/m,75 kHz,180`.
fn reference(text: &str) -> Result<ReferenceLever, Error> {
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let lever = || {
        let [k, f0, q] = parts[..] else { return None };
        Some(ReferenceLever {
            stiffness: Kind::Stiffness.parse(k).ok()?,
            frequency: Kind::Frequency.parse(f0).ok()?,
            quality: Kind::Number.parse(q).ok()?,
        })
    };
    lever().ok_or_else(|| {
        Error::option(
            "reference",
            format!("expected K,F0,Q, got `{text}`"),
            "give the stiffness, frequency and quality factor, as in \"2.8 N/m,75 kHz,180\"",
        )
    })
}

/// The block of a case file. Without k it lacks k.
fn block(calibration: &Calibration) -> String {
    let mut text = "[cantilever]\n".to_owned();
    let mut line = |words: String| {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{words}");
    };
    if let Some(k) = calibration.stiffness {
        line(format!(
            "k = \"{}\"",
            Kind::Stiffness.format_digits(k.value, 5)
        ));
        let percent = significant(100.0 * k.relative_error, 2);
        line(format!("k_error = \"{percent} %\""));
    }
    let f0 = Kind::Frequency.format_digits(calibration.frequency.value, 6);
    line(format!("f0 = \"{f0}\""));
    line(format!("Q = {}", significant(calibration.quality.value, 4)));
    text
}

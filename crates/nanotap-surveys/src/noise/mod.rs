//! Thermal noise at a working point: of the lever alone, and in what a lock-in amplifier reads while
//! the tip taps.
//!
//! By the fluctuation–dissipation theorem the lever's damping matrix C comes with a random force of
//! intensity 2 k_B T C on its modes. Its effect is small, so it obeys the linearisation along the
//! orbit: see `linearised.rs`. Noise of the sample and of the detector is not included. Escapes to
//! another state need a large noise; `saddle.rs` estimates how large.

mod free_lever;
mod linearised;
mod saddle;

use nalgebra::{Complex, DMatrix, DVector, Matrix2};
use nanotap_arithmetic::ComplexFunctions as _;
use nanotap_case::physical::Remark;
use schemars::JsonSchema;
use serde::Serialize;

use crate::figure::noise::noise_figure;
pub use free_lever::{Calibrations, ThermalSpectrum};
pub use linearised::ReadingSpectrum;
use linearised::{Linearised, LockIn};
use nanotap_case::Case;
use nanotap_case::key::Key;
use nanotap_case::physical::Kind;
use nanotap_case::state::WrittenState;
use nanotap_dynamics::control::Control;
use nanotap_error::Error;
use nanotap_figures::Figure;
use nanotap_model::Model;
use nanotap_model::cantilever::Cantilever;
use nanotap_model::galerkin::Galerkin;
use nanotap_model::parameter::Parameter;
use nanotap_motions::orbit::{OrbitOptions, OrbitReport, OrbitStudy};
use nanotap_observe::frame::{Frame, Rows, frame};
use nanotap_observe::{Derivative, ObservableSet};
use nanotap_study::Study;
use nanotap_study::cantilever;
use nanotap_study::request::options;
use nanotap_study::value::Amount;
pub use saddle::SaddleDistance;

/// Boltzmann's constant in J/K; exact in the SI of 2019.
pub const BOLTZMANN: f64 = 1.380_649e-23;

/// Thermal noise at a working point. All quantities are in SI.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct NoiseReport {
    /// Temperature of the lever and its surroundings, K.
    #[schemars(extend("x-unit" = "K"))]
    pub temperature: f64,
    /// Time constant of the lock-in amplifier's first-order filter in s.
    #[schemars(extend("x-unit" = "s"))]
    pub time_constant: f64,
    /// Noise bandwidth of this filter in Hz, 1 over four time constants.
    #[schemars(extend("x-unit" = "Hz"))]
    pub bandwidth: f64,
    /// Root mean square of the tip deflection of the lever alone, without a drive, in m.
    #[schemars(extend("x-unit" = "m"))]
    pub thermal_rms: f64,
    /// Period of the orbit in drive periods.
    pub period: usize,
    /// Amplitude that the lock-in amplifier reads, in m.
    #[serde(rename = "A")]
    #[schemars(extend("x-unit" = "m"))]
    pub amplitude: f64,
    /// Root mean square of the noise of this amplitude in m.
    #[schemars(extend("x-unit" = "m"))]
    pub amplitude_rms: f64,
    /// Phase that the lock-in amplifier reads, behind the drive, in degrees.
    #[schemars(extend("x-unit" = "degree"))]
    pub phase: f64,
    /// Root mean square of the noise of this phase in degrees.
    #[schemars(extend("x-unit" = "degree"))]
    pub phase_rms: f64,
    /// Frequency of the drive, Hz.
    #[schemars(extend("x-unit" = "Hz"))]
    pub frequency: f64,
    /// Root mean square of the noise with which frequency modulation reads the frequency at this
    /// working point, in the bandwidth, while it holds the amplitude and the phase, in Hz.
    #[schemars(extend("x-unit" = "Hz"))]
    pub frequency_rms: f64,
    /// Root mean square of the noise of the amplitude of the free lever under the same drive, m.
    #[schemars(extend("x-unit" = "m"))]
    pub free_amplitude_rms: f64,
    /// Root mean square of the noise of the phase of the free lever under the same drive, degrees.
    #[schemars(extend("x-unit" = "degree"))]
    pub free_phase_rms: f64,
    /// Root mean square of the noise with which frequency modulation reads the free lever's frequency,
    /// in the bandwidth and at the amplitude of this drive, in Hz.
    #[schemars(extend("x-unit" = "Hz"))]
    pub free_frequency_rms: f64,
    /// Force gradient that shifts the phase of the free lever by the root mean square of its noise,
    /// N/m.
    #[schemars(extend("x-unit" = "N/m"))]
    pub force_gradient_min: f64,
    /// The unstable orbit on the boundary of the basin, if one was found.
    pub saddle: Option<SaddleDistance>,
    /// Spectrum of the noise that the lock-in amplifier reads.
    pub reading_spectrum: ReadingSpectrum,
    /// Spring constants that the usual calibrations would give.
    pub calibrations: Option<Calibrations>,
    /// Thermal spectrum of the free lever.
    pub spectrum: ThermalSpectrum,
    /// Which initial state was followed, and how to list the motions that others lead to.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

impl NoiseReport {
    /// What is read at the working point, and its noise there and of the free lever.
    pub fn summary_table(&self) -> Frame<'_> {
        let rows = [
            ("mean", [self.amplitude, self.phase, self.frequency]),
            (
                "rms noise",
                [self.amplitude_rms, self.phase_rms, self.frequency_rms],
            ),
            (
                "of the free lever",
                [
                    self.free_amplitude_rms,
                    self.free_phase_rms,
                    self.free_frequency_rms,
                ],
            ),
        ];
        frame! { Rows::new("summary", rows, None);
            "statistic", "", Plain => |(name, _)| name;
            "amplitude", "amplitude A", (Length, Prefixed(4)) => |(_, [amplitude, ..])| amplitude;
            "phase", "phase lag", (Angle, Digits(4)) => |(_, [_, phase, _])| phase;
            "frequency", "frequency, A and phase held", (Frequency, Prefixed(4)) =>
                |(_, [.., frequency])| frequency;
            .turned();
        }
    }
}

options! {
    /// Options of the thermal noise.
    pub struct NoiseOptions {
        /// Temperature in kelvin
        #[schemars(range(min = 0), extend("x-value" = "K"))]
        pub temperature: f64 = 295.0,
        /// Time constant of the lock-in amplifier's first-order filter; default: 0.25 ms
        #[schemars(extend("x-value" = "TIME"))]
        pub time_constant: Option<Amount> = None,
        /// Noise bandwidth of the lock-in amplifier, 1 over four time constants, in place of it
        #[schemars(extend("x-value" = "FREQUENCY"))]
        pub bandwidth: Option<Amount> = None,
        /// State near the orbit, at drive phase 0: a1,…,aN,v1,…,vN, or some by name, as in
        /// tip=5nm; of a physical case in m and m/s, or with units
        #[schemars(extend("x-value" = "STATE"))]
        pub state: Option<WrittenState> = None,
    }
}

/// Time constant, in drive periods, of a lock-in amplifier without ripple.
const SLOW_PERIODS: f64 = 1e5;

/// Time constant in s if none is given: a bandwidth of 1 kHz.
const TIME_CONSTANT: f64 = 0.25e-3;

impl NoiseOptions {
    /// Returns the time constant of the filter, s.
    fn time_constant(&self) -> Result<f64, Error> {
        let positive = |option, kind: Kind, amount: &Amount| {
            let value = kind.parse(amount.text());
            let value = value.map_err(|error| error.to_string()).and_then(|value| {
                let valid = value > 0.0 && value.is_finite();
                valid
                    .then_some(value)
                    .ok_or_else(|| format!("expected {} above zero, got {amount}", kind.noun()))
            });
            value.map_err(|words| {
                Error::option(option, words, "write it as in \"1 ms\" or \"1 kHz\"")
            })
        };
        match (&self.time_constant, &self.bandwidth) {
            (Some(_), Some(_)) => Err(Error::input(
                "the time constant and the bandwidth are both given",
                "leave {time_constant} or {bandwidth} out",
            )),
            (Some(time), None) => positive("time_constant", Kind::Time, time),
            (None, Some(frequency)) => {
                Ok(0.25 / positive("bandwidth", Kind::Frequency, frequency)?)
            }
            (None, None) => Ok(TIME_CONSTANT),
        }
    }
}

/// Study of thermal noise at a working point.
///
/// ```
/// use nanotap::case::Case;
/// use nanotap::control::Control;
/// use nanotap::study::Study;
/// use nanotap::study::noise::{NoiseOptions, NoiseStudy};
///
/// let words = [
///     "cantilever.k=40 N/m", "cantilever.f0=300 kHz", "cantilever.Q=400", "modes=1",
///     "sample.stiffness=20 N/m", "gap.tip=1 um",
///     "drive.actuation=tip", "drive.frequency_ratio=1", "drive.free_amplitude=10 nm",
/// ];
/// let case = Case::parse(None, &words.map(str::to_owned))?;
/// let found = NoiseStudy::run(&case, &NoiseOptions::default(), &Control::default())?;
/// // √(k_B T/k) of one mode, which is 3 % stiffer than the beam.
/// assert!((found.thermal_rms - 9.94e-12).abs() < 1e-14);
/// # Ok::<(), nanotap::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct NoiseStudy;

impl Study for NoiseStudy {
    const NAME: &'static str = "noise";
    const ABOUT: &'static str = "Compute thermal noise of amplitude and phase at a working point";
    const COUNTED: &'static str = "steps";
    type Options = NoiseOptions;
    type Report = NoiseReport;

    fn frames<'a>(_: &Case, report: &'a NoiseReport) -> Vec<Frame<'a>> {
        vec![report.spectrum.table(), report.summary_table()]
    }

    fn figure(_: &Case, report: &NoiseReport) -> Option<Figure> {
        Some(noise_figure(report))
    }

    fn remarks(_: &Case, report: &NoiseReport) -> Vec<Remark> {
        Remark::notes(&report.notes)
    }

    fn compute(
        case: &Case,
        options: &NoiseOptions,
        control: &Control<'_>,
    ) -> Result<NoiseReport, Error> {
        let lever = cantilever(case, Self::NAME)?;
        nanotap_study::without_signal(case, "the thermal noise")?;
        let view = case.physical().ok_or_else(|| {
            Error::input(
                "a dimensionless case has no unit of energy, and a temperature is one",
                "give the lever and the sample in physical quantities",
            )
        })?;
        if !lever.further_tones.is_empty() {
            return Err(Error::input(
                "the noise under two tones is not known here",
                "leave out the second tone of the drive",
            ));
        }
        if lever.has_q_control() {
            return Err(Error::input(
                "the noise under Q control is not known here: the feedback adds that of the detector",
                "leave out drive.q_control_gain, and state the Q that the loop gives the lever",
            ));
        }
        if !(options.temperature >= 0.0 && options.temperature.is_finite()) {
            return Err(Error::option(
                "temperature",
                format!(
                    "expected a temperature in kelvin, got {}",
                    options.temperature
                ),
                "give 295",
            ));
        }
        let scales = view.scales;
        let time_constant = options.time_constant()?;
        let equations = Galerkin::new(lever)
            .map_err(|error| Error::input(error.to_string(), "change the case"))?;
        let thermal = Thermal {
            energy: BOLTZMANN * options.temperature / scales.energy,
            tip: equations.modes.shapes(1.0),
            equations,
        };
        let lock_in = LockIn {
            time_constant: time_constant / scales.time,
        };
        let tapping = thermal.reading(case, options.state.as_ref(), lock_in, control)?;
        let free = thermal.reading(&free(lever), None, lock_in, control)?;
        let orbit = &tapping.orbit;
        let held_rms = thermal.held_frequency_rms(lever, &tapping, lock_in, control)?;
        // A spring κ at the tip changes the free response by 1/(1 + κ χ).
        let frequency_rms = free.frequency_rms(thermal.delay(lever.omega), lock_in);
        let turn = thermal.compliance(lever.omega).im.abs() * scales.length / scales.force;
        Ok(NoiseReport {
            temperature: options.temperature,
            time_constant,
            bandwidth: 0.25 / time_constant,
            thermal_rms: scales.length * thermal.tip_rms(),
            period: orbit.period,
            amplitude: scales.length * orbit.observables.first_harmonic,
            amplitude_rms: scales.length * tapping.amplitude_rms,
            phase: orbit.observables.phase,
            phase_rms: tapping.phase_rms.to_degrees(),
            frequency: scales.frequency * lever.omega,
            frequency_rms: held_rms / scales.time,
            free_amplitude_rms: scales.length * free.amplitude_rms,
            free_phase_rms: free.phase_rms.to_degrees(),
            free_frequency_rms: frequency_rms / scales.time,
            force_gradient_min: free.phase_rms / turn,
            saddle: saddle::nearest(
                case,
                (&orbit.state, orbit.period),
                &tapping.covariance,
                scales.length,
                control,
            )?,
            reading_spectrum: tapping.spectrum.in_si(scales.length, scales.time),
            calibrations: thermal.calibrations(view),
            spectrum: thermal.spectrum(view),
            notes: orbit.notes.clone(),
        })
    }
}

/// Returns the same lever under the same drive, so far from the sample that it never touches.
fn free(lever: &Cantilever) -> Case {
    let mut free = lever.clone();
    free.law = None;
    let far = 1.0 + free.alpha5.abs();
    Case::from(free.with(Parameter::Alpha5, 1e3 * far))
}

/// The lever's equations with the thermal force on them, in the model's units.
struct Thermal {
    equations: Galerkin,
    /// Thermal energy k_B T, model units.
    energy: f64,
    /// Mode shapes at the tip.
    tip: DVector<f64>,
}

/// Readings of a lock-in amplifier and their noise, in model units.
struct Reading {
    model: Model,
    orbit: OrbitReport,
    amplitude_rms: f64,
    /// Root mean square of the noise of the phase, rad.
    phase_rms: f64,
    /// Covariance of the continuous entries of the state.
    covariance: DMatrix<f64>,
    spectrum: ReadingSpectrum,
}

impl Reading {
    /// Noise of the frequency at which a loop holds the phase, from that of the phase at low
    /// frequencies and its derivative by the angular frequency: a loop undoes the delay of the lever,
    /// so that the noise is white over the bandwidth (Albrecht et al., J. Appl. Phys. 69, 668, 1991).
    fn frequency_rms(&self, delay: f64, lock_in: LockIn) -> f64 {
        let density = self.spectrum.phase.first().copied().unwrap_or(f64::NAN);
        let phase = (density * lock_in.bandwidth()).sqrt().to_radians();
        phase / (delay.abs() * std::f64::consts::TAU)
    }
}

impl Thermal {
    /// Noise of the drive frequency under loops that hold the amplitude and the phase by the frequency
    /// and the strength of the drive: by what they undo at low frequencies, the derivatives of the
    /// orbit by both. It is white over the bandwidth up to 1/Q, since noise and loops act on the
    /// lever in the same way.
    fn held_frequency_rms(
        &self,
        lever: &Cantilever,
        Reading { model, orbit, .. }: &Reading,
        lock_in: LockIn,
        control: &Control<'_>,
    ) -> Result<f64, Error> {
        let set = ObservableSet::FIRST_HARMONIC;
        let at = (orbit.state.as_slice(), orbit.period);
        let keys = [Parameter::Omega, Parameter::Alpha2].map(Key::of);
        let case = Case::from(lever.clone());
        let changes = Derivative::of_keys(&case, model, &keys, at, &orbit.observables, set)?;
        // Of the amplitude, and of the phase in degrees.
        let units = [1.0, 1.0_f64.to_radians()];
        let change = |row: usize, column: usize| {
            let of_set = changes[column].observables.get(row);
            let change = of_set.and_then(|(_, change)| change.number());
            change.map_or(f64::NAN, |change| units[row] * change)
        };
        let undone = Matrix2::from_fn(change).try_inverse();
        let undone = undone.unwrap_or_else(|| Matrix2::repeat(f64::NAN));
        let densities = self.slow_densities(model, orbit, control)?;
        let density = (undone * densities * undone.transpose())[(0, 0)];
        Ok((density * lock_in.bandwidth()).sqrt() / std::f64::consts::TAU)
    }

    /// Root mean square of the deflection by equipartition, √(k_B T φᵀ K⁻¹ φ).
    fn tip_rms(&self) -> f64 {
        let compliance = self.equations.stiffness[0].clone().lu().solve(&self.tip);
        (self.energy * compliance.map_or(f64::NAN, |a| a.dot(&self.tip))).sqrt()
    }

    /// Deflection of the free tip by a unit force at the tip at a frequency.
    fn compliance(&self, omega: f64) -> Complex<f64> {
        let of = |matrix: &DMatrix<f64>, factor: Complex<f64>| matrix.map(|entry| factor * entry);
        let matrix = of(&self.equations.stiffness[0], Complex::new(1.0, 0.0))
            + of(&self.equations.mass, Complex::new(-omega * omega, 0.0))
            + of(&self.equations.damping[0], Complex::new(0.0, omega));
        let tip = self.tip.map(|entry| Complex::new(entry, 0.0));
        let bent = matrix.lu().solve(&tip);
        bent.map_or(Complex::new(f64::NAN, 0.0), |bent| bent.dot(&tip))
    }

    /// Derivative of the phase lag of the free tip by the angular frequency of a force.
    fn delay(&self, omega: f64) -> f64 {
        let step = 1e-6 * omega;
        let [low, high] = [omega - step, omega + step].map(|at| self.compliance(at));
        let ratio = low / high;
        nanotap_arithmetic::atan2(ratio.im, ratio.re) / (2.0 * step)
    }

    /// The highest frequency of the modes, from above.
    fn fastest(&self) -> f64 {
        let inverse = self.equations.mass.clone().lu();
        let squares = inverse.solve(&self.equations.stiffness[0]);
        squares.map_or(0.0, |squares| squares.trace().sqrt())
    }

    /// Covariance that a unit of time adds to the velocities: 2 k_B T M⁻¹ C M⁻¹.
    fn diffusion(&self) -> DMatrix<f64> {
        let mass = self.equations.mass.clone().lu();
        let half = mass.solve(&self.equations.damping[0]).unwrap_or_default();
        let whole = mass.solve(&half.transpose()).unwrap_or_default();
        2.0 * self.energy * whole
    }

    /// The reading at the orbit of a case.
    fn reading(
        &self,
        case: &Case,
        state: Option<&WrittenState>,
        lock_in: LockIn,
        control: &Control<'_>,
    ) -> Result<Reading, Error> {
        let options = OrbitOptions {
            state: state.cloned(),
            harmonics: 0,
            observables: Some(ObservableSet::FIRST_HARMONIC),
            ..OrbitOptions::default()
        };
        let orbit = OrbitStudy::run(case, &options, control)?.motion;
        if !orbit.stable {
            return Err(Error::numerics(
                "the orbit at this working point is unstable: noise drives the lever away from it",
            ));
        }
        self.reading_at(case.model()?, orbit, lock_in, control)
    }

    /// Spectral densities of the amplitude and the phase at low frequencies, as a slow lock-in amplifier
    /// reads them: the ripple of a fast one would mix a part of the phase's noise into the amplitude's.
    fn slow_densities(
        &self,
        model: &Model,
        orbit: &OrbitReport,
        control: &Control<'_>,
    ) -> Result<Matrix2<f64>, Error> {
        let slow = LockIn {
            time_constant: SLOW_PERIODS * model.period(),
        };
        let found = Linearised::along(model, orbit, self, slow, control)?;
        // The reading of a sin(Ωt − θ) is −i a e^{−iθ}; a larger lag turns it clockwise.
        let lag = orbit.observables.phase.to_radians();
        let (sin, cos) = nanotap_arithmetic::sin_cos(lag);
        let along = DVector::from_vec(vec![-sin, -cos]);
        let across = DVector::from_vec(vec![-cos, sin]);
        let densities = found.slow_densities([&along, &across], orbit.observables.first_harmonic);
        Ok(densities.unwrap_or_else(|| Matrix2::repeat(f64::NAN)))
    }

    fn reading_at(
        &self,
        model: Model,
        orbit: OrbitReport,
        lock_in: LockIn,
        control: &Control<'_>,
    ) -> Result<Reading, Error> {
        let found = Linearised::along(&model, &orbit, self, lock_in, control)?;
        let covariance = found.stationary()?;
        let last = covariance.nrows() - 2;
        let read = found.read;
        // Without the ripple at twice the drive's frequency that the filter lets through.
        let amplitude = orbit.observables.first_harmonic;
        let size = read.modulus();
        let along = DVector::from_vec(vec![read.re / size, read.im / size]);
        let across = DVector::from_vec(vec![-read.im / size, read.re / size]);
        let block = covariance.view((last, last), (2, 2));
        let deviation = |way: &DVector<f64>| way.dot(&(block * way)).max(0.0).sqrt();
        Ok(Reading {
            amplitude_rms: deviation(&along),
            phase_rms: deviation(&across) / amplitude,
            covariance: covariance.view((0, 0), (last, last)).clone_owned(),
            spectrum: found.spectrum([&along, &across], amplitude, lock_in)?,
            model,
            orbit,
        })
    }
}

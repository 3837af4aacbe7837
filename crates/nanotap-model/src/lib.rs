//! The model of a case: a piecewise-linear system with named outputs.
//!
//! State: `(a_1 … a_N, ȧ_1 … ȧ_N)` for the cantilever, after which comes the memory of a
//! sample that recovers (see [`contact`]), zero at rest; `(x, ẋ)` for an
//! oscillator. Regime 0 is free flight. Everything that analyses or shows a motion works on a
//! [`Model`].
//!
//! A sample with a [nonlinear] force law has no contact regime: the linear system of such a model
//! is free flight alone, and a separate flow computes the motion under the force.

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

pub mod beam;
mod beam_equations;
pub mod cantilever;
pub mod contact;
pub mod drive_form;
pub mod drive_signal;
pub mod enclosed;
pub mod exact_beam;
mod fixed_point;
pub mod galerkin;
mod grazed;
pub mod lever_mode;
mod measured_modes;
pub mod model_map;
mod motion_error;
pub mod nonlinear;
pub mod oscillator;
pub mod parameter;
pub mod recording;
pub mod release;
pub mod sample_law;
pub mod spectrum;
mod tangent;
pub mod words;

use std::sync::{Arc, OnceLock};

pub use motion_error::MotionError;
use nanotap_arithmetic::CancelFlag;
use nanotap_dynamics::Wall;
use nanotap_flow::sensitivity::SystemTangent;
use nanotap_flow::{Drive, Output, System};
pub use nanotap_flow::{FlowError, vector_instructions};
pub use tangent::ModelTangent;

use crate::beam::Modes;
use crate::beam_equations::Beam;
use crate::cantilever::{Cantilever, CantileverError};
use crate::contact::law::Law;
use crate::drive_form::FrequencyRatio;
use crate::galerkin::{Galerkin, Regime};
use crate::nonlinear::{Equilibrium, Nonlinear, Variation};
use crate::parameter::Parameter;

/// Why a cantilever or an oscillator has no model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// A parameter of the cantilever is invalid.
    #[error(transparent)]
    Cantilever(#[from] CantileverError),
    /// A parameter of the oscillator is invalid.
    #[error(transparent)]
    Oscillator(#[from] crate::oscillator::OscillatorError),
    /// The equations cannot be solved in closed form.
    #[error(transparent)]
    Flow(#[from] FlowError),
    /// The force law is invalid, or the modes cannot be computed.
    #[error(transparent)]
    Nonlinear(#[from] nanotap_volterra::VolterraError),
}

/// A piecewise-linear system with named outputs, such as the tip displacement and the force.
///
/// ```
/// use nanotap::model::Model;
/// use nanotap::model::cantilever::Cantilever;
///
/// let model = Model::cantilever(&Cantilever::paper())?;
/// // Deflections and velocities of three modes.
/// assert_eq!(model.dimension(), 6);
/// assert!((model.period() - std::f64::consts::TAU / 2.6).abs() < 1e-15);
/// # Ok::<(), nanotap::model::ModelError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Regimes, transitions and drive of the piecewise-linear system, in model units.
    pub system: Arc<System>,
    /// Whether tip and sample touch in each regime; an entry per regime.
    pub contact: Vec<bool>,
    /// Tip displacement relative to the base, W (the oscillator's x).
    pub tip: Output,
    /// Height of the tip over the free surface of the sample, positive in flight, negative
    /// in contact: V_T, less the position of a surface that recovers.
    pub gap: Output,
    /// Height V_T of the tip over the undeformed surface; minus the indentation in contact.
    pub height: Output,
    /// Force of the sample on the tip, positive when it pushes the tip away; an entry per regime.
    /// The unit is EI g₀/L³ for a cantilever.
    pub force: Vec<Output>,
    /// Energy flows in each regime: see [`Model::power`].
    pub(crate) power: PowersOnDemand,
    /// The rigid stop, if there is one.
    pub rigid_stop: Option<RigidStop>,
    /// The release from the rigid stop after sticking; `None` where motions do not stick, or do not
    /// leave it in one known state.
    pub release: Option<Arc<release::Release>>,
    /// The beam's modes, if it is a beam.
    pub beam: Option<BeamOutputs>,
    /// Number of entries at the end of the state that belong to the sample.
    pub memory: usize,
    /// Phases of further tones, rad; an entry per tone.
    pub tone_phases: Vec<f64>,
    /// Data of an internal variable of the surface that is overwritten at the end of each contact,
    /// with which the volume change of the map is computed; `None` without such a variable.
    pub memory_reset: Option<MemoryReset>,
    /// The flow under a nonlinear force law; the system is then free flight alone.
    pub nonlinear: Option<Arc<Nonlinear>>,
    /// State at drive phase 0 from which a motion starts when no other is given; `None`: rest.
    pub start: Option<Vec<f64>>,
}

/// A rigid stop on which the tip bounces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RigidStop {
    /// Mass m that bounces, in the oscillator's unit of mass.
    pub mass: f64,
    /// Coefficient of restitution r, dimensionless, 0 to 1.
    pub restitution: f64,
    /// Tip displacement x at the stop, in the oscillator's unit of length.
    pub tip: f64,
}

impl RigidStop {
    /// Impulse on the tip of an impact from regime `from` to `to` at unit speed: m (1 + r), or m
    /// where the tip comes to rest on the stop.
    pub fn impulse(&self, from: usize, to: usize) -> f64 {
        let bounce = if from == to { self.restitution } else { 0.0 };
        self.mass * (1.0 + bounce)
    }
}

/// An internal variable `s` of the surface that is overwritten when contact ends, decays in flight,
/// and acts on the beam when the tip meets the surface again.
#[derive(Clone, Debug, PartialEq)]
pub struct MemoryReset {
    /// Its rate in flight, in 1/time of the model, ≤ 0.
    pub rate: f64,
    /// Change of the state per change of `s` where contact begins.
    pub kick: nalgebra::DVector<f64>,
}

/// Energy flows in one regime, as sums of `weight · a · b` over pairs of outputs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Powers {
    /// Power that the drive delivers.
    pub drive: Vec<Product>,
    /// Power that the beam's own damping takes.
    pub beam: Vec<Product>,
    /// Power that the sample's damping takes.
    pub sample: Vec<Product>,
    /// Kinetic and elastic energy stored in the lever (an energy, not a power).
    pub stored: Vec<Product>,
    /// Energy stored in the sample.
    pub stored_by_sample: Vec<Product>,
}

/// [`Powers`] of every regime, computed on first use: few of the thousands of models that a sweep
/// sets up need them.
#[derive(Clone, Debug)]
pub(crate) struct PowersOnDemand {
    known: OnceLock<Vec<Powers>>,
    /// Equations from which the powers are computed; `None` if they were given.
    equations: Option<Arc<Galerkin>>,
    /// Gap of the model in units of g₀, if it differs from that of the equations.
    gap: Option<f64>,
}

impl PowersOnDemand {
    /// Prepares the powers of these equations, without computing them.
    pub(crate) fn of(equations: Galerkin) -> Self {
        Self {
            known: OnceLock::new(),
            equations: Some(Arc::new(equations)),
            gap: None,
        }
    }

    /// The equations at the model's gap.
    fn equations(&self) -> Option<Arc<Galerkin>> {
        let known = self.equations.as_ref()?;
        let Some(gap) = self.gap else {
            return Some(Arc::clone(known));
        };
        let case = known.case.clone().with(Parameter::Alpha5, gap);
        Galerkin::new(&case).ok().map(Arc::new)
    }
}

impl From<Vec<Powers>> for PowersOnDemand {
    fn from(known: Vec<Powers>) -> Self {
        Self {
            known: known.into(),
            equations: None,
            gap: None,
        }
    }
}

impl PartialEq for PowersOnDemand {
    /// Compares equations and gaps, and powers only where these were given without equations.
    fn eq(&self, other: &Self) -> bool {
        let of = |powers: &Self| (powers.equations.clone(), powers.gap);
        of(self) == of(other) && (self.equations.is_some() || self.known == other.known)
    }
}

/// A term `weight · a · b` of a power or an energy.
#[derive(Clone, Debug, PartialEq)]
pub struct Product {
    /// Constant factor, in model units: a mass, stiffness, damping or number.
    pub weight: f64,
    /// First output of the product.
    pub a: Output,
    /// Second output of the product.
    pub b: Output,
}

/// Modes and outputs that only a beam has.
#[derive(Clone, Debug, PartialEq)]
pub struct BeamOutputs {
    /// Modes of the bare beam, N of them.
    pub modes: Arc<Modes>,
    /// Slope ∂W/∂ξ at the tip: what an optical lever reads.
    pub slope: Output,
    /// Displacement of the base, in units of g₀: α2 sin Ωτ and further tones, 0 if the drive acts
    /// on the lever itself.
    pub base: Output,
}

impl BeamOutputs {
    /// Height V(ξ, τ) = W(ξ, τ) + α2 sin Ωτ + 1 of the beam's point ξ above the sample
    /// (in units of g₀): where it vanishes, the beam itself touches.
    pub fn height(&self, xi: f64) -> Output {
        let shapes = self.modes.shapes(xi);
        let mut height = self.base.clone().with_constant(1.0);
        for (r, shape) in height.row.iter_mut().zip(shapes.iter()) {
            *r = *shape;
        }
        height
    }
}

impl Model {
    /// Names of the entries of a state: a1 … aN, v1 … vN, then s1, s2, … of the sample's memory; of an
    /// oscillator x and v.
    pub fn state_names(&self) -> Vec<String> {
        if self.beam.is_none() {
            return vec!["x".to_owned(), "v".to_owned()];
        }
        let n = (self.dimension() - self.memory) / 2;
        let named = |letter: char, count: usize| (1..=count).map(move |i| format!("{letter}{i}"));
        named('a', n)
            .chain(named('v', n))
            .chain(named('s', self.memory))
            .collect()
    }

    /// Returns the state at rest: at deflection 0, or on a rigid stop if that lies before it.
    pub fn rest(&self) -> Vec<f64> {
        let mut state = vec![0.0; self.dimension()];
        self.stop_at_wall(&mut state);
        state
    }

    /// Returns the state at drive phase 0 from which a motion starts: that of the setpoint's motion
    /// if it is given, else the state at rest.
    pub fn first_state(&self) -> Vec<f64> {
        self.start.clone().unwrap_or_else(|| self.rest())
    }

    /// Returns the states at drive phase 0 in which the tip is where the contact law ends, at a pole or
    /// at the first row of a table; `None` if the law holds at every gap.
    pub fn wall(&self) -> Option<Wall> {
        self.nonlinear.as_ref()?.wall()
    }

    /// Moves a state that lies behind a rigid stop onto the stop.
    pub fn stop_at_wall(&self, state: &mut [f64]) {
        if let (Some(stop), Some(x)) = (self.rigid_stop, state.first_mut()) {
            *x = x.min(stop.tip);
        }
    }

    /// The cantilever of `case`, Eqs. (8)–(18).
    ///
    /// # Errors
    /// When the case is not valid, or a regime is driven at an undamped resonance.
    pub fn cantilever(case: &Cantilever) -> Result<Self, ModelError> {
        let galerkin = Galerkin::new(case)?;
        let drive = drive_of(case)?;
        let Some(law) = &case.law else {
            return Self::on(&case.contact_law(None), galerkin, &drive, None);
        };
        let bare = Beam::new(&galerkin, &drive, 0)?;
        let free = bare.regime(Regime::Free, &contact::no_sample(&[]).flight, true)?;
        let nonlinear = Nonlinear::new(law, &bare, &free, &drive)?;
        let flight = contact::no_sample(&nonlinear.memory_rates());
        Self::on(&flight, galerkin, &drive, Some(nonlinear))
    }

    /// The beam on a piecewise-linear sample, or in flight alone with the flow under a `nonlinear`
    /// law.
    fn on(
        law: &Law,
        galerkin: Galerkin,
        drive: &Drive,
        nonlinear: Option<Nonlinear>,
    ) -> Result<Self, ModelError> {
        let beam = Beam::new(&galerkin, drive, law.internal)?;
        let mut regimes = vec![beam.regime(Regime::Free, &law.flight, true)?];
        let mut transitions = vec![Vec::new()];
        if nonlinear.is_none() {
            regimes.push(beam.regime(Regime::Contact, &law.contact, law.plain_contact)?);
            transitions = beam.transitions(law);
        }
        let contact: Vec<bool> = (0..regimes.len()).map(|r| r > 0).collect();
        let outputs = beam.outputs(law, regimes.len());
        let system = Arc::new(System::new(drive.clone(), regimes, transitions)?);
        let of_tones = Parameter::TONES
            .iter()
            .take(galerkin.case.further_tones.len());
        let tone_phases = of_tones
            .map(|[_, phase]| galerkin.case.get(*phase).to_radians())
            .collect();
        Ok(Self {
            contact,
            tip: outputs.tip,
            gap: outputs.gap,
            height: outputs.height,
            force: outputs.force,
            power: PowersOnDemand::of(galerkin),
            rigid_stop: None,
            release: None,
            beam: Some(outputs.beam),
            memory: law.internal,
            memory_reset: outputs.memory_reset,
            tone_phases,
            nonlinear: nonlinear.map(Arc::new),
            start: None,
            system,
        })
    }

    /// The contact law of the piecewise-linear system, with derivatives by a parameter: that of the
    /// case, or none under a nonlinear law.
    fn law_of(&self, case: &Cantilever, parameter: Option<Parameter>) -> Law {
        if let Some(nonlinear) = &self.nonlinear {
            contact::no_sample(&nonlinear.memory_rates())
        } else {
            case.contact_law(parameter)
        }
    }

    /// The equations of the cantilever that this is the model of.
    fn equations_of(&self, case: &Cantilever) -> Result<Arc<Galerkin>, ModelError> {
        match self.power.equations() {
            Some(known) => Ok(known),
            None => Ok(Arc::new(Galerkin::new(case)?)),
        }
    }

    /// Returns the energy flows; an entry per regime.
    pub fn power(&self) -> &[Powers] {
        self.power.known.get_or_init(|| {
            let Some(galerkin) = self.power.equations() else {
                return Vec::new();
            };
            let law = self.law_of(&galerkin.case, None);
            Beam::new(&galerkin, self.system.drive(), law.internal)
                .map(|beam| beam.powers(&law, &self.system))
                .unwrap_or_default()
        })
    }

    /// Calls `visit` with every constant of its outputs: the numbers that move with the gap, apart
    /// from those of its system.
    pub fn each_output_constant(&mut self, visit: &mut dyn FnMut(&mut f64)) {
        let outputs = [&mut self.gap, &mut self.height].into_iter();
        for output in outputs.chain(&mut self.force) {
            visit(&mut output.constant);
        }
        if let Some(stop) = &mut self.rigid_stop {
            visit(&mut stop.tip);
            let moved = self.release.take();
            self.release = moved.and_then(|release| release.moved_to(stop.tip));
        }
        if self.power.equations.is_some() {
            return;
        }
        for powers in self.power.known.get_mut().into_iter().flatten() {
            let products = [&mut powers.drive, &mut powers.beam, &mut powers.sample];
            let stored = [&mut powers.stored, &mut powers.stored_by_sample];
            let products = products.into_iter().chain(stored).flatten();
            for product in products {
                visit(&mut product.a.constant);
                visit(&mut product.b.constant);
            }
        }
    }

    /// Sets the gap, in units of g₀, with which quantities are computed from the equations later.
    pub fn set_gap_of_equations(&mut self, gap: f64) {
        if self.power.equations.is_some() {
            self.power.known = OnceLock::new();
            self.power.gap = Some(gap);
        }
    }

    /// Returns the equilibria of the undriven system, the tip farthest away first. For a
    /// piecewise-linear system an equilibrium is the constant part of a regime's response, if no
    /// guard of that regime is passed there.
    pub fn equilibria(&self) -> Vec<Equilibrium> {
        if let Some(nonlinear) = &self.nonlinear {
            return nonlinear.equilibria();
        }
        let (regimes, transitions) = (self.system.regimes(), self.system.transitions());
        let mut found = Vec::new();
        for (r, regime) in regimes.iter().enumerate() {
            let state = &regime.response().constant;
            let at = |output: &Output| (&output.row * state)[0] + output.constant;
            if !transitions[r].iter().all(|out| at(&out.guard) > 0.0) {
                continue;
            }
            found.push(Equilibrium {
                gap: at(&self.height),
                deflection: at(&self.tip),
                force: at(&self.force[r]),
                contact: self.contact[r],
                stable: regime.basis().eigenvalues.iter().all(|z| z.re < 0.0),
                branch: 0,
            });
        }
        found.sort_by(|a, b| b.gap.total_cmp(&a.gap));
        found
    }

    /// Returns the model with motions that end with an error once `cancel` is set.
    #[must_use]
    pub fn cancelled_by(mut self, cancel: &CancelFlag) -> Self {
        let system = Arc::unwrap_or_clone(self.system);
        self.system = Arc::new(system.cancelled_by(cancel.clone()));
        self.nonlinear = self
            .nonlinear
            .map(|nonlinear| Arc::new(Arc::unwrap_or_clone(nonlinear).cancelled_by(cancel)));
        self
    }

    /// Returns the model with motions that may continue for a moment after the work was cancelled.
    #[must_use]
    pub fn with_grace(&self) -> Self {
        let cancel = self.system.cancel().with_grace();
        self.clone().cancelled_by(&cancel)
    }

    /// Returns the length of the state: amplitudes, velocities and entries of the sample.
    pub fn dimension(&self) -> usize {
        self.system.dimension()
    }

    /// Returns the velocity of the tip displacement, Ẇ (the oscillator's ẋ), in model units.
    pub fn tip_rate(&self) -> Output {
        // The state holds the velocities, so that every regime says the same.
        let free = &self.system.regimes()[0];
        self.tip
            .rate(free.matrix(), free.forcing(), self.system.drive())
    }

    /// Returns the displacement of the tip at which it touches the surface: −(α2 sin Ωτ + α5) for
    /// the cantilever, which moves up from the sample, changed by the position of a surface that
    /// recovers; the position of the stop for an oscillator.
    pub fn surface(&self) -> Output {
        let towards = if self.beam.is_some() { -1.0 } else { 1.0 };
        self.tip.plus(towards, &self.gap)
    }

    /// Returns the drive period, in model units of time: the period of the stroboscopic map, after
    /// which every tone repeats.
    pub fn period(&self) -> f64 {
        self.system.drive().period()
    }

    /// Returns the angular frequency of the drive, in model units; with several tones, that of the
    /// first.
    pub fn frequency(&self) -> f64 {
        let drive = self.system.drive();
        let first = drive.frequencies().first().copied();
        first.unwrap_or(std::f64::consts::TAU / drive.period())
    }

    /// Returns the number of periods of the first tone in the drive period.
    pub fn repetition(&self) -> usize {
        let first = self.system.drive().harmonics().first().copied();
        first.unwrap_or(1) as usize
    }
}

/// The drive's tones: the first, and further ones if there are any, or those of a signal.
fn drive_of(case: &Cantilever) -> Result<Drive, FlowError> {
    if let Some(signal) = &case.signal {
        let tones = signal.tones.iter();
        let frequencies: Vec<f64> = tones.map(|(multiple, _)| multiple * case.omega).collect();
        return Drive::unlocked(case.period(), &frequencies);
    }
    match case.further_tones[..] {
        [] => Drive::single(case.omega),
        [ratio] if !ratio.repeats() => {
            Drive::unlocked(case.period(), &[case.omega, ratio.value() * case.omega])
        }
        ref further => {
            let repetition = case.repetition();
            let harmonic = |of: &FrequencyRatio| repetition / of.denominator() * of.numerator();
            let harmonics = further.iter().map(harmonic);
            let harmonics: Vec<u32> = std::iter::once(repetition).chain(harmonics).collect();
            Drive::new(case.period(), &harmonics)
        }
    }
}

/// Derivative of the map of a model with respect to a number of the case.
#[derive(Clone, Debug)]
pub struct Tangent(pub TangentKind);

/// Derivative of the map in the form of the engine that computes it.
#[derive(Clone, Debug)]
pub enum TangentKind {
    /// Of the exact flow: the derivative of its equations.
    PiecewiseLinear(SystemTangent),
    /// Of the flow under a nonlinear force.
    Nonlinear(Variation),
}

impl Tangent {
    /// Returns the zero derivative, of a model that does not change.
    pub fn zeros(model: &Model) -> Self {
        Self(match &model.nonlinear {
            None => TangentKind::PiecewiseLinear(SystemTangent::zeros(&model.system)),
            Some(_) => TangentKind::Nonlinear(Variation::none()),
        })
    }

    /// Computes the derivative along `slopes` of the cantilever's parameters and `law` of the force
    /// law's parameters.
    ///
    /// # Errors
    /// As [`Model::cantilever`].
    pub fn along(
        case: &Cantilever,
        model: &Model,
        slopes: &[(Parameter, f64)],
        law: &[f64],
    ) -> Result<Self, ModelError> {
        if let Some(nonlinear) = &model.nonlinear {
            let variation = Variation::along(case, model, nonlinear, slopes, law)?;
            return Ok(Self(TangentKind::Nonlinear(variation)));
        }
        let mut sum = SystemTangent::zeros(&model.system);
        for &(parameter, slope) in slopes {
            sum.add(slope, &cantilever_tangent(case, model, parameter)?);
        }
        Ok(Self(TangentKind::PiecewiseLinear(sum)))
    }
}

impl From<SystemTangent> for Tangent {
    fn from(tangent: SystemTangent) -> Self {
        Self(TangentKind::PiecewiseLinear(tangent))
    }
}

/// The derivative of the cantilever's piecewise-linear system with respect to one parameter.
///
/// # Errors
/// As [`Model::cantilever`].
pub fn cantilever_tangent(
    case: &Cantilever,
    model: &Model,
    parameter: Parameter,
) -> Result<SystemTangent, ModelError> {
    let galerkin = model.equations_of(case)?;
    let mut tangent = SystemTangent::zeros(&model.system);
    if parameter == Parameter::Omega {
        tangent.log_period = -1.0 / case.omega;
    }
    let law = model.law_of(case, Some(parameter));
    let beam = Beam::new(&galerkin, model.system.drive(), law.internal)?;
    let change = beam.derivative(parameter);
    let responses = [&law.flight, &law.contact];
    for (regime, response) in tangent.regimes.iter_mut().zip(responses) {
        *regime = change.regime(&beam, response);
    }
    if model.nonlinear.is_some() {
        return Ok(tangent);
    }
    let guards = [&law.gap, &law.release_guard].into_iter();
    tangent.guards = guards
        .map(|guard| vec![change.combined(&beam, guard)])
        .collect();
    if let Some(values) = &law.release_reset {
        let changes = values.iter().map(|value| change.combined(&beam, value));
        tangent.resets[1][0] = Some(beam.memory_jump(changes, 0.0));
    }
    Ok(tangent)
}

/// The derivative of the cantilever's model with respect to one parameter.
///
/// # Errors
/// As [`Model::cantilever`].
pub fn cantilever_model_tangent(
    case: &Cantilever,
    model: &Model,
    parameter: Parameter,
) -> Result<ModelTangent, ModelError> {
    let galerkin = model.equations_of(case)?;
    let law = model.law_of(case, Some(parameter));
    let beam = Beam::new(&galerkin, model.system.drive(), law.internal)?;
    let change = beam.derivative(parameter);
    Ok(ModelTangent {
        system: cantilever_tangent(case, model, parameter)?,
        base: change.base(&beam),
        force: [&law.flight, &law.contact]
            .iter()
            .take(model.force.len())
            .map(|response| change.combined(&beam, &response.force))
            .collect(),
        beam_power: change.beam_power(&beam, parameter),
        height: change.into_height(),
        tone_phases: Parameter::TONES
            .iter()
            .take(case.further_tones.len())
            .map(|[_, phase]| f64::from(u8::from(parameter == *phase)).to_radians())
            .collect(),
        rigid_stop: RigidStop::default(),
    })
}

impl From<ModelError> for nanotap_error::Error {
    fn from(error: ModelError) -> Self {
        match error {
            ModelError::Cantilever(error) => error.into(),
            ModelError::Oscillator(_) | ModelError::Flow(FlowError::Resonance { .. }) => {
                Self::input(error.to_string(), "change it in the case")
            }
            ModelError::Nonlinear(error) => Self::input(
                error.to_string(),
                "change the law of the sample in the case",
            ),
            ModelError::Flow(error) => error.into(),
        }
    }
}

#[cfg(test)]
mod tests;

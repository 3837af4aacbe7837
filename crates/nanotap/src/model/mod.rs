//! The model of a case as a piecewise-linear system with the outputs that someone
//! wants to see.
//!
//! State: `(a_1 … a_N, ȧ_1 … ȧ_N)` for the cantilever, after which comes the memory of a
//! sample that recovers (see [`contact`]), zero at rest; `(x, ẋ)` for an
//! oscillator. Regime 0 is free flight. Everything that analyses or shows a motion works on a
//! [`Model`] and asks no more where it came from.
//!
//! A sample with a [nonlinear] force law is no regime: such a model has free flight
//! alone as a linear system, and the flow under the force in addition.

pub mod beam;
mod beam_equations;
pub mod cantilever;
pub mod contact;
pub mod drive_form;
pub mod enclosed;
pub mod exact_beam;
pub mod galerkin;
mod grazed;
pub mod higher_modes;
mod measured_modes;
pub mod model_map;
mod motion_error;
pub mod nonlinear;
pub mod oscillator;
pub mod parameter;
pub mod recording;
pub mod sample_law;
pub mod spectrum;
mod tangent;

use std::sync::{Arc, OnceLock};

pub use motion_error::MotionError;
use nanotap_arithmetic::CancelFlag;
use nanotap_flow::sensitivity::SystemTangent;
use nanotap_flow::{Drive, Output, System};
pub use nanotap_flow::{FlowError, vector_instructions};
pub use tangent::ModelTangent;

use crate::model::beam::Modes;
use crate::model::beam_equations::Beam;
use crate::model::cantilever::{Cantilever, CantileverError};
use crate::model::galerkin::{Galerkin, Regime};
use crate::model::nonlinear::{Equilibrium, Nonlinear, Variation};
use crate::model::parameter::Parameter;
use crate::model::sample_law::SampleLaw;

/// Why a cantilever or an oscillator has no model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// A number of the cantilever makes no sense.
    #[error(transparent)]
    Cantilever(#[from] CantileverError),
    /// The oscillator makes no sense.
    #[error(transparent)]
    Oscillator(#[from] crate::model::oscillator::OscillatorError),
    /// Its equations cannot be solved in closed form.
    #[error(transparent)]
    Flow(#[from] FlowError),
    /// Its force law makes no sense, or its modes cannot be had.
    #[error(transparent)]
    Nonlinear(#[from] nanotap_volterra::VolterraError),
}

/// A piecewise-linear system with names for what it shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// The system.
    pub system: Arc<System>,
    /// Which regimes are contact.
    pub contact: Vec<bool>,
    /// Tip displacement relative to the base, W (the oscillator's x).
    pub tip: Output,
    /// Height of the tip over the free surface of the sample, positive in flight, negative
    /// in contact: V_T, less the position of a surface that recovers.
    pub gap: Output,
    /// Height V_T of the tip over the undeformed surface; minus the indentation in contact.
    pub height: Output,
    /// Force of the sample on the tip, positive when it pushes the tip away; an entry
    /// a regime.
    pub force: Vec<Output>,
    /// What feeds and drains energy: see [`Model::power`].
    pub(crate) power: PowersOnDemand,
    /// The rigid stop, if there is one.
    pub rigid_stop: Option<RigidStop>,
    /// The beam's modes, if it is a beam.
    pub beam: Option<BeamOutputs>,
    /// How many numbers at the end of the state are the sample's.
    pub memory: usize,
    /// Phase of a second tone in rad.
    pub second_phase: f64,
    /// What a sample's memory that is overwritten at the end of each contact does to
    /// volumes of states.
    pub forgetting: Option<Forgetting>,
    /// The flow under a nonlinear force law; the system is then free flight alone.
    pub nonlinear: Option<Arc<Nonlinear>>,
    /// State at drive phase 0 from which a motion starts when no other is given; `None`: rest.
    pub start: Option<Vec<f64>>,
}

/// A rigid stop on which the tip bounces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RigidStop {
    /// The mass m that bounces.
    pub mass: f64,
    /// The coefficient of restitution r.
    pub restitution: f64,
    /// Tip displacement at the stop.
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

/// A memory `s` that is set anew when contact ends, fades in flight at a rate, and acts on
/// the beam when it is met again.
#[derive(Clone, Debug, PartialEq)]
pub struct Forgetting {
    /// Its rate in flight, ≤ 0.
    pub rate: f64,
    /// How much the state changes per change of `s` where contact begins.
    pub kick: nalgebra::DVector<f64>,
}

/// What feeds and drains energy in one regime, as sums of `weight · a · b` over pairs
/// of outputs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Powers {
    /// Power that the drive delivers.
    pub drive: Vec<Product>,
    /// Power that the beam's own damping takes.
    pub beam: Vec<Product>,
    /// Power that the sample's damping takes.
    pub sample: Vec<Product>,
    /// Kinetic and elastic energy stored (an energy, not a power).
    pub stored: Vec<Product>,
}

/// [`Powers`] of every regime, computed when first used: of the thousands of models
/// that a sweep sets up, few ever are.
#[derive(Clone, Debug)]
pub(crate) struct PowersOnDemand {
    known: OnceLock<Vec<Powers>>,
    /// What they follow from, where they are not known from the start.
    equations: Option<Arc<Galerkin>>,
}

impl PowersOnDemand {
    /// Of these equations.
    pub(crate) fn of(equations: Galerkin) -> Self {
        Self {
            known: OnceLock::new(),
            equations: Some(Arc::new(equations)),
        }
    }
}

impl From<Vec<Powers>> for PowersOnDemand {
    fn from(known: Vec<Powers>) -> Self {
        Self {
            known: known.into(),
            equations: None,
        }
    }
}

impl PartialEq for PowersOnDemand {
    /// Whether they are the same, worked out or not.
    fn eq(&self, other: &Self) -> bool {
        self.equations == other.equations && (self.equations.is_some() || self.known == other.known)
    }
}

/// `weight · a · b`.
#[derive(Clone, Debug, PartialEq)]
pub struct Product {
    /// The weight.
    pub weight: f64,
    /// One factor.
    pub a: Output,
    /// The other.
    pub b: Output,
}

/// What only a beam has.
#[derive(Clone, Debug, PartialEq)]
pub struct BeamOutputs {
    /// Its modes.
    pub modes: Arc<Modes>,
    /// Slope ∂W/∂ξ at the tip: what an optical lever reads.
    pub slope: Output,
    /// Displacement of the base: α2 sin Ωτ and what a second tone adds, 0 if the drive acts
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
    /// The state at rest: at deflection 0, or on a rigid stop that stands before it.
    pub fn rest(&self) -> Vec<f64> {
        let mut state = vec![0.0; self.dimension()];
        self.stop_at_wall(&mut state);
        state
    }

    /// Puts a state that lies behind a rigid stop on it.
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
        if let Some(law) = &case.law {
            return Self::under(law, galerkin, &drive);
        }
        let law = case.contact_law(None);
        let beam = Beam::new(&galerkin, &drive, law.has_memory)?;
        let regimes = vec![
            beam.regime(Regime::Free, &law.flight, true)?,
            beam.regime(Regime::Contact, &law.contact, law.plain_contact)?,
        ];
        let system = Arc::new(System::new(drive.clone(), regimes, beam.transitions(&law))?);
        let outputs = beam.outputs(&law);
        Ok(Self {
            contact: vec![false, true],
            tip: outputs.tip,
            gap: outputs.gap,
            height: outputs.height,
            force: outputs.force,
            power: PowersOnDemand::of(galerkin),
            rigid_stop: None,
            beam: Some(outputs.beam),
            memory: usize::from(law.has_memory),
            forgetting: outputs.forgetting,
            second_phase: case.tone2_phase.to_radians(),
            nonlinear: None,
            start: None,
            system,
        })
    }

    /// The beam under a nonlinear force law.
    fn under(law: &SampleLaw, galerkin: Galerkin, drive: &Drive) -> Result<Self, ModelError> {
        let free = |beam: &Beam<'_>, memory| {
            let flight = contact::no_sample(memory).flight;
            beam.regime(Regime::Free, &flight, true)
        };
        let bare = Beam::new(&galerkin, drive, false)?;
        let nonlinear = Nonlinear::new(law, &bare, &free(&bare, false)?, drive)?;
        let memory = nonlinear.remembers;
        let beam = Beam::new(&galerkin, drive, memory)?;
        let regime = free(&beam, memory)?;
        let outputs = beam.outputs(&contact::no_sample(memory));
        let system = System::new(drive.clone(), vec![regime], vec![Vec::new()])?;
        let second_phase = galerkin.case.tone2_phase.to_radians();
        Ok(Self {
            contact: vec![false],
            tip: outputs.tip,
            gap: outputs.height.clone(),
            force: vec![outputs.height.scaled(0.0)],
            height: outputs.height,
            beam: Some(outputs.beam),
            power: PowersOnDemand::of(galerkin),
            rigid_stop: None,
            memory: usize::from(memory),
            forgetting: None,
            second_phase,
            nonlinear: Some(Arc::new(nonlinear)),
            start: None,
            system: Arc::new(system),
        })
    }

    /// The equations of the cantilever that this is the model of.
    fn equations_of(&self, case: &Cantilever) -> Result<Arc<Galerkin>, ModelError> {
        match &self.power.equations {
            Some(known) => Ok(Arc::clone(known)),
            None => Ok(Arc::new(Galerkin::new(case)?)),
        }
    }

    /// What feeds and drains energy; an entry a regime.
    pub fn power(&self) -> &[Powers] {
        self.power.known.get_or_init(|| {
            let Some(galerkin) = &self.power.equations else {
                return Vec::new();
            };
            let drive = self.system.drive();
            if self.nonlinear.is_some() {
                let flight = contact::no_sample(self.memory > 0).flight;
                let free = &self.system.regimes()[0];
                return Beam::new(galerkin, drive, self.memory > 0)
                    .map(|beam| vec![beam.powers_in(free, &flight)])
                    .unwrap_or_default();
            }
            let law = galerkin.case.contact_law(None);
            Beam::new(galerkin, drive, law.has_memory)
                .map(|beam| beam.powers(&law, &self.system))
                .unwrap_or_default()
        })
    }

    /// Where the undriven system can rest, the tip farthest away first: of a piecewise-linear one
    /// at the constant part of each regime's response, where no guard of that regime is passed.
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

    /// The same model, whose motions end with an error once `cancel` is set.
    #[must_use]
    pub fn cancelled_by(mut self, cancel: &CancelFlag) -> Self {
        let system = Arc::unwrap_or_clone(self.system);
        self.system = Arc::new(system.cancelled_by(cancel.clone()));
        self.nonlinear = self
            .nonlinear
            .map(|nonlinear| Arc::new(Arc::unwrap_or_clone(nonlinear).cancelled_by(cancel)));
        self
    }

    /// The same model, whose motions may go on for a moment after the work was cancelled.
    #[must_use]
    pub(crate) fn with_grace(&self) -> Self {
        let cancel = self.system.cancel().with_grace();
        self.clone().cancelled_by(&cancel)
    }

    /// Dimension of the state.
    pub fn dimension(&self) -> usize {
        self.system.dimension()
    }

    /// Speed of the tip displacement, Ẇ (the oscillator's ẋ).
    pub fn tip_rate(&self) -> Output {
        // The state holds the velocities, so that every regime says the same.
        let free = &self.system.regimes()[0];
        self.tip
            .rate(free.matrix(), free.forcing(), self.system.drive())
    }

    /// Displacement of the tip at which it touches: −(α2 sin Ωτ + α5) for the cantilever,
    /// which moves up from the sample, more or less where a surface recovers; where the stop
    /// stands for an oscillator.
    pub fn surface(&self) -> Output {
        let towards = if self.beam.is_some() { -1.0 } else { 1.0 };
        self.tip.plus(towards, &self.gap)
    }

    /// The drive period: that of the stroboscopic map, after which every tone repeats.
    pub fn period(&self) -> f64 {
        self.system.drive().period()
    }

    /// Angular frequency of the drive, of several tones the first.
    pub fn frequency(&self) -> f64 {
        let drive = self.system.drive();
        let first = drive.frequencies().first().copied();
        first.unwrap_or(std::f64::consts::TAU / drive.period())
    }

    /// How many periods of the first tone the drive period has.
    pub fn repetition(&self) -> usize {
        let first = self.system.drive().harmonics().first().copied();
        first.unwrap_or(1) as usize
    }
}

/// The drive's tones: the first, and the second if there is one.
fn drive_of(case: &Cantilever) -> Result<Drive, FlowError> {
    match case.tone2_ratio {
        None => Drive::single(case.omega),
        Some(ratio) => Drive::new(case.period(), &[ratio.denominator(), ratio.numerator()]),
    }
}

/// How the map of a model changes with a number.
#[derive(Clone, Debug)]
pub struct Tangent(pub(crate) TangentKind);

/// The engines' own terms.
#[derive(Clone, Debug)]
pub(crate) enum TangentKind {
    PiecewiseLinear(SystemTangent),
    Nonlinear(Variation),
}

impl Tangent {
    /// Of a model that does not change.
    pub(crate) fn zeros(model: &Model) -> Self {
        Self(match &model.nonlinear {
            None => TangentKind::PiecewiseLinear(SystemTangent::zeros(&model.system)),
            Some(_) => TangentKind::Nonlinear(Variation::none()),
        })
    }

    /// Along `slopes` of a cantilever's numbers and `law` of its force law's parameters.
    ///
    /// # Errors
    /// As [`Model::cantilever`].
    pub(crate) fn along(
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
    if model.nonlinear.is_some() {
        // Free flight alone.
        let memory = model.memory > 0;
        let beam = Beam::new(&galerkin, model.system.drive(), memory)?;
        let change = beam.derivative(parameter);
        tangent.regimes[0] = change.regime(&beam, &contact::no_sample(memory).flight);
        return Ok(tangent);
    }
    let law = case.contact_law(Some(parameter));
    let beam = Beam::new(&galerkin, model.system.drive(), law.has_memory)?;
    let change = beam.derivative(parameter);
    for (r, answer) in [&law.flight, &law.contact].into_iter().enumerate() {
        tangent.regimes[r] = change.regime(&beam, answer);
    }
    tangent.guards = vec![
        vec![change.combined(&beam, &law.gap)],
        vec![change.combined(&beam, &law.hold)],
    ];
    if let Some(left) = &law.left {
        let change = change.combined(&beam, left);
        tangent.resets[1][0] = Some(beam.memory_jump(&change, 0.0));
    }
    Ok(tangent)
}

/// The derivative of the cantilever's model with respect to one parameter.
///
/// # Errors
/// As [`Model::cantilever`].
pub(crate) fn cantilever_model_tangent(
    case: &Cantilever,
    model: &Model,
    parameter: Parameter,
) -> Result<ModelTangent, ModelError> {
    let galerkin = model.equations_of(case)?;
    let law = if model.nonlinear.is_some() {
        contact::no_sample(model.memory > 0)
    } else {
        case.contact_law(Some(parameter))
    };
    let beam = Beam::new(&galerkin, model.system.drive(), law.has_memory)?;
    let change = beam.derivative(parameter);
    let second_phase = f64::from(u8::from(parameter == Parameter::Tone2Phase));
    Ok(ModelTangent {
        system: cantilever_tangent(case, model, parameter)?,
        base: change.base(&beam),
        force: [&law.flight, &law.contact]
            .iter()
            .take(model.force.len())
            .map(|answer| change.combined(&beam, &answer.force))
            .collect(),
        beam_power: change.beam_power(&beam, parameter),
        height: change.into_height(),
        second_phase: second_phase.to_radians(),
        rigid_stop: RigidStop::default(),
    })
}

impl From<ModelError> for crate::Error {
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

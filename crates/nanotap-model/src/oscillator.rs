//! One-degree-of-freedom oscillators with a stop, the paper's Fig. 1:
//! `m ẍ + c ẋ + k x = F cos ωt` with a stop at `x = gap`, either a further spring and
//! damper (vibro-impact oscillator, Fig. 1a) or a rigid wall with a coefficient of
//! restitution (impact oscillator, Fig. 1b), chatter and sticking included.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, RowDVector};
use nanotap_flow::sensitivity::{RegimeTangent, SystemTangent};
use nanotap_flow::{Drive, HarmonicVector, Output, Reset, Sticking, System, Transition};
use serde::Serialize;

use crate::contact::dual::Dual;
use crate::release::Release;
use crate::{Model, ModelError, ModelTangent, Powers, Product, RigidStop};
use nanotap_quantity::number::shortest;

/// Stop of an oscillator: soft or rigid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Stop {
    /// A spring and a damper that act while `x ≥ gap`.
    Soft {
        /// Stiffness of the stop's spring, ≥ 0, force per length.
        stiffness: f64,
        /// Damping of the stop's damper, ≥ 0, force per velocity.
        damping: f64,
    },
    /// A rigid wall: the velocity is reversed and multiplied by the coefficient of
    /// restitution, 0 … 1.
    Rigid {
        /// Coefficient of restitution, dimensionless, 0 to 1.
        restitution: f64,
    },
}

/// An oscillator `m ẍ + c ẋ + k x = F cos ωt` with a stop. The numbers are in any one consistent
/// system of units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Oscillator {
    /// Mass m > 0 of the oscillator.
    pub mass: f64,
    /// Stiffness k ≥ 0 of the spring, force per length.
    pub stiffness: f64,
    /// Damping c ≥ 0 of the damper, force per velocity.
    pub damping: f64,
    /// Amplitude F of the drive, a force of either sign.
    pub forcing: f64,
    /// Angular frequency ω > 0 of the drive, rad per unit of time.
    pub omega: f64,
    /// Displacement x at which the stop is, a length of either sign.
    pub gap: f64,
    /// Kind of the stop, with its numbers.
    pub stop: Stop,
}

/// An invalid parameter of an oscillator.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{key} = {}: {expected}", shortest(*value))]
pub struct OscillatorError {
    /// Key of the parameter in a case file.
    pub key: &'static str,
    /// Refused value, in the unit in which it was given.
    pub value: f64,
    /// What is needed instead, as a phrase of the message.
    pub expected: &'static str,
}

/// Largest magnitude of a parameter; beyond it products of parameters lose all digits.
const LARGEST: f64 = 1e12;
/// Range of a positive parameter.
const POSITIVE: (f64, f64) = (f64::MIN_POSITIVE, LARGEST);
/// Range of a parameter that may be zero.
const NOT_NEGATIVE: (f64, f64) = (0.0, LARGEST);
/// Range of a parameter of either sign.
const FINITE: (f64, f64) = (-LARGEST, LARGEST);

/// The table of parameters: name in case files and range.
macro_rules! parameters {
    ($($(#[$doc:meta])* $parameter:ident: $name:literal, $range:expr;)*) => {
        /// A parameter of an oscillator.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum OscillatorParameter { $($(#[$doc])* $parameter),* }

        impl OscillatorParameter {
            /// All parameters, in the order of the table.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$parameter),*];

            /// Returns the key in a case file.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$parameter => $name),* }
            }

            /// Returns the least and the greatest value that is allowed.
            pub const fn range(self) -> (f64, f64) {
                match self { $(Self::$parameter => $range),* }
            }
        }
    };
}

parameters! {
    /// Mass m of the oscillator.
    Mass: "mass", POSITIVE;
    /// Stiffness k of the spring.
    Stiffness: "stiffness", NOT_NEGATIVE;
    /// Damping c of the damper.
    Damping: "damping", NOT_NEGATIVE;
    /// Amplitude F of the driving force.
    Forcing: "forcing", FINITE;
    /// Angular frequency ω of the drive.
    Omega: "omega", POSITIVE;
    /// Displacement x at which the stop is.
    Gap: "gap", FINITE;
    /// Stiffness of the spring of a soft stop.
    ContactStiffness: "contact_stiffness", NOT_NEGATIVE;
    /// Damping of the damper of a soft stop.
    ContactDamping: "contact_damping", NOT_NEGATIVE;
    /// Coefficient of restitution of a rigid stop.
    Restitution: "restitution", (0.0, 1.0);
}

impl Oscillator {
    /// Returns the place where a parameter is stored; `None` if this stop does not have it.
    fn place(&mut self, parameter: OscillatorParameter) -> Option<&mut f64> {
        use OscillatorParameter as P;
        match (parameter, &mut self.stop) {
            (P::Mass, _) => Some(&mut self.mass),
            (P::Stiffness, _) => Some(&mut self.stiffness),
            (P::Damping, _) => Some(&mut self.damping),
            (P::Forcing, _) => Some(&mut self.forcing),
            (P::Omega, _) => Some(&mut self.omega),
            (P::Gap, _) => Some(&mut self.gap),
            (P::ContactStiffness, Stop::Soft { stiffness, .. }) => Some(stiffness),
            (P::ContactDamping, Stop::Soft { damping, .. }) => Some(damping),
            (P::Restitution, Stop::Rigid { restitution }) => Some(restitution),
            _ => None,
        }
    }

    /// Returns the value of a parameter; `None` if this stop does not have it.
    pub fn get(&self, parameter: OscillatorParameter) -> Option<f64> {
        let mut copy = *self;
        copy.place(parameter).map(|value| *value)
    }

    /// Returns the oscillator with one parameter changed, or unchanged if this stop does not have
    /// it.
    #[must_use]
    pub fn with(mut self, parameter: OscillatorParameter, value: f64) -> Self {
        if let Some(place) = self.place(parameter) {
            *place = value;
        }
        self
    }

    /// The numbers of the equations in a regime, outside the stop or in it: spring, damper, drive
    /// and constant force over the mass, with their derivatives by a parameter.
    fn coefficients(&self, inside: bool, parameter: Option<OscillatorParameter>) -> [Dual; 4] {
        use OscillatorParameter as P;
        let dual = |p: P| {
            let by = f64::from(u8::from(Some(p) == parameter));
            self.get(p)
                .map_or(Dual::default(), |value| Dual::new(value, by))
        };
        let of_stop = |p: P| if inside { dual(p) } else { Dual::default() };
        let stop = of_stop(P::ContactStiffness);
        let stiffness = dual(P::Stiffness) + stop;
        let damping = dual(P::Damping) + of_stop(P::ContactDamping);
        [stiffness, damping, dual(P::Forcing), stop * dual(P::Gap)].map(|of| of / dual(P::Mass))
    }

    /// Checks every field.
    ///
    /// # Errors
    /// [`OscillatorError`] for the first invalid one.
    pub fn validate(&self) -> Result<(), OscillatorError> {
        use OscillatorParameter as P;
        for parameter in P::ALL {
            let Some(value) = self.get(parameter) else {
                continue;
            };
            let (least, greatest) = parameter.range();
            if !(least..=greatest).contains(&value) {
                let expected = match parameter {
                    P::Mass | P::Omega => "a positive, finite number of at most 1e12 is needed",
                    P::Restitution => "a number from 0 to 1 is needed",
                    P::Forcing | P::Gap => "a finite number from -1e12 to 1e12 is needed",
                    _ => "a finite number of at least 0 and at most 1e12 is needed",
                };
                return Err(OscillatorError {
                    key: parameter.name(),
                    value,
                    expected,
                });
            }
        }
        Ok(())
    }

    /// Builds the model: tip is `x`, gap is `gap − x`.
    ///
    /// # Errors
    /// When a parameter is invalid or an undamped regime is driven at resonance.
    pub fn model(&self) -> Result<Model, ModelError> {
        self.validate()?;
        let drive = Drive::single(self.omega)?;
        let free = self.regime(0, &drive)?;
        let gap = self.gap_output();
        let (regimes, transitions) = match self.stop {
            Stop::Soft { .. } => {
                let contact = self.regime(1, &drive)?;
                let transitions = vec![
                    vec![Transition::new(gap.clone(), 1)],
                    vec![Transition::new(gap.scaled(-1.0), 0)],
                ];
                (vec![free, contact], transitions)
            }
            Stop::Rigid { restitution } => Self::rigid(restitution, free, &gap, &drive)?,
        };
        let system = Arc::new(System::new(drive, regimes, transitions)?);
        Ok(self.outputs(system, gap))
    }

    fn regime(&self, index: usize, drive: &Drive) -> Result<nanotap_flow::Regime, ModelError> {
        let numbers = self.coefficients(index == 1, None).map(|of| of.value);
        let equations = equations(1.0, numbers);
        let regime = nanotap_flow::Regime::new(index, equations.matrix, equations.forcing, drive);
        Ok(regime?)
    }

    /// Flight with impacts, and sticking, in which the wall carries the spring and the
    /// drive until they would pull the mass away.
    fn rigid(
        restitution: f64,
        free: nanotap_flow::Regime,
        gap: &Output,
        drive: &Drive,
    ) -> Result<(Vec<nanotap_flow::Regime>, Vec<Vec<Transition>>), ModelError> {
        let bounce = |r: f64| Reset {
            matrix: DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, -r]),
            offset: HarmonicVector::zeros(2, 1),
        };
        // The gap's acceleration in flight is minus the pressing force over the mass.
        let acceleration = gap.rate(free.matrix(), free.forcing(), drive).rate(
            free.matrix(),
            free.forcing(),
            drive,
        );
        let still =
            nanotap_flow::Regime::new(1, DMatrix::zeros(2, 2), HarmonicVector::zeros(2, 1), drive)?;
        let impact = Transition::new(gap.clone(), 0)
            .with_reset(bounce(restitution))
            .with_sticking(Sticking {
                regime: 1,
                reset: bounce(0.0),
            });
        let release = Transition::new(acceleration.scaled(-1.0), 0).as_release();
        Ok((vec![free, still], vec![vec![impact], vec![release]]))
    }

    fn gap_output(&self) -> Output {
        Output::linear(RowDVector::from_row_slice(&[-1.0, 0.0]), 1).with_constant(self.gap)
    }

    fn outputs(&self, system: Arc<System>, gap: Output) -> Model {
        let speed = Output::linear(RowDVector::from_row_slice(&[0.0, 1.0]), 1);
        let tip = Output::linear(RowDVector::from_row_slice(&[1.0, 0.0]), 1);
        let drive = Output::linear(RowDVector::zeros(2), 1).with_tone(0, 0.0, self.forcing);
        let zero = gap.scaled(0.0);
        // The soft stop pushes with its spring and damper, the wall with whatever keeps
        // the mass still, and with the impulses of impacts, which are counted apart.
        let force = match self.stop {
            Stop::Soft { stiffness, damping } => gap.scaled(-stiffness).plus(damping, &speed),
            Stop::Rigid { .. } => drive.plus(-self.stiffness, &tip),
        };
        let product = |weight, a: &Output, b: &Output| Product {
            weight,
            a: a.clone(),
            b: b.clone(),
        };
        let power = |contact_stiffness: f64, contact_damping: f64| Powers {
            drive: vec![product(1.0, &drive, &speed)],
            beam: vec![product(self.damping, &speed, &speed)],
            sample: vec![product(contact_damping, &speed, &speed)],
            stored: vec![
                product(0.5 * self.mass, &speed, &speed),
                product(0.5 * self.stiffness, &tip, &tip),
            ],
            stored_by_sample: vec![product(0.5 * contact_stiffness, &gap, &gap)],
        };
        let (contact_stiffness, contact_damping, rigid_stop) = match self.stop {
            Stop::Soft { stiffness, damping } => (stiffness, damping, None),
            Stop::Rigid { restitution } => {
                let stop = RigidStop {
                    mass: self.mass,
                    restitution,
                    tip: self.gap,
                };
                (0.0, 0.0, Some(stop))
            }
        };
        Model {
            contact: vec![false, true],
            tip: tip.clone(),
            force: vec![zero, force],
            power: vec![power(0.0, 0.0), power(contact_stiffness, contact_damping)].into(),
            rigid_stop,
            release: Release::new(self),
            beam: None,
            memory: 0,
            memory_reset: None,
            nonlinear: None,
            start: None,
            tone_phases: Vec::new(),
            height: gap.clone(),
            gap,
            system,
        }
    }

    /// The derivative of the model's system with respect to one parameter, zero where
    /// this stop does not have it.
    ///
    /// # Errors
    /// As [`Oscillator::model`].
    pub fn tangent(
        &self,
        model: &Model,
        parameter: OscillatorParameter,
    ) -> Result<SystemTangent, ModelError> {
        use OscillatorParameter as P;
        let mut tangent = SystemTangent::zeros(&model.system);
        let moving = match self.stop {
            Stop::Soft { .. } => 2,
            Stop::Rigid { .. } => 1,
        };
        for (r, regime) in tangent.regimes.iter_mut().enumerate().take(moving) {
            let numbers = self.coefficients(r == 1, Some(parameter));
            *regime = equations(0.0, numbers.map(Dual::derivative));
        }
        match (parameter, self.stop) {
            (P::Omega, _) => tangent.log_period = -1.0 / self.omega,
            (P::Gap, Stop::Soft { .. }) => {
                tangent.guards[0][0].constant = 1.0;
                tangent.guards[1][0].constant = -1.0;
            }
            (P::Gap, Stop::Rigid { .. }) => tangent.guards[0][0].constant = 1.0,
            (P::Restitution, Stop::Rigid { .. }) => {
                tangent.resets[0][0] = Some(Reset {
                    matrix: DMatrix::from_row_slice(2, 2, &[0.0, 0.0, 0.0, -1.0]),
                    offset: HarmonicVector::zeros(2, 1),
                });
            }
            _ => {}
        }
        if moving == 1 {
            // The release guard −g̈ = (F cos ωt − k x − c ẋ)/m moves with the parameters.
            let numbers = self.coefficients(false, Some(parameter));
            let [k, c, force, _] = numbers.map(Dual::derivative);
            tangent.guards[1][0] =
                Output::linear(RowDVector::from_row_slice(&[-k, -c]), 1).with_tone(0, 0.0, force);
        }
        Ok(tangent)
    }

    /// The derivative of the model with respect to one parameter.
    ///
    /// # Errors
    /// As [`Oscillator::model`].
    pub fn model_tangent(
        &self,
        model: &Model,
        parameter: OscillatorParameter,
    ) -> Result<ModelTangent, ModelError> {
        use OscillatorParameter as P;
        let is = |p: P| f64::from(u8::from(p == parameter));
        let mut tangent = ModelTangent::zeros(model);
        tangent.system = self.tangent(model, parameter)?;
        let zero = model.tip.scaled(0.0);
        tangent.height = zero.clone().with_constant(is(P::Gap));
        let speed = Output::linear(RowDVector::from_row_slice(&[0.0, 1.0]), 1);
        tangent.force[1] = match self.stop {
            Stop::Soft { stiffness, .. } => model
                .gap
                .scaled(-is(P::ContactStiffness))
                .plus(is(P::ContactDamping), &speed)
                .plus(-stiffness, &tangent.height),
            Stop::Rigid { .. } => zero
                .clone()
                .with_tone(0, 0.0, is(P::Forcing))
                .plus(-is(P::Stiffness), &model.tip),
        };
        tangent.beam_power = vec![[speed.scaled(is(P::Damping)), zero]];
        if let Stop::Rigid { .. } = self.stop {
            tangent.rigid_stop = RigidStop {
                mass: is(P::Mass),
                restitution: is(P::Restitution),
                tip: is(P::Gap),
            };
        }
        Ok(tangent)
    }
}

/// `[[0, velocity], [−k, −c]]` and the forcing of (k, c, F, constant force), each over the mass.
fn equations(velocity: f64, [k, c, drive, constant]: [f64; 4]) -> RegimeTangent {
    let lower = |v: f64| DVector::from_vec(vec![0.0, v]);
    RegimeTangent {
        matrix: DMatrix::from_row_slice(2, 2, &[0.0, velocity, -k, -c]),
        forcing: HarmonicVector::zeros(2, 1)
            .with_tone(0, &DVector::zeros(2), &lower(drive))
            .with_constant(&lower(constant)),
    }
}

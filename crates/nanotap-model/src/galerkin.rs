//! The Galerkin equations of motion, Eqs. (10)–(18), and their derivatives with
//! respect to every parameter.
//!
//! In either regime M Ẍ + C Ẋ + K X = s sin Ωτ + c cos Ωτ + k, and the gap between
//! tip and sample is V_T = p·X + α2 sin Ωτ + α5, Eq. (8); with further tones, or a drive
//! that acts on the lever itself, as [`drive_form`](crate::drive_form) says.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::beam::Modes;
use crate::cantilever::{Cantilever, CantileverError, CosineTerm, Reason};
use crate::contact::dual::Dual;
use crate::drive_form::{Actuation, FrequencyRatio};
use crate::measured_modes::Correction;
use crate::parameter::Parameter;
use crate::spectrum::dense_eigenvalues;
use nanotap_arithmetic::Scalar as _;
use nanotap_flow::Complex;

/// Rounding error of an eigenvalue, as a part of the square of the largest: the stiffness has entries of
/// this size.
const ROUNDING: f64 = 1e-14;

/// The two linear regimes of the tip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Regime {
    /// Free flight, V_T > 0.
    Free,
    /// Contact of tip and sample, V_T ≤ 0.
    Contact,
}

impl Regime {
    /// Both regimes, in the order of the arrays in this module.
    pub const ALL: [Self; 2] = [Self::Free, Self::Contact];

    /// Returns the index of the regime in the arrays of this module.
    pub const fn index(self) -> usize {
        match self {
            Self::Free => 0,
            Self::Contact => 1,
        }
    }
}

/// A generalised force s sin Ωτ + c cos Ωτ + k, each of length N.
#[derive(Clone, Debug, PartialEq)]
pub struct Forcing {
    /// s, the coefficients of sin Ωτ.
    pub sine: DVector<f64>,
    /// c, the coefficients of cos Ωτ.
    pub cosine: DVector<f64>,
    /// k, the part constant in time.
    pub constant: DVector<f64>,
    /// Sine and cosine coefficients at the frequencies of further tones.
    pub further: Vec<[DVector<f64>; 2]>,
}

/// The gap V_T = p·X + sine · sin Ωτ + constant, Eq. (8), or a derivative of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Gap {
    /// The row p in front of X.
    pub tip: DVector<f64>,
    /// Coefficient of sin Ωτ, in units of g₀.
    pub sine: f64,
    /// Coefficient of cos Ωτ, in units of g₀: 0 but under a signal.
    pub cosine: f64,
    /// Part constant in time, in units of g₀.
    pub constant: f64,
    /// Sine and cosine coefficients at the frequencies of further tones.
    pub further: Vec<[f64; 2]>,
}

/// The equations of motion of one case. Arrays are indexed by [`Regime::index`].
#[derive(Clone, Debug, PartialEq)]
pub struct Galerkin {
    /// The dimensionless case of these equations.
    pub case: Cantilever,
    /// Modes of the bare beam, N of them.
    pub modes: Arc<Modes>,
    /// M, N×N, the same in both regimes: Eqs. (11), (15).
    pub mass: DMatrix<f64>,
    /// C, N×N: Eqs. (12), (16).
    pub damping: [DMatrix<f64>; 2],
    /// K, N×N: Eqs. (13), (17).
    pub stiffness: [DMatrix<f64>; 2],
    /// Generalised forces F of length N, in units of EI g₀/L³: Eqs. (14), (18).
    pub forcing: [Forcing; 2],
    /// Height V_T of the tip over the undeformed surface, in units of g₀: Eq. (8).
    pub gap: Gap,
    /// Corrections by measured modes and Q control, which the matrices already contain.
    pub(crate) corrections: Vec<Correction>,
}

/// The derivative of a [`Galerkin`] with respect to one parameter, in the same shape.
/// It is that of the coefficients: Ω in the argument of sin Ωτ is not varied.
#[derive(Clone, Debug, PartialEq)]
pub struct GalerkinDerivative {
    /// Derivative of the mass matrix M, N×N.
    pub mass: DMatrix<f64>,
    /// Derivatives of the damping matrices C, N×N.
    pub damping: [DMatrix<f64>; 2],
    /// Derivatives of the stiffness matrices K, N×N.
    pub stiffness: [DMatrix<f64>; 2],
    /// Derivatives of the generalised forces F, of length N.
    pub forcing: [Forcing; 2],
    /// Derivative of the coefficients of V_T.
    pub gap: Gap,
}

impl Galerkin {
    /// Sets up the equations of `case`.
    ///
    /// # Errors
    /// [`CantileverError`] if the case is not valid.
    pub fn new(case: &Cantilever) -> Result<Self, CantileverError> {
        case.validate()?;
        let modes = Modes::of(case)?;
        let corrections = Correction::all(case, &modes, None);
        let mut equations = Coefficients::of(case).assemble(&modes);
        equations.correct(case, &corrections, None);
        let GalerkinDerivative {
            mass,
            damping,
            stiffness,
            forcing,
            gap,
        } = equations;
        let equations = Self {
            case: case.clone(),
            modes,
            mass,
            damping,
            stiffness,
            forcing,
            gap,
            corrections,
        };
        if case.has_q_control() && equations.grows() {
            return Err(CantileverError {
                key: Parameter::QControlGain.name(),
                value: case.get(Parameter::QControlGain),
                reason: Reason::SelfExcited,
            });
        }
        Ok(equations)
    }

    /// Returns true if a motion of the free lever grows without a drive.
    fn grows(&self) -> bool {
        let values = dense_eigenvalues(self, Regime::Free);
        let error = values
            .last()
            .map_or(0.0, |largest| ROUNDING * largest.norm_sqr());
        values.iter().any(|value| value.re > error)
    }

    /// The exact derivative with respect to `parameter`.
    pub fn derivative(&self, parameter: Parameter) -> GalerkinDerivative {
        let mut change = Coefficients::derivative(&self.case, parameter).assemble(&self.modes);
        let corrections = Correction::all(&self.case, &self.modes, Some(parameter));
        change.correct(&self.case, &corrections, Some(parameter));
        change
    }
}

impl GalerkinDerivative {
    /// Adds the corrections by measured modes and Q control, or their derivatives by `parameter`: to the
    /// matrices, and where the base moves by y, the force −(mass ÿ + damping ẏ) along each mode.
    fn correct(
        &mut self,
        case: &Cantilever,
        corrections: &[Correction],
        parameter: Option<Parameter>,
    ) {
        let derivative = parameter.is_some();
        let dual = |p| Dual::new(case.get(p), f64::from(u8::from(Some(p) == parameter)));
        for each in corrections {
            self.mass += each.square(each.mass, derivative);
            for r in Regime::ALL.map(Regime::index) {
                self.damping[r] += each.square(each.damping, derivative);
                self.stiffness[r] += each.square(each.stiffness, derivative);
            }
            for which in Which::all(case) {
                let [sine, cosine] = Tone::new(case, &dual, which).gap;
                let rate = which.rate(&dual);
                let (mass, drag) = (
                    each.mass * each.base * rate * rate,
                    each.damping * each.base * rate,
                );
                let force = [
                    each.vector(mass * sine + drag * cosine, derivative),
                    each.vector(mass * cosine - drag * sine, derivative),
                ];
                for forcing in &mut self.forcing {
                    forcing.add(which, &force);
                }
            }
        }
    }
}

impl Forcing {
    /// Adds sine and cosine coefficients of a tone.
    fn add(&mut self, which: Which, [sine, cosine]: &[DVector<f64>; 2]) {
        let [own_sine, own_cosine] = match which {
            Which::First | Which::OfSignal(0, ..) => [&mut self.sine, &mut self.cosine],
            Which::Further(k, _) => self.further[k].each_mut(),
            Which::OfSignal(k, ..) => self.further[k - 1].each_mut(),
        };
        *own_sine += sine;
        *own_cosine += cosine;
    }
}

/// One tone of the drive, as sine and cosine factors of the vectors p and I and in the gap.
#[derive(Clone, Copy, Debug)]
struct Tone<N> {
    /// Force along p: sine, cosine.
    tip: [N; 2],
    /// Force along I, or along L where the drive is spread over the beam: sine, cosine.
    spread: [N; 2],
    /// Contribution to the gap V_T: sine, cosine.
    gap: [N; 2],
    /// Force along p that contact adds: sine, cosine.
    contact: [N; 2],
}

impl Tone<Dual> {
    /// A sin(wτ + θ). Through the base its force is A w² (α1 p + I) sin(wτ + θ) −
    /// A α3 w I cos(wτ + θ), as Eqs. (14) and (6) have it.
    fn new(case: &Cantilever, dual: &impl Fn(Parameter) -> Dual, which: Which) -> Self {
        let zero = Dual::constant(0.0);
        let rate = which.rate(dual);
        let (amplitude, [sin, cos]) = which.amplitude(dual);
        // s sin(wτ + θ) + c cos(wτ + θ)
        let turned = |s: Dual, c: Dual| [s * cos - c * sin, s * sin + c * cos];
        let (tip, spread, gap) = match case.actuation {
            Actuation::Base => {
                let inertia = amplitude * rate * rate;
                let drag = amplitude * dual(Parameter::Alpha3);
                let drag = match case.cosine_term {
                    CosineTerm::Corrected => drag * rate,
                    CosineTerm::Printed => drag,
                };
                (
                    turned(dual(Parameter::Alpha1) * inertia, zero),
                    turned(inertia, -drag),
                    turned(amplitude, zero),
                )
            }
            Actuation::Tip => (turned(amplitude, zero), [zero; 2], [zero; 2]),
            Actuation::Distributed => ([zero; 2], turned(amplitude, zero), [zero; 2]),
        };
        let (stiffness, damping) = (dual(Parameter::Alpha4), dual(Parameter::Alpha6));
        Self {
            tip,
            spread,
            gap,
            contact: [
                -(stiffness * gap[0]) + damping * rate * gap[1],
                -(stiffness * gap[1]) - damping * rate * gap[0],
            ],
        }
    }

    fn map(self, number: fn(Dual) -> f64) -> Tone<f64> {
        Tone {
            tip: self.tip.map(number),
            spread: self.spread.map(number),
            gap: self.gap.map(number),
            contact: self.contact.map(number),
        }
    }
}

/// A tone of the drive: the first, or a further one.
#[derive(Clone, Copy)]
enum Which {
    First,
    /// Index among the further tones, and frequency over that of the first.
    Further(usize, FrequencyRatio),
    /// Index among the tones of a signal, frequency over that of the drive, and z of `Re(z e^{iωt})`
    /// over the amplitude of the drive.
    OfSignal(usize, f64, Complex),
}

impl Which {
    /// All tones of a case.
    fn all(case: &Cantilever) -> Vec<Self> {
        if let Some(signal) = &case.signal {
            let tones = signal.tones.iter().enumerate();
            let tone =
                |(k, (multiple, z)): (usize, &(f64, Complex))| Self::OfSignal(k, *multiple, *z);
            return tones.map(tone).collect();
        }
        let further = case.further_tones.iter().enumerate();
        std::iter::once(Self::First)
            .chain(further.map(|(k, ratio)| Self::Further(k, *ratio)))
            .collect()
    }

    /// The mean of a signal, as the cosine of a tone of frequency 0; 0 without a signal.
    fn mean(case: &Cantilever) -> Self {
        let mean = case.signal.as_ref().map_or(0.0, |signal| signal.mean);
        Self::OfSignal(0, 0.0, Complex::new(mean, 0.0))
    }

    /// Amplitude, and sine and cosine of the phase.
    fn amplitude(self, dual: &impl Fn(Parameter) -> Dual) -> (Dual, [Dual; 2]) {
        let of_phase = |phase: Dual| <[Dual; 2]>::from(phase.to_radians().sin_cos());
        match self {
            Self::First => (dual(Parameter::Alpha2), of_phase(Dual::constant(0.0))),
            Self::Further(k, _) => {
                let [amplitude, phase] = Parameter::TONES[k].map(dual);
                (amplitude, of_phase(phase))
            }
            // Re(z e^{iωt}) = Re z cos ωt − Im z sin ωt
            Self::OfSignal(_, _, z) => (dual(Parameter::Alpha2), [z.re, -z.im].map(Dual::constant)),
        }
    }

    /// Returns the angular frequency, in units of √(EI/(mL⁴)).
    fn rate(self, dual: &impl Fn(Parameter) -> Dual) -> Dual {
        let omega = dual(Parameter::Omega);
        match self {
            Self::First => omega,
            Self::Further(_, ratio) => omega * Dual::constant(ratio.value()),
            Self::OfSignal(_, multiple, _) => omega * Dual::constant(multiple),
        }
    }
}

/// Everything that depends on the parameters, as factors of 1, ppᵀ, diag(β⁴), p and I.
/// Values and derivatives differ in these numbers only.
#[derive(Clone, Debug)]
struct Coefficients {
    beam_mass: f64,
    tip_mass: f64,
    beam_damping: f64,
    contact_damping: f64,
    beam_stiffness: f64,
    contact_stiffness: f64,
    tones: Vec<Tone<f64>>,
    /// Mean of a signal, as the cosine of a tone of frequency 0.
    mean: Tone<f64>,
    /// Whether the drive is spread over the beam.
    is_distributed: bool,
    /// Constant force that contact adds along p.
    contact_constant: f64,
    gap_tip: f64,
    gap_constant: f64,
}

impl Coefficients {
    /// Computes the coefficients of Eqs. (8) and (11)–(18).
    fn of(case: &Cantilever) -> Self {
        Self::numbers(case, None, |dual| dual.value)
    }

    /// Computes the derivatives of the coefficients with respect to `parameter`.
    fn derivative(case: &Cantilever, parameter: Parameter) -> Self {
        Self::numbers(case, Some(parameter), Dual::derivative)
    }

    fn numbers(case: &Cantilever, parameter: Option<Parameter>, number: fn(Dual) -> f64) -> Self {
        let dual = |p| Dual::new(case.get(p), f64::from(u8::from(Some(p) == parameter)));
        let one = Dual::constant(1.0);
        Self {
            beam_mass: number(one),
            tip_mass: number(dual(Parameter::Alpha1)),
            beam_damping: number(dual(Parameter::Alpha3)),
            contact_damping: number(dual(Parameter::Alpha6)),
            beam_stiffness: number(one),
            contact_stiffness: number(dual(Parameter::Alpha4)),
            tones: Which::all(case)
                .into_iter()
                .map(|which| Tone::new(case, &dual, which).map(number))
                .collect(),
            mean: Tone::new(case, &dual, Which::mean(case)).map(number),
            is_distributed: case.actuation == Actuation::Distributed,
            contact_constant: number(-(dual(Parameter::Alpha4) * dual(Parameter::Alpha5))),
            gap_tip: number(one),
            gap_constant: number(dual(Parameter::Alpha5)),
        }
    }

    fn assemble(&self, modes: &Modes) -> GalerkinDerivative {
        let count = modes.count();
        let p = &modes.tip;
        let i = if self.is_distributed {
            &modes.even_load
        } else {
            &modes.integral
        };
        // diag(d) + load ppᵀ
        let loaded = |diagonal: &dyn Fn(usize) -> f64, load: f64| {
            DMatrix::from_fn(count, count, |row, column| {
                let tip = load * (p[row] * p[column]);
                if row == column {
                    diagonal(row) + tip
                } else {
                    tip
                }
            })
        };
        let damping = |_: usize| self.beam_damping;
        let stiffness = |j: usize| modes.stiffness[j] * self.beam_stiffness;
        let forcing = |touching: f64| {
            let tone = |tone: &Tone<f64>| {
                [0, 1].map(|k| p * (tone.tip[k] + touching * tone.contact[k]) + i * tone.spread[k])
            };
            let [sine, cosine] = tone(&self.tones[0]);
            let [_, mean] = tone(&self.mean);
            Forcing {
                sine,
                cosine,
                constant: p * (touching * self.contact_constant) + mean,
                further: self.tones[1..].iter().map(tone).collect(),
            }
        };
        GalerkinDerivative {
            mass: loaded(&|_| self.beam_mass, self.tip_mass),
            damping: [
                loaded(&damping, 0.0),
                loaded(&damping, self.contact_damping),
            ],
            stiffness: [
                loaded(&stiffness, 0.0),
                loaded(&stiffness, self.contact_stiffness),
            ],
            forcing: [forcing(0.0), forcing(1.0)],
            gap: Gap {
                tip: p * self.gap_tip,
                sine: self.tones[0].gap[0],
                cosine: self.tones[0].gap[1],
                constant: self.gap_constant + self.mean.gap[1],
                further: self.tones[1..].iter().map(|tone| tone.gap).collect(),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A case with nothing equal to zero or one, so that every term shows.
    fn case() -> Cantilever {
        Cantilever {
            modes: 4,
            alpha1: 0.13,
            alpha2: 0.7,
            alpha3: 0.31,
            alpha4: 17.0,
            alpha5: -0.23,
            alpha6: 0.41,
            omega: 3.7,
            cosine_term: CosineTerm::Corrected,
            ..Cantilever::paper()
        }
    }

    /// All entries of a set of equations, in sequence.
    fn entries(g: &GalerkinDerivative) -> Vec<f64> {
        let mut all: Vec<f64> = g.mass.iter().copied().collect();
        for r in Regime::ALL.map(Regime::index) {
            all.extend(g.damping[r].iter().chain(g.stiffness[r].iter()));
            let forcing = &g.forcing[r];
            all.extend(
                forcing
                    .sine
                    .iter()
                    .chain(forcing.cosine.iter())
                    .chain(forcing.constant.iter()),
            );
        }
        all.extend(g.gap.tip.iter());
        all.extend([g.gap.sine, g.gap.constant]);
        all.extend(g.gap.further.iter().flatten());
        let further = g.forcing.iter().flat_map(|f| &f.further);
        all.extend(further.flatten().flat_map(|v| v.iter()));
        all
    }

    fn values(case: &Cantilever) -> Vec<f64> {
        let g = Galerkin::new(case).unwrap();
        entries(&GalerkinDerivative {
            mass: g.mass,
            damping: g.damping,
            stiffness: g.stiffness,
            forcing: g.forcing,
            gap: g.gap,
        })
    }

    /// The weak form of Eq. (6) for a rigid motion of the whole beam: the force of
    /// contact must be −(α4 V_T + α6 V̇_T) on the tip, whatever the drive's phase.
    #[test]
    fn contact_adds_a_spring_and_a_damper_at_the_tip() {
        let case = case();
        let g = Galerkin::new(&case).unwrap();
        let x = DVector::from_vec(vec![0.3, -0.2, 0.05, 0.01]);
        let v = DVector::from_vec(vec![-1.3, 0.4, 2.0, -0.7]);
        for tau in [0.0, 0.4, 1.1, 2.9] {
            let (sin, cos) = (case.omega * tau).sin_cos();
            let force = |r: usize| {
                let f = &g.forcing[r];
                &f.sine * sin + &f.cosine * cos + &f.constant
                    - &g.damping[r] * &v
                    - &g.stiffness[r] * &x
            };
            let gap = g.gap.tip.dot(&x) + g.gap.sine * sin + g.gap.constant;
            let rate = g.gap.tip.dot(&v) + g.gap.sine * case.omega * cos;
            let expected = &g.modes.tip * -(case.alpha4 * gap + case.alpha6 * rate);
            assert!((force(1) - force(0) - expected).amax() < 1e-12);
        }
    }

    /// In the absolute frame (displacement w + y) the base's motion acts through
    /// bending only; in free flight the generalised inertia and damping forces of
    /// y = α2 sin Ωτ are therefore −(α1 p + I) ÿ − α3 I ẏ.
    #[test]
    fn drive_is_the_base_acceleration_and_velocity() {
        let case = case();
        let g = Galerkin::new(&case).unwrap();
        let inertia = &g.modes.tip * case.alpha1 + &g.modes.integral;
        for tau in [0.0, 0.3, 1.7] {
            let (sin, cos) = (case.omega * tau).sin_cos();
            let velocity = case.alpha2 * case.omega * cos;
            let acceleration = -case.alpha2 * case.omega.powi(2) * sin;
            let expected =
                -(&inertia * acceleration) - &g.modes.integral * (case.alpha3 * velocity);
            let force = &g.forcing[0].sine * sin + &g.forcing[0].cosine * cos;
            assert!((force - expected).amax() < 1e-13);
        }
    }

    #[test]
    fn printed_form_differs_by_omega_in_the_beams_cosine_term_only() {
        let printed = Cantilever {
            cosine_term: CosineTerm::Printed,
            ..case()
        };
        let (a, b) = (
            Galerkin::new(&case()).unwrap(),
            Galerkin::new(&printed).unwrap(),
        );
        assert!((&b.forcing[0].cosine * 3.7 - &a.forcing[0].cosine).amax() < 1e-15);
        assert!((&b.forcing[1].cosine - &b.forcing[0].cosine).relative_eq(
            &(&a.forcing[1].cosine - &a.forcing[0].cosine),
            1e-14,
            1e-14
        ));
        assert_eq!(
            (a.mass, a.damping, a.stiffness),
            (b.mass, b.damping, b.stiffness)
        );
        assert_eq!(a.forcing[1].sine, b.forcing[1].sine);
    }

    /// The equations are at most quadratic in any one parameter, so central
    /// differences have no truncation error.
    #[test]
    fn derivatives_agree_with_central_differences() {
        for cosine_term in [CosineTerm::Corrected, CosineTerm::Printed] {
            let case = Cantilever {
                cosine_term,
                ..case()
            };
            let g = Galerkin::new(&case).unwrap();
            for parameter in Parameter::ALL {
                let step = 0.0625;
                let at = |offset: f64| {
                    values(&case.clone().with(parameter, case.get(parameter) + offset))
                };
                let exact = entries(&g.derivative(parameter));
                for ((plus, minus), exact) in at(step).iter().zip(at(-step)).zip(exact) {
                    let difference = (plus - minus) / (2.0 * step);
                    assert!(
                        (difference - exact).abs() < 1e-11 * (1.0 + plus.abs()),
                        "{parameter}: {difference} instead of {exact}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_bad_case_is_refused() {
        let error = Galerkin::new(&case().with_modes(51)).unwrap_err();
        assert_eq!(error.key, "modes");
        let error = Galerkin::new(&case().with(Parameter::Alpha4, f64::NAN)).unwrap_err();
        assert_eq!(error.key, "alpha4");
    }
}

//! The Galerkin equations of motion, Eqs. (10)–(18), and their derivatives with
//! respect to every parameter.
//!
//! In either regime M Ẍ + C Ẋ + K X = s sin Ωτ + c cos Ωτ + k, and the gap between
//! tip and sample is V_T = p·X + α2 sin Ωτ + α5, Eq. (8).

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::beam::Modes;
use crate::case::{Case, CaseError, CosineTerm};
use crate::parameter::Parameter;

/// The two linear regimes of the tip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Regime {
    /// Free flight, V_T > 0.
    Free,
    /// Contact, V_T ≤ 0.
    Contact,
}

impl Regime {
    /// Both, in the order of the arrays in this module.
    pub const ALL: [Self; 2] = [Self::Free, Self::Contact];

    /// The regime's place in the arrays of this module.
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
}

/// The gap V_T = p·X + sine · sin Ωτ + constant, Eq. (8), or a derivative of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Gap {
    /// The row p in front of X.
    pub tip: DVector<f64>,
    /// The coefficient of sin Ωτ.
    pub sine: f64,
    /// The part constant in time.
    pub constant: f64,
}

/// The equations of motion of one case. Arrays are indexed by [`Regime::index`].
#[derive(Clone, Debug, PartialEq)]
pub struct Galerkin {
    /// The case.
    pub case: Case,
    /// The beam's modes.
    pub modes: Arc<Modes>,
    /// M, N×N, the same in both regimes: Eqs. (11), (15).
    pub mass: DMatrix<f64>,
    /// C, N×N: Eqs. (12), (16).
    pub damping: [DMatrix<f64>; 2],
    /// K, N×N: Eqs. (13), (17).
    pub stiffness: [DMatrix<f64>; 2],
    /// F: Eqs. (14), (18).
    pub forcing: [Forcing; 2],
    /// V_T: Eq. (8).
    pub gap: Gap,
}

/// The derivative of a [`Galerkin`] with respect to one parameter, in the same shape.
/// It is that of the coefficients: Ω in the argument of sin Ωτ is not varied.
#[derive(Clone, Debug, PartialEq)]
pub struct GalerkinDerivative {
    /// ∂M.
    pub mass: DMatrix<f64>,
    /// ∂C.
    pub damping: [DMatrix<f64>; 2],
    /// ∂K.
    pub stiffness: [DMatrix<f64>; 2],
    /// ∂F.
    pub forcing: [Forcing; 2],
    /// ∂V_T.
    pub gap: Gap,
}

impl Galerkin {
    /// Sets up the equations of `case`.
    ///
    /// # Errors
    /// [`CaseError`] if the case is not valid.
    pub fn new(case: &Case) -> Result<Self, CaseError> {
        case.validate()?;
        let modes = Modes::shared(case.modes)?;
        let GalerkinDerivative {
            mass,
            damping,
            stiffness,
            forcing,
            gap,
        } = Coefficients::of(case).assemble(&modes);
        Ok(Self {
            case: case.clone(),
            modes,
            mass,
            damping,
            stiffness,
            forcing,
            gap,
        })
    }

    /// The exact derivative with respect to `parameter`.
    pub fn derivative(&self, parameter: Parameter) -> GalerkinDerivative {
        Coefficients::derivative(&self.case, parameter).assemble(&self.modes)
    }
}

/// Everything that depends on the parameters, as factors of 1, ppᵀ, diag(β⁴), p and I.
/// Values and derivatives differ in these numbers only.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Coefficients {
    beam_mass: f64,
    tip_mass: f64,
    beam_damping: f64,
    contact_damping: f64,
    beam_stiffness: f64,
    contact_stiffness: f64,
    /// Free sine force along p and along I.
    sine: [f64; 2],
    /// Free cosine force along I.
    cosine: f64,
    /// What contact adds along p: sine, cosine, constant.
    contact: [f64; 3],
    gap_tip: f64,
    gap_sine: f64,
    gap_constant: f64,
}

impl Coefficients {
    /// Eqs. (8) and (11)–(18).
    fn of(case: &Case) -> Self {
        let &Case {
            alpha1,
            alpha2,
            alpha3,
            alpha4,
            alpha5,
            alpha6,
            omega,
            ..
        } = case;
        Self {
            beam_mass: 1.0,
            tip_mass: alpha1,
            beam_damping: alpha3,
            contact_damping: alpha6,
            beam_stiffness: 1.0,
            contact_stiffness: alpha4,
            sine: [alpha1 * alpha2 * omega * omega, alpha2 * omega * omega],
            cosine: match case.cosine_term {
                CosineTerm::Corrected => -alpha2 * alpha3 * omega,
                CosineTerm::Printed => -alpha2 * alpha3,
            },
            contact: [-alpha2 * alpha4, -alpha2 * alpha6 * omega, -alpha4 * alpha5],
            gap_tip: 1.0,
            gap_sine: alpha2,
            gap_constant: alpha5,
        }
    }

    /// The derivatives of [`of`](Self::of).
    fn derivative(case: &Case, parameter: Parameter) -> Self {
        let &Case {
            alpha1,
            alpha2,
            alpha3,
            alpha4,
            alpha5,
            alpha6,
            omega,
            ..
        } = case;
        let zero = Self::default();
        // The cosine force is −α2 α3 times this.
        let (rate, rate_by_omega) = match case.cosine_term {
            CosineTerm::Corrected => (omega, 1.0),
            CosineTerm::Printed => (1.0, 0.0),
        };
        match parameter {
            Parameter::Alpha1 => Self {
                tip_mass: 1.0,
                sine: [alpha2 * omega * omega, 0.0],
                ..zero
            },
            Parameter::Alpha2 => Self {
                sine: [alpha1 * omega * omega, omega * omega],
                cosine: -alpha3 * rate,
                contact: [-alpha4, -alpha6 * omega, 0.0],
                gap_sine: 1.0,
                ..zero
            },
            Parameter::Alpha3 => Self {
                beam_damping: 1.0,
                cosine: -alpha2 * rate,
                ..zero
            },
            Parameter::Alpha4 => Self {
                contact_stiffness: 1.0,
                contact: [-alpha2, 0.0, -alpha5],
                ..zero
            },
            Parameter::Alpha5 => Self {
                contact: [0.0, 0.0, -alpha4],
                gap_constant: 1.0,
                ..zero
            },
            Parameter::Alpha6 => Self {
                contact_damping: 1.0,
                contact: [0.0, -alpha2 * omega, 0.0],
                ..zero
            },
            Parameter::Omega => Self {
                sine: [2.0 * alpha1 * alpha2 * omega, 2.0 * alpha2 * omega],
                cosine: -alpha2 * alpha3 * rate_by_omega,
                contact: [0.0, -alpha2 * alpha6, 0.0],
                ..zero
            },
            // Of the sample's own equations only.
            Parameter::RelaxationStiffness | Parameter::RelaxationTime => zero,
        }
    }

    fn assemble(&self, modes: &Modes) -> GalerkinDerivative {
        let count = modes.count();
        let (p, i) = (&modes.tip, &modes.integral);
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
        let free = Forcing {
            sine: p * self.sine[0] + i * self.sine[1],
            cosine: i * self.cosine,
            constant: DVector::zeros(count),
        };
        let contact = Forcing {
            sine: &free.sine + p * self.contact[0],
            cosine: &free.cosine + p * self.contact[1],
            constant: p * self.contact[2],
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
            forcing: [free, contact],
            gap: Gap {
                tip: p * self.gap_tip,
                sine: self.gap_sine,
                constant: self.gap_constant,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A case with nothing equal to zero or one, so that every term shows.
    fn case() -> Case {
        Case {
            modes: 4,
            alpha1: 0.13,
            alpha2: 0.7,
            alpha3: 0.31,
            alpha4: 17.0,
            alpha5: -0.23,
            alpha6: 0.41,
            omega: 3.7,
            cosine_term: CosineTerm::Corrected,
            ..Case::paper()
        }
    }

    /// All entries of a set of equations, one after the other.
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
        all
    }

    fn values(case: &Case) -> Vec<f64> {
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
        let printed = Case {
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
            let case = Case {
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

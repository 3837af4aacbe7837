//! The model of a case as a piecewise-linear system with the outputs that someone
//! wants to see.
//!
//! State: `(a_1 … a_N, ȧ_1 … ȧ_N)` for the cantilever, `(x, ẋ)` for an oscillator.
//! Regime 0 is free flight. Everything that analyses or shows a motion works on a
//! [`Model`] and asks no more where it came from.

use std::sync::{Arc, OnceLock};

use nalgebra::{Complex, DMatrix, DVector, RowDVector};
pub use nanotap_flow::FlowError;
use nanotap_flow::sensitivity::{RegimeTangent, SystemTangent};
use nanotap_flow::{Drive, Exit, HarmonicVector, Output, SpectralBasis, System};

use crate::beam::Modes;
use crate::case::{Case, CaseError, CosineTerm};
use crate::galerkin::{Forcing, Galerkin, Gap, Regime};
use crate::parameter::Parameter;
use crate::spectrum::Spectrum;

/// Why a case has no model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// The case itself makes no sense.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// The oscillator makes no sense.
    #[error(transparent)]
    Oscillator(#[from] crate::oscillator::OscillatorError),
    /// Its equations cannot be solved in closed form.
    #[error(transparent)]
    Flow(#[from] FlowError),
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
    /// Tip-sample gap, V_T: positive in flight.
    pub gap: Output,
    /// Force of the sample on the tip, positive when it pushes the tip away; an entry
    /// a regime.
    pub force: Vec<Output>,
    /// What feeds and drains energy: see [`Model::power`].
    pub(crate) power: PowersOnDemand,
    /// What an impact takes, as a factor of the square of the gap's rate: ½ m (1 − r²)
    /// for a rigid stop, 0 otherwise.
    pub impact_loss: f64,
    /// The beam's modes, if it is a beam.
    pub beam: Option<BeamOutputs>,
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

/// [`Powers`] of every regime, worked out when first asked for: of the thousands of models
/// that a sweep sets up, few ever are.
#[derive(Clone, Debug)]
pub(crate) struct PowersOnDemand {
    known: OnceLock<Vec<Powers>>,
    /// What they follow from, where they are not known from the start.
    equations: Option<Arc<Galerkin>>,
}

impl PowersOnDemand {
    /// Of these equations.
    fn of(equations: Galerkin) -> Self {
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
    /// Displacement of the base, α2 sin Ωτ.
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
    /// The cantilever of `case`, Eqs. (8)–(18).
    ///
    /// # Errors
    /// When the case is not valid, or a regime is driven at an undamped resonance.
    pub fn cantilever(case: &Case) -> Result<Self, ModelError> {
        let galerkin = Galerkin::new(case)?;
        let drive = Drive::single(case.omega)?;
        let mass = galerkin.mass.clone().cholesky();
        let Some(mass) = mass else {
            return Err(FlowError::NotFinite {
                what: "the mass matrix",
            }
            .into());
        };
        let n = case.modes;
        let mut regimes = Vec::with_capacity(2);
        for regime in Regime::ALL {
            let r = regime.index();
            let matrix = companion(
                &mass.solve(&galerkin.stiffness[r]),
                &mass.solve(&galerkin.damping[r]),
            );
            let forcing = accelerations(&galerkin.forcing[r], |f| mass.solve(f));
            regimes.push(match Spectrum::new(&galerkin, regime) {
                Ok(s) => {
                    let basis = SpectralBasis::from_simple_eigenpairs(
                        s.eigenvalues,
                        s.right_state,
                        s.left_state,
                    )?;
                    nanotap_flow::Regime::with_basis(r, matrix, forcing, &drive, basis)?
                }
                // (Nearly) critical damping has no basis of eigenvectors; the general
                // decomposition groups what belongs together.
                Err(_) => nanotap_flow::Regime::new(r, matrix, forcing, &drive)?,
            });
        }
        let gap = gap_output(&galerkin.gap, n);
        let exits = vec![
            vec![Exit::new(gap.clone(), 1)],
            vec![Exit::new(gap.scaled(-1.0), 0)],
        ];
        let system = Arc::new(System::new(drive, regimes, exits)?);
        Ok(Self::with_outputs(galerkin, system, gap))
    }

    fn with_outputs(galerkin: Galerkin, system: Arc<System>, gap: Output) -> Self {
        let (case, modes) = (&galerkin.case, &galerkin.modes);
        let displacement = |v: &DVector<f64>| state_row(v, 0);
        let base =
            Output::linear(RowDVector::zeros(2 * case.modes), 1).with_tone(0, case.alpha2, 0.0);
        let contact_force = {
            // f = −(α4 V_T + α6 V̇_T)
            let regime = &system.regimes()[1];
            let rate = gap.rate(regime.matrix(), regime.forcing(), system.drive());
            gap.scaled(-case.alpha4).plus(-case.alpha6, &rate)
        };
        let force = vec![gap.scaled(0.0), contact_force];
        Self {
            contact: vec![false, true],
            tip: displacement(&modes.tip),
            force,
            impact_loss: 0.0,
            beam: Some(BeamOutputs {
                modes: Arc::clone(modes),
                slope: displacement(&modes.tip_slope),
                base,
            }),
            gap,
            system,
            power: PowersOnDemand::of(galerkin),
        }
    }

    /// What feeds and drains energy; an entry a regime.
    pub fn power(&self) -> &[Powers] {
        self.power.known.get_or_init(|| {
            let (Some(galerkin), Some(beam)) = (&self.power.equations, &self.beam) else {
                return Vec::new();
            };
            Regime::ALL
                .map(|regime| powers(galerkin, &self.system, regime, &self.gap, beam, &self.force))
                .into()
        })
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
    /// which moves up from the sample; where the stop stands for an oscillator.
    pub fn surface(&self) -> Output {
        let towards = if self.beam.is_some() { -1.0 } else { 1.0 };
        self.tip.plus(towards, &self.gap)
    }

    /// The drive period.
    pub fn period(&self) -> f64 {
        self.system.drive().period()
    }
}

/// The derivative of the cantilever's system with respect to one parameter.
///
/// # Errors
/// As [`Model::cantilever`].
pub fn cantilever_tangent(
    case: &Case,
    model: &Model,
    parameter: Parameter,
) -> Result<SystemTangent, ModelError> {
    let galerkin = Galerkin::new(case)?;
    let derivative = galerkin.derivative(parameter);
    let Some(mass) = galerkin.mass.clone().cholesky() else {
        return Err(FlowError::NotFinite {
            what: "the mass matrix",
        }
        .into());
    };
    let mut tangent = SystemTangent::zeros(&model.system);
    for r in 0..2 {
        // ∂(M⁻¹K) = M⁻¹(∂K − ∂M M⁻¹K), and so on.
        let (k, c) = (
            mass.solve(&galerkin.stiffness[r]),
            mass.solve(&galerkin.damping[r]),
        );
        let dk = mass.solve(&(&derivative.stiffness[r] - &derivative.mass * &k));
        let dc = mass.solve(&(&derivative.damping[r] - &derivative.mass * &c));
        let change = |df: &DVector<f64>, f: &DVector<f64>| {
            mass.solve(&(df - &derivative.mass * mass.solve(f)))
        };
        let (f, df) = (&galerkin.forcing[r], &derivative.forcing[r]);
        let forcing = Forcing {
            sine: change(&df.sine, &f.sine),
            cosine: change(&df.cosine, &f.cosine),
            constant: change(&df.constant, &f.constant),
        };
        let n = case.modes;
        let mut matrix = companion(&dk, &dc);
        matrix.view_mut((0, n), (n, n)).fill(0.0);
        tangent.regimes[r] = RegimeTangent {
            matrix,
            forcing: accelerations(&forcing, Clone::clone),
        };
    }
    let gap = gap_output(&derivative.gap, case.modes);
    tangent.guards = vec![vec![gap.clone()], vec![gap.scaled(-1.0)]];
    if parameter == Parameter::Omega {
        tangent.log_period = -1.0 / case.omega;
    }
    Ok(tangent)
}

/// `[[0, 1], [−M⁻¹K, −M⁻¹C]]`.
fn companion(stiffness: &DMatrix<f64>, damping: &DMatrix<f64>) -> DMatrix<f64> {
    let n = stiffness.nrows();
    DMatrix::from_fn(2 * n, 2 * n, |row, column| match (row < n, column < n) {
        (true, _) => f64::from(u8::from(column == row + n)),
        (false, true) => -stiffness[(row - n, column)],
        (false, false) => -damping[(row - n, column - n)],
    })
}

/// A generalised force as the forcing of the state equation.
fn accelerations(force: &Forcing, solve: impl Fn(&DVector<f64>) -> DVector<f64>) -> HarmonicVector {
    let n = force.sine.len();
    let (sine, cosine) = (solve(&force.sine), solve(&force.cosine));
    let constant = solve(&force.constant);
    let lower = |row: usize| row.checked_sub(n);
    HarmonicVector {
        constant: DVector::from_fn(2 * n, |row, _| lower(row).map_or(0.0, |j| constant[j])),
        tones: vec![DVector::from_fn(2 * n, |row, _| {
            lower(row).map_or(Complex::new(0.0, 0.0), |j| {
                Complex::new(cosine[j], -sine[j])
            })
        })],
    }
}

/// A row acting on the displacements (`block` 0) or velocities (`block` 1).
fn state_row(v: &DVector<f64>, block: usize) -> Output {
    let n = v.len();
    let mut row = RowDVector::zeros(2 * n);
    row.columns_mut(block * n, n).tr_copy_from(v);
    Output::linear(row, 1)
}

fn gap_output(gap: &Gap, n: usize) -> Output {
    debug_assert_eq!(gap.tip.len(), n);
    state_row(&gap.tip, 0)
        .with_tone(0, gap.sine, 0.0)
        .with_constant(gap.constant)
}

/// Energy flows in one regime, in the frame of the resting sample. With y = α2 sin Ωτ,
/// the clamp pushes with R = d/dτ(I·ȧ + ẏ + α1(p·ȧ + ẏ)) + α3(I·ȧ + ẏ) − f and
/// delivers R ẏ; the beam's damping, which acts on the velocity of the beam
/// through the medium, takes α3 ∫(Ẇ + ẏ)² dξ; the sample's takes α6 V̇_T². The
/// printed Eq. (14) is a further force on the modes, whose work counts as the drive's.
fn powers(
    galerkin: &Galerkin,
    system: &System,
    regime: Regime,
    gap: &Output,
    beam: &BeamOutputs,
    force: &[Output],
) -> Powers {
    let (case, base, force) = (&galerkin.case, &beam.base, &force[regime.index()]);
    let flow = &system.regimes()[regime.index()];
    let rate = |o: &Output| o.rate(flow.matrix(), flow.forcing(), system.drive());
    let modes = &galerkin.modes;
    let base_rate = rate(base);
    let integral = state_row(&modes.integral, 1);
    let tip_speed = state_row(&modes.tip, 1).plus(1.0, &base_rate);
    let mean_speed = integral.plus(1.0, &base_rate);
    let momentum = mean_speed.plus(case.alpha1, &tip_speed);
    let clamp = rate(&momentum)
        .plus(case.alpha3, &mean_speed)
        .plus(-1.0, force);
    let product = |weight, a: &Output, b: &Output| Product {
        weight,
        a: a.clone(),
        b: b.clone(),
    };
    let mut drive = vec![product(1.0, &clamp, &base_rate)];
    if case.cosine_term == CosineTerm::Printed {
        // Printed minus corrected: −α2 α3 (1 − Ω) I cos Ωτ, acting on ȧ.
        let extra = Output::linear(RowDVector::zeros(2 * case.modes), 1).with_tone(
            0,
            0.0,
            -case.alpha2 * case.alpha3 * (1.0 - case.omega),
        );
        drive.push(product(1.0, &extra, &integral));
    }
    let unit = |j: usize, block: usize| {
        let mut unit = DVector::zeros(case.modes);
        unit[j] = 1.0;
        state_row(&unit, block)
    };
    // ∫(Ẇ + ẏ)² = |ȧ|² + ẏ (2 I·ȧ + ẏ)
    let mut squared_speed: Vec<Product> = (0..case.modes)
        .map(|j| product(1.0, &unit(j, 1), &unit(j, 1)))
        .collect();
    squared_speed.push(product(
        1.0,
        &base_rate,
        &integral.scaled(2.0).plus(1.0, &base_rate),
    ));
    let weighted = |factor: f64| {
        squared_speed.iter().map(move |p| Product {
            weight: p.weight * factor,
            ..p.clone()
        })
    };
    let mut stored: Vec<Product> = weighted(0.5).collect();
    stored.push(product(0.5 * case.alpha1, &tip_speed, &tip_speed));
    stored.extend(
        (0..case.modes).map(|j| product(0.5 * modes.stiffness[j], &unit(j, 0), &unit(j, 0))),
    );
    let mut sample = Vec::new();
    if regime == Regime::Contact {
        sample.push(product(case.alpha6, &rate(gap), &rate(gap)));
        stored.push(product(0.5 * case.alpha4, gap, gap));
    }
    Powers {
        drive,
        beam: weighted(case.alpha3).collect(),
        sample,
        stored,
    }
}

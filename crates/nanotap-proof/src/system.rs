//! A harmonically forced piecewise-linear system with intervals as coefficients, and its flow in
//! closed form.
//!
//! In a regime ẋ = A x + f(t) with f(t) = f₀ + Σ Re(F_k e^{iω_k t}). With the forced response p(t)
//! = p₀ + Σ Re(P_k e^{iω_k t}), p₀ = −A⁻¹f₀ and P_k = (iω_k − A)⁻¹F_k, and with L, R and λ from an
//! [`Eigenbasis`], the motion from x at time t is x(t + s) = p(t + s) + Re(R e^{λs} L (x − p(t))).

use nanotap_arithmetic::CancelFlag;

use crate::ProofError;
use crate::complex::Rectangle;
use crate::eigen::Eigenbasis;
use crate::interval::Interval;
use crate::matrix::{Matrix, dot};

/// A vector `constant + Σ_k Re(tones_k e^{iω_k t})`.
#[derive(Clone, Debug, PartialEq)]
pub struct HarmonicVector {
    /// The part that does not depend on time.
    pub constant: Vec<Interval>,
    /// The complex amplitude of each tone.
    pub tones: Vec<Vec<Rectangle>>,
}

/// A scalar `row · x + constant + Σ_k Re(tones_k e^{iω_k t})`.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// Coefficients of the state, one for each of its entries.
    pub row: Vec<Interval>,
    /// The part that depends on neither state nor time.
    pub constant: Interval,
    /// The complex amplitude of each tone.
    pub tones: Vec<Rectangle>,
}

/// A jump of the state, `x⁺ = matrix · x⁻ + offset(t)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Reset {
    /// Matrix of the jump, d × d.
    pub matrix: Matrix<Interval>,
    /// Offset of the jump, length d.
    pub offset: HarmonicVector,
}

/// An exit from a regime, taken when its guard falls to zero.
#[derive(Clone, Debug, PartialEq)]
pub struct Transition {
    /// The guard, positive inside the regime.
    pub guard: Output,
    /// Index of the next regime.
    pub target: usize,
    /// Jump of the state, if any.
    pub reset: Option<Reset>,
    /// Guards of the next regime that start at exactly zero, by transition, with the number of
    /// derivatives that vanish, including the guard itself.
    pub starts_at_zero: Vec<(usize, usize)>,
}

/// Definition of a regime: ẋ = A x + f(t), until a guard falls to zero.
#[derive(Clone, Debug, PartialEq)]
pub struct RegimeParts {
    /// The matrix A, d × d.
    pub matrix: Matrix<Interval>,
    /// The forcing f(t), of length d.
    pub forcing: HarmonicVector,
    /// The exits from the regime.
    pub transitions: Vec<Transition>,
}

/// A regime with its flow.
#[derive(Clone, Debug)]
pub struct Regime {
    pub(crate) parts: RegimeParts,
    pub(crate) basis: Eigenbasis,
    pub(crate) response: HarmonicVector,
    /// The guard of each transition along a motion.
    pub(crate) guards: Vec<ModalOutput>,
}

/// An output along a motion of a regime: Re Σ_k w_k q_k e^{λ_k s} plus the forced part.
#[derive(Clone, Debug)]
pub(crate) struct ModalOutput {
    pub(crate) weights: Vec<Rectangle>,
    pub(crate) constant: Interval,
    pub(crate) tones: Vec<Rectangle>,
}

/// A piecewise-linear system that is periodically forced, with its regimes.
#[derive(Clone, Debug)]
pub struct System {
    pub(crate) dimension: usize,
    pub(crate) period: Interval,
    pub(crate) frequencies: Vec<Interval>,
    pub(crate) regimes: Vec<Regime>,
    cancel: CancelFlag,
}

impl HarmonicVector {
    /// The value for the given phasors of the tones.
    pub(crate) fn at(&self, phasors: &[Rectangle]) -> Vec<Interval> {
        (0..self.constant.len())
            .map(|i| {
                let tones = self.tones.iter().zip(phasors);
                self.constant[i] + tones.map(|(z, &e)| (z[i] * e).re).sum()
            })
            .collect()
    }

    /// The time derivative for the given phasors.
    pub(crate) fn rate(&self, frequencies: &[Interval], phasors: &[Rectangle]) -> Vec<Interval> {
        (0..self.constant.len())
            .map(|i| {
                let tones = self.tones.iter().zip(frequencies.iter().zip(phasors));
                tones
                    .map(|(z, (&w, &e))| (z[i] * e * Rectangle::imaginary(w)).re)
                    .sum()
            })
            .collect()
    }
}

impl Output {
    /// The value at a state.
    pub(crate) fn at(&self, state: &[Interval], phasors: &[Rectangle]) -> Interval {
        let tones = self.tones.iter().zip(phasors);
        dot(&self.row, state) + self.constant + tones.map(|(&z, &e)| (z * e).re).sum()
    }

    /// The time derivative at a fixed state.
    pub(crate) fn explicit_rate(
        &self,
        frequencies: &[Interval],
        phasors: &[Rectangle],
    ) -> Interval {
        let tones = self.tones.iter().zip(frequencies.iter().zip(phasors));
        tones
            .map(|(&z, (&w, &e))| (z * e * Rectangle::imaginary(w)).re)
            .sum()
    }
}

impl System {
    /// Builds a system from its regimes. `frequencies` are those of the tones, all multiples of 2π
    /// over `period`.
    ///
    /// # Errors
    /// [`ProofError::Eigenvalues`] or [`ProofError::Resonance`] if the flow of a regime has no
    /// closed form that can be enclosed.
    ///
    /// # Panics
    /// If sizes do not match.
    pub fn new(
        period: Interval,
        frequencies: Vec<Interval>,
        regimes: Vec<RegimeParts>,
    ) -> Result<Self, ProofError> {
        let dimension = regimes.first().map_or(0, |r| r.matrix.rows());
        let regimes = regimes
            .into_iter()
            .enumerate()
            .map(|(r, parts)| Regime::new(r, parts, &frequencies))
            .collect::<Result<_, _>>()?;
        Ok(Self {
            dimension,
            period,
            frequencies,
            regimes,
            cancel: CancelFlag::default(),
        })
    }

    /// The same system with a cancellation flag: proofs end with [`ProofError::Cancelled`] once it
    /// is set.
    #[must_use]
    pub fn cancelled_by(mut self, cancel: CancelFlag) -> Self {
        self.cancel = cancel;
        self
    }

    /// Returns an error if the flag is set.
    pub(crate) fn check_cancel(&self) -> Result<(), ProofError> {
        if self.cancel.is_cancelled() {
            Err(ProofError::Cancelled)
        } else {
            Ok(())
        }
    }

    /// Returns the dimension d of the state.
    pub const fn dimension(&self) -> usize {
        self.dimension
    }

    /// Returns an enclosure of the drive period T, in the system's unit of time.
    pub const fn period(&self) -> Interval {
        self.period
    }

    /// Returns the angular frequencies of the tones, in rad per unit of time.
    pub fn frequencies(&self) -> &[Interval] {
        &self.frequencies
    }

    /// Returns the definitions of the regimes.
    pub fn regimes(&self) -> impl ExactSizeIterator<Item = &RegimeParts> {
        self.regimes.iter().map(|regime| &regime.parts)
    }

    /// The phasors e^{iω_k t} of the tones at `time`.
    pub(crate) fn phasors(&self, time: Interval) -> Vec<Rectangle> {
        let turn = |&w: &Interval| Rectangle::imaginary(w * time).exp();
        self.frequencies.iter().map(turn).collect()
    }
}

impl Regime {
    fn new(index: usize, parts: RegimeParts, frequencies: &[Interval]) -> Result<Self, ProofError> {
        let basis =
            Eigenbasis::of(&parts.matrix).ok_or(ProofError::Eigenvalues { regime: index })?;
        let response = forced(&basis, &parts.forcing, frequencies)
            .ok_or(ProofError::Resonance { regime: index })?;
        let mut regime = Self {
            parts,
            basis,
            response,
            guards: Vec::new(),
        };
        regime.guards = regime
            .parts
            .transitions
            .iter()
            .map(|transition| regime.project(&transition.guard))
            .collect();
        Ok(regime)
    }

    fn project(&self, output: &Output) -> ModalOutput {
        let complex: Vec<Rectangle> = output.row.iter().map(|&x| x.into()).collect();
        let tones = output.tones.iter().zip(&self.response.tones);
        ModalOutput {
            weights: (0..self.basis.values.len())
                .map(|k| dot(&complex, &self.basis.right.column(k)))
                .collect(),
            constant: output.constant + dot(&output.row, &self.response.constant),
            tones: tones.map(|(&z, p)| z + dot(&complex, p)).collect(),
        }
    }

    /// The time derivative ẋ of the state.
    pub(crate) fn field(&self, state: &[Interval], phasors: &[Rectangle]) -> Vec<Interval> {
        let forcing = self.parts.forcing.at(phasors);
        let linear = self.parts.matrix.apply(state);
        linear.iter().zip(forcing).map(|(&a, f)| a + f).collect()
    }

    /// Modal coordinates of the difference of a state from the forced response.
    pub(crate) fn modal(&self, state: &[Interval], phasors: &[Rectangle]) -> Vec<Rectangle> {
        let forced = self.response.at(phasors);
        let difference: Vec<Rectangle> = state
            .iter()
            .zip(forced)
            .map(|(&x, p)| Rectangle::real(x - p))
            .collect();
        self.basis.left.apply(&difference)
    }

    /// The factors e^{λ_k s} of the modal coordinates over a time s.
    pub(crate) fn factors(&self, duration: Interval) -> Vec<Rectangle> {
        let values = self.basis.values.iter();
        values.map(|&z| z.scale(duration).exp()).collect()
    }

    /// The state with these modal coordinates at the time of the phasors.
    pub(crate) fn state(&self, modal: &[Rectangle], phasors: &[Rectangle]) -> Vec<Interval> {
        let forced = self.response.at(phasors);
        (0..forced.len())
            .map(|i| dot(self.basis.right.row(i), modal).re + forced[i])
            .collect()
    }

    /// The state a time `since` after `state`, if no guard falls to zero between, with the phasors
    /// of both times.
    pub(crate) fn after(
        &self,
        (state, start): (&[Interval], &[Rectangle]),
        (since, end): (Interval, &[Rectangle]),
    ) -> Vec<Interval> {
        let mut modal = self.modal(state, start);
        for (q, factor) in modal.iter_mut().zip(self.factors(since)) {
            *q = *q * factor;
        }
        self.state(&modal, end)
    }

    /// The derivative of the state after a time by the initial state, Re(R e^{λs} L).
    pub(crate) fn propagator(&self, factors: &[Rectangle]) -> Matrix<Interval> {
        let (n, m) = (self.basis.right.rows(), factors.len());
        let turned = Matrix::from_fn(n, m, |i, k| self.basis.right[(i, k)] * factors[k]);
        Matrix::from_fn(n, n, |i, j| {
            (0..m)
                .map(|k| {
                    let (a, b) = (turned[(i, k)], self.basis.left[(k, j)]);
                    a.re * b.re - a.im * b.im
                })
                .sum()
        })
    }
}

/// The forced response, `None` at an undamped resonance.
fn forced(
    basis: &Eigenbasis,
    forcing: &HarmonicVector,
    frequencies: &[Interval],
) -> Option<HarmonicVector> {
    let n = forcing.constant.len();
    let paired = |k: usize| basis.values[k].im != Interval::ZERO;
    // Columns of pairs have the factor 2, which the sum over both members cancels.
    let half = |k: usize| Interval::point(if paired(k) { 0.5 } else { 1.0 });
    let solve = |rate: Rectangle, by: &[Rectangle]| -> Option<Vec<Rectangle>> {
        if by.iter().all(|z| *z == Rectangle::ZERO) {
            return Some(vec![Rectangle::ZERO; n]);
        }
        let mut response = vec![Rectangle::ZERO; n];
        for k in 0..basis.values.len() {
            for conjugate in [false, true] {
                if conjugate && !paired(k) {
                    continue;
                }
                let turned = |z: Rectangle| if conjugate { z.conj() } else { z };
                let row: Vec<Rectangle> = basis.left.row(k).iter().map(|&z| turned(z)).collect();
                let along = dot(&row, by);
                if along == Rectangle::ZERO {
                    continue;
                }
                let modal = along / (rate - turned(basis.values[k]));
                for (i, x) in response.iter_mut().enumerate() {
                    *x += turned(basis.right[(i, k)]).scale(half(k)) * modal;
                }
            }
        }
        response.iter().all(|z| z.is_finite()).then_some(response)
    };
    let constant: Vec<Rectangle> = forcing.constant.iter().map(|&x| x.into()).collect();
    Some(HarmonicVector {
        constant: solve(Rectangle::ZERO, &constant)?
            .iter()
            .map(|z| z.re)
            .collect(),
        tones: forcing
            .tones
            .iter()
            .zip(frequencies)
            .map(|(tone, &w)| solve(Rectangle::imaginary(w), tone))
            .collect::<Option<_>>()?,
    })
}

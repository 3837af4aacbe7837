//! The equations of cantilevers and oscillators with numbers that are intervals, for proofs.
//!
//! Every parameter is the interval of all decimal numbers that are read as its value
//! ([`Interval::decimal`]), wave numbers β_j come from an interval Newton step on
//! cos β + sech β = 0, and matrices, forcing and guards follow by the same formulas as the
//! plain ones, Eqs. (8)–(18), rounded outwards.

use nanotap_proof::{
    HarmonicVector, Interval, Matrix, Output, ProofError, Rectangle, RegimeParts, Reset, RigidStop,
    System, Transition,
};

use crate::beam::Modes;
use crate::cantilever::{Cantilever, CosineTerm};
use crate::contact::ContactLaw;
use crate::contact::law::{LinearForm, SampleResponse};
use crate::drive_form::Actuation;
use crate::oscillator::{Oscillator, Stop};
use crate::parameter::Parameter;

/// Why a case has no equations in intervals.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EnclosureError {
    /// Its flow has no closed form.
    #[error("the law `{law}` is nonlinear: only piecewise-linear motion is known in closed form")]
    NonlinearLaw {
        /// Names of the nonlinear laws, joined by ` + `.
        law: String,
    },
    /// The lever has measured higher modes, but proofs are of uniform beams.
    #[error("proofs are of uniform beams, and this one has measured higher modes")]
    MeasuredModes,
    /// The deflection is fed back to the lever, but proofs are of uniform beams.
    #[error("proofs are of uniform beams without feedback, and this one has Q control")]
    QControl,
    /// A force that jumps where contact begins.
    #[error(
        "proofs are of contact forces that begin at zero or with a damper, and that of a \
         \"{law}\" jumps by its adhesion"
    )]
    ForceJumps {
        /// Contact law whose force jumps where contact begins.
        law: ContactLaw,
    },
    /// A motion that was integrated step by step.
    #[error("the motion is not known in closed form")]
    NotPiecewiseLinear,
    /// A wave number could not be enclosed.
    #[error("the wave number of mode {mode} could not be enclosed")]
    WaveNumber {
        /// Number of the mode, counted from 1.
        mode: usize,
    },
    /// The flow could not be enclosed.
    #[error(transparent)]
    Flow(#[from] ProofError),
}

/// Coefficients of one mode in the equations.
struct EnclosedMode {
    /// Modal stiffness β⁴, dimensionless.
    stiffness: Interval,
    /// Tip deflection φ(1), dimensionless.
    tip: Interval,
    /// Integral ∫₀¹φ dξ over the beam.
    integral: Interval,
}

/// The equations of motion in the state (a, ȧ, s).
struct EnclosedBeam {
    modes: Vec<EnclosedMode>,
    /// Number of internal variables of the surface.
    memory: usize,
    tones: usize,
    frequencies: Vec<Interval>,
    /// The factor 1/(1 + 4N α1) in M⁻¹p = p/(1 + 4N α1).
    give: Interval,
    alpha1: Interval,
    alpha3: Interval,
    /// Height V_T of the tip over the undeformed surface.
    height: Output,
    /// Rate V̇_T of that height.
    height_rate: Output,
    /// Force along p and along I of each tone.
    drives: Vec<[Rectangle; 2]>,
}

/// The system of a cantilever in intervals.
///
/// # Errors
/// [`EnclosureError`] if the case is not piecewise linear, or cannot be enclosed.
pub fn enclosed(case: &Cantilever) -> Result<System, EnclosureError> {
    if let Some(law) = &case.law {
        return Err(EnclosureError::NonlinearLaw { law: law.name() });
    }
    if case.has_measured_modes() {
        return Err(EnclosureError::MeasuredModes);
    }
    if case.has_q_control() {
        return Err(EnclosureError::QControl);
    }
    if case.has_attractive_surface() {
        return Err(EnclosureError::ForceJumps { law: case.contact });
    }
    let law = case.contact_law(None);
    let beam = EnclosedBeam::new(case, law.internal)?;
    let recovers = law.onsets.is_some();
    let gap = beam.combined(&law.gap, exact);
    let hold = if recovers {
        beam.combined(&law.release_guard, derived)
    } else {
        scaled(&gap, -Interval::ONE)
    };
    let reset = law.release_reset.as_ref().map(|values| {
        let outputs: Vec<Output> = values.iter().map(|of| beam.combined(of, exact)).collect();
        beam.memory_jump(&outputs)
    });
    let begins = Transition {
        guard: gap,
        target: 1,
        reset: None,
        starts_at_zero: if recovers { Vec::new() } else { vec![(0, 1)] },
    };
    // A Kelvin–Voigt surface parts with gap and rate zero, any other with the gap alone.
    let ends = Transition {
        guard: hold,
        target: 0,
        reset,
        starts_at_zero: vec![(0, if recovers { 2 } else { 1 })],
    };
    let regimes = vec![
        beam.regime(&law.flight, begins),
        beam.regime(&law.contact, ends),
    ];
    let period = Interval::point(f64::from(2 * case.repetition())) * Interval::pi()
        / Interval::decimal(case.omega);
    Ok(System::new(period, beam.frequencies.clone(), regimes)?)
}

/// Builds the system of an oscillator in intervals: mẍ + cẋ + kx = F cos ωt before the stop, and
/// behind a soft one its spring and damper too. A rigid stop has impacts; for a mass that sticks to it
/// see [`enclosed_stop`].
///
/// # Errors
/// [`EnclosureError::Flow`] where its flow cannot be enclosed.
pub fn enclosed_oscillator(oscillator: &Oscillator) -> Result<System, EnclosureError> {
    let typed = Interval::decimal;
    let (zero, one) = (Interval::ZERO, Interval::ONE);
    let (mass, wall) = (typed(oscillator.mass), typed(oscillator.gap));
    let still = HarmonicVector {
        constant: vec![zero; 2],
        tones: vec![vec![Rectangle::ZERO; 2]],
    };
    let gap = Output {
        row: vec![-one, zero],
        constant: wall,
        tones: vec![Rectangle::ZERO],
    };
    let regime = |stiffness: Interval, damping: Interval, exit: Transition| {
        let k = typed(oscillator.stiffness) + stiffness;
        let c = typed(oscillator.damping) + damping;
        let rows = [[zero, one], [-k / mass, -c / mass]];
        RegimeParts {
            matrix: Matrix::from_fn(2, 2, |i, j| rows[i][j]),
            forcing: HarmonicVector {
                constant: vec![zero, stiffness * wall / mass],
                tones: vec![vec![
                    Rectangle::ZERO,
                    Rectangle::real(typed(oscillator.forcing) / mass),
                ]],
            },
            transitions: vec![exit],
        }
    };
    let exit = |guard: Output, target: usize, reset: Option<Reset>| Transition {
        guard,
        target,
        reset,
        starts_at_zero: vec![(0, 1)],
    };
    let regimes = match oscillator.stop {
        Stop::Soft { stiffness, damping } => {
            let back = scaled(&gap, -one);
            vec![
                regime(zero, zero, exit(gap, 1, None)),
                regime(typed(stiffness), typed(damping), exit(back, 0, None)),
            ]
        }
        Stop::Rigid { restitution } => {
            let rows = [[one, zero], [zero, -typed(restitution)]];
            let bounce = Reset {
                matrix: Matrix::from_fn(2, 2, |i, j| rows[i][j]),
                offset: still,
            };
            vec![regime(zero, zero, exit(gap, 0, Some(bounce)))]
        }
    };
    let omega = typed(oscillator.omega);
    let period = Interval::point(2.0) * Interval::pi() / omega;
    Ok(System::new(period, vec![omega], regimes)?)
}

/// Builds the rigid stop of an oscillator in intervals, for orbits that come to rest on it; `None` for
/// a soft one.
pub fn enclosed_stop(oscillator: &Oscillator) -> Option<RigidStop> {
    let Stop::Rigid { restitution } = oscillator.stop else {
        return None;
    };
    let typed = Interval::decimal;
    let mass = typed(oscillator.mass);
    let over_mass = |x: f64| typed(x) / mass;
    Some(RigidStop {
        place: typed(oscillator.gap),
        restitution: typed(restitution),
        pressure: Output {
            row: vec![
                -over_mass(oscillator.stiffness),
                -over_mass(oscillator.damping),
            ],
            constant: Interval::ZERO,
            tones: vec![Rectangle::real(over_mass(oscillator.forcing))],
        },
    })
}

/// β_j: Newton's operator maps an interval around the computed root into itself, so that it
/// holds just one root, which lies in the image.
fn wave_number(number: usize, approximate: f64) -> Option<Interval> {
    let around = Interval::around(approximate, 1e-12 * approximate);
    let sech = |beta: Interval| {
        let (_, cosh) = beta.sinh_cosh();
        Interval::ONE / cosh
    };
    let middle = Interval::point(approximate);
    let value = middle.sin_cos().1 + sech(middle);
    let (sinh, cosh) = around.sinh_cosh();
    let slope = -around.sin_cos().0 - sinh / cosh * sech(around);
    let newton = middle - value / slope;
    // Root j is the one between (j − 1)π and jπ.
    let pi = Interval::pi();
    let (from, to) = (number as f64 - 1.0, number as f64);
    let own = (newton - Interval::point(from) * pi).is_positive()
        && (Interval::point(to) * pi - newton).is_positive();
    (own && around.encloses(newton)).then_some(newton)
}

impl EnclosedMode {
    /// σ_j = (sinh β − sin β)/(cosh β + cos β) is tanh(β/2) of an odd root and coth(β/2) of
    /// an even one, as cos β = −sech β there.
    fn new(number: usize, approximate: f64) -> Result<Self, EnclosureError> {
        let beta =
            wave_number(number, approximate).ok_or(EnclosureError::WaveNumber { mode: number })?;
        let falling = (-beta).exp();
        let tanh = (Interval::ONE - falling) / (Interval::ONE + falling);
        let odd = number % 2 == 1;
        let sigma = if odd { tanh } else { Interval::ONE / tanh };
        Ok(Self {
            stiffness: beta.square().square(),
            tip: Interval::point(if odd { 2.0 } else { -2.0 }),
            integral: Interval::point(2.0) * sigma / beta,
        })
    }
}

/// Encloses a number of a law, which is 0, ±1 or a product or quotient of typed parameters and
/// their sums without cancellation: it is within 8 units of its last place.
fn derived(value: f64) -> Interval {
    if value == 0.0 {
        return Interval::ZERO;
    }
    let typed = Interval::decimal(value);
    typed + typed * Interval::around_zero(8.0 * f64::EPSILON)
}

/// Encloses a number of a law as [`derived`] does, but ±1 exactly, for numbers that are ±1 by
/// definition.
fn exact(value: f64) -> Interval {
    if value.abs() == 1.0 {
        Interval::point(value)
    } else {
        derived(value)
    }
}

fn scaled(output: &Output, factor: Interval) -> Output {
    Output {
        row: output.row.iter().map(|&x| x * factor).collect(),
        constant: output.constant * factor,
        tones: output.tones.iter().map(|z| z.scale(factor)).collect(),
    }
}

fn sum(a: &Output, b: &Output) -> Output {
    Output {
        row: a.row.iter().zip(&b.row).map(|(&a, &b)| a + b).collect(),
        constant: a.constant + b.constant,
        tones: a.tones.iter().zip(&b.tones).map(|(&a, &b)| a + b).collect(),
    }
}

impl EnclosedBeam {
    fn new(case: &Cantilever, memory: usize) -> Result<Self, EnclosureError> {
        let typed = Interval::decimal;
        let approximate = Modes::shared(case.modes)
            .map_err(|_| EnclosureError::WaveNumber { mode: case.modes })?;
        let modes = approximate
            .iter()
            .map(|mode| EnclosedMode::new(mode.number, mode.beta))
            .collect::<Result<Vec<_>, _>>()?;
        let count = modes.len();
        let (omega, alpha1, alpha3) = (typed(case.omega), typed(case.alpha1), typed(case.alpha3));
        let mut frequencies = vec![omega];
        // s sin wτ + c cos wτ = Re((c − i s) e^{iwτ}); a phase turns it.
        let sine = |s: Interval, c: Interval| Rectangle::new(c, -s);
        let mut amplitudes = vec![(typed(case.alpha2), Rectangle::ONE)];
        for (ratio, [amplitude, phase]) in case.further_tones.iter().zip(Parameter::TONES) {
            let [p, q] = [ratio.numerator(), ratio.denominator()];
            frequencies.push(omega * Interval::point(f64::from(p)) / Interval::point(f64::from(q)));
            let degrees = typed(case.get(phase));
            let phase = degrees * Interval::pi() / Interval::point(180.0);
            let turn = Rectangle::imaginary(phase).exp();
            amplitudes.push((typed(case.get(amplitude)), turn));
        }
        let mut gap_tones = Vec::new();
        let mut drives = Vec::new();
        for ((amplitude, turn), &rate) in amplitudes.into_iter().zip(&frequencies) {
            let zero = Interval::ZERO;
            let one = sine(amplitude, zero) * turn;
            let (tip, spread, gap) = match case.actuation {
                Actuation::Base => {
                    let inertia = amplitude * rate.square();
                    let drag = match case.cosine_term {
                        CosineTerm::Corrected => amplitude * alpha3 * rate,
                        CosineTerm::Printed => amplitude * alpha3,
                    };
                    (
                        sine(alpha1 * inertia, zero) * turn,
                        sine(inertia, -drag) * turn,
                        one,
                    )
                }
                Actuation::Tip => (one, Rectangle::ZERO, Rectangle::ZERO),
                Actuation::Distributed => (Rectangle::ZERO, one, Rectangle::ZERO),
            };
            drives.push([tip, spread]);
            gap_tones.push(gap);
        }
        let size = 2 * count + memory;
        let tip_row = |block: usize| {
            let mut row = vec![Interval::ZERO; size];
            for (j, mode) in modes.iter().enumerate() {
                row[block * count + j] = mode.tip;
            }
            row
        };
        let rate_tones = gap_tones.iter().zip(&frequencies);
        let height_rate = Output {
            row: tip_row(1),
            constant: Interval::ZERO,
            tones: rate_tones
                .map(|(&z, &w)| z * Rectangle::imaginary(w))
                .collect(),
        };
        // M = 1 + α1 p pᵀ, pᵀp = 4N: M⁻¹p = p/(1 + 4N α1).
        let give = Interval::ONE / (Interval::ONE + Interval::point(4.0 * count as f64) * alpha1);
        Ok(Self {
            height: Output {
                row: tip_row(0),
                constant: typed(case.alpha5),
                tones: gap_tones,
            },
            height_rate,
            memory,
            tones: frequencies.len(),
            frequencies,
            give,
            alpha1,
            alpha3,
            drives,
            modes,
        })
    }

    fn size(&self) -> usize {
        2 * self.modes.len() + self.memory
    }

    /// M⁻¹ = 1 − α1 p pᵀ/(1 + 4N α1), times a vector.
    fn over_mass(&self, vector: &[Rectangle]) -> Vec<Rectangle> {
        let along: Rectangle = self
            .modes
            .iter()
            .zip(vector)
            .map(|(mode, z)| z.scale(mode.tip))
            .sum();
        let taken = along.scale(self.alpha1 * self.give);
        let each = self.modes.iter().zip(vector);
        each.map(|(mode, &z)| z - taken.scale(mode.tip)).collect()
    }

    fn combined(&self, form: &LinearForm, number: fn(f64) -> Interval) -> Output {
        let mut output = sum(
            &scaled(&self.height, number(form.height.value)),
            &scaled(&self.height_rate, number(form.rate.value)),
        );
        let variables = &mut output.row[2 * self.modes.len()..];
        for (factor, of) in variables.iter_mut().zip(&form.internal) {
            *factor += number(of.value);
        }
        output
    }

    fn regime(&self, response: &SampleResponse, exit: Transition) -> RegimeParts {
        let (n, size) = (self.modes.len(), self.size());
        let mut matrix = Matrix::zeros(size, size);
        let mut constant = vec![Interval::ZERO; size];
        let mut tones = vec![vec![Rectangle::ZERO; size]; self.tones];
        for j in 0..n {
            matrix[(j, n + j)] = Interval::ONE;
            let unit = |size: Interval| -> Vec<Rectangle> {
                let mut unit = vec![Rectangle::ZERO; n];
                unit[j] = Rectangle::real(size);
                self.over_mass(&unit)
            };
            let springs = unit(self.modes[j].stiffness);
            let dampers = unit(self.alpha3);
            for i in 0..n {
                matrix[(n + i, j)] = -springs[i].re;
                matrix[(n + i, n + j)] = -dampers[i].re;
            }
        }
        for (tone, [tip, spread]) in tones.iter_mut().zip(&self.drives) {
            let force: Vec<Rectangle> = self
                .modes
                .iter()
                .map(|mode| tip.scale(mode.tip) + spread.scale(mode.integral))
                .collect();
            tone[n..2 * n].copy_from_slice(&self.over_mass(&force));
        }
        // The force acts along M⁻¹p, and internal variables change by themselves.
        let force = self.combined(&response.force, derived);
        let mut rows: Vec<(usize, Interval, Output)> = (0..n)
            .map(|i| (n + i, self.modes[i].tip * self.give, force.clone()))
            .collect();
        rows.extend(response.rates.iter().enumerate().map(|(k, rate)| {
            let rate = self.combined(rate, derived);
            (2 * n + k, Interval::ONE, rate)
        }));
        for (i, factor, output) in rows {
            for (j, &x) in output.row.iter().enumerate() {
                matrix[(i, j)] += factor * x;
            }
            constant[i] += factor * output.constant;
            for (tone, z) in tones.iter_mut().zip(&output.tones) {
                tone[i] += z.scale(factor);
            }
        }
        RegimeParts {
            matrix,
            forcing: HarmonicVector { constant, tones },
            transitions: vec![exit],
        }
    }

    /// The internal variables become `values`, and nothing else changes.
    fn memory_jump(&self, values: &[Output]) -> Reset {
        let size = self.size();
        let mut matrix = Matrix::identity(size);
        let mut offset = HarmonicVector {
            constant: vec![Interval::ZERO; size],
            tones: vec![vec![Rectangle::ZERO; size]; self.tones],
        };
        for (at, value) in (2 * self.modes.len()..).zip(values) {
            for (j, &x) in value.row.iter().enumerate() {
                matrix[(at, j)] = x;
            }
            offset.constant[at] = value.constant;
            for (tone, &z) in offset.tones.iter_mut().zip(&value.tones) {
                tone[at] = z;
            }
        }
        Reset { matrix, offset }
    }
}

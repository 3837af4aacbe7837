//! The beam's equations of motion as regimes of a piecewise-linear system: the free beam,
//! and the sample's force at its tip as a contact law has it.
//!
//! Every regime is the free beam's with `M⁻¹p f` added to its accelerations, where the
//! force f is a linear form of the tip's height V_T, its rate and the surface's internal variables.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, RowDVector};
use nanotap_flow::sensitivity::RegimeTangent;
use nanotap_flow::{
    Complex, Drive, FlowError, HarmonicVector, Output, Reset, SpectralBasis, System, Transition,
};

use crate::cantilever::CosineTerm;
use crate::contact::dual::Dual;
use crate::contact::law::{Bilinear, Law, LinearForm, SampleResponse};
use crate::drive_form::Actuation;
use crate::galerkin::{Forcing, Galerkin, Gap, Regime};
use crate::measured_modes::Correction;
use crate::parameter::Parameter;
use crate::spectrum::{TipLoad, eigenbasis};
use crate::{BeamOutputs, MemoryReset, Powers, Product};

/// The free beam in the state (a, ȧ, s), ready for a sample.
pub(crate) struct Beam<'a> {
    galerkin: &'a Galerkin,
    drive: &'a Drive,
    layout: Layout,
    solve: Solve,
    /// `ẋ = A x + f` in flight, the memory's row zero.
    matrix: DMatrix<f64>,
    forcing: HarmonicVector,
    /// Derivative of ẋ with respect to a force at the tip: M⁻¹p at the velocities, else 0.
    kick: DVector<f64>,
    /// Height V_T of the tip over the undeformed surface, and its rate V̇_T.
    height: Output,
    height_rate: Output,
}

/// Outputs of a beam with its sample; see the fields of [`Model`](crate::Model).
pub(crate) struct Outputs {
    pub(crate) tip: Output,
    pub(crate) gap: Output,
    pub(crate) height: Output,
    pub(crate) force: Vec<Output>,
    pub(crate) beam: BeamOutputs,
    pub(crate) memory_reset: Option<MemoryReset>,
}

/// Layout of a state: modes, their velocities, internal variables of the surface.
#[derive(Clone, Copy)]
struct Layout {
    modes: usize,
    memory: usize,
    tones: usize,
}

impl Layout {
    const fn dimension(self) -> usize {
        2 * self.modes + self.memory
    }

    /// Weights of the displacements (`block` 0) or velocities (`block` 1).
    fn row(self, weights: &DVector<f64>, block: usize) -> Output {
        let mut row = RowDVector::zeros(self.dimension());
        row.columns_mut(block * self.modes, self.modes)
            .tr_copy_from(weights);
        Output::linear(row, self.tones)
    }

    /// `factors` times the internal variables of the surface.
    fn internal(self, factors: impl Iterator<Item = f64>) -> Output {
        let mut row = RowDVector::zeros(self.dimension());
        for (of, factor) in row.iter_mut().skip(2 * self.modes).zip(factors) {
            *of = factor;
        }
        Output::linear(row, self.tones)
    }

    /// The direction of each internal variable in the state.
    fn units(self) -> impl Iterator<Item = DVector<f64>> {
        (2 * self.modes..self.dimension()).map(move |at| {
            let mut unit = DVector::zeros(self.dimension());
            unit[at] = 1.0;
            unit
        })
    }

    /// A vector at the velocities.
    fn at_velocities(self, v: &DVector<f64>) -> DVector<f64> {
        let mut state = DVector::zeros(self.dimension());
        state.rows_mut(self.modes, self.modes).copy_from(v);
        state
    }

    /// `[[0, 1], [−K, −C]]`, rows and columns of internal variables zero.
    fn companion(self, stiffness: &DMatrix<f64>, damping: &DMatrix<f64>) -> DMatrix<f64> {
        let (n, size) = (self.modes, self.dimension());
        let mut matrix = DMatrix::zeros(size, size);
        for i in 0..n {
            matrix[(i, n + i)] = 1.0;
            for j in 0..n {
                matrix[(n + i, j)] = -stiffness[(i, j)];
                matrix[(n + i, n + j)] = -damping[(i, j)];
            }
        }
        matrix
    }

    /// Accelerations as the forcing of the state equation.
    fn accelerations(self, of: &Forcing) -> HarmonicVector {
        let forcing = HarmonicVector::zeros(self.dimension(), self.tones)
            .with_tone(
                0,
                &self.at_velocities(&of.sine),
                &self.at_velocities(&of.cosine),
            )
            .with_constant(&self.at_velocities(&of.constant));
        let further = of.further.iter().enumerate();
        further.fold(forcing, |forcing, (k, [sine, cosine])| {
            forcing.with_tone(
                k + 1,
                &self.at_velocities(sine),
                &self.at_velocities(cosine),
            )
        })
    }

    fn gap(self, gap: &Gap) -> Output {
        let output = self
            .row(&gap.tip, 0)
            .with_tone(0, gap.sine, gap.cosine)
            .with_constant(gap.constant);
        let further = gap.further.iter().enumerate();
        further.fold(output, |output, (k, [sine, cosine])| {
            output.with_tone(k + 1, *sine, *cosine)
        })
    }
}

/// `matrix + column · row`, and the same of the forcing.
fn add_force(
    matrix: &mut DMatrix<f64>,
    forcing: &mut HarmonicVector,
    column: &DVector<f64>,
    force: &Output,
) {
    matrix.ger(1.0, column, &force.row.transpose(), 1.0);
    forcing.constant.axpy(force.constant, column, 1.0);
    for (tone, z) in forcing.tones.iter_mut().zip(&force.tones) {
        *tone += column.map(|v| z * v);
    }
}

impl<'a> Beam<'a> {
    /// The free beam of `galerkin`, with this number of internal variables of the surface.
    pub(crate) fn new(
        galerkin: &'a Galerkin,
        drive: &'a Drive,
        memory: usize,
    ) -> Result<Self, FlowError> {
        let layout = Layout {
            modes: galerkin.modes.count(),
            memory,
            tones: drive.frequencies().len(),
        };
        let free = Regime::Free.index();
        let solve = Solve::new(galerkin)?;
        let matrix = layout.companion(
            &solve.matrix(&galerkin.stiffness[free]),
            &solve.matrix(&galerkin.damping[free]),
        );
        let forcing = layout.accelerations(&solve.forcing(&galerkin.forcing[free]));
        let kick = layout.at_velocities(&solve.vector(&galerkin.gap.tip));
        let height = layout.gap(&galerkin.gap);
        let height_rate = height.rate(&matrix, &forcing, drive);
        Ok(Self {
            galerkin,
            drive,
            layout,
            solve,
            matrix,
            forcing,
            kick,
            height,
            height_rate,
        })
    }

    /// Returns the height V_T of the tip over the undeformed surface, in units of g₀.
    pub(crate) const fn height(&self) -> &Output {
        &self.height
    }

    /// Returns the derivative of ẋ with respect to a force at the tip: M⁻¹p at the velocities, else
    /// 0.
    pub(crate) const fn kick(&self) -> &DVector<f64> {
        &self.kick
    }

    /// Returns the angular frequency Ω of the drive.
    pub(crate) const fn drive_frequency(&self) -> f64 {
        self.galerkin.case.omega
    }

    /// Returns the factor of the sample's force in the force with which a moving clamp pushes, see
    /// [`Beam::powers_in`]; 0 where the clamp is at rest.
    pub(crate) fn clamp_force(&self) -> f64 {
        if self.galerkin.case.actuation != Actuation::Base {
            return 0.0;
        }
        let modes = &self.galerkin.modes;
        let momentum = self.layout.row(&modes.integral, 1);
        let tip_speed = self.layout.row(&modes.tip, 1);
        let mut momentum = momentum.plus(self.galerkin.case.alpha1, &tip_speed);
        for each in &self.galerkin.corrections {
            let speed = self.layout.row(&each.row, 1);
            momentum = momentum.plus(each.mass.value * each.base.value, &speed);
        }
        (&momentum.row * &self.kick)[0] - 1.0
    }

    /// A linear form as an output.
    fn combined(&self, form: &LinearForm) -> Output {
        self.with_numbers(form, |dual| dual.value)
    }

    fn with_numbers(&self, form: &LinearForm, number: fn(Dual) -> f64) -> Output {
        let internal = form.internal.iter().map(|by| number(*by));
        self.height
            .scaled(number(form.height))
            .plus(number(form.rate), &self.height_rate)
            .plus(1.0, &self.layout.internal(internal))
            .with_constant(number(form.constant))
    }

    /// Builds one regime. `known` states that its spectrum is that of a beam with spring and damper
    /// at its tip, apart from the internal variables.
    pub(crate) fn regime(
        &self,
        regime: Regime,
        response: &SampleResponse,
        known: bool,
    ) -> Result<nanotap_flow::Regime, FlowError> {
        let r = regime.index();
        let (mut matrix, mut forcing) = (self.matrix.clone(), self.forcing.clone());
        add_force(
            &mut matrix,
            &mut forcing,
            &self.kick,
            &self.combined(&response.force),
        );
        for (unit, rate) in self.layout.units().zip(&response.rates) {
            add_force(&mut matrix, &mut forcing, &unit, &self.combined(rate));
        }
        let mut rates = response.rates.iter().enumerate();
        let decoupled = rates.all(|(k, rate)| rate.is_internal(k));
        if !known || !decoupled || !self.galerkin.corrections.is_empty() {
            return nanotap_flow::Regime::new(r, matrix, forcing, self.drive);
        }
        let case = &self.galerkin.case;
        let load = TipLoad::of(case, regime);
        let simple = eigenbasis(&self.galerkin.modes, case.alpha3, load);
        let basis = if let Some(basis) = simple {
            basis
        } else {
            // (Nearly) critical damping has no basis of eigenvectors; the general
            // decomposition groups what belongs together.
            let n = 2 * self.layout.modes;
            let beam = matrix.view((0, 0), (n, n)).into_owned();
            Arc::new(SpectralBasis::of(&beam, self.drive.period(), r)?.into())
        };
        let decays = response.rates.iter().enumerate();
        let basis = decays.fold(basis, |basis, (k, rate)| {
            let rate = rate.internal[k].value;
            Arc::new(with_decaying_variable(basis.basis().clone(), rate).into())
        });
        nanotap_flow::Regime::with_basis(r, matrix, forcing, self.drive, basis)
    }

    /// Returns the transitions out of flight, and those out of contact.
    pub(crate) fn transitions(&self, law: &Law) -> Vec<Vec<Transition>> {
        let mut begins = Transition::new(self.combined(&law.gap), 1);
        let mut ends = Transition::new(self.combined(&law.release_guard), 0);
        if let Some([met, left]) = law.onsets {
            begins = begins.with_onset(met);
            ends = ends.with_onset(left);
        }
        if let Some(values) = &law.release_reset {
            let outputs = values.iter().map(|value| self.combined(value));
            ends = ends.with_reset(self.memory_jump(outputs, 1.0));
        }
        vec![vec![begins], vec![ends]]
    }

    /// A jump of the internal variables to `values`, the rest of the state times `rest`.
    pub(crate) fn memory_jump(&self, values: impl Iterator<Item = Output>, rest: f64) -> Reset {
        let size = self.layout.dimension();
        let mut matrix = DMatrix::from_diagonal_element(size, size, rest);
        let mut offset = HarmonicVector::zeros(size, self.layout.tones);
        for (at, value) in (2 * self.layout.modes..).zip(values) {
            matrix.row_mut(at).copy_from(&value.row);
            offset.constant[at] = value.constant;
            for (tone, z) in offset.tones.iter_mut().zip(&value.tones) {
                tone[at] = *z;
            }
        }
        Reset { matrix, offset }
    }

    /// Returns the outputs of the beam on its sample, with a force for each of the `regimes`
    /// regimes.
    pub(crate) fn outputs(&self, law: &Law, regimes: usize) -> Outputs {
        let modes = &self.galerkin.modes;
        Outputs {
            tip: self.layout.row(&modes.tip, 0),
            gap: self.combined(&law.gap),
            height: self.height.clone(),
            force: [&law.flight, &law.contact]
                .into_iter()
                .take(regimes)
                .map(|response| self.combined(&response.force))
                .collect(),
            beam: BeamOutputs {
                modes: Arc::clone(modes),
                slope: self.layout.row(&modes.tip_slope, 0),
                base: self.base(),
            },
            memory_reset: law.release_reset.as_ref().map(|_| MemoryReset {
                rate: law.flight.rates[0].internal[0].value,
                // Contact begins with the force −α6 ġ, and ġ contains −ṡ: a state that
                // comes δs/ġ later has missed α6 δs of momentum.
                kick: &self.kick * -law.contact.force.rate.value,
            }),
        }
    }

    /// The drive itself, α2 sin Ωτ and the further tones, or α2 times the signal.
    fn drive_output(&self) -> Output {
        let case = &self.galerkin.case;
        let still = self.layout.internal(std::iter::empty());
        if let Some(signal) = &case.signal {
            let tones = signal.tones.iter().enumerate();
            let mean = still.with_constant(signal.mean);
            let drive = tones.fold(mean, |drive, (k, (_, z))| drive.with_tone(k, -z.im, z.re));
            return drive.scaled(case.alpha2);
        }
        let drive = still.with_tone(0, case.alpha2, 0.0);
        (0..case.further_tones.len()).fold(drive, |drive, k| {
            let [amplitude, phase] = Parameter::TONES[k].map(|of| case.get(of));
            let (sin, cos) = nanotap_arithmetic::sin_cos(phase.to_radians());
            drive.with_tone(k + 1, amplitude * cos, amplitude * sin)
        })
    }

    /// Displacement of the base: the drive, if it acts there.
    fn base(&self) -> Output {
        let moves = self.galerkin.case.actuation == Actuation::Base;
        self.drive_output().scaled(f64::from(u8::from(moves)))
    }

    /// Energy flows in each regime.
    pub(crate) fn powers(&self, law: &Law, system: &System) -> Vec<Powers> {
        let regimes = system.regimes().iter().zip([&law.flight, &law.contact]);
        regimes
            .map(|(regime, response)| self.powers_in(regime, response))
            .collect()
    }

    /// Energy flows in one regime, in the frame of the resting sample. With y = α2 sin Ωτ,
    /// the clamp pushes with R = d/dτ(I·ȧ + ẏ + α1(p·ȧ + ẏ)) + α3(I·ȧ + ẏ) − f and
    /// delivers R ẏ (a drive on the lever itself its force times the speed there, and y = 0);
    /// the beam's damping, which acts on the velocity of the beam
    /// through the medium, takes α3 ∫(Ẇ + ẏ)² dξ; the sample takes and stores what its law
    /// says. The printed Eq. (14) is a further force on the modes, whose work counts as the
    /// drive's.
    fn powers_in(&self, flow: &nanotap_flow::Regime, response: &SampleResponse) -> Powers {
        let (case, modes) = (&self.galerkin.case, &self.galerkin.modes);
        let (base, force) = (self.base(), self.combined(&response.force));
        let rate = |o: &Output| o.rate(flow.matrix(), flow.forcing(), self.drive);
        let base_rate = rate(&base);
        let integral = self.layout.row(&modes.integral, 1);
        let tip_speed = self.layout.row(&modes.tip, 1).plus(1.0, &base_rate);
        let mean_speed = integral.plus(1.0, &base_rate);
        let mut momentum = mean_speed.plus(case.alpha1, &tip_speed);
        let mut drag = mean_speed.scaled(case.alpha3);
        let corrections = &self.galerkin.corrections;
        let speeds: Vec<Output> = corrections
            .iter()
            .map(|each| self.speed(each, &base_rate))
            .collect();
        for (each, speed) in corrections.iter().zip(&speeds) {
            momentum = momentum.plus(each.mass.value * each.base.value, speed);
            drag = drag.plus(each.damping.value * each.base.value, speed);
        }
        let clamp = rate(&momentum).plus(1.0, &drag).plus(-1.0, &force);
        let product = |weight, a: &Output, b: &Output| Product {
            weight,
            a: a.clone(),
            b: b.clone(),
        };
        let tip_rate = self.layout.row(&modes.tip, 1);
        let mut drive = vec![match case.actuation {
            Actuation::Base => product(1.0, &clamp, &base_rate),
            Actuation::Tip => product(1.0, &self.drive_output(), &tip_rate),
            Actuation::Distributed => {
                let rate = self.layout.row(&modes.even_load, 1);
                product(1.0, &self.drive_output(), &rate)
            }
        }];
        if case.cosine_term == CosineTerm::Printed && case.actuation == Actuation::Base {
            // Printed minus corrected: of each tone −A α3 (1 − w) I cos(wτ + θ), acting on ȧ.
            let mut extra = base.clone();
            for (z, w) in extra.tones.iter_mut().zip(self.drive.frequencies()) {
                // From sine to cosine is a quarter turn.
                *z *= Complex::new(0.0, -case.alpha3 * (1.0 - w));
            }
            drive.push(product(1.0, &extra, &integral));
        }
        let unit = |j: usize, block: usize| {
            let mut unit = DVector::zeros(case.modes);
            unit[j] = 1.0;
            self.layout.row(&unit, block)
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
        let mut beam: Vec<Product> = weighted(case.alpha3).collect();
        for (each, speed) in corrections.iter().zip(&speeds) {
            let bent = self.layout.row(&each.row, 0);
            stored.push(product(0.5 * each.mass.value, speed, speed));
            stored.push(product(0.5 * each.stiffness.value, &bent, &bent));
            beam.push(product(each.damping.value, speed, speed));
        }
        Powers {
            drive,
            beam,
            sample: self.products(response.dissipated.iter()).collect(),
            stored,
            stored_by_sample: self.products(response.stored.iter()).collect(),
        }
    }

    /// Returns the rate of a measured mode, the part that moves with the base included.
    fn speed(&self, of: &Correction, base_rate: &Output) -> Output {
        let own = self.layout.row(&of.row, 1);
        own.plus(of.base.value, base_rate)
    }

    fn products<'b>(
        &'b self,
        terms: impl Iterator<Item = &'b Bilinear> + 'b,
    ) -> impl Iterator<Item = Product> + 'b {
        terms.map(|term| Product {
            weight: term.weight,
            a: self.combined(&term.one),
            b: self.combined(&term.other),
        })
    }

    /// Computes the derivative of the beam with respect to a parameter.
    pub(crate) fn derivative(&self, parameter: Parameter) -> BeamTangent {
        let derivative = self.galerkin.derivative(parameter);
        let free = Regime::Free.index();
        let solve = &self.solve;
        // ∂(M⁻¹K) = M⁻¹(∂K − ∂M M⁻¹K), and so on.
        let of_matrix = |change: &DMatrix<f64>, of: &DMatrix<f64>| {
            solve.matrix(&(change - &derivative.mass * solve.matrix(of)))
        };
        let of_vector = |change: &DVector<f64>, of: &DVector<f64>| {
            solve.vector(&(change - &derivative.mass * solve.vector(of)))
        };
        let galerkin = self.galerkin;
        let mut matrix = self.layout.companion(
            &of_matrix(&derivative.stiffness[free], &galerkin.stiffness[free]),
            &of_matrix(&derivative.damping[free], &galerkin.damping[free]),
        );
        let n = self.layout.modes;
        matrix.view_mut((0, n), (n, n)).fill(0.0);
        let (df, f) = (&derivative.forcing[free], &galerkin.forcing[free]);
        let forcing = self.layout.accelerations(&Forcing {
            sine: of_vector(&df.sine, &f.sine),
            cosine: of_vector(&df.cosine, &f.cosine),
            constant: of_vector(&df.constant, &f.constant),
            further: df
                .further
                .iter()
                .zip(&f.further)
                .map(|(df, f)| [0, 1].map(|k| of_vector(&df[k], &f[k])))
                .collect(),
        });
        let height = self.layout.gap(&derivative.gap);
        let mut height_rate = self.layout.row(&derivative.gap.tip, 1);
        // ∂(iω z) = iω ∂z + i ∂ω z, and every tone's ω goes with Ω.
        let log_omega = if parameter == Parameter::Omega {
            1.0 / galerkin.case.omega
        } else {
            0.0
        };
        for (k, rate) in height_rate.tones.iter_mut().enumerate() {
            let turn = Complex::new(0.0, self.drive.frequencies()[k]);
            *rate = turn * (height.tones[k] + self.height.tones[k] * log_omega);
        }
        let zero = DVector::zeros(n);
        let kick = self
            .layout
            .at_velocities(&of_vector(&zero, &galerkin.gap.tip));
        BeamTangent {
            matrix,
            forcing,
            kick,
            height,
            height_rate,
        }
    }
}

/// The derivative of a [`Beam`] with respect to one parameter, at constant drive phase.
pub(crate) struct BeamTangent {
    matrix: DMatrix<f64>,
    forcing: HarmonicVector,
    kick: DVector<f64>,
    height: Output,
    height_rate: Output,
}

impl BeamTangent {
    /// Returns the derivative of the forcing f in flight.
    pub(crate) const fn forcing(&self) -> &HarmonicVector {
        &self.forcing
    }

    /// Returns the derivative of the height V_T of the tip.
    pub(crate) const fn height(&self) -> &Output {
        &self.height
    }

    /// The derivative of a linear form.
    pub(crate) fn combined(&self, beam: &Beam<'_>, form: &LinearForm) -> Output {
        beam.with_numbers(form, Dual::derivative)
            .plus(form.height.value, &self.height)
            .plus(form.rate.value, &self.height_rate)
    }

    /// Consumes the tangent and returns the derivative of the height V_T.
    pub(crate) fn into_height(self) -> Output {
        self.height
    }

    /// Returns the derivative of the displacement of the base, which is a part of the tip's height;
    /// 0 where the base is at rest.
    pub(crate) fn base(&self, beam: &Beam<'_>) -> Output {
        let mut base = self.height.scaled(0.0);
        if beam.galerkin.case.actuation == Actuation::Base {
            base.tones.clone_from(&self.height.tones);
        }
        base
    }

    /// The derivatives of the factors of the beam's damping power, in the order of
    /// [`Powers::beam`]: α3 ȧ_j and ȧ_j of every mode, α3 ẏ and 2 I·ȧ + ẏ; then those of measured
    /// modes.
    pub(crate) fn beam_power(&self, beam: &Beam<'_>, parameter: Parameter) -> Vec<[Output; 2]> {
        let (layout, case) = (beam.layout, &beam.galerkin.case);
        let by = f64::from(u8::from(parameter == Parameter::Alpha3));
        let mut base_rate = self.base(beam);
        let mut moving = base_rate.clone();
        if case.actuation == Actuation::Base {
            // Of the rates of V_T only the base's have tones.
            moving.tones.clone_from(&beam.height_rate.tones);
            base_rate.tones.clone_from(&self.height_rate.tones);
        }
        let unit = |j: usize| {
            let mut unit = DVector::zeros(case.modes);
            unit[j] = by;
            layout.row(&unit, 1)
        };
        let zero = base_rate.scaled(0.0);
        let mut of_measured = Vec::new();
        let mut factors: Vec<[Output; 2]> =
            (0..case.modes).map(|j| [unit(j), zero.clone()]).collect();
        for each in Correction::all(case, &beam.galerkin.modes, Some(parameter)) {
            let speed = beam.speed(&each, &moving);
            let change = layout
                .row(&each.row_change, 1)
                .plus(each.base.derivative(), &moving)
                .plus(each.base.value, &base_rate);
            let weighted = speed.scaled(each.damping.derivative());
            of_measured.push([weighted.plus(each.damping.value, &change), change]);
        }
        factors.push([moving.scaled(by).plus(case.alpha3, &base_rate), base_rate]);
        factors.append(&mut of_measured);
        factors
    }

    /// The derivative of a regime.
    pub(crate) fn regime(&self, beam: &Beam<'_>, response: &SampleResponse) -> RegimeTangent {
        let (mut matrix, mut forcing) = (self.matrix.clone(), self.forcing.clone());
        let mut add = |column: &DVector<f64>, force: &Output| {
            add_force(&mut matrix, &mut forcing, column, force);
        };
        add(&self.kick, &beam.combined(&response.force));
        add(&beam.kick, &self.combined(beam, &response.force));
        for (unit, rate) in beam.layout.units().zip(&response.rates) {
            add(&unit, &self.combined(beam, rate));
        }
        RegimeTangent { matrix, forcing }
    }
}

/// Cholesky factor of the mass matrix M, for products with M⁻¹.
struct Solve {
    mass: nalgebra::Cholesky<f64, nalgebra::Dyn>,
}

impl Solve {
    fn new(galerkin: &Galerkin) -> Result<Self, FlowError> {
        let mass = galerkin.mass.clone().cholesky();
        mass.map(|mass| Self { mass }).ok_or(FlowError::NotFinite {
            what: "the mass matrix",
        })
    }

    fn matrix(&self, of: &DMatrix<f64>) -> DMatrix<f64> {
        self.mass.solve(of)
    }

    fn vector(&self, of: &DVector<f64>) -> DVector<f64> {
        self.mass.solve(of)
    }

    fn forcing(&self, of: &Forcing) -> Forcing {
        Forcing {
            sine: self.vector(&of.sine),
            cosine: self.vector(&of.cosine),
            constant: self.vector(&of.constant),
            further: of
                .further
                .iter()
                .map(|tone| [0, 1].map(|k| self.vector(&tone[k])))
                .collect(),
        }
    }
}

/// The basis of a beam's regime with one more state, which decays at `rate` by itself.
fn with_decaying_variable(basis: SpectralBasis, rate: f64) -> SpectralBasis {
    let (n, m) = basis.right.shape();
    let zero = Complex::new(0.0, 0.0);
    let one = Complex::new(1.0, 0.0);
    let mut eigenvalues = basis.eigenvalues;
    eigenvalues.push(Complex::new(rate, 0.0));
    let mut right = basis.right.resize(n + 1, m + 1, zero);
    let mut left = basis.left.resize(m + 1, n + 1, zero);
    right[(n, m)] = one;
    left[(m, n)] = one;
    SpectralBasis {
        eigenvalues,
        right,
        left,
        clusters: basis.clusters,
    }
}

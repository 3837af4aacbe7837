//! Derivatives of a run by its initial state and by parameters.
//!
//! On a step the variations of the forces obey the step's own equations linearised, so the
//! matrix that Newton factored serves with one more right-hand side a column. At a switch the
//! variation jumps by the saltation matrix. Next to a switch at which the force has an
//! infinite slope the variation is taken at fixed distance from the switch instead of at
//! fixed time: there it is as smooth as the force itself.

use crate::flow::{Flow, Observer, Switch};
use crate::kernel::CHECKS;
use crate::law::{Exit, Guard};
use crate::linear::add_product;
use crate::step::{Solver, Step};
use crate::system::{Response, System};
use crate::{Complex, VolterraError};
use nalgebra::{DMatrix, DVector};

/// The derivative of a system with respect to a parameter; quantities that are not named are
/// constant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parameter {
    /// Changes of the law's parameters, in their own units per unit of the parameter (empty: none).
    pub law: Vec<f64>,
    /// Change of the gap's offset, in the unit of the gap per unit of the parameter.
    pub offset: f64,
    /// Changes of the constant forcing, of the length of the state, in units of `ẋ` per unit of the
    /// parameter (empty: none).
    pub constant: Vec<f64>,
    /// Changes of the tones, one per tone (empty: none).
    pub tones: Vec<ToneChange>,
}

/// The derivative of a tone with respect to a parameter.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ToneChange {
    /// Change of its angular frequency, in radians per unit of time, per unit of the parameter.
    pub frequency: f64,
    /// Changes of its forcing, of the length of the state, per unit of the parameter (empty: none).
    pub forcing: Vec<Complex>,
    /// Change of its complex amplitude in the gap, in the unit of the gap per unit of the
    /// parameter.
    pub gap: Complex,
}

impl Parameter {
    /// Creates the derivative by the offset of the gap.
    pub fn offset() -> Self {
        Self {
            offset: 1.0,
            ..Self::default()
        }
    }

    /// Creates the derivative by parameter number `index` of the system's law.
    pub fn of_law(system: &System, index: usize) -> Self {
        let mut law = vec![0.0; system.law().parameters().len()];
        if let Some(entry) = law.get_mut(index) {
            *entry = 1.0;
        }
        Self {
            law,
            ..Self::default()
        }
    }
}

/// The derivative of the linear forced motion with respect to a parameter.
#[derive(Clone, Debug)]
pub(crate) struct Forced {
    law: Vec<f64>,
    gap_constant: f64,
    /// Modal coordinates: the constant, and for each tone the parts that grow like `1` and like
    /// `t`.
    pub(crate) constant: DVector<f64>,
    pub(crate) tones: Vec<[DVector<Complex>; 2]>,
    /// Change of each tone's angular frequency.
    pub(crate) frequencies: Vec<f64>,
    /// Changes of the gap's tones: the parts that grow like `1` and like `t`.
    gap_tones: Vec<[Complex; 2]>,
}

impl Forced {
    fn new(system: &System, parameter: &Parameter) -> Result<Self, VolterraError> {
        let kernel = system.kernel();
        let n = system.dimension();
        let drive = system.drive();
        check(system, parameter)?;
        let constant = if parameter.constant.is_empty() {
            DVector::zeros(n)
        } else {
            DVector::from_column_slice(&parameter.constant)
        };
        let none = ToneChange::default();
        let change = |k: usize| parameter.tones.get(k).unwrap_or(&none);
        // (iω − A) X = F, so (iω − A) X' = F' − i ω' X.
        let state = system.forced();
        let tones: Vec<(f64, DVector<Complex>)> = drive
            .tones
            .iter()
            .enumerate()
            .map(|(k, tone)| {
                let change = change(k);
                let forcing = DVector::from_fn(n, |i, _| {
                    let own = change.forcing.get(i).copied().unwrap_or_default();
                    own - Complex::new(0.0, change.frequency) * state.tones[k][i]
                });
                (tone.frequency, forcing)
            })
            .collect();
        let response = Response::of(kernel, &constant, &tones)?;
        let gap_constant = parameter.offset
            + kernel
                .readout
                .iter()
                .zip(response.constant.iter())
                .map(|(r, y)| r * y)
                .sum::<f64>();
        let turn = |k: usize| Complex::new(0.0, change(k).frequency);
        let gap_tones = response
            .tones
            .iter()
            .enumerate()
            .map(|(k, y)| {
                [
                    change(k).gap + kernel.read(y),
                    turn(k) * system.gap_tones[k],
                ]
            })
            .collect();
        let tones = response
            .tones
            .into_iter()
            .enumerate()
            .map(|(k, y)| [y, system.response().tones[k].map(|z| turn(k) * z)])
            .collect();
        Ok(Self {
            law: parameter.law.clone(),
            gap_constant,
            constant: response.constant,
            frequencies: (0..drive.tones.len())
                .map(|k| change(k).frequency)
                .collect(),
            tones,
            gap_tones,
        })
    }

    /// Returns the change of the gap and of its rate at a time.
    fn gap(&self, system: &System, time: f64) -> (f64, f64) {
        let mut out = (self.gap_constant, 0.0);
        for (tone, [own, secular]) in system.drive().tones.iter().zip(&self.gap_tones) {
            let (sin, cos) = nanotap_arithmetic::sin_cos(tone.frequency * time);
            let phasor = Complex::new(cos, sin);
            let amplitude = own + secular * time;
            let rate = amplitude * Complex::new(0.0, tone.frequency) + secular;
            out.0 += (amplitude * phasor).re;
            out.1 += (rate * phasor).re;
        }
        out
    }

    /// Returns the change of the law's arguments at a time.
    fn arguments(&self, system: &System, time: f64) -> (f64, f64) {
        let (gap, rate) = self.gap(system, time);
        if system.second_is_rate() {
            return (gap, rate);
        }
        let second = system.signal().map_or(0.0, |(tone, frequency)| {
            -self.frequencies[tone] * time * nanotap_arithmetic::sin(frequency * time)
        });
        (gap, second)
    }

    /// Returns the change of the forced response's modal coordinates at a time.
    fn modal(&self, system: &System, time: f64) -> DVector<f64> {
        let mut out = self.constant.clone();
        for (tone, [own, secular]) in system.drive().tones.iter().zip(&self.tones) {
            let (sin, cos) = nanotap_arithmetic::sin_cos(tone.frequency * time);
            let phasor = Complex::new(cos, sin);
            for ((out, a), b) in out.iter_mut().zip(own.iter()).zip(secular.iter()) {
                *out += ((a + b * time) * phasor).re;
            }
        }
        out
    }
}

fn check(system: &System, parameter: &Parameter) -> Result<(), VolterraError> {
    let n = system.dimension();
    let lengths = [
        (
            "a parameter's change of the law",
            parameter.law.len(),
            system.law().parameters().len(),
        ),
        (
            "a parameter's change of the constant forcing",
            parameter.constant.len(),
            n,
        ),
        (
            "a parameter's change of the tones",
            parameter.tones.len(),
            system.drive().tones.len(),
        ),
    ];
    let forcings = parameter.tones.iter().map(|t| {
        (
            "a parameter's change of a tone's forcing",
            t.forcing.len(),
            n,
        )
    });
    for (what, found, expected) in lengths.into_iter().chain(forcings) {
        if found != 0 && found != expected {
            return Err(VolterraError::Shape {
                what,
                found,
                expected,
            });
        }
    }
    Ok(())
}

/// The changes of the motion on a step, one column each, relative to the step, which may move.
#[derive(Clone, Debug)]
pub(crate) struct StepChange {
    /// Modal coordinates at its start.
    pub(crate) modal: Vec<f64>,
    /// Changes of the force's coefficients.
    pub(crate) coefficients: Vec<f64>,
    /// Changes of the step's position in time.
    pub(crate) shifts: Vec<f64>,
    /// Changes of the time of its end, where the law switches there; otherwise empty.
    pub(crate) ends: Vec<f64>,
}

/// Observer that carries the derivatives along a run, in modal coordinates.
#[derive(Clone, Debug)]
pub(crate) struct Tangents {
    /// Derivatives of the system for the last columns; the columns before change with their start
    /// alone.
    pub(crate) parameters: Vec<Forced>,
    plain: usize,
    /// Changes on every step, if they are kept.
    pub(crate) kept: Option<Vec<StepChange>>,
    /// Changes of the modal coordinates, dimension × changes, column-major.
    columns: Vec<f64>,
    /// Changes of the time of the last switch, while the variation is taken relative to it.
    shifts: Vec<f64>,
    moving: bool,
    carry: Vec<f64>,
    right: Vec<f64>,
    shift_column: Vec<f64>,
    law: Vec<f64>,
    base: Vec<(f64, f64)>,
}

impl Tangents {
    /// Creates the derivatives of a run that begins at time `start`, where the state changes by
    /// `starts`, one column per change; the last columns belong to the parameters.
    pub(crate) fn new(
        system: &System,
        starts: &DMatrix<f64>,
        parameters: &[Parameter],
        start: f64,
    ) -> Result<Self, VolterraError> {
        let dimension = system.dimension();
        let count = starts.ncols();
        for (what, found, expected) in [
            ("the changes of the state", starts.nrows(), dimension),
            (
                "the changes that come with parameters",
                parameters.len().max(count),
                count,
            ),
        ] {
            if found != expected {
                return Err(VolterraError::Shape {
                    what,
                    found,
                    expected,
                });
            }
        }
        let parameters = parameters
            .iter()
            .map(|p| Forced::new(system, p))
            .collect::<Result<Vec<_>, _>>()?;
        let plain = count - parameters.len();
        // A variation x' of the state is L x' in modal coordinates, less the forced one.
        let mut columns = (system.kernel().modes().left() * starts)
            .as_slice()
            .to_vec();
        for (column, p) in columns[plain * dimension..]
            .chunks_exact_mut(dimension)
            .zip(&parameters)
        {
            for (y, forced) in column.iter_mut().zip(p.modal(system, start).iter()) {
                *y -= forced;
            }
        }
        let n = system.kernel().nodes;
        Ok(Self {
            parameters,
            plain,
            kept: None,
            columns,
            shifts: vec![0.0; count],
            moving: false,
            carry: vec![0.0; dimension * n],
            right: vec![0.0; n],
            shift_column: vec![0.0; n],
            law: vec![0.0; system.law().parameters().len()],
            base: Vec::new(),
        })
    }

    /// Keeps the changes on every step.
    pub(crate) fn keeping(mut self) -> Self {
        self.kept = Some(Vec::new());
        self
    }

    /// Returns the changes of the state at the end of the run, at time `end`.
    pub(crate) fn at_end(&self, system: &System, end: f64) -> DMatrix<f64> {
        let dimension = system.dimension();
        let count = self.shifts.len();
        let mut modal = DMatrix::from_column_slice(dimension, count, &self.columns);
        for (k, p) in self.parameters.iter().enumerate() {
            let mut column = modal.column_mut(self.plain + k);
            column += p.modal(system, end);
        }
        system.kernel().modes().right() * modal
    }

    /// Returns `ẏ` at modal coordinates `modal` under a force on a branch of the law.
    pub(crate) fn slope(system: &System, branch: usize, modal: &[f64], force: f64) -> Vec<f64> {
        let kernel = system.kernel_on(branch);
        let mut slope = vec![0.0; modal.len()];
        kernel.modes().apply(modal, &mut slope);
        for (s, b) in slope.iter_mut().zip(&kernel.source) {
            *s += b * force;
        }
        system.spare_surface_rates(branch, &mut slope);
        slope
    }
}

impl Observer for Tangents {
    const PERTURBS: bool = true;

    fn step(&mut self, system: &System, solver: &mut Solver, step: &Step, end: &[f64]) {
        let kernel = system.kernel_on(step.branch);
        let table = kernel.table(step.map, step.index);
        let (n, dimension) = (step.forces.len(), system.dimension());
        let rows = n + CHECKS;
        let whole = step.end >= 1.0;
        let idle = system.vanishes(step.branch);
        let exponentials: Vec<[[f64; 2]; 2]> = if whole {
            table.exponentials.clone()
        } else {
            let time = step.map.time(step.length, step.end);
            kernel
                .modes()
                .blocks()
                .iter()
                .map(|b| b.exp(time))
                .collect()
        };
        if !idle {
            if whole {
                self.carry.copy_from_slice(&table.carry);
            } else {
                kernel.partial_carry(step.map, step.length, step.end, &mut self.carry);
            }
            // A solved step's matrix is regular, or Newton would not have converged.
            solver.factor(table, step);
        }
        let start_slope = Self::slope(system, step.branch, &step.modal, step.force_at(0.0));
        if step.moving_end {
            solver.shift(system, table, step, step.force_at(0.0));
        } else if step.moving_start {
            solver.tone_shift(system, table, step);
        }
        if step.moving_end || step.moving_start {
            let (gap, rate) = solver.shifts();
            for i in 0..n {
                self.shift_column[i] = step.by_gap[i] * gap[i] + step.by_rate[i] * rate[i];
            }
        }
        let shift_gap_end = solver.shifts().0[n - 1];
        let mut shift_solution = self.shift_column.clone();
        if step.moving_end {
            solver.back_substitute(&mut shift_solution);
        }
        let effect = |x: &[f64]| -> f64 {
            (0..n)
                .map(|j| table.gap_force[j * rows + n - 1] * x[j])
                .sum()
        };
        let end_slope = Self::slope(system, step.branch, end, step.force_at(step.end));
        let count = self.shifts.len();
        if let Some(kept) = &mut self.kept {
            kept.push(StepChange {
                modal: Vec::with_capacity(dimension * count),
                coefficients: vec![0.0; if idle { 0 } else { n * count }],
                shifts: vec![0.0; count],
                ends: Vec::new(),
            });
        }
        for column in 0..count {
            let parameter = column.checked_sub(self.plain).map(|p| &self.parameters[p]);
            let y = &mut self.columns[column * dimension..(column + 1) * dimension];
            let mut time_shift = 0.0;
            if step.moving_start {
                time_shift = self.shifts[column];
                for (y, s) in y.iter_mut().zip(&start_slope) {
                    *y += s * time_shift;
                }
            }
            self.base.clear();
            if let Some(p) = parameter {
                self.base.extend(
                    table.times[..n]
                        .iter()
                        .map(|t| p.arguments(system, step.start + t)),
                );
            }
            let mut gap_end = 0.0;
            if !idle {
                let (mut gap, mut rate) = ([0.0; 40], [0.0; 40]);
                let (gap, rate) = (&mut gap[..rows], &mut rate[..rows]);
                add_product(&table.gap, y, gap);
                if solver.rates {
                    add_product(&table.rate, y, rate);
                }
                for (i, (d, v)) in self.base.iter().enumerate() {
                    gap[i] += d;
                    rate[i] += v;
                }
                gap_end = gap[n - 1];
                for i in 0..n {
                    self.right[i] = step.by_gap[i] * gap[i] + step.by_rate[i] * rate[i];
                    if step.moving_start {
                        self.right[i] += self.shift_column[i] * time_shift;
                    }
                }
                if let Some(p) = parameter
                    && !p.law.is_empty()
                {
                    for i in 0..n {
                        system.law().by_parameters(
                            step.branch,
                            step.gap[i],
                            step.rate[i],
                            &mut self.law,
                        );
                        self.right[i] +=
                            self.law.iter().zip(&p.law).map(|(a, b)| a * b).sum::<f64>();
                    }
                }
                solver.back_substitute(&mut self.right);
            }
            if step.moving_end {
                let level = parameter.map_or(0.0, |p| level_change(system, step, p, &mut self.law));
                let slope = shift_gap_end + effect(&shift_solution);
                time_shift = -(gap_end + effect(&self.right) - level) / slope;
                for (r, c) in self.right.iter_mut().zip(&shift_solution) {
                    *r += c * time_shift;
                }
                for (y, s) in y.iter_mut().zip(&start_slope) {
                    *y += s * time_shift;
                }
            }
            if let Some(kept) = self.kept.as_mut().and_then(|kept| kept.last_mut()) {
                kept.modal.extend_from_slice(y);
                kept.shifts[column] = time_shift;
                if !idle {
                    let coefficients = &mut kept.coefficients[column * n..(column + 1) * n];
                    add_product(&kernel.coefficients, &self.right, coefficients);
                }
            }
            for (block, e) in kernel.modes().blocks().iter().zip(&exponentials) {
                let s = block.start;
                if block.size == 1 {
                    y[s] *= e[0][0];
                } else {
                    let (a, b) = (y[s], y[s + 1]);
                    y[s] = e[0][0] * a + e[0][1] * b;
                    y[s + 1] = e[1][0] * a + e[1][1] * b;
                }
            }
            if !idle {
                add_product(&self.carry, &self.right, y);
            }
            if step.moving_start || step.moving_end {
                // Back to fixed time, as if the force went on as it is at the end.
                for (y, s) in y.iter_mut().zip(&end_slope) {
                    *y -= s * time_shift;
                }
            }
            self.shifts[column] = time_shift;
        }
        self.moving = step.moving_end;
    }

    fn switch(&mut self, system: &System, switch: &Switch, exit: &Exit, modal: &[f64]) {
        let kernel = system.kernel_on(switch.from);
        let dimension = system.dimension();
        let law = system.law();
        let depth = system.second_of(switch.time, [switch.rate, 0.0], modal, &[])[0];
        let before = law.force(switch.from, switch.gap, depth);
        let after = law.force(switch.to, switch.gap, depth).value;
        let jump = after - before.value;
        // The guard h, positive before: its derivatives by gap and rate.
        let (by_gap, by_rate) = match exit.guard {
            Guard::Falls(_) => (1.0, 0.0),
            Guard::Rises(_) => (-1.0, 0.0),
            Guard::Turns => (0.0, -1.0),
            Guard::Own(index) => {
                let g = law.guard(index, switch.gap, depth);
                (g.by_gap, g.by_rate)
            }
        };
        let slope = Self::slope(system, switch.from, modal, before.value);
        let acceleration = system.forced_gap(switch.time)[2]
            + kernel
                .rate_readout
                .iter()
                .zip(&slope)
                .map(|(r, s)| r * s)
                .sum::<f64>();
        let [_, second] = system.second_of(switch.time, [switch.rate, acceleration], modal, &slope);
        let fall = by_gap * switch.rate + by_rate * second;
        for column in 0..self.shifts.len() {
            let y = &mut self.columns[column * dimension..(column + 1) * dimension];
            if !self.moving {
                let dot = |row: &[f64]| row.iter().zip(y.iter()).map(|(r, y)| r * y).sum::<f64>();
                let mut change =
                    by_gap * dot(&kernel.readout) + by_rate * dot(&kernel.second_readout);
                if let Some(p) = column.checked_sub(self.plain).map(|p| &self.parameters[p]) {
                    let (d, v) = p.arguments(system, switch.time);
                    change += by_gap * d + by_rate * v;
                    if !p.law.is_empty() {
                        law.guard_by_parameters(
                            switch.from,
                            switch.exit,
                            switch.gap,
                            depth,
                            &mut self.law,
                        );
                        change += self.law.iter().zip(&p.law).map(|(a, b)| a * b).sum::<f64>();
                    }
                }
                self.shifts[column] = if fall == 0.0 { 0.0 } else { -change / fall };
            }
            let shift = self.shifts[column];
            if jump != 0.0 {
                for (y, b) in y.iter_mut().zip(&kernel.source) {
                    *y -= b * jump * shift;
                }
            }
        }
        self.moving = false;
        if let Some(last) = self.kept.as_mut().and_then(|kept| kept.last_mut()) {
            last.ends.clone_from(&self.shifts);
        }
    }
}

/// Returns the change, with a parameter of the law, of the gap at which a step ends.
fn level_change(system: &System, step: &Step, parameter: &Forced, scratch: &mut [f64]) -> f64 {
    if parameter.law.is_empty() {
        return 0.0;
    }
    let n = step.forces.len();
    let Some(level) = step.pinned_end else {
        return 0.0;
    };
    let exits = system.exits(step.branch);
    let Some(number) = exits
        .iter()
        .position(|e| matches!(e.guard, Guard::Rises(l) | Guard::Falls(l) if l == level))
    else {
        return 0.0;
    };
    system
        .law()
        .guard_by_parameters(step.branch, number, level, step.rate[n - 1], scratch);
    let sum: f64 = scratch.iter().zip(&parameter.law).map(|(a, b)| a * b).sum();
    // The guard is level − gap where the gap rises to it, gap − level where it falls.
    if matches!(exits[number].guard, Guard::Rises(_)) {
        sum
    } else {
        -sum
    }
}

impl Flow {
    /// Runs to time `end` and writes the derivative of the state there by the state at the
    /// start (`n × n`) and by each parameter (one column each, `n × p`), all at fixed times.
    ///
    /// # Errors
    /// As for [`Flow::run_until`], and if a parameter does not fit the system.
    pub fn run_with_derivatives(
        &mut self,
        end: f64,
        parameters: &[Parameter],
        jacobian: &mut DMatrix<f64>,
        derivatives: &mut DMatrix<f64>,
    ) -> Result<(), VolterraError> {
        let system = self.system.clone();
        let n = system.dimension();
        let mut starts = DMatrix::identity(n, n + parameters.len());
        starts.columns_mut(n, parameters.len()).fill(0.0);
        let mut tangents = Tangents::new(&system, &starts, parameters, self.time())?;
        self.run(end, &mut tangents)?;
        let all = tangents.at_end(&system, self.time());
        *jacobian = all.columns(0, n).into_owned();
        *derivatives = all.columns(n, parameters.len()).into_owned();
        Ok(())
    }
}

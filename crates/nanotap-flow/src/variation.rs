//! Derivatives of a motion's functionals with respect to a parameter.
//!
//! A [`Variation`] follows a motion together with its sensitivity `s = dx/dθ` (see
//! [`sensitivity`](crate::sensitivity)), which begins with a given value: with that of a
//! periodic orbit, by the implicit function theorem, everything that follows is the orbit's
//! own derivative. Of outputs `g` (scalars affine in the state) it gathers
//!
//! - `d∫g dt`, `d∫g h dt` and `d∫g e^{−iωt} dt` at constant drive phase: the integral of
//!   `∂g·s + ∂_θ g`, and of every switch the jump of the integrand times the time by which it
//!   moves, `−(∂h·s + ∂_θ h)/ḣ` with `h` the guard;
//! - the derivative of extrema: that of the output where it is extreme, an end that moves with
//!   a switch included;
//! - the derivative of the guard's rate at the fastest switch between two regimes.
//!
//! The integrands are sums of products of exponentials, smooth between switches. They are
//! integrated by Gauss–Legendre quadrature whose panels follow from the fastest exponential,
//! so that the error is that of rounding: nothing here is a difference.

use nanotap_arithmetic::{ComplexFunctions as _, Dual};
use std::sync::LazyLock;

use crate::functional::Functional;
use crate::observer::{Observer, SegmentView, SwitchView};
use crate::regime::ModalOutput;
use crate::search::sign_changes;
use crate::sensitivity::{Propagator, Sensitivity, SystemTangent};
use crate::{Complex, Drive, Output, Regime, System};

/// An output and its derivative with respect to the parameter at constant state and drive phase,
/// with one entry per regime each.
#[derive(Clone, Debug, PartialEq)]
pub struct VariedOutput {
    /// Output in each regime, one entry per regime.
    pub value: Vec<Output>,
    /// Derivative of the output with respect to the parameter, one entry per regime.
    pub change: Vec<Output>,
}

impl VariedOutput {
    /// Creates the same output in every regime, with its derivative.
    pub fn same(system: &System, value: &Output, change: &Output) -> Self {
        let regimes = system.regimes().len();
        Self {
            value: vec![value.clone(); regimes],
            change: vec![change.clone(); regimes],
        }
    }

    /// Returns the output's rate along the motion.
    #[must_use]
    pub fn rate(&self, system: &System, tangent: &SystemTangent) -> Self {
        let drive = system.drive();
        let rate = |(r, value): (usize, &Output)| {
            let regime = &system.regimes()[r];
            value.rate(regime.matrix(), regime.forcing(), drive)
        };
        let change = |(r, (value, change)): (usize, (&Output, &Output))| {
            let (regime, moved) = (&system.regimes()[r], &tangent.regimes[r]);
            // ∂(g A) x + ∂(g f), and ∂(iω z) = iω ∂z − iω ∂ln T z.
            let mut rate = change.rate(regime.matrix(), regime.forcing(), drive);
            let along = value.rate(&moved.matrix, &moved.forcing, drive);
            rate.row += &along.row;
            rate.constant += along.constant;
            for (k, z) in rate.tones.iter_mut().enumerate() {
                let turn = Complex::new(0.0, drive.frequencies()[k]);
                // `along` has the rate of the value's own tone, which is not part of it.
                *z += along.tones[k] - turn * value.tones[k] * (1.0 + tangent.log_period);
            }
            rate
        };
        Self {
            value: self.value.iter().enumerate().map(rate).collect(),
            change: self
                .value
                .iter()
                .zip(&self.change)
                .enumerate()
                .map(change)
                .collect(),
        }
    }
}

/// Observer that carries the functionals' derivatives along a flow.
#[derive(Debug)]
pub struct Variation<'a> {
    system: &'a System,
    tangent: &'a SystemTangent,
    sensitivity: Sensitivity<'a>,
    outputs: Vec<VariedOutput>,
    /// By regime and output: value and derivative in modal coordinates.
    modal: Vec<Vec<[ModalOutput; 2]>>,
    guards: Vec<Vec<Guard>>,
    functionals: Vec<Functional>,
    /// The functionals' values with their derivatives, by number; extrema of a motion of no length
    /// are infinite.
    pub values: Vec<nalgebra::Complex<Dual>>,
    /// Pairs of regimes, with the speeds of the guard at switches between them.
    pub speeds: Vec<((usize, usize), Speeds)>,
    /// Duration of the motion, in the system's unit of time.
    pub duration: Dual,
    /// Extrema at the end of the last stretch, which move with a switch there: number and rate of
    /// each.
    at_end: Vec<(usize, f64)>,
    /// Change of the time of the stretch's start, if it began with a switch.
    moved: Option<f64>,
    periods: f64,
}

/// Speeds of a guard at switches, with their derivatives; zero where there was none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Speeds {
    /// Greatest speed, in units of the guard per unit of time.
    pub greatest: Dual,
    /// Sum of the speeds, in units of the guard per unit of time.
    pub sum: Dual,
    /// Sum of the squared speeds.
    pub squares: Dual,
}

/// A guard, its rate, and the rate of that, with their derivatives.
#[derive(Clone, Debug)]
struct Guard {
    value: [ModalOutput; 2],
    rate: [ModalOutput; 2],
    curvature: ModalOutput,
}

impl<'a> Variation<'a> {
    /// Creates the derivatives along a flow of `system` that is in `regime`, with `dx/dθ = start`
    /// (length `n`) there.
    ///
    /// # Panics
    /// If an output or the start does not fit the system.
    pub fn new(
        system: &'a System,
        tangent: &'a SystemTangent,
        regime: usize,
        start: &[f64],
        outputs: Vec<VariedOutput>,
        functionals: Vec<Functional>,
        speeds: impl Iterator<Item = (usize, usize)>,
    ) -> Self {
        let mut sensitivity = Sensitivity::new(system, std::slice::from_ref(tangent), regime);
        sensitivity.begin(&system.regimes()[regime], 0, start);
        let pair = |regime: &Regime, varied: &VariedOutput, r: usize| {
            [
                regime.project(&varied.value[r]),
                regime.project(&varied.change[r]),
            ]
        };
        let modal = system
            .regimes()
            .iter()
            .enumerate()
            .map(|(r, regime)| outputs.iter().map(|o| pair(regime, o, r)).collect())
            .collect();
        let guards = system
            .transitions()
            .iter()
            .enumerate()
            .map(|(r, transitions)| {
                let regime = &system.regimes()[r];
                let guard = |(number, of): (usize, &crate::Transition)| {
                    let value = VariedOutput::same(system, &of.guard, &tangent.guards[r][number]);
                    let rate = value.rate(system, tangent);
                    let curvature = rate.rate(system, tangent);
                    Guard {
                        value: pair(regime, &value, r),
                        rate: pair(regime, &rate, r),
                        curvature: regime.project(&curvature.value[r]),
                    }
                };
                transitions.iter().enumerate().map(guard).collect()
            })
            .collect();
        Self {
            system,
            tangent,
            sensitivity,
            modal,
            guards,
            values: functionals.iter().map(|f| f.initial()).collect(),
            speeds: speeds.map(|pair| (pair, Speeds::default())).collect(),
            duration: Dual::default(),
            outputs,
            functionals,
            at_end: Vec::new(),
            moved: None,
            periods: 0.0,
        }
    }

    /// Writes `∂x/∂θ` (length `n`) now, in `regime`, to `derivative`.
    pub fn state(&self, regime: usize, derivative: &mut [f64]) {
        let regime = &self.system.regimes()[regime];
        self.sensitivity.to_state(regime, 0, derivative);
    }

    /// Adds a quadrature node of this weight, with these values of the outputs, at a time within
    /// the period.
    fn add_node(&mut self, weight: Dual, time: f64, values: &[Dual]) {
        let time = self.periods * self.system.drive().period() + time;
        for (sum, functional) in self.values.iter_mut().zip(&self.functionals) {
            functional.add_node(sum, weight, values, |omega| Dual::constant(omega * time));
        }
    }

    /// Finds the extrema over a stretch.
    fn look_for_extrema(&mut self, segment: &SegmentView<'_>) {
        let (r, drive) = (segment.regime, segment.system.drive());
        let regime = segment.regime();
        self.at_end.clear();
        for index in 0..self.functionals.len() {
            let Some((output, sign)) = self.functionals[index].extremum() else {
                continue;
            };
            let [value, _] = &self.modal[r][output];
            let signal = segment.signal(value);
            let rate = signal.differentiated(segment.length);
            let inside = sign_changes(&rate, segment.length);
            let places = std::iter::once(0.0).chain(inside).chain([segment.length]);
            for place in places {
                let found = signal.at(place);
                if sign * (found - self.values[index].re.value) <= 0.0 {
                    continue;
                }
                let slope = rate.at(place);
                let q = Propagator::new(regime, drive, place).modal(segment.modal);
                let s = self.sensitivity.after(segment, place);
                let time = segment.phase + place;
                let change = varied(&self.modal[r][output], &q, &s, drive, time).derivative();
                let moved = if place == 0.0 {
                    self.moved.map_or(0.0, |by| by * slope)
                } else {
                    0.0
                };
                self.values[index].re = Dual::new(found, change + moved);
                self.at_end.retain(|(known, _)| *known != index);
                if place == segment.length {
                    self.at_end.push((index, slope));
                }
            }
        }
    }
}

/// Returns an output's value and total derivative at modal coordinates `q` with derivative `s`.
fn varied(
    [value, change]: &[ModalOutput; 2],
    q: &[Complex],
    s: &[Complex],
    drive: &Drive,
    time: f64,
) -> Dual {
    let along: f64 = value.modal.iter().zip(s).map(|(w, s)| (w * s).re).sum();
    Dual::new(value.at(drive, q, time), along + change.at(drive, q, time))
}

impl Observer for Variation<'_> {
    fn segment(&mut self, segment: &SegmentView<'_>) {
        if segment.length <= 0.0 {
            return;
        }
        let (regime, drive) = (segment.regime(), segment.system.drive());
        self.look_for_extrema(segment);
        // Products have twice the rate, Fourier integrals the frequency in addition.
        let modes = regime.basis().eigenvalues.iter().map(|l| l.modulus());
        let tones = drive.frequencies().iter().copied();
        let fastest = 2.0 * modes.chain(tones).fold(0.0, f64::max);
        let omegas = self.functionals.iter().filter_map(|f| f.frequency());
        let rate = fastest + omegas.map(f64::abs).fold(0.0, f64::max);
        let panels = (rate * segment.length / PANEL).ceil().max(1.0);
        let width = segment.length / panels;
        let rule = &*GAUSS;
        let steps: Vec<Propagator> = rule
            .iter()
            .map(|(at, _)| Propagator::new(regime, drive, at * width))
            .collect();
        let step = Propagator::new(regime, drive, width);
        let mut q = segment.modal.to_vec();
        let mut s = self.sensitivity.modal(0).to_vec();
        let mut at = vec![Dual::default(); self.outputs.len()];
        for panel in 0..panels as usize {
            let begin = segment.phase + panel as f64 * width;
            for (propagator, (place, weight)) in steps.iter().zip(rule) {
                let time = begin + place * width;
                let (q, s) = (
                    propagator.modal(&q),
                    propagator.sensitivity(&self.sensitivity, segment.regime, begin, &q, &s),
                );
                for (at, output) in at.iter_mut().zip(&self.modal[segment.regime]) {
                    *at = varied(output, &q, &s, drive, time);
                }
                self.add_node(Dual::constant(weight * width), time, &at);
            }
            s = step.sensitivity(&self.sensitivity, segment.regime, begin, &q, &s);
            q = step.modal(&q);
        }
        self.duration.value += segment.length;
        self.sensitivity.segment(segment);
        self.moved = None;
    }

    fn switch(&mut self, view: &SwitchView<'_>) {
        let (from, drive) = (view.switch.from, view.system.drive());
        let guard = &self.guards[from][view.transition];
        let s = self.sensitivity.modal(0);
        let moves = varied(&guard.value, view.modal, s, drive, view.phase).derivative();
        // Where the guard only grazes, nothing that is read off the motion jumps.
        let by = if view.rate == 0.0 {
            0.0
        } else {
            -moves / view.rate
        };
        let rate = varied(&guard.rate, view.modal, s, drive, view.phase);
        let curvature = guard.curvature.at(drive, view.modal, view.phase);
        let speed = Dual::new(
            rate.value.abs(),
            (rate.derivative() + curvature * by) * rate.value.signum(),
        );
        let between = (from, view.switch.to);
        for (_, speeds) in self.speeds.iter_mut().filter(|(pair, _)| *pair == between) {
            if speed.value > speeds.greatest.value {
                speeds.greatest = speed;
            }
            speeds.sum = speeds.sum + speed;
            speeds.squares = speeds.squares + speed * speed;
        }
        for (index, rate) in std::mem::take(&mut self.at_end) {
            self.values[index].re.slopes[0] += rate * by;
        }
        let x = view.state();
        let after = view.reset().map_or_else(
            || x.clone(),
            |reset| &reset.matrix * &x + reset.offset.at(drive, view.phase),
        );
        // The integrand before the switch in place of that after it, for as long as it moves.
        for (regime, x, by) in [(from, &x, by), (view.switch.to, &after, -by)] {
            let value =
                |o: &VariedOutput| o.value[regime].at(drive, x.as_slice(), view.phase).into();
            let values: Vec<Dual> = self.outputs.iter().map(value).collect();
            self.add_node(Dual::new(0.0, by), view.phase, &values);
        }
        self.sensitivity.switch(view);
        self.moved = Some(by);
    }

    fn period_end(&mut self) {
        self.periods += 1.0;
        self.at_end.clear();
        self.moved = None;
    }
}

impl Variation<'_> {
    /// Ends the motion. Everything was accumulated at constant drive phase; a change of the period
    /// stretches all integrals alike.
    pub fn finish(&mut self) {
        let by = self.tangent.log_period;
        let stretch = Dual::new(1.0, by);
        for (sum, functional) in self.values.iter_mut().zip(&self.functionals) {
            if functional.extremum().is_none() {
                *sum = nalgebra::Complex::new(sum.re * stretch, sum.im * stretch);
            }
        }
        self.duration = self.duration * stretch;
    }
}

/// Number of nodes of a panel: the quadrature's relative error, (θ/2)³² 16!⁴/(33 · 32!³) at the
/// angle θ = 12 of [`PANEL`], is below 1e-17.
const NODES: usize = 16;
/// Angle in radians through which the fastest exponential turns over a panel.
const PANEL: f64 = 12.0;

/// Places in (0, 1) and weights of Gauss–Legendre quadrature.
static GAUSS: LazyLock<Vec<(f64, f64)>> = LazyLock::new(|| {
    let legendre = |x: f64| {
        let (mut before, mut here) = (1.0, x);
        for k in 2..=NODES {
            let k = k as f64;
            (before, here) = (here, ((2.0 * k - 1.0) * x * here - (k - 1.0) * before) / k);
        }
        let slope = NODES as f64 * (x * here - before) / (x * x - 1.0);
        (here, slope)
    };
    (0..NODES)
        .map(|i| {
            let mut x = nanotap_arithmetic::cos(
                std::f64::consts::PI * (i as f64 + 0.75) / (NODES as f64 + 0.5),
            );
            for _ in 0..8 {
                let (value, slope) = legendre(x);
                x -= value / slope;
            }
            let slope = legendre(x).1;
            (0.5 * (1.0 - x), 1.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
});

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quadrature_integrates_an_exponential_that_turns_as_far_as_a_panel_may() {
        for angle in [0.0, 1.0, PANEL] {
            let z = Complex::new(0.0, angle);
            let sum: Complex = GAUSS.iter().map(|(x, w)| (z * *x).exponential() * *w).sum();
            let exact = if angle == 0.0 {
                Complex::new(1.0, 0.0)
            } else {
                (z.exponential() - 1.0) / z
            };
            assert!(
                (sum - exact).modulus() < 1e-14,
                "{angle}: {:e}",
                (sum - exact).modulus()
            );
        }
    }
}

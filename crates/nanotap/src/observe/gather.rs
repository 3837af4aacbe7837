//! Gathers what observables are read from along a motion under a nonlinear force: extrema of
//! the dense output, integrals by the quadrature that its polynomials need.

use std::sync::Arc;

use nanotap_flow::Complex;
use nanotap_volterra::{Node, Output, Sample, Trajectory};

use super::clearance::SampledClearance;
use super::contact_event::{ContactEvent, ContactEventKind};
use super::energy::stored_by_lever;
use super::measure::{Asked, frequency};
use super::measured::{Beginnings, Found, Impacts, Need, Signal};
use super::number::Phasor;
use super::table::{Observables, Set};
use crate::model::Model;
use crate::model::nonlinear::Nonlinear;
use crate::model::recording::read;

/// What is gathered of a motion, period by period.
pub(super) struct Gatherer<'a> {
    model: &'a Model,
    nonlinear: &'a Arc<Nonlinear>,
    set: Set,
    asked: Asked,
    /// The signals that are needed, each as an output.
    signals: Vec<(Signal, Output)>,
    values: Vec<Complex>,
    periods: usize,
    contact_time: f64,
    contacts: Beginnings<f64>,
    events: Vec<ContactEvent>,
    clearance: Option<SampledClearance>,
    /// Energy stored by lever and law at the beginning, and so far.
    energies: [(f64, f64); 2],
    /// Least and greatest tip deflection of each period.
    lows: Vec<f64>,
    highs: Vec<f64>,
    nodes: Vec<Node>,
}

impl<'a> Gatherer<'a> {
    /// Of the observables `set` of a motion of `model` from `state`.
    pub(super) fn new(
        model: &'a Model,
        nonlinear: &'a Arc<Nonlinear>,
        set: Set,
        state: &[f64],
    ) -> Self {
        let asked = Asked::of(model, set);
        let mut signals: Vec<(Signal, Output)> = Vec::new();
        for need in &asked.needs {
            let (first, second) = need.signals();
            for signal in std::iter::once(first).chain(second) {
                if !signals.iter().any(|(known, _)| *known == signal) {
                    signals.push((signal, signal.reading(model, nonlinear)));
                }
            }
        }
        let start = (stored_by_lever(model, state), f64::NAN);
        Self {
            values: asked.needs.iter().map(Need::nothing).collect(),
            clearance: asked
                .clearance
                .then(|| SampledClearance::new(model, nonlinear))
                .flatten(),
            model,
            nonlinear,
            set,
            asked,
            signals,
            periods: 0,
            contact_time: 0.0,
            contacts: Beginnings::default(),
            events: Vec::new(),
            energies: [start, start],
            lows: Vec::new(),
            highs: Vec::new(),
            nodes: Vec::new(),
        }
    }

    /// Takes a period that ends in `state`.
    pub(super) fn take(&mut self, state: &[f64], period: &Trajectory) {
        self.nodes = period.nodes();
        self.sum();
        self.extend(period);
        let touches = &self.nonlinear.contact;
        let stretches = period.stretches();
        self.contact_time += stretches
            .filter(|s| touches[s.branch])
            .map(|s| s.length)
            .sum::<f64>();
        self.take_switches(period);
        if let Some(clearance) = &mut self.clearance {
            clearance.period(self.nonlinear, self.periods, period, &self.nodes);
        }
        let law = self.nonlinear.system.law();
        let (start, end) = period.span();
        let energy = |time: f64| {
            let sample = period.at(time)?;
            law.energy(sample.branch, sample.gap)
        };
        if self.periods == 0 {
            self.energies[0].1 = energy(start).unwrap_or(0.0);
        }
        self.energies[1] = (
            stored_by_lever(self.model, state),
            energy(end).unwrap_or(0.0),
        );
        self.periods += 1;
    }

    fn output(&self, signal: Signal) -> Option<&Output> {
        self.signals
            .iter()
            .find(|(known, _)| *known == signal)
            .map(|(_, output)| output)
    }

    /// Adds to the integrals.
    fn sum(&mut self) {
        let offset = self.periods as f64 * self.nonlinear.period;
        for k in 0..self.asked.needs.len() {
            let need = self.asked.needs[k];
            let value = |signal: Signal, sample: &Sample| {
                self.output(signal)
                    .map_or(0.0, |output| read(self.nonlinear, output, sample))
            };
            let nodes = self.nodes.iter();
            let sum: Complex = match need {
                Need::Least(_) | Need::Greatest(_) => continue,
                Need::Integral(signal) => nodes
                    .map(
                        |Node {
                             weight: w,
                             sample: s,
                             ..
                         }| w * value(signal, s),
                    )
                    .sum::<f64>()
                    .into(),
                Need::Product(a, b) => nodes
                    .map(
                        |Node {
                             weight: w,
                             sample: s,
                             ..
                         }| w * value(a, s) * value(b, s),
                    )
                    .sum::<f64>()
                    .into(),
                Need::Fourier(signal, tone) => {
                    let omega = frequency(self.model, tone);
                    nodes
                        .map(
                            |Node {
                                 weight: w,
                                 sample: s,
                                 ..
                             }| {
                                let (sin, cos) =
                                    nanotap_arithmetic::sin_cos(omega * (offset + s.time));
                                Complex::new(cos, -sin) * (w * value(signal, s))
                            },
                        )
                        .sum()
                }
            };
            self.values[k] += sum;
        }
    }

    /// Extends the extrema.
    fn extend(&mut self, period: &Trajectory) {
        let mut known: Vec<(Signal, [f64; 2])> = Vec::new();
        for k in 0..self.asked.needs.len() {
            let (Need::Least(signal) | Need::Greatest(signal)) = self.asked.needs[k] else {
                continue;
            };
            let found = known.iter().find(|(other, _)| *other == signal);
            let ends = if let Some((_, ends)) = found {
                *ends
            } else {
                let of =
                    |output: &Output| period.ends_of_range(&self.nodes, output).map(|end| end.1);
                let ends = self.output(signal).map_or([f64::NAN; 2], of);
                known.push((signal, ends));
                ends
            };
            let value = &mut self.values[k].re;
            match self.asked.needs[k] {
                Need::Least(_) => *value = value.min(ends[0]),
                _ => *value = value.max(ends[1]),
            }
        }
        if let Some((_, [low, high])) = known.iter().find(|(signal, _)| *signal == Signal::Tip) {
            self.lows.push(*low);
            self.highs.push(*high);
        }
    }

    /// Notes contacts that begin and end.
    fn take_switches(&mut self, period: &Trajectory) {
        let touches = &self.nonlinear.contact;
        for switch in period.switches() {
            let kind = match (touches[switch.from], touches[switch.to]) {
                (false, true) => {
                    self.contacts.count += 1;
                    let speed = -switch.rate;
                    self.contacts.greatest_speed = self.contacts.greatest_speed.max(speed);
                    ContactEventKind::ContactStart
                }
                (true, false) => ContactEventKind::ContactEnd,
                _ => continue,
            };
            self.events.push(ContactEvent {
                tau: self.periods as f64 * self.nonlinear.period + switch.time,
                kind,
                gap_rate: switch.rate,
            });
        }
    }

    /// Least tip deflection of each period so far, where it is asked for.
    pub(super) fn lows(&mut self) -> Vec<f64> {
        std::mem::take(&mut self.lows)
    }

    /// Greatest tip deflection of each period so far, where it is asked for.
    pub(super) fn highs(&mut self) -> Vec<f64> {
        std::mem::take(&mut self.highs)
    }

    /// The contacts so far.
    pub(super) fn events(&mut self) -> Vec<ContactEvent> {
        std::mem::take(&mut self.events)
    }

    /// The observables of what was taken.
    pub(super) fn observables(self) -> Observables {
        if self.periods == 0 {
            return Observables::UNKNOWN;
        }
        let [before, after] = self.energies;
        let by_sample = after.1 - before.1;
        let found = Found {
            values: self
                .asked
                .needs
                .into_iter()
                .zip(self.values.into_iter().map(Phasor::from))
                .collect(),
            duration: self.periods as f64 * self.nonlinear.period,
            periods: self.periods as u64,
            contact_time: self.contact_time,
            contacts: self.contacts,
            stored: after.0 - before.0 + by_sample,
            stored_by_sample: by_sample,
            impacts: Impacts::default(),
            second_phase: self.model.second_phase,
            clearance: self
                .clearance
                .and_then(|search| search.found(self.model, self.nonlinear)),
        };
        found.observables(self.model, self.set)
    }
}

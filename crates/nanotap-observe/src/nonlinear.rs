//! Measurement of a motion under a nonlinear force during a run: extrema of the dense output,
//! integrals by quadrature.

use std::sync::Arc;

use nanotap_flow::{Complex, accumulate};
use nanotap_volterra::{Flow, Node, Output, Trajectory};

use super::clearance::SampledClearance;
use super::contact_event::{ContactEvent, ContactEventKind};
use super::energy::{end_phase, stored_by_lever};
use super::functional::{Requirements, Signal};
use super::measured::{Beginnings, Impacts, MeasuredValues};
use super::number::Phasor;
use super::record::{Engine, Measurements, RecordOptions, Run};
use super::table::ObservableSet;
use nanotap_model::recording::{Recording, read};
use nanotap_model::{Model, MotionError, nonlinear};

/// The measurement of motions of a model under a nonlinear force.
pub(super) struct Nonlinear<'a> {
    model: &'a Model,
    engine: &'a Arc<nonlinear::Nonlinear>,
    required: Requirements,
    functionals: Vec<accumulate::Functional>,
    /// Required signals, in the order of the requirements.
    outputs: Vec<Output>,
}

impl<'a> Nonlinear<'a> {
    /// Prepares the measurement of the observables `set`.
    pub(super) fn new(
        model: &'a Model,
        nonlinear: &'a Arc<nonlinear::Nonlinear>,
        set: ObservableSet,
    ) -> Self {
        let required = Requirements::of(model, set);
        let output = |signal: &Signal| {
            let output = &signal.outputs(model)[0];
            nonlinear.output(output, signal.force_part(nonlinear))
        };
        Self {
            outputs: required.signals.iter().map(output).collect(),
            functionals: required.numbered(model),
            model,
            engine: nonlinear,
            required,
        }
    }
}

impl Engine for Nonlinear<'_> {
    fn start(&self, state: &[f64], _: RecordOptions) -> Result<Box<dyn Run + '_>, MotionError> {
        let clearance = self.required.clearance;
        let clearance = clearance.then(|| SampledClearance::new(self.model, self.engine));
        let start = (stored_by_lever(self.model, state, 0.0), None);
        Ok(Box::new(NonlinearRun {
            of: self,
            flow: Flow::new(Arc::clone(&self.engine.system)),
            state: state.to_vec(),
            values: self.functionals.iter().map(|f| f.initial()).collect(),
            periods: 0,
            contact_time: 0.0,
            contacts: Beginnings::default(),
            events: Vec::new(),
            clearance: clearance.flatten(),
            energies: [start, start],
            lows: Vec::new(),
            highs: Vec::new(),
            recorded: Vec::new(),
        }))
    }
}

/// A run of the flow under a nonlinear force, which is measured.
struct NonlinearRun<'a> {
    of: &'a Nonlinear<'a>,
    flow: Flow,
    state: Vec<f64>,
    /// Values of the functionals so far.
    values: Vec<Complex>,
    periods: usize,
    contact_time: f64,
    contacts: Beginnings<f64>,
    events: Vec<ContactEvent>,
    clearance: Option<SampledClearance>,
    /// Energy stored in the lever, and in the law if it is known, at the beginning and now.
    energies: [(f64, Option<f64>); 2],
    lows: Vec<f64>,
    highs: Vec<f64>,
    recorded: Vec<Trajectory>,
}

impl Run for NonlinearRun<'_> {
    fn period(&mut self, record: bool) -> Result<(), MotionError> {
        let nonlinear = self.of.engine;
        nonlinear.start(&mut self.flow, &self.state)?;
        let period = self.flow.record_until(nonlinear.period)?;
        nonlinear.end(&self.flow, &mut self.state);
        let nodes = period.nodes();
        self.integrate(&nodes);
        self.extend(&period, &nodes);
        self.contact_time += period.time_on(|branch| nonlinear.contact[branch]);
        self.take_switches(&period);
        if let Some(clearance) = &mut self.clearance {
            clearance.period(nonlinear, self.periods, &period, &nodes);
        }
        let law = nonlinear.system.law();
        let (start, end) = period.span();
        let energy = |time: f64| {
            let sample = period.at(time)?;
            law.energy(sample.branch, sample.gap)
        };
        if self.periods == 0 {
            self.energies[0].1 = energy(start);
        }
        self.energies[1] = (
            stored_by_lever(self.of.model, &self.state, end_phase(self.of.model)),
            energy(end),
        );
        self.periods += 1;
        if record {
            self.recorded.push(period);
        }
        Ok(())
    }

    fn state(&self) -> Vec<f64> {
        self.state.clone()
    }

    fn finish(self: Box<Self>) -> Result<Measurements, MotionError> {
        let run = *self;
        let (model, nonlinear) = (run.of.model, run.of.engine);
        let [before, after] = run.energies;
        let by_sample = after
            .1
            .zip(before.1)
            .map_or(0.0, |(end, start)| end - start);
        let functionals = run.of.required.functionals.iter().copied();
        let found = MeasuredValues {
            values: functionals
                .zip(run.values.into_iter().map(Phasor::from))
                .collect(),
            duration: run.periods as f64 * nonlinear.period,
            periods: run.periods as u64,
            contact_time: run.contact_time,
            contacts: run.contacts,
            stored: after.0 - before.0 + by_sample,
            stored_by_sample: by_sample,
            impacts: Impacts::default(),
            tone_phases: model.tone_phases.clone(),
            clearance: run
                .clearance
                .and_then(|search| search.finish(model, nonlinear)),
        };
        Ok(Measurements {
            found: (run.periods > 0).then_some(found),
            recording: Recording::of_periods(nonlinear, run.recorded),
            events: run.events,
            lows: run.lows,
            highs: run.highs,
        })
    }
}

impl NonlinearRun<'_> {
    /// Adds a period to the integrals.
    fn integrate(&mut self, nodes: &[Node]) {
        let (nonlinear, functionals) = (self.of.engine, &self.of.functionals);
        let offset = self.periods as f64 * nonlinear.period;
        let mut sums: Vec<Complex> = vec![Complex::default(); functionals.len()];
        let outputs = &self.of.outputs;
        for Node { weight, sample, .. } in nodes.iter().filter(|node| node.weight != 0.0) {
            let touches = nonlinear.contact[sample.branch];
            let signals = outputs.iter().zip(&self.of.required.signals);
            let values: Vec<f64> = signals
                .map(|(output, signal)| {
                    if signal.is_of_contact() && !touches {
                        0.0
                    } else {
                        read(nonlinear, output, sample)
                    }
                })
                .collect();
            for (sum, functional) in sums.iter_mut().zip(functionals) {
                let time = offset + sample.time;
                functional.add_node(sum, *weight, &values, |omega| omega * time);
            }
        }
        for (value, sum) in self.values.iter_mut().zip(sums) {
            *value += sum;
        }
    }

    /// Extends the extrema by those of a period.
    fn extend(&mut self, period: &Trajectory, nodes: &[Node]) {
        let mut ranges: Vec<Option<[f64; 2]>> = vec![None; self.of.outputs.len()];
        for (value, functional) in self.values.iter_mut().zip(&self.of.functionals) {
            let Some((output, sign)) = functional.extremum() else {
                continue;
            };
            let [least, greatest] = *ranges[output].get_or_insert_with(|| {
                let ends = period.ends_of_range(nodes, &self.of.outputs[output]);
                ends.map(|(_, value)| value)
            });
            value.re = if sign < 0.0 {
                value.re.min(least)
            } else {
                value.re.max(greatest)
            };
        }
        let signals = self.of.required.signals.iter().zip(ranges);
        let mut tip = signals.filter(|(signal, _)| **signal == Signal::Tip);
        if let Some([low, high]) = tip.find_map(|(_, range)| range) {
            self.lows.push(low);
            self.highs.push(high);
        }
    }

    /// Lists the beginnings and ends of contacts.
    fn take_switches(&mut self, period: &Trajectory) {
        let nonlinear = self.of.engine;
        for switch in period.switches() {
            let kind = match (nonlinear.contact[switch.from], nonlinear.contact[switch.to]) {
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
                tau: self.periods as f64 * nonlinear.period + switch.time,
                kind,
                gap_rate: switch.rate,
            });
        }
    }
}

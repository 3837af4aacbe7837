//! The sums themselves, carried along a flow.

use std::sync::Arc;

use super::request::{End, ExtremumKey, FourierKey, IntegralKey, Plan, ProductKey};
use crate::Complex;
use crate::extrema::sign_changes;
use crate::flow::{Observer, SegmentView, SwitchView};
use crate::integral::{fourier_integral, integral, product_integral};
use crate::signal::Signal;

/// Switches from one regime to another.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Switches {
    /// How many.
    pub count: u64,
    /// How many of them only grazed, within rounding.
    pub grazing: u64,
    /// The greatest speed at which the guard fell to zero.
    pub greatest_speed: f64,
    /// `Σ v²` of those speeds.
    pub squared_speeds: f64,
}

/// Accumulates what a [`Plan`] asks for. See the [module](super).
#[derive(Clone, Debug)]
pub struct Accumulator {
    plan: Arc<Plan>,
    extrema: Vec<f64>,
    integrals: Vec<f64>,
    products: Vec<f64>,
    fouriers: Vec<Complex>,
    times: Vec<f64>,
    switches: Vec<Switches>,
    duration: f64,
    periods: u64,
}

impl Accumulator {
    /// Of a motion that is still to run.
    pub fn new(plan: &Arc<Plan>) -> Self {
        let (request, regimes) = (&plan.request, plan.regimes());
        let mut accumulator = Self {
            extrema: vec![0.0; request.extrema.len()],
            integrals: vec![0.0; request.integrals.len()],
            products: vec![0.0; request.products.len()],
            fouriers: vec![Complex::new(0.0, 0.0); request.fouriers.len()],
            times: vec![0.0; regimes],
            switches: vec![Switches::default(); regimes * regimes],
            duration: 0.0,
            periods: 0,
            plan: Arc::clone(plan),
        };
        accumulator.clear();
        accumulator
    }

    /// What it accumulates.
    pub fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    /// Begins anew.
    pub fn clear(&mut self) {
        for (extremum, (_, end)) in self.extrema.iter_mut().zip(&self.plan.request.extrema) {
            *extremum = nothing_yet(*end);
        }
        self.integrals.fill(0.0);
        self.products.fill(0.0);
        self.fouriers.fill(Complex::new(0.0, 0.0));
        self.times.fill(0.0);
        self.switches.fill(Switches::default());
        self.duration = 0.0;
        self.periods = 0;
    }

    /// How long the motion ran.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// How many drive periods were completed.
    pub fn periods(&self) -> u64 {
        self.periods
    }

    /// How long the motion was in regime `regime`; 0 where there is none of this number.
    pub fn time_in(&self, regime: usize) -> f64 {
        self.times.get(regime).copied().unwrap_or(0.0)
    }

    /// The switches from regime `from` to regime `to`; none where these do not exist.
    pub fn switches(&self, from: usize, to: usize) -> Switches {
        let regimes = self.plan.regimes();
        if from < regimes && to < regimes {
            self.switches[from * regimes + to]
        } else {
            Switches::default()
        }
    }

    /// A least or greatest value; of no time, plus or minus infinity.
    pub fn extremum(&self, key: ExtremumKey) -> f64 {
        self.extrema[key.0]
    }

    /// The same, which begins anew.
    pub fn take_extremum(&mut self, key: ExtremumKey) -> f64 {
        let (_, end) = self.plan.request.extrema[key.0];
        std::mem::replace(&mut self.extrema[key.0], nothing_yet(end))
    }

    /// `∫ g dt`.
    pub fn integral(&self, key: IntegralKey) -> f64 {
        self.integrals[key.0]
    }

    /// `∫ g h dt`.
    pub fn product(&self, key: ProductKey) -> f64 {
        self.products[key.0]
    }

    /// `∫ g e^{−iωt} dt`.
    pub fn fourier(&self, key: FourierKey) -> Complex {
        self.fouriers[key.0]
    }
}

/// An extremum of no value.
fn nothing_yet(end: End) -> f64 {
    match end {
        End::Least => f64::INFINITY,
        End::Greatest => f64::NEG_INFINITY,
    }
}

impl Observer for Accumulator {
    fn segment(&mut self, segment: &SegmentView<'_>) {
        let length = segment.length;
        if length <= 0.0 {
            return;
        }
        self.duration += length;
        self.times[segment.regime] += length;
        let plan = Arc::clone(&self.plan);
        let (request, outputs) = (&plan.request, &plan.outputs[segment.regime]);
        let (drive, regime) = (segment.system.drive(), segment.regime());
        let signal = |channel: usize| {
            let output = &outputs[channel];
            Signal::of(regime, drive, output, segment.modal, segment.phase, length)
        };
        let time = self.periods as f64 * drive.period() + segment.phase;
        for (sum, &channel) in self.integrals.iter_mut().zip(&request.integrals) {
            *sum += integral(&signal(channel), length);
        }
        for (sum, &(channel, omega)) in self.fouriers.iter_mut().zip(&request.fouriers) {
            *sum += fourier_integral(&signal(channel), time, length, omega);
        }
        for (sum, &(g, h)) in self.products.iter_mut().zip(&request.products) {
            *sum += product_integral(&signal(g), &signal(h), length);
        }
        for (extremum, &(channel, end)) in self.extrema.iter_mut().zip(&request.extrema) {
            let signal = signal(channel);
            let rate = signal.differentiated(length);
            let zeros = sign_changes(&rate, length);
            for s in zeros.into_iter().chain([0.0, length]) {
                let value = signal.at(s);
                *extremum = match end {
                    End::Least => extremum.min(value),
                    End::Greatest => extremum.max(value),
                };
            }
        }
    }

    fn switch(&mut self, view: &SwitchView<'_>) {
        let (from, to) = (view.switch.from, view.switch.to);
        let switches = &mut self.switches[from * self.times.len() + to];
        switches.count += 1;
        switches.grazing += u64::from(view.grazing);
        switches.greatest_speed = switches.greatest_speed.max(-view.rate);
        switches.squared_speeds += view.rate * view.rate;
    }

    fn period_end(&mut self) {
        self.periods += 1;
    }
}

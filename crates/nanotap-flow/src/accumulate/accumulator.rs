//! The sums themselves, carried along a flow.

use std::sync::Arc;

use super::request::{Plan, RangePlan, RegimePlan, Sign};
use super::stretch::Stretch;
use crate::Complex;
use crate::functional::Functional;
use crate::integral::{fourier_integral, integral, product_integral};
use crate::observer::{Observer, SegmentView, SwitchView};
use crate::search::range::{Extend, Range, RangeWork, extend_by_certified_steps};
use crate::search::tabulated::Table;
use crate::signal::Signal;
use crate::simd::{self, LARGEST_ANGLE, layout};

/// Counts and speeds of the switches from one regime to another.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Switches {
    /// Number of switches, grazing ones included.
    pub count: u64,
    /// Number of these switches that only grazed the guard's zero, within rounding.
    pub grazing: u64,
    /// Greatest speed at which the guard fell to zero, in units of the guard per unit of time; 0
    /// without a switch.
    pub greatest_speed: f64,
    /// Sum `Σ v` of the speeds at these switches, in units of the guard per unit of time.
    pub speeds: f64,
    /// Sum `Σ v²` of the squared speeds at these switches, in squared units of the guard per unit
    /// of time.
    pub squared_speeds: f64,
}

/// Accumulates the functionals that a [`Plan`] requests. See the [module](super).
#[derive(Clone, Debug)]
pub struct Accumulator {
    plan: Arc<Plan>,
    /// Values of the functionals, by number.
    values: Vec<Complex>,
    times: Vec<f64>,
    switches: Vec<Switches>,
    duration: f64,
    periods: u64,
    /// Work space of the stretch that is added.
    stretch: Stretch,
    search: RangeWork,
}

impl Accumulator {
    /// Creates an accumulator of no motion yet, for the functionals of `plan`.
    pub fn new(plan: &Arc<Plan>) -> Self {
        let regimes = plan.regimes();
        let mut accumulator = Self {
            values: vec![Complex::new(0.0, 0.0); plan.functionals.len()],
            times: vec![0.0; regimes],
            switches: vec![Switches::default(); regimes * regimes],
            duration: 0.0,
            periods: 0,
            stretch: Stretch::default(),
            search: RangeWork::default(),
            plan: Arc::clone(plan),
        };
        accumulator.clear();
        accumulator
    }

    /// Returns the plan whose functionals are accumulated.
    pub fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    /// Resets all sums and extrema to those of no motion.
    pub fn clear(&mut self) {
        for (value, functional) in self.values.iter_mut().zip(&self.plan.functionals) {
            *value = functional.initial();
        }
        self.times.fill(0.0);
        self.switches.fill(Switches::default());
        self.duration = 0.0;
        self.periods = 0;
    }

    /// Returns how long the motion ran, in the system's unit of time.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Returns the number of completed drive periods.
    pub fn periods(&self) -> u64 {
        self.periods
    }

    /// Returns the time spent in regime `regime`, in the system's unit of time; 0 if there is no
    /// such regime.
    pub fn time_in(&self, regime: usize) -> f64 {
        self.times.get(regime).copied().unwrap_or(0.0)
    }

    /// Returns the switches from regime `from` to regime `to`; all zero if the system has none.
    pub fn switches(&self, from: usize, to: usize) -> Switches {
        let regimes = self.plan.regimes();
        if from < regimes && to < regimes {
            self.switches[from * regimes + to]
        } else {
            Switches::default()
        }
    }

    /// Returns the functionals' values by number. They are real except for Fourier coefficients;
    /// extrema of an empty motion are infinite.
    pub fn values(&self) -> &[Complex] {
        &self.values
    }

    /// Returns the value of functional `number` and resets it.
    pub fn take(&mut self, number: usize) -> f64 {
        let initial = self.plan.functionals[number].initial();
        std::mem::replace(&mut self.values[number], initial).re
    }
}

impl Accumulator {
    /// Adds a stretch of a regime whose eigenvalues are all simple.
    #[inline(always)]
    fn add_stretch(&mut self, plan: &Plan, segment: &SegmentView<'_>) {
        let (regime, drive) = (&plan.regimes[segment.regime], segment.system.drive());
        let (length, modes) = (segment.length, segment.modal.len());
        let tones = drive.frequencies().len();
        let stretch = &mut self.stretch;
        stretch.length = length;
        stretch.terms.clear();
        let terms = (0..modes + tones)
            .map(|k| [segment.packed, segment.turns].map(|list| layout::get(list, k)));
        stretch
            .terms
            .extend(terms.chain([[Complex::new(1.0, 0.0); 2]]));
        let used = |channel: usize| !regime.weights[channel].is_empty();

        if plan.integrals.iter().any(|&(_, c)| used(c)) {
            stretch.integrate(&regime.rates);
            for &(number, channel) in &plan.integrals {
                self.values[number].re += stretch.integral(&regime.weights[channel]);
            }
        }
        for (number, (frequency, rates)) in plan.frequencies.iter().zip(&regime.turned).enumerate()
        {
            let wanted = |&(_, c, n): &(usize, usize, usize)| n == number && used(c);
            if !plan.fouriers.iter().any(wanted) {
                continue;
            }
            // A power of the tone's phase is as exact after any number of periods.
            let [start, over] = if let Some((tone, n)) = frequency.multiple {
                stretch.terms[modes + tone].map(|phasor| phasor.powu(n))
            } else {
                let time = self.periods as f64 * drive.period() + segment.phase;
                [time, length].map(|t| {
                    let (sin, cos) = nanotap_arithmetic::sin_cos(frequency.omega * t);
                    Complex::new(cos, sin)
                })
            };
            stretch.turn(rates, start.conj(), over.conj());
            for fourier in plan.fouriers.iter().filter(|f| wanted(f)) {
                self.values[fourier.0] += stretch.fourier(&regime.weights[fourier.1]);
            }
        }
        if regime.products.iter().any(|weights| !weights.is_empty()) {
            stretch.pair(&regime.rates);
            for (&(number, ..), weights) in plan.products.iter().zip(&regime.products) {
                self.values[number].re += stretch.product(weights);
            }
        }
    }

    /// Adds a stretch of a regime with coinciding eigenvalues, from signals.
    #[cold]
    fn add_clustered_stretch(&mut self, plan: &Plan, segment: &SegmentView<'_>) {
        let length = segment.length;
        let signal = |channel: usize| signal(plan, segment, channel);
        let time = self.periods as f64 * segment.system.drive().period() + segment.phase;
        for (sum, functional) in self.values.iter_mut().zip(&plan.functionals) {
            *sum += match *functional {
                Functional::Least(_) | Functional::Greatest(_) => continue,
                Functional::Integral(g) => integral(&signal(g), length).into(),
                Functional::Product(g, h) => {
                    product_integral(&signal(g), &signal(h), length).into()
                }
                Functional::Fourier(g, omega) => fourier_integral(&signal(g), time, length, omega),
            };
        }
    }

    /// Extends the extrema of channel `wanted.channel` over a stretch.
    #[inline(always)]
    fn extend_range(&mut self, plan: &Plan, segment: &SegmentView<'_>, wanted: &RangePlan) {
        let known =
            |key: Option<usize>, otherwise: f64| key.map_or(otherwise, |k| self.values[k].re);
        let mut range = Range {
            least: known(wanted.least, f64::MIN),
            greatest: known(wanted.greatest, f64::MAX),
        };
        let regime = &plan.regimes[segment.regime];
        let weights = &regime.weights[wanted.channel];
        if weights.is_empty() {
            range.hold(0.0);
        } else if let Some(table) = Self::table(regime, segment) {
            let kernel = &regime.kernels[wanted.channel];
            let size = self.stretch.size(weights);
            for end in self.stretch.ends(weights) {
                range.hold(if end.abs() <= DROWNED * size {
                    0.0
                } else {
                    end
                });
            }
            // What a guard says of the sign, or the size of all terms, may settle it.
            let sign = regime.signs[wanted.channel];
            let lower =
                range.least <= -size || sign == Some(Sign::NotNegative) && range.least <= 0.0;
            let upper =
                range.greatest >= size || sign == Some(Sign::NotPositive) && range.greatest >= 0.0;
            if !(lower && upper) {
                let (packed, length) = (segment.packed, segment.length);
                let mut within = Range {
                    least: if lower { f64::MIN } else { range.least },
                    greatest: if upper { f64::MAX } else { range.greatest },
                };
                simd::dispatch(Extend {
                    range: &mut within,
                    table,
                    kernel,
                    packed,
                    length,
                    work: &mut self.search,
                });
                if !lower {
                    range.least = within.least;
                }
                if !upper {
                    range.greatest = within.greatest;
                }
            }
        } else {
            let signal = signal(plan, segment, wanted.channel);
            extend_by_certified_steps(&mut range, &signal, segment.length);
        }
        if let Some(key) = wanted.least {
            self.values[key].re = range.least;
        }
        if let Some(key) = wanted.greatest {
            self.values[key].re = range.greatest;
        }
    }

    /// Returns the table for the outputs of a regime: that of its guards, or a separate one.
    #[inline(always)]
    fn table<'a>(regime: &'a RegimePlan, segment: &SegmentView<'a>) -> Option<&'a Table> {
        if segment.system.largest_angle() > LARGEST_ANGLE {
            return None;
        }
        let transitions = segment.system.prepared(segment.regime);
        let guards = || {
            transitions
                .iter()
                .find_map(|transition| transition.table.as_ref())
        };
        regime.table.as_ref().or_else(guards)
    }
}

/// A value at an end of a stretch counts as zero below this fraction of the size of its terms: it
/// is rounding.
const DROWNED: f64 = 128.0 * f64::EPSILON;

fn signal(plan: &Plan, segment: &SegmentView<'_>, channel: usize) -> Signal {
    segment.signal(&plan.regimes[segment.regime].outputs[channel])
}

impl Observer for Accumulator {
    fn segment(&mut self, segment: &SegmentView<'_>) {
        if segment.length <= 0.0 {
            return;
        }
        self.duration += segment.length;
        self.times[segment.regime] += segment.length;
        let plan = Arc::clone(&self.plan);
        if segment.regime().basis().clusters.is_empty() {
            self.add_stretch(&plan, segment);
        } else {
            self.add_clustered_stretch(&plan, segment);
        }
        for wanted in &plan.ranges {
            self.extend_range(&plan, segment, wanted);
        }
    }

    fn switch(&mut self, view: &SwitchView<'_>) {
        let (from, to) = (view.switch.from, view.switch.to);
        let switches = &mut self.switches[from * self.times.len() + to];
        switches.count += 1;
        switches.grazing += u64::from(view.grazing);
        switches.greatest_speed = switches.greatest_speed.max(-view.rate);
        switches.speeds -= view.rate;
        switches.squared_speeds += view.rate * view.rate;
    }

    fn period_end(&mut self) {
        self.periods += 1;
    }
}

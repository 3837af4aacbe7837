//! A request for functionals of outputs, and the same made ready for one system.

use std::sync::Arc;

use super::stretch::{Rates, pair_weights};
use crate::functional::Functional;
use crate::rate::Rate;
use crate::regime::{Kernel, KernelFrame, ModalOutput};
use crate::search::tabulated::Table;
use crate::{Complex, Drive, FlowError, Output, Regime, System};

/// An output, the same in every regime or one per regime.
#[derive(Clone, Debug, PartialEq)]
enum Outputs {
    Same(Output),
    ByRegime(Vec<Output>),
}

/// Outputs and functionals of them, both by number. See the [module](super).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Request {
    outputs: Vec<Outputs>,
    functionals: Vec<Functional>,
}

impl Request {
    /// Creates a request without outputs and functionals.
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns the functionals, in the order of their numbers.
    pub fn functionals(&self) -> &[Functional] {
        &self.functionals
    }

    /// Adds an output that is the same in every regime, and returns its number.
    pub fn output(&mut self, output: &Output) -> usize {
        place(&mut self.outputs, Outputs::Same(output.clone()))
    }

    /// Adds an output that differs from regime to regime, such as a contact force (one entry per
    /// regime), and returns its number.
    pub fn output_by_regime(&mut self, outputs: &[Output]) -> usize {
        place(&mut self.outputs, Outputs::ByRegime(outputs.to_vec()))
    }

    /// Adds a functional of the outputs, and returns its number.
    pub fn add(&mut self, functional: Functional) -> usize {
        let functional = match functional {
            Functional::Product(g, h) => Functional::Product(g.min(h), g.max(h)),
            other => other,
        };
        place(&mut self.functionals, functional)
    }

    /// Prepares the request for `system`.
    ///
    /// # Errors
    /// If an output does not fit the system (its length, its tones, or its number of regimes), or
    /// if a value or frequency is not finite.
    pub fn plan(&self, system: &System) -> Result<Arc<Plan>, FlowError> {
        let (n, tones) = (system.dimension(), system.drive().frequencies().len());
        let regimes = system.regimes();
        let mut omegas = self.functionals.iter().filter_map(|f| f.frequency());
        if omegas.any(|omega| !omega.is_finite()) {
            return Err(FlowError::NotFinite {
                what: "a frequency of a Fourier coefficient",
            });
        }
        let mut outputs = vec![Vec::with_capacity(self.outputs.len()); regimes.len()];
        let mut signs = vec![Vec::with_capacity(self.outputs.len()); regimes.len()];
        for channel in &self.outputs {
            if let Outputs::ByRegime(all) = channel
                && all.len() != regimes.len()
            {
                return Err(FlowError::Shape {
                    what: "an output for each regime",
                    found: all.len(),
                    expected: regimes.len(),
                });
            }
            for (r, (regime, modal)) in regimes.iter().zip(&mut outputs).enumerate() {
                let guards = &system.transitions()[r];
                let output = match channel {
                    Outputs::Same(output) => output,
                    Outputs::ByRegime(all) => &all[r],
                };
                output.check("an output", n, tones)?;
                modal.push(regime.project(output));
                let reversed = output.scaled(-1.0);
                signs[r].push(guards.iter().find_map(|transition| {
                    if transition.guard == *output {
                        Some(Sign::NotNegative)
                    } else {
                        (transition.guard == reversed).then_some(Sign::NotPositive)
                    }
                }));
            }
        }
        let (mut frequencies, mut fouriers) = (Vec::new(), Vec::new());
        let (mut integrals, mut products) = (Vec::new(), Vec::new());
        let mut ranges: Vec<RangePlan> = Vec::new();
        for (number, functional) in self.functionals.iter().enumerate() {
            match *functional {
                Functional::Least(channel) | Functional::Greatest(channel) => {
                    let at = ranges.iter().position(|r| r.channel == channel);
                    let at = at.unwrap_or_else(|| {
                        ranges.push(RangePlan {
                            channel,
                            least: None,
                            greatest: None,
                        });
                        ranges.len() - 1
                    });
                    match functional {
                        Functional::Least(_) => ranges[at].least = Some(number),
                        _ => ranges[at].greatest = Some(number),
                    }
                }
                Functional::Integral(channel) => integrals.push((number, channel)),
                Functional::Product(g, h) => products.push((number, g, h)),
                Functional::Fourier(channel, omega) => {
                    let frequency = place(&mut frequencies, omega);
                    fouriers.push((number, channel, frequency));
                }
            }
        }
        let regimes = regimes.iter().zip(outputs).zip(signs).enumerate();
        let regimes = regimes
            .map(|(r, ((regime, outputs), signs))| {
                // The table of a guard serves every output of its regime.
                let tabulated = system
                    .prepared(r)
                    .iter()
                    .any(|transition| transition.table.as_ref().is_some_and(Table::is_complete));
                let drive = system.drive();
                let plan =
                    RegimePlan::new(regime, drive, outputs, &frequencies, &products, tabulated);
                RegimePlan { signs, ..plan }
            })
            .collect();
        let frequencies = frequencies.into_iter();
        Ok(Arc::new(Plan {
            functionals: self.functionals.clone(),
            ranges,
            integrals,
            products,
            fouriers,
            frequencies: frequencies
                .map(|omega| Frequency::new(omega, system.drive()))
                .collect(),
            regimes,
        }))
    }
}

/// Returns the position of `item` in the list, and appends it if it is missing.
fn place<T: PartialEq>(list: &mut Vec<T>, item: T) -> usize {
    list.iter()
        .position(|other| *other == item)
        .unwrap_or_else(|| {
            list.push(item);
            list.len() - 1
        })
}

/// A [`Request`] prepared for one [`System`].
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    pub(super) functionals: Vec<Functional>,
    pub(super) ranges: Vec<RangePlan>,
    /// Number and channel of each integral.
    pub(super) integrals: Vec<(usize, usize)>,
    /// Number and channels of each product.
    pub(super) products: Vec<(usize, usize, usize)>,
    /// Number, channel and number of the frequency of each Fourier coefficient.
    pub(super) fouriers: Vec<(usize, usize, usize)>,
    pub(super) frequencies: Vec<Frequency>,
    pub(super) regimes: Vec<RegimePlan>,
}

/// The angular frequency of a Fourier coefficient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frequency {
    pub(super) omega: f64,
    /// The tone of which it is a multiple, and the multiple; `None` if it is not a multiple of any
    /// tone.
    pub(super) multiple: Option<(usize, u32)>,
}

/// Highest multiple of a tone whose phase is taken as a power of the tone's.
const HIGHEST_MULTIPLE: f64 = 1024.0;

impl Frequency {
    fn new(omega: f64, drive: &Drive) -> Self {
        let multiple = drive
            .frequencies()
            .iter()
            .enumerate()
            .find_map(|(k, tone)| {
                let n = (omega / tone).round();
                let is_multiple = (n * tone - omega).abs() <= 2.0 * f64::EPSILON * omega.abs();
                ((1.0..=HIGHEST_MULTIPLE).contains(&n) && is_multiple).then_some((k, n as u32))
            });
        Self { omega, multiple }
    }
}

/// The requested extrema of one channel, by their numbers among the functionals.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RangePlan {
    pub(super) channel: usize,
    pub(super) least: Option<usize>,
    pub(super) greatest: Option<usize>,
}

/// Sign of a channel, as a guard determines it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sign {
    NotNegative,
    NotPositive,
}

/// The channels in one regime.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RegimePlan {
    pub(super) outputs: Vec<ModalOutput>,
    /// Weights of modes, tones and constant for each channel; empty where the channel is zero.
    pub(super) weights: Vec<Vec<Complex>>,
    /// Weights of the pairs of terms for each product; empty where a channel is zero.
    pub(super) products: Vec<Vec<[Complex; 2]>>,
    pub(super) kernels: Vec<Kernel>,
    pub(super) rates: Rates,
    /// Rates `λ − iω` and `λ̄ − iω` of the terms, for each frequency.
    pub(super) turned: Vec<Vec<[Rate; 2]>>,
    /// For each channel, its sign if it is a guard of the regime (not negative) or the negative of
    /// one.
    pub(super) signs: Vec<Option<Sign>>,
    /// Table of the channels, if the tables of the guards do not follow every term.
    pub(super) table: Option<Table>,
}

impl RegimePlan {
    fn new(
        regime: &Regime,
        drive: &Drive,
        outputs: Vec<ModalOutput>,
        frequencies: &[f64],
        products: &[(usize, usize, usize)],
        tabulated: bool,
    ) -> Self {
        let weights: Vec<Vec<Complex>> = outputs.iter().map(weights).collect();
        let product = |&(_, g, h): &(usize, usize, usize)| pair_weights(&weights[g], &weights[h]);
        let pairs = products.iter().map(product).collect();
        let frame = KernelFrame::new(regime, drive);
        let kernels: Vec<Kernel> = outputs.iter().map(|o| frame.kernel(o)).collect();
        let rates = Rates::new(&regime.basis().eigenvalues, drive, !products.is_empty());
        let turned = frequencies
            .iter()
            .map(|&omega| rates.turned(omega))
            .collect();
        let clustered = !regime.basis().clusters.is_empty();
        let table = kernels.first().filter(|_| !tabulated && !clustered);
        let table = table.and_then(|kernel| Table::for_extrema(kernel, drive.period()));
        Self {
            outputs,
            weights,
            products: pairs,
            kernels,
            rates,
            turned,
            signs: Vec::new(),
            table,
        }
    }
}

fn weights(output: &ModalOutput) -> Vec<Complex> {
    let constant = Complex::new(output.constant, 0.0);
    let all: Vec<Complex> = output
        .modal
        .iter()
        .chain(&output.tones)
        .copied()
        .chain([constant])
        .collect();
    if all.iter().all(|w| w.re == 0.0 && w.im == 0.0) {
        Vec::new()
    } else {
        all
    }
}

impl Plan {
    /// Returns the number of regimes of the system.
    pub(super) fn regimes(&self) -> usize {
        self.regimes.len()
    }
}

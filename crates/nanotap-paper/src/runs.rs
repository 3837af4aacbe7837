//! Results that several sections need: censuses, each computed once, orbits, and progress.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::atomic::{AtomicUsize, Ordering};

use nanotap_dynamics::{
    AttractorKind, Census, CensusOptions, ClassifyOptions, Control, Fraction, Lifetime,
    LyapunovOptions, LyapunovSpectrum, OrbitSearch, PeriodicOrbit, StartBox, census, find_orbits,
};

use super::check::digits;
use super::{PaperError, rerun};
use nanotap::case::Case;
use nanotap::model::Model;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::model_map::ModelMap;
use nanotap::observe::{ObservableSet, Observables, measure};
use nanotap::study::orbit::{OrbitReport, report};
use nanotap::study::proof::Prover;
use nanotap::study::start_box::default_box;

/// The seed of every set of initial states.
pub(super) const SEED: u64 = 1;
/// Number of harmonics of an orbit; only its extrema and contacts are used.
const HARMONICS: usize = 1;
/// Drive periods over which a motion that never repeats is observed.
const OBSERVED_PERIODS: usize = 400;

/// Results that the sections share: every census and scan of grids is computed once.
pub(super) struct Runs<'a> {
    quick: bool,
    control: &'a Control<'a>,
    /// Fraction of the whole computation before this section, and the fraction of this section.
    share: Cell<(f64, f64)>,
    /// Reported progress in percent; it never decreases.
    reported: AtomicUsize,
    counts: RefCell<Vec<Rc<Counted>>>,
    found: RefCell<Vec<CaseOrbits>>,
    shared: RefCell<Vec<Rc<dyn Any>>>,
}

/// The orbits of a case that one search found.
struct CaseOrbits {
    case: Cantilever,
    search: OrbitSearch,
    orbits: Rc<[PeriodicOrbit]>,
}

impl<'a> Runs<'a> {
    pub(super) fn new(quick: bool, control: &'a Control<'a>) -> Self {
        Self {
            quick,
            control,
            share: Cell::new((0.0, 1.0)),
            reported: AtomicUsize::new(0),
            counts: RefCell::default(),
            found: RefCell::default(),
            shared: RefCell::default(),
        }
    }

    /// Begins a section: `before` is the fraction finished, `own` that of the section.
    pub(super) fn begin(&self, before: f64, own: f64) {
        self.share.set((before, own));
        report_percent(self.control, &self.reported, before);
    }

    pub(super) fn quick(&self) -> bool {
        self.quick
    }

    /// `quick` with [`crate::Options::quick`], otherwise `full`.
    pub(super) fn either<T>(&self, full: T, quick: T) -> T {
        if self.quick { quick } else { full }
    }

    /// Runs `work` with a control that reports the progress of the whole.
    pub(super) fn controlled<T>(&self, work: impl FnOnce(&Control<'_>) -> T) -> T {
        let (before, own) = self.share.get();
        let (control, reported) = (self.control, &self.reported);
        let hear = |done: usize, total: usize| {
            report_percent(
                control,
                reported,
                before + own * done as f64 / total.max(1) as f64,
            );
        };
        work(&Control {
            cancel: control.cancel,
            progress: Some(&hear),
        })
    }

    /// The census of `case`, computed when first requested.
    pub(super) fn count(&self, case: &Cantilever) -> Result<Rc<Counted>, PaperError> {
        if let Some(known) = self.counts.borrow().iter().find(|c| c.case == *case) {
            return Ok(Rc::clone(known));
        }
        let model = Model::cantilever(case)?;
        let starts = start_box(&model)?;
        let count = self.either(256, 24);
        let options = CensusOptions {
            classify: ClassifyOptions {
                lyapunov: LyapunovOptions {
                    max_periods: self.either(4000, 1500),
                    relative_error: 0.05,
                    ..LyapunovOptions::default()
                },
                ..ClassifyOptions::default()
            },
            ..CensusOptions::default()
        };
        let map = ModelMap::new(&model);
        let census =
            self.controlled(|control| census(&map, &starts.starts(SEED, count), &options, control));
        if census.cancelled {
            return Err(PaperError::Cancelled);
        }
        let counted = Rc::new(Counted {
            case: case.clone(),
            model,
            census,
            starts: count,
        });
        self.counts.borrow_mut().push(Rc::clone(&counted));
        Ok(counted)
    }

    /// Every periodic orbit up to `longest`, stable or not, that Newton's method reaches from
    /// states in the box and from near returns of runs of `run` periods; searched for when first
    /// requested.
    pub(super) fn orbits(
        &self,
        counted: &Counted,
        longest: usize,
        run: usize,
    ) -> Result<Rc<[PeriodicOrbit]>, PaperError> {
        let starts = start_box(&counted.model)?;
        let search = OrbitSearch {
            max_period: longest,
            run,
            ..OrbitSearch::default()
        };
        let same = |f: &&CaseOrbits| f.case == counted.case && f.search == search;
        if let Some(known) = self.found.borrow().iter().find(same) {
            return Ok(Rc::clone(&known.orbits));
        }
        let map = ModelMap::new(&counted.model);
        let count = self.either(64, 12);
        let orbits: Rc<[PeriodicOrbit]> = self
            .controlled(|control| find_orbits(&map, &starts.starts(SEED, count), &search, control))
            .into();
        self.found.borrow_mut().push(CaseOrbits {
            case: counted.case.clone(),
            search,
            orbits: Rc::clone(&orbits),
        });
        Ok(orbits)
    }

    /// `count` initial states in the box of a case.
    pub(super) fn starts(counted: &Counted, count: usize) -> Result<Vec<Vec<f64>>, PaperError> {
        let starts = start_box(&counted.model)?;
        Ok(starts.starts(SEED, count))
    }

    /// A result that several sections need, computed once; there is one of each type.
    pub(super) fn shared<T: 'static>(
        &self,
        make: impl FnOnce(&Self) -> Result<T, PaperError>,
    ) -> Result<Rc<T>, PaperError> {
        let known = |one: &Rc<dyn Any>| Rc::clone(one).downcast().ok();
        let known = self.shared.borrow().iter().find_map(known);
        if let Some(known) = known {
            return Ok(known);
        }
        let made = Rc::new(make(self)?);
        self.shared.borrow_mut().push(made.clone());
        Ok(made)
    }
}

/// Reports the finished fraction of the whole, unless more was reported before: a section may have
/// several tasks.
fn report_percent(control: &Control<'_>, reported: &AtomicUsize, part: f64) {
    let percent = (100.0 * part) as usize;
    if let Some(progress) = control.progress
        && reported.fetch_max(percent, Ordering::Relaxed) <= percent
    {
        progress(percent, 100);
    }
}

/// The box of the initial states.
fn start_box(model: &Model) -> Result<StartBox, PaperError> {
    default_box(model).map_err(PaperError::failed("the box of initial states"))
}

/// Chaos from which no escape was observed.
pub(super) struct Chaos<'a> {
    pub(super) spectrum: &'a LyapunovSpectrum,
    pub(super) lifetime: Lifetime,
    pub(super) fraction: Fraction,
    /// A state on the attractor at drive phase 0.
    pub(super) state: &'a [f64],
}

/// A case with its census.
pub(super) struct Counted {
    pub(super) case: Cantilever,
    pub(super) model: Model,
    pub(super) census: Census,
    /// Number of initial states of the census.
    pub(super) starts: usize,
}

impl Counted {
    /// Stable orbits of this period (in drive periods), with their fractions of the initial states.
    pub(super) fn stable(&self, period: usize) -> Vec<(&PeriodicOrbit, Fraction)> {
        self.all_stable()
            .into_iter()
            .filter(|(orbit, _)| orbit.period == period)
            .collect()
    }

    /// Every stable periodic orbit, with its fraction of the initial states.
    pub(super) fn all_stable(&self) -> Vec<(&PeriodicOrbit, Fraction)> {
        self.census
            .attractors
            .iter()
            .filter_map(|a| match &a.kind {
                AttractorKind::Periodic(orbit) => Some((orbit, a.fraction)),
                _ => None,
            })
            .collect()
    }

    /// Chaotic attractors, with their fractions of the initial states.
    pub(super) fn chaos(&self) -> Vec<Chaos<'_>> {
        self.census
            .attractors
            .iter()
            .filter_map(|a| match &a.kind {
                AttractorKind::Chaotic { spectrum, lifetime } => Some(Chaos {
                    spectrum,
                    lifetime: *lifetime,
                    fraction: a.fraction,
                    state: &a.state,
                }),
                _ => None,
            })
            .collect()
    }

    /// Observables of a motion that does not repeat, over [`OBSERVED_PERIODS`] periods from `state`.
    pub(super) fn watch(&self, state: &[f64]) -> Result<Observables, PaperError> {
        measure(&self.model, state, OBSERVED_PERIODS, ObservableSet::ALL)
            .map_err(PaperError::failed("a run to observe"))
    }

    /// Observables of a closed orbit of this case.
    pub(super) fn look(&self, orbit: &PeriodicOrbit) -> Result<OrbitReport, PaperError> {
        report(&self.model, orbit, HARMONICS).map_err(PaperError::failed(format!(
            "a period-{} orbit",
            orbit.period
        )))
    }

    /// The result of a proof for an orbit, to be appended to its description; empty if nothing was
    /// proved.
    pub(super) fn proved(&self, orbit: &PeriodicOrbit) -> String {
        let prover = Prover::new(&Case::from(self.case.clone()));
        let theorem = self
            .look(orbit)
            .ok()
            .and_then(|o| prover.report(&o.trajectory, o.period).theorem);
        theorem.map_or_else(String::new, |theorem| match theorem.stability {
            "undecided" => ", proved to exist".to_owned(),
            word => format!(", proved to exist and to be {word}"),
        })
    }

    /// The kinds of the attractors, most frequent first.
    pub(super) fn kinds(&self) -> Vec<String> {
        self.census
            .attractors
            .iter()
            .map(|attractor| match &attractor.kind {
                AttractorKind::Periodic(orbit) => format!("period {}", orbit.period),
                AttractorKind::QuasiPeriodic(_) => "torus".to_owned(),
                AttractorKind::Chaotic { .. } => "chaos".to_owned(),
            })
            .chain(
                self.census
                    .transient_chaos
                    .iter()
                    .map(|_| "transient chaos".to_owned()),
            )
            .collect()
    }

    /// Lists all attractors, and what else the initial states led to, in one sentence.
    pub(super) fn summary(&self) -> String {
        let mut parts: Vec<String> = Vec::new();
        for attractor in &self.census.attractors {
            let count = attractor.fraction.count;
            parts.push(match &attractor.kind {
                AttractorKind::Periodic(orbit) => format!(
                    "a stable period-{} orbit ({count} starts, largest |μ| {}{})",
                    orbit.period,
                    digits(orbit.spectral_radius(), 4),
                    self.proved(orbit)
                ),
                AttractorKind::QuasiPeriodic(_) => format!("a torus ({count} starts)"),
                AttractorKind::Chaotic { spectrum, lifetime } => {
                    let (exponent, error) = spectrum.largest();
                    format!(
                        "chaos ({count} starts, λ₁ = {exponent:.3} ± {error:.3} per period; no escape observed, so \
                         its mean lifetime is above {:.0} periods at 95 %)",
                        lifetime.low
                    )
                }
            });
        }
        if let Some(chaos) = &self.census.transient_chaos {
            parts.push(format!(
                "transient chaos ({} starts not yet escaped)",
                chaos.unescaped.count
            ));
        }
        if !self.census.undecided.is_empty() {
            parts.push(format!("{} starts undecided", self.census.undecided.len()));
        }
        format!("of {} starts: {}", self.starts, parts.join("; "))
    }

    /// Upper bound of the share of the box of attractors that were not found.
    pub(super) fn missed(&self) -> String {
        format!(
            "the basin of an attractor that none of {} starts found is smaller than {:.1} % of the box (95 %)",
            self.starts,
            100.0 * Fraction::new(0, self.starts).high
        )
    }

    /// The command line that computes this census.
    pub(super) fn rerun(&self) -> String {
        rerun::on_case(
            "attractors",
            &self.case,
            &format!("--starts {} --seed {SEED}", self.starts),
        )
    }
}

/// Whether an orbit is stable, in a word.
pub(super) fn stability(orbit: &PeriodicOrbit) -> &'static str {
    if orbit.is_stable() {
        "stable"
    } else {
        "unstable"
    }
}

/// A number of motions of one kind, as text: "no stable period-2 orbit".
pub(super) fn how_many(count: usize, kind: &str) -> String {
    match count {
        0 => format!("no {kind}"),
        1 => format!("one {kind}"),
        n => format!("{n} {kind}s"),
    }
}

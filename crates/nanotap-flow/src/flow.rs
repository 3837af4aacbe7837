//! Running a system: from switch to switch in modal coordinates, one drive period
//! at a time.

use crate::crossing::{Crossing, Start, Statistics, first_crossing};
use crate::regime::Regime;
use crate::signal::Signal;
use crate::system::{Switch, System};
use crate::{Complex, FlowError};
use std::sync::Arc;

/// A stretch within one regime and one drive period.
#[derive(Clone, Copy, Debug)]
pub struct SegmentView<'a> {
    /// The system.
    pub system: &'a System,
    /// The regime's number.
    pub regime: usize,
    /// When it starts, within its drive period (`0 ≤ phase < T`).
    pub phase: f64,
    /// How long it lasts.
    pub length: f64,
    /// Modal coordinates at its start.
    pub modal: &'a [Complex],
    /// `e^{λ_k · length}`.
    pub factors: &'a [Complex],
}

impl SegmentView<'_> {
    /// The regime.
    pub fn regime(&self) -> &Regime {
        &self.system.regimes()[self.regime]
    }
}

/// A switch from one regime to another.
#[derive(Clone, Copy, Debug)]
pub struct SwitchView<'a> {
    /// The system.
    pub system: &'a System,
    /// The change of modal coordinates.
    pub switch: &'a Switch,
    /// The number of the exit taken out of `switch.from`.
    pub exit: usize,
    /// Whether it ended chatter: the motion goes on in the sticking regime.
    pub stuck: bool,
    /// When it happens, within its drive period.
    pub phase: f64,
    /// The guard's rate before it.
    pub rate: f64,
    /// Whether the guard only grazed zero, within rounding.
    pub grazing: bool,
    /// Modal coordinates before it.
    pub modal: &'a [Complex],
}

/// Something that watches a flow: a recorder, a Jacobian, a sensitivity.
pub trait Observer {
    /// A stretch within one regime was completed.
    fn segment(&mut self, segment: &SegmentView<'_>) {
        let _ = segment;
    }
    /// A switch happened.
    fn switch(&mut self, switch: &SwitchView<'_>) {
        let _ = switch;
    }
    /// A drive period was completed; the phase is zero again.
    fn period_end(&mut self) {}
}

impl Observer for () {}

impl<A: Observer, B: Observer> Observer for (&mut A, &mut B) {
    fn segment(&mut self, segment: &SegmentView<'_>) {
        self.0.segment(segment);
        self.1.segment(segment);
    }
    fn switch(&mut self, switch: &SwitchView<'_>) {
        self.0.switch(switch);
        self.1.switch(switch);
    }
    fn period_end(&mut self) {
        self.0.period_end();
        self.1.period_end();
    }
}

/// A motion of a [`System`] with its work space. Cloning shares the system.
#[derive(Clone, Debug)]
pub struct Flow {
    system: Arc<System>,
    regime: usize,
    phase: f64,
    modal: Vec<Complex>,
    /// The exit whose guard starts at zero, and how.
    surface: Option<(usize, Start)>,
    signal: Signal,
    phasors: Vec<Complex>,
    factors: Vec<Complex>,
    stacked: Vec<f64>,
    state: Vec<f64>,
    statistics: Statistics,
    switches: u64,
}

/// Switches without time passing before chatter without a sticking regime is refused.
const STALLED_SWITCHES: u32 = 1000;
/// An impact sequence ends in sticking when its flights last less than this part
/// of the fastest time scale: what is left of it is below rounding (second order).
const CHATTER_RESOLUTION: f64 = 1e-8;

impl Flow {
    /// A flow of `system`; call [`Flow::start`] before running it.
    pub fn new(system: Arc<System>) -> Self {
        let largest = system.regimes().iter().map(|r| r.basis().len()).max().unwrap_or(0);
        let tones = system.drive().frequencies().len();
        let zero = Complex::new(0.0, 0.0);
        Self {
            regime: 0,
            phase: 0.0,
            modal: Vec::with_capacity(largest),
            surface: None,
            signal: Signal::default(),
            phasors: vec![zero; tones],
            factors: vec![zero; largest],
            stacked: vec![0.0; 2 * largest],
            state: vec![0.0; system.dimension()],
            statistics: Statistics::default(),
            switches: 0,
            system,
        }
    }

    /// The system.
    pub fn system(&self) -> &Arc<System> {
        &self.system
    }

    /// What the searches for switches have cost so far.
    pub fn statistics(&self) -> Statistics {
        self.statistics
    }

    /// Switches so far.
    pub fn switches(&self) -> u64 {
        self.switches
    }

    /// The regime the motion is in.
    pub fn regime(&self) -> usize {
        self.regime
    }

    /// The time within the drive period.
    pub fn phase(&self) -> f64 {
        self.phase
    }

    /// Puts the motion at state `x` (length `n`) and time `phase` within the period.
    ///
    /// # Errors
    /// When a value is not finite, the length is wrong, or no regime holds the state.
    pub fn start(&mut self, x: &[f64], phase: f64) -> Result<(), FlowError> {
        let n = self.system.dimension();
        if x.len() != n {
            return Err(FlowError::Shape { what: "the state", found: x.len(), expected: n });
        }
        if !x.iter().all(|v| v.is_finite()) || !phase.is_finite() {
            return Err(FlowError::NotFinite { what: "the state" });
        }
        let (regime, surface) = self.system.regime_at(x, phase)?;
        self.regime = regime;
        self.phase = phase;
        self.surface = surface.map(|exit| (exit, Start::Surface { rate: None }));
        let basis = self.system.regimes()[regime].basis();
        self.modal.resize(basis.len(), Complex::new(0.0, 0.0));
        self.system.regimes()[regime].to_modal(self.system.drive(), x, phase, &mut self.modal);
        Ok(())
    }

    /// Writes the state (length `n`) to `x`.
    pub fn state(&self, x: &mut [f64]) {
        self.system.regimes()[self.regime].to_state(self.system.drive(), &self.modal, self.phase, x);
    }

    /// Runs to the end of the drive period; the phase is then zero.
    ///
    /// # Errors
    /// When the motion diverges, or chatters with no sticking regime to end in.
    pub fn run_period<O: Observer>(&mut self, observer: &mut O) -> Result<(), FlowError> {
        let period = self.system.drive().period();
        self.run_until(period, observer)?;
        self.phase = 0.0;
        observer.period_end();
        Ok(())
    }

    /// Runs to time `end` within the same drive period.
    ///
    /// # Errors
    /// As [`Flow::run_period`].
    pub fn run_until<O: Observer>(&mut self, end: f64, observer: &mut O) -> Result<(), FlowError> {
        let system = Arc::clone(&self.system);
        let mut stalled = 0;
        while self.phase < end {
            let left = end - self.phase;
            for (k, phasor) in self.phasors.iter_mut().enumerate() {
                *phasor = system.drive().phasor(k, self.phase);
            }
            let found = self.next_crossing(&system, left)?;
            let length = found.map_or(left, |(_, crossing)| crossing.at);
            self.pass(&system, length, observer);
            let Some((exit, crossing)) = found else {
                self.phase = end;
                break;
            };
            stalled = if length <= f64::EPSILON * end { stalled + 1 } else { 0 };
            if stalled > STALLED_SWITCHES {
                return Err(FlowError::Accumulation { time: self.phase });
            }
            self.switch(&system, exit, crossing, observer);
        }
        Ok(())
    }

    /// The earliest exit within `left`.
    fn next_crossing(&mut self, system: &System, left: f64) -> Result<Option<(usize, Crossing)>, FlowError> {
        let regime = &system.regimes()[self.regime];
        let mut earliest: Option<(usize, Crossing)> = None;
        for (e, exit) in system.prepared(self.regime).iter().enumerate() {
            let horizon = earliest.map_or(left, |(_, c)| c.at);
            self.signal.refill(regime, system.drive(), &exit.guard, &self.modal, &self.phasors, horizon);
            if !self.signal.is_finite() {
                return Err(FlowError::Diverged { time: self.phase });
            }
            let start = match self.surface {
                Some((surface, start)) if surface == e => start,
                _ => Start::Inside,
            };
            if let Some(crossing) = first_crossing(&self.signal, horizon, start, &mut self.statistics) {
                earliest = Some((e, crossing));
            }
        }
        Ok(earliest)
    }

    /// Moves on by `length` within the regime.
    fn pass<O: Observer>(&mut self, system: &System, length: f64, observer: &mut O) {
        let basis = system.regimes()[self.regime].basis();
        let factors = &mut self.factors[..basis.len()];
        for (factor, lambda) in factors.iter_mut().zip(&basis.eigenvalues) {
            *factor = (lambda * length).exp();
        }
        observer.segment(&SegmentView {
            system,
            regime: self.regime,
            phase: self.phase,
            length,
            modal: &self.modal,
            factors,
        });
        basis.apply(&mut self.modal, length, factors);
        self.phase += length;
        if length > 0.0 {
            self.surface = None;
        }
    }

    /// Takes exit `exit`.
    fn switch<O: Observer>(&mut self, system: &System, exit: usize, crossing: Crossing, observer: &mut O) {
        self.switches += 1;
        let description = &system.exits()[self.regime][exit];
        let prepared = &system.prepared(self.regime)[exit];
        let stuck = self.chatter_ends(system, exit, crossing);
        let (switch, twin) = match (&prepared.sticking, stuck) {
            (Some(sticking), true) => (sticking, prepared.sticking_twin),
            _ => (&prepared.switch, prepared.twin),
        };
        observer.switch(&SwitchView {
            system,
            switch,
            exit,
            stuck,
            phase: self.phase,
            rate: crossing.rate,
            grazing: crossing.grazing,
            modal: &self.modal,
        });
        self.change_basis(system, switch);
        self.surface = twin.map(|twin| {
            let start = if description.release {
                Start::Release
            } else if description.reset.is_none() && crossing.grazing {
                // The rate is continuous and here known better than from the sums.
                Start::Surface { rate: Some(-crossing.rate) }
            } else {
                Start::Surface { rate: None }
            };
            (twin, start)
        });
        self.regime = switch.to;
    }

    /// Whether this impact is so slow, and pressed so firmly, that the rest of the
    /// sequence is below rounding.
    fn chatter_ends(&mut self, system: &System, exit: usize, crossing: Crossing) -> bool {
        let prepared = &system.prepared(self.regime)[exit];
        let Some(acceleration) = &prepared.acceleration else { return false };
        let mut state = std::mem::take(&mut self.state);
        self.state(&mut state);
        let pressed = -acceleration.at(system.drive(), &state, self.phase);
        self.state = state;
        let fastest = self.signal.fastest().max(std::f64::consts::TAU / system.drive().period());
        // Flights last about 2|ġ|/a; a must keep its sign for far longer than that.
        pressed > 0.0 && -crossing.rate * fastest <= CHATTER_RESOLUTION * pressed
    }

    fn change_basis(&mut self, system: &System, switch: &Switch) {
        let (to, from) = (switch.matrix.nrows() / 2, switch.matrix.ncols() / 2);
        let stacked = &mut self.stacked[..2 * to];
        stacked.copy_from_slice(switch.constant.as_slice());
        for (k, [real, imaginary]) in switch.tones.iter().enumerate() {
            let phasor = system.drive().phasor(k, self.phase);
            for (s, (r, i)) in stacked.iter_mut().zip(real.iter().zip(imaginary.iter())) {
                *s += r * phasor.re - i * phasor.im;
            }
        }
        for (k, q) in self.modal.iter().enumerate() {
            let (re, im) = (switch.matrix.column(k), switch.matrix.column(from + k));
            for (s, (a, b)) in stacked.iter_mut().zip(re.iter().zip(im.iter())) {
                *s += a * q.re + b * q.im;
            }
        }
        self.modal.resize(to, Complex::new(0.0, 0.0));
        for (k, q) in self.modal.iter_mut().enumerate() {
            *q = Complex::new(stacked[k], stacked[to + k]);
        }
    }
}

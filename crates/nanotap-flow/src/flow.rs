//! Running a system: from switch to switch in modal coordinates, one drive period
//! at a time.

use crate::crossing::{
    Crossing, Start, Statistics, first_crossing_on_lattice, first_crossing_with,
};
#[cfg(target_arch = "x86_64")]
use crate::pack::Fused;
use crate::pack::{self, Library, Math, Pack, Plain, WIDTH};
use crate::regime::Regime;
use crate::signal::Signal;
use crate::system::{Exit, ON_SURFACE, Onset, Switch, System, rounding};
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
    /// Whether it watches nothing, so that nothing need be prepared for it.
    const IDLE: bool = false;
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

impl Observer for () {
    const IDLE: bool = true;
}

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
    /// Modal coordinates, then the tones' phasors, packed: `[re, im]`.
    packed: Vec<[Pack; 2]>,
    /// The work space of a switch.
    next: Vec<[Pack; 2]>,
    /// The exit whose guard starts at zero, and how.
    surface: Option<(usize, Start)>,
    signal: Signal,
    /// For observers: modal coordinates and `e^{λ_k s}` as plain numbers.
    modal: Vec<Complex>,
    factors: Vec<Complex>,
    state: Vec<f64>,
    statistics: Statistics,
    switches: u64,
    fused: bool,
}

/// Switches without time passing before chatter without a sticking regime is refused.
const STALLED_SWITCHES: u32 = 1000;
/// An impact sequence ends in sticking when its flights last less than this part
/// of the fastest time scale: what is left of it is below rounding (second order).
const CHATTER_RESOLUTION: f64 = 1e-8;

impl Flow {
    /// A flow of `system`; call [`Flow::start`] before running it.
    pub fn new(system: Arc<System>) -> Self {
        let largest = system
            .regimes()
            .iter()
            .map(|r| r.basis().len())
            .max()
            .unwrap_or(0);
        Self {
            regime: 0,
            phase: 0.0,
            packed: Vec::new(),
            next: Vec::new(),
            surface: None,
            signal: Signal::default(),
            modal: Vec::with_capacity(largest),
            factors: Vec::with_capacity(largest),
            state: vec![0.0; system.dimension()],
            statistics: Statistics::default(),
            switches: 0,
            fused: fused_available(),
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
            return Err(FlowError::Shape {
                what: "the state",
                found: x.len(),
                expected: n,
            });
        }
        if !x.iter().all(|v| v.is_finite()) || !phase.is_finite() {
            return Err(FlowError::NotFinite { what: "the state" });
        }
        let (regime, surface) = self.system.regime_at(x, phase)?;
        self.regime = regime;
        self.phase = phase;
        self.surface = surface.map(|exit| (exit, Start::Surface { rate: None }));
        let system = Arc::clone(&self.system);
        let regime = &system.regimes()[regime];
        self.modal
            .resize(regime.basis().len(), Complex::new(0.0, 0.0));
        regime.to_modal(system.drive(), x, phase, &mut self.modal);
        self.pack_modal(&system);
        self.set_phasors(&system);
        Ok(())
    }

    /// Writes the state (length `n`) to `x`.
    pub fn state(&self, x: &mut [f64]) {
        let regime = &self.system.regimes()[self.regime];
        let modal = (0..regime.basis().len()).map(|k| self.coordinate(k));
        regime.to_state(self.system.drive(), modal, self.phase, x);
    }

    fn coordinate(&self, k: usize) -> Complex {
        let [re, im] = &self.packed[k / WIDTH];
        Complex::new(re[k % WIDTH], im[k % WIDTH])
    }

    fn set_coordinate(&mut self, k: usize, q: Complex) {
        let [re, im] = &mut self.packed[k / WIDTH];
        re[k % WIDTH] = q.re;
        im[k % WIDTH] = q.im;
    }

    /// Packs `self.modal`; phasors are zero afterwards.
    fn pack_modal(&mut self, system: &System) {
        let count = self.modal.len() + system.drive().frequencies().len();
        self.packed.clear();
        self.packed.resize(count.div_ceil(WIDTH), [[0.0; WIDTH]; 2]);
        for k in 0..self.modal.len() {
            self.set_coordinate(k, self.modal[k]);
        }
    }

    fn unpack_modal(&mut self, count: usize) {
        self.modal.clear();
        for k in 0..count {
            self.modal.push(self.coordinate(k));
        }
    }

    fn set_phasors(&mut self, system: &System) {
        let modes = system.regimes()[self.regime].basis().len();
        for k in 0..system.drive().frequencies().len() {
            self.set_coordinate(modes + k, system.drive().phasor(k, self.phase));
        }
    }

    /// Runs to the end of the drive period; the phase is then zero.
    ///
    /// # Errors
    /// When the motion diverges, or chatters with no sticking regime to end in.
    pub fn run_period<O: Observer>(&mut self, observer: &mut O) -> Result<(), FlowError> {
        let period = self.system.drive().period();
        self.run_until(period, observer)?;
        self.phase = 0.0;
        // Phasors are carried from switch to switch; a new period sets them right.
        let modes = self.system.regimes()[self.regime].basis().len();
        for k in 0..self.system.drive().frequencies().len() {
            self.set_coordinate(modes + k, Complex::new(1.0, 0.0));
        }
        observer.period_end();
        Ok(())
    }

    /// Runs to time `end` within the same drive period.
    ///
    /// # Errors
    /// As [`Flow::run_period`].
    pub fn run_until<O: Observer>(&mut self, end: f64, observer: &mut O) -> Result<(), FlowError> {
        if self.system.largest_angle() > pack::LARGEST_ANGLE {
            return self.run::<Library, O>(end, observer);
        }
        #[cfg(target_arch = "x86_64")]
        if self.fused {
            // SAFETY: `fused` is set only where the machine has these instructions.
            return unsafe { self.run_fused(end, observer) };
        }
        self.run::<Plain, O>(end, observer)
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma")]
    fn run_fused<O: Observer>(&mut self, end: f64, observer: &mut O) -> Result<(), FlowError> {
        self.run::<Fused, O>(end, observer)
    }

    #[inline(always)]
    fn run<M: Math, O: Observer>(&mut self, end: f64, observer: &mut O) -> Result<(), FlowError> {
        let system = Arc::clone(&self.system);
        let mut stalled = 0;
        while self.phase < end {
            let left = end - self.phase;
            let reach = if M::LIBRARY {
                left
            } else {
                left.min(system.lattice_reach(self.regime))
            };
            let found = self.next_crossing::<M>(&system, reach)?;
            let length = found.map_or(reach, |(_, crossing)| crossing.at);
            self.pass::<M, O>(&system, length, observer);
            let Some((exit, crossing)) = found else {
                if reach < left {
                    continue;
                }
                self.phase = end;
                break;
            };
            stalled = if length <= f64::EPSILON * end {
                stalled + 1
            } else {
                0
            };
            if stalled > STALLED_SWITCHES {
                return Err(FlowError::Accumulation { time: self.phase });
            }
            self.switch::<M, O>(&system, exit, crossing, observer);
        }
        Ok(())
    }

    /// The earliest exit within `left`.
    #[inline(always)]
    fn next_crossing<M: Math>(
        &mut self,
        system: &System,
        left: f64,
    ) -> Result<Option<(usize, Crossing)>, FlowError> {
        let regime = &system.regimes()[self.regime];
        let clustered = !regime.basis().clusters.is_empty();
        if clustered {
            self.unpack_modal(regime.basis().len());
        }
        let mut earliest: Option<(usize, Crossing)> = None;
        for (e, exit) in system.prepared(self.regime).iter().enumerate() {
            let horizon = earliest.map_or(left, |(_, c)| c.at);
            if clustered {
                self.signal = Signal::of(
                    regime,
                    system.drive(),
                    &exit.guard,
                    &self.modal,
                    self.phase,
                    horizon,
                );
            } else {
                self.signal.refill::<M>(&exit.kernel, &self.packed, horizon);
            }
            if !self.signal.is_finite() {
                return Err(FlowError::Diverged { time: self.phase });
            }
            let start = match self.surface {
                Some((surface, start)) if surface == e => start,
                _ => Start::Inside,
            };
            let found = match &exit.lattice {
                Some(lattice) if !M::LIBRARY => first_crossing_on_lattice::<M>(
                    lattice,
                    &mut self.signal,
                    horizon,
                    start,
                    &mut self.statistics,
                ),
                _ => first_crossing_with::<M>(&self.signal, horizon, start, &mut self.statistics),
            };
            if let Some(crossing) = found {
                earliest = Some((e, crossing));
            }
        }
        Ok(earliest)
    }

    /// Moves on by `length` within the regime.
    #[inline(always)]
    fn pass<M: Math, O: Observer>(&mut self, system: &System, length: f64, observer: &mut O) {
        let basis = system.regimes()[self.regime].basis();
        if O::IDLE && basis.clusters.is_empty() {
            let rates = &system.packed_rates()[self.regime];
            let kept = self.signal.kept_factors();
            let kept = kept
                .filter(|(at, _)| (length - at).abs() * self.signal.fastest() < pack::SMALL_ANGLE);
            if let Some((at, factors)) = kept {
                let rest = M::splat(length - at);
                for (i, q) in self.packed.iter_mut().enumerate() {
                    let [decay, frequency] = &rates[i];
                    let z = [
                        M::mul(M::load(decay), rest),
                        M::mul(M::load(frequency), rest),
                    ];
                    let factor = [M::load(&factors[i][0]), M::load(&factors[i][1])];
                    multiply::<M>(q, pack::complex_mul::<M>(factor, pack::exp_small::<M>(z)));
                }
            } else {
                for (q, [decay, frequency]) in self.packed.iter_mut().zip(rates) {
                    let (decay, frequency) = (M::load(decay), M::load(frequency));
                    multiply::<M>(
                        q,
                        pack::exp_complex::<M>(decay, frequency, M::splat(length)),
                    );
                }
            }
        } else {
            self.pass_watched(system, length, observer);
        }
        self.phase += length;
        if length > 0.0 {
            self.surface = None;
        }
    }

    /// The same where someone watches or eigenvalues coincide.
    fn pass_watched<O: Observer>(&mut self, system: &System, length: f64, observer: &mut O) {
        let basis = system.regimes()[self.regime].basis();
        self.unpack_modal(basis.len());
        self.factors.clear();
        self.factors.extend(
            basis
                .eigenvalues
                .iter()
                .map(|lambda| (lambda * length).exp()),
        );
        observer.segment(&SegmentView {
            system,
            regime: self.regime,
            phase: self.phase,
            length,
            modal: &self.modal,
            factors: &self.factors,
        });
        basis.apply(&mut self.modal, length, &self.factors);
        for k in 0..self.modal.len() {
            self.set_coordinate(k, self.modal[k]);
        }
        for (k, &omega) in system.drive().frequencies().iter().enumerate() {
            let (sin, cos) = (omega * length).sin_cos();
            let phasor = self.coordinate(basis.len() + k) * Complex::new(cos, sin);
            self.set_coordinate(basis.len() + k, phasor);
        }
    }

    /// Takes exit `exit`.
    #[inline(always)]
    fn switch<M: Math, O: Observer>(
        &mut self,
        system: &System,
        exit: usize,
        crossing: Crossing,
        observer: &mut O,
    ) {
        self.switches += 1;
        let description = &system.exits()[self.regime][exit];
        let prepared = &system.prepared(self.regime)[exit];
        let stuck = prepared.acceleration.is_some() && self.chatter_ends(system, exit, crossing);
        let (switch, twin) = match (&prepared.sticking, stuck) {
            (Some(sticking), true) => (sticking, prepared.sticking_twin),
            _ => (&prepared.switch, prepared.twin),
        };
        if !O::IDLE {
            self.unpack_modal(system.regimes()[self.regime].basis().len());
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
        }
        let onset = description
            .onset
            .and_then(|onset| self.onset(system, description, onset, crossing));
        self.change_basis::<M>(switch);
        self.surface = onset.or_else(|| {
            twin.map(|twin| {
                let start = if description.release {
                    Start::Release
                } else if description.reset.is_none() && crossing.refined {
                    // The rate is continuous and here known better than from the sums.
                    Start::Surface {
                        rate: Some(-crossing.rate),
                    }
                } else {
                    Start::Surface { rate: None }
                };
                (twin, start)
            })
        });
        self.regime = switch.to;
    }

    /// How the guard of the next regime starts of which something is known; `None` where
    /// it is well inside.
    fn onset(
        &mut self,
        system: &System,
        taken: &Exit,
        onset: Onset,
        crossing: Crossing,
    ) -> Option<(usize, Start)> {
        let mut state = std::mem::take(&mut self.state);
        self.state(&mut state);
        let found = match onset {
            Onset::AtRest(exit) => {
                // A start beyond the guard's zero leaves at the rate that it has.
                let beyond = crossing.at == 0.0
                    && taken.guard.at(system.drive(), &state, self.phase)
                        < -ON_SURFACE * rounding(&taken.guard, &state);
                let rate = (!beyond).then_some(0.0);
                Some((exit, Start::Surface { rate }))
            }
            Onset::Proportional { exit, factor } => {
                let guard = &system.exits()[taken.target][exit].guard;
                (factor * crossing.rate <= ON_SURFACE * rounding(guard, &state))
                    .then_some((exit, Start::Surface { rate: None }))
            }
        };
        self.state = state;
        found
    }

    /// Whether this impact is so slow, and pressed so firmly, that the rest of the
    /// sequence is below rounding.
    fn chatter_ends(&mut self, system: &System, exit: usize, crossing: Crossing) -> bool {
        let prepared = &system.prepared(self.regime)[exit];
        let Some(acceleration) = &prepared.acceleration else {
            return false;
        };
        let mut state = std::mem::take(&mut self.state);
        self.state(&mut state);
        let pressed = -acceleration.at(system.drive(), &state, self.phase);
        self.state = state;
        let fastest = self
            .signal
            .fastest()
            .max(std::f64::consts::TAU / system.drive().period());
        // Flights last about 2|ġ|/a; a must keep its sign for far longer than that.
        pressed > 0.0 && -crossing.rate * fastest <= CHATTER_RESOLUTION * pressed
    }

    #[inline(always)]
    fn change_basis<M: Math>(&mut self, switch: &Switch) {
        switch.packed.apply::<M>(&self.packed, &mut self.next);
        std::mem::swap(&mut self.packed, &mut self.next);
    }
}

/// `q ← q · factor` of packed complex numbers.
#[inline(always)]
fn multiply<M: Math>(q: &mut [Pack; 2], factor: [M::Lanes; 2]) {
    let product = pack::complex_mul::<M>([M::load(&q[0]), M::load(&q[1])], factor);
    *q = product.map(M::store);
}

/// Whether this machine has fused multiply-add in vectors of four.
pub(crate) fn fused_available() -> bool {
    #[cfg(target_arch = "x86_64")]
    {
        std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma")
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        false
    }
}

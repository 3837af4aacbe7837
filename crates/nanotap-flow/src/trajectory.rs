//! A recorded motion with closed-form dense output.

use crate::observer::{Observer, SegmentView, SwitchView};
use crate::regime::ModalOutput;
use crate::signal::Signal;
use crate::system::System;
use crate::{Complex, Flow, FlowError, Output};
use std::sync::Arc;

/// A stretch of a trajectory within one regime and one drive period.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// Number of the regime, from 0.
    pub regime: usize,
    /// Time of its start, from the start of the recording's first period, in the system's unit of
    /// time.
    pub start: f64,
    /// Time of its start within the drive period, in the system's unit of time.
    pub phase: f64,
    /// Length in time, in the system's unit of time.
    pub length: f64,
    /// Modal coordinates at its start, of length `m`.
    pub modal: Vec<Complex>,
}

/// A switch in a trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Time from the start of the recording's first period, in the system's unit of time.
    pub time: f64,
    /// Number of the regime that the switch leaves.
    pub from: usize,
    /// Number of the regime that the switch enters.
    pub to: usize,
    /// Rate of the guard before the switch, at most 0, in units of the guard per unit of time.
    pub rate: f64,
    /// Whether the guard only grazed zero, within rounding.
    pub grazing: bool,
    /// Logarithm log|det| of the saltation matrix, dimensionless; `None` at a reset, or if it does
    /// not follow from `rate`.
    pub log_determinant: Option<f64>,
}

/// A recorded motion, with the state between switches in closed form.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    system: Arc<System>,
    segments: Vec<Segment>,
    events: Vec<Event>,
    end: f64,
}

/// Observer that records a flow as a [`Trajectory`].
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    segments: Vec<Segment>,
    events: Vec<Event>,
    periods: u64,
}

impl Recorder {
    fn offset(&self, system: &System) -> f64 {
        self.periods as f64 * system.drive().period()
    }

    /// Appends a stretch given by its modal coordinates: in `regime`, from `phase` within the drive
    /// period, of length `length`.
    pub fn take_stretch(&mut self, regime: usize, phase: f64, length: f64, modal: &[Complex]) {
        self.segments.push(Segment {
            regime,
            start: phase,
            phase,
            length,
            modal: modal.to_vec(),
        });
    }

    /// Returns the recording, of a flow of `system`.
    pub fn finish(self, system: Arc<System>) -> Trajectory {
        let end = self.segments.last().map_or(0.0, |s| s.start + s.length);
        Trajectory {
            system,
            segments: self.segments,
            events: self.events,
            end,
        }
    }
}

impl Observer for Recorder {
    fn segment(&mut self, segment: &SegmentView<'_>) {
        if segment.length > 0.0 {
            self.segments.push(Segment {
                regime: segment.regime,
                start: self.offset(segment.system) + segment.phase,
                phase: segment.phase,
                length: segment.length,
                modal: segment.modal.to_vec(),
            });
        }
    }

    fn switch(&mut self, switch: &SwitchView<'_>) {
        self.events.push(Event {
            time: self.offset(switch.system) + switch.phase,
            from: switch.switch.from,
            to: switch.switch.to,
            rate: switch.rate,
            grazing: switch.grazing,
            log_determinant: switch.switch.log_determinant(switch.rate),
        });
    }

    fn period_end(&mut self) {
        self.periods += 1;
    }
}

/// One output over a trajectory: a signal on each piece.
#[derive(Clone, Debug, PartialEq)]
pub struct PiecewiseSignal {
    /// The pieces, in order of time.
    pub pieces: Vec<Piece>,
}

/// One piece: `signal(s)` is the output at time `start + s`, `0 ≤ s ≤ length`.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// Time of its start, from the start of the recording's first period, in the system's unit of
    /// time.
    pub start: f64,
    /// Length in time, in the system's unit of time.
    pub length: f64,
    /// Output as a function of the time `s` from the start of the piece.
    pub signal: Signal,
}

impl Trajectory {
    /// Runs `periods` drive periods from state `x` at phase 0 and records them.
    ///
    /// # Errors
    /// As for [`Flow::start`] and [`Flow::run_period`].
    pub fn record(system: &Arc<System>, x: &[f64], periods: usize) -> Result<Self, FlowError> {
        let mut flow = Flow::new(Arc::clone(system));
        flow.start(x, 0.0)?;
        let mut recorder = Recorder::default();
        for _ in 0..periods {
            flow.run_period(&mut recorder)?;
        }
        Ok(recorder.finish(Arc::clone(system)))
    }

    /// Returns the system whose motion was recorded.
    pub fn system(&self) -> &Arc<System> {
        &self.system
    }

    /// Returns the segments, in order of time.
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// Returns the switches, in order of time.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// Returns the time at the end; the start is 0.
    pub fn end(&self) -> f64 {
        self.end
    }

    /// Returns the segment that contains time `t` (the nearest one outside the recording).
    pub fn segment_at(&self, t: f64) -> Option<&Segment> {
        let after = self.segments.partition_point(|s| s.start <= t);
        self.segments.get(after.saturating_sub(1))
    }

    /// Returns the state at time `t`; `None` for an empty recording.
    pub fn state_at(&self, t: f64) -> Option<Vec<f64>> {
        let segment = self.segment_at(t)?;
        let regime = &self.system.regimes()[segment.regime];
        let s = (t - segment.start).clamp(0.0, segment.length);
        let mut modal = segment.modal.clone();
        let mut factors = modal.clone();
        regime.basis().advance(&mut modal, s, &mut factors);
        let mut x = vec![0.0; self.system.dimension()];
        regime.to_state(
            self.system.drive(),
            modal.iter().copied(),
            segment.phase + s,
            &mut x,
        );
        Some(x)
    }

    /// Returns the piece of the signal of `output` at time `t`.
    pub fn piece_at(&self, output: &Output, t: f64) -> Option<Piece> {
        let segment = self.segment_at(t)?;
        let modal = self.system.regimes()[segment.regime].project(output);
        Some(self.piece(segment, &modal))
    }

    fn piece(&self, segment: &Segment, output: &ModalOutput) -> Piece {
        let regime = &self.system.regimes()[segment.regime];
        let (phase, length) = (segment.phase, segment.length);
        Piece {
            start: segment.start,
            length,
            signal: Signal::of(
                regime,
                self.system.drive(),
                output,
                &segment.modal,
                phase,
                length,
            ),
        }
    }

    /// Returns the total time in `regime`, in the system's unit of time.
    pub fn time_in(&self, regime: usize) -> f64 {
        self.segments
            .iter()
            .filter(|s| s.regime == regime)
            .map(|s| s.length)
            .sum()
    }

    /// Returns an output over the whole trajectory, the same in every regime.
    pub fn signal(&self, output: &Output) -> PiecewiseSignal {
        self.signal_by_regime(&vec![output.clone(); self.system.regimes().len()])
    }

    /// Returns an output that differs from regime to regime (one entry per regime), such as a
    /// contact force.
    ///
    /// # Panics
    /// If there are fewer outputs than regimes.
    pub fn signal_by_regime(&self, outputs: &[Output]) -> PiecewiseSignal {
        let regimes = self.system.regimes().iter().zip(outputs);
        let modal: Vec<_> = regimes.map(|(r, o)| r.project(o)).collect();
        let segments = self.segments.iter();
        let pieces = segments.map(|s| self.piece(s, &modal[s.regime])).collect();
        PiecewiseSignal { pieces }
    }
}

impl PiecewiseSignal {
    /// Returns the value at time `t` (of the nearest piece outside); `None` if empty.
    pub fn at(&self, t: f64) -> Option<f64> {
        let after = self.pieces.partition_point(|p| p.start <= t);
        let piece = self.pieces.get(after.saturating_sub(1))?;
        Some(piece.signal.at((t - piece.start).clamp(0.0, piece.length)))
    }

    /// Returns the total time covered, in the system's unit of time.
    pub fn duration(&self) -> f64 {
        self.pieces.iter().map(|p| p.length).sum()
    }
}

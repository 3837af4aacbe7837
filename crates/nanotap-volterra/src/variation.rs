//! Derivatives of a run's outputs by its initial state and by parameters.
//!
//! A step's variation is a motion of the same modes under a variation of the force that is a
//! polynomial as the force itself is, and so it has the same dense output. Integrals over the run
//! change by the integral of the integrand's change, by the quadrature that gives their values, and
//! where steps move by what the integrand is at their ends; extrema by the change of the output
//! where it is extreme. Nothing here is a difference.

use crate::flow::Flow;
use crate::kernel::TimeMap;
use crate::quadrature::{derivative, series};
use crate::tangent::{Forced, Parameter, StepChange, Tangents};
use crate::trajectory::{Node, Output, Trajectory};
use crate::{Complex, VolterraError};
use nalgebra::{DMatrix, RowDVector};

/// A recorded run with its derivatives, one column per change.
#[derive(Clone, Debug)]
pub struct Variation {
    motion: Trajectory,
    pieces: Vec<StepChange>,
    /// Derivatives of the system for the last columns.
    parameters: Vec<Forced>,
    count: usize,
    /// Changes of the time of the run's end.
    end: Vec<f64>,
    /// Changes of the state at the end of the run, at its time.
    at_end: DMatrix<f64>,
}

/// An output with its derivatives at constant state and time.
#[derive(Clone, Debug, PartialEq)]
pub struct VariedOutput {
    /// Output whose derivatives are `changes`.
    pub value: Output,
    /// Its derivatives, one per column (empty: none).
    pub changes: Vec<Output>,
}

impl VariedOutput {
    /// Creates an output without derivatives: the parameters do not enter it directly.
    pub const fn fixed(value: Output) -> Self {
        Self {
            value,
            changes: Vec::new(),
        }
    }
}

/// Outputs at a place of the motion. Changes are relative to the step, which may move: at a fixed
/// place of it, not at a fixed time.
#[derive(Clone, Debug)]
pub struct Reading<'a> {
    /// Time of the place on the unvaried motion, in the system's unit of time.
    pub time: f64,
    /// Number of the law's branch.
    pub branch: usize,
    /// Weight in integrals over time, in the system's unit of time; 0 at the ends of steps.
    pub weight: f64,
    /// Changes, one per column, of the length of time that the step covers in an integral, from its
    /// movement at this end relative to the step; 0 inside a step.
    pub widening: &'a [f64],
    /// Changes of the step's position in time, one per column.
    pub shifts: &'a [f64],
    /// Values of all outputs, in the order in which they were given.
    pub values: &'a [f64],
    /// Changes of all outputs, output by output, one per column.
    pub changes: &'a [f64],
}

impl Reading<'_> {
    /// Returns the change of output number `output` with column `column`.
    pub fn change(&self, output: usize, column: usize) -> f64 {
        self.changes[output * self.shifts.len() + column]
    }
}

/// A number that is read at one moment of the motion, such as an extremum, with its derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    /// Value, in the unit of the output.
    pub value: f64,
    /// Derivatives, one per column, in units of the output per unit of the column's change.
    pub changes: Vec<f64>,
}

/// An output in modal coordinates, ready to be read.
struct Reader {
    row: Vec<f64>,
    constant: f64,
    tones: Vec<Complex>,
    force: f64,
    changes: Vec<ChangeReader>,
}

/// The derivative of an output with one column, apart from that through the motion.
struct ChangeReader {
    row: Vec<f64>,
    constant: f64,
    /// Parts that grow like `1` and like `t`.
    tones: Vec<[Complex; 2]>,
    force: f64,
}

impl Flow {
    /// Runs to time `end`, which moves by `moves` as the columns change, and records the motion and
    /// its derivatives. `starts` has one column per change of the state at the start; the last
    /// columns belong to `parameters`.
    ///
    /// # Errors
    /// As [`Flow::record_until`], and when sizes do not fit.
    pub fn record_with_changes(
        &mut self,
        end: f64,
        moves: &[f64],
        starts: &DMatrix<f64>,
        parameters: &[Parameter],
    ) -> Result<Variation, VolterraError> {
        if moves.len() != starts.ncols() {
            return Err(VolterraError::Shape {
                what: "the moves of the end",
                found: moves.len(),
                expected: starts.ncols(),
            });
        }
        let system = self.system.clone();
        let mut tangents = Tangents::new(&system, starts, parameters, self.time())?.keeping();
        let mut motion = Trajectory::empty(system.clone());
        self.run(end, &mut (&mut tangents, &mut motion))?;
        Ok(Variation {
            at_end: tangents.at_end(&system, self.time()),
            motion: motion.whole()?,
            pieces: tangents.kept.unwrap_or_default(),
            parameters: tangents.parameters,
            count: starts.ncols(),
            end: moves.to_vec(),
        })
    }
}

impl Variation {
    /// Returns the recorded motion without variation.
    pub const fn motion(&self) -> &Trajectory {
        &self.motion
    }

    /// Returns the changes of the state at the end of the run, at its time, one column each.
    pub const fn at_end(&self) -> &DMatrix<f64> {
        &self.at_end
    }

    /// Returns the changes of parameter and drive for a column.
    fn forced(&self, column: usize) -> Option<&Forced> {
        let plain = self.count - self.parameters.len();
        column.checked_sub(plain).map(|k| &self.parameters[k])
    }

    /// Returns the change, with a column, of the time of the boundary after piece number `piece`.
    fn boundary(&self, piece: usize, column: usize) -> f64 {
        if piece + 1 == self.pieces.len() {
            return self.end[column];
        }
        let ends = &self.pieces[piece].ends;
        ends.get(column).copied().unwrap_or(0.0)
    }

    /// Returns the movement of the start or the end of a piece relative to the piece.
    fn edge(&self, piece: usize, end: bool, column: usize) -> f64 {
        let boundary = match (end, piece) {
            (true, _) => self.boundary(piece, column),
            (false, 0) => 0.0,
            (false, _) => self.boundary(piece - 1, column),
        };
        boundary - self.pieces[piece].shifts[column]
    }

    /// Returns the change, with a column, of the time that the motion spends on steps of some
    /// branches of the law.
    pub fn time_on(&self, column: usize, inside: impl Fn(usize) -> bool) -> f64 {
        let pieces = self.motion.pieces.iter().enumerate();
        pieces
            .filter(|(_, piece)| inside(piece.branch))
            .map(|(k, _)| self.edge(k, true, column) - self.edge(k, false, column))
            .sum()
    }

    fn reader(&self, output: &VariedOutput) -> Reader {
        let system = &self.motion.system;
        let kernel = system.kernel();
        let forced = system.forced();
        let modal = |row: &RowDVector<f64>| -> Vec<f64> {
            (row * kernel.modes().right()).iter().copied().collect()
        };
        let of = |row: &RowDVector<f64>, k: usize| -> Complex {
            let response = row.iter().zip(forced.tones[k].iter());
            response.map(|(r, z)| z * *r).sum()
        };
        let own = |output: &Output, k: usize| output.tones.get(k).copied().unwrap_or_default();
        let count = system.drive().tones.len();
        let value = &output.value;
        let row = modal(&value.row);
        let constant = value.offset + (&value.row * &forced.constant)[0];
        let change = |column: usize| {
            let mut reader = ChangeReader {
                row: Vec::new(),
                constant: 0.0,
                tones: vec![[Complex::default(); 2]; count],
                force: 0.0,
            };
            if let Some(by) = self.forced(column) {
                let along =
                    |z: &[Complex]| -> Complex { row.iter().zip(z).map(|(r, z)| z * *r).sum() };
                reader.constant += row
                    .iter()
                    .zip(by.constant.iter())
                    .map(|(r, y)| r * y)
                    .sum::<f64>();
                for (k, tone) in reader.tones.iter_mut().enumerate() {
                    let turn = Complex::new(0.0, by.frequencies[k]);
                    tone[0] += along(by.tones[k][0].as_slice());
                    tone[1] += along(by.tones[k][1].as_slice()) + turn * own(value, k);
                }
            }
            if let Some(of_output) = output.changes.get(column) {
                if of_output.row.iter().any(|r| *r != 0.0) {
                    reader.row = modal(&of_output.row);
                    reader.constant += (&of_output.row * &forced.constant)[0];
                    for (k, tone) in reader.tones.iter_mut().enumerate() {
                        tone[0] += of(&of_output.row, k);
                    }
                }
                reader.constant += of_output.offset;
                for (k, tone) in reader.tones.iter_mut().enumerate() {
                    tone[0] += own(of_output, k);
                }
                reader.force = of_output.force;
            }
            reader
        };
        Reader {
            constant,
            tones: (0..count)
                .map(|k| of(&value.row, k) + own(value, k))
                .collect(),
            force: value.force,
            changes: (0..self.count).map(change).collect(),
            row,
        }
    }

    /// Visits the nodes of a quadrature of the whole motion and the ends of its steps, in order of
    /// time, dense enough for a factor that oscillates with the angular frequency `omega`.
    pub fn visit(&self, outputs: &[VariedOutput], omega: f64, mut take: impl FnMut(&Reading<'_>)) {
        let readers: Vec<Reader> = outputs.iter().map(|output| self.reader(output)).collect();
        let mut values = vec![0.0; outputs.len()];
        let mut changes = vec![0.0; outputs.len() * self.count];
        let mut widening = vec![0.0; self.count];
        for (index, (piece, of)) in self.motion.pieces.iter().zip(&self.pieces).enumerate() {
            let mut place = self.start_of(index);
            for (u, weight) in self.motion.places(piece, omega) {
                self.move_to(&mut place, u);
                for (o, reader) in readers.iter().enumerate() {
                    let changes = &mut changes[o * self.count..(o + 1) * self.count];
                    values[o] = self.read(reader, &place, changes);
                }
                let edge = if weight == 0.0 { Some(u != 0.0) } else { None };
                for (column, wider) in widening.iter_mut().enumerate() {
                    *wider = match edge {
                        None => 0.0,
                        Some(true) => self.edge(index, true, column),
                        Some(false) => -self.edge(index, false, column),
                    };
                }
                take(&Reading {
                    time: place.time,
                    branch: piece.branch,
                    weight: weight * piece.map.rate(piece.length, u),
                    widening: &widening,
                    shifts: &of.shifts,
                    values: &values,
                    changes: &changes,
                });
            }
        }
    }

    /// Returns the start of a step.
    fn start_of(&self, index: usize) -> Place {
        let (piece, of) = (&self.motion.pieces[index], &self.pieces[index]);
        let coefficients = if of.coefficients.is_empty() {
            Vec::new()
        } else {
            [&*piece.coefficients, &*of.coefficients].concat()
        };
        Place {
            index,
            u: 0.0,
            time: piece.start,
            phasors: Vec::new(),
            modal: [&*piece.modal, &*of.modal].concat(),
            coefficients,
        }
    }

    /// Moves to another place of the same step.
    fn move_to(&self, place: &mut Place, u: f64) {
        let (system, piece) = (&self.motion.system, &self.motion.pieces[place.index]);
        let range = [place.u, u];
        let Place {
            modal,
            coefficients,
            ..
        } = place;
        let kernel = system.kernel_on(piece.branch);
        kernel.between(piece.map, piece.length, range, modal, coefficients);
        let [from, to] = range.map(|u| piece.map.time(piece.length, u));
        system.spare_surface(piece.branch, to - from, &mut modal[..system.dimension()]);
        place.u = u;
        place.time = piece.start + piece.map.time(piece.length, u);
        let tones = system.drive().tones.iter();
        place.phasors.clear();
        place.phasors.extend(tones.map(|tone| {
            let (sin, cos) = nanotap_arithmetic::sin_cos(tone.frequency * place.time);
            Complex::new(cos, sin)
        }));
    }

    /// Returns the value of an output at a place; writes its changes with all columns.
    fn read(&self, reader: &Reader, place: &Place, changes: &mut [f64]) -> f64 {
        let (piece, of) = (&self.motion.pieces[place.index], &self.pieces[place.index]);
        let kernel = self.motion.system.kernel();
        let n = kernel.nodes;
        let (own, varied) = place.modal.split_at(kernel.modes().dimension());
        let force = series(&piece.coefficients, place.u);
        let columns = varied.chunks_exact(own.len()).zip(changes);
        for (column, (of_column, change)) in columns.enumerate() {
            let by_force = of.coefficients.get(column * n..(column + 1) * n);
            let motion = Motion {
                modal: own,
                force,
                change: of_column,
                by_force: if reader.force == 0.0 {
                    0.0
                } else {
                    by_force.map_or(0.0, |c| series(c, place.u))
                },
                time: place.time,
                shift: of.shifts[column],
            };
            let tones = self.motion.system.drive().tones.iter();
            let turns = tones.map(|tone| tone.frequency);
            *change = reader.change(column, &motion, &place.phasors, turns);
        }
        reader.value(own, &place.phasors, force)
    }

    /// Returns the least and the largest value of an output over the run, ends included, with their
    /// changes; `nodes` are those of the motion ([`Trajectory::nodes`]).
    pub fn range(&self, nodes: &[Node], output: &VariedOutput) -> [Moment; 2] {
        let reader = self.reader(output);
        self.motion
            .extremes(nodes, &output.value)
            .map(|place| Moment {
                value: place.value,
                changes: self.changes_at(&reader, place.piece, place.u),
            })
    }

    /// Returns an output just before every switch of the law that `wanted` selects by the branches
    /// before and after it.
    pub fn before_switches(
        &self,
        output: &VariedOutput,
        wanted: impl Fn(usize, usize) -> bool,
    ) -> Vec<Moment> {
        let reader = self.reader(output);
        let pieces = &self.motion.pieces;
        let switches = (0..self.pieces.len().saturating_sub(1)).filter(|k| {
            !self.pieces[*k].ends.is_empty() && wanted(pieces[*k].branch, pieces[*k + 1].branch)
        });
        switches
            .map(|k| {
                let sample = pieces[k].sample(&self.motion.system, pieces[k].end);
                Moment {
                    value: self.motion.read(&output.value, &sample).0,
                    changes: self.changes_at(&reader, k, pieces[k].end),
                }
            })
            .collect()
    }

    /// Returns the changes, one per column, of an output where it is extreme, or at an end of a
    /// step.
    fn changes_at(&self, reader: &Reader, index: usize, u: f64) -> Vec<f64> {
        let mut changes = vec![f64::NAN; self.count];
        let Some(piece) = self.motion.pieces.get(index) else {
            return changes;
        };
        let mut place = self.start_of(index);
        let nodes = self.motion.places(piece, 0.0).into_iter();
        for (node, _) in nodes.take_while(|(node, _)| *node < u).chain([(u, 0.0)]) {
            self.move_to(&mut place, node);
        }
        self.read(reader, &place, &mut changes);
        let edge = if u == 0.0 {
            Some(false)
        } else {
            (u >= piece.end).then_some(true)
        };
        for (column, change) in changes.iter_mut().enumerate() {
            // Between its ends a step has the extremum where the output does not change in time.
            let moved = edge.map_or(0.0, |end| self.edge(index, end, column));
            if moved != 0.0 {
                *change += moved * self.rate(reader, &place);
            }
        }
        changes
    }

    /// Returns the rate in time of an output at an end of a step.
    fn rate(&self, reader: &Reader, place: &Place) -> f64 {
        let (system, piece) = (&self.motion.system, &self.motion.pieces[place.index]);
        let (u, modal) = (place.u, &place.modal[..system.dimension()]);
        let slope = Tangents::slope(system, piece.branch, modal, series(&piece.coefficients, u));
        let mut rate: f64 = reader.row.iter().zip(&slope).map(|(r, s)| r * s).sum();
        let tones = system.drive().tones.iter().zip(&reader.tones);
        for ((tone, z), phasor) in tones.zip(&place.phasors) {
            rate -= tone.frequency * (z * phasor).im;
        }
        if reader.force != 0.0 {
            let mut first = vec![0.0; piece.coefficients.len()];
            derivative(&piece.coefficients, &mut first);
            let by_time = piece.map.rate(piece.length, u);
            rate += reader.force
                * if by_time == 0.0 {
                    // Where u runs like the root of time the force sets in without a slope in u.
                    let mut second = vec![0.0; first.len()];
                    derivative(&first, &mut second);
                    let bend = if piece.map == TimeMap::End { -2.0 } else { 2.0 };
                    series(&second, u) / (bend * piece.length)
                } else {
                    series(&first, u) / by_time
                };
        }
        rate
    }
}

/// A place on a step, with the motion and its changes there.
struct Place {
    index: usize,
    u: f64,
    time: f64,
    /// `e^{iωt}` of the drive's tones.
    phasors: Vec<Complex>,
    /// Modal coordinates of the motion, then of its changes.
    modal: Vec<f64>,
    /// Coefficients of the force, then of its changes; empty where the force vanishes.
    coefficients: Vec<f64>,
}

/// A motion and one change of it at an instant.
struct Motion<'a> {
    modal: &'a [f64],
    force: f64,
    change: &'a [f64],
    by_force: f64,
    time: f64,
    /// By how much the step moves.
    shift: f64,
}

impl Reader {
    fn value(&self, modal: &[f64], phasors: &[Complex], force: f64) -> f64 {
        let own: f64 = self.row.iter().zip(modal).map(|(r, y)| r * y).sum();
        let tones: f64 = self
            .tones
            .iter()
            .zip(phasors)
            .map(|(z, phasor)| (z * phasor).re)
            .sum();
        self.constant + own + tones + self.force * force
    }

    fn change(
        &self,
        column: usize,
        motion: &Motion<'_>,
        phasors: &[Complex],
        turns: impl Iterator<Item = f64>,
    ) -> f64 {
        let by = &self.changes[column];
        let dot = |row: &[f64], y: &[f64]| row.iter().zip(y).map(|(r, y)| r * y).sum::<f64>();
        let mut sum = by.constant + dot(&self.row, motion.change) + dot(&by.row, motion.modal);
        sum += self.force * motion.by_force + by.force * motion.force;
        let tones = by.tones.iter().zip(&self.tones).zip(phasors).zip(turns);
        for ((([own, secular], z), phasor), turn) in tones {
            let moving = z * Complex::new(0.0, turn * motion.shift);
            sum += ((own + secular * motion.time + moving) * phasor).re;
        }
        sum
    }
}

//! Curves under frequency modulation: at every row the orbit with the amplitude and phase that the
//! loop maintains, with frequency and strength of the drive as unknowns in addition to its state.
//!
//! Such an instrument records the frequency relative to the free lever, and the drive relative to
//! that of the free lever. The derivatives of both with respect to a parameter follow from the
//! equations for orbit, amplitude and phase by the implicit function theorem ([`Held::changes`]),
//! including those of the free lever. Units that depend on a parameter change with it.
//!
//! Fails by omission: if the curve has several orbits at a distance, the one that continues the
//! previous row is used.

use std::sync::{Arc, OnceLock};

use rayon::prelude::*;

use super::{Effects, Point, Problem, RowPoint};
use crate::fit::branches::Rows;
use crate::fit::data::is_distance;
use crate::fit::parameters::Target;
use nanotap_case::physical::Scales;
use nanotap_case::{Case, Key};
use nanotap_dynamics::control::Control;
use nanotap_error::Error;
use nanotap_model::parameter::Parameter;
use nanotap_motions::frequency_modulation::walk::{HeldWalk, Stepped};
use nanotap_motions::frequency_modulation::{Driven, FreeOscillation, Held, HeldOrbit, Modulated};
use nanotap_study::FreeMotion;

/// Setpoint of the loop of frequency modulation.
#[derive(Clone, Copy, Debug)]
pub(in crate::fit) struct Loop {
    /// Amplitude at the drive frequency, in m, or in the unit of a dimensionless case.
    amplitude: f64,
    /// Phase lag that the loop maintains, degrees.
    phase: f64,
}

/// An orbit with the settings of the loop.
#[derive(Clone, Debug)]
pub(in crate::fit) struct HeldRow {
    driven: Driven,
    case: Case,
    free: Arc<Free>,
}

/// The free lever at the same amplitude and phase.
#[derive(Clone, Debug)]
struct Free {
    case: Case,
    held: Held,
    oscillation: FreeOscillation,
    /// Frequency, strength and loss in SI.
    frequency: f64,
    strength: f64,
    loss: f64,
    /// Derivatives by the keys that were requested first: many rows request the same.
    known: OnceLock<FreeChanges>,
}

type FreeChange = ([f64; 2], Option<f64>);

/// Derivatives of the free lever by keys of the case.
#[derive(Clone, Debug)]
struct FreeChanges {
    keys: Vec<Key>,
    /// Derivatives of frequency and strength (model units) and of the loss (J) by each key.
    by: Option<Vec<FreeChange>>,
}

/// Sizes of the model's units in SI; 1 for a dimensionless case.
#[derive(Clone, Copy, Debug)]
struct Sizes {
    length: f64,
    frequency: f64,
    strength: f64,
    energy: f64,
}

impl Sizes {
    const OWN: Self = Self {
        length: 1.0,
        frequency: 1.0,
        strength: 1.0,
        energy: 1.0,
    };

    fn of_scales(case: &Case, scales: &Scales) -> Option<Self> {
        Some(Self {
            length: scales.length,
            frequency: scales.frequency,
            strength: scales.of(Parameter::Alpha2, case.cantilever()?.actuation),
            energy: scales.energy,
        })
    }

    fn of(case: &Case) -> Option<Self> {
        match case.physical() {
            Some(view) => Self::of_scales(case, &view.scales),
            None => Some(Self::OWN),
        }
    }

    /// Derivatives of the units by a key.
    fn by(case: &Case, key: Key) -> Option<Self> {
        let Some((low, high, width)) = case.scales_beside(key).ok()? else {
            return Some(Self {
                length: 0.0,
                frequency: 0.0,
                strength: 0.0,
                energy: 0.0,
            });
        };
        let (low, high) = (Self::of_scales(case, &low)?, Self::of_scales(case, &high)?);
        let slope = |of: fn(&Self) -> f64| (of(&high) - of(&low)) / width;
        Some(Self {
            length: slope(|s| s.length),
            frequency: slope(|s| s.frequency),
            strength: slope(|s| s.strength),
            energy: slope(|s| s.energy),
        })
    }
}

/// Distance beyond the first row at which the free oscillation is started, if Newton needs a path.
const BEYOND: f64 = 8.0;

impl Loop {
    /// The free amplitude of a case, and a phase.
    pub(in crate::fit) fn of(case: &Case, phase: f64) -> Result<Self, Error> {
        let model = case.model()?;
        let held = Held {
            amplitude: FreeMotion::of(&model).amplitude,
            phase,
        }
        .check()?;
        let sizes = Sizes::of(case).unwrap_or(Sizes::OWN);
        // Whether the free lever can have these settings depends on the case, not on a row.
        FreeOscillation::of(case, held)?;
        Ok(Self {
            amplitude: held.amplitude * sizes.length,
            phase,
        })
    }

    /// Settings at a row: its own amplitude, the free one, or that of the case.
    fn at(self, problem: &Problem<'_>, x: &[f64], at: &[f64], case: &Case) -> Option<Held> {
        let key = Key::DriveFreeAmplitude;
        let swept = problem.data.swept.iter().position(|s| s.key == key);
        let free = problem
            .parameters
            .iter()
            .position(|p| p.target == Target::Key(key));
        let amplitude = match (swept, free) {
            (Some(k), _) => at[k],
            (None, Some(k)) => x[k],
            (None, None) => self.amplitude,
        };
        Some(Held {
            amplitude: amplitude / Sizes::of(case)?.length,
            phase: self.phase,
        })
    }

    /// The free lever at a row.
    fn free(case: &Case, held: Held) -> Option<Free> {
        let oscillation = FreeOscillation::of(case, held).ok()?;
        let sizes = Sizes::of(case)?;
        Some(Free {
            case: case.clone(),
            held,
            frequency: oscillation.frequency * sizes.frequency,
            strength: oscillation.strength * sizes.strength,
            loss: oscillation.loss * sizes.energy,
            oscillation,
            known: OnceLock::new(),
        })
    }

    /// The position of a row without the distance: rows with the same one share a free lever.
    fn without_distance(problem: &Problem<'_>, at: &[f64]) -> Vec<f64> {
        let swept = problem.data.swept.iter().zip(at);
        swept
            .filter(|(swept, _)| !is_distance(swept.key))
            .map(|(_, at)| *at)
            .collect()
    }

    /// Finds the orbits at all rows, each continued from the previous row, the first of a curve
    /// from a large distance.
    pub(in crate::fit) fn discover(self, problem: &Problem<'_>, x: &[f64]) -> (Point, Vec<Rows>) {
        let bases = problem.cases(x);
        let curves = problem.data.curves.par_iter().enumerate();
        let found: Vec<Vec<RowPoint>> = curves
            .map(|(curve, _)| self.along(problem, x, curve, &bases[curve]))
            .collect();
        let rows = found.iter().map(|rows| vec![Vec::new(); rows.len()]);
        let candidates = rows.collect();
        let point = Point {
            rows: found.into_iter().flatten().collect(),
            folds: Vec::new(),
        };
        (point, candidates)
    }

    fn along(self, problem: &Problem<'_>, x: &[f64], curve: usize, base: &Case) -> Vec<RowPoint> {
        let mut free: Option<(Vec<f64>, Arc<Free>)> = None;
        let mut last: Option<(Vec<f64>, f64, Driven)> = None;
        let mut branch = 0;
        let columns = problem.data.columns.len();
        let mut row = |row| -> Option<RowPoint> {
            problem.finished(())?;
            let at = problem.place(x, curve, row);
            let case = problem.case_at(base, &at);
            let held = self.at(problem, x, &at, &case)?;
            let rest = Self::without_distance(problem, &at);
            let known = free.take().filter(|(of, _)| *of == rest);
            let of_row = match known {
                Some((_, known)) => known,
                None => Arc::new(Self::free(&case, held)?),
            };
            free = Some((rest.clone(), Arc::clone(&of_row)));
            let gap = case.get(case.gap_key());
            let from = last.as_ref().filter(|(of, ..)| *of == rest);
            let (far, start) = match from {
                Some((_, before, driven)) => (*before, driven.clone()),
                None => (
                    gap + BEYOND * gap.abs().max(held.amplitude),
                    of_row.oscillation.driven(),
                ),
            };
            let mut walk = HeldWalk::new(&case, held, start, far);
            let Stepped { orbit, breaks } = walk.step(gap, &Control::default()).ok()?;
            branch += breaks.len();
            last = Some((rest, gap, orbit.driven()));
            Self::row_point(problem, &case, &of_row, orbit, branch)
        };
        let rows = problem.data.curves[curve].rows.iter();
        rows.map(|of| row(of).unwrap_or_else(|| RowPoint::empty(columns)))
            .collect()
    }

    /// The result at a row.
    fn row_point(
        problem: &Problem<'_>,
        case: &Case,
        free: &Arc<Free>,
        orbit: HeldOrbit,
        branch: usize,
    ) -> Option<RowPoint> {
        let driven = orbit.driven();
        let found = modulated(case, free, &driven)?;
        let columns = problem.data.columns.iter();
        let values = columns.map(|column| column.quantity.modulated()?.number(&found));
        Some(RowPoint {
            orbit: Some(orbit.orbit),
            lost: false,
            branch,
            values: values.collect::<Option<_>>()?,
            held: Some(Box::new(HeldRow {
                driven,
                case: case.clone(),
                free: Arc::clone(free),
            })),
            ..RowPoint::empty(0)
        })
    }

    /// Predicts the orbits at other parameters from a known point, to first order.
    pub(in crate::fit) fn follow(
        self,
        problem: &Problem<'_>,
        (x, bases): (&[f64], &[Case]),
        (before, from): (&[f64], &Point),
    ) -> Point {
        let rows = problem.rows();
        let frees = self.frees(problem, x, bases);
        let one = |(index, point): (usize, &RowPoint)| {
            let (curve, row) = rows[index];
            let follow = || {
                problem.finished(())?;
                let mut guess = point.held.as_ref()?.driven.clone();
                if !point.lost {
                    for (k, by) in point.states.iter().enumerate() {
                        guess.add(x[k] - before[k], by);
                    }
                }
                let at = problem.place(x, curve, row);
                let case = problem.case_at(&bases[curve], &at);
                let held = self.at(problem, x, &at, &case)?;
                let orbit = held.close(&case, &guess).ok()?;
                Self::row_point(problem, &case, frees[index].as_ref()?, orbit, point.branch)
            };
            follow().unwrap_or_else(|| point.without_orbit())
        };
        let found = from.rows.par_iter().enumerate().map(one);
        Point {
            rows: found.collect(),
            folds: Vec::new(),
        }
    }

    /// The free lever of every row.
    fn frees(self, problem: &Problem<'_>, x: &[f64], bases: &[Case]) -> Vec<Option<Arc<Free>>> {
        let mut known: Option<(usize, Vec<f64>, Option<Arc<Free>>)> = None;
        let mut all = Vec::new();
        for (curve, row) in problem.rows() {
            if problem.finished(()).is_none() {
                all.push(None);
                continue;
            }
            let at = problem.place(x, curve, row);
            let rest = Self::without_distance(problem, &at);
            let same = known
                .take()
                .filter(|(of, place, _)| *of == curve && *place == rest);
            let (_, _, free) = known.insert(same.unwrap_or_else(|| {
                let case = problem.case_at(&bases[curve], &at);
                let held = self.at(problem, x, &at, &case);
                let free = held.and_then(|held| Self::free(&case, held));
                (curve, rest, free.map(Arc::new))
            }));
            all.push(free.clone());
        }
        all
    }

    /// Derivatives of drive and state, and of the measured values, by every parameter.
    pub(in crate::fit) fn derivatives(
        problem: &Problem<'_>,
        x: &[f64],
        (curve, point): (usize, &RowPoint),
        effects: &[Effects],
    ) -> Option<Vec<(Vec<f64>, Vec<f64>)>> {
        let row = point.held.as_ref()?;
        let keys = keys_of(effects);
        let by_key = row.by(&keys)?;
        let columns = &problem.data.columns;
        let parameter = |(k, effects): (usize, &Effects)| -> Option<(Vec<f64>, Vec<f64>)> {
            let mut state = vec![0.0; row.driven.state.len() + 2];
            let of = &problem.parameters[k];
            if !of.is_of(curve) {
                return Some((state, vec![0.0; columns.len()]));
            }
            let mut by = vec![0.0; columns.len()];
            for (key, weight) in effects {
                let (driven, found) = &by_key[keys.iter().position(|other| other == key)?];
                let drive = [driven.frequency, driven.strength];
                let changes = drive.iter().chain(&driven.state);
                state
                    .iter_mut()
                    .zip(changes)
                    .for_each(|(sum, part)| *sum += weight * part);
                for (column, of) in columns.iter().enumerate() {
                    let number = of.quantity.modulated()?.number(found)?;
                    by[column] += weight * problem.scale(x, curve, column) * number;
                }
            }
            Some((state, by))
        };
        effects.iter().enumerate().map(parameter).collect()
    }
}

/// The keys that depend on any parameter.
fn keys_of(effects: &[Effects]) -> Vec<Key> {
    let mut keys: Vec<Key> = effects.iter().flatten().map(|(key, _)| *key).collect();
    keys.sort_unstable();
    keys.dedup();
    keys
}

/// The readings of a loop for a drive, in SI.
fn modulated(case: &Case, free: &Free, driven: &Driven) -> Option<Modulated> {
    let sizes = Sizes::of(case)?;
    let frequency = driven.frequency * sizes.frequency;
    let strength = driven.strength * sizes.strength;
    let of_free = [free.frequency, free.strength, free.loss];
    Some(Modulated::of_drive([frequency, strength], of_free))
}

impl HeldRow {
    /// Derivatives of drive, state and readings by keys of the case.
    fn by(&self, keys: &[Key]) -> Option<Vec<(Driven, Modulated)>> {
        let (case, free) = (&self.case, &*self.free);
        let held = Held {
            amplitude: free.held.amplitude * Sizes::of(&free.case)?.length
                / Sizes::of(case)?.length,
            phase: free.held.phase,
        };
        let at_row = amplitudes(case, held, keys)?;
        let changes = held.changes(case, self.driven.clone(), &at_row).ok()?;
        let of_free = free.changes(keys)?;
        let here_now = modulated(case, free, &self.driven)?;
        let (sizes, free_sizes) = (Sizes::of(case)?, Sizes::of(&free.case)?);
        let one = |((key, change), (by, loss)): ((&Key, Driven), FreeChange)| {
            let (here, there) = (Sizes::by(case, *key)?, Sizes::by(&free.case, *key)?);
            let oscillation = &free.oscillation;
            let frequency =
                change.frequency * sizes.frequency + self.driven.frequency * here.frequency;
            let strength = change.strength * sizes.strength + self.driven.strength * here.strength;
            let free_frequency =
                by[0] * free_sizes.frequency + oscillation.frequency * there.frequency;
            let free_strength = by[1] * free_sizes.strength + oscillation.strength * there.strength;
            let shift = frequency - free_frequency;
            let relative = (shift - here_now.relative_shift * free_frequency) / free.frequency;
            let ratio = (strength - here_now.drive_ratio * free_strength) / free.strength;
            let rest = here_now.drive_ratio - 1.0 - here_now.relative_shift;
            let loss = if rest == 0.0 { 0.0 } else { loss? };
            let found = Modulated {
                drive_frequency: frequency,
                drive_strength: strength,
                frequency_shift: shift,
                relative_shift: relative,
                drive_ratio: ratio,
                drive_dissipation: loss * rest + free.loss * (ratio - relative),
                ..here_now
            };
            Some((change, found))
        };
        keys.iter().zip(changes).zip(of_free).map(one).collect()
    }
}

/// Each key with the derivative of the controlled amplitude, in the model's unit.
fn amplitudes(case: &Case, held: Held, keys: &[Key]) -> Option<Vec<(Key, f64)>> {
    let length = Sizes::of(case)?.length;
    let one = |key: &Key| {
        let own = if *key == Key::DriveFreeAmplitude {
            length.recip()
        } else {
            0.0
        };
        let of_unit = held.amplitude * Sizes::by(case, *key)?.length / length;
        Some((*key, own - of_unit))
    };
    keys.iter().map(one).collect()
}

impl Free {
    /// Derivatives of the free lever by keys of the case.
    fn changes(&self, keys: &[Key]) -> Option<Vec<FreeChange>> {
        let all = || FreeChanges {
            keys: keys.to_vec(),
            by: self.changes_by(keys),
        };
        let known = self.known.get_or_init(all);
        if known.keys == keys {
            known.by.clone()
        } else {
            all().by
        }
    }

    fn changes_by(&self, keys: &[Key]) -> Option<Vec<FreeChange>> {
        let held = amplitudes(&self.case, self.held, keys)?;
        let of = self.oscillation.changes(&self.case, self.held, &held);
        let one = |(key, by): (&Key, [f64; 2])| (by, self.loss_by(*key));
        Some(keys.iter().zip(of.ok()?).map(one).collect())
    }

    /// Derivative of the loss, in SI, by a key: a sequence of closed forms, whose central
    /// difference is accurate to ten digits.
    fn loss_by(&self, key: Key) -> Option<f64> {
        let value = self.case.get(key);
        let step = 1e-5 * if value == 0.0 { 1.0 } else { value.abs() };
        let amplitude = self.held.amplitude * Sizes::of(&self.case)?.length;
        let at_side = |side: f64| {
            let case = self.case.with(key, value + side * step);
            let amplitude = if key == Key::DriveFreeAmplitude {
                amplitude + side * step
            } else {
                amplitude
            };
            let held = Held {
                amplitude: amplitude / Sizes::of(&case)?.length,
                ..self.held
            };
            Some(Loop::free(&case, held)?.loss)
        };
        Some((at_side(1.0)? - at_side(-1.0)?) / (2.0 * step))
    }
}

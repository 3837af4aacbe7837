//! Following a motion under loops from far on towards the sample.

use std::f64::consts::PI;

use nanotap_flow::Complex;

use super::formulas::{Readings, estimates};
use super::loops::{Held, Loops, Tone};
use super::torus::{Drives, OVER_RESOLVED, Torus};
use super::{
    BimodalJump, BimodalOptions, BimodalPoint, BimodalReport, Estimates, FreeTone, Loop, OPEN_LOOP,
    ToneReading,
};
use nanotap_case::physical::force::SampleForce;
use nanotap_case::physical::{Kind, Physical};
use nanotap_case::{Case, Key};
use nanotap_dynamics::control::Control;
use nanotap_error::Error;
use nanotap_model::Model;
use nanotap_model::cantilever::Cantilever;
use nanotap_model::parameter::Parameter;
use nanotap_motions::frequency_modulation::{FreeOscillation, Held as Condition};
use nanotap_study::FreeMotion;
use nanotap_study::value::implied;

/// First step of the distance, relative to the size of the motion.
const FIRST: f64 = 0.02;
/// Shortest step of the distance, relative to the size of the motion.
const SHORTEST: f64 = 5e-4;
/// Largest changes in a step up to which two motions are taken for the same: amplitude over that of
/// the free lever, phase in degrees, strength over that of the free lever.
const FARTHEST: [f64; 3] = [0.1, 15.0, 0.3];
/// Degrees from 90 up to which a drive counts as one at resonance.
const AT_RESONANCE: f64 = 2.0;
/// Logarithm of a tone's frequency over the resonance nearest to it, up to which its loop finds it.
const FARTHEST_RESONANCE: f64 = 0.2;
/// Most secant steps towards the distance of the setpoint.
const SECANTS: usize = 40;
/// Relative error of the amplitude at which they stop.
const REACHED: f64 = 1e-10;
/// Time in which a motion settles, over the time in which a disturbance falls to 1/e.
const FORGOTTEN: f64 = 20.0;
/// Largest relative size of the last harmonics of the phase; above it the motion is not resolved.
const UNKNOWN: f64 = 1e-3;

/// An approach: the motions, jumps between them, and why it ended early.
#[derive(Default)]
struct Approach {
    table: Vec<BimodalPoint>,
    jumps: Vec<BimodalJump>,
    ended: Option<String>,
}

/// The lever with its loops, and what its readings are in SI.
struct Follower<'a> {
    view: &'a Physical,
    loops: Loops,
    kinds: [Loop; 2],
    radius: Option<f64>,
}

/// Follows the motion of `case` from far on.
///
/// # Errors
/// When the conditions contradict each other, or there is no motion where the approach begins.
pub(super) fn follow(
    case: &Case,
    lever: &Cantilever,
    view: &Physical,
    options: &BimodalOptions,
    control: &Control<'_>,
) -> Result<BimodalReport, Error> {
    let kinds = [
        options.first.unwrap_or(Loop::Am),
        options.second.unwrap_or(Loop::Fm),
    ];
    let sought = view.setpoint.filter(|_| case.leaves_distance_to_setpoint());
    if sought.is_some() && kinds[0].holds_amplitude() {
        return Err(Error::input(
            "the loop of the first tone and the setpoint both hold its amplitude",
            "leave out drive.setpoint and give gap.tip, or give {first} am",
        ));
    }
    let tones = [
        tone(lever, 0, kinds[0], options.phase)?,
        tone(lever, 1, kinds[1], options.second_phase)?,
    ];
    let length = tones.iter().map(Tone::size).sum();
    let follower = Follower {
        view,
        radius: view.value(Key::TipRadius),
        kinds,
        loops: Loops {
            lever: lever.clone(),
            tones,
            length,
        },
    };
    let distance =
        |option, given: &Option<_>| implied(case, case.gap_key(), option, given.as_ref());
    let reach = FreeMotion::of(&Model::cantilever(lever)?).reach;
    let first = distance("from", &options.from)?.unwrap_or(1.1 * reach.max(length));
    let last = distance("to", &options.to)?;
    let last = last.unwrap_or(if sought.is_some() { 0.0 } else { lever.alpha5 });
    if first <= last {
        return Err(Error::input(
            format!(
                "the approach begins at {} and cannot end at {}",
                follower.length(first),
                follower.length(last)
            ),
            "give a larger {from}, or a smaller {to}",
        ));
    }
    let setpoint = sought.map(|ratio| ratio * follower.loops.tones[0].free_amplitude);
    let approach = follower.approach([first, last], options.points, setpoint, control)?;
    let force = view.sample.force.as_ref();
    let hertz = view.sample.hertz.map(|hertz| hertz.reduced_modulus);
    let free = [0, 1].map(|k| follower.free(k));
    let dynamic = |k: usize| force.and_then(|force| force.dynamic_modulus(free[k].frequency));
    Ok(BimodalReport {
        loops: kinds,
        dynamic_moduli: dynamic(0).zip(dynamic(1)).map(|(a, b)| [a, b]),
        free,
        setpoint: setpoint.map(|amplitude| amplitude * view.scales.length),
        reduced_modulus: force.and_then(SampleForce::reduced_modulus).or(hertz),
        table: approach.table,
        jumps: approach.jumps,
        ended: approach.ended,
        stability: OPEN_LOOP,
    })
}

/// A tone of the lever, with the free lever at its amplitude and the phase that is held.
fn tone(lever: &Cantilever, index: usize, kind: Loop, phase: f64) -> Result<Tone, Error> {
    let of_tone = ["first tone", "second tone"][index];
    let mut alone = lever.clone().under_one_tone();
    let strength = lever.get(Parameter::Tone2Amplitude);
    if let (1, Some(ratio)) = (index, lever.further_tones.first()) {
        alone.omega *= ratio.value();
        alone.alpha2 = strength;
    }
    let drive = [alone.omega, alone.alpha2];
    let free_motion = FreeMotion::of(&Model::cantilever(&alone)?);
    let condition = Condition {
        amplitude: free_motion.amplitude,
        phase,
    };
    let key = ["drive.free_amplitude", "drive.second_free_amplitude"][index];
    let condition = condition
        .check()
        .map_err(|error| error.context(of_tone).remedy(format!("give {key}")))?;
    let free = FreeOscillation::of(&Case::from(alone), condition).map_err(|error| {
        let of = |option: &str| match (option, index) {
            ("phase", 1) => "{second_phase}".to_owned(),
            _ => format!("{{{option}}}"),
        };
        error.context(of_tone).written(of)
    })?;
    let away = nanotap_arithmetic::ln(free.frequency / drive[0]).abs();
    if kind.holds_phase() && away > FARTHEST_RESONANCE {
        return Err(Error::input(
            format!("no mode of the lever resonates near the {of_tone}"),
            "give {modes} or another frequency",
        ));
    }
    Ok(Tone {
        holds_phase: kind.holds_phase(),
        holds_amplitude: kind.holds_amplitude(),
        free,
        drive,
        free_amplitude: free_motion.amplitude,
        free_phase: free_motion.phase,
    })
}

impl Follower<'_> {
    fn length(&self, value: f64) -> String {
        Kind::Length.format(value * self.view.scales.length)
    }

    /// An approach between two distances.
    fn approach(
        &self,
        [first, last]: [f64; 2],
        points: usize,
        setpoint: Option<f64>,
        control: &Control<'_>,
    ) -> Result<Approach, Error> {
        let dimension = Model::cantilever(&self.loops.lever)?.dimension();
        let start = (self.loops.free_drives(first), &Torus::at_rest(dimension));
        let begun = self.loops.hold(start, None, control);
        let mut here = begun.map_err(|error| error.remedy("begin farther away, with {from}"))?;
        let mut before: Option<Held> = None;
        let mut approach = Approach {
            table: vec![self.point(&here)?],
            ..Approach::default()
        };
        let step = (first - last) / (points - 1) as f64;
        let mut stride = FIRST * self.loops.length;
        let mut lost: Option<Error> = self.objection(&here).map(Error::numerics);
        for k in 1..points {
            let target = if k + 1 == points {
                last
            } else {
                first - step * k as f64
            };
            while lost.is_none() && here.drives().gap > target {
                match self.step(&here, before.as_ref(), target, &mut stride, control) {
                    Ok(next) => before = Some(std::mem::replace(&mut here, next)),
                    Err(error) if control.is_cancelled() => return Err(error),
                    Err(error) => lost = Some(error),
                }
                if setpoint.is_some_and(|amplitude| here.amplitude(0) <= amplitude) {
                    break;
                }
            }
            if lost.is_some() {
                let Some(next) = self.jump(&here, target, control)? else {
                    continue;
                };
                lost = None;
                approach.jumps.push(BimodalJump {
                    from: here.drives().gap * self.view.scales.length,
                    to: target * self.view.scales.length,
                });
                (before, here) = (None, next);
                stride = FIRST * self.loops.length;
            }
            if let Some(amplitude) = setpoint.filter(|amplitude| here.amplitude(0) <= *amplitude) {
                let reached = match &before {
                    Some(before) => self.reached(before, &here, amplitude, control),
                    None => Err(Error::numerics("it is passed by a jump")),
                };
                match reached {
                    Ok(reached) => approach.table.push(self.point(&reached)?),
                    Err(error) if control.is_cancelled() => return Err(error),
                    Err(error) => {
                        approach.table.push(self.point(&here)?);
                        approach.ended = Some(format!(
                            "the setpoint is an amplitude of {}: {}",
                            self.length(amplitude),
                            error.message()
                        ));
                    }
                }
                return Ok(approach);
            }
            approach.table.push(self.point(&here)?);
            if let Some(progress) = control.progress {
                progress(k, points);
            }
        }
        approach.ended = lost.map(|error| self.end(&here, &error)).or_else(|| {
            setpoint.map(|amplitude| {
                format!(
                    "the setpoint, an amplitude of {}, is not reached up to a distance of {}",
                    self.length(amplitude),
                    self.length(last)
                )
            })
        });
        Ok(approach)
    }

    /// A step towards `target` of `stride` at most, as long as the motion changes little. The stride
    /// of the next one is left in its place.
    fn step(
        &self,
        here: &Held,
        before: Option<&Held>,
        target: f64,
        stride: &mut f64,
        control: &Control<'_>,
    ) -> Result<Held, Error> {
        let gap = here.drives().gap;
        let shortest = SHORTEST * self.loops.length;
        loop {
            // Exactly the target where the whole way is gone.
            let there = if gap - *stride <= target {
                target
            } else {
                gap - *stride
            };
            let (drives, torus) = predicted(here, before, there);
            let reason = match self.loops.hold((drives, &torus), Some(here), control) {
                Ok(next) => match self.objection(&next) {
                    Some(reason) => Error::numerics(reason),
                    None if self.is_next(here, &next) => {
                        *stride *= 1.5;
                        return Ok(next);
                    }
                    None => Error::numerics("the motion changes by a jump"),
                },
                Err(error) if control.is_cancelled() => return Err(error),
                Err(error) => error,
            };
            *stride = 0.4 * (gap - there);
            if *stride < shortest {
                return Err(reason);
            }
        }
    }

    /// Finds the motion at `gap` to which the lever jumps where the present one does not continue:
    /// integrates at the drives of the last motion, then applies the loops. None if the loops hold
    /// no motion near it.
    fn jump(&self, here: &Held, gap: f64, control: &Control<'_>) -> Result<Option<Held>, Error> {
        let mut drives = *here.drives();
        drives.gap = gap;
        let lever = &self.loops.lever;
        // The lever forgets its state within some Q/π periods of the slower tone.
        let damping = here.growth.min(1.0 - 1e-3);
        let forgotten = (FORGOTTEN / (1.0 - damping)).ceil() as usize;
        let settled = Torus::settled(lever, &drives, &here.closed.torus, forgotten, control);
        let held = settled.and_then(|torus| self.loops.hold((drives, &torus), None, control));
        match held {
            Ok(held) => Ok(Some(held).filter(|held| self.objection(held).is_none())),
            Err(error) if control.is_cancelled() => Err(error),
            Err(_) => Ok(None),
        }
    }

    /// Whether a motion is the continuation of another.
    fn is_next(&self, here: &Held, next: &Held) -> bool {
        (0..2).all(|k| {
            let tone = &self.loops.tones[k];
            let turned = next.phase(k) - here.phase(k);
            let turned = turned - 360.0 * (turned / 360.0).round();
            let grown = next.amplitude(k) - here.amplitude(k);
            let stronger = next.drives().strength[k] - here.drives().strength[k];
            grown.abs() <= FARTHEST[0] * tone.free_amplitude
                && turned.abs() <= FARTHEST[1]
                && stronger.abs() <= FARTHEST[2] * tone.free.strength
        })
    }

    /// The motion at which the first tone has an amplitude that lies between those of two motions.
    fn reached(
        &self,
        before: &Held,
        behind: &Held,
        amplitude: f64,
        control: &Control<'_>,
    ) -> Result<Held, Error> {
        let mut ends = [before.clone(), behind.clone()];
        let off = |held: &Held| held.amplitude(0) / amplitude - 1.0;
        let mut values = [off(before), off(behind)];
        let mut moved = None;
        for _ in 0..SECANTS {
            let gaps = ends.each_ref().map(|held| held.drives().gap);
            let part = values[0] / (values[0] - values[1]);
            let gap = gaps[0] + part * (gaps[1] - gaps[0]);
            let (drives, torus) = predicted(&ends[1], Some(&ends[0]), gap);
            let held = self.loops.hold((drives, &torus), Some(&ends[1]), control)?;
            let value = off(&held);
            if value.abs() <= REACHED {
                return Ok(held);
            }
            let side = usize::from(value < 0.0);
            // The Illinois method: an end that stays counts half.
            if moved == Some(side) {
                values[1 - side] *= 0.5;
            }
            values[side] = value;
            ends[side] = held;
            moved = Some(side);
        }
        Err(Error::numerics(
            "the setpoint is not found between two distances",
        ))
    }

    /// Returns why a motion is not one of the instrument, if so. Where the first tone's drive does
    /// not follow its phase, a disturbance that grows at constant drives also grows under the
    /// loops.
    fn objection(&self, held: &Held) -> Option<String> {
        if held.closed.tail > UNKNOWN {
            return Some(format!(
                "the motion depends too sharply on the second tone's phase to be computed; its last \
                 harmonics are {:.1e} of it",
                held.closed.tail
            ));
        }
        (!self.kinds[0].holds_phase() && held.growth >= 1.0)
            .then(|| "the motion loses its stability".to_owned())
    }

    /// Remark at the end of the motion.
    fn end(&self, here: &Held, error: &Error) -> String {
        format!(
            "no motion is found closer than {}: {}",
            self.length(here.drives().gap),
            error.message()
        )
    }

    /// Returns amplitude, phase, frequency and drive of the free lever at a tone, in SI.
    fn free(&self, index: usize) -> FreeTone {
        let (tone, scales) = (&self.loops.tones[index], &self.view.scales);
        let drives = self.loops.free_drives(0.0);
        FreeTone {
            amplitude: tone.free_amplitude * scales.length,
            phase: if tone.holds_phase {
                tone.free.phase
            } else {
                tone.free_phase
            },
            frequency: drives.frequency[index] * scales.frequency,
            drive_strength: drives.strength[index] * self.strength(),
            stiffness: tone.free.stiffness * scales.stiffness,
            resonance: tone.free.frequency * scales.frequency,
        }
    }

    /// Returns the SI unit of the drive's strength: what 1 in model units is in N, or in m for a
    /// driven base.
    fn strength(&self) -> f64 {
        self.view
            .scales
            .of(Parameter::Alpha2, self.loops.lever.actuation)
    }

    /// Converts a motion that the loops hold to the readings of an instrument, in SI.
    fn point(&self, held: &Held) -> Result<BimodalPoint, Error> {
        let scales = &self.view.scales;
        let forces = held.closed.forces(&self.loops.lever)?;
        let readings = [0, 1].map(|k| self.readings(held, k));
        let touches = forces.largest > 0.0;
        Ok(BimodalPoint {
            zc: held.drives().gap * scales.length,
            tones: [0, 1].map(|k| self.reading(held, k, forces.tones[k], &readings[k])),
            mean_force: forces.mean * scales.force,
            peak_force: forces.largest.max(0.0) * scales.force,
            least_force: forces.lowest * scales.force,
            closest: forces.closest * scales.length,
            growth: held.growth,
            error: held.closed.tail,
            estimates: if touches {
                estimates(&readings, self.radius)
            } else {
                Estimates::default()
            },
        })
    }

    fn reading(&self, held: &Held, k: usize, force: Complex, readings: &Readings) -> ToneReading {
        let scales = &self.view.scales;
        let free = self.loops.free_drives(0.0);
        // Of Re(c e^{iωt}): mean of the product, and minus the work on the tone's part in a period.
        let product = force * held.tip[k].conj();
        let frequency = held.drives().frequency[k];
        ToneReading {
            amplitude: held.amplitude(k) * scales.length,
            phase: held.phase(k),
            frequency: frequency * scales.frequency,
            frequency_shift: (frequency - free.frequency[k]) * scales.frequency,
            drive_strength: held.drives().strength[k] * self.strength(),
            drive_ratio: held.drives().strength[k] / free.strength[k],
            virial: 0.5 * product.re * scales.energy,
            dissipation: -PI * product.im * scales.energy,
            estimates: readings.estimates(),
        }
    }

    /// Returns what an instrument reads and knows by calibration of tone `k`, in SI.
    fn readings(&self, held: &Held, k: usize) -> Readings {
        let (tone, scales) = (&self.loops.tones[k], &self.view.scales);
        let strength = held.drives().strength[k] / tone.free.strength;
        // Of a mode that answers the drive with the other sign, the formulas count from that sign.
        let sign = if tone.free.phase < 0.0 { 180.0 } else { 0.0 };
        let kept = nanotap_arithmetic::sin((tone.free.phase + sign).to_radians());
        let stiffness = tone.free.stiffness;
        let [amplitude, resonance] = [tone.free.amplitude, tone.free.frequency];
        // What the free lever loses in a period is π k A²/Q at resonance.
        let quality = PI * stiffness * amplitude * amplitude / tone.free.loss;
        let shift = held.drives().frequency[k] - resonance;
        let away = tone.free_phase + sign - 90.0;
        Readings {
            stiffness: stiffness * scales.stiffness,
            quality,
            resonance: resonance * scales.frequency,
            shift: tone.holds_phase.then_some(shift * scales.frequency),
            amplitude: held.amplitude(k) * scales.length,
            free_amplitude: strength * amplitude / kept * scales.length,
            phase: (held.phase(k) + sign).to_radians(),
            at_resonance: !tone.holds_phase && away.abs() <= AT_RESONANCE,
        }
    }
}

/// Extrapolates drives and torus to `gap`, from the last motion and, if given, the one before it.
fn predicted(here: &Held, before: Option<&Held>, gap: f64) -> (Drives, Torus) {
    let mut drives = *here.drives();
    let Some(before) = before.filter(|before| before.drives().gap > here.drives().gap) else {
        drives.gap = gap;
        return (drives, here.closed.torus.clone());
    };
    let old = before.drives();
    let share = (gap - drives.gap) / (drives.gap - old.gap);
    let further = |now: f64, old: f64| now + share * (now - old);
    for k in 0..2 {
        drives.frequency[k] = further(drives.frequency[k], old.frequency[k]);
        drives.strength[k] = further(drives.strength[k], old.strength[k]);
    }
    drives.gap = gap;
    let torus = here.closed.torus.extrapolated(&before.closed.torus, share);
    if here.closed.tail < OVER_RESOLVED {
        return (drives, torus.coarser());
    }
    (drives, torus)
}

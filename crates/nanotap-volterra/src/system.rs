//! Modes, drive and law together.

use crate::kernel::{Kernel, LENGTHS, TimeMap};
use crate::law::{Exit, ForceLaw, Guard, Surface};
use crate::{Complex, VolterraError};
use nalgebra::DVector;
use nanotap_arithmetic::{CancelFlag, ComplexFunctions as _};
use std::sync::{Arc, OnceLock};

/// Largest number of tones.
pub const MAX_TONES: usize = 64;
/// Largest number of branches of a law.
pub const MAX_BRANCHES: usize = 4097;

/// One tone `Re(… e^{iωt})` of the drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Tone {
    /// Angular frequency `ω`, in radians per unit of time.
    pub frequency: f64,
    /// Complex amplitude of its part in `ẋ`, of the length of the state.
    pub forcing: DVector<Complex>,
    /// Complex amplitude of its part in the gap (motion of the base or of the sample), in the unit
    /// of the gap.
    pub gap: Complex,
}

/// The linear forcing of state and gap.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    /// Constant part of `ẋ`, of the length of the state.
    pub constant: DVector<f64>,
    /// Constant part of the gap, in the unit of the gap.
    pub offset: f64,
    /// Tones of the drive, at most [`MAX_TONES`].
    pub tones: Vec<Tone>,
}

/// Accuracy of the steps, and their largest number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Largest change of the gap by the error of one step, in the unit of the gap. Rounding sets a
    /// separate floor.
    pub tolerance: f64,
    /// Largest number of steps of one run.
    pub max_steps: usize,
}

impl Options {
    /// Creates options with a tolerance in the unit of the gap, and at most a hundred thousand
    /// steps per run: a motion takes some hundred per period, and a longer recording fills
    /// gigabytes.
    pub const fn new(tolerance: f64) -> Self {
        Self {
            tolerance,
            max_steps: 100_000,
        }
    }
}

/// `ẋ = A x + f(t) + p F(d, ḋ)`, `d = row · x + offset + tones`, ready to run.
#[derive(Clone, Debug)]
pub struct System {
    kernel: Arc<Kernel>,
    /// Kernel and forced response of the surface while it is free, if it relaxes.
    free: Option<Box<FreeSurface>>,
    /// Whether the force acts on the surface, if it relaxes, by branch.
    presses: Vec<bool>,
    law: Arc<dyn ForceLaw>,
    drive: Drive,
    options: Options,
    exits: Vec<Vec<Exit>>,
    vanishes: Vec<bool>,
    /// Modal coordinates of the forced response.
    response: Response,
    /// State of the forced response.
    forced: Response,
    /// Complex amplitudes of the gap's forced part.
    pub(crate) gap_tones: Vec<Complex>,
    pub(crate) gap_constant: f64,
    /// Constant part of the gap's forced motion without the offset.
    forced_gap: f64,
    /// Sizes of the drive's part in the gap and in its rate.
    pub(crate) gap_sizes: [f64; 2],
    /// Whether a step needs the gap's rate, for the law or a guard.
    pub(crate) needs_rate: bool,
    takes_signal: bool,
    phasors: Arc<[Vec<OnceLock<Phasors>>; 3]>,
    /// Flag that cancels its motions.
    cancel: CancelFlag,
}

/// The surface of a sample that relaxes, with the lever over it.
#[derive(Clone, Debug)]
struct FreeSurface {
    /// Kernel with a force that acts on the lever alone.
    kernel: Arc<Kernel>,
    /// Kernel of the lever without the surface's coordinates.
    lever: Arc<Kernel>,
    rates: Vec<f64>,
    gains: Vec<f64>,
    /// Constant part of the force in contact that does not act on the surface.
    adhesion: f64,
}

/// Cosines and sines of every tone at the points of a table.
type Phasors = Vec<f64>;

/// A constant and complex amplitudes of the tones.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Response {
    pub(crate) constant: DVector<f64>,
    pub(crate) tones: Vec<DVector<Complex>>,
}

impl Response {
    /// Computes the modal response of the kernel's modes to a forcing.
    pub(crate) fn of(
        kernel: &Kernel,
        constant: &DVector<f64>,
        tones: &[(f64, DVector<Complex>)],
    ) -> Result<Self, VolterraError> {
        let modes = kernel.modes();
        let left = modes.left();
        let real = |v: &DVector<f64>| v.map(|x| Complex::new(x, 0.0));
        Ok(Self {
            constant: modes
                .response(0.0, &real(&(left * constant)))?
                .map(|z| z.re),
            tones: tones
                .iter()
                .map(|(omega, forcing)| {
                    let re = left * forcing.map(|z| z.re);
                    let im = left * forcing.map(|z| z.im);
                    modes.response(*omega, &re.zip_map(&im, Complex::new))
                })
                .collect::<Result<_, _>>()?,
        })
    }

    pub(crate) fn to_state(&self, kernel: &Kernel) -> Self {
        let right = kernel.modes().right();
        Self {
            constant: right * &self.constant,
            tones: self
                .tones
                .iter()
                .map(|y| {
                    let re = right * y.map(|z| z.re);
                    let im = right * y.map(|z| z.im);
                    re.zip_map(&im, Complex::new)
                })
                .collect(),
        }
    }
}

impl Drive {
    /// Returns the same drive for a state of `n` entries: those of a surface, at the end, are not
    /// driven.
    fn resized(mut self, n: usize) -> Self {
        self.constant = self.constant.resize_vertically(n, 0.0);
        let none = Complex::new(0.0, 0.0);
        for tone in &mut self.tones {
            tone.forcing = std::mem::take(&mut tone.forcing).resize_vertically(n, none);
        }
        self
    }
}

impl System {
    /// Combines a kernel, a law, a drive and options into a system.
    ///
    /// # Errors
    /// If sizes do not fit, a number is out of range, or a tone meets an undamped mode.
    pub fn new(
        kernel: Arc<Kernel>,
        law: Arc<dyn ForceLaw>,
        drive: Drive,
        options: Options,
    ) -> Result<Self, VolterraError> {
        check_drive(&drive, kernel.modes().dimension())?;
        let surface = law.surface().cloned();
        Self::over(kernel, drive, law, surface.as_ref(), options)
    }

    /// Returns the same modes, law and options under another drive.
    ///
    /// # Errors
    /// As [`System::new`].
    pub fn driven_by(&self, drive: Drive) -> Result<Self, VolterraError> {
        check_drive(&drive, self.dimension())?;
        let (kernel, free) = (Arc::clone(&self.kernel), self.free.clone());
        let system = Self::joined(kernel, free, Arc::clone(&self.law), drive, self.options)?;
        Ok(system.cancelled_by(self.cancel.clone()))
    }

    /// Returns the same system over a surface none of whose coordinates is slower than `rate`, with
    /// the same compliance at rest: its periodic motions are nearly the same, and are reached
    /// sooner.
    ///
    /// # Errors
    /// As [`System::new`].
    pub fn hastened(&self, rate: f64) -> Result<Self, VolterraError> {
        let (Some(free), Some(surface)) = (&self.free, self.law.surface()) else {
            return Ok(self.clone());
        };
        let mut surface = surface.clone();
        for (own, gain) in surface.rates.iter_mut().zip(&mut surface.gains) {
            let faster = own.max(rate);
            *gain *= faster / *own;
            *own = faster;
        }
        let lever = free.lever.modes().dimension();
        let system = Self::over(
            Arc::clone(&free.lever),
            self.drive.clone().resized(lever),
            Arc::clone(&self.law),
            Some(&surface),
            self.options,
        )?;
        Ok(system.cancelled_by(self.cancel.clone()))
    }

    /// Combines a lever with the surface, if there is one.
    fn over(
        lever: Arc<Kernel>,
        drive: Drive,
        law: Arc<dyn ForceLaw>,
        surface: Option<&Surface>,
        options: Options,
    ) -> Result<Self, VolterraError> {
        if law.takes_signal() {
            if drive.tones.is_empty() {
                return Err(VolterraError::Shape {
                    what: "the tones",
                    found: 0,
                    expected: 1,
                });
            }
            return Self::joined(lever.with_signal()?, None, law, drive, options);
        }
        let Some(surface) = surface else {
            return Self::joined(lever, None, law, drive, options);
        };
        let (rates, gains) = (&surface.rates, &surface.gains);
        let (n, count) = (lever.modes().dimension(), rates.len());
        let kernel = lever.over_surface(rates, gains)?;
        let drive = drive.resized(n + count);
        let free = FreeSurface {
            kernel: lever.over_surface(rates, &vec![0.0; count])?,
            lever,
            rates: rates.clone(),
            gains: gains.clone(),
            adhesion: surface.adhesion,
        };
        Self::joined(kernel, Some(Box::new(free)), law, drive, options)
    }

    fn joined(
        kernel: Arc<Kernel>,
        free: Option<Box<FreeSurface>>,
        law: Arc<dyn ForceLaw>,
        drive: Drive,
        options: Options,
    ) -> Result<Self, VolterraError> {
        if !(options.tolerance > 0.0 && options.tolerance.is_finite()) {
            return Err(VolterraError::Value {
                what: "the tolerance".into(),
                found: options.tolerance,
                needed: "positive and finite",
            });
        }
        let branches = law.branches();
        if branches > MAX_BRANCHES {
            return Err(VolterraError::TooLarge {
                what: "the number of branches of the law",
                found: branches,
                limit: MAX_BRANCHES,
            });
        }
        let exits: Vec<Vec<Exit>> = (0..branches).map(|b| law.exits(b)).collect();
        let always = law.surface().is_some_and(|surface| surface.always);
        let presses = (0..branches).map(|b| always || law.touches(b)).collect();
        let tones: Vec<(f64, DVector<Complex>)> = drive
            .tones
            .iter()
            .map(|t| (t.frequency, t.forcing.clone()))
            .collect();
        let response = Response::of(&kernel, &drive.constant, &tones)?;
        let gap_tones: Vec<Complex> = drive
            .tones
            .iter()
            .zip(&response.tones)
            .map(|(tone, y)| tone.gap + kernel.read(y))
            .collect();
        let gap_sizes = gap_sizes(&drive, &gap_tones);
        let needs_rate = law.depends_on_rate()
            || exits
                .iter()
                .flatten()
                .any(|exit| matches!(exit.guard, Guard::Turns | Guard::Own(_)));
        let pairs = kernel.readout.iter().zip(response.constant.iter());
        let forced_gap = pairs.map(|(r, y)| r * y).sum::<f64>();
        Ok(Self {
            gap_constant: drive.offset + forced_gap,
            vanishes: (0..branches).map(|b| law.vanishes(b)).collect(),
            presses,
            free,
            forced: response.to_state(&kernel),
            takes_signal: law.takes_signal(),
            exits,
            law,
            drive,
            options,
            response,
            gap_tones,
            forced_gap,
            gap_sizes,
            needs_rate,
            phasors: Arc::new(std::array::from_fn(|_| {
                (0..LENGTHS).map(|_| OnceLock::new()).collect()
            })),
            kernel,
            cancel: CancelFlag::default(),
        })
    }

    /// Returns the same system, whose motions end with [`VolterraError::Cancelled`] once `cancel`
    /// is set.
    #[must_use]
    pub fn cancelled_by(mut self, cancel: CancelFlag) -> Self {
        self.cancel = cancel;
        self
    }

    /// Returns the flag that cancels its motions.
    pub fn cancel(&self) -> &CancelFlag {
        &self.cancel
    }

    /// Returns the same modes, drive and law with another offset of the gap; shares all tables.
    ///
    /// # Errors
    /// If the offset is not finite.
    pub fn with_offset(&self, offset: f64) -> Result<Self, VolterraError> {
        let mut system = self.clone();
        system.set_offset(offset)?;
        Ok(system)
    }

    /// Changes the offset of the gap; allocates nothing.
    ///
    /// # Errors
    /// If the offset is not finite.
    pub fn set_offset(&mut self, offset: f64) -> Result<(), VolterraError> {
        if !offset.is_finite() {
            return Err(not_finite("the offset of the gap", offset));
        }
        self.gap_constant = offset + self.forced_gap;
        self.drive.offset = offset;
        Ok(())
    }

    /// Changes the amplitude of a tone in the gap; allocates nothing.
    ///
    /// # Errors
    /// If there is no such tone, or the amplitude is not finite.
    pub fn set_gap_tone(&mut self, number: usize, gap: Complex) -> Result<(), VolterraError> {
        if !(gap.re.is_finite() && gap.im.is_finite()) {
            return Err(not_finite("a tone's amplitude", gap.modulus()));
        }
        let found = self.drive.tones.len();
        let Some(tone) = self.drive.tones.get_mut(number) else {
            return Err(VolterraError::Shape {
                what: "the tones",
                found,
                expected: number + 1,
            });
        };
        tone.gap = gap;
        self.gap_tones[number] = gap + self.kernel.read(&self.response.tones[number]);
        self.gap_sizes = gap_sizes(&self.drive, &self.gap_tones);
        Ok(())
    }

    /// Returns the dimension `n` of the state, the coordinates of a relaxing surface included.
    pub fn dimension(&self) -> usize {
        self.kernel.modes().dimension()
    }

    /// Returns modes, gap and column; for a surface that relaxes, those in contact.
    pub fn kernel(&self) -> &Arc<Kernel> {
        &self.kernel
    }

    /// Returns the kernel on a branch of the law.
    pub(crate) fn kernel_on(&self, branch: usize) -> &Arc<Kernel> {
        match &self.free {
            Some(free) if !self.presses[branch] => &free.kernel,
            _ => &self.kernel,
        }
    }

    /// Reports whether the force on a branch acts on the surface of a sample that relaxes.
    pub fn presses(&self, branch: usize) -> bool {
        self.presses[branch]
    }

    /// Returns the constant part of the force on a branch that does not act on the surface.
    pub(crate) fn adhesion(&self, branch: usize) -> f64 {
        let pressed = self.free.as_ref().filter(|_| self.presses[branch]);
        pressed.map_or(0.0, |surface| surface.adhesion)
    }

    /// Removes from modal coordinates, reached under a force on all coordinates after some time on
    /// a branch, the effect of the adhesion on the surface.
    pub(crate) fn spare_surface(&self, branch: usize, time: f64, y: &mut [f64]) {
        let adhesion = self.adhesion(branch);
        let Some(surface) = self.free.as_ref().filter(|_| adhesion != 0.0) else {
            return;
        };
        let first = y.len() - surface.rates.len();
        let coordinates = surface.rates.iter().zip(&surface.gains);
        for (y, (rate, gain)) in y[first..].iter_mut().zip(coordinates) {
            *y += adhesion * gain * nanotap_arithmetic::exp_m1(-rate * time) / rate;
        }
    }

    /// Removes the same effect from the rates of modal coordinates.
    pub(crate) fn spare_surface_rates(&self, branch: usize, slope: &mut [f64]) {
        let adhesion = self.adhesion(branch);
        if let Some(surface) = self.free.as_ref().filter(|_| adhesion != 0.0) {
            let first = slope.len() - surface.gains.len();
            for (slope, gain) in slope[first..].iter_mut().zip(&surface.gains) {
                *slope -= adhesion * gain;
            }
        }
    }

    /// Reports whether the second argument of the law is the gap's rate.
    pub(crate) fn second_is_rate(&self) -> bool {
        self.free.is_none() && self.signal().is_none()
    }

    /// Returns number and frequency of the tone whose signal the law takes, if it takes one.
    pub(crate) fn signal(&self) -> Option<(usize, f64)> {
        let tone = self.drive.tones.len().min(2).checked_sub(1)?;
        self.takes_signal
            .then(|| (tone, self.drive.tones[tone].frequency))
    }

    /// Returns the second argument of the law at a time, in a state in which the gap has this rate:
    /// a signal, the depth of a surface that relaxes, or the rate.
    pub fn second_argument(&self, time: f64, rate: f64, x: &[f64]) -> f64 {
        if let Some((_, frequency)) = self.signal() {
            return nanotap_arithmetic::cos(frequency * time);
        }
        match self.kernel.surface() {
            0 => rate,
            count => x[x.len() - count..].iter().sum(),
        }
    }

    /// Returns the force law.
    pub fn law(&self) -> &Arc<dyn ForceLaw> {
        &self.law
    }

    /// Returns the drive of state and gap.
    pub fn drive(&self) -> &Drive {
        &self.drive
    }

    /// Returns the accuracy and the largest number of steps.
    pub fn options(&self) -> Options {
        self.options
    }

    /// Returns the exits of a branch.
    pub fn exits(&self, branch: usize) -> &[Exit] {
        &self.exits[branch]
    }

    pub(crate) fn vanishes(&self, branch: usize) -> bool {
        self.vanishes[branch]
    }

    pub(crate) fn forced(&self) -> &Response {
        &self.forced
    }

    /// Returns `cos ωt` at the points of a table, then `sin ωt`, tone after tone.
    pub(crate) fn phasors(&self, map: TimeMap, index: usize) -> &[f64] {
        self.phasors[map as usize][index].get_or_init(|| {
            let table = self.kernel.table(map, index);
            self.drive
                .tones
                .iter()
                .flat_map(|tone| {
                    let angles = table.times.iter().map(|t| tone.frequency * t);
                    let (sines, cosines): (Vec<f64>, Vec<f64>) =
                        angles.map(nanotap_arithmetic::sin_cos).unzip();
                    cosines.into_iter().chain(sines)
                })
                .collect()
        })
    }

    /// Returns the forced part of the gap at a time, and its first two derivatives.
    pub(crate) fn forced_gap(&self, time: f64) -> [f64; 3] {
        let mut out = [self.gap_constant, 0.0, 0.0];
        for (tone, amplitude) in self.drive.tones.iter().zip(&self.gap_tones) {
            let (sin, cos) = nanotap_arithmetic::sin_cos(tone.frequency * time);
            let z = amplitude * Complex::new(cos, sin);
            out[0] += z.re;
            out[1] -= tone.frequency * z.im;
            out[2] -= tone.frequency * tone.frequency * z.re;
        }
        out
    }

    /// Returns the gap and its rate at modal coordinates `y`.
    pub(crate) fn gap_of(&self, time: f64, y: &[f64]) -> (f64, f64) {
        let forced = self.forced_gap(time);
        let dot = |row: &[f64]| row.iter().zip(y).map(|(r, y)| r * y).sum::<f64>();
        (
            forced[0] + dot(&self.kernel.readout),
            forced[1] + dot(&self.kernel.rate_readout),
        )
    }

    /// Returns the second argument of the law and its rate at a time, at modal coordinates `y` with
    /// rates `slope`, where the gap has this rate and acceleration.
    pub(crate) fn second_of(
        &self,
        time: f64,
        [rate, acceleration]: [f64; 2],
        y: &[f64],
        slope: &[f64],
    ) -> [f64; 2] {
        if self.second_is_rate() {
            return [rate, acceleration];
        }
        if let Some((_, frequency)) = self.signal() {
            let (sin, cos) = nanotap_arithmetic::sin_cos(frequency * time);
            return [cos, -frequency * sin];
        }
        let row = &self.kernel.second_readout;
        let dot = |v: &[f64]| row.iter().zip(v).map(|(r, v)| r * v).sum::<f64>();
        [dot(y), dot(slope)]
    }

    /// Returns the gap and its rate in state `x` at a time.
    pub fn gap(&self, time: f64, x: &[f64]) -> (f64, f64) {
        let mut y = vec![0.0; self.dimension()];
        self.to_modal(time, x, &mut y);
        self.gap_of(time, &y)
    }

    /// Returns the state of the free lever at a time, over an undeformed surface.
    pub fn free_state(&self, time: f64) -> Vec<f64> {
        let mut x = vec![0.0; self.dimension()];
        self.write_forced(time, &mut x);
        x
    }

    /// Returns the branch of the law in state `x` at a time, without a history.
    pub fn branch_at(&self, time: f64, x: &[f64]) -> usize {
        let (gap, rate) = self.gap(time, x);
        self.law.branch_at(gap, self.second_argument(time, rate, x))
    }

    /// Writes the forced response at a time to `x`.
    pub(crate) fn write_forced(&self, time: f64, x: &mut [f64]) {
        x.copy_from_slice(self.forced.constant.as_slice());
        for (tone, response) in self.drive.tones.iter().zip(&self.forced.tones) {
            let (sin, cos) = nanotap_arithmetic::sin_cos(tone.frequency * time);
            for (x, z) in x.iter_mut().zip(response.iter()) {
                *x += z.re * cos - z.im * sin;
            }
        }
    }

    /// Writes the modal coordinates (without the forced response) of state `x` to `y`.
    pub(crate) fn to_modal(&self, time: f64, x: &[f64], y: &mut [f64]) {
        let mut rest = vec![0.0; x.len()];
        self.write_forced(time, &mut rest);
        let left = self.kernel.modes().left();
        y.fill(0.0);
        for (k, (x, p)) in x.iter().zip(&rest).enumerate() {
            for (y, l) in y.iter_mut().zip(left.column(k).iter()) {
                *y += l * (x - p);
            }
        }
    }

    /// Writes the state of modal coordinates `y` to `x`.
    pub(crate) fn to_state(&self, time: f64, y: &[f64], x: &mut [f64]) {
        self.write_forced(time, x);
        let right = self.kernel.modes().right();
        for (k, y) in y.iter().enumerate() {
            for (x, r) in x.iter_mut().zip(right.column(k).iter()) {
                *x += r * y;
            }
        }
    }

    /// Writes the vector field `ẋ` in state `x` at a time on a branch of the law to `out`.
    pub fn field(&self, time: f64, x: &[f64], branch: usize, out: &mut [f64]) {
        let n = self.dimension();
        let mut y = vec![0.0; n];
        self.to_modal(time, x, &mut y);
        let (gap, rate) = self.gap_of(time, &y);
        let second = self.second_argument(time, rate, x);
        let force = self.law.force(branch, gap, second).value;
        let kernel = self.kernel_on(branch);
        let mut slope = vec![0.0; n];
        kernel.modes().apply(&y, &mut slope);
        for (s, b) in slope.iter_mut().zip(&kernel.source) {
            *s += b * force;
        }
        self.spare_surface_rates(branch, &mut slope);
        let right = self.kernel.modes().right();
        out.fill(0.0);
        for (k, s) in slope.iter().enumerate() {
            for (o, r) in out.iter_mut().zip(right.column(k).iter()) {
                *o += r * s;
            }
        }
        for (tone, response) in self.drive.tones.iter().zip(&self.forced.tones) {
            let (sin, cos) = nanotap_arithmetic::sin_cos(tone.frequency * time);
            for (o, z) in out.iter_mut().zip(response.iter()) {
                *o -= tone.frequency * (z.re * sin + z.im * cos);
            }
        }
    }

    /// Returns the modal coordinates of the forced response.
    pub(crate) fn response(&self) -> &Response {
        &self.response
    }
}

/// Computes the sizes of the drive's part in the gap and in its rate.
fn gap_sizes(drive: &Drive, gap_tones: &[Complex]) -> [f64; 2] {
    let mut sizes = [0.0; 2];
    for (tone, amplitude) in drive.tones.iter().zip(gap_tones) {
        let size = amplitude.modulus();
        sizes[0] += size;
        sizes[1] += size * tone.frequency;
    }
    sizes
}

fn not_finite(what: &str, found: f64) -> VolterraError {
    VolterraError::Value {
        what: what.into(),
        found,
        needed: "finite",
    }
}

fn check_drive(drive: &Drive, n: usize) -> Result<(), VolterraError> {
    if drive.tones.len() > MAX_TONES {
        return Err(VolterraError::TooLarge {
            what: "the number of tones",
            found: drive.tones.len(),
            limit: MAX_TONES,
        });
    }
    let lengths = drive
        .tones
        .iter()
        .map(|t| ("a tone's forcing", t.forcing.len()))
        .chain([("the constant forcing", drive.constant.len())]);
    for (what, found) in lengths {
        if found != n {
            return Err(VolterraError::Shape {
                what,
                found,
                expected: n,
            });
        }
    }
    if !drive.offset.is_finite() {
        return Err(not_finite("the offset of the gap", drive.offset));
    }
    if let Some(&found) = drive.constant.iter().find(|v| !v.is_finite()) {
        return Err(not_finite("the constant forcing", found));
    }
    for tone in &drive.tones {
        if !(tone.frequency > 0.0 && tone.frequency.is_finite()) {
            return Err(VolterraError::Value {
                what: "a tone's angular frequency".into(),
                found: tone.frequency,
                needed: "positive and finite",
            });
        }
        for z in tone.forcing.iter().chain([&tone.gap]) {
            if !(z.re.is_finite() && z.im.is_finite()) {
                return Err(not_finite("a tone's amplitude", z.modulus()));
            }
        }
    }
    Ok(())
}

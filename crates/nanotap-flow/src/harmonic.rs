//! Vectors that vary harmonically, and scalars linear in the state with
//! harmonic terms (guards and observed outputs).

use crate::{Complex, Drive, FlowError};
use nalgebra::{DMatrix, DVector, RowDVector};

/// A vector `c + Σ_k Re(z_k e^{iω_k t})`, with one complex amplitude per tone of the drive.
#[derive(Clone, Debug, PartialEq)]
pub struct HarmonicVector {
    /// Constant part `c`, of length `n`.
    pub constant: DVector<f64>,
    /// Complex amplitudes `z_k`, one vector of length `n` per tone; the real part multiplies the
    /// cosine, minus the imaginary part the sine.
    pub tones: Vec<DVector<Complex>>,
}

impl HarmonicVector {
    /// Creates a zero vector for a state of dimension `n` and `tones` tones.
    pub fn zeros(n: usize, tones: usize) -> Self {
        Self {
            constant: DVector::zeros(n),
            tones: vec![DVector::zeros(n); tones],
        }
    }

    /// Adds `sine · sin ω_k t + cosine · cos ω_k t`.
    #[must_use]
    pub fn with_tone(mut self, k: usize, sine: &DVector<f64>, cosine: &DVector<f64>) -> Self {
        self.tones[k] += cosine.zip_map(sine, |c, s| Complex::new(c, -s));
        self
    }

    /// Adds `constant`, of length `n`, to the constant part.
    #[must_use]
    pub fn with_constant(mut self, constant: &DVector<f64>) -> Self {
        self.constant += constant;
        self
    }

    /// Returns the value at time `t`.
    pub fn at(&self, drive: &Drive, t: f64) -> DVector<f64> {
        let mut value = DVector::zeros(self.constant.len());
        self.write(drive, t, value.as_mut_slice());
        value
    }

    /// Writes the value at time `t` to `value` (length `n`).
    pub(crate) fn write(&self, drive: &Drive, t: f64, value: &mut [f64]) {
        self.write_where_tones_are((0..self.tones.len()).map(|k| drive.phasor(k, t)), value);
    }

    /// Writes the value for the phasors `e^{iω_k t}` of the tones to `value` (length `n`).
    pub(crate) fn write_where_tones_are(
        &self,
        phasors: impl IntoIterator<Item = Complex>,
        value: &mut [f64],
    ) {
        value.copy_from_slice(self.constant.as_slice());
        for (tone, phasor) in self.tones.iter().zip(phasors) {
            for (v, z) in value.iter_mut().zip(tone.as_slice()) {
                *v += z.re * phasor.re - z.im * phasor.im;
            }
        }
    }

    /// Returns the time derivative, again a harmonic vector.
    #[must_use]
    pub fn rate(&self, drive: &Drive) -> Self {
        let tones = self
            .tones
            .iter()
            .zip(drive.frequencies())
            .map(|(z, &w)| z * Complex::new(0.0, w))
            .collect();
        Self {
            constant: DVector::zeros(self.constant.len()),
            tones,
        }
    }

    /// Returns the product `matrix · self`.
    #[must_use]
    pub fn mapped(&self, matrix: &DMatrix<f64>) -> Self {
        let complex = matrix.map(|v| Complex::new(v, 0.0));
        Self {
            constant: matrix * &self.constant,
            tones: self.tones.iter().map(|z| &complex * z).collect(),
        }
    }

    /// Returns `self + factor · other`.
    #[must_use]
    pub fn plus(&self, factor: f64, other: &Self) -> Self {
        Self {
            constant: &self.constant + factor * &other.constant,
            tones: self
                .tones
                .iter()
                .zip(&other.tones)
                .map(|(a, b)| a + b * Complex::new(factor, 0.0))
                .collect(),
        }
    }

    pub(crate) fn check(
        &self,
        what: &'static str,
        n: usize,
        tones: usize,
    ) -> Result<(), FlowError> {
        let shape = |found, expected| FlowError::Shape {
            what,
            found,
            expected,
        };
        if self.constant.len() != n {
            return Err(shape(self.constant.len(), n));
        }
        if self.tones.len() != tones {
            return Err(shape(self.tones.len(), tones));
        }
        for tone in &self.tones {
            if tone.len() != n {
                return Err(shape(tone.len(), n));
            }
        }
        let finite = self.constant.iter().all(|v| v.is_finite())
            && self
                .tones
                .iter()
                .flat_map(|z| z.iter())
                .all(|z| z.re.is_finite() && z.im.is_finite());
        if finite {
            Ok(())
        } else {
            Err(FlowError::NotFinite { what })
        }
    }
}

/// A scalar `row · x + c + Σ_k Re(z_k e^{iω_k t})`: a guard or an observed output.
#[derive(Clone, Debug, PartialEq)]
pub struct Output {
    /// Row that multiplies the state, of length `n`.
    pub row: RowDVector<f64>,
    /// Constant part `c`, in the units of the output.
    pub constant: f64,
    /// Complex amplitudes `z_k`, one per tone (see [`HarmonicVector::tones`]), in the units of the
    /// output.
    pub tones: Vec<Complex>,
}

impl Output {
    /// Creates `row · x` alone, for a drive of `tones` tones.
    pub fn linear(row: RowDVector<f64>, tones: usize) -> Self {
        Self {
            row,
            constant: 0.0,
            tones: vec![Complex::new(0.0, 0.0); tones],
        }
    }

    /// Adds `sine · sin ω_k t + cosine · cos ω_k t`.
    #[must_use]
    pub fn with_tone(mut self, k: usize, sine: f64, cosine: f64) -> Self {
        self.tones[k] += Complex::new(cosine, -sine);
        self
    }

    /// Adds `constant` to the constant part.
    #[must_use]
    pub fn with_constant(mut self, constant: f64) -> Self {
        self.constant += constant;
        self
    }

    /// Returns the product `factor · self`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            row: &self.row * factor,
            constant: self.constant * factor,
            tones: self.tones.iter().map(|z| z * factor).collect(),
        }
    }

    /// Returns `self + factor · other`.
    #[must_use]
    pub fn plus(&self, factor: f64, other: &Self) -> Self {
        Self {
            row: &self.row + factor * &other.row,
            constant: self.constant + factor * other.constant,
            tones: self
                .tones
                .iter()
                .zip(&other.tones)
                .map(|(a, b)| a + b * factor)
                .collect(),
        }
    }

    /// Returns the value at state `x` and time `t`.
    pub fn at(&self, drive: &Drive, x: &[f64], t: f64) -> f64 {
        let harmonic: f64 = self
            .tones
            .iter()
            .enumerate()
            .filter(|(_, z)| **z != Complex::new(0.0, 0.0))
            .map(|(k, z)| (z * drive.phasor(k, t)).re)
            .sum();
        self.linear_at(x) + self.constant + harmonic
    }

    /// Returns the value at state `x` for the phasors `e^{iω_k t}` of the tones.
    pub(crate) fn where_tones_are(&self, phasors: &[Complex], x: &[f64]) -> f64 {
        let tones = self.tones.iter().zip(phasors);
        let harmonic: f64 = tones.map(|(z, p)| z.re * p.re - z.im * p.im).sum();
        self.linear_at(x) + self.constant + harmonic
    }

    fn linear_at(&self, x: &[f64]) -> f64 {
        self.row.as_slice().iter().zip(x).map(|(r, x)| r * x).sum()
    }

    /// Returns the time derivative along `ẋ = matrix · x + forcing`, again such a scalar.
    #[must_use]
    pub fn rate(&self, matrix: &DMatrix<f64>, forcing: &HarmonicVector, drive: &Drive) -> Self {
        let dot = |tone: &DVector<Complex>| -> Complex {
            self.row.iter().zip(tone.iter()).map(|(r, z)| z * *r).sum()
        };
        let tones = self
            .tones
            .iter()
            .zip(&forcing.tones)
            .zip(drive.frequencies())
            .map(|((z, f), &w)| z * Complex::new(0.0, w) + dot(f))
            .collect();
        Self {
            row: &self.row * matrix,
            constant: (&self.row * &forcing.constant)[0],
            tones,
        }
    }

    pub(crate) fn check(
        &self,
        what: &'static str,
        n: usize,
        tones: usize,
    ) -> Result<(), FlowError> {
        if self.row.len() != n {
            return Err(FlowError::Shape {
                what,
                found: self.row.len(),
                expected: n,
            });
        }
        if self.tones.len() != tones {
            return Err(FlowError::Shape {
                what,
                found: self.tones.len(),
                expected: tones,
            });
        }
        let finite = self.constant.is_finite()
            && self.row.iter().all(|v| v.is_finite())
            && self
                .tones
                .iter()
                .all(|z| z.re.is_finite() && z.im.is_finite());
        if finite {
            Ok(())
        } else {
            Err(FlowError::NotFinite { what })
        }
    }
}

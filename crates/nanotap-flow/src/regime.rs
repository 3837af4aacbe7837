//! One linear regime, `ẋ = A x + f(t)` with harmonic `f`, solved in closed form.

use crate::prepared_basis::PreparedBasis;
use crate::relaxation::relaxation_masks;
use crate::simd::{ComplexVector, Vector, layout};
use crate::{Complex, Drive, FlowError, HarmonicVector, Output, SpectralBasis};
use nalgebra::DMatrix;
use nanotap_arithmetic::ComplexFunctions as _;
use std::sync::Arc;

/// A linear regime with its spectral basis and its forced response `x_p(t)`; the
/// solution is `x(t) = x_p(t) + Re(R e^{Λ(t − t₀)} q)`, `q = L (x(t₀) − x_p(t₀))`.
#[derive(Clone, Debug, PartialEq)]
pub struct Regime {
    matrix: DMatrix<f64>,
    forcing: HarmonicVector,
    prepared: Arc<PreparedBasis>,
    response: HarmonicVector,
}

impl Regime {
    /// Creates the regime of matrix `A` (`n × n`) and forcing `f` (length `n`). `index` is its
    /// number in the system, for messages.
    ///
    /// # Errors
    /// If sizes do not fit, a value is not finite, the basis is too ill-conditioned, or an undamped
    /// mode is driven at resonance.
    pub fn new(
        index: usize,
        matrix: DMatrix<f64>,
        forcing: HarmonicVector,
        drive: &Drive,
    ) -> Result<Self, FlowError> {
        check(&matrix, &forcing, drive)?;
        let basis = SpectralBasis::of(&matrix, drive.period(), index)?;
        Self::with_basis(index, matrix, forcing, drive, Arc::new(basis.into()))
    }

    /// Creates the regime with a basis that the caller knows, and may share with other regimes.
    ///
    /// # Errors
    /// As [`Regime::new`].
    pub fn with_basis(
        index: usize,
        matrix: DMatrix<f64>,
        forcing: HarmonicVector,
        drive: &Drive,
        prepared: Arc<PreparedBasis>,
    ) -> Result<Self, FlowError> {
        check(&matrix, &forcing, drive)?;
        let response = forced_response(index, &forcing, drive, prepared.basis())?;
        Ok(Self {
            matrix,
            forcing,
            prepared,
            response,
        })
    }

    /// Returns the matrix `A`, `n × n`.
    pub fn matrix(&self) -> &DMatrix<f64> {
        &self.matrix
    }

    /// Returns the forcing `f`, of length `n`.
    pub fn forcing(&self) -> &HarmonicVector {
        &self.forcing
    }

    /// Returns the spectral basis of the matrix `A`.
    pub fn basis(&self) -> &SpectralBasis {
        self.prepared.basis()
    }

    /// Returns the spectral basis in the layout of the inner loop.
    pub(crate) fn prepared(&self) -> &PreparedBasis {
        &self.prepared
    }

    /// Returns the forced response `x_p`, of length `n`.
    pub fn response(&self) -> &HarmonicVector {
        &self.response
    }

    /// Writes the modal coordinates of state `x` at time `t` to `q`; `rest` is work space of the
    /// length of the state.
    pub(crate) fn to_modal(
        &self,
        drive: &Drive,
        x: &[f64],
        t: f64,
        rest: &mut [f64],
        q: &mut [Complex],
    ) {
        self.response.write(drive, t, rest);
        q.fill(Complex::new(0.0, 0.0));
        let columns = self.basis().left.as_slice().chunks_exact(q.len().max(1));
        for ((x, p), left) in x.iter().zip(rest).zip(columns) {
            let own = x - *p;
            for (q, l) in q.iter_mut().zip(left) {
                *q += l * own;
            }
        }
    }

    /// Writes the state of modal coordinates `q` at time `t` to `x`.
    pub(crate) fn to_state(
        &self,
        drive: &Drive,
        q: impl IntoIterator<Item = Complex>,
        t: f64,
        x: &mut [f64],
    ) {
        self.response.write(drive, t, x);
        let columns = self.basis().right.as_slice().chunks_exact(x.len().max(1));
        for (q, column) in q.into_iter().zip(columns) {
            for (x, r) in x.iter_mut().zip(column) {
                *x += r.re * q.re - r.im * q.im;
            }
        }
    }

    /// Calls `visit` with every entry of the constant parts of forcing and response.
    pub(crate) fn each_constant(&mut self, visit: &mut dyn FnMut(&mut f64)) {
        let constants = [&mut self.forcing.constant, &mut self.response.constant];
        constants.into_iter().flatten().for_each(visit);
    }

    /// Returns an output in this regime's modal coordinates.
    pub fn project(&self, output: &Output) -> ModalOutput {
        let dot = |column: &[Complex]| -> Complex {
            output.row.iter().zip(column).map(|(r, z)| z * *r).sum()
        };
        ModalOutput {
            modal: (0..self.basis().len())
                .map(|k| dot(self.basis().right.column(k).as_slice()))
                .collect(),
            tones: output
                .tones
                .iter()
                .zip(&self.response.tones)
                .map(|(z, response)| z + dot(response.as_slice()))
                .collect(),
            constant: output.constant + (&output.row * &self.response.constant)[0],
        }
    }
}

/// An output in modal coordinates: `Re(modal · q) + Re Σ tones_k e^{iω_k t} + constant`.
#[derive(Clone, Debug, PartialEq)]
pub struct ModalOutput {
    /// Complex weights of the modal coordinates, of length `m`.
    pub modal: Vec<Complex>,
    /// Complex amplitudes of the tones, in the units of the output.
    pub tones: Vec<Complex>,
    /// Constant part, forced response included, in the units of the output.
    pub constant: f64,
}

impl ModalOutput {
    /// Returns the value at modal coordinates `q` and time `t`.
    pub fn at(&self, drive: &Drive, q: &[Complex], t: f64) -> f64 {
        let phasors = (0..self.tones.len()).map(|k| drive.phasor(k, t));
        let modes = self.modal.iter().copied().zip(q.iter().copied());
        let terms = modes.chain(self.tones.iter().copied().zip(phasors));
        self.constant + terms.map(|(w, q)| (w * q).re).sum::<f64>()
    }
}

/// A [`ModalOutput`] of a regime without clusters, packed for the inner loop: modal
/// coordinates first, then the tones' phasors.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Kernel {
    pub(crate) vectors: Vec<KernelVectors>,
    pub(crate) count: usize,
    pub(crate) constant: f64,
    /// Largest `|λ|` of the terms with a non-zero weight, per unit of time.
    pub(crate) fastest: f64,
    /// Whether some `Re λ` is positive.
    pub(crate) grows: bool,
}

/// Four terms of a kernel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct KernelVectors {
    pub(crate) decay: Vector,
    pub(crate) frequency: Vector,
    pub(crate) weight: ComplexVector,
    /// `|λ|³` of each term, for bounds of the third derivative.
    pub(crate) cube: Vector,
    /// Masks of the terms that each lower bound follows.
    pub(crate) masks: ComplexVector,
}

/// The part that the kernels of all outputs of a regime share: the rates of their terms.
pub(crate) struct KernelFrame {
    kernel: Kernel,
    /// Absolute rate `|λ|` of each term.
    sizes: Vec<f64>,
}

impl KernelFrame {
    /// Packs the rates of `regime` and of the drive.
    pub(crate) fn new(regime: &Regime, drive: &Drive) -> Self {
        let tones = drive.frequencies().iter();
        let tones = tones.map(|&w| Complex::new(0.0, w));
        let rates: Vec<Complex> = regime
            .basis()
            .eigenvalues
            .iter()
            .copied()
            .chain(tones)
            .collect();
        let mut kernel = Kernel {
            vectors: vec![KernelVectors::default(); layout::vectors_for(rates.len())],
            count: rates.len(),
            ..Kernel::default()
        };
        let sizes: Vec<f64> = rates.iter().map(|rate| rate.modulus()).collect();
        let masks = relaxation_masks(&sizes);
        for (k, rate) in rates.into_iter().enumerate() {
            let (vector, i) = layout::place(k);
            let vector = &mut kernel.vectors[vector];
            for (lanes, mask) in vector.masks.iter_mut().zip(masks[k]) {
                lanes[i] = mask;
            }
            vector.decay[i] = rate.re;
            vector.frequency[i] = rate.im;
            vector.cube[i] = sizes[k].powi(3);
        }
        Self { kernel, sizes }
    }

    /// Returns the kernel with the weights of `output`.
    pub(crate) fn kernel(&self, output: &ModalOutput) -> Kernel {
        let mut kernel = self.kernel.clone();
        kernel.constant = output.constant;
        for (k, weight) in output.modal.iter().chain(&output.tones).enumerate() {
            let (vector, i) = layout::place(k);
            let vector = &mut kernel.vectors[vector];
            vector.weight[0][i] = weight.re;
            vector.weight[1][i] = weight.im;
            if weight.re != 0.0 || weight.im != 0.0 {
                kernel.fastest = kernel.fastest.max(self.sizes[k]);
                kernel.grows |= vector.decay[i] > 0.0;
            }
        }
        kernel
    }
}

impl Kernel {
    /// Returns the rate `λ` of term `k`.
    pub(crate) fn rate(&self, k: usize) -> Complex {
        let (vector, lane) = layout::place(k);
        let vector = &self.vectors[vector];
        Complex::new(vector.decay[lane], vector.frequency[lane])
    }
}

fn check(matrix: &DMatrix<f64>, forcing: &HarmonicVector, drive: &Drive) -> Result<(), FlowError> {
    let n = matrix.nrows();
    if n == 0 {
        return Err(FlowError::Shape {
            what: "a regime's matrix",
            found: 0,
            expected: 1,
        });
    }
    if matrix.ncols() != n {
        return Err(FlowError::Shape {
            what: "a regime's matrix",
            found: matrix.ncols(),
            expected: n,
        });
    }
    if matrix.iter().any(|v| !v.is_finite()) {
        return Err(FlowError::NotFinite {
            what: "a regime's matrix",
        });
    }
    forcing.check("a regime's forcing", n, drive.frequencies().len())
}

/// Computes `x_p`: each tone's complex amplitude solves `(iω − A) X = F`, mode by mode.
fn forced_response(
    index: usize,
    forcing: &HarmonicVector,
    drive: &Drive,
    basis: &SpectralBasis,
) -> Result<HarmonicVector, FlowError> {
    let n = forcing.constant.len();
    let resonance = |frequency: f64| {
        move |mode: Complex| FlowError::Resonance {
            regime: index,
            frequency,
            mode: mode.im.abs(),
        }
    };
    let mut tones = Vec::with_capacity(forcing.tones.len());
    for (tone, &omega) in forcing.tones.iter().zip(drive.frequencies()) {
        // A pair represents itself and its conjugate: Re(R y), with R's factor 2, covers
        // both for a real right-hand side only. Re(F e^{iωt}) is half the sum of F e^{iωt}
        // and F̄ e^{−iωt}, and the response to the second is the conjugate of that to
        // the first with all eigenvalues: (R y₊ + conj(R y₋)) / 2.
        let z = Complex::new(0.0, omega);
        let plus = basis
            .resolvent(z, &(&basis.left * tone))
            .map_err(resonance(omega))?;
        let minus = basis
            .resolvent(-z, &(&basis.left * tone.map(|f| f.conj())))
            .map_err(resonance(omega))?;
        let mut response = &basis.right * plus;
        response.zip_apply(&(&basis.right * minus), |plus, minus| {
            *plus = (*plus + minus.conj()) * 0.5;
        });
        tones.push(response);
    }
    let b = &basis.left * forcing.constant.map(|v| Complex::new(v, 0.0));
    let y = basis
        .resolvent(Complex::new(0.0, 0.0), &b)
        .map_err(resonance(0.0))?;
    let constant = (&basis.right * y).map(|z| z.re);
    debug_assert_eq!(constant.len(), n);
    Ok(HarmonicVector { constant, tones })
}

//! What is to be accumulated, and the same made ready for one system.

use std::sync::Arc;

use crate::regime::ModalOutput;
use crate::{FlowError, Output, System};

/// An output of a [`Request`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Channel(pub(super) usize);

/// A least or greatest value that was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ExtremumKey(pub(super) usize);

/// An integral that was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct IntegralKey(pub(super) usize);

/// An integral of a product that was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ProductKey(pub(super) usize);

/// A Fourier coefficient that was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FourierKey(pub(super) usize);

/// Which end of an output's range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    Least,
    Greatest,
}

/// An output in every regime.
#[derive(Clone, Debug, PartialEq)]
enum Outputs {
    Same(Output),
    ByRegime(Vec<Output>),
}

/// Outputs, and what is wanted of each. See the [module](super).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Request {
    outputs: Vec<Outputs>,
    pub(super) extrema: Vec<(usize, End)>,
    pub(super) integrals: Vec<usize>,
    pub(super) products: Vec<(usize, usize)>,
    pub(super) fouriers: Vec<(usize, f64)>,
}

impl Request {
    /// Nothing yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// An output that is the same in every regime.
    pub fn output(&mut self, output: &Output) -> Channel {
        self.channel(Outputs::Same(output.clone()))
    }

    /// An output that differs from regime to regime, such as a contact force: one entry a
    /// regime.
    pub fn output_by_regime(&mut self, outputs: &[Output]) -> Channel {
        self.channel(Outputs::ByRegime(outputs.to_vec()))
    }

    fn channel(&mut self, outputs: Outputs) -> Channel {
        Channel(place(&mut self.outputs, outputs))
    }

    /// The least value.
    pub fn least(&mut self, channel: Channel) -> ExtremumKey {
        ExtremumKey(place(&mut self.extrema, (channel.0, End::Least)))
    }

    /// The greatest value.
    pub fn greatest(&mut self, channel: Channel) -> ExtremumKey {
        ExtremumKey(place(&mut self.extrema, (channel.0, End::Greatest)))
    }

    /// `∫ g dt`.
    pub fn integral(&mut self, channel: Channel) -> IntegralKey {
        IntegralKey(place(&mut self.integrals, channel.0))
    }

    /// `∫ g h dt`; with itself, of the square.
    pub fn product(&mut self, g: Channel, h: Channel) -> ProductKey {
        let pair = (g.0.min(h.0), g.0.max(h.0));
        ProductKey(place(&mut self.products, pair))
    }

    /// `∫ g e^{−iωt} dt`. Twice this over the duration `D`, `c = (2/D) ∫ g e^{−iωt} dt`, is the
    /// amplitude of the component `Re(c e^{iωt})`.
    pub fn fourier(&mut self, channel: Channel, omega: f64) -> FourierKey {
        FourierKey(place(&mut self.fouriers, (channel.0, omega)))
    }

    /// The request made ready for `system`.
    ///
    /// # Errors
    /// When an output does not fit the system (its length, its tones, or its number of
    /// regimes), or a value or frequency is not finite.
    pub fn plan(&self, system: &System) -> Result<Arc<Plan>, FlowError> {
        let (n, tones) = (system.dimension(), system.drive().frequencies().len());
        let regimes = system.regimes();
        if self.fouriers.iter().any(|(_, omega)| !omega.is_finite()) {
            return Err(FlowError::NotFinite {
                what: "a frequency of a Fourier coefficient",
            });
        }
        let mut outputs = vec![Vec::with_capacity(self.outputs.len()); regimes.len()];
        for channel in &self.outputs {
            if let Outputs::ByRegime(all) = channel
                && all.len() != regimes.len()
            {
                return Err(FlowError::Shape {
                    what: "an output for each regime",
                    found: all.len(),
                    expected: regimes.len(),
                });
            }
            for (r, (regime, modal)) in regimes.iter().zip(&mut outputs).enumerate() {
                let output = match channel {
                    Outputs::Same(output) => output,
                    Outputs::ByRegime(all) => &all[r],
                };
                output.check("an output", n, tones)?;
                modal.push(regime.project(output));
            }
        }
        Ok(Arc::new(Plan {
            request: self.clone(),
            outputs,
        }))
    }
}

/// Where `item` stands in the list, at its end if it was not there.
fn place<T: PartialEq>(list: &mut Vec<T>, item: T) -> usize {
    list.iter()
        .position(|other| *other == item)
        .unwrap_or_else(|| {
            list.push(item);
            list.len() - 1
        })
}

/// A [`Request`] made ready for one [`System`].
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    pub(super) request: Request,
    /// `outputs[r][c]`: channel `c` in modal coordinates of regime `r`.
    pub(super) outputs: Vec<Vec<ModalOutput>>,
}

impl Plan {
    /// How many regimes the system has.
    pub(super) fn regimes(&self) -> usize {
        self.outputs.len()
    }
}

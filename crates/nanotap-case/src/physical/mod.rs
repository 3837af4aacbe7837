//! Physical units: quantities of data sheets, mapped to α1 … α6 and Ω.
//!
//! The quantities that a case states, with levers and materials of the [`Catalogue`] by name,
//! are mapped to a dimensionless [`Cantilever`](nanotap_model::cantilever::Cantilever) and the
//! [`Scales`] that turn its results back into SI units: together the view [`Physical`].
//! [`Remark`]s say what had to be assumed.
//!
//! An FM-class lever whose tip weighs a tenth of the beam, on polystyrene: α4 is about 25,
//! near the paper's 20, and Ω = 2.6 is 65.7 kHz. An NCHR-class lever is fifteen times as
//! stiff; on the same sample its α4 is 2.1, far from the paper's case.
//!
//! ```
//! use nanotap::case::Case;
//! use nanotap::case::physical::Kind;
//!
//! let words = |lever: &str| {
//!     [
//!         &format!("cantilever.lever={lever}"),
//!         "cantilever.Q=200",
//!         "tip.mass_ratio=0.1",
//!         "sample.material=polystyrene",
//!         "drive.frequency=65.7 kHz",
//!         "drive.free_amplitude=20 nm",
//!         "gap.tip=0 nm",
//!     ]
//!     .map(str::to_owned)
//! };
//! let soft = Case::parse(None, &words("PPP-FM"))?;
//! let soft = soft.physical().unwrap();
//! assert!((soft.cantilever.alpha4 - 25.0).abs() < 1.0);
//! let frequency = 2.6 * soft.scales.frequency;
//! assert_eq!(Kind::Frequency.format_digits(frequency, 3), "65.7 kHz");
//!
//! let stiff = Case::parse(None, &words("PPP-NCHR"))?;
//! assert!((stiff.physical().unwrap().cantilever.alpha4 - 2.1).abs() < 0.1);
//! # Ok::<(), nanotap::case::file::CaseFileError>(())
//! ```

mod beam_geometry;
pub mod blade;
pub mod catalogue;
pub mod drive;
mod elastic;
mod error;
pub mod fluid;
pub mod force;
pub mod free_response;
pub mod lever;
pub mod mapping;
mod reader;
mod remark;
mod remarks;
pub mod sample;
pub mod tip;
mod view;

pub(crate) use catalogue::Lever as CatalogueLever;
pub use catalogue::{Catalogue, CatalogueError};
pub use error::PhysicalError;
pub use lever::{BeamGeometry, Lever, LeverData};
pub use mapping::{MappingRow, Scales};
pub use remark::{Remark, Severity};
pub use view::{Held, Physical};

pub(crate) use reader::Reader;

pub use super::quantity::{self, Kind, Quantity, QuantityError};

#[cfg(test)]
mod tests;

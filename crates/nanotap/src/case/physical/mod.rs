//! Physical units: what stands on the lever's box and on the sample's label, as α1 … α6 and Ω.
//!
//! A [`PhysicalCase`] is read from the sections of a case file, with levers and materials of
//! the [`Catalogue`] by name, and [resolved](PhysicalCase::resolve) into a dimensionless
//! [`Cantilever`](crate::model::cantilever::Cantilever), the [`Scales`] that turn its results back into SI units, and
//! [`Remark`]s on what had to be assumed.
//!
//! An FM-class lever whose tip weighs a tenth of the beam, on polystyrene: α4 is about 25,
//! near the paper's 20, and Ω = 2.6 is 65.7 kHz. An NCHR-class lever is fifteen times as
//! stiff; on the same sample its α4 is 2.1, far from the paper's case.
//!
//! ```
//! use nanotap::model::cantilever::CosineTerm;
//! use nanotap::case::physical::{Catalogue, Kind, PhysicalCase, Sections};
//!
//! let mut sections = Sections::new();
//! for (section, key, value) in [
//!     ("cantilever", "lever", "PPP-FM"),
//!     ("cantilever", "Q", "200"),
//!     ("tip", "mass_ratio", "0.1"),
//!     ("sample", "material", "polystyrene"),
//!     ("drive", "frequency", "65.7 kHz"),
//!     ("drive", "free_amplitude", "20 nm"),
//!     ("gap", "tip", "0 nm"),
//! ] {
//!     let section = sections.entry(section.to_owned()).or_default();
//!     section.insert(key.to_owned(), value.to_owned());
//! }
//! let catalogue = Catalogue::builtin()?;
//! let read = |sections: &Sections| {
//!     PhysicalCase::from_sections(sections, 3, CosineTerm::Corrected, &catalogue)?.resolve()
//! };
//! let soft = read(&sections)?;
//! assert!((soft.case.alpha4 - 25.0).abs() < 1.0);
//! let frequency = 2.6 * soft.scales.frequency;
//! assert_eq!(Kind::Frequency.format_digits(frequency, 3), "65.7 kHz");
//!
//! sections.get_mut("cantilever").unwrap().insert("lever".into(), "PPP-NCHR".into());
//! let stiff = read(&sections)?;
//! assert!((stiff.case.alpha4 - 2.1).abs() < 0.1);
//! # Ok::<(), nanotap::case::physical::PhysicalError>(())
//! ```

pub mod catalogue;
pub mod drive;
mod error;
pub mod free_response;
pub mod lever;
pub mod mapping;
mod physical_case;
pub mod quantity;
mod remark;
pub mod sample;
mod section;
pub mod tip;

pub use catalogue::{Catalogue, CatalogueError};
pub use error::PhysicalError;
pub use lever::{BeamGeometry, Lever, LeverData};
pub use mapping::{MappingRow, PhysicalParameters, Scales};
pub use physical_case::{PhysicalCase, Resolved, SECTIONS};
pub use quantity::{Kind, Quantity, QuantityError};
pub use remark::{Remark, Severity};
pub use section::{Section, Sections};

#[cfg(test)]
mod tests;

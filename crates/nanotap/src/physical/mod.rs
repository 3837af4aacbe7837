//! Physical units: what stands on the lever's box and on the sample's label, as α1 … α6 and Ω.
//!
//! A [`PhysicalCase`] is read from the sections of a case file, with levers and materials of
//! the [`Catalogue`] by name, and [resolved](PhysicalCase::resolve) into a dimensionless
//! [`Case`](crate::case::Case), the [`Scales`] that turn its results back into SI units, and
//! [`Remark`]s on what had to be assumed.

pub mod catalogue;
pub mod drive;
mod error;
pub mod free_response;
pub mod lever;
pub mod mapping;
mod nearest;
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

//! The site of the documents, as input for mdBook.
//!
//! `docs/SUMMARY.md` lists the pages. Pages of this repository are checked and copied, with every
//! formula typeset as MathML, so that the site can be read without a network or scripts. Pages
//! under `docs/reference/` are not in the repository: they are generated from the tables that the
//! program itself reads, and from the report on the paper.

mod formula;
mod page;
mod reference;
mod site;

pub use site::{Site, Trouble};

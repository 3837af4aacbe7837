//! The site of documents, before mdBook makes pages of it.
//!
//! `docs/SUMMARY.md` lists the pages; what stands in this repository is checked and copied, with
//! every formula typeset as MathML, so that the site needs neither a network nor scripts to be
//! read. Pages under `docs/reference/` are not in the repository: they are made of the tables that
//! the program itself reads, and of the report on the paper.

mod formula;
mod page;
mod reference;
mod site;

pub use site::{Site, Trouble};

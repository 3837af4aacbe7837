//! The site of the documents, as input for mdBook.
//!
//! `docs/SUMMARY.md` lists the pages. Pages of this repository are checked and copied, with every
//! formula typeset as MathML, so that the site can be read without a network or scripts. Pages under
//! `docs/reference/` are generated from the tables that the program itself reads: `cargo xtask
//! reference` writes them, and a test compares them. The page on the paper is made with the site.

mod formula;
mod page;
mod reference;
mod site;

pub use site::{Site, Trouble, outdated_reference};

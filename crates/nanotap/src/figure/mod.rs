//! The figures: a description of each study's report, which `nanotap-figures` draws.

pub use nanotap_fit::figure::{calibrate, files, fit};
pub use nanotap_images::figure as image_states;
pub use nanotap_motions::figure::{
    approach, attractors, branch, contact, motion, panels, plotted_quantity,
};
pub use nanotap_reconstruct::figure::reconstruct;
pub use nanotap_scan::figure::{force_curve, scan};
pub use nanotap_surveys::figure::{
    basin, bimodal, contact_laws, convergence, modes, noise, sweep, window,
};

//! Tapping-mode atomic force microscopy, exactly: beam modes, Galerkin matrices,
//! contact laws, observables and experiments.

pub mod attractor_figure;
pub mod attractors;
pub mod basin;
pub mod beam;
mod beam_equations;
pub mod branch;
pub mod branch_figure;
pub mod case;
pub mod case_document;
pub mod case_file;
pub mod contact;
pub mod convergence;
pub mod dataset;
pub mod drive_form;
pub mod exact_beam;
pub mod experiment;
pub mod fixed_step_run;
pub mod galerkin;
pub mod lyapunov;
pub mod mode_share;
pub mod mode_table;
pub mod model;
pub mod motion_figure;
pub mod near_name;
pub mod observables;
pub mod orbit;
pub mod oscillator;
pub mod paper;
pub mod parameter;
pub mod physical;
pub mod physical_subject;
pub mod sample_comparison;
pub mod sample_figure;
pub mod simulate;
pub mod spectrum;
pub mod start_box;
pub mod strobe;
pub mod studied;
pub mod subject;
pub mod sweep;
pub mod time_series;
pub mod units;

pub use nanotap_dynamics::control;

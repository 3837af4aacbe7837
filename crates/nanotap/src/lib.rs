//! Tapping-mode atomic force microscopy, exactly: beam modes, Galerkin matrices,
//! contact laws, observables and experiments.

pub mod beam;
pub mod case;
pub mod case_file;
pub mod convergence;
pub mod exact_beam;
pub mod fixed_step_run;
pub mod galerkin;
pub mod mode_table;
pub mod model;
pub mod motion_figure;
pub mod observables;
pub mod orbit;
pub mod oscillator;
pub mod parameter;
pub mod physical;
pub mod simulate;
pub mod spectrum;
pub mod strobe;
pub mod subject;
pub mod time_series;
pub mod units;

//! Experiments against closed forms, invariants and independent methods.

mod approach;

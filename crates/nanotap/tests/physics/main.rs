//! The physics and the mathematics of nanotap against references, closed forms and
//! independent methods.

mod derivatives;
mod facts;
mod impact_oscillator;
mod motions;
mod observables;
mod references;
mod short_contacts;

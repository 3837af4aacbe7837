//! A number with its derivative with respect to one parameter.

pub use nanotap_arithmetic::Dual;

//! A number with its derivative with respect to one parameter.

pub(crate) use nanotap_arithmetic::Dual;

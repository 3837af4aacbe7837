//! Sweeps, basins and their datasets.

#![allow(
    clippy::disallowed_methods,
    reason = "references are the platform's own functions"
)]

mod basins;
mod damaged;
mod datasets;
mod folder;
mod neighbours;
mod packing;
mod physics;
mod setpoint_map;
mod setpoints;

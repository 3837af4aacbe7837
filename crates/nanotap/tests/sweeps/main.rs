//! Sweeps, basins and their datasets.

mod basins;
mod datasets;
mod folder;
mod neighbours;
mod physics;

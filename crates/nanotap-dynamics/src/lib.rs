//! Analysis of any periodically forced system through its stroboscopic map:
//! which motions exist, how stable each is, where it is born and dies.
//!
//! Nothing here knows of beams, tips or contact. A system implements
//! [`map::StroboscopicMap`] (and [`map::MapFamily`] for continuation); everything
//! else follows from it.

mod adapted_norm;
pub mod basin;
pub mod bifurcation;
mod birkhoff;
mod block_average;
mod block_cyclic;
mod branch_solver;
pub mod branch_switching;
pub mod census;
pub mod confidence;
pub mod continuation;
pub mod control;
pub mod diagram;
mod failure;
pub mod locus;
pub mod lyapunov;
pub mod map;
pub mod multipliers;
pub mod neighbourhood;
pub mod orbit;
pub mod period;
pub mod settle;
pub mod shooting;
pub mod starts;
pub mod unstable;
mod vector;

pub use basin::{BasinError, BasinOptions, Basins, Label, Slice, SliceAxis};
pub use bifurcation::{Bifurcation, BifurcationKind};
pub use birkhoff::birkhoff_digits;
pub use branch_solver::OrbitTangency;
pub use branch_switching::switch_at_flip;
pub use census::{Attractor, AttractorKind, Census, CensusOptions, Fate, TransientChaos, census};
pub use confidence::{Fraction, Lifetime};
pub use continuation::{
    Branch, BranchEnd, BranchPoint, ContinuationError, ContinuationOptions, Direction,
    continue_orbit,
};
pub use control::Control;
pub use diagram::{Diagram, DiagramBranch, DiagramOptions, assemble_diagram};
pub use failure::MapFailure;
pub use locus::{Locus, LocusOptions, LocusPoint, TwoParameterFamily, trace_locus};
pub use lyapunov::{LyapunovOptions, LyapunovSpectrum, lyapunov_spectrum};
pub use map::{MapFamily, StroboscopicMap, Tangency};
pub use multipliers::{MultiplierError, Multipliers, Stability};
pub use nalgebra::{Complex, DMatrix};
pub use neighbourhood::Neighbourhood;
pub use orbit::PeriodicOrbit;
pub use period::{Candidate, candidate_periods};
pub use settle::{Chaos, SettleOptions, Settled, Torus, UndecidedReason, Verdict, settle};
pub use shooting::{
    DivergenceReason, ShootingError, ShootingOptions, close_orbit, close_orbit_from_points,
};
pub use starts::{StartBox, StartBoxError};
pub use unstable::{OrbitSearch, find_orbits};

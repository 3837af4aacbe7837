//! Analysis of any periodically forced system through its stroboscopic map:
//! which motions exist, how stable each is, where it is born and dies.
//!
//! Nothing here knows of beams, tips or contact. A system implements
//! [`map::StroboscopicMap`] (and [`map::MapFamily`] for continuation); everything
//! else follows from it. One folder a concept, each calling only those before it:
//!
//! | folder | what it answers |
//! |---|---|
//! | [`orbit`] | which orbit closes near here, and is it stable |
//! | [`neighbourhood`] | from where every motion goes to a given orbit |
//! | [`lyapunov`] | how fast neighbouring motions part |
//! | [`classify()`] | what the motion from one start comes to |
//! | [`mod@census`] | which attractors a set of starts goes to, and what it may have missed |
//! | [`global`] | which attractors there are all over a grid of parameter values |
//! | [`basin`] | which points of a slice go to which attractor |
//! | [`continuation`] | how an orbit goes on in one parameter, and its bifurcations |
//! | [`curve`] | where a bifurcation goes on in two parameters |

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

pub mod basin;
pub mod census;
pub mod classify;
pub mod continuation;
pub mod control;
pub mod curve;
mod failure;
pub mod global;
pub mod lyapunov;
pub mod map;
pub mod neighbourhood;
pub mod orbit;
mod vector;

pub use basin::{BasinError, BasinOptions, Basins, Label, Slice, SliceAxis};
pub use census::{
    Attractor, AttractorKind, Census, CensusEnd, CensusOptions, Fraction, Lifetime, SizeCount,
    StartBox, StartBoxError, StartOrigin, StartOutcome, StartSet, TransientChaos,
    UndiscoveredFraction, census, census_of,
};
pub use classify::{
    Candidate, Chaos, Classified, ClassifyOptions, MotionKind, Torus, UndecidedReason,
    birkhoff_digits, candidate_periods, classify, classify_beside,
};
pub use continuation::{
    Bifurcation, BifurcationKind, Branch, BranchEnd, BranchPoint, ContinuationError,
    ContinuationOptions, Diagram, DiagramBranch, DiagramOptions, Direction, OrbitTangency,
    assemble_diagram, continue_orbit, switch_at_flip,
};
pub use control::{CancelFlag, Control};
pub use curve::{BifurcationCurve, CurveEnd, CurveOptions, CurvePoint, trace_curve};
pub use failure::MapFailure;
pub use global::{
    GlobalAttractor, GlobalOptions, GlobalValue, attractors_along, grid_neighbours, orbits_shared,
};
pub use lyapunov::{LyapunovOptions, LyapunovSpectrum, StrobeMeans, lyapunov_spectrum};
pub use map::{MapFamily, StroboscopicMap, Tangency, TwoParameterFamily};
pub use nalgebra::{Complex, DMatrix};
pub use neighbourhood::Neighbourhood;
pub use orbit::{
    DivergenceReason, MultiplierError, Multipliers, OrbitSearch, PeriodicOrbit, ShootingError,
    ShootingOptions, Stability, check_size, close_orbit, close_orbit_from_points, find_orbits,
};

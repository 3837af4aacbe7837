//! Analysis of periodically forced systems through their stroboscopic maps: coexisting motions,
//! their stability, and their bifurcations.
//!
//! This crate does not depend on beams, tips or contact. A system implements
//! [`map::StroboscopicMap`] (and [`map::MapFamily`] for continuation). Each module depends only on
//! those before it:
//!
//! | module | task |
//! |---|---|
//! | [`orbit`] | find a periodic orbit near a guess, with its stability |
//! | [`neighbourhood`] | find a ball around an orbit from which all motions converge to it |
//! | [`lyapunov`] | compute the rates at which neighbouring motions diverge |
//! | [`classify()`] | follow the motion from one start and classify it |
//! | [`mod@census`] | find the attractors reached from a set of starts, and bound the fraction missed |
//! | [`attractor_continuation`] | find the attractors on a grid of parameter values |
//! | [`basin`] | find the basins of attraction on a slice of initial states |
//! | [`continuation`] | follow an orbit in one parameter, with its bifurcations |
//! | [`codim1_curves`] | follow a bifurcation in two parameters |

#![cfg_attr(
    test,
    allow(
        clippy::disallowed_methods,
        reason = "references are the platform's own functions"
    )
)]

pub mod attractor_continuation;
pub mod basin;
pub mod census;
pub mod classify;
pub mod codim1_curves;
pub mod continuation;
pub mod control;
mod failure;
pub mod lyapunov;
pub mod map;
pub mod neighbourhood;
pub mod orbit;
pub mod random;
mod reset;
mod same_motion;
mod vector;

pub use attractor_continuation::{
    AttractorContinuationOptions, AttractorsAtValue, ContinuedAttractor, continue_attractors,
    grid_neighbours, share_orbits,
};
pub use basin::{BasinError, BasinOptions, Basins, Label, Slice, SliceAxis};
pub use census::{
    Attractor, AttractorKind, Census, CensusEnd, CensusOptions, CheckedStart, ExactOutcome,
    Fraction, Lifetime, SizeCount, StartBox, StartBoxError, StartOrigin, StartOutcome, StartSet,
    TransientChaos, UndiscoveredFraction, Wall, census, census_of, check_starts,
};
pub use classify::{
    Candidate, Chaos, Classified, ClassifyOptions, MotionKind, Torus, UndecidedReason,
    birkhoff_digits, candidate_periods, classify, classify_beside, classify_exactly,
};
pub use codim1_curves::{BifurcationCurve, CurveEnd, CurveOptions, CurvePoint, trace_curve};
pub use continuation::{
    Bifurcation, BifurcationKind, Branch, BranchEnd, BranchPoint, ContinuationError,
    ContinuationOptions, Criticality, Diagram, DiagramBranch, DiagramOptions, Direction,
    OrbitTangency, assemble_diagram, continue_orbit, switch_at_flip,
};
pub use control::{CancelFlag, Control};
pub use failure::MapFailure;
pub use lyapunov::{LyapunovOptions, LyapunovSpectrum, StrobeMeans, lyapunov_spectrum};
pub use map::{MapFamily, Scheduling, StroboscopicMap, Tangency, TwoParameterFamily};
pub use nalgebra::{Complex, DMatrix};
pub use neighbourhood::Neighbourhood;
pub use orbit::{
    DivergenceReason, MultiplierError, Multipliers, OrbitSearch, PeriodicOrbit, ShootingError,
    ShootingOptions, Stability, check_size, close_orbit, close_orbit_from_points, find_orbits,
};
pub use reset::AfterReset;
pub use same_motion::SameMotion;

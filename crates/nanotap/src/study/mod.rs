//! The studies, one module each: options, run, report. A study either reports in a document
//! ([`Study`]) or computes a dataset ([`DatasetStudy`]).

pub mod registry;

pub use nanotap_case::drive_signal;
pub use nanotap_fit::{calibrate, fit};
pub use nanotap_images::image_states;
pub use nanotap_motions::simulate::{fixed_step, one_shot};
pub use nanotap_motions::{
    approach, attractors, branch, event, frequency_modulation, lyapunov, orbit, proof, setpoint,
    simulate, upset,
};
pub use nanotap_observe::model_limits;
pub use nanotap_reconstruct::reconstruct;
pub use nanotap_scan::{force_curve, scan};
pub use nanotap_study::{
    Computation, DatasetPlan, DatasetStudy, Document, FreeMotion, Study, averaged_orbits,
    cantilever, in_si, limits, request, start_box, target, threads, value,
};
pub use nanotap_surveys::{
    basin, bimodal, contact_laws, convergence, lever, mode_share, modes, noise, setpoint_map,
    sweep, window,
};

use registry::StudyEntry;

/// All studies, in the order in which front ends list them.
pub static STUDIES: &[StudyEntry] = &[
    StudyEntry::of::<modes::ModesStudy>(),
    StudyEntry::of::<simulate::SimulateStudy>(),
    StudyEntry::of::<orbit::OrbitStudy>(),
    StudyEntry::of::<attractors::AttractorsStudy>(),
    StudyEntry::of::<branch::BranchStudy>(),
    StudyEntry::of::<approach::ApproachStudy>(),
    StudyEntry::of::<frequency_modulation::FrequencyModulationStudy>(),
    StudyEntry::of::<fit::FitStudy>().or_dataset::<fit::FitMap>(),
    StudyEntry::of::<reconstruct::ReconstructStudy>(),
    StudyEntry::dataset::<sweep::SweepStudy>(),
    StudyEntry::dataset::<window::WindowStudy>(),
    StudyEntry::dataset::<basin::BasinStudy>(),
    StudyEntry::of::<lyapunov::LyapunovStudy>(),
    StudyEntry::of::<convergence::ConvergenceStudy>(),
    StudyEntry::of::<contact_laws::ContactLawsStudy>(),
    StudyEntry::of::<noise::NoiseStudy>(),
    StudyEntry::of::<bimodal::BimodalStudy>(),
    StudyEntry::of::<scan::ScanStudy>().or_dataset::<scan::ScanLines>(),
    StudyEntry::of::<image_states::ImageStatesStudy>(),
    StudyEntry::of::<force_curve::ForceCurveStudy>(),
    StudyEntry::of::<lever::LeverStudy>(),
];

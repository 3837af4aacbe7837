//! The report of a force curve, in SI.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Way;
use super::fits::{ContactFit, fits};
use super::path::Plan;
use super::run::Run;
use super::statics::{BranchesAndJumps, Rest, StaticCurve};
use crate::moving_lever::Signals;
use nanotap_case::key::Key;
use nanotap_case::physical::force::SampleForce;
use nanotap_case::physical::sample::Elastic;
use nanotap_observe::OutOfRange;
use nanotap_observe::frame::{AsCell as _, Frame, Rows, frame, rows};

/// Waveform of the distance against time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Waveform {
    /// At a constant speed there and back
    Ramp,
    /// As one period of a cosine
    Cosine,
}

rows! {
    in si_unit
    /// A point of the force curve, in SI. Of a driven lever separation, deflection and force are means
    /// over the drive period before, as the slow channels of an instrument show them.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
    pub struct CurvePoint {
        /// Direction of the motion at this point.
        pub way: Way,
        /// Time from the start, s.
        pub time: f64 = Time, "time",
        /// Distance z between tip and undeformed surface with the lever at deflection 0, m.
        pub distance: f64 = Length, "distance",
        /// Separation of tip and undeformed surface, z + deflection, m; minus the indentation in contact.
        pub separation: f64 = Length, "separation",
        /// Deflection of the tip, positive away from the sample, m.
        pub deflection: f64 = Length, "deflection",
        /// Force of the sample on the tip, positive if it repels, N.
        pub force: f64 = Force, "force",
        /// Whether tip and sample touch; of a driven lever, at any time of the drive period before.
        pub contact: bool = Count, "contact",
        /// Amplitude of the deflection at the drive's frequency over the drive period before, m.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub amplitude: Option<f64> = Length, "amplitude",
        /// Phase lag of the deflection behind the drive over the drive period before, degrees.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub phase: Option<f64> = Angle, "phase lag",
    }
}

/// An equilibrium of the lever against the sample, in SI.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct StaticPoint {
    /// Distance z between tip and undeformed surface with the lever at deflection 0, m.
    #[schemars(extend("x-unit" = "m"))]
    pub distance: f64,
    /// Separation of tip and undeformed surface, z + deflection, m; negative: minus the
    /// indentation.
    #[schemars(extend("x-unit" = "m"))]
    pub separation: f64,
    /// Deflection of the tip, positive away from the sample, m.
    #[schemars(extend("x-unit" = "m"))]
    pub deflection: f64,
    /// Force of the sample on the tip, positive if it repels, N.
    #[schemars(extend("x-unit" = "N"))]
    pub force: f64,
}

/// A branch on which the lever can rest.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct StaticBranch {
    /// Whether tip and sample touch.
    pub contact: bool,
    /// Whether the equilibrium is stable.
    pub stable: bool,
    /// Equilibria of the branch, by falling separation.
    pub points: Vec<StaticPoint>,
}

/// A jump of the lever at rest from the end of a branch, a fold or the end of the law's branch.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, JsonSchema)]
pub struct StaticJump {
    /// Direction in which the distance changes at the jump.
    pub way: Way,
    /// Last equilibrium before the jump, at the end of the branch.
    pub before: StaticPoint,
    /// Equilibrium after the jump; None if there is no stable one.
    pub after: Option<StaticPoint>,
}

/// Branches of the lever at rest.
#[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
pub struct Statics {
    /// Branches between the ends of the curve.
    pub branches: Vec<StaticBranch>,
    /// Jumps of the lever moved without inertia, in order.
    pub jumps: Vec<StaticJump>,
    /// Lowest force in contact on the retract up to the first jump.
    pub pull_off: Option<StaticPoint>,
}

rows! {
    in si_unit
    /// Results of a force curve, in SI.
    #[derive(Clone, Debug, PartialEq, Serialize, JsonSchema)]
    pub struct ForceCurveSummary {
        /// Distance at which the tip first touches on the approach, m.
        pub contact_begin: Option<f64> = Length, "distance at which the tip first touches on the approach", "contact begins", Prefixed(5),
        /// Distance at which the tip last touches on the retract, m.
        pub contact_end: Option<f64> = Length, "distance at which the tip last touches on the retract", "contact ends", Prefixed(5),
        /// Largest force of the sample on the tip, N; 0 if it never repels.
        pub peak_force: f64 = Force, "peak force", "peak force", Prefixed(5),
        /// Adhesion force: minus the lowest force of the retract, N.
        pub adhesion_force: f64 = Force, "minus the lowest force of the retract", "adhesion force", Prefixed(5),
        /// Minus the lowest force of the approach, N.
        pub attraction: f64 = Force, "minus the lowest force of the approach", "attraction", Prefixed(5),
        /// Indentation: minus the least separation, m.
        pub indentation: f64 = Length, "minus the least separation", "indentation", Prefixed(5),
        /// Work of adhesion of the curve, −∫F dz over the parts of the retract where the sample
        /// attracts, J; of a driven lever over the drive periods in which it attracts on the mean.
        pub adhesion_energy: f64 = Energy, "area between the retract and zero force where the sample attracts", "work of adhesion", Prefixed(5),
        /// Energy lost in the cycle, −∮F dz, J.
        pub energy_lost: f64 = Energy, "area between approach and retract", "energy lost", Prefixed(5),
        /// Energy that the tip gives to the sample, J: of an undriven lever a part of the lost energy, whose
        /// rest rings down in the lever; of a driven one the drive pays for it, too.
        pub dissipation: f64 = Energy, "energy that the tip gives to the sample", "given to the sample", Prefixed(5),
    }
}

/// A force curve with its static branches.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct ForceCurveReport {
    /// Waveform of the distance against time.
    pub waveform: Waveform,
    /// Distance at the start, m.
    #[schemars(extend("x-unit" = "m"))]
    pub from: f64,
    /// Distance at which the approach turns, m.
    #[schemars(extend("x-unit" = "m"))]
    pub to: f64,
    /// Speed of the ramp, or largest speed of the cosine, m/s.
    #[schemars(extend("x-unit" = "m/s"))]
    pub speed: f64,
    /// Duration of the cycle, s.
    #[schemars(extend("x-unit" = "s"))]
    pub duration: f64,
    /// Whether the lever is driven.
    pub driven: bool,
    /// Number of stretches of the exact flow.
    pub stretches: usize,
    /// Adhesion force: minus the lowest force of the retract, N.
    #[schemars(extend("x-unit" = "N"))]
    pub adhesion: f64,
    /// Distance at which the tip first touches on the approach, m.
    #[schemars(extend("x-unit" = "m"))]
    pub snap_in: Option<f64>,
    /// Distance at which the tip last touches on the retract, m.
    #[schemars(extend("x-unit" = "m"))]
    pub pull_off: Option<f64>,
    /// Largest force of the sample on the tip, N; 0 if it never repels.
    #[schemars(extend("x-unit" = "N"))]
    pub peak_force: f64,
    /// Contact distances, adhesion, energies and indentation.
    pub summary: ForceCurveSummary,
    /// Reduced modulus E* of tip and sample of the case, Pa, if its law has one.
    #[schemars(extend("x-unit" = "Pa"))]
    pub reduced_modulus: Option<f64>,
    /// Young's modulus of the sample of the case, Pa, if its law has one.
    #[schemars(extend("x-unit" = "Pa"))]
    pub modulus: Option<f64>,
    /// Fits of contact models to the unloading part.
    pub fits: Vec<ContactFit>,
    /// Branches of the lever at rest.
    pub statics: Statics,
    /// Points of approach and retract, in order of time.
    #[serde(rename = "table")]
    pub points: Vec<CurvePoint>,
    /// Sentences on what makes the results doubtful.
    pub warnings: Vec<String>,
}

impl ForceCurveReport {
    /// The points of approach and retract.
    pub fn point_table(&self) -> Frame<'_> {
        let undriven: &[&str] = if self.driven {
            &[]
        } else {
            &["amplitude", "phase"]
        };
        frame! { Rows::new("table", &self.points, None);
            "way", "way", Plain => |p| p.way.name();
            .fields(Some);
            .without(undriven);
        }
    }

    /// The results.
    pub fn result_table(&self) -> Frame<'_> {
        let at_rest = |report: &'_ Self| Some(-report.statics.pull_off?.force);
        frame! { Rows::new("summary", [self], None);
            .fields(|report| Some(&report.summary));
            "", "  at rest", (Force, Prefixed(5)) => at_rest;
            .label("the same without inertia, until the lever jumps off");
            .shown(RESULTS);
        }
    }

    /// The fits of contact models to the unloading part, and the moduli of the case.
    pub fn fit_table(&self) -> Frame<'_> {
        let fits = self.fits.iter();
        let fits = fits.map(|f| {
            (
                f.model.name(),
                f.reduced_modulus,
                f.modulus,
                Some(f.residual),
            )
        });
        let own = self.reduced_modulus.filter(|_| !self.fits.is_empty());
        let own = own.map(|reduced| ("of the case", reduced, self.modulus, None));
        let modulus = |e: Option<f64>| e.map_or_else(|| "none".cell(), |e| e.cell());
        frame! { Rows::new("fits", fits.chain(own), None);
            "model", "fit of the unloading", Plain => |f| f.0;
            "reduced_modulus", "E*", (Si(Kind::Pressure), Prefixed(5)) => |f| f.1;
            "modulus", "E of the sample", (Si(Kind::Pressure), Prefixed(5)) => move |f| modulus(f.2);
            "residual", "rms", (Length, Scaled(-12, 3)) => |f| f.3;
            .aligned(Left, Point);
        }
    }
}

/// Results that are shown.
const RESULTS: &str = "contact_begin,contact_end,peak_force,adhesion_force,  at rest,indentation,\
                       adhesion_energy,energy_lost,dissipation";

/// Fraction of the resonance frequency above which the inertia of a moving base matters.
const FAST: f64 = 0.1;

/// Compliance at rest over that of the modes above which the difference is reported.
const STIFFER: f64 = 1.01;

/// Creates the report of a run.
pub(super) fn report(plan: &Plan<'_>, statics: &BranchesAndJumps, run: &Run) -> ForceCurveReport {
    let scales = &plan.view.scales;
    let rest = |rest: &Rest| StaticPoint {
        distance: rest.distance * scales.length,
        separation: rest.gap * scales.length,
        deflection: (rest.gap - rest.distance) * scales.length,
        force: rest.force * scales.force,
    };
    let points: Vec<CurvePoint> = run
        .rows
        .iter()
        .map(|row| CurvePoint {
            way: row.way,
            time: row.time * scales.time,
            distance: row.distance * scales.length,
            separation: row.signals.gap * scales.length,
            deflection: row.signals.deflection * scales.length,
            force: row.signals.force * scales.force,
            contact: row.signals.contact,
            amplitude: row
                .oscillation
                .map(|[amplitude, _]| amplitude * scales.length),
            phase: row.oscillation.map(|[_, phase]| phase),
        })
        .collect();
    let (peak, adhesion) = (
        run.peak_force * scales.force,
        0.0 - run.lowest[1] * scales.force,
    );
    let force = plan.view.sample.force.as_ref();
    let hertz = plan.view.sample.hertz.map(|hertz| hertz.reduced_modulus);
    let reduced_modulus = force.and_then(SampleForce::reduced_modulus).or(hertz);
    let sample = force.and_then(|force| {
        let [modulus, poisson] = [Key::SampleModulus, Key::SamplePoisson].map(|key| force.get(key));
        Some(Elastic {
            modulus: modulus?,
            poisson: poisson?,
        })
    });
    let radius = plan.view.value(Key::TipRadius);
    let sample_modulus = |reduced: f64| {
        let sample = sample?;
        let tip = 1.0 / reduced_modulus? - 1.0 / sample.plane_strain_modulus();
        let own = 1.0 / (1.0 / reduced - tip);
        (own > 0.0).then_some(own * (1.0 - sample.poisson * sample.poisson))
    };
    let span = peak + adhesion;
    let [low, high] = plan.fit.map(|part| part * span - adhesion);
    let in_si = |signals: &Signals| (signals.gap * scales.length, signals.force * scales.force);
    // Up to the lowest force: beyond it the neck is unstable, and the lever jumps and rings.
    let forces = run.unloading.iter().map(|signals| signals.force);
    let numbered = forces.enumerate();
    let lowest = numbered.min_by(|a, b| a.1.total_cmp(&b.1));
    let unloading = run.unloading.iter();
    let unloading = unloading.take(lowest.map_or(0, |(k, _)| k + 1));
    let unloading = unloading.filter(|signals| signals.contact);
    let unloading: Vec<(f64, f64)> = unloading
        .map(in_si)
        .filter(|(_, force)| (low..=high).contains(force))
        .collect();
    let fits = match radius {
        Some(radius) if !plan.driven => fits(&unloading, radius, adhesion, sample_modulus),
        _ => Vec::new(),
    };
    let speed = plan.path.speed.map_or(
        0.5 * (plan.path.from - plan.path.to) * plan.path.omega,
        |speed| speed,
    );
    let violated = OutOfRange::within(&plan.model, run.least_gap);
    let mut warnings: Vec<String> = violated.iter().map(ToString::to_string).collect();
    let frequency = plan.path.omega * scales.frequency;
    if plan.path.speed.is_none() && frequency > FAST * plan.view.lever.f0 {
        warnings.push(format!(
            "the cosine's frequency is {:.2} of f0: the inertia of a moving base is left out, the \
             sample moves instead",
            frequency / plan.view.lever.f0
        ));
    }
    let compliances = [&plan.statics, &plan.moving_statics].map(StaticCurve::compliance);
    if let [Some(whole), Some(modes)] = compliances
        && whole > STIFFER * modes
    {
        warnings.push(format!(
            "the moving lever is {:.1} % stiffer than the lever at rest: it lacks the modes that are \
             left out; raise `modes`",
            100.0 * (whole / modes - 1.0)
        ));
    }
    if run.ends_in_contact {
        warnings.push(
            "the tip still touches at the end of the retract: the adhesion force and the energies \
             are those of an open curve; give a larger `from`"
                .to_owned(),
        );
    }
    if fits.is_empty() && !plan.driven && radius.is_some() && peak > 0.0 {
        warnings.push(
            "no fits: the forces of the unloading part do not span the range of `fit_from` to \
             `fit_to`"
                .to_owned(),
        );
    }
    let distance = |z: Option<f64>| z.map(|z| z * scales.length);
    let (snap_in, pull_off) = (distance(run.contact_begin), distance(run.contact_end));
    ForceCurveReport {
        waveform: if plan.path.speed.is_some() {
            Waveform::Ramp
        } else {
            Waveform::Cosine
        },
        from: plan.path.from * scales.length,
        to: plan.path.to * scales.length,
        speed: speed * scales.velocity,
        duration: plan.duration() * scales.time,
        driven: plan.driven,
        stretches: run.stretches,
        adhesion,
        snap_in,
        pull_off,
        peak_force: peak,
        summary: ForceCurveSummary {
            contact_begin: snap_in,
            contact_end: pull_off,
            peak_force: peak,
            adhesion_force: adhesion,
            // Not −0 where nothing attracts.
            attraction: 0.0 - run.lowest[0] * scales.force,
            indentation: -run.least_gap * scales.length,
            adhesion_energy: run.adhesion_energy * scales.energy,
            energy_lost: run.energy_lost * scales.energy,
            dissipation: run.dissipation * scales.energy,
        },
        reduced_modulus,
        modulus: sample.map(|sample| sample.modulus),
        fits,
        statics: Statics {
            branches: statics
                .pieces
                .iter()
                .map(|piece| StaticBranch {
                    contact: piece.contact,
                    stable: piece.stable,
                    points: piece.rests.iter().map(rest).collect(),
                })
                .collect(),
            jumps: statics
                .jumps
                .iter()
                .map(|jump| StaticJump {
                    way: jump.way,
                    before: rest(&jump.before),
                    after: jump.after.as_ref().map(rest),
                })
                .collect(),
            pull_off: statics.pull_off.as_ref().map(rest),
        },
        points,
        warnings,
    }
}

//! Fig. 5: what attracts at each drive frequency, and the period-1 branch through all of
//! it, stable or not.

use nanotap_dynamics::{
    Bifurcation, BifurcationKind, Branch, ContinuationOptions, Direction, SettleOptions,
    Verdict as Settled, continue_orbit, settle,
};
use nanotap_figures::{Axis, Band, Colour, Dash, Figure, Legend, Line, Markers, Panel, Shape};
use nanotap_flow::Trajectory;

use super::check::{Check, Verdict};
use super::frequency_sweep::{Column, Kind, draw, spaced, stretches, sweep, where_seen};
use super::laboratory::{Laboratory, SEED};
use super::section::{Picture, Section, Table};
use super::{PaperError, rerun};
use crate::case::Case;
use crate::model::Model;
use crate::parameter::Parameter;
use crate::strobe::Strobe;
use crate::subject::{Family, Key, Subject};

/// Range of Ω drawn. The paper's axis cannot be read from its text, which names 2.0 to
/// 2.15, 2.6, and what happens at higher frequencies.
const RANGE: (f64, f64) = (1.5, 7.5);
/// Range drawn larger: around Ω = 2.6.
const CLOSE: (f64, f64) = (2.4, 3.3);
/// Where the paper has nonperiodic motions evolving from period 2.
const WINDOW: (f64, f64) = (2.0, 2.15);
/// Where the period-1 branch is entered: it is stable there.
const ENTRY: f64 = 3.5;

/// The key of the drive frequency.
const OMEGA: Key = Key::Cantilever(Parameter::Omega);

/// Fig. 5.
pub(super) fn section(
    laboratory: &Laboratory<'_>,
    section: Section,
) -> Result<Section, PaperError> {
    let (count, starts) = (laboratory.either(400, 40), laboratory.either(8, 2));
    let case = Case::paper();
    let subject = Subject::Cantilever(case.clone());
    let wide = sweep(
        laboratory,
        &subject,
        OMEGA,
        &spaced(RANGE.0, RANGE.1, count),
        starts,
    )?;
    let close_count = laboratory.either(181, 20);
    let close = sweep(
        laboratory,
        &subject,
        OMEGA,
        &spaced(CLOSE.0, CLOSE.1, close_count),
        starts,
    )?;
    let window = sweep(
        laboratory,
        &subject,
        OMEGA,
        &spaced(WINDOW.0, WINDOW.1, laboratory.either(31, 4)),
        starts,
    )?;
    let branch = PeriodOne::follow(laboratory, &subject)?;
    let mut table = Table::new(
        format!(
            "What attracts, N = 3, {starts} seeded starts a value of Ω; shorter stretches than five values left out"
        ),
        ["Ω from", "to", "motions"],
    );
    for (from, to, kinds) in stretches(&wide) {
        if to - from >= 4.0 * (RANGE.1 - RANGE.0) / count as f64 {
            let words: Vec<String> = kinds.iter().map(|k| k.words()).collect();
            table.row([format!("{from:.3}"), format!("{to:.3}"), words.join(", ")]);
        }
    }
    let again = rerun::on_case(
        "sweep",
        &case,
        &format!(
            "--over omega={}:{}:{count} --starts {starts} --seed {SEED}",
            RANGE.0, RANGE.1
        ),
    );
    let branch_again = rerun::on_case(
        "branch",
        &case.with(Parameter::Omega, ENTRY),
        &format!(
            "--parameter omega --from {ENTRY} --to {} --period 1",
            RANGE.0
        ),
    );
    let checks = [
        subharmonics(&wide, &branch, &again),
        nonperiodic_window(&window, &close, &again),
        further(&wide, &branch, &branch_again),
        period_three(&wide, &again),
        coexistence(&wide, &again),
    ];
    let mut section = section
        .text(
            "At each drive frequency several seeded starts are followed until their motion is named; each motion gives \
             one point a drive period, the greatest tip deflection in it. The line is the period-1 branch, followed by \
             arclength continuation through its bifurcations, whether it attracts or not.",
        )
        .picture(picture(&wide, &close, &branch, starts))
        .table(branch.table())
        .table(table);
    for check in checks {
        section = section.check(check);
    }
    Ok(section)
}

/// The period-1 branch over the whole range.
struct PeriodOne {
    /// (Ω, greatest W, stable), by Ω.
    points: Vec<(f64, f64, bool)>,
    bifurcations: Vec<Bifurcation>,
}

impl PeriodOne {
    fn follow(laboratory: &Laboratory<'_>, subject: &Subject) -> Result<Self, PaperError> {
        let failed = |why: String| PaperError::Failed {
            what: format!("the period-1 branch from Ω = {ENTRY}"),
            why,
        };
        let model = subject.with(OMEGA, ENTRY).model()?;
        let settled = settle(
            &mut Strobe::new(&model),
            &vec![0.0; model.dimension()],
            &SettleOptions::default(),
        );
        let Settled::Periodic(orbit) = settled.verdict else {
            return Err(failed("no periodic motion was found there".into()));
        };
        let family = Family {
            subject: subject.clone(),
            key: OMEGA,
        };
        let options = ContinuationOptions::over(RANGE.0, RANGE.1);
        let follow = |direction| -> Result<Branch, PaperError> {
            laboratory
                .controlled(|control| {
                    continue_orbit(&family, ENTRY, &orbit, direction, &options, control)
                })
                .map_err(|error| failed(error.to_string()))
        };
        let (down, up) = (
            follow(Direction::Decreasing)?,
            follow(Direction::Increasing)?,
        );
        let mut points = Vec::new();
        for point in down.points.iter().rev().chain(up.points.iter().skip(1)) {
            let model = subject.with(OMEGA, point.parameter).model()?;
            points.push((
                point.parameter,
                greatest(&model, &point.orbit.states[0])?,
                point.orbit.is_stable(),
            ));
        }
        let mut bifurcations: Vec<Bifurcation> = down
            .bifurcations
            .into_iter()
            .chain(up.bifurcations)
            .collect();
        bifurcations.sort_by(|a, b| a.parameter.total_cmp(&b.parameter));
        Ok(Self {
            points,
            bifurcations,
        })
    }

    /// Where its stability changes, of one kind.
    fn of_kind(&self, kind: impl Fn(&BifurcationKind) -> bool) -> Vec<f64> {
        self.bifurcations
            .iter()
            .filter(|b| kind(&b.kind))
            .map(|b| b.parameter)
            .collect()
    }

    fn flips(&self) -> Vec<f64> {
        self.of_kind(|k| matches!(k, BifurcationKind::Flip))
    }

    fn tori(&self) -> Vec<f64> {
        self.of_kind(|k| matches!(k, BifurcationKind::NeimarkSacker { .. }))
    }

    fn table(&self) -> Table {
        let mut table = Table::new(
            "Bifurcations of the period-1 branch",
            ["Ω", "what happens", "known to"],
        );
        for b in &self.bifurcations {
            let what = match b.kind {
                BifurcationKind::Fold => "fold",
                BifurcationKind::Crossing => "another branch crosses",
                BifurcationKind::Flip => "flip (period doubling)",
                BifurcationKind::NeimarkSacker { .. } => "Neimark–Sacker: a torus is born",
                BifurcationKind::Grazing { .. } => "grazing: a contact is born or dies",
            };
            table.row([
                format!("{:.10}", b.parameter),
                what.to_owned(),
                format!("{:.0e}", b.uncertainty),
            ]);
        }
        table
    }
}

/// Greatest tip deflection over the period from `state`.
fn greatest(model: &Model, state: &[f64]) -> Result<f64, PaperError> {
    let trajectory =
        Trajectory::record(&model.system, state, 1).map_err(|error| PaperError::Failed {
            what: "a point of the branch".into(),
            why: error.to_string(),
        })?;
    Ok(trajectory
        .signal(&model.tip)
        .range()
        .map_or(f64::NAN, |(_, high)| high.value))
}

fn numbers(values: &[f64]) -> String {
    if values.is_empty() {
        return "nowhere".to_owned();
    }
    values
        .iter()
        .map(|v| format!("{v:.10}"))
        .collect::<Vec<_>>()
        .join(", ")
}

/// "Period-1 and period-2 bifurcations are shown."
fn subharmonics(wide: &[Column], branch: &PeriodOne, again: &str) -> Check {
    let (one, two) = (Kind::Periodic(1), Kind::Periodic(2));
    let holds = wide.iter().any(|c| c.has(one))
        && wide.iter().any(|c| c.has(two))
        && !branch.flips().is_empty();
    Check::new(
        "fig5-periods-1-2",
        "Fig. 5: period-1 and period-2 motions and their bifurcations",
        format!(
            "period 1 attracts at Ω = {}; period 2 at Ω = {}",
            where_seen(wide, |c| c.has(one)),
            where_seen(wide, |c| c.has(two))
        ),
        Verdict::of(holds),
    )
    .evidence(format!(
        "the period-1 branch doubles its period at Ω = {}",
        numbers(&branch.flips())
    ))
    .rerun(again)
}

/// "In 2.0 ≤ Ω ≤ 2.15 nonperiodic motions evolving from period-2 are observed."
fn nonperiodic_window(window: &[Column], close: &[Column], again: &str) -> Check {
    let nonperiodic = |c: &Column| c.motions.iter().any(|m| m.kind.is_nonperiodic());
    let inside = window.iter().filter(|c| nonperiodic(c)).count();
    let kinds: Vec<String> = stretches(window)
        .iter()
        .map(|(f, t, k)| {
            format!(
                "{f:.3}–{t:.3}: {}",
                k.iter().map(|k| k.words()).collect::<Vec<_>>().join(", ")
            )
        })
        .collect();
    Check::new(
        "fig5-window",
        "section 4: for 2.0 ≤ Ω ≤ 2.15 nonperiodic motions evolve from period 2",
        format!("at {inside} of {} values of Ω there is one ({})", window.len(), kinds.join("; ")),
        Verdict::of(inside > 0),
    )
    .evidence(format!(
        "what the statement describes exists at other frequencies: near Ω = 2.6 nonperiodic motion at {}, period 2 at {}",
        where_seen(close, nonperiodic),
        where_seen(close, |c| c.has(Kind::Periodic(2)))
    ))
    .rerun(again)
}

/// "If the driving frequency further increases, nonperiodic motions will evolve from period-1."
fn further(wide: &[Column], branch: &PeriodOne, again: &str) -> Check {
    let tori: Vec<f64> = branch
        .tori()
        .into_iter()
        .filter(|omega| *omega > WINDOW.1)
        .collect();
    let seen = wide.iter().any(|c| c.at > WINDOW.1 && c.has(Kind::Torus));
    Check::new(
        "fig5-further",
        "section 4: if the driving frequency further increases, nonperiodic motions evolve from period-1 motions",
        if tori.is_empty() {
            "the period-1 branch has no Neimark–Sacker bifurcation above Ω = 2.15 in the range drawn".to_owned()
        } else {
            format!("the period-1 branch gives birth to tori at Ω = {}", numbers(&tori))
        },
        Verdict::of(!tori.is_empty() && seen),
    )
    .evidence(format!(
        "quasi-periodic motion at Ω = {}; chaos at Ω = {}",
        where_seen(wide, |c| c.has(Kind::Torus)),
        where_seen(wide, |c| c.has(Kind::Chaos))
    ))
    .rerun(again)
}

/// "Other subharmonic motion like period-3 exists, which is not shown."
fn period_three(wide: &[Column], again: &str) -> Check {
    let three = Kind::Periodic(3);
    Check::new(
        "fig5-period-3",
        "section 4: other subharmonics like period 3 exist, which Fig. 5 does not show",
        format!(
            "period 3 attracts at Ω = {}",
            where_seen(wide, |c| c.has(three))
        ),
        Verdict::of(wide.iter().any(|c| c.has(three))),
    )
    .evidence("at Ω = 2.6 itself, where Fig. 7 has it, none does (see Fig. 7)")
    .rerun(again)
}

/// "Several period-n motions coexist at one driving frequency."
fn coexistence(wide: &[Column], again: &str) -> Check {
    let several = |c: &Column| c.motions.len() > 1;
    Check::new(
        "fig5-coexistence",
        "section 4: several period-n motions coexist at one driving frequency",
        format!(
            "more than one motion attracts at Ω = {}",
            where_seen(wide, several)
        ),
        Verdict::of(wide.iter().any(several)),
    )
    .evidence("from as many starts as were tried at each value; others may exist beside")
    .rerun(again)
}

fn picture(wide: &[Column], close: &[Column], branch: &PeriodOne, starts: usize) -> Picture {
    let panel = |range: (f64, f64)| {
        Panel::new(
            Axis::linear("drive frequency $Ω$").range(range.0, range.1),
            Axis::linear("$W_{max}$ in each drive period"),
        )
    };
    let shown = |panel: Panel, columns: &[Column], diameter: f64, range: (f64, f64)| {
        let panel = draw(panel, columns, diameter);
        let unstable = gaps(&branch.points, range, false);
        let panel = panel.with(
            Line::new(unstable)
                .colour(Colour::BLUE)
                .dash(Dash::Dashed)
                .width(0.5),
        );
        let marks = |omegas: Vec<f64>| -> Vec<(f64, f64)> {
            omegas
                .into_iter()
                .filter(|o| (range.0..=range.1).contains(o))
                .filter_map(|o| Some((o, branch.height(o)?)))
                .collect()
        };
        panel
            .with(
                Markers::new(marks(branch.flips()))
                    .shape(Shape::Diamond)
                    .colour(Colour::BLACK)
                    .size(1.6)
                    .label("flip"),
            )
            .with(
                Markers::new(marks(branch.tori()))
                    .shape(Shape::Square)
                    .open()
                    .colour(Colour::BLACK)
                    .size(1.4)
                    .label("Neimark–Sacker"),
            )
    };
    let whole = panel(RANGE).legend(Legend::Above).with(Band::x([WINDOW]));
    let near = panel(CLOSE)
        .legend(Legend::Hidden)
        .with(nanotap_figures::Rule::vertical(2.6));
    Picture::new(
        "fig05",
        "What attracts at each drive frequency, α₁ = 0.1 (Fig. 5)",
        format!(
            "Eq. (26), N = 3, {starts} seeded starts at each Ω; the ranges are chosen here. One point a drive period. \
             Dashed: the period-1 branch where it repels. Band in (a): 2.0 ≤ Ω ≤ 2.15, where the paper has nonperiodic \
             motions. (b) Around Ω = 2.6 (line), the frequency of Figs. 6 and 7."
        ),
        Figure::new(2, 1)
            .with(shown(whole, wide, 0.5, RANGE))
            .with(shown(near, close, 0.4, CLOSE)),
        140.0,
    )
}

impl PeriodOne {
    /// Greatest W on the branch at Ω.
    fn height(&self, omega: f64) -> Option<f64> {
        let near = |p: &&(f64, f64, bool)| (p.0 - omega).abs();
        self.points
            .iter()
            .min_by(|a, b| near(a).total_cmp(&near(b)))
            .map(|p| p.1)
    }
}

/// The part of a branch with the given stability, gaps between its stretches.
fn gaps(points: &[(f64, f64, bool)], range: (f64, f64), stable: bool) -> Vec<(f64, f64)> {
    points
        .iter()
        .map(|p| {
            let inside = (range.0..=range.1).contains(&p.0);
            (
                p.0,
                if p.2 == stable && inside {
                    p.1
                } else {
                    f64::NAN
                },
            )
        })
        .collect()
}

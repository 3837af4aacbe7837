//! Fig. 5: the attractors at each drive frequency, and the period-1 branch through all of it,
//! stable or not.

use nanotap_figures::{
    Axis, Band, Colour, Dash, Figure, Legend, Line, Markers, Panel, Rule, Shape,
};

use super::followed_branch::{FollowedBranch, OMEGA, in_words};
use super::frequency_sweep::{Column, Kind, draw, spaced, stretches, sweep, where_seen};
use super::runs::{Runs, SEED};
use super::section::{Picture, Section, Table};
use super::{PaperError, rerun};
use nanotap::case::Case;
use nanotap::model::cantilever::Cantilever;
use nanotap::model::parameter::Parameter;

/// Range of Ω that is drawn. The paper's axis cannot be inferred from its text, which names 2.0 to
/// 2.15, 2.6, and higher frequencies.
const RANGE: (f64, f64) = (1.5, 7.5);
/// Range of the enlarged panel: around Ω = 2.6.
const CLOSE: (f64, f64) = (2.4, 3.3);
/// Range in which the paper has nonperiodic motions evolving from period 2.
const WINDOW: (f64, f64) = (2.0, 2.15);
/// Deflections with ticks on the axis of the whole diagram.
const MARKS: [f64; 5] = [0.1, 0.2, 0.5, 1.0, 2.0];
/// Start of the period-1 branch, which is stable there.
const ENTRY: f64 = 3.5;
/// Start of the period-2 branch around Ω = 2.6.
const ENTRY_TWO: f64 = 2.75;

/// Computes the section on Fig. 5: the bifurcation diagram over Ω.
pub(super) fn section(runs: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    let (count, starts) = (runs.either(400, 40), runs.either(8, 2));
    let case = Cantilever::paper();
    let subject = Case::from(case.clone());
    let wide = sweep(
        runs,
        &subject,
        OMEGA,
        &spaced(RANGE.0, RANGE.1, count),
        starts,
    )?;
    let close_count = runs.either(181, 20);
    let close = sweep(
        runs,
        &subject,
        OMEGA,
        &spaced(CLOSE.0, CLOSE.1, close_count),
        starts,
    )?;
    let window = sweep(
        runs,
        &subject,
        OMEGA,
        &spaced(WINDOW.0, WINDOW.1, runs.either(31, 4)),
        starts,
    )?;
    let one = FollowedBranch::from_rest(runs, &subject, (ENTRY, 1), RANGE)?;
    let two = FollowedBranch::from_rest(runs, &subject, (ENTRY_TWO, 2), CLOSE)?;
    let mut table = Table::new(
        format!(
            "Attractors, N = 3, {starts} initial states per value of Ω; intervals of fewer than five values are omitted"
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
    let window_again = rerun::on_case(
        "sweep",
        &case,
        &format!(
            "--over omega={}:{}:{} --starts {starts} --seed {SEED}",
            WINDOW.0,
            WINDOW.1,
            window.len()
        ),
    );
    let branch_again = rerun::on_case(
        "branch",
        &case.with(Parameter::Omega, ENTRY),
        &format!(
            "--parameter omega --from {ENTRY} --to {} --period 1",
            RANGE.1
        ),
    );
    let beyond = sweep(runs, &subject, OMEGA, &inside_the_tori(&one), starts.max(4))?;
    let section = subharmonics(section, &wide, [&one, &two], &again);
    let section = nonperiodic_window(section, &window, &close, &window_again);
    let section = further(section, &wide, &beyond, &one, &branch_again);
    let three = |c: &Column| c.has(Kind::Periodic(3));
    let several = |c: &Column| c.motions.len() > 1;
    Ok(section
        .check(
            "fig5-period-3",
            count_of(&wide, three),
            format!("period 3 is stable at Ω = {}", where_seen(&wide, three)),
            "none is stable at Ω = 2.6, the frequency of Fig. 7 (see there)",
            &again,
        )
        .check(
            "fig5-coexistence",
            count_of(&wide, several),
            format!("more than one motion is stable at Ω = {}", where_seen(&wide, several)),
            "found from a limited number of initial states per value; further motions may exist",
            &again,
        )
        .text(
            "At each drive frequency several initial states are followed until their motions are classified. Each motion gives \
             one point per drive period: the largest tip deflection in that period. The line is the period-1 branch, stable \
             and unstable, followed by arclength continuation through its bifurcations.",
        )
        .picture(picture(&wide, &close, [&one, &two], starts))
        .table(one.table("Bifurcations of the period-1 branch"))
        .table(two.table("Bifurcations of the period-2 branch around Ω = 2.6"))
        .table(table))
}

/// Number of frequencies with this property.
fn count_of(columns: &[Column], property: impl Fn(&Column) -> bool) -> usize {
    columns.iter().filter(|c| property(c)).count()
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
fn subharmonics(
    section: Section,
    wide: &[Column],
    [branch, doubled]: [&FollowedBranch; 2],
    again: &str,
) -> Section {
    let (one, two) = (Kind::Periodic(1), Kind::Periodic(2));
    let holds = wide.iter().any(|c| c.has(one))
        && wide.iter().any(|c| c.has(two))
        && !branch.flips().is_empty();
    section.check(
        "fig5-periods-1-2",
        holds,
        format!(
            "period 1 is stable at Ω = {}; period 2 at Ω = {}",
            where_seen(wide, |c| c.has(one)),
            where_seen(wide, |c| c.has(two))
        ),
        format!(
            "the period-1 branch doubles its period at Ω = {}; the period-2 branch around Ω = 2.6 is stable at {}",
            numbers(&branch.flips()),
            in_words(&doubled.attracting())
        ),
        again,
    )
}

/// "In 2.0 ≤ Ω ≤ 2.15 nonperiodic motions evolving from period-2 are observed."
fn nonperiodic_window(
    section: Section,
    window: &[Column],
    close: &[Column],
    again: &str,
) -> Section {
    let nonperiodic = |c: &Column| c.motions.iter().any(|m| m.kind.is_nonperiodic());
    let inside = count_of(window, nonperiodic);
    let kinds: Vec<String> = stretches(window)
        .iter()
        .map(|(f, t, k)| {
            format!(
                "{f:.3}–{t:.3}: {}",
                k.iter().map(|k| k.words()).collect::<Vec<_>>().join(", ")
            )
        })
        .collect();
    section.check(
        "fig5-window",
        inside,
        format!("nonperiodic at {inside} of {} values of Ω ({})", window.len(), kinds.join("; ")),
        format!(
            "such motions exist at other frequencies: near Ω = 2.6 nonperiodic motion at {}, period 2 at {}",
            where_seen(close, nonperiodic),
            where_seen(close, |c| c.has(Kind::Periodic(2)))
        ),
        again,
    )
}

/// Frequencies slightly beyond the Neimark–Sacker points above the paper's window, on the side
/// where the period-1 orbit is unstable.
fn inside_the_tori(branch: &FollowedBranch) -> Vec<f64> {
    /// Distance from a Neimark–Sacker point, as a part of the distance to the next one.
    const BEYOND: f64 = 0.15;
    let tori: Vec<f64> = branch
        .tori()
        .into_iter()
        .filter(|omega| *omega > WINDOW.1)
        .collect();
    tori.chunks_exact(2)
        .flat_map(|pair| {
            let step = BEYOND * (pair[1] - pair[0]);
            [pair[0] + step, pair[1] - step]
        })
        .collect()
}

/// "If the driving frequency further increases, nonperiodic motions will evolve from period-1."
fn further(
    section: Section,
    wide: &[Column],
    beyond: &[Column],
    branch: &FollowedBranch,
    again: &str,
) -> Section {
    let tori: Vec<f64> = branch
        .tori()
        .into_iter()
        .filter(|omega| *omega > WINDOW.1)
        .collect();
    // A coarse sweep can miss the short intervals in which the torus is stable.
    let mut columns: Vec<Column> = wide.iter().chain(beyond).cloned().collect();
    columns.sort_by(|a, b| a.at.total_cmp(&b.at));
    let seen = columns
        .iter()
        .any(|c| c.at > WINDOW.1 && c.has(Kind::Torus));
    section.check(
        "fig5-further",
        !tori.is_empty() && seen,
        if tori.is_empty() {
            "the period-1 branch has no Neimark–Sacker bifurcation above Ω = 2.15 in the range drawn".to_owned()
        } else {
            format!("tori bifurcate from the period-1 branch at Ω = {}", numbers(&tori))
        },
        format!(
            "quasi-periodic motion at Ω = {}; chaos at Ω = {}",
            where_seen(&columns, |c| c.has(Kind::Torus)),
            where_seen(wide, |c| c.has(Kind::Chaos))
        ),
        again,
    )
}

fn picture(
    wide: &[Column],
    close: &[Column],
    branches: [&FollowedBranch; 2],
    starts: usize,
) -> Picture {
    let panel = |y: Axis, range: (f64, f64)| {
        Panel::new(
            Axis::linear("drive frequency $Ω$").range(range.0, range.1),
            y,
        )
    };
    let label = "$W_{max}$ in each drive period";
    let whole = panel(
        Axis::log(label).marks(MARKS.map(|w| (w, w.to_string()))),
        RANGE,
    )
    .legend(Legend::Above)
    .with(Band::x([WINDOW]));
    let near = panel(Axis::linear(label), CLOSE)
        .legend(Legend::Hidden)
        .with(Rule::vertical(2.6));
    let whole = with_branch(draw(whole, wide, 0.5), branches[0], Colour::BLUE, RANGE);
    let near = with_branch(draw(near, close, 0.4), branches[0], Colour::BLUE, CLOSE);
    let near = with_branch(near, branches[1], Colour::VERMILLION, CLOSE);
    Picture::new(
        "fig05",
        "Attractors at each drive frequency, α₁ = 0.1 (Fig. 5)",
        format!(
            "Eq. (26), N = 3, {starts} initial states at each Ω; the paper does not state its ranges. One point per drive period. \
             Dashed: the period-1 branch and, in (b), the period-2 branch where they are unstable. Band in (a): \
             2.0 ≤ Ω ≤ 2.15, where the paper has nonperiodic motions. (b) Colours as in (a); around Ω = 2.6 (vertical line), the frequency of \
             Figs. 6 and 7."
        ),
        Figure::new(2, 1).with(whole).with(near),
        140.0,
    )
}

/// Adds the unstable parts of a branch, and its bifurcations.
fn with_branch(
    mut panel: Panel,
    branch: &FollowedBranch,
    colour: Colour,
    range: (f64, f64),
) -> Panel {
    for line in branch.repelling(range) {
        panel = panel.with(Line::new(line).colour(colour).dash(Dash::Dashed).width(0.5));
    }
    let marks = |omegas: Vec<f64>| -> Vec<(f64, f64)> {
        let inside = omegas
            .into_iter()
            .filter(|o| (range.0..=range.1).contains(o));
        inside
            .filter_map(|o| Some((o, branch.height(o)?)))
            .collect()
    };
    let flips = Markers::new(marks(branch.flips()))
        .shape(Shape::Diamond)
        .colour(Colour::BLACK)
        .size(1.6);
    let tori = Markers::new(marks(branch.tori()))
        .shape(Shape::Square)
        .open()
        .colour(Colour::BLACK)
        .size(1.4);
    panel
        .with(flips.label("flip"))
        .with(tori.label("Neimark–Sacker"))
}

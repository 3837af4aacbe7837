//! A branch of periodic orbits in the drive frequency, stable or not, with the data that the
//! sections need: its extrema, its bifurcations, and where it is stable.

use nanotap_dynamics::{
    Bifurcation, BifurcationKind, Branch, ClassifyOptions, ContinuationOptions, Direction,
    MotionKind as Settled, PeriodicOrbit, classify, continue_orbit,
};

use super::PaperError;
use super::frequency_sweep::maxima;
use super::runs::Runs;
use super::section::Table;
use nanotap::case::{Case, Key};
use nanotap::model::model_map::ModelMap;

/// The key of the drive frequency.
pub(super) const OMEGA: Key = Key::Omega;

/// A branch in Ω, followed in both directions from one orbit.
pub(super) struct FollowedBranch {
    /// Points in order along the branch.
    points: Vec<Point>,
    /// Bifurcations in order along the branch.
    bifurcations: Vec<Bifurcation>,
}

struct Point {
    omega: f64,
    /// Largest tip deflection in each of its drive periods.
    maxima: Vec<f64>,
    stable: bool,
    /// The bifurcation, if any, between the previous point and this one that changes stability.
    since: Option<f64>,
}

impl FollowedBranch {
    /// Follows the orbit of `period` to which a run from rest leads at Ω = `entry`.
    pub(super) fn from_rest(
        runs: &Runs<'_>,
        case: &Case,
        (entry, period): (f64, usize),
        range: (f64, f64),
    ) -> Result<Self, PaperError> {
        let model = case.with(OMEGA, entry).model()?;
        let classified = classify(
            &mut ModelMap::new(&model),
            &vec![0.0; model.dimension()],
            &ClassifyOptions::default(),
        );
        match classified.kind {
            Settled::Periodic(orbit) | Settled::TransientChaos { orbit, .. }
                if orbit.period == period =>
            {
                Self::from_orbit(runs, case, entry, &orbit, range)
            }
            _ => Err(PaperError::Failed {
                what: format!("the period-{period} branch"),
                why: format!("a run from rest at Ω = {entry} does not converge to it"),
            }),
        }
    }

    /// Follows `orbit`, which exists at Ω = `entry`.
    pub(super) fn from_orbit(
        runs: &Runs<'_>,
        case: &Case,
        entry: f64,
        orbit: &PeriodicOrbit,
        range: (f64, f64),
    ) -> Result<Self, PaperError> {
        let family = case.family(OMEGA);
        let options = ContinuationOptions {
            max_step: 0.1,
            ..ContinuationOptions::over(range.0, range.1)
        };
        let (down, up) = runs.controlled(|control| {
            let follow =
                |direction| continue_orbit(&family, entry, orbit, direction, &options, control);
            rayon::join(
                || follow(Direction::Decreasing),
                || follow(Direction::Increasing),
            )
        });
        let failed = PaperError::failed(format!(
            "the period-{} branch from Ω = {entry}",
            orbit.period
        ));
        let (down, up) = (down.map_err(&failed)?, up.map_err(&failed)?);
        let mut points = points_of(&down, case)?;
        points.reverse();
        // In reversed order a bifurcation precedes the point that it followed.
        for k in (1..points.len()).rev() {
            points[k].since = points[k - 1].since;
        }
        if let Some(first) = points.first_mut() {
            first.since = None;
        }
        points.extend(points_of(&up, case)?.into_iter().skip(1));
        let mut bifurcations = down.bifurcations;
        bifurcations.reverse();
        bifurcations.extend(up.bifurcations);
        Ok(Self {
            points,
            bifurcations,
        })
    }

    fn of_kind(&self, kind: impl Fn(&BifurcationKind) -> bool) -> Vec<f64> {
        self.bifurcations
            .iter()
            .filter(|b| kind(&b.kind))
            .map(|b| b.parameter)
            .collect()
    }

    /// Values of Ω at which the period doubles.
    pub(super) fn flips(&self) -> Vec<f64> {
        self.of_kind(|k| matches!(k, BifurcationKind::Flip))
    }

    /// Values of Ω at which tori are born.
    pub(super) fn tori(&self) -> Vec<f64> {
        self.of_kind(|k| matches!(k, BifurcationKind::NeimarkSacker { .. }))
    }

    /// Smallest and largest Ω of the branch.
    pub(super) fn extent(&self) -> (f64, f64) {
        self.points
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| {
                (low.min(p.omega), high.max(p.omega))
            })
    }

    /// Intervals of Ω in which the branch is stable, lower end first, in order along the branch.
    pub(super) fn attracting(&self) -> Vec<(f64, f64)> {
        stable_stretches(self.points.iter().map(|p| (p.omega, p.stable, p.since)))
    }

    /// (Ω, largest W) of each drive period where the branch is unstable, intervals separated by
    /// gaps.
    pub(super) fn repelling(&self, range: (f64, f64)) -> Vec<Vec<(f64, f64)>> {
        let count = self.points.first().map_or(0, |p| p.maxima.len());
        (0..count)
            .map(|k| {
                let inside = |p: &Point| !p.stable && (range.0..=range.1).contains(&p.omega);
                self.points
                    .iter()
                    .map(|p| (p.omega, if inside(p) { p.maxima[k] } else { f64::NAN }))
                    .collect()
            })
            .collect()
    }

    /// Largest W at the point nearest to Ω.
    pub(super) fn height(&self, omega: f64) -> Option<f64> {
        let near = |p: &&Point| (p.omega - omega).abs();
        let point = self
            .points
            .iter()
            .min_by(|a, b| near(a).total_cmp(&near(b)))?;
        point.maxima.iter().copied().max_by(f64::total_cmp)
    }

    /// Table of its bifurcations, by Ω.
    pub(super) fn table(&self, caption: &str) -> Table {
        let mut table = Table::new(caption, ["Ω", "bifurcation", "uncertainty"]);
        let mut sorted: Vec<&Bifurcation> = self.bifurcations.iter().collect();
        sorted.sort_by(|a, b| a.parameter.total_cmp(&b.parameter));
        for b in sorted {
            let what = match b.kind {
                BifurcationKind::Fold => "fold",
                BifurcationKind::Crossing => "another branch crosses",
                BifurcationKind::Flip => "flip (period doubling)",
                BifurcationKind::NeimarkSacker { .. } => "Neimark–Sacker: a torus bifurcates",
                BifurcationKind::Grazing { .. } => "grazing: a contact appears or vanishes",
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

/// The points of one direction; `since` is the bifurcation between the previous point and this one.
fn points_of(branch: &Branch, case: &Case) -> Result<Vec<Point>, PaperError> {
    let changes_stability = |b: &&Bifurcation| !matches!(b.kind, BifurcationKind::Grazing { .. });
    branch
        .points
        .iter()
        .enumerate()
        .map(|(k, point)| {
            let model = case.with(OMEGA, point.parameter).model()?;
            let since = branch
                .bifurcations
                .iter()
                .filter(changes_stability)
                .rfind(|b| b.after_point + 1 == k);
            Ok(Point {
                omega: point.parameter,
                maxima: maxima(&model, &point.orbit.states[0], point.orbit.period)?,
                stable: point.orbit.is_stable(),
                since: since.map(|b| b.parameter),
            })
        })
        .collect()
}

/// Intervals of stable points, ending at located bifurcations if there are any.
fn stable_stretches(points: impl Iterator<Item = (f64, bool, Option<f64>)>) -> Vec<(f64, f64)> {
    let mut found: Vec<(f64, f64)> = Vec::new();
    let mut open: Option<(f64, f64)> = None;
    for (omega, stable, since) in points {
        open = match (open, stable) {
            (None, true) => Some((since.unwrap_or(omega), omega)),
            (Some((from, _)), true) => Some((from, omega)),
            (Some((from, last)), false) => {
                found.push((from, since.unwrap_or(last)));
                None
            }
            (None, false) => None,
        };
    }
    found.extend(open);
    found
        .into_iter()
        .map(|(a, b)| (a.min(b), a.max(b)))
        .collect()
}

/// Intervals as text, overlapping ones joined: "2.6076–2.6133, 2.6401–2.6512".
pub(super) fn in_words(stretches: &[(f64, f64)]) -> String {
    let mut sorted = stretches.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut joined: Vec<(f64, f64)> = Vec::new();
    for (from, to) in sorted {
        match joined.last_mut() {
            Some(last) if from <= last.1 => last.1 = last.1.max(to),
            _ => joined.push((from, to)),
        }
    }
    if joined.is_empty() {
        return "nowhere".to_owned();
    }
    let words = joined.iter().map(|(from, to)| format!("{from:.4}–{to:.4}"));
    words.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_end_at_the_bifurcations_between_points() {
        let points = [
            (1.0, true, None),
            (2.0, true, None),
            (3.0, false, Some(2.4)),
            (4.0, true, Some(3.5)),
            (3.8, true, None),
        ];
        assert_eq!(
            stable_stretches(points.into_iter()),
            [(1.0, 2.4), (3.5, 3.8)]
        );
        assert_eq!(stable_stretches(std::iter::empty()), []);
        assert_eq!(
            in_words(&[(3.5, 3.8), (1.0, 2.4)]),
            "1.0000–2.4000, 3.5000–3.8000"
        );
        assert_eq!(
            in_words(&[(1.0, 2.5), (2.0, 3.0), (1.2, 1.3)]),
            "1.0000–3.0000"
        );
        assert_eq!(in_words(&[]), "nowhere");
    }
}

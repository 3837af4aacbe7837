//! Figs. 15–17: no tip mass. The captions have Ω = 20, the text Ω = 2.6; both are computed.

use std::rc::Rc;

use nanotap_dynamics::PeriodicOrbit;
use nanotap_figures::{Figure, Panel};

use super::PaperError;
use super::check::digits;
use super::expected::Computed;
use super::motion_view::{KEY, View, empty_portrait};
use super::runs::{Counted, Runs, how_many, stability};
use super::section::{Picture, Section};
use nanotap::model::cantilever::Cantilever;
use nanotap::model::parameter::Parameter;

/// Longest period of the orbits that are searched for.
const MAX_PERIOD: usize = 4;

/// Both readings, with their censuses and orbits.
struct Bare {
    fast: Reading,
    slow: Reading,
}

/// One reading of the three figures.
struct Reading {
    counted: Rc<Counted>,
    orbits: Rc<[PeriodicOrbit]>,
}

impl Reading {
    fn new(runs: &Runs<'_>, omega: f64) -> Result<Self, PaperError> {
        let case = Cantilever::paper()
            .with(Parameter::Alpha1, 0.0)
            .with(Parameter::Omega, omega);
        let counted = runs.count(&case)?;
        let orbits = runs.orbits(&counted, MAX_PERIOD, 256)?;
        Ok(Self { counted, orbits })
    }

    fn unstable(&self, period: usize) -> Vec<&PeriodicOrbit> {
        self.orbits
            .iter()
            .filter(|o| o.period == period && !o.is_stable())
            .collect()
    }

    /// The motions of a period in words: "one stable (W from … to …), one unstable (…)".
    fn describe(&self, period: usize) -> Result<String, PaperError> {
        let mut parts = Vec::new();
        for (orbit, _) in self.counted.stable(period) {
            let o = self.counted.look(orbit)?.observables;
            parts.push(format!(
                "one stable (W from {} to {})",
                digits(o.tip_min, 4),
                digits(o.tip_max, 5)
            ));
        }
        for orbit in self.unstable(period) {
            let o = self.counted.look(orbit)?.observables;
            parts.push(format!(
                "one unstable (W from {} to {})",
                digits(o.tip_min, 4),
                digits(o.tip_max, 5)
            ));
        }
        let omega = self.counted.case.omega;
        Ok(if parts.is_empty() {
            format!("Ω = {omega}: no period-{period} motion")
        } else {
            format!("Ω = {omega}: {}", parts.join(", "))
        })
    }

    /// An orbit of this period; a stable one is preferred.
    fn best(&self, period: usize) -> Option<&PeriodicOrbit> {
        let stable = self.counted.stable(period).first().map(|(orbit, _)| *orbit);
        stable.or_else(|| self.unstable(period).first().copied())
    }

    /// Time series and phase portrait of an orbit.
    fn panels(&self, orbit: &PeriodicOrbit, periods: usize) -> Result<[Panel; 2], PaperError> {
        let omega = self.counted.case.omega;
        let view = View::new(&self.counted.model, &orbit.states[0], periods)?;
        let whole = View::new(&self.counted.model, &orbit.states[0], orbit.period)?;
        Ok([
            view.time_panel(format!(
                "Ω = {omega}: period {}, {}",
                orbit.period,
                stability(orbit)
            )),
            whole.portrait_panel(
                format!("largest |μ| = {}", digits(orbit.spectral_radius(), 4)),
                0.8,
            ),
        ])
    }
}

impl Bare {
    fn new(runs: &Runs<'_>) -> Result<Self, PaperError> {
        Ok(Self {
            fast: Reading::new(runs, 20.0)?,
            slow: Reading::new(runs, 2.6)?,
        })
    }

    /// Checks a number of motions of this period.
    fn check(
        &self,
        section: Section,
        id: &'static str,
        period: usize,
    ) -> Result<Section, PaperError> {
        let stable = [&self.fast, &self.slow].map(|r| r.counted.stable(period).len());
        let all = [&self.fast, &self.slow]
            .map(|r| r.counted.stable(period).len() + r.unstable(period).len());
        let here = format!(
            "{}; {}",
            self.fast.describe(period)?,
            self.slow.describe(period)?
        );
        let evidence = format!(
            "Ω = 20, {}; Ω = 2.6, {}; {}",
            self.fast.counted.summary(),
            self.slow.counted.summary(),
            self.fast.counted.missed()
        );
        let again = self.fast.counted.rerun();
        Ok(section.check(id, found(stable, all), here, evidence, again))
    }
}

/// The numbers of `stable` motions and of `all` motions, unstable ones included, of the better of two
/// readings. Unstable motions count only next to a stable one.
fn found(stable: [usize; 2], all: [usize; 2]) -> Computed {
    let most = |counts: [usize; 2]| counts[0].max(counts[1]) as f64;
    let any = most(stable) >= 1.0;
    Computed::readings(most(stable), if any { most(all) } else { 0.0 })
}

/// The picture of up to two orbits.
fn picture(
    name: &str,
    title: &str,
    caption: &str,
    rows: &[Option<(&Reading, &PeriodicOrbit, usize)>],
) -> Result<Picture, PaperError> {
    let mut figure = Figure::new(rows.len(), 2).column_widths([1.7, 1.0]);
    for row in rows {
        let [time, portrait] = match row {
            Some((reading, orbit, periods)) => reading.panels(orbit, *periods)?,
            None => [
                empty_portrait("no such motion"),
                empty_portrait("no such motion"),
            ],
        };
        figure = figure.with(time).with(portrait);
    }
    Ok(Picture::new(
        name,
        title,
        format!("Eq. (26) with α₁ = 0, N = 3. {caption} {KEY}"),
        figure,
        64.0 * rows.len() as f64,
    ))
}

/// Computes the section on Fig. 15: two period-1 motions without tip mass.
pub(super) fn fig15(runs: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    let bare = Bare::new(runs)?;
    let kinds = |r: &Reading| r.counted.kinds().join(", ");
    // The captions' reading is the better one if only it has a stable subharmonic.
    let subharmonic = |r: &Reading| {
        r.counted
            .all_stable()
            .iter()
            .any(|(orbit, _)| orbit.period > 1)
    };
    let reading = match (subharmonic(&bare.fast), subharmonic(&bare.slow)) {
        (true, false) => {
            "only at Ω = 20 does a subharmonic exist, as Figs. 16 and 17 need: the captions look right"
        }
        (false, true) => {
            "only at Ω = 2.6 does a subharmonic exist, as Figs. 16 and 17 need: the text looks right"
        }
        _ => "the existing motions do not decide between the two",
    };
    Ok(bare
        .check(section, "fig15", 1)?
        .text(
            "The captions of Figs. 15–17 say Ω = 20; the text on them says Ω = 2.6. Section 4 also says once that α₁ = 0 \
             in Figs. 16 and 17 and once in Figs. 15–17; the captions say 15–17.",
        )
        .picture(picture(
            "fig15",
            "Period-1 motions without a tip mass (Fig. 15)",
            "(a, b) Ω = 20, as in the captions. (c, d) Ω = 2.6, as in the text.",
            &[
                bare.fast.best(1).map(|o| (&bare.fast, o, 4)),
                bare.slow.best(1).map(|o| (&bare.slow, o, 4)),
            ],
        )?)
        .check(
            "fig15-omega",
            (),
            reading,
            format!("attractors at Ω = 20: {}; at Ω = 2.6: {}", kinds(&bare.fast), kinds(&bare.slow)),
            bare.slow.counted.rerun(),
        )
        .check(
            "fig15-alpha1",
            (),
            "α₁ = 0 is used for Figs. 15–17",
            "the paper contradicts itself; two of its three statements say 15–17",
            bare.fast.counted.rerun(),
        ))
}

/// Computes the section on Fig. 16: period 2 without tip mass.
pub(super) fn fig16(runs: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    let bare = Bare::new(runs)?;
    let shown = match (bare.fast.best(2), bare.slow.best(2)) {
        (Some(orbit), _) => (&bare.fast, orbit, 2, "The period-2 orbit."),
        (None, Some(orbit)) => (&bare.slow, orbit, 2, "The period-2 orbit."),
        (None, None) => {
            let orbit = bare.fast.best(4).or_else(|| bare.fast.best(1));
            let Some(orbit) = orbit else {
                return Err(PaperError::failed("Fig. 16")("no orbit at Ω = 20"));
            };
            let words = "No period-2 orbit was found, stable or unstable; the figure shows the subharmonic that exists at Ω = 20.";
            (&bare.fast, orbit, orbit.period, words)
        }
    };
    let three = bare.slow.counted.stable(3).len();
    Ok(bare
        .check(section, "fig16", 2)?
        .picture(picture(
            "fig16",
            "Is there a period-2 motion without a tip mass? (Fig. 16)",
            shown.3,
            &[Some((shown.0, shown.1, shown.2))],
        )?)
        .check(
            "fig16-no-period-3",
            three,
            if three == 0 {
                "none is stable here either"
            } else {
                "one is stable"
            },
            format!(
                "{}; {}",
                bare.slow.counted.summary(),
                bare.slow.counted.missed()
            ),
            bare.slow.counted.rerun(),
        ))
}

/// Computes the section on Fig. 17: two period-4 motions without tip mass.
pub(super) fn fig17(runs: &Runs<'_>, section: Section) -> Result<Section, PaperError> {
    let bare = Bare::new(runs)?;
    let stable: Vec<&PeriodicOrbit> = bare
        .fast
        .counted
        .stable(4)
        .into_iter()
        .map(|(orbit, _)| orbit)
        .collect();
    let unstable = bare.fast.unstable(4);
    let mut rows: Vec<Option<(&Reading, &PeriodicOrbit, usize)>> = stable
        .iter()
        .chain(&unstable)
        .take(2)
        .map(|orbit| Some((&bare.fast, *orbit, 4)))
        .collect();
    if rows.is_empty() {
        rows.push(None);
    }
    let tip = runs.count(&Cantilever::paper())?;
    let with_tip = tip.stable(4).len();
    Ok(bare
        .check(section, "fig17", 4)?
        .picture(picture(
            "fig17",
            "Period-4 motions without a tip mass at Ω = 20 (Fig. 17)",
            &format!(
                "{} {}",
                match stable.len() {
                    0 => "No period-4 motion is stable.".to_owned(),
                    1 => "(a, b) The stable one.".to_owned(),
                    n => format!("{n} are stable."),
                },
                if unstable.is_empty() {
                    ""
                } else {
                    "(c, d) The unstable one (saddle)."
                }
            ),
            &rows,
        )?)
        .check(
            "fig17-no-tip-mass",
            with_tip,
            how_many(with_tip, "stable period-4 motion"),
            tip.summary(),
            tip.rerun(),
        ))
}

#[cfg(test)]
mod tests {
    use super::super::check::Verdict;
    use super::super::expected::Expected::AtLeast;
    use super::*;

    #[test]
    fn two_claimed_motions_need_two_that_attract() {
        let verdict = |claimed, stable, all| AtLeast(claimed).verdict(&found(stable, all));
        assert_eq!(verdict(2, [2, 0], [2, 0]), Verdict::Reproduced);
        // One is stable, its saddle partner is not: the paper may show either.
        assert_eq!(verdict(2, [1, 0], [2, 0]), Verdict::Ambiguous);
        assert_eq!(verdict(2, [1, 1], [1, 1]), Verdict::Differs);
        assert_eq!(verdict(1, [0, 0], [3, 0]), Verdict::Differs);
    }
}

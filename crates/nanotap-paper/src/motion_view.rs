//! Drawing of a motion: tip deflection against time with the contact shaded, and the phase portrait
//! (W, dW/dτ) with the contact in a separate colour.

use nanotap_figures::{Axis, Band, Colour, Dash, Legend, Line, Markers, Panel, Points};
use nanotap_flow::{Output, Trajectory};

use super::PaperError;
use nanotap::model::Model;

/// Number of points drawn per drive period.
const POINTS_PER_PERIOD: f64 = 500.0;
/// Minimum number of points per stretch of flight or contact.
const MIN_POINTS: f64 = 6.0;

/// Colour of the motion in free flight.
pub(super) const FLIGHT: Colour = Colour::BLUE;
/// Colour of the motion in contact.
pub(super) const CONTACT: Colour = Colour::VERMILLION;

/// A motion that is drawn: a trajectory of a model.
pub(super) struct View<'a> {
    model: &'a Model,
    trajectory: Trajectory,
}

/// Points of one stretch of flight or contact.
struct Stretch {
    contact: bool,
    points: Vec<(f64, f64)>,
}

impl<'a> View<'a> {
    /// `periods` drive periods of `model` from the state `start`.
    pub(super) fn new(model: &'a Model, start: &[f64], periods: usize) -> Result<Self, PaperError> {
        let trajectory = Trajectory::record(&model.system, start, periods)
            .map_err(PaperError::failed("a motion to draw"))?;
        Ok(Self { model, trajectory })
    }

    /// One output against another, stretch by stretch.
    fn stretches(&self, x: Option<&Output>, y: &Output) -> Vec<Stretch> {
        let y = self.trajectory.signal(y);
        let x = x.map(|x| self.trajectory.signal(x));
        let period = self.model.period();
        let mut stretches: Vec<Stretch> = Vec::new();
        for (i, (segment, piece)) in self.trajectory.segments().iter().zip(&y.pieces).enumerate() {
            let contact = self.model.contact[segment.regime];
            let count = (POINTS_PER_PERIOD * piece.length / period)
                .max(MIN_POINTS)
                .ceil();
            let points = (0..=count as usize).map(|k| {
                let s = piece.length * k as f64 / count;
                let across = x
                    .as_ref()
                    .map_or((piece.start + s) / period, |x| x.pieces[i].signal.at(s));
                (across, piece.signal.at(s))
            });
            match stretches.last_mut() {
                // A drive period ended within the stretch.
                Some(last) if last.contact == contact => last.points.extend(points),
                _ => stretches.push(Stretch {
                    contact,
                    points: points.collect(),
                }),
            }
        }
        stretches
    }

    /// Intervals in which the tip is in contact, in drive periods.
    pub(super) fn contacts(&self) -> Vec<(f64, f64)> {
        self.stretches(None, &self.model.tip)
            .iter()
            .filter(|s| s.contact)
            .filter_map(|s| Some((s.points.first()?.0, s.points.last()?.0)))
            .collect()
    }

    /// The line of tip deflection against time in drive periods.
    pub(super) fn tip_line(&self) -> Line {
        Line::new(
            self.stretches(None, &self.model.tip)
                .into_iter()
                .flat_map(|s| s.points),
        )
    }

    /// A panel with the tip deflection against time, contacts shaded.
    pub(super) fn time_panel(&self, title: impl Into<String>) -> Panel {
        let surface = self
            .stretches(None, &self.model.surface())
            .into_iter()
            .flat_map(|s| s.points);
        Panel::new(
            Axis::linear("time $τ / T$ (drive periods)").tight(),
            Axis::linear("tip deflection $W$"),
        )
        .title(title)
        .legend(Legend::Hidden)
        .with(Band::x(self.contacts()))
        .with(
            Line::new(surface)
                .colour(Colour::GREY)
                .dash(Dash::Dashed)
                .width(0.6),
        )
        .with(self.tip_line().colour(FLIGHT))
    }

    /// A panel with the phase portrait, the strobe states marked.
    pub(super) fn portrait_panel(&self, title: impl Into<String>, width: f64) -> Panel {
        let rate = self.model.tip_rate();
        let mut panel = empty_portrait(title);
        for stretch in self.stretches(Some(&self.model.tip), &rate) {
            let colour = if stretch.contact { CONTACT } else { FLIGHT };
            panel = panel.with(Line::new(stretch.points).colour(colour).width(width));
        }
        panel.with(Markers::new(self.strobes()).colour(Colour::BLACK).size(1.1))
    }

    /// The phase portrait of a motion that fills an area, as one thin line per regime.
    pub(super) fn tangle_into(&self, panel: Panel, colour: Colour) -> Panel {
        let rate = self.model.tip_rate();
        let points = self
            .stretches(Some(&self.model.tip), &rate)
            .into_iter()
            .flat_map(|s| s.points);
        panel.with(Line::new(points).colour(colour).width(0.2))
    }

    /// (W, dW/dτ) at drive phase 0.
    pub(super) fn strobes(&self) -> Vec<(f64, f64)> {
        let period = self.model.period();
        let (tip, rate) = (
            self.trajectory.signal(&self.model.tip),
            self.trajectory.signal(&self.model.tip_rate()),
        );
        let count = (self.trajectory.end() / period).round() as usize;
        (0..count)
            .filter_map(|k| Some((tip.at(k as f64 * period)?, rate.at(k as f64 * period)?)))
            .collect()
    }

    /// The strobe states as dots.
    pub(super) fn strobe_dots(&self) -> Points {
        Points::new(self.strobes()).diameter(0.5)
    }
}

/// Creates a panel for a phase portrait (W, dW/dτ), without data.
pub(super) fn empty_portrait(title: impl Into<String>) -> Panel {
    Panel::new(
        Axis::linear("tip deflection $W$"),
        Axis::linear("tip velocity $dW/dτ$"),
    )
    .title(title)
    .legend(Legend::Hidden)
}

/// Meaning of shading and colours, for captions.
pub(super) const KEY: &str = "Grey bands: tip in contact; dashed line: the sample's surface as the moving base \
    sees it. Phase portraits: flight blue, contact orange-red, dots at drive phase 0.";

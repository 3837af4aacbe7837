//! A free amplitude and a setpoint that meet the wishes of an experiment: the page's view Plan.
//!
//! The study `window` is computed around the case's own point first, then over a whole range in stages of
//! increasing resolution. Each point comes with the motions that the study found there: what the page
//! says of it, and its line for the notebook.

use nanotap::case::physical::{Held, Physical};
use nanotap::case::quantity::Kind;
use nanotap::case::units::prefixed;
use nanotap::case::{Case, Key};
use nanotap::observe::table::shown_phase;
use nanotap::study::lever::{PointTimes, time_constant, usual_gain};
use nanotap::study::registry::study as study_named;
use nanotap::study::request::read;
use nanotap::study::scan::ScanOptions;
use nanotap::study::target::{Regime, Target, TargetMotion, TargetPoint};
use nanotap::study::window::Window;
use nanotap_figures::{Axis, CategoryMap, Colour, Figure, Legend, Markers, Panel, Shape};
use serde_json::{Value, json};

use super::plan::PLAN_STARTS;
use super::{Stage, Studied, dataset, object};
use crate::api_error::ApiError;
use crate::forms::quality_factor;

/// Numbers of free amplitudes and of setpoints: near the case's own point, then over the whole range. The
/// study follows an approach at each of up to 16 free amplitudes; of more, it leaves some out, and finds
/// fewer states there.
const COUNTS: [[usize; 2]; 4] = [[3, 3], [5, 5], [9, 9], [9, 17]];
/// Reach of the free amplitude on either side, as a part of it.
const REACH: f64 = 0.5;
/// Setpoints above the case's own, and in the whole range.
const SETPOINTS: [f64; 2] = [0.1, 0.4];
/// Largest and smallest setpoint.
const ENDS: [f64; 2] = [0.05, 0.99];
/// Setpoint of a case without one.
const USUAL: f64 = 0.8;
/// Other points that are offered.
const OFFERS: usize = 4;
/// Pixels of a line, most.
const MAX_PIXELS: usize = 100_000;
/// Digits of the numbers in a sentence.
const DIGITS: usize = 3;

/// What the figure shows of a point.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Tile {
    One,
    Several,
    Hard,
    Unknown,
}

impl Tile {
    const ALL: [(Self, &'static str, Colour); 4] = [
        (Self::One, "one state", Colour::GREEN),
        (Self::Several, "two states or more", Colour::ORANGE),
        (Self::Hard, "too hard", Colour::VERMILLION),
        (Self::Unknown, "not decided", Colour::GREY),
    ];
}

/// The wishes that are the same for every point.
struct Wishes {
    /// The force may not exceed a limit.
    force: Target,
    /// One state, tapping, or no contact; `None`: any state.
    kind: Option<Target>,
    pixels: usize,
    /// Height of the steps of the surface, m.
    step: f64,
    /// Integral gain of the feedback, 1/s, and whether the case states it.
    gain: (f64, bool),
    /// Slew rate, m/s; infinite where none is stated.
    slew: f64,
}

/// A point of the window.
struct Point<'a> {
    /// Free amplitude, m.
    free: f64,
    setpoint: f64,
    distance: f64,
    found: &'a TargetPoint,
    motions: Vec<&'a TargetMotion>,
    tile: Tile,
    /// Distance from the case's own point on the map.
    apart: f64,
}

impl Point<'_> {
    /// The largest force of all motions, N; infinite where one is not known.
    fn force(&self) -> f64 {
        let force = |motion: &&TargetMotion| match motion.period {
            0 => f64::INFINITY,
            _ => motion.named("peak_force"),
        };
        self.motions.iter().map(force).fold(0.0, f64::max)
    }

    /// The motion whose amplitude is the setpoint's.
    fn motion(&self) -> Option<&TargetMotion> {
        let off = |motion: &TargetMotion| {
            (motion.named("first_harmonic") - self.setpoint * self.free).abs()
        };
        let orbits = self.motions.iter().filter(|motion| motion.period > 0);
        orbits.min_by(|a, b| off(a).total_cmp(&off(b))).copied()
    }

    fn meets(&self, targets: &[&Target]) -> bool {
        let targets: Vec<Target> = targets.iter().copied().cloned().collect();
        self.found.meets(&targets)
    }
}

impl Studied<'_> {
    /// Finds free amplitudes and setpoints that meet the wishes.
    pub(super) fn wishes(&self) -> Result<(), ApiError> {
        let case = self.request.case.any_distance(self.app)?;
        let own = own_point(&case)?;
        let wishes = self.read_wishes(&case)?;
        let conditions = self.conditions()?;
        let whole = ranges(own, true);
        for (stage, [amplitudes, setpoints]) in COUNTS.into_iter().enumerate() {
            let [free, setpoint] = ranges(own, stage > 0);
            let length = |value| Kind::Length.format_exact(value).replace(' ', "");
            let over = [
                format!(
                    "{}={}:{}:{amplitudes}",
                    Key::DriveFreeAmplitude,
                    length(free[0]),
                    length(free[1])
                ),
                format!(
                    "{}={}:{}:{setpoints}",
                    Key::DriveSetpoint,
                    number(setpoint[0]),
                    number(setpoint[1])
                ),
            ];
            let options =
                object(json!({ "over": over, "starts": PLAN_STARTS, "where": conditions }));
            let entry = study_named("window");
            let entry = entry.ok_or_else(|| ApiError::failed("unknown study `window`"))?;
            let (figure, mut plan) = self.counting("steps of the next stage", |control| {
                let plan = entry.plan(&case, Value::Object(options.clone()), control)?;
                dataset(&plan, control, |store| {
                    let window = Window::of(store).map_err(ApiError::of)?;
                    let found = Window::motions(store).map_err(ApiError::of)?;
                    let points = points(&window, &found, own, &wishes);
                    let best = best(&points, &wishes);
                    let figure = figure(&window, &points, whole, &best, &wishes);
                    Ok((
                        figure,
                        self.plan_json(&points, &wishes, &best, whole[0][1])?,
                    ))
                })
            })?;
            plan["known"] = (amplitudes * setpoints).into();
            plan["of"] = COUNTS[COUNTS.len() - 1].iter().product::<usize>().into();
            self.hand(Stage {
                figure: Some(figure),
                clicks: json!({ "plan": plan }),
                studies: &[("window", &options)],
                ..Stage::default()
            })?;
            if self.request.quick || self.control.is_cancelled() {
                break;
            }
        }
        Ok(())
    }

    fn read_wishes(&self, case: &Case) -> Result<Wishes, ApiError> {
        let target = |text: &String| Target::parse(text, true).map_err(ApiError::of);
        let mut targets = self
            .conditions()?
            .iter()
            .map(target)
            .collect::<Result<Vec<_>, _>>()?;
        let kind = (targets.len() > 1).then(|| targets.pop()).flatten();
        let force = targets.pop().ok_or_else(|| {
            ApiError::input("no force is given", "give the largest force").about("force")
        })?;
        let pixels = self.field("points")?.parse::<usize>().ok();
        let pixels = pixels.filter(|count| (1..=MAX_PIXELS).contains(count));
        let pixels = pixels.ok_or_else(|| {
            ApiError::input(
                format!("expected 1 to {MAX_PIXELS} points of a line"),
                "as in 256",
            )
            .about("points")
        })?;
        let step = Kind::Length.parse(self.field("step")?).ok();
        let step = step.filter(|step| *step >= 0.0 && step.is_finite());
        let step = step.ok_or_else(|| {
            ApiError::input("expected the height of a step", "as in 10 nm").about("step")
        })?;
        let view = physical(case)?;
        let scan = case.scan().cloned().unwrap_or_default();
        let options: ScanOptions = read(Value::Object(scan))?;
        let [gain, slew] = options.feedback_limits()?;
        let usual = usual_gain(time_constant(quality_factor(view), view.lever.f0));
        Ok(Wishes {
            force,
            kind,
            pixels,
            step,
            gain: (gain.unwrap_or(usual), gain.is_some()),
            slew: slew.unwrap_or(f64::INFINITY),
        })
    }

    /// What the page says: the best point, the other offers, all points, and what fails. The map's unit is
    /// that of the `largest` free amplitude.
    fn plan_json(
        &self,
        points: &[Point<'_>],
        wishes: &Wishes,
        best: &[usize],
        largest: f64,
    ) -> Result<Value, ApiError> {
        let mut all = Vec::new();
        for point in points {
            all.push(self.point_json(point, wishes, largest)?);
        }
        Ok(json!({
            "points": all,
            "best": best,
            "fails": best.is_empty().then(|| fails(points, wishes)),
        }))
    }

    fn point_json(
        &self,
        point: &Point<'_>,
        wishes: &Wishes,
        largest: f64,
    ) -> Result<Value, ApiError> {
        let free = exact(Kind::Length, point.free);
        let setpoint = exact(Kind::Number, point.setpoint);
        let mut spec = self.request.case.clone();
        spec.put(Key::DriveFreeAmplitude, &free);
        spec.put(Key::DriveSetpoint, &setpoint);
        let scale = prefixed(Kind::Length, 1.0, largest).0;
        let percent = Kind::Number.format_digits(100.0 * point.setpoint, 4);
        let mut json = json!({
            "free": free,
            "setpoint": setpoint,
            "at": [point.free, point.setpoint],
            "place": [scale * point.free, 100.0 * point.setpoint],
            "shown": { "free": Kind::Length.format_digits(point.free, 4), "setpoint": format!("{percent} %") },
            "states": point.motions.len(),
            "tile": Tile::ALL.iter().position(|(tile, ..)| *tile == point.tile),
            "gentle": point.meets(&[&wishes.force]),
            "kind": wishes.kind.as_ref().is_none_or(|kind| point.meets(&[kind])),
        });
        let Some(motion) = point.motion().filter(|_| point.tile != Tile::Unknown) else {
            return Ok(json);
        };
        let case = spec.any_distance(self.app)?;
        let view = physical(&case)?;
        let constant = time_constant(quality_factor(view), view.lever.f0);
        let error = point.free * (1.0 - point.setpoint);
        let times = PointTimes::new(constant, wishes.step, wishes.gain.0, error, wishes.slew);
        let (longest, limit) = times.longest();
        let shown = |kind: Kind, value: f64| kind.format_digits(value, DIGITS);
        let lines = Kind::Number.format_digits(times.line_rate(wishes.pixels), DIGITS);
        let regime = motion.regime().map_or("", Regime::name);
        let touches = point
            .motions
            .iter()
            .any(|motion| motion.named("contact_fraction") > 0.0);
        let each = point.motions.iter().map(|motion| {
            json!({
                "period": motion.period,
                "regime": motion.regime().map(Regime::name),
                "amplitude": motion.named("first_harmonic"),
                "phase": shown_phase(motion.named("phase")),
                "force": motion.named("peak_force"),
                "contact": motion.named("contact_fraction"),
            })
        });
        json["motions"] = each.collect();
        json["regime"] = regime.into();
        json["touches"] = touches.into();
        json["force"] =
            json!({ "value": point.force(), "shown": shown(Kind::Force, point.force()) });
        json["phase"] = shown_phase(motion.named("phase")).into();
        json["distance"] = json!({ "value": point.distance, "shown": Kind::Length.format_digits(point.distance, 4) });
        json["lines"] = json!({
            "rate": lines,
            "limit": limit,
            "time": shown(Kind::Time, longest),
            "gain": Kind::Number.format_digits(wishes.gain.0, DIGITS),
            "stated": wishes.gain.1,
            "step": shown(Kind::Length, wishes.step),
        });
        json["line"] = notebook(&case, point, motion, &lines, wishes.pixels)?.into();
        Ok(json)
    }
}

/// One line that says all of a point.
fn notebook(
    case: &Case,
    point: &Point<'_>,
    motion: &TargetMotion,
    lines: &str,
    pixels: usize,
) -> Result<String, ApiError> {
    let view = physical(case)?;
    let shown = |kind: Kind, value: f64| kind.format_digits(value, DIGITS);
    let key = |key: Key, name: &str| {
        let value = case.get(key);
        let text = value.is_finite().then(|| shown(key.kind(), value));
        text.map(|text| format!("{name}{text}"))
    };
    let lever = [
        Some(format!("k {}", shown(Kind::Stiffness, view.lever.k))),
        Some(format!(
            "f0 {}",
            Kind::Frequency.format_digits(view.lever.f0, 4)
        )),
        Some(format!(
            "Q {}",
            shown(Kind::Number, view.lever.quality_factor)
        )),
        key(Key::TipRadius, "R "),
    ];
    let law = case.stated(Key::SampleLaw).map(nanotap::case::Value::text);
    let law = law.map(|law| match law.as_str() {
        "dmt" | "jkr" | "dlvo" => law.to_uppercase(),
        _ => law,
    });
    let modulus = key(Key::SampleModulus, "").or_else(|| key(Key::SampleStiffness, ""));
    let joined = |parts: &[Option<String>]| {
        let parts: Vec<&str> = parts.iter().flatten().map(String::as_str).collect();
        parts.join(", ")
    };
    let states = match point.motions.len() {
        1 => "one state".to_owned(),
        2 => "TWO STATES".to_owned(),
        count => format!("{count} STATES"),
    };
    let amplitude = Kind::Length.format_digits(point.setpoint * point.free, 4);
    Ok(format!(
        "{} | {} | A0 {}, setpoint {} ({amplitude}) | {states}, {}, phase lag {:.1} deg, peak force {}, distance {} | <= {lines} lines/s at {pixels} px | nanotap {}, case {:04x}",
        joined(&lever),
        joined(&[law, modulus]),
        Kind::Length.format_digits(point.free, 4),
        Kind::Number.format_digits(point.setpoint, 4),
        motion.regime().map_or("", Regime::name),
        shown_phase(motion.named("phase")),
        shown(Kind::Force, point.force()),
        Kind::Length.format_digits(point.distance, 4),
        env!("CARGO_PKG_VERSION"),
        fingerprint(&case.to_toml()),
    ))
}

/// Sixteen bits of the FNV-1a hash of a text, by which two cases are told apart.
fn fingerprint(text: &str) -> u64 {
    let mix = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    text.bytes().fold(0xcbf2_9ce4_8422_2325, mix) >> 48
}

fn physical(case: &Case) -> Result<&Physical, ApiError> {
    case.physical().ok_or_else(|| {
        ApiError::input(
            "an experiment is planned with units, and this case has none",
            "choose an example with units",
        )
    })
}

/// Free amplitude in m and setpoint of a case.
fn own_point(case: &Case) -> Result<[f64; 2], ApiError> {
    let view = physical(case)?;
    let setpoint = match view.held {
        None => USUAL,
        Some(Held::Amplitude(ratio)) => ratio,
        Some(_) => {
            return Err(ApiError::input(
                "the setpoint of this case is not an amplitude",
                "give it as a part of the free amplitude, as in 0.8",
            )
            .about(Key::DriveSetpoint.path()));
        }
    };
    Ok([view.free_amplitude, setpoint])
}

/// Ranges of the free amplitude, m, and of the setpoint: all, or near the case's own.
fn ranges([free, setpoint]: [f64; 2], whole: bool) -> [[f64; 2]; 2] {
    let reach = if whole { REACH } else { 0.5 * REACH };
    let [step, span] = SETPOINTS;
    let above = setpoint + step;
    let top = if above < ENDS[1] { above } else { setpoint };
    let span = if whole { span } else { 2.0 * step };
    let amplitudes = [free * (1.0 - reach), free * (1.0 + reach)];
    [amplitudes, [(top - span).max(ENDS[0]), top]]
}

/// A number without the rounding errors of its last digits.
fn number(value: f64) -> String {
    Kind::Number.format_digits(value, 12)
}

/// A value as a case states it: with few digits, where that is the same value.
fn exact(kind: Kind, value: f64) -> String {
    let short = kind.format_digits(value, 8);
    let same = |read: f64| (read - value).abs() <= 1e-12 * value.abs();
    match kind.parse(&short) {
        Ok(read) if same(read) => short,
        _ => kind.format_exact(value),
    }
}

/// The points of a window, row by row.
fn points<'a>(
    window: &Window,
    found: &'a [TargetPoint],
    own: [f64; 2],
    wishes: &Wishes,
) -> Vec<Point<'a>> {
    let columns = window.x.len().max(1);
    let place = |(k, found): (usize, &'a TargetPoint)| {
        let (free, setpoint) = (window.x[k % columns], window.y[k / columns]);
        let row = window.distances.get(k / columns);
        let distance = row.and_then(|row| row[k % columns]).unwrap_or(f64::NAN);
        let motions = found.different();
        let tile = if found.unknown || motions.is_empty() {
            Tile::Unknown
        } else if !found.meets(std::slice::from_ref(&wishes.force)) {
            Tile::Hard
        } else if motions.len() > 1 {
            Tile::Several
        } else {
            Tile::One
        };
        let off = [
            (free / own[0] - 1.0) / REACH,
            (setpoint - own[1]) / (0.5 * SETPOINTS[1]),
        ];
        let apart = off.iter().map(|part| part * part).sum::<f64>().sqrt();
        Point {
            free,
            setpoint,
            distance,
            found,
            motions,
            tile,
            apart,
        }
    };
    found.iter().enumerate().map(place).collect()
}

/// Indices of the points that meet all wishes: the nearest to the case's own, then others that differ from
/// those before.
fn best(points: &[Point<'_>], wishes: &Wishes) -> Vec<usize> {
    let mut targets = vec![&wishes.force];
    targets.extend(&wishes.kind);
    let mut fit: Vec<usize> = (0..points.len())
        .filter(|&k| points[k].meets(&targets))
        .collect();
    fit.sort_by(|&a, &b| points[a].apart.total_cmp(&points[b].apart));
    let mut chosen: Vec<usize> = Vec::new();
    for k in fit {
        let far = |&other: &usize| {
            let [one, other] = [&points[k], &points[other]];
            (one.free / other.free - 1.0).abs() > 0.1
                || (one.setpoint - other.setpoint).abs() > 0.09
        };
        if chosen.len() <= OFFERS && chosen.iter().all(far) {
            chosen.push(k);
        }
    }
    chosen
}

/// Which wish fails, and the nearest points that meet the other one.
fn fails(points: &[Point<'_>], wishes: &Wishes) -> Value {
    let known = || (0..points.len()).filter(|&k| points[k].tile != Tile::Unknown);
    let kind: Vec<&Target> = wishes.kind.iter().collect();
    let gentlest = known()
        .filter(|&k| points[k].meets(&kind) && points[k].force().is_finite())
        .min_by(|&a, &b| points[a].force().total_cmp(&points[b].force()));
    let gentle = known()
        .filter(|&k| points[k].meets(&[&wishes.force]))
        .min_by(|&a, &b| points[a].apart.total_cmp(&points[b].apart));
    let wish = match (gentlest, gentle) {
        (_, None) => "force",
        (None, Some(_)) => "kind",
        (Some(_), Some(_)) => "both",
    };
    json!({ "wish": wish, "gentlest": gentlest, "gentle": gentle })
}

/// The map of a stage in the whole range, with the points that fit.
fn figure(
    window: &Window,
    points: &[Point<'_>],
    whole: [[f64; 2]; 2],
    best: &[usize],
    wishes: &Wishes,
) -> Figure {
    let (factor, unit) = prefixed(Kind::Length, 1.0, whole[0][1]);
    // Half a cell of the first stage of the whole range lies beyond each end.
    let beyond = |[from, to]: [f64; 2]| {
        let half = 0.5 * (to - from) / (COUNTS[1][0] - 1) as f64;
        (from - half, to + half)
    };
    let edges = |values: &[f64], scale: f64| {
        let (from, to) = (values[0], values[values.len() - 1]);
        let half = 0.5 * (to - from) / (values.len() - 1) as f64;
        (scale * (from - half), scale * (to + half))
    };
    let shown: Vec<_> = Tile::ALL
        .iter()
        .filter(|(tile, ..)| points.iter().any(|point| point.tile == *tile))
        .collect();
    let cells = points
        .iter()
        .map(|point| shown.iter().position(|(tile, ..)| *tile == point.tile));
    let mut map = CategoryMap::new(
        window.x.len(),
        window.y.len(),
        cells,
        edges(&window.x, factor),
        edges(&window.y, 100.0),
    );
    for (_, words, colour) in shown {
        map = map.category_in(*words, *colour);
    }
    let at = |point: &Point<'_>| (factor * point.free, 100.0 * point.setpoint);
    let mut targets = vec![&wishes.force];
    targets.extend(&wishes.kind);
    let fit = points.iter().filter(|point| point.meets(&targets)).map(at);
    let fit = Markers::new(fit).colour(Colour::BLACK).size(1.2);
    let [x, y] = [beyond(whole[0]), beyond(whole[1])];
    let mut panel = Panel::new(
        Axis::linear("free amplitude")
            .unit(unit)
            .range(factor * x.0, factor * x.1),
        Axis::linear("setpoint")
            .unit("%")
            .range(100.0 * y.0, 100.0 * y.1),
    )
    .with(map);
    if let Some(&first) = best.first() {
        let offered = Markers::new([at(&points[first])])
            .shape(Shape::Square)
            .size(3.2);
        panel = panel
            .with(offered.open().colour(Colour::BLACK).label("offered"))
            .with(fit.label("fits the wishes"));
    }
    Figure::single(panel.legend(Legend::Above))
}

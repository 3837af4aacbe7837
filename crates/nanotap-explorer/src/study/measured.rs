//! Measured data: over the curve of the model, fitted, or inverted to a force.

use std::fmt::Write as _;

use nanotap::case::file::Source;
use nanotap::case::force_table::ForceTable;
use nanotap::case::quantity::Kind;
use nanotap::case::units::prefixed;
use nanotap::case::{Case, Key};
use nanotap::control::Control;
use nanotap::figure::fit::fit_figure;
use nanotap::figure::reconstruct::reconstruct_figure;
use nanotap::files;
use nanotap::study::DatasetStudy as _;
use nanotap::study::approach::ApproachStudy;
use nanotap::study::fit::{FitMap, FitOptions, FitStudy, Table, force_curve_table, measured};
use nanotap::study::image_states::ImageData;
use nanotap::study::reconstruct::{
    ReconstructMethod, ReconstructOptions, ReconstructReport, ReconstructStudy,
};
use nanotap::study::registry::{Study as _, study as study_named};
use nanotap::study::request::read;
use nanotap_figures::{Axis as Axes, Colour, Figure, Markers, Panel};
use serde_json::{Map, Value, json};

use super::approach::{APPROACH, APPROACH_SHOWS, Approached};
use super::calibrate::CALIBRATE;
use super::image_states::IMAGE;
use super::{NextStep, Stage, Studied, object};
use crate::api_error::ApiError;
use crate::clicks::Height;
use crate::commands::CASE_FILE;
use crate::forms::{CURVE, WHOLE_MAP};
use crate::motion_request::model_of;
use crate::report;

impl Studied<'_> {
    /// Measured data: over the model's curve, or with the fit of the model to them.
    pub(super) fn measured(&self) -> Result<(), ApiError> {
        let case = self.request.case.any_distance(self.app)?;
        model_of(&case)?;
        let Some((name, content)) = &self.request.data else {
            return Err(ApiError::input("no data", "drop a file on the page"));
        };
        let bytes = content.bytes()?;
        let curve = self.field(CURVE).unwrap_or_default();
        let is_map = curve == WHOLE_MAP;
        let number = match curve {
            "" | WHOLE_MAP => None,
            number => Some(number.parse().map_err(|_| {
                ApiError::input(
                    format!("curve: expected a number, got `{number}`"),
                    format!("give the number of a curve, from 0, or `{WHOLE_MAP}`"),
                )
            })?),
        };
        if self.field(CALIBRATE).is_ok() {
            return self.calibrated(&case, name, bytes);
        }
        if self.field(IMAGE).is_ok() {
            let images = ImageData::of_bytes(name, bytes)?;
            let shown = self.states_of_image(&case, name, images);
            return shown.or_else(|error| self.waiting_image(error));
        }
        let options = |study| study_named(study).map_or_else(Map::new, |entry| self.options(entry));
        let of_fit = options(FitStudy::NAME);
        let mut named = object(json!({ "data": [name] }));
        if self.field("reconstruct").is_ok() {
            let mut of_curve = options(ReconstructStudy::NAME);
            // The form has the fit's default where both studies have an option.
            let given = |name: &String| of_fit.contains_key(name);
            let fitted = serde_json::to_value(FitOptions::default()).unwrap_or_default();
            of_curve.retain(|name, _| fitted.get(name).is_none() || given(name));
            let mut request: ReconstructOptions = read(Value::Object(of_curve.clone()))?;
            request.data = vec![Table::of_bytes(name, bytes, number)?];
            named.extend(of_curve);
            return self.reconstructed(&case, &request, &named);
        }
        let mut request: FitOptions = read(Value::Object(of_fit.clone()))?;
        named.extend(of_fit);
        let fits = self.field("fit").is_ok();
        if fits && is_map {
            let map = request.of_map(name, files::read(name, bytes)?)?;
            return self.fitted_pixels(&case, &map, named);
        }
        if let Some(number) = number {
            named.insert(CURVE.into(), number.into());
        }
        if !fits {
            let noise = bytes.clone();
            let images = ImageData::of_bytes(name, bytes.clone()).ok();
            let shown = Table::of_bytes(name, bytes, number)
                .map_err(ApiError::of)
                .and_then(|table| {
                    request.data = vec![table];
                    self.over_model(&case, &request, &named, images.is_some())
                });
            // What is no curve may be images, or the thermal noise of a lever.
            return shown.or_else(|error| {
                if let Some(images) = images {
                    let shown = self.states_of_image(&case, name, images);
                    return shown.or_else(|error| self.waiting_image(error));
                }
                let calibrated = self.calibrated(&case, name, noise);
                calibrated.map_err(|_| error)
            });
        }
        request.data = vec![Table::of_bytes(name, bytes, number)?];
        if !request.pixels.is_empty() {
            return self.fitted_pixels(&case, &request, named);
        }
        let report = self.counting(FitStudy::COUNTED, |control| {
            FitStudy::run(&case, &request, control)
        })?;
        let found = Source {
            name: CASE_FILE.to_owned(),
            text: report.case_file.clone(),
        };
        let set = Case::parse(Some(found), &[]).map(|found| report::changes(&case, &found));
        let found = NextStep {
            set: set.ok(),
            take: "Use these values",
            file: report.case_file.clone(),
            save: "Case file of the fit",
            name: "best.toml",
        };
        let notes = report.reason.iter().chain(&report.remarks);
        let notes: Vec<&str> = notes.map(String::as_str).collect();
        let fits = if report.fits {
            "The model describes the data."
        } else {
            "The model does not describe the data."
        };
        let shown = [
            force_curve_table(&report.force_curves),
            report.parameter_table(),
        ];
        let filled = shown.iter().filter(|table| table.rows > 0);
        let tables = filled.map(|table| report::of_frame("", table)).collect();
        self.hand(Stage {
            figure: Some(fit_figure(&report)),
            words: format!("{fits} {}", notes.join(". ")).trim_end().to_owned(),
            studies: &[("fit", &named)],
            tables,
            found: Some(found),
            ..Stage::default()
        })
    }

    /// The fits of a force volume, one a pixel.
    fn fitted_pixels(
        &self,
        case: &Case,
        request: &FitOptions,
        mut named: Map<String, Value>,
    ) -> Result<(), ApiError> {
        let entry = study_named(FitStudy::NAME)
            .ok_or_else(|| ApiError::failed("this program has no fit"))?;
        let plan = |control: &Control<'_>| FitMap::prepare(case, request, control);
        let map = self.whole_dataset(entry, plan)?;
        named.insert("out".into(), "fit.zarr".into());
        self.hand(Stage {
            figure: map.figure(),
            words: "One fit a pixel.".to_owned(),
            studies: &[(FitStudy::NAME, &named)],
            tables: (map.frames().iter())
                .map(|frame| report::of_frame("", frame))
                .collect(),
            ..Stage::default()
        })
    }

    /// Force and dissipation of measured data, without a contact law.
    fn reconstructed(
        &self,
        case: &Case,
        request: &ReconstructOptions,
        named: &Map<String, Value>,
    ) -> Result<(), ApiError> {
        let report = self.counting(ReconstructStudy::COUNTED, |control| {
            ReconstructStudy::run(case, request, control)
        })?;
        let method = match report.method {
            ReconstructMethod::AmplitudeModulation => "amplitude and phase",
            ReconstructMethod::FrequencyModulation => "frequency shift",
        };
        let set = self.table_law(case, &report);
        let negative = report
            .table
            .damping
            .iter()
            .any(|damping| damping.is_some_and(|value| value < 0.0));
        let none = "as a law the force has no damping where it is negative";
        let notes = report.remarks.iter().map(String::as_str);
        let notes = notes.chain((set.is_some() && negative).then_some(none));
        let mut words = format!("Force from {method} of {} rows", report.rows.len());
        for note in notes {
            let _ = write!(words, "; {note}");
        }
        self.hand(Stage {
            figure: Some(reconstruct_figure(&report)),
            words,
            studies: &[(ReconstructStudy::NAME, named)],
            tables: vec![report::of_frame("", &report.summary_table())],
            found: Some(NextStep {
                set,
                take: "Use as the sample's force table",
                file: report.force_table().csv(),
                save: "Force curve (CSV)",
                name: "force.csv",
            }),
            ..Stage::default()
        })
    }

    /// The changes to the case that take a reconstructed force as its contact law, where it can.
    fn table_law(&self, case: &Case, report: &ReconstructReport) -> Option<Map<String, Value>> {
        let change = case.law_change("table", case).ok()?;
        let mut set = object(json!({ Key::SampleLaw.path(): change.law }));
        for key in &change.dropped {
            set.insert(key.path().into(), "".into());
        }
        let force = Table::parse("the reconstructed force", &report.force_table().csv()).ok()?;
        let force = ForceTable::of(&force).ok()?.text();
        set.insert(Key::SampleTable.path().into(), force.into());
        let mut spec = self.request.case.clone();
        for (key, text) in &set {
            spec.put(Key::find(key)?, text.as_str()?);
        }
        let taken = spec.any_distance(self.app).ok()?;
        taken.model().is_ok().then_some(set)
    }

    /// Measured data over the model's curve, where they are of the distance; otherwise alone.
    fn over_model(
        &self,
        case: &Case,
        request: &FitOptions,
        named: &Map<String, Value>,
        has_images: bool,
    ) -> Result<(), ApiError> {
        let data = measured(case, request)?;
        let swept = data.swept.first().map(|swept| swept.key);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for row in data.rows() {
            let at = row.at.first().copied().unwrap_or(f64::NAN);
            (low, high) = (low.min(at), high.max(at));
        }
        let length = |value: f64| Kind::Length.format_exact(value);
        let distance = swept == Some(Key::GapTip)
            && case.is_physical()
            && low < high
            && !data.is_force_curve();
        let mut scales = Vec::new();
        let (mut figure, factor) = if distance {
            let options =
                object(json!({ "points": APPROACH[0], "from": length(high), "to": length(low) }));
            let report = self.report::<ApproachStudy>(case, &options)?;
            let Approached { figure, axis, .. } = Approached::of(case, &report);
            (figure, axis.factor)
        } else {
            let scaled = |kind: Option<Kind>, most: f64| match kind {
                Some(kind) if case.is_physical() && kind != Kind::Number => {
                    prefixed(kind, 1.0, most)
                }
                _ => (1.0, String::new()),
            };
            let (factor, unit) = scaled(swept.map(Key::kind), low.abs().max(high.abs()));
            let label = swept.map_or("", Key::path);
            let mut figure = Figure::new(1, data.columns.len());
            for (k, column) in data.columns.iter().enumerate() {
                let known = data.rows().filter_map(|row| *row.values.get(k)?);
                let most = known.fold(0.0, |most: f64, value| most.max(value.abs()));
                let (scale, of_column) = scaled(column.quantity.kind(), most);
                scales.push(scale);
                let x = Axes::linear(label).unit(unit.clone());
                let y = Axes::linear(column.name.clone()).unit(of_column);
                figure = figure.with(Panel::new(x, y));
            }
            (figure, factor)
        };
        let heights = Height::of(&figure, &APPROACH_SHOWS);
        let mut left = Vec::new();
        for (k, column) in data.columns.iter().enumerate() {
            let place = if distance {
                heights
                    .iter()
                    .position(|height| height.is(column.quantity.name()))
            } else {
                Some(k)
            };
            let Some(panel) = place.and_then(|place| figure.panels.get_mut(place)) else {
                left.push(column.name.as_str());
                continue;
            };
            let drawn = |value: f64| match place.and_then(|place| heights.get(place)) {
                Some(height) if distance => height.of_measured(value),
                _ => value * scales.get(k).copied().unwrap_or(1.0),
            };
            let points = data.rows().filter_map(|row| {
                let value = (*row.values.get(k)?)?;
                Some((factor * row.at.first()?, drawn(value)))
            });
            let markers = Markers::new(points)
                .open()
                .colour(Colour::BLACK)
                .label("measured");
            panel.layers.push(markers.into());
        }
        let mut words = format!("{} rows.", data.rows().count());
        if !left.is_empty() {
            words.push_str(" Not drawn: ");
            words.push_str(&left.join(", "));
        }
        self.hand(Stage {
            figure: Some(figure),
            words,
            studies: &[("fit", named)],
            has_images,
            ..Stage::default()
        })
    }
}
